//! A whole walk as a state machine: no socket, no clock, no thread.
//!
//! ```text
//! Waiting --a state is heard--> Ready --walk()--> Starting --up, balancing--> Walking --lie_down()--> LyingDown --> Down
//!                                      StandUp, BalanceStand       Move at 20 Hz       StopMove, StandDown
//! any of these --fault--> Ended: Damp until it is answered, never Move again
//! ```
//!
//! The caller owns transport and clock: it gives the payload of every sample to [`receive_state`](WalkSession::receive_state) or
//! [`receive_response`](WalkSession::receive_response), calls [`advance`](WalkSession::advance) every few milliseconds with the time, and
//! sends what [`take_requests`](WalkSession::take_requests) returns. Rules that hold whatever arrives:
//!
//! - Nothing is asked of a robot before [`walk`](WalkSession::walk), and no `Move` before it stood up and balanced, as its answers say and
//!   its state shows.
//! - `Move` goes out while the last command is younger than [`SessionConfig::fresh_ns`] and the last state younger than
//!   [`SessionConfig::blind_ns`]; otherwise `StopMove`, until it is answered or the tries are used up.
//! - A robot that does not move though it is told to is found out by its odometry: after `StandUp` it may ignore `Move` for 4-10 s and
//!   answer "done".
//! - After a fault there is no `Move`. The robot is damped, unless somebody else has it, or nothing was ever asked of it.
//!
//! What the state's `error_code` means differs between firmwares and is written nowhere: it is not judged.

mod fault;

pub use fault::{Fault, Step};

use crate::unitree::call::{CallInFlight, RetryConfig, Verdict};
use crate::unitree::message::{Request, Response, SportModeState};
use crate::unitree::progress::Progress;
use crate::unitree::sport::{Call, CallError, Outcome};
use crate::unitree::walker::{SportMode, WalkerState};

/// Times and limits of a session. All times in nanoseconds of the caller's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionConfig {
    /// Number of the first request; the next ones follow. Unlike those of an earlier session: a clock will do.
    pub first_id: i64,
    /// Between `Move`s (50 ms).
    pub move_period_ns: i64,
    /// A command is followed for this long (150 ms).
    pub fresh_ns: i64,
    /// Without a state for so long the robot is told to stand still (150 ms).
    pub blind_ns: i64,
    /// Without a state for so long the link is lost (1 s).
    pub lost_ns: i64,
    /// What was answered with "done" must show in the state within this (10 s).
    pub confirm_ns: i64,
    /// A robot that got up stands for this long before it is asked for more (1 s).
    pub settle_ns: i64,
    /// A robot may ignore `Move` for this long (15 s; 4-10 s after `StandUp` were seen).
    pub ignored_ns: i64,
    /// Body heights from here on are standing (0.2 m: a Go2 stands at 0.3 and lies at 0.1).
    pub standing_m: f64,
    /// Limits of what is asked.
    pub limits: Limits,
    /// Sending again.
    pub retry: RetryConfig,
}

/// The fastest that is asked of the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Forward (1.0, for indoors).
    pub forward_mps: f64,
    /// Backward (0.5).
    pub backward_mps: f64,
    /// To either side (0.5).
    pub lateral_mps: f64,
    /// Either way round (1.4).
    pub yaw_rate_radps: f64,
}

impl Default for SessionConfig {
    fn default() -> Self {
        const MS: i64 = 1_000_000;
        Self {
            first_id: 1,
            move_period_ns: 50 * MS,
            fresh_ns: 150 * MS,
            blind_ns: 150 * MS,
            lost_ns: 1_000 * MS,
            confirm_ns: 10_000 * MS,
            settle_ns: 1_000 * MS,
            ignored_ns: 15_000 * MS,
            standing_m: 0.2,
            limits: Limits { forward_mps: 1.0, backward_mps: 0.5, lateral_mps: 0.5, yaw_rate_radps: 1.4 },
            retry: RetryConfig::default(),
        }
    }
}

/// Why a session was not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// A time, height or limit is not positive or not finite.
    #[error("times, heights and limits of a session must be positive and finite, and a call be sent once at least")]
    Numbers,
    /// Silence would be noticed too late.
    #[error("a command may be followed for 200 ms at most, and a robot not be heard for as long")]
    Deaf,
}

