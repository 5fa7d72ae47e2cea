//! The link over real sockets and in real time, against the model of PX4 that judges the state machine's own tests.

#[path = "../../../crates/robot-link/tests/support/mod.rs"]
mod support;

use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mission::px4::{Px4Address, Px4Config, Px4Error, Px4Link};
use mission::stream::FlightSetPoint;
use nalgebra::{Isometry3, Point3, Vector3};
use omni_perception::{OdometryEstimate, Stamp};
use robot_link::mavlink::signing::SigningKey;
use robot_link::mavlink::{Fault, Phase, SessionConfig};
use support::{LAND, ModelPx4, POSITION};

/// The model behind a socket, 200 times a second.
struct Autopilot {
    model: Arc<Mutex<ModelPx4>>,
    address: SocketAddr,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Autopilot {
    /// Listens on a free port; with `to` it speaks first.
    fn start(model: ModelPx4, to: Option<SocketAddr>) -> Autopilot {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.set_nonblocking(true).unwrap();
        let address = socket.local_addr().unwrap();
        let (model, is_over) = (Arc::new(Mutex::new(model)), Arc::new(AtomicBool::new(false)));
        let (shared, over) = (Arc::clone(&model), Arc::clone(&is_over));
        let thread = std::thread::spawn(move || {
            let (begin, mut tick, mut client, mut buffer) = (Instant::now(), 0i64, to, [0; 2048]);
            while !over.load(Ordering::Relaxed) {
                tick += 1;
                let now_ns = tick * 5 * support::MS;
                let mut said = Vec::new();
                {
                    let mut model = shared.lock().unwrap();
                    while let Ok((length, from)) = socket.recv_from(&mut buffer) {
                        client = Some(from);
                        said.extend(model.receive(now_ns, &buffer[..length]));
                    }
                    said.extend(model.step(now_ns));
                }
                for frame in said {
                    client.map(|client| socket.send_to(&frame, client));
                }
                std::thread::sleep((Duration::from_millis(5) * tick as u32).saturating_sub(begin.elapsed()));
            }
        });
        Autopilot { model, address, is_over, thread: Some(thread) }
    }

    fn config(&self) -> Px4Config {
        let session = SessionConfig::default();
        Px4Config { address: Px4Address::Out(self.address), session, key: None }
    }
}

impl Drop for Autopilot {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.thread.take().map(JoinHandle::join);
    }
}

static NEVER: AtomicBool = AtomicBool::new(false);

fn standing() -> OdometryEstimate {
    // The odometry's world is turned by 90 degrees against east, and the robot stands 0.2 m above its floor.
    OdometryEstimate::at_rest(Stamp(0), Isometry3::translation(0.0, 0.0, 0.2))
}

fn point(position: [f64; 3], is_armed: bool) -> FlightSetPoint {
    FlightSetPoint {
        position_in_world: Point3::from(position),
        velocity_in_world_mps: Vector3::zeros(),
        acceleration_in_world_mps2: Vector3::zeros(),
        jerk_in_world_mps3: Vector3::zeros(),
        yaw_rad: 0.0,
        yaw_rate_radps: 0.0,
        is_armed,
    }
}

