//! Laws of a walk over a link that loses and delays samples, against a model of the robot's sport service.

#[path = "support/dog.rs"]
mod dog;

use std::collections::VecDeque;

use dog::*;
use proptest::prelude::*;
use robot_link::unitree::session::{Limits, SessionConfig};
use robot_link::unitree::*;

/// One direction of the link: samples with the time at which they arrive; some never do.
struct Way {
    samples: VecDeque<(i64, Vec<u8>)>,
    delay_ns: i64,
    loss: f64,
    state: u64,
}

impl Way {
    fn new(loss: f64, delay_ns: i64, seed: u64) -> Way {
        Way { samples: VecDeque::new(), delay_ns, loss, state: seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1 }
    }

    fn send(&mut self, now_ns: i64, sample: Vec<u8>) {
        self.state = self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        if (self.state >> 11) as f64 / (1u64 << 53) as f64 >= self.loss {
            self.samples.push_back((now_ns + self.delay_ns, sample));
        }
    }

    fn arrived(&mut self, now_ns: i64) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        while self.samples.front().is_some_and(|(at_ns, _)| *at_ns <= now_ns) {
            out.extend(self.samples.pop_front().map(|(_, sample)| sample));
        }
        out
    }
}

struct Walk {
    session: WalkSession,
    dog: ModelDog,
    up: Way,
    answers: Way,
    states: Way,
    now_ns: i64,
    /// What the session sent, with its time.
    sent: Vec<(i64, i64)>,
    velocity: Option<Velocity>,
    is_silent: bool,
}

const FORWARD: Velocity = Velocity { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: 0.0 };

impl Walk {
    fn new(loss: f64, delay_ns: i64, seed: u64) -> Walk {
        Walk {
            session: WalkSession::new(SessionConfig { first_id: 1000, ..SessionConfig::default() }).expect("sound"),
            dog: ModelDog::new(),
            up: Way::new(loss, delay_ns, seed),
            answers: Way::new(loss, delay_ns, seed + 1),
            states: Way::new(loss, delay_ns, seed + 2),
            now_ns: 0,
            sent: Vec::new(),
            velocity: None,
            is_silent: false,
        }
    }

    fn over_a_good_link() -> Walk {
        Walk::new(0.0, MS, 1)
    }

    /// Goes on for a time in steps of 5 ms; a new command every 20 ms, a state every 20 ms.
    fn go_on(&mut self, seconds: f64) {
        let end_ns = self.now_ns + (seconds * 1e9) as i64;
        while self.now_ns < end_ns {
            self.now_ns += 5 * MS;
            let now_ns = self.now_ns;
            for payload in self.up.arrived(now_ns) {
                if let Some(answer) = self.dog.receive(now_ns, &payload) {
                    self.answers.send(now_ns, answer);
                }
            }
            if now_ns % (20 * MS) == 0 {
                let state = self.dog.step(now_ns);
                if !self.is_silent {
                    self.states.send(now_ns, state);
                }
                if let Some(velocity) = &self.velocity {
                    self.session.drive(now_ns, velocity).expect("finite");
                }
            }
            for payload in self.states.arrived(now_ns) {
                self.session.receive_state(now_ns, &payload);
            }
            for payload in self.answers.arrived(now_ns) {
                self.session.receive_response(now_ns, &payload);
            }
            self.session.advance(now_ns);
            for request in self.session.take_requests() {
                self.sent.push((now_ns, request.api_id));
                self.up.send(now_ns, request.to_cdr());
            }
        }
    }

    fn walking() -> Walk {
        let mut walk = Walk::over_a_good_link();
        walk.go_on(0.1);
        walk.session.walk(walk.now_ns);
        walk.go_on(4.0);
        assert_eq!((walk.session.phase(), walk.session.fault()), (Phase::Walking, None));
        walk.velocity = Some(FORWARD);
        walk.go_on(2.0);
        walk
    }