/// A velocity in the body.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Velocity {
    /// Forward.
    pub forward_mps: f64,
    /// To the left.
    pub left_mps: f64,
    /// Counter-clockwise from above.
    pub yaw_rate_radps: f64,
}

/// Where a session stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// No sound state was heard yet.
    Waiting,
    /// The robot is heard; nothing is asked of it.
    Ready,
    /// It stands up.
    Starting,
    /// It follows our commands, and stands still without.
    Walking,
    /// It stops and lies down.
    LyingDown,
    /// It lies, and that was wanted.
    Down,
    /// Over, for the reason that [`WalkSession::fault`] gives.
    Ended,
}

enum Stage {
    Waiting,
    Ready,
    Doing(Doing),
    /// With the `StopMove` that is under way while there is nothing to follow.
    Walking {
        stop: Option<CallInFlight>,
        is_stopped: bool,
    },
    Down,
    /// With the `Damp` that is under way.
    Ended(Option<CallInFlight>),
}

/// A step: asked, then answered, then seen.
struct Doing {
    step: Step,
    call: CallInFlight,
    answered_ns: Option<i64>,
    shown_since_ns: Option<i64>,
}

/// Slower than this, m/s and rad/s, is standing still.
const STILL: (f64, f64) = (0.1, 0.15);
/// No walk tilts a robot by so much.
const FALLEN_RAD: f64 = 1.0;
/// No robot is faster, and odometry may correct itself by so much at once.
const LEAP: (f64, f64) = (6.0, 0.5);

/// One walk.
pub struct WalkSession {
    config: SessionConfig,
    stage: Stage,
    fault: Option<Fault>,
    next_id: i64,
    /// Whether anything was ever asked of the robot.
    has_asked: bool,
    state: Option<WalkerState>,
    bad_payloads: u64,
    wanted: Option<(i64, Velocity)>,
    next_move_ns: i64,
    progress: Progress,
    requests: Vec<Request>,
}