/// Sends the robot somewhere for a time, or until the link does something else.
fn fly(link: &mut Px4Link, position: [f64; 3], seconds: f64) {
    let begin = Instant::now();
    while begin.elapsed().as_secs_f64() < seconds && link.fault().is_none() {
        let now_ns = link.now_ns();
        link.obey(now_ns, &point(position, true), Some(&standing()));
        link.tell_odometry(now_ns, &standing(), 0);
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn from_take_off_to_landing_over_a_socket() {
    let mut model = ModelPx4::new();
    model.battery = Some(87);
    let autopilot = Autopilot::start(model, None);
    let mut link = Px4Link::open(&autopilot.config()).unwrap();
    assert_eq!(link.charge(), None, "nothing was said yet");
    let pose = link.wait_until_ready(Duration::from_secs(10), &NEVER).unwrap();
    // Nose north is y.
    assert!((pose.world_from_body.rotation.euler_angles().2 - std::f64::consts::FRAC_PI_2).abs() < 1e-6);
    link.obey(link.now_ns(), &point([0.0, 0.0, 0.2], false), Some(&standing()));
    assert_eq!(link.phase(), Phase::Ready, "motors off before take-off means nothing");
    fly(&mut link, [2.0, 1.0, 1.2], 9.0);
    assert_eq!((link.phase(), link.fault(), link.charge()), (Phase::Flying, None, Some(0.87)));
    {
        // The robot's x is the autopilot's north, its y west; it rises by a metre.
        let model = autopilot.model.lock().unwrap();
        let [north, east, down] = model.position;
        assert!(
            (north - 2.0).abs() < 0.05 && (east + 1.0).abs() < 0.05 && (down + 1.0).abs() < 0.05,
            "{:?}",
            model.position
        );
        assert!(model.odometry > 100 && model.set_points.len() > 200);
    }
    let there = link.pose_at(link.now_ns()).unwrap();
    // An odometry that believes it stands at its start is off by all of that way; one that knows the place is not.
    let apart_m = |place: [f64; 3]| {
        let estimate = OdometryEstimate::at_rest(Stamp(0), Isometry3::translation(place[0], place[1], place[2]));
        link.disagreement_m(link.now_ns(), &estimate).unwrap()
    };
    assert!(apart_m([2.0, 1.0, 1.2]) < 0.1 && (apart_m([0.0, 0.0, 0.2]) - 6.0f64.sqrt()).abs() < 0.1);
    assert!((there.world_from_body.translation.vector - Vector3::new(-1.0, 2.0, 1.0)).norm() < 0.1);
    link.obey(link.now_ns(), &point([0.0, 0.0, 0.2], false), Some(&standing()));
    link.land(Duration::from_secs(20)).unwrap();
    let model = autopilot.model.lock().unwrap();
    assert!(!model.is_armed && model.custom_mode == LAND && model.position[2] == 0.0);
    assert!(model.violations.is_empty(), "{:?}", model.violations);
}

#[test]
fn who_does_not_answer_is_told_apart() {
    let timeout = Duration::from_secs(2);
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = Px4Address::Out(silent.local_addr().unwrap());
    let config = Px4Config { address, session: SessionConfig::default(), key: None };
    let error = Px4Link::open(&config).unwrap().wait_until_ready(timeout, &NEVER).unwrap_err();
    assert!(error.to_string().contains("no autopilot answers at udpout:127.0.0.1"), "{error}");

    let mut other = ModelPx4::new();
    other.system_id = 7;
    let autopilot = Autopilot::start(other, None);
    let error = Px4Link::open(&autopilot.config()).unwrap().wait_until_ready(timeout, &NEVER).unwrap_err();
    assert!(matches!(error, Px4Error::WrongSystem { found: 7, wanted: 1, .. }), "{error}");
    assert!(error.to_string().contains("--px4-system 7"));

    let autopilot = Autopilot::start(ModelPx4::new(), None);
    let signed = Px4Config { key: Some(SigningKey::new([5; 32])), ..autopilot.config() };
    let error = Px4Link::open(&signed).unwrap().wait_until_ready(timeout, &NEVER).unwrap_err();
    assert!(matches!(error, Px4Error::WrongKey { .. }), "{error}");

    let mut lost = ModelPx4::new();
    lost.has_no_estimate = true;
    let autopilot = Autopilot::start(lost, None);
    let error = Px4Link::open(&autopilot.config()).unwrap().wait_until_ready(timeout, &NEVER).unwrap_err();
    assert!(matches!(error, Px4Error::Fault(Fault::NoPosition)), "{error}");

    let link = Px4Link::open(&autopilot.config()).unwrap();
    assert!(matches!(link.wait_until_ready(timeout, &AtomicBool::new(true)), Err(Px4Error::Interrupted)));
}

#[test]
fn an_operator_is_told_of_and_left_alone() {
    // The autopilot speaks first here: udpin.
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let config = Px4Config { address: Px4Address::In(port), session: SessionConfig::default(), key: None };
    let mut link = Px4Link::open(&config).unwrap();
    let autopilot = Autopilot::start(ModelPx4::new(), Some(port));
    link.wait_until_ready(Duration::from_secs(10), &NEVER).unwrap();
    fly(&mut link, [0.0, 0.0, 1.2], 5.0);
    assert_eq!((link.phase(), link.fault()), (Phase::Flying, None));
    autopilot.model.lock().unwrap().custom_mode = POSITION;
    fly(&mut link, [0.0, 0.0, 1.2], 5.0);
    let fault = link.fault().expect("it noticed");
    assert!(matches!(fault, Fault::TakenOver { .. }) && fault.to_string().contains("POSITION"), "{fault}");
    let heard = autopilot.model.lock().unwrap().set_points.len();
    assert!(matches!(link.land(Duration::from_secs(5)), Err(Px4Error::Fault(Fault::TakenOver { .. }))));
    drop(link);
    let model = autopilot.model.lock().unwrap();
    assert_eq!((model.set_points.len(), model.custom_mode), (heard, POSITION));
}

#[test]
fn a_link_that_is_dropped_in_flight_lands() {
    let autopilot = Autopilot::start(ModelPx4::new(), None);
    let mut link = Px4Link::open(&autopilot.config()).unwrap();
    link.wait_until_ready(Duration::from_secs(10), &NEVER).unwrap();
    fly(&mut link, [0.0, 0.0, 1.2], 5.0);
    drop(link);
    assert_eq!(autopilot.model.lock().unwrap().custom_mode, LAND);
}