    fn count(&self, api_id: i64) -> usize {
        self.sent.iter().filter(|(_, sent)| *sent == api_id).count()
    }

    fn last(&self, api_id: i64) -> Option<i64> {
        self.sent.iter().rev().find(|(_, sent)| *sent == api_id).map(|(at_ns, _)| *at_ns)
    }
}

#[test]
fn from_its_belly_to_its_belly() {
    let mut walk = Walk::over_a_good_link();
    walk.velocity = Some(FORWARD);
    walk.go_on(0.5);
    assert_eq!((walk.session.phase(), walk.sent.len()), (Phase::Ready, 0), "nothing is asked unasked");
    walk.session.walk(walk.now_ns);
    walk.go_on(6.0);
    let from = walk.dog.count(MOVE);
    walk.go_on(2.0);
    assert_eq!(walk.dog.count(MOVE) - from, 40, "20 Hz");
    assert!(walk.dog.position[0] > 1.0);
    walk.session.lie_down(walk.now_ns);
    walk.go_on(4.0);
    assert_eq!((walk.session.phase(), walk.session.fault()), (Phase::Down, None));
    assert!(walk.session.is_over() && walk.dog.height_m < 0.1);
    assert_eq!(walk.dog.violations, [""; 0]);
    let others: Vec<i64> = walk.sent.iter().map(|(_, api)| *api).filter(|api| *api != MOVE).collect();
    assert_eq!(others, [UP, BALANCE, STOP, DOWN]);
}

#[test]
fn a_robot_that_ignores_move_for_a_while_is_given_time_and_one_that_never_moves_is_not() {
    for (deaf_s, fails) in [(10, false), (100, true)] {
        let mut walk = Walk::over_a_good_link();
        walk.dog.deaf_ns = deaf_s * 1000 * MS;
        walk.go_on(0.1);
        walk.session.walk(walk.now_ns);
        walk.velocity = Some(FORWARD);
        walk.go_on(25.0);
        assert_eq!(matches!(walk.session.fault(), Some(Fault::NotMoving { .. })), fails, "{:?}", walk.session.fault());
        assert_eq!(walk.dog.mode, if fails { 7 } else { 3 });
        assert_eq!(walk.dog.violations, [""; 0]);
    }
}

#[test]
fn a_robot_that_is_held_still_on_purpose_is_not_found_to_be_stuck() {
    let mut walk = Walk::walking();
    walk.velocity = Some(Velocity::default());
    walk.go_on(30.0);
    assert_eq!(walk.session.fault(), None);
}

#[test]
fn without_commands_it_is_stopped_and_goes_on_when_they_come_back() {
    let mut walk = Walk::walking();
    let silent_ns = walk.now_ns;
    walk.velocity = None;
    walk.go_on(5.0);
    assert!(walk.last(MOVE).is_some_and(|at_ns| at_ns <= silent_ns + 200 * MS));
    assert!(walk.last(STOP).is_some_and(|at_ns| at_ns <= silent_ns + 200 * MS));
    assert_eq!((walk.count(STOP), walk.session.phase()), (1, Phase::Walking));
    walk.velocity = Some(FORWARD);
    walk.go_on(1.0);
    assert!(walk.last(MOVE).is_some_and(|at_ns| at_ns + 60 * MS >= walk.now_ns));
}

#[test]
fn a_silent_robot_is_stopped_and_then_damped() {
    // Silent, or saying the same again and again.
    for is_frozen in [false, true] {
        let mut walk = Walk::walking();
        (walk.is_silent, walk.dog.is_frozen) = (!is_frozen, is_frozen);
        let silent_ns = walk.now_ns;
        walk.go_on(3.0);
        assert!(walk.last(MOVE).is_some_and(|at_ns| at_ns <= silent_ns + 200 * MS));
        assert!(matches!(walk.session.fault(), Some(Fault::LinkLost { .. })));
        assert_eq!((walk.count(STOP), walk.count(DAMP), walk.dog.mode), (1, 1, 7));
        assert!(walk.session.is_over());
    }
}

