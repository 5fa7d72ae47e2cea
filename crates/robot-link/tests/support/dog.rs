//! A model of a walking robot's sport service, written from the makers' rules and not from the session's code: it judges what it is sent.

#![allow(dead_code)] // every test takes what it needs

use robot_link::unitree::{Request, Response, SportModeState};

pub const MS: i64 = 1_000_000;

pub const DAMP: i64 = 1001;
pub const BALANCE: i64 = 1002;
pub const STOP: i64 = 1003;
pub const UP: i64 = 1004;
pub const DOWN: i64 = 1005;
pub const MOVE: i64 = 1008;

/// The robot: a unicycle with side steps that lies on its belly at first.
pub struct ModelDog {
    pub position: [f64; 2],
    pub yaw_rad: f64,
    pub height_m: f64,
    pub mode: u8,
    pub velocity: [f64; 3],
    /// Answers to a function, 0 unless set.
    pub answers: Vec<(i64, i32)>,
    /// No answers at all.
    pub is_mute: bool,
    /// For so long after it stood up it ignores `Move`.
    pub deaf_ns: i64,
    /// The same state again and again.
    pub is_frozen: bool,
    /// Requests received, with their times.
    pub requests: Vec<(i64, Request)>,
    /// Rules that were broken.
    pub violations: Vec<String>,
    up_ns: i64,
    commanded: Option<(i64, [f64; 3])>,
    now_ns: i64,
    stamp_ns: i64,
}

impl ModelDog {
    pub fn new() -> ModelDog {
        ModelDog {
            position: [0.0; 2],
            yaw_rad: 0.0,
            height_m: 0.08,
            mode: 5,
            velocity: [0.0; 3],
            answers: Vec::new(),
            is_mute: false,
            deaf_ns: 0,
            is_frozen: false,
            requests: Vec::new(),
            violations: Vec::new(),
            up_ns: i64::MIN / 2,
            commanded: None,
            now_ns: 0,
            stamp_ns: 0,
        }
    }

    /// Takes a payload; what it answers.
    pub fn receive(&mut self, now_ns: i64, payload: &[u8]) -> Option<Vec<u8>> {
        let request = Request::from_cdr(payload).expect("requests are plain CDR");
        let Request { id, api_id, no_reply, .. } = request;
        if self.requests.iter().any(|(_, earlier)| earlier.id == id) {
            self.violations.push(format!("the number {id} came twice"));
        }
        self.check_order(api_id);
        let code = self.answers.iter().find(|(function, _)| *function == api_id).map_or(0, |(_, code)| *code);
        if code == 0 {
            self.obey(now_ns, api_id, &request.parameter);
        }
        self.requests.push((now_ns, request));
        let response = Response { id, api_id, code, ..Response::default() };
        (!self.is_mute && !no_reply).then(|| response.to_cdr())
    }

    fn check_order(&mut self, api_id: i64) {
        let was = |function: i64| self.requests.iter().any(|(_, earlier)| earlier.api_id == function);
        let broken = [
            (api_id == MOVE && !matches!(self.mode, 1 | 3), "Move before it balances"),
            (api_id == MOVE && was(DOWN), "Move after it was told to lie down"),
            (api_id != DAMP && was(DAMP), "something other than Damp after Damp"),
            (api_id == BALANCE && self.height_m < 0.2, "BalanceStand before it stands"),
            (api_id == DOWN && self.velocity.iter().any(|v| v.abs() > 0.2), "StandDown while it walks"),
        ];
        self.violations.extend(broken.iter().filter(|(is_broken, _)| *is_broken).map(|(_, rule)| (*rule).to_owned()));
    }

    fn obey(&mut self, now_ns: i64, api_id: i64, parameter: &str) {
        match api_id {
            UP => (self.mode, self.up_ns) = (6, now_ns),
            BALANCE => self.mode = 1,
            STOP => self.commanded = None,
            DOWN => (self.mode, self.commanded) = (5, None),
            DAMP => (self.mode, self.commanded) = (7, None),
            MOVE => {
                let numbers: Vec<f64> =
                    parameter.split([':', ',', '}']).filter_map(|part| part.trim().parse().ok()).collect();
                let [x, y, z] = numbers[..] else { panic!("three numbers in {parameter}") };
                self.commanded = Some((now_ns, [x, y, z]));
                self.mode = 3;
            }
            _ => self.violations.push(format!("the function {api_id}")),
        }
    }

    /// Goes on to `now_ns`; its state then.
    pub fn step(&mut self, now_ns: i64) -> Vec<u8> {
        let dt_s = (now_ns - self.now_ns) as f64 * 1e-9;
        self.now_ns = now_ns;
        let height_m = if matches!(self.mode, 5 | 7) { 0.08 } else { 0.3 };
        self.height_m += (height_m - self.height_m).clamp(-0.3 * dt_s, 0.3 * dt_s);
        // A Move drives for a second; then it stands.
        let is_deaf = now_ns - self.up_ns < self.deaf_ns;
        let wanted = self.commanded.filter(|(at_ns, _)| now_ns - at_ns < 1000 * MS && !is_deaf);
        let wanted = wanted.map_or([0.0; 3], |(_, velocity)| velocity);
        for (v, wanted) in self.velocity.iter_mut().zip(wanted) {
            *v += (wanted - *v).clamp(-3.0 * dt_s, 3.0 * dt_s);
        }
        let [forward, left, turn] = self.velocity;
        let (sin, cos) = self.yaw_rad.sin_cos();
        self.position[0] += (cos * forward - sin * left) * dt_s;
        self.position[1] += (sin * forward + cos * left) * dt_s;
        self.yaw_rad += turn * dt_s;
        if !self.is_frozen {
            self.stamp_ns = now_ns;
        }
        self.state().to_cdr()
    }

    pub fn state(&self) -> SportModeState {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [forward, left, turn] = self.velocity;
        let mut state = SportModeState {
            stamp_s: (self.stamp_ns / 1_000_000_000) as i32,
            stamp_ns: (self.stamp_ns % 1_000_000_000) as u32,
            mode: self.mode,
            position: [self.position[0] as f32, self.position[1] as f32, self.height_m as f32],
            body_height_m: self.height_m as f32,
            velocity: [(cos * forward - sin * left) as f32, (sin * forward + cos * left) as f32, 0.0],
            yaw_speed_radps: turn as f32,
            ..SportModeState::default()
        };
        state.imu.quaternion = [(self.yaw_rad / 2.0).cos() as f32, 0.0, 0.0, (self.yaw_rad / 2.0).sin() as f32];
        state
    }

    /// How often a function was asked for.
    pub fn count(&self, api_id: i64) -> usize {
        self.requests.iter().filter(|(_, request)| request.api_id == api_id).count()
    }
}
