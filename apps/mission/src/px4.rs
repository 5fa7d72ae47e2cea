//! An autopilot at the other end of a UDP socket: where it is goes in, what it shall do goes out, in real time.
//!
//! Bytes, order and faults are [`OffboardSession`]'s. Here are the socket, the clock, and a thread that keeps the stream steady
//! while the mission thinks. The mission commands in the frame of its own odometry; the autopilot has a local frame of its own.
//! How they lie to each other is taken once, where both stand before take-off, and then holds: the autopilot is told our odometry
//! all the time, and a real one follows it.

mod address;
mod error;
mod poses;

pub use address::{AddressError, Px4Address};
pub use error::Px4Error;
pub use poses::{PoseHistory, VehiclePose};

use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use omni_perception::{OdometryEstimate, TrackingStatus};
use robot_link::mavlink::signing::SigningKey;
use robot_link::mavlink::stream::Reference;
use robot_link::mavlink::{Fault, OffboardSession, OwnOdometry, Phase, SessionConfig};

use crate::stream::FlightSetPoint;

/// How to reach the autopilot.
#[derive(Debug, Clone)]
pub struct Px4Config {
    /// Where it is.
    pub address: Px4Address,
    /// Ids, times and limits.
    pub session: SessionConfig,
    /// Signs and demands signatures.
    pub key: Option<SigningKey>,
}

/// A link that is open; dropped in flight, it asks the autopilot to land first.
pub struct Px4Link {
    address: Px4Address,
    wanted_system: u8,
    clock: Clock,
    shared: Arc<Mutex<Shared>>,
    is_closing: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    local_from_odometry: Option<Isometry3<f64>>,
}

struct Shared {
    session: OffboardSession,
    poses: PoseHistory,
}

/// Nanoseconds since the link was opened, and a second: zero means a question in TIMESYNC.
#[derive(Debug, Clone, Copy)]
struct Clock(Instant);

impl Clock {
    fn now_ns(self) -> i64 {
        1_000_000_000 + i64::try_from(self.0.elapsed().as_nanos()).unwrap_or(i64::MAX / 2)
    }
}

/// The thread looks at the socket at least this often.
const POLL: Duration = Duration::from_millis(2);
/// Datagrams taken in one go; more wait.
const MAX_DATAGRAMS: usize = 64;
/// Comparisons of clocks before a flight.
const MIN_COMPARISONS: u32 = 5;
/// A link that is dropped in flight waits so long for its landing to be accepted.
const LAND_ON_DROP: Duration = Duration::from_secs(3);

impl Px4Link {
    /// Opens the socket and begins to send heartbeats.
    ///
    /// # Errors
    /// [`Px4Error::Socket`], [`Px4Error::Session`], [`Px4Error::Thread`].
    pub fn open(config: &Px4Config) -> Result<Px4Link, Px4Error> {
        let address = config.address;
        let of_socket = |source| Px4Error::Socket { address, source };
        let socket = match address {
            Px4Address::Out(there) => {
                let here = if there.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
                // Connected: nobody else's datagrams get through.
                UdpSocket::bind(here).and_then(|socket| socket.connect(there).map(|()| socket))
            }
            Px4Address::In(here) => UdpSocket::bind(here),
        }
        .map_err(of_socket)?;
        socket.set_read_timeout(Some(POLL)).map_err(of_socket)?;
        let clock = Clock(Instant::now());
        let mut session = OffboardSession::new(config.session.clone(), clock.now_ns())?;
        if let Some(key) = &config.key {
            session.sign(key.clone(), 0, signing_time());
        }
        let shared = Arc::new(Mutex::new(Shared { session, poses: PoseHistory::default() }));
        let is_closing = Arc::new(AtomicBool::new(false));
        let mut end = LinkEnd { socket, address, peer: None, clock, shared: Arc::clone(&shared) };
        let closing = Arc::clone(&is_closing);
        let thread = std::thread::Builder::new().name("px4".into()).spawn(move || end.run(&closing));
        Ok(Px4Link {
            address,
            wanted_system: config.session.system_id,
            clock,
            shared,
            is_closing,
            thread: Some(thread.map_err(Px4Error::Thread)?),
            local_from_odometry: None,
        })
    }

    /// Time of the link's clock.
    pub fn now_ns(&self) -> i64 {
        self.clock.now_ns()
    }