#[test]
fn an_operator_keeps_the_robot() {
    let mut walk = Walk::walking();
    walk.dog.mode = 7;
    let sent = walk.count(DAMP) + walk.count(DOWN);
    // The mode stays when a Move is still on its way.
    walk.dog.answers = vec![(MOVE, 3205)];
    walk.go_on(0.1);
    let moves = walk.count(MOVE);
    walk.go_on(3.0);
    assert_eq!(walk.session.fault(), Some(&Fault::TakenOver { mode: SportMode(7) }));
    assert_eq!((walk.count(DAMP) + walk.count(DOWN), walk.count(MOVE)), (sent, moves));
}

#[test]
fn lies_end_the_walk() {
    type Lie = (fn(&mut ModelDog), fn(&Fault) -> bool);
    let lies: [Lie; 2] = [
        (|dog| dog.position[0] += 5.0, |fault| matches!(fault, Fault::Jumped { jump_m } if *jump_m > 4.0)),
        (|dog| dog.position[0] = f64::NAN, |fault| matches!(fault, Fault::LinkLost { .. })),
    ];
    for (spoil, is_it) in lies {
        let mut walk = Walk::walking();
        spoil(&mut walk.dog);
        walk.go_on(2.0);
        assert!(walk.session.fault().is_some_and(is_it), "{:?}", walk.session.fault());
        assert_eq!(walk.dog.mode, 7, "damped");
    }
    let mut walk = Walk::walking();
    let before = walk.session.bad_payloads();
    walk.session.receive_state(walk.now_ns, &[0, 1, 0, 0, 1]);
    walk.session.receive_response(walk.now_ns, &[9; 40]);
    assert_eq!((walk.session.bad_payloads(), walk.session.fault()), (before + 2, None));
}

#[test]
fn every_refusal_is_named() {
    let outcomes = [3102, 3103, 3104, 3105, 3106, 3203, 3204, 3205, 4101, 4201, 4202];
    for (code, api_id, step) in outcomes.iter().flat_map(|code| {
        [(UP, Step::StandUp), (BALANCE, Step::BalanceStand)].map(|(api_id, step)| (*code, api_id, step))
    }) {
        let mut walk = Walk::over_a_good_link();
        walk.dog.answers = vec![(api_id, code)];
        walk.go_on(0.1);
        walk.session.walk(walk.now_ns);
        walk.go_on(8.0);
        assert_eq!(walk.session.fault(), Some(&Fault::Refused { step, outcome: Outcome::of(code) }));
        let asked = walk.count(api_id);
        assert_eq!(asked, if Outcome::of(code).is_passing() { 4 } else { 1 }, "{code}");
        assert_eq!((walk.count(MOVE), walk.dog.mode), (0, 7));
        assert!(Outcome::of(code).to_string().contains(&code.to_string()));
    }
}

#[test]
fn who_does_not_answer_is_asked_so_often_and_no_more() {
    let mut walk = Walk::over_a_good_link();
    walk.dog.is_mute = true;
    walk.go_on(0.1);
    walk.session.walk(walk.now_ns);
    walk.go_on(20.0);
    assert_eq!(walk.session.fault(), Some(&Fault::Unanswered { step: Step::StandUp, times: 4 }));
    assert_eq!((walk.count(UP), walk.count(DAMP), walk.sent.len()), (4, 4, 8));
    assert!(walk.session.is_over());
}