impl WalkSession {
    /// A session that has said nothing yet.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn new(config: SessionConfig) -> Result<WalkSession, SessionError> {
        let Limits { forward_mps, backward_mps, lateral_mps, yaw_rate_radps } = config.limits;
        let numbers = [config.standing_m, forward_mps, backward_mps, lateral_mps, yaw_rate_radps];
        let times = [
            config.move_period_ns,
            config.fresh_ns,
            config.blind_ns,
            config.lost_ns,
            config.confirm_ns,
            config.settle_ns,
            config.ignored_ns,
            config.retry.period_ns,
        ];
        let is_sound = numbers.iter().all(|number| number.is_finite() && *number > 0.0)
            && times.iter().all(|time| *time > 0)
            && config.retry.max_sent > 0;
        if !is_sound {
            return Err(SessionError::Numbers);
        }
        if config.fresh_ns.max(config.blind_ns) > 200_000_000 {
            return Err(SessionError::Deaf);
        }
        Ok(WalkSession {
            next_id: config.first_id,
            stage: Stage::Waiting,
            fault: None,
            has_asked: false,
            state: None,
            bad_payloads: 0,
            wanted: None,
            next_move_ns: i64::MIN,
            progress: Progress::default(),
            requests: Vec::new(),
            config,
        })
    }

    /// Takes the payload of a state that arrived at `now_ns`. What is no state is counted and not listened to; one with the stamp of
    /// the last, or an older one, is no news: a robot that repeats itself is silent.
    pub fn receive_state(&mut self, now_ns: i64, payload: &[u8]) {
        let message = SportModeState::from_cdr(payload).ok();
        let Some(state) = message.and_then(|message| WalkerState::of(now_ns, &message)) else {
            self.bad_payloads += 1;
            return;
        };
        // Without stamps every state is news.
        let last_ns = self.state.and_then(|last| last.robot_ns);
        if state.robot_ns.is_some() && state.robot_ns <= last_ns {
            return;
        }
        let before = self.state.replace(state);
        self.progress.see(&state);
        if matches!(self.stage, Stage::Waiting) {
            self.stage = Stage::Ready;
        }
        if let Some(before) = before {
            self.judge_jump(&before, &state);
        }
        self.judge_state(&state);
    }

    /// Takes the payload of a response that arrived at `now_ns`. Answers to other programs are not listened to.
    pub fn receive_response(&mut self, now_ns: i64, payload: &[u8]) {
        let Ok(response) = Response::from_cdr(payload) else {
            self.bad_payloads += 1;
            return;
        };
        match &mut self.stage {
            Stage::Doing(doing) => match doing.call.answer(&response) {
                Some(Verdict::Done) => {
                    doing.answered_ns.get_or_insert(now_ns);
                }
                Some(verdict) if doing.answered_ns.is_none() => {
                    let step = doing.step;
                    self.refused(now_ns, step, verdict);
                }
                _ => {}
            },
            Stage::Walking { stop, is_stopped } => match stop.as_mut().and_then(|stop| stop.answer(&response)) {
                Some(Verdict::Done) => (*stop, *is_stopped) = (None, true),
                Some(verdict) => self.refused(now_ns, Step::StopMove, verdict),
                None => self.judge_move(now_ns, &response),
            },
            Stage::Ended(damp) => {
                if damp.as_mut().and_then(|damp| damp.answer(&response)).is_some() {
                    *damp = None;
                }
            }
            Stage::Waiting | Stage::Ready | Stage::Down => {}
        }
    }

    /// Does what is due at `now_ns`.
    pub fn advance(&mut self, now_ns: i64) {
        self.watch_link(now_ns);
        self.go_on(now_ns);
        self.follow(now_ns);
        self.repeat(now_ns);
    }

    /// What is to be sent now, in this order.
    pub fn take_requests(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.requests)
    }

    /// A walk is wanted: stand up, balance. Asked again it changes nothing.
    pub fn walk(&mut self, now_ns: i64) {
        if matches!(self.stage, Stage::Ready) {
            self.begin(now_ns, Step::StandUp);
        }
    }

    /// The newest velocity, cut to the limits; followed from now on for [`SessionConfig::fresh_ns`] while the robot walks.
    ///
    /// # Errors
    /// [`CallError::NotFinite`]; the velocity before stays.
    pub fn drive(&mut self, now_ns: i64, velocity: &Velocity) -> Result<(), CallError> {
        let Velocity { forward_mps, left_mps, yaw_rate_radps } = *velocity;
        if ![forward_mps, left_mps, yaw_rate_radps].iter().all(|number| number.is_finite()) {
            return Err(CallError::NotFinite);
        }
        let limits = &self.config.limits;
        let cut = Velocity {
            forward_mps: forward_mps.clamp(-limits.backward_mps, limits.forward_mps),
            left_mps: left_mps.clamp(-limits.lateral_mps, limits.lateral_mps),
            yaw_rate_radps: yaw_rate_radps.clamp(-limits.yaw_rate_radps, limits.yaw_rate_radps),
        };
        self.wanted = Some((now_ns, cut));
        Ok(())
    }

    /// The walk is to end here: stop, lie down. Asked again it changes nothing.
    pub fn lie_down(&mut self, now_ns: i64) {
        match &self.stage {
            Stage::Waiting | Stage::Ready => self.stage = Stage::Down,
            Stage::Doing(doing) if matches!(doing.step, Step::StopMove | Step::StandDown) => {}
            Stage::Doing(doing) if doing.step == Step::StandUp && !doing.call.is_sent() => self.stage = Stage::Down,
            Stage::Doing(_) | Stage::Walking { .. } => self.begin(now_ns, Step::StopMove),
            Stage::Down | Stage::Ended(_) => {}
        }
    }

    /// Where it stands.
    pub fn phase(&self) -> Phase {
        match &self.stage {
            Stage::Waiting => Phase::Waiting,
            Stage::Ready => Phase::Ready,
            Stage::Doing(doing) if matches!(doing.step, Step::StopMove | Step::StandDown) => Phase::LyingDown,
            Stage::Doing(_) => Phase::Starting,
            Stage::Walking { .. } => Phase::Walking,
            Stage::Down => Phase::Down,
            Stage::Ended(_) => Phase::Ended,
        }
    }

    /// Whether there is nothing left to say: lying, or ended with its `Damp` answered or given up.
    pub fn is_over(&self) -> bool {
        matches!(self.stage, Stage::Down | Stage::Ended(None)) && self.requests.is_empty()
    }

    /// Why it ended.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// The newest state.
    pub fn state(&self) -> Option<&WalkerState> {
        self.state.as_ref()
    }

    /// Payloads that were no states or responses, or held numbers that are none.
    pub fn bad_payloads(&self) -> u64 {
        self.bad_payloads
    }

    fn watch_link(&mut self, now_ns: i64) {
        let Some(state) = &self.state else { return };
        let silent_ns = now_ns.saturating_sub(state.stamp_ns);
        if silent_ns > self.config.lost_ns && !matches!(self.stage, Stage::Down | Stage::Ended(_)) {
            self.end(now_ns, Fault::LinkLost { silent_s: silent_ns as f64 * 1e-9 });
        }
    }

    /// Steps: sent until answered, then watched until the state shows them, then the next.
    fn go_on(&mut self, now_ns: i64) {
        let config = &self.config;
        let Stage::Doing(doing) = &mut self.stage else { return };
        let step = doing.step;
        let Some(answered_ns) = doing.answered_ns else {
            match doing.call.poll(now_ns, &mut self.next_id, &config.retry) {
                Ok(request) => {
                    self.has_asked |= request.is_some();
                    self.requests.extend(request);
                }
                Err(verdict) => self.refused(now_ns, step, verdict),
            }
            return;
        };
        let Some(state) = self.state else { return };
        let is_shown = match step {
            Step::StandUp => is_up(&state, config) && is_still(&state),
            Step::BalanceStand => is_up(&state, config) && state.mode != SportMode::LOCKED,
            Step::StopMove => is_still(&state),
            Step::StandDown => state.body_height_m < config.standing_m && is_still(&state),
            Step::Move => true,
        };
        let since_ns = doing.shown_since_ns.filter(|_| is_shown).or(is_shown.then_some(now_ns));
        doing.shown_since_ns = since_ns;
        let settle_ns = if step == Step::StandUp { config.settle_ns } else { 0 };
        if since_ns.is_some_and(|since_ns| now_ns.saturating_sub(since_ns) >= settle_ns) {
            match step {
                Step::StandUp => self.begin(now_ns, Step::BalanceStand),
                Step::StopMove => self.begin(now_ns, Step::StandDown),
                Step::StandDown => self.stage = Stage::Down,
                Step::BalanceStand | Step::Move => {
                    self.progress = Progress::default();
                    self.progress.see(&state);
                    self.stage = Stage::Walking { stop: None, is_stopped: true };
                }
            }
            // The next step is asked for at once.
            self.go_on(now_ns);
        } else if now_ns.saturating_sub(answered_ns) > config.confirm_ns {
            self.end(now_ns, Fault::NotShown { step, mode: state.mode, body_height_m: state.body_height_m });
        }
    }

    /// `Move` while there is something to follow and the robot is seen; else `StopMove`, once it had been moving.
    fn follow(&mut self, now_ns: i64) {
        let config = &self.config;
        let Stage::Walking { stop, is_stopped } = &mut self.stage else { return };
        let age = |stamp_ns: i64| now_ns.saturating_sub(stamp_ns);
        let is_seen = self.state.is_some_and(|state| age(state.stamp_ns) <= config.blind_ns);
        let fresh = self.wanted.filter(|(stamp_ns, _)| is_seen && age(*stamp_ns) <= config.fresh_ns);
        match fresh {
            Some((_, velocity)) if now_ns >= self.next_move_ns => {
                let Velocity { forward_mps, left_mps, yaw_rate_radps } = velocity;
                // Velocities are finite since they came in.
                let Ok(request) = (Call::Move { forward_mps, left_mps, yaw_rate_radps }).request(self.next_id) else {
                    return;
                };
                self.next_id = self.next_id.wrapping_add(1);
                self.requests.push(request);
                (*stop, *is_stopped) = (None, false);
                self.next_move_ns = next(self.next_move_ns, config.move_period_ns, now_ns);
                self.progress.ask(&velocity, config.move_period_ns);
            }
            Some(_) => {}
            None if !*is_stopped && stop.is_none() => *stop = Some(CallInFlight::new(Call::StopMove, now_ns)),
            None => {}
        }
        if self.progress.ignored_ns() > config.ignored_ns {
            let asked_s = self.progress.ignored_ns() as f64 * 1e-9;
            self.end(now_ns, Fault::NotMoving { asked_s });
        }
    }

    /// `StopMove` and `Damp` until they are answered.
    fn repeat(&mut self, now_ns: i64) {
        let (call, is_stop) = match &mut self.stage {
            Stage::Walking { stop: Some(call), .. } => (call, true),
            Stage::Ended(Some(call)) => (call, false),
            _ => return,
        };
        match call.poll(now_ns, &mut self.next_id, &self.config.retry) {
            Ok(request) => self.requests.extend(request),
            Err(verdict) if is_stop => self.refused(now_ns, Step::StopMove, verdict),
            Err(_) => self.stage = Stage::Ended(None),
        }
    }

    fn judge_jump(&mut self, before: &WalkerState, state: &WalkerState) {
        let is_under_way = matches!(self.stage, Stage::Doing(_) | Stage::Walking { .. });
        let passed_s = state.stamp_ns.saturating_sub(before.stamp_ns) as f64 * 1e-9;
        let jump_m = (state.world_from_body.translation.vector - before.world_from_body.translation.vector).norm();
        if is_under_way && jump_m > LEAP.0 * passed_s.max(0.0) + LEAP.1 {
            self.end(state.stamp_ns, Fault::Jumped { jump_m });
        }
    }

    /// Whether the robot still is what we took it for.
    fn judge_state(&mut self, state: &WalkerState) {
        let is_under_way = matches!(self.stage, Stage::Doing(_) | Stage::Walking { .. });
        let is_walking = matches!(self.stage, Stage::Walking { .. });
        if is_under_way && state.tilt_rad() > FALLEN_RAD {
            self.end(state.stamp_ns, Fault::Fallen { tilt_deg: state.tilt_rad().to_degrees() });
        } else if is_walking && (state.mode.is_down() || state.mode == SportMode::LOCKED) {
            self.end(state.stamp_ns, Fault::TakenOver { mode: state.mode });
        }
    }

    /// `Move` wants no answer; a robot that gives one all the same has something to say. "Not now" is for the odometry to judge.
    fn judge_move(&mut self, now_ns: i64, response: &Response) {
        let is_ours = (self.config.first_id..self.next_id).contains(&response.id);
        let outcome = response.outcome();
        if is_ours && response.api_id == Step::Move.call().api_id() && outcome != Outcome::Done && !outcome.is_passing()
        {
            self.end(now_ns, Fault::Refused { step: Step::Move, outcome });
        }
    }

    fn refused(&mut self, now_ns: i64, step: Step, verdict: Verdict) {
        let fault = match verdict {
            Verdict::Unanswered(times) => Fault::Unanswered { step, times },
            Verdict::Refused(outcome) => Fault::Refused { step, outcome },
            Verdict::Done => return,
        };
        self.end(now_ns, fault);
    }

    fn begin(&mut self, now_ns: i64, step: Step) {
        let call = CallInFlight::new(step.call(), now_ns);
        self.stage = Stage::Doing(Doing { step, call, answered_ns: None, shown_since_ns: None });
    }

    fn end(&mut self, now_ns: i64, fault: Fault) {
        if matches!(self.stage, Stage::Ended(_)) {
            return;
        }
        let is_ours = self.has_asked && !matches!(fault, Fault::TakenOver { .. });
        self.fault = Some(fault);
        // What was to be sent before is not true any more.
        self.requests.clear();
        self.stage = Stage::Ended(is_ours.then(|| CallInFlight::new(Call::Damp, now_ns)));
    }
}

fn is_up(state: &WalkerState, config: &SessionConfig) -> bool {
    state.body_height_m >= config.standing_m && !state.mode.is_down()
}

fn is_still(state: &WalkerState) -> bool {
    state.velocity_in_world_mps.norm() < STILL.0 && state.yaw_rate_radps.abs() < STILL.1
}

/// The next time of something periodic that was due at `due_ns`. It keeps its beat over what a loop is late by; later than that it
/// begins a new one, so that two are never much less than a period apart.
fn next(due_ns: i64, period_ns: i64, now_ns: i64) -> i64 {
    let is_in_time = now_ns.saturating_sub(due_ns) <= period_ns / 10;
    (if is_in_time { due_ns } else { now_ns }).saturating_add(period_ns)
}
