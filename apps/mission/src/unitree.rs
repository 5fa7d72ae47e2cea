//! A Unitree robot at the other end of DDS: where it is goes in, how fast it shall walk goes out, in real time.
//!
//! Calls, order and faults are [`WalkSession`]'s, the topics [`SportTopics`]'. Here are the clock, and a thread that repeats `Move` while
//! the mission thinks and stops when it thinks too long.

mod error;
mod topics;

pub use error::UnitreeError;
pub use topics::{SportTopics, Unmatched};

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use nalgebra::Vector3;
use robot_link::mavlink::vehicle::{AttitudeReport, PositionReport};
use robot_link::unitree::{Fault, Phase, SessionConfig, Velocity, WalkSession, WalkerState};

use crate::px4::{PoseHistory, VehiclePose};

/// How to reach the robot.
#[derive(Debug, Clone)]
pub struct UnitreeConfig {
    /// Name of the network interface it is at; `lo` for one on this machine.
    pub interface: String,
    /// DDS domain (0).
    pub domain: u16,
    /// Times and limits. The number of the first request is taken from the clock.
    pub session: SessionConfig,
}

/// A link that is open; dropped on a walk, it has the robot lie down first.
pub struct UnitreeLink {
    interface: String,
    domain: u16,
    clock: Clock,
    shared: Arc<Mutex<Shared>>,
    is_closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    session: WalkSession,
    poses: PoseHistory,
    /// Our clock less the robot's, by the sample that came fastest.
    offset_ns: Option<i64>,
    unmatched: Vec<Unmatched>,
}

/// Nanoseconds since the link was opened.
#[derive(Debug, Clone, Copy)]
struct Clock(Instant);

impl Clock {
    fn now_ns(self) -> i64 {
        i64::try_from(self.0.elapsed().as_nanos()).unwrap_or(i64::MAX / 2)
    }
}

/// The thread looks at the topics at least this often.
const POLL: Duration = Duration::from_millis(2);
/// And at who serves them.
const LOOK_ROUND_NS: i64 = 100_000_000;
/// A topic with another type is reported after so long.
const OTHER_TYPE: Duration = Duration::from_secs(2);
/// A link that is dropped on a walk waits so long for the robot to lie down.
const LIE_DOWN_ON_DROP: Duration = Duration::from_secs(6);
/// A stamp of the robot further off than this after the offset is no stamp.
const WILD_NS: i64 = 500_000_000;

impl UnitreeLink {
    /// Joins the topics. Nothing is asked of the robot yet.
    ///
    /// # Errors
    /// What cannot be set up.
    pub fn open(config: &UnitreeConfig) -> Result<UnitreeLink, UnitreeError> {
        let topics = SportTopics::open(&config.interface, config.domain)?;
        let clock = Clock(Instant::now());
        let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let first_id = i64::try_from(since_1970.as_nanos()).unwrap_or(1);
        let session = WalkSession::new(SessionConfig { first_id, ..config.session.clone() })?;
        let unmatched = topics.unmatched();
        let shared = Shared { session, poses: PoseHistory::default(), offset_ns: None, unmatched };
        let shared = Arc::new(Mutex::new(shared));
        let is_closing = Arc::new(AtomicBool::new(false));
        let mut end = LinkEnd { topics, clock, shared: Arc::clone(&shared), next_look_ns: 0 };
        let closing = Arc::clone(&is_closing);
        let thread = std::thread::Builder::new().name("unitree".into()).spawn(move || end.run(&closing));
        Ok(UnitreeLink {
            interface: config.interface.clone(),
            domain: config.domain,
            clock,
            shared,
            is_closing,
            thread: Some(thread.map_err(UnitreeError::Thread)?),
        })
    }

    /// Time of the link's clock.
    pub fn now_ns(&self) -> i64 {
        self.clock.now_ns()
    }