#[test]
fn numbers_of_a_session_are_checked() {
    let with = |change: fn(&mut SessionConfig)| {
        let mut config = SessionConfig::default();
        change(&mut config);
        WalkSession::new(config).err()
    };
    assert_eq!(with(|_| {}), None);
    assert_eq!(with(|config| config.fresh_ns = 500 * MS), Some(SessionError::Deaf));
    assert_eq!(with(|config| config.blind_ns = 500 * MS), Some(SessionError::Deaf));
    assert_eq!(with(|config| config.lost_ns = 0), Some(SessionError::Numbers));
    assert_eq!(with(|config| config.standing_m = f64::NAN), Some(SessionError::Numbers));
    assert_eq!(with(|config| config.limits.lateral_mps = -1.0), Some(SessionError::Numbers));
    assert_eq!(with(|config| config.retry.max_sent = 0), Some(SessionError::Numbers));
}

#[derive(Debug, Clone)]
enum Event {
    Walk,
    LieDown,
    Drive(f64, f64, f64),
    NoCommands,
    Silence(bool),
    Mute(bool),
    Answer(i64, i32),
    Mode(u8),
    Jump(f64),
    Noise(Vec<u8>),
    Wait(f64),
}

fn event() -> impl Strategy<Value = Event> {
    let speed = || prop_oneof![Just(0.0), -5.0..5.0f64];
    let function = prop_oneof![Just(UP), Just(BALANCE), Just(STOP), Just(DOWN), Just(DAMP), Just(MOVE)];
    let code = prop_oneof![Just(0), Just(3104), Just(3203), Just(4202), any::<i32>()];
    prop_oneof![
        4 => Just(Event::Walk),
        1 => Just(Event::LieDown),
        6 => (speed(), speed(), speed()).prop_map(|(x, y, z)| Event::Drive(x, y, z)),
        2 => Just(Event::NoCommands),
        1 => any::<bool>().prop_map(Event::Silence),
        1 => any::<bool>().prop_map(Event::Mute),
        1 => (function, code).prop_map(|(function, code)| Event::Answer(function, code)),
        1 => (0..11u8).prop_map(Event::Mode),
        1 => (-3.0..3.0f64).prop_map(Event::Jump),
        1 => prop::collection::vec(any::<u8>(), 0..80).prop_map(Event::Noise),
        6 => (0.0..6.0f64).prop_map(Event::Wait),
    ]
}