    /// Waits until the autopilot is heard, knows where it is, and its clock is known.
    ///
    /// # Errors
    /// A sentence for each way in which this may not happen within `timeout`.
    pub fn wait_until_ready(&self, timeout: Duration, stop: &AtomicBool) -> Result<VehiclePose, Px4Error> {
        let begin = Instant::now();
        loop {
            if stop.load(Ordering::Relaxed) {
                return Err(Px4Error::Interrupted);
            }
            let shared = self.lock();
            if let Some(fault) = shared.session.fault() {
                return Err(fault.clone().into());
            }
            let is_ready = shared.session.phase() == Phase::Ready;
            if is_ready
                && shared.session.clock().accepted() >= MIN_COMPARISONS
                && let Some(pose) = shared.poses.at(self.now_ns())
            {
                return Ok(pose);
            }
            if begin.elapsed() >= timeout {
                return Err(self.silence(&shared.session, timeout));
            }
            drop(shared);
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// What to say of a link on which no vehicle got ready.
    fn silence(&self, session: &OffboardSession, timeout: Duration) -> Px4Error {
        let (address, refused) = (self.address, session.statistics().bad_signatures);
        match session.foreign_system() {
            _ if session.phase() != Phase::Waiting => Px4Error::Fault(Fault::NoPosition),
            Some(found) => Px4Error::WrongSystem { address, found, wanted: self.wanted_system },
            None if refused > 0 => Px4Error::WrongKey { address, refused },
            None => Px4Error::Silent { address, waited_s: timeout.as_secs_f64() },
        }
    }

    /// Where the vehicle was at a time of the last second, or is.
    pub fn pose_at(&self, stamp_ns: i64) -> Option<VehiclePose> {
        self.lock().poses.at(stamp_ns)
    }

    /// What the autopilot says of its batteries: the least charge, 1 full, 0 empty; `None` where it has said nothing for ten seconds.
    pub fn charge(&self) -> Option<f64> {
        let now_ns = self.now_ns();
        self.lock().session.charge(now_ns)
    }

    /// Where the flight stands.
    pub fn phase(&self) -> Phase {
        self.lock().session.phase()
    }

    /// Why it ended, or lands without having been told to.
    pub fn fault(&self) -> Option<Fault> {
        self.lock().session.fault().cloned()
    }

    /// A set-point in the frame of the odometry, meant for `stamp_ns`. The first with motors on begins the flight: from then on the
    /// frames of odometry and autopilot hang together as they do where it stands now. One with motors off ends it.
    pub fn obey(&mut self, stamp_ns: i64, point: &FlightSetPoint, odometry: Option<&OdometryEstimate>) {
        let now_ns = self.now_ns();
        if !point.is_armed {
            // Nothing was begun, or it is over.
            if self.local_from_odometry.is_some() {
                self.lock().session.land(now_ns);
            }
            return;
        }
        let known = match (self.local_from_odometry, odometry, self.pose_at(now_ns)) {
            (Some(known), ..) => known,
            (None, Some(odometry), Some(local)) => {
                level(&local.world_from_body) * level(&odometry.world_from_body).inverse()
            }
            // Somebody here does not know where it stands.
            (None, ..) => return,
        };
        let local_from_odometry = *self.local_from_odometry.insert(known);
        let reference = Reference {
            position_in_world: (local_from_odometry * point.position_in_world).coords,
            velocity_in_world_mps: local_from_odometry * point.velocity_in_world_mps,
            acceleration_in_world_mps2: local_from_odometry * point.acceleration_in_world_mps2,
            yaw_rad: point.yaw_rad + local_from_odometry.rotation.euler_angles().2,
            yaw_rate_radps: point.yaw_rate_radps,
        };
        let session = &mut self.lock().session;
        session.fly(now_ns);
        // A point that is not finite is not followed; the stream brakes when no better one comes.
        let _ = session.follow(stamp_ns, &reference);
    }

    /// How far apart odometry and autopilot put the body at `stamp_ns`, m; `None` before the flight, where their frames are not yet tied
    /// together, or where nothing is known of that time.
    pub fn disagreement_m(&self, stamp_ns: i64, estimate: &OdometryEstimate) -> Option<f64> {
        let believed = self.local_from_odometry? * estimate.world_from_body;
        let told = self.pose_at(stamp_ns)?.world_from_body;
        Some((believed.translation.vector - told.translation.vector).norm())
    }

    /// The robot's own odometry for the autopilot's estimator; nothing while it is lost. `resets` counts its jumps.
    pub fn tell_odometry(&self, stamp_ns: i64, estimate: &OdometryEstimate, resets: u64) {
        if estimate.status == TrackingStatus::Lost {
            return;
        }
        let body_from_world = estimate.world_from_body.rotation.inverse();
        let own = OwnOdometry {
            world_from_body: estimate.world_from_body,
            velocity_in_body_mps: body_from_world * estimate.velocity_in_world_mps,
            angular_velocity_in_body_radps: estimate.angular_velocity_in_body_radps,
            covariance: Some(estimate.covariance),
            reset_counter: (resets % 256) as u8,
        };
        // An estimate that is not finite is not told; the autopilot notices the gap.
        let _ = self.lock().session.tell_odometry(stamp_ns, &own);
    }

    /// Has the autopilot land, and waits until its motors are off.
    ///
    /// # Errors
    /// A fault on the way, or [`Px4Error::StillUp`].
    pub fn land(&mut self, timeout: Duration) -> Result<(), Px4Error> {
        let begin = Instant::now();
        self.lock().session.land(self.now_ns());
        loop {
            let (phase, fault) = (self.phase(), self.fault());
            match (phase, fault) {
                (Phase::Landed | Phase::Ended, Some(fault)) => return Err(fault.into()),
                (Phase::Landed | Phase::Ended, None) => return Ok(()),
                _ if begin.elapsed() >= timeout => return Err(Px4Error::StillUp { waited_s: timeout.as_secs_f64() }),
                _ => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Px4Link {
    fn drop(&mut self) {
        let begin = Instant::now();
        if matches!(self.phase(), Phase::Starting | Phase::Flying) {
            self.lock().session.land(self.now_ns());
            // Until LAND shows, or the thread gives up: then its silence is for the autopilot's failsafe.
            let is_open = |session: &OffboardSession| session.phase() == Phase::Landing && !session.is_descending();
            while begin.elapsed() < LAND_ON_DROP && is_open(&self.lock().session) {
                std::thread::sleep(POLL);
            }
        }
        self.is_closing.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread's end: socket and clock.
struct LinkEnd {
    socket: UdpSocket,
    address: Px4Address,
    /// Who is spoken to: with `udpin` the first that the session listens to.
    peer: Option<std::net::SocketAddr>,
    clock: Clock,
    shared: Arc<Mutex<Shared>>,
}

impl LinkEnd {
    fn run(&mut self, is_closing: &AtomicBool) {
        let mut buffer = [0; 2048];
        while !is_closing.load(Ordering::Relaxed) {
            // Waits for the first datagram, takes what else is there.
            for _ in 0..MAX_DATAGRAMS {
                // Errors are silence: nobody listens there yet, or the network is down. The session judges silence.
                let Ok((length, sender)) = self.socket.recv_from(&mut buffer) else { break };
                self.take(&buffer[..length], sender);
                if self.socket.set_nonblocking(true).is_err() {
                    break;
                }
            }
            let _ = self.socket.set_nonblocking(false);
            let frames = {
                let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
                shared.session.advance(self.clock.now_ns());
                shared.session.take_frames()
            };
            for frame in frames {
                let _ = match (self.address, self.peer) {
                    (Px4Address::Out(_), _) => self.socket.send(&frame),
                    (Px4Address::In(_), Some(peer)) => self.socket.send_to(&frame, peer),
                    (Px4Address::In(_), None) => continue,
                };
            }
        }
    }

    fn take(&mut self, datagram: &[u8], sender: std::net::SocketAddr) {
        if self.peer.is_some_and(|peer| peer != sender) {
            return;
        }
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        shared.session.receive(self.clock.now_ns(), datagram);
        let Shared { session, poses } = &mut *shared;
        poses.add(session.vehicle().position(), session.vehicle().attitude());
        if matches!(self.address, Px4Address::In(_)) && session.phase() != Phase::Waiting {
            self.peer = Some(sender);
        }
    }
}

/// The same place and heading without tilt.
fn level(world_from_body: &Isometry3<f64>) -> Isometry3<f64> {
    let yaw_rad = world_from_body.rotation.euler_angles().2;
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    Isometry3::from_parts(Translation3::from(world_from_body.translation.vector), turn)
}

/// Now, in 10 us since 2015-01-01 00:00 UTC.
fn signing_time() -> u64 {
    const EPOCH_S: u64 = 1_420_070_400;
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let since = since_1970.saturating_sub(Duration::from_secs(EPOCH_S));
    u64::try_from(since.as_micros() / 10).unwrap_or(0)
}