    /// Waits until the robot serves all topics and says where it is.
    ///
    /// # Errors
    /// A sentence for each way in which this may not happen within `timeout`.
    pub fn wait_until_ready(&self, timeout: Duration, stop: &AtomicBool) -> Result<(), UnitreeError> {
        let begin = Instant::now();
        loop {
            if stop.load(Ordering::Relaxed) {
                return Err(UnitreeError::Interrupted);
            }
            let shared = self.lock();
            if let Some(fault) = shared.session.fault() {
                return Err((*fault).into());
            }
            if shared.session.phase() == Phase::Ready && shared.unmatched.is_empty() {
                return Ok(());
            }
            let other = shared.unmatched.iter().find_map(|topic| Some((topic, topic.found.clone()?)));
            if let Some((topic, found)) = other
                && begin.elapsed() >= OTHER_TYPE.min(timeout)
            {
                let (interface, topic, wanted) = (self.interface.clone(), topic.topic, topic.wanted);
                return Err(UnitreeError::OtherType { interface, topic, found, wanted });
            }
            if begin.elapsed() >= timeout {
                return Err(self.silence(&shared, timeout));
            }
            drop(shared);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    fn silence(&self, shared: &Shared, timeout: Duration) -> UnitreeError {
        let interface = self.interface.clone();
        if shared.unmatched.is_empty() {
            return UnitreeError::NoState { interface, bad: shared.session.bad_payloads() };
        }
        let topics: Vec<String> =
            shared.unmatched.iter().map(|topic| format!("{} ({})", topic.topic, topic.wanted)).collect();
        let waited_s = timeout.as_secs_f64();
        UnitreeError::Silent { interface, domain: self.domain, waited_s, topics: topics.join(", ") }
    }

    /// Has the robot stand up, and waits until it is ready to walk.
    ///
    /// # Errors
    /// A fault on the way, [`UnitreeError::TooSlow`], or [`UnitreeError::Interrupted`].
    pub fn stand_up(&self, timeout: Duration, stop: &AtomicBool) -> Result<(), UnitreeError> {
        self.lock().session.walk(self.now_ns());
        self.wait_for(Phase::Walking, "to stand up", timeout, Some(stop))
    }

    /// Has the robot stop and lie down, and waits until it lies.
    ///
    /// # Errors
    /// A fault on the way, or [`UnitreeError::TooSlow`].
    pub fn lie_down(&self, timeout: Duration) -> Result<(), UnitreeError> {
        self.lock().session.lie_down(self.now_ns());
        self.wait_for(Phase::Down, "to lie down", timeout, None)
    }

    fn wait_for(
        &self,
        phase: Phase,
        what: &'static str,
        timeout: Duration,
        stop: Option<&AtomicBool>,
    ) -> Result<(), UnitreeError> {
        let begin = Instant::now();
        loop {
            match (self.phase(), self.fault()) {
                (_, Some(fault)) => return Err(fault.into()),
                (now, None) if now == phase => return Ok(()),
                _ if stop.is_some_and(|stop| stop.load(Ordering::Relaxed)) => return Err(UnitreeError::Interrupted),
                _ if begin.elapsed() >= timeout => {
                    return Err(UnitreeError::TooSlow { what, waited_s: timeout.as_secs_f64() });
                }
                _ => std::thread::sleep(Duration::from_millis(10)),
            }
        }
    }

    /// The newest velocity; followed for a moment only. One that is not finite is not followed.
    pub fn drive(&self, velocity: &Velocity) {
        let now_ns = self.now_ns();
        let _ = self.lock().session.drive(now_ns, velocity);
    }

    /// Where the robot was at a time of the last second, or is, in the world of its own odometry.
    pub fn pose_at(&self, stamp_ns: i64) -> Option<VehiclePose> {
        self.lock().poses.at(stamp_ns)
    }

    /// Where the walk stands.
    pub fn phase(&self) -> Phase {
        self.lock().session.phase()
    }

    /// Why it ended.
    pub fn fault(&self) -> Option<Fault> {
        self.lock().session.fault().copied()
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for UnitreeLink {
    fn drop(&mut self) {
        let begin = Instant::now();
        self.lock().session.lie_down(self.clock.now_ns());
        // Until it lies, or a fault's Damp is out and answered.
        while begin.elapsed() < LIE_DOWN_ON_DROP && !self.lock().session.is_over() {
            std::thread::sleep(POLL);
        }
        self.is_closing.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread's end: topics and clock.
struct LinkEnd {
    topics: SportTopics,
    clock: Clock,
    shared: Arc<Mutex<Shared>>,
    next_look_ns: i64,
}

impl LinkEnd {
    fn run(&mut self, is_closing: &AtomicBool) {
        while !is_closing.load(Ordering::Relaxed) {
            let (states, responses) = (self.topics.take_states(), self.topics.take_responses());
            let now_ns = self.clock.now_ns();
            let unmatched = (now_ns >= self.next_look_ns).then(|| self.topics.unmatched());
            if unmatched.is_some() {
                self.next_look_ns = now_ns + LOOK_ROUND_NS;
            }
            let requests = {
                let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
                for state in states {
                    shared.session.receive_state(now_ns, &state);
                    shared.note_pose();
                }
                for response in responses {
                    shared.session.receive_response(now_ns, &response);
                }
                if let Some(unmatched) = unmatched {
                    shared.unmatched = unmatched;
                }
                shared.session.advance(now_ns);
                shared.session.take_requests()
            };
            for request in requests {
                // One that cannot be sent is not answered, and the session sends it again.
                let _ = self.topics.send(request.to_cdr());
            }
            std::thread::sleep(POLL);
        }
    }
}

impl Shared {
    fn note_pose(&mut self) {
        let Some(state) = self.session.state().copied() else { return };
        let stamp_ns = self.on_our_clock(&state);
        let rotation = state.world_from_body.rotation;
        let position = PositionReport {
            stamp_ns,
            position_in_world: state.world_from_body.translation.vector,
            velocity_in_world_mps: state.velocity_in_world_mps,
        };
        let attitude = AttitudeReport {
            stamp_ns,
            world_from_body: rotation,
            angular_velocity_in_body_radps: rotation.inverse() * Vector3::new(0.0, 0.0, state.yaw_rate_radps),
        };
        self.poses.add(Some(&position), Some(&attitude));
    }

    /// When the robot was there: its own stamp, where it keeps one; arrival is late by what the network took.
    fn on_our_clock(&mut self, state: &WalkerState) -> i64 {
        let Some(robot_ns) = state.robot_ns else { return state.stamp_ns };
        let offset_ns = state.stamp_ns.saturating_sub(robot_ns);
        let known_ns = *self.offset_ns.get_or_insert(offset_ns);
        let is_wild = offset_ns.saturating_sub(known_ns).saturating_abs() > WILD_NS;
        let used_ns = if is_wild { offset_ns } else { known_ns.min(offset_ns) };
        self.offset_ns = Some(used_ns);
        robot_ns.saturating_add(used_ns)
    }
}