/// No gap in the numbers, order, limits, silence, faults: what holds whatever happens.
fn check_laws(walk: &Walk, faulted_ns: Option<i64>, commands: &[(i64, bool)]) -> Result<(), TestCaseError> {
    let limits = SessionConfig::default().limits;
    let first = |api_id: i64| walk.sent.iter().position(|(_, sent)| *sent == api_id).unwrap_or(usize::MAX);
    if first(MOVE) != usize::MAX {
        prop_assert!(first(UP) < first(BALANCE) && first(BALANCE) < first(MOVE));
    }
    for api_id in [UP, BALANCE, DOWN, DAMP] {
        prop_assert!(walk.count(api_id) <= 4, "{api_id} was sent {} times", walk.count(api_id));
    }
    let mut last_move_ns = i64::MIN / 2;
    for (at_ns, _) in walk.sent.iter().filter(|(_, api_id)| *api_id == MOVE) {
        prop_assert!(faulted_ns.is_none_or(|fault_ns| *at_ns < fault_ns), "Move after a fault");
        prop_assert!(at_ns - last_move_ns >= 45 * MS, "faster than 20 Hz");
        last_move_ns = *at_ns;
        // The newest change of the commands: were there any in the last 200 ms?
        let before = commands.iter().rev().find(|(since_ns, _)| since_ns < at_ns);
        let is_led = before.is_some_and(|(since_ns, is_on)| *is_on || at_ns - since_ns <= 200 * MS);
        prop_assert!(is_led, "Move at {at_ns} without a command");
    }
    for (_, request) in walk.dog.requests.iter().filter(|(_, request)| request.api_id == MOVE) {
        let Limits { forward_mps, backward_mps, lateral_mps, yaw_rate_radps } = limits;
        let numbers: Vec<f64> =
            request.parameter.split([':', ',', '}']).filter_map(|part| part.trim().parse().ok()).collect();
        prop_assert!((-backward_mps..=forward_mps).contains(&numbers[0]));
        prop_assert!(numbers[1].abs() <= lateral_mps && numbers[2].abs() <= yaw_rate_radps);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn laws_hold_whatever_happens(
        events in prop::collection::vec(event(), 1..14),
        loss in prop_oneof![Just(0.0), 0.0..0.5f64],
        delay_ms in 0..40i64,
        seed in 0..1000u64,
    ) {
        let mut walk = Walk::new(loss, delay_ms * MS, seed);
        let (mut faulted_ns, mut commands) = (None, Vec::new());
        walk.go_on(0.3);
        for event in events {
            let now_ns = walk.now_ns;
            match event {
                Event::Walk => walk.session.walk(now_ns),
                Event::LieDown => walk.session.lie_down(now_ns),
                Event::Drive(forward_mps, left_mps, yaw_rate_radps) => {
                    walk.velocity = Some(Velocity { forward_mps, left_mps, yaw_rate_radps });
                    commands.push((now_ns, true));
                }
                Event::NoCommands => {
                    walk.velocity = None;
                    commands.push((now_ns, false));
                }
                Event::Silence(is_silent) => walk.is_silent = is_silent,
                Event::Mute(is_mute) => walk.dog.is_mute = is_mute,
                Event::Answer(function, code) => walk.dog.answers.push((function, code)),
                Event::Mode(mode) => walk.dog.mode = mode,
                Event::Jump(by) => walk.dog.position[0] += by,
                Event::Noise(bytes) => {
                    walk.session.receive_state(now_ns, &bytes);
                    walk.session.receive_response(now_ns, &bytes);
                }
                Event::Wait(seconds) => {
                    // In small pieces: a fault is seen as soon as it is there.
                    let pieces = (seconds / 0.05) as usize;
                    for _ in 0..pieces {
                        let before = walk.session.fault().copied();
                        walk.go_on(0.05);
                        if before.is_none() && walk.session.fault().is_some() {
                            faulted_ns.get_or_insert(walk.now_ns);
                        }
                    }
                }
            }
            if walk.session.fault().is_some() {
                faulted_ns.get_or_insert(walk.now_ns);
            }
        }
        check_laws(&walk, faulted_ns, &commands)?;
        // Whatever it was: it comes to an end by itself when it is told to, with a bounded number of requests.
        walk.velocity = None;
        walk.session.lie_down(walk.now_ns);
        walk.go_on(60.0);
        prop_assert!(walk.session.is_over(), "{:?}", walk.session.phase());
    }

    /// At rates of our own looking between 1 and 50 ms: no Move later than 200 ms after the last command or the last state.
    #[test]
    fn silence_stops_it_within_200_ms(step_ms in 1..50i64, is_ours in any::<bool>()) {
        let mut walk = Walk::walking();
        let silent_ns = walk.now_ns;
        let mut sent = Vec::new();
        for step in 1..=(2000 / step_ms) {
            let now_ns = silent_ns + step * step_ms * MS;
            if is_ours {
                let state = walk.dog.step(now_ns);
                walk.session.receive_state(now_ns, &state);
            } else {
                walk.session.drive(now_ns, &FORWARD).expect("finite");
            }
            walk.session.advance(now_ns);
            sent.extend(walk.session.take_requests().iter().map(|request| (now_ns, request.api_id)));
        }
        let limit_ns = silent_ns + 200 * MS;
        prop_assert!(sent.iter().all(|(at_ns, api_id)| *api_id != MOVE || *at_ns <= limit_ns), "{sent:?}");
        let stop = sent.iter().find(|(_, api_id)| *api_id == STOP);
        prop_assert!(stop.is_some_and(|(at_ns, _)| *at_ns <= limit_ns), "{stop:?}");
    }
}
