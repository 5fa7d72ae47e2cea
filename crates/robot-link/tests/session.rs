//! Laws of an offboard flight over a link that loses, doubles, delays and reorders, against a model of PX4.

mod support;

use nalgebra::Vector3;
use proptest::prelude::*;
use robot_link::mavlink::session::Step;
use robot_link::mavlink::signing::SigningKey;
use robot_link::mavlink::stream::Reference;
use robot_link::mavlink::*;
use support::{Lossy, MS, ModelPx4, OFFBOARD, POSITION};

/// The two ends and the link between.
struct Flight {
    session: OffboardSession,
    px4: ModelPx4,
    up: Lossy,
    down: Lossy,
    now_ns: i64,
    /// Kinds of frames that the session has sent, with their times.
    sent: Vec<(i64, Message)>,
    tap: FrameReader,
    /// The newest heartbeat that has reached the session: when, its number, its mode.
    heartbeat: Option<(i64, u8, u32)>,
}

impl Flight {
    fn new(up: Lossy, down: Lossy) -> Flight {
        let session = OffboardSession::new(SessionConfig::default(), 1000 * MS).expect("sound");
        Flight {
            session,
            px4: ModelPx4::new(),
            up,
            down,
            now_ns: 1000 * MS,
            sent: Vec::new(),
            tap: FrameReader::new(),
            heartbeat: None,
        }
    }

    fn over_a_good_link() -> Flight {
        Flight::new(Lossy::new(0.0, 0.0, 1.0, 1), Lossy::new(0.0, 0.0, 1.0, 2))
    }

    /// Goes on for a time; the robot wants to fly, and follows a line.
    fn go_on(&mut self, seconds: f64) {
        let end_ns = self.now_ns + (seconds * 1e9) as i64;
        while self.now_ns < end_ns {
            self.now_ns += 5 * MS;
            for datagram in self.down.arrived(self.now_ns) {
                self.session.receive(self.now_ns, &datagram);
                for received in FrameReader::new().read(&datagram) {
                    if let Message::Heartbeat(heartbeat) = received.message
                        && self.heartbeat.is_none_or(|(_, _, mode)| mode != heartbeat.custom_mode)
                    {
                        self.heartbeat = Some((self.now_ns, received.sequence, heartbeat.custom_mode));
                    }
                }
            }
            self.session.advance(self.now_ns);
            for frame in self.session.take_frames() {
                self.sent.extend(self.tap.read(&frame).into_iter().map(|received| (self.now_ns, received.message)));
                self.up.send(self.now_ns, frame);
            }
            for datagram in self.up.arrived(self.now_ns) {
                for answer in self.px4.receive(self.now_ns, &datagram) {
                    self.down.send(self.now_ns, answer);
                }
            }
            for said in self.px4.step(self.now_ns) {
                self.down.send(self.now_ns, said);
            }
        }
    }

    /// Until it flies, or ends, or the time is over.
    fn take_off(&mut self, seconds: f64) {
        let end_ns = self.now_ns + (seconds * 1e9) as i64;
        while self.now_ns < end_ns && !matches!(self.session.phase(), Phase::Flying | Phase::Ended) {
            self.session.fly(self.now_ns);
            self.go_on(0.02);
        }
    }

    fn follow(&mut self, position: Vector3<f64>) {
        self.session.follow(self.now_ns, &Reference::resting_at(position, 0.0)).expect("finite");
    }

    fn commands(&self, number: u16) -> usize {
        let is = |message: &Message| matches!(message, Message::CommandLong(command) if command.command == number);
        self.sent.iter().filter(|(_, message)| is(message)).count()
    }

    /// Set-points and commands of the session since a time.
    fn controls_since(&self, time_ns: i64) -> usize {
        let is = |message: &Message| matches!(message, Message::CommandLong(_) | Message::SetPositionTargetLocalNed(_));
        self.sent.iter().filter(|(at_ns, message)| *at_ns > time_ns && is(message)).count()
    }
}

#[test]
fn from_the_floor_and_back() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    assert_eq!(flight.session.phase(), Phase::Ready);
    assert!(flight.px4.set_points.is_empty() && flight.commands(511) == 2, "it only asks for poses");
    let offset_ns = flight.session.clock().offset_ns().expect("compared");
    assert!((offset_ns - 77_000_000_000).abs() < 6 * MS, "{offset_ns}");
    flight.take_off(10.0);
    assert_eq!(flight.session.phase(), Phase::Flying);
    // Three up and two to the east.
    for _ in 0..200 {
        flight.follow(Vector3::new(2.0, 0.0, 3.0));
        flight.go_on(0.05);
    }
    let [north, east, down] = flight.px4.position;
    assert!(north.abs() < 0.01 && (east - 2.0).abs() < 0.01 && (down + 3.0).abs() < 0.01, "{north} {east} {down}");
    let odometry = OwnOdometry {
        world_from_body: nalgebra::Isometry3::identity(),
        velocity_in_body_mps: Vector3::zeros(),
        angular_velocity_in_body_radps: Vector3::zeros(),
        covariance: None,
        reset_counter: 0,
    };
    for tick in 0..200 {
        flight.session.tell_odometry(flight.now_ns + tick * 5 * MS, &odometry).expect("finite");
    }
    flight.session.land(flight.now_ns);
    flight.go_on(10.0);
    assert_eq!((flight.session.phase(), flight.session.fault()), (Phase::Landed, None));
    assert!(!flight.px4.is_armed && flight.px4.position[2] == 0.0);
    assert_eq!(
        (flight.px4.odometry, flight.px4.violations.len()),
        (50, 0),
        "a second at 50 Hz; {:?}",
        flight.px4.violations
    );
    // 50 Hz without gaps, and each command once.
    let gaps = flight.px4.set_points.windows(2).map(|pair| pair[1].0 - pair[0].0);
    assert!(gaps.max().is_some_and(|gap| gap <= 30 * MS));
    assert_eq!([176, 400, 21].map(|number| flight.commands(number)), [1, 2, 1]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn the_order_holds_over_any_link_and_commands_are_bounded(
        loss in prop_oneof![1 => Just(0.0), 2 => 0.0..0.5f64], doubling in 0.0..0.5f64, delay_ms in 0.0..90.0f64, seed in any::<u64>(),
        answer_to_mode in prop_oneof![4 => Just(0u8), 1 => 0..12u8], answer_to_arming in prop_oneof![4 => Just(0u8), 1 => 0..12u8],
        is_mute in prop::bool::weighted(0.1),
    ) {
        let mut flight = Flight::new(Lossy::new(loss, doubling, delay_ms, seed), Lossy::new(loss, doubling, delay_ms, !seed));
        flight.px4.answer_to_mode = answer_to_mode;
        flight.px4.answer_to_arming = answer_to_arming;
        flight.px4.is_mute = is_mute;
        flight.go_on(5.0);
        flight.take_off(60.0);
        prop_assert!(flight.px4.violations.is_empty(), "{:?}", flight.px4.violations);
        prop_assert!(flight.commands(176) <= 5 && flight.commands(400) <= 5 && flight.commands(511) <= 10);
        prop_assert!(matches!(flight.session.phase(), Phase::Flying | Phase::Ended), "it comes to an end: {:?}", flight.session.phase());
        let is_willing = (answer_to_mode, answer_to_arming, is_mute) == (0, 0, false);
        // However few are lost, at times they are just those that were needed.
        if is_willing && loss == 0.0 {
            prop_assert_eq!(flight.session.phase(), Phase::Flying, "{:?}", flight.session.fault());
        }
        if answer_to_mode != 0 || answer_to_arming != 0 {
            prop_assert!(!matches!(flight.session.phase(), Phase::Flying));
        }
    }

    #[test]
    fn what_an_operator_took_is_never_taken_back(
        loss in 0.0..0.3f64, delay_ms in 0.0..90.0f64, seed in any::<u64>(), taken_s in 0.0..8.0f64, mode in prop_oneof![Just(POSITION), Just(4 << 16 | 3 << 24), Just(1 << 16)],
    ) {
        let mut flight = Flight::new(Lossy::new(loss, 0.2, delay_ms, seed), Lossy::new(loss, 0.2, delay_ms, !seed));
        flight.go_on(3.0);
        let mut left_s = taken_s;
        while left_s > 0.0 && flight.session.phase() != Phase::Ended {
            flight.session.fly(flight.now_ns);
            flight.follow(Vector3::new(0.0, 0.0, 2.0));
            flight.go_on(0.02);
            left_s -= 0.02;
        }
        let had_it = flight.session.phase() == Phase::Flying && flight.px4.custom_mode == OFFBOARD;
        flight.px4.custom_mode = mode;
        if !had_it {
            return Ok(());
        }
        for _ in 0..1000 {
            flight.session.fly(flight.now_ns);
            flight.follow(Vector3::new(0.0, 0.0, 2.0));
            flight.go_on(0.02);
        }
        flight.session.land(flight.now_ns);
        flight.go_on(3.0);
        prop_assert!(matches!(flight.session.fault(), Some(Fault::TakenOver { .. })), "{:?}", flight.session.fault());
        prop_assert_eq!(flight.px4.custom_mode, mode);
        // Heartbeats come once a second and may be lost; from the first that arrives on there is silence, even about landing.
        let (heard_ns, _, heard) = flight.heartbeat.expect("heartbeats came");
        prop_assert_eq!((heard, flight.controls_since(heard_ns - 1)), (mode, 0));
    }

    #[test]
    fn the_streamed_velocity_is_the_derivative_of_the_streamed_position(
        seed in any::<u64>(), jumps in prop::collection::vec(prop::array::uniform3(-5.0..5.0f64), 1..5),
    ) {
        let mut flight = Flight::over_a_good_link();
        flight.go_on(2.0);
        flight.take_off(10.0);
        let mut dice = support::Dice(seed);
        for jump in jumps {
            for _ in 0..40 {
                // Some points are late, some stay away.
                if dice.roll() < 0.7 {
                    let here = Reference { velocity_in_world_mps: Vector3::new(dice.roll(), 0.0, 0.0), ..Reference::resting_at(Vector3::from(jump), 0.0) };
                    flight.session.follow(flight.now_ns - (dice.roll() * 2e8) as i64, &here).expect("finite");
                }
                flight.go_on(0.02);
            }
        }
        for pair in flight.px4.set_points.windows(2) {
            let ((t0, Some(p0), v0), (t1, Some(p1), v1)) = (pair[0], pair[1]) else { continue };
            let dt = ((t1 - t0) as f64 * 1e-9) as f32;
            for axis in 0..3 {
                let off = p1[axis] - p0[axis] - dt * (v0[axis] + v1[axis]) / 2.0;
                // 6 m/s^2 over a step of 20 ms, and 5 ms of arrival.
                prop_assert!(off.abs() < 0.005 + 0.006 * (v0[axis].abs() + v1[axis].abs()), "{off} {v0:?} {v1:?}");
            }
            prop_assert!(p1[2] <= 0.0, "never below the floor it stood on");
            prop_assert!(v1[0].hypot(v1[1]) <= 3.0 + 1e-3 && v1[2].abs() <= 0.8 + 1e-3);
        }
        prop_assert_eq!(flight.session.phase(), Phase::Flying);
    }

    #[test]
    fn hostile_datagrams_change_nothing(
        noise in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0xFDu8), Just(0), any::<u8>()], 0..300), 0..30), flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 0..20)
    ) {
        let mut flight = Flight::over_a_good_link();
        flight.go_on(2.0);
        flight.take_off(10.0);
        for datagram in &noise {
            flight.session.receive(flight.now_ns, datagram);
        }
        for (at, bit) in flips {
            let mut damaged = flight.px4.say("abc");
            let at = at.index(damaged.len());
            damaged[at] ^= 1 << bit;
            flight.session.receive(flight.now_ns, &damaged);
        }
        flight.go_on(3.0);
        prop_assert_eq!(flight.session.phase(), Phase::Flying);
        prop_assert_eq!(flight.session.words(), None);
    }

    /// Whatever a well-formed autopilot says in whatever order, nothing panics, and commands stay bounded.
    #[test]
    fn nonsense_in_good_frames_does_no_harm(
        texts in prop::collection::vec((prop_oneof![1 => Just(0u32), 9 => prop::sample::select(vec![31u32, 32, 77, 111, 253, 331])], prop::collection::vec(any::<u8>(), 0..60), 0..100u32), 0..200),
        begin_s in prop_oneof![Just(0.0), Just(1.2), Just(4.0), Just(6.0)],
    ) {
        let mut flight = Flight::over_a_good_link();
        flight.take_off(begin_s);
        let mut writer = FrameWriter::new(1, 1);
        for (id, payload, wait_ms) in texts {
            let message = robot_link::mavlink::message::Message::from_payload(id, &payload).expect("known");
            let frame = writer.write(&message);
            flight.session.receive(flight.now_ns, &frame);
            flight.session.fly(flight.now_ns);
            flight.go_on(f64::from(wait_ms) * 1e-3);
        }
        prop_assert!(flight.commands(400) + flight.commands(176) + flight.commands(21) <= 5 * 13);
        prop_assert!(flight.px4.violations.is_empty(), "{:?}", flight.px4.violations);
    }
}

/// A heartbeat from before the change of mode, held up on its way, is no operator.
#[test]
fn an_overtaken_heartbeat_takes_nothing_over() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    flight.take_off(10.0);
    let (_, number, mode) = flight.heartbeat.expect("heartbeats came");
    assert_eq!((flight.session.phase(), mode), (Phase::Flying, OFFBOARD));
    let before =
        Heartbeat { custom_mode: POSITION, vehicle_type: 2, autopilot: 12, base_mode: 1, ..Heartbeat::default() };
    let mut writer = FrameWriter { sequence: number.wrapping_sub(100), ..FrameWriter::new(1, 1) };
    let late = writer.write(&Message::Heartbeat(before));
    flight.session.receive(flight.now_ns, &late);
    assert_eq!(flight.session.phase(), Phase::Flying);
    // The same with a number that is due is one.
    writer.sequence = number.wrapping_add(20);
    let taken = writer.write(&Message::Heartbeat(before));
    flight.session.receive(flight.now_ns, &taken);
    assert_eq!(flight.session.phase(), Phase::Ended);
}

/// Somebody who starts the motors by hand before we have asked for it flies, whatever was planned.
#[test]
fn motors_that_somebody_else_starts_are_left_to_him() {
    // In the lead, and between the question for OFFBOARD and its answer.
    for (is_mute, wait_s) in [(false, 0.5), (true, 1.8)] {
        let mut flight = Flight::over_a_good_link();
        (flight.px4.is_mute, flight.px4.answer_to_mode) = (is_mute, u8::from(is_mute));
        flight.go_on(2.0);
        flight.take_off(wait_s);
        assert_eq!((flight.session.phase(), flight.commands(176) > 0), (Phase::Starting, is_mute));
        flight.px4.is_armed = true;
        flight.go_on(1.1);
        assert_eq!(flight.session.fault(), Some(&Fault::AlreadyArmed));
        assert_eq!((flight.session.phase(), flight.commands(400)), (Phase::Ended, 0));
        let ended_ns = flight.now_ns;
        flight.take_off(5.0);
        flight.go_on(5.0);
        assert_eq!((flight.px4.custom_mode, flight.controls_since(ended_ns)), (POSITION, 0));
    }
}

/// An estimate that jumps when arming has been asked for: motors that run are not left running.
#[test]
fn a_jump_while_arming_turns_the_motors_off_again() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    while !flight.px4.is_armed {
        flight.session.fly(flight.now_ns);
        flight.go_on(0.005);
    }
    assert_eq!(flight.session.phase(), Phase::Starting);
    flight.px4.position[0] += 4.0;
    flight.go_on(10.0);
    assert_eq!((flight.session.phase(), flight.session.fault()), (Phase::Landed, Some(&Fault::EstimatorReset)));
    assert!(!flight.px4.is_armed && flight.px4.violations.is_empty(), "{:?}", flight.px4.violations);
}

#[test]
fn silence_in_flight_is_answered_with_silence() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    flight.take_off(10.0);
    flight.follow(Vector3::new(0.0, 0.0, 2.0));
    flight.go_on(3.0);
    flight.down.loss = 1.0;
    let silent_ns = flight.now_ns;
    flight.go_on(2.0);
    // Where it is nobody knows: it is told to stand still.
    let blind: Vec<_> = flight.px4.set_points.iter().filter(|(at, ..)| *at > silent_ns + 700 * MS).collect();
    assert!(blind.len() > 50 && blind.iter().all(|(_, position, v)| position.is_none() && *v == [0.0; 3]));
    flight.go_on(2.0);
    assert!(matches!(flight.session.fault(), Some(Fault::LinkLost { .. })), "{:?}", flight.session.fault());
    assert!(flight.px4.set_points.iter().all(|(at, ..)| *at < silent_ns + 2600 * MS));
    assert!(flight.session.fault().expect("lost").to_string().contains("lost"));
}

#[test]
fn a_short_silence_is_stood_out() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    flight.take_off(10.0);
    for _ in 0..100 {
        flight.follow(Vector3::new(0.0, 0.0, 2.0));
        flight.go_on(0.05);
    }
    flight.down.loss = 1.0;
    flight.go_on(1.2);
    flight.down.loss = 0.0;
    for _ in 0..100 {
        flight.follow(Vector3::new(1.0, 0.0, 2.0));
        flight.go_on(0.05);
    }
    assert_eq!(flight.session.phase(), Phase::Flying);
    assert!((flight.px4.position[1] - 1.0).abs() < 0.05, "{:?}", flight.px4.position);
}

#[test]
fn an_estimator_that_jumps_is_landed_by_the_autopilot_itself() {
    let mut flight = Flight::over_a_good_link();
    flight.go_on(2.0);
    flight.take_off(10.0);
    for _ in 0..60 {
        flight.follow(Vector3::new(0.0, 0.0, 2.0));
        flight.go_on(0.05);
    }
    flight.px4.position[0] += 4.0;
    let jump_ns = flight.now_ns;
    flight.go_on(0.3);
    assert_eq!(flight.session.phase(), Phase::Landing);
    assert_eq!(flight.session.fault(), Some(&Fault::EstimatorReset));
    // What was under way when it jumped may still arrive.
    let after = flight.px4.set_points.iter().filter(|(at, ..)| *at > jump_ns + 60 * MS);
    assert!(after.clone().all(|(_, position, velocity)| position.is_none() && *velocity == [0.0; 3]));
    flight.go_on(10.0);
    assert_eq!(flight.session.phase(), Phase::Landed);
    assert!(flight.px4.violations.is_empty());
}

#[test]
fn refusals_are_told_in_words() {
    let ends = |prepare: fn(&mut ModelPx4)| {
        let mut flight = Flight::over_a_good_link();
        prepare(&mut flight.px4);
        flight.go_on(2.0);
        let words = flight.px4.say("Preflight Fail: no GPS");
        flight.session.receive(flight.now_ns, &words);
        flight.take_off(30.0);
        assert_eq!(flight.session.phase(), Phase::Ended);
        assert_eq!(flight.controls_since(flight.now_ns - 1), 0);
        flight.session.fault().cloned().expect("a fault")
    };
    let denied = ends(|px4| px4.answer_to_arming = 2);
    assert!(matches!(denied, Fault::Refused { step: Step::Arm, .. }));
    let text = denied.to_string();
    assert!(text.contains("to arm") && text.contains("denied") && text.contains("no GPS"), "{text}");
    let rejected = ends(|px4| px4.answer_to_mode = 1).to_string();
    assert!(rejected.contains("OFFBOARD") && rejected.contains("not in the present state"), "{rejected}");
    let deaf = ends(|px4| (px4.is_mute, px4.answer_to_mode) = (true, 1)).to_string();
    assert!(deaf.contains("5 times") && deaf.contains("OFFBOARD"), "{deaf}");
    assert_eq!(ends(|px4| px4.has_no_estimate = true), Fault::NoPosition);
    assert_eq!(ends(|px4| px4.is_armed = true), Fault::AlreadyArmed);
}

#[test]
fn another_systems_heartbeat_is_noticed_and_not_obeyed() {
    let mut flight = Flight::over_a_good_link();
    flight.px4.system_id = 7;
    flight.go_on(3.0);
    assert_eq!((flight.session.phase(), flight.session.foreign_system()), (Phase::Waiting, Some(7)));
}

#[test]
fn signed_flights_need_the_same_key() {
    for (ours, theirs, expected) in
        [(1u8, Some(1u8), Phase::Flying), (1, Some(2), Phase::Waiting), (1, None, Phase::Waiting)]
    {
        let mut flight = Flight::over_a_good_link();
        // Doubled frames are replays: every second copy is refused, the flight goes on. Overtaken ones would be refused too.
        (flight.down.doubling, flight.down.delay_ms) = (0.5, 0.0);
        flight.session.sign(SigningKey::new([ours; 32]), 0, 1_000_000);
        if let Some(theirs) = theirs {
            flight.px4.sign(SigningKey::new([theirs; 32]));
        }
        flight.go_on(3.0);
        flight.take_off(10.0);
        assert_eq!(flight.session.phase(), expected, "{:?}", flight.session.fault());
        let statistics = flight.session.statistics();
        match expected {
            Phase::Flying => assert!(statistics.replayed > 50 && statistics.bad_signatures == 0, "{statistics:?}"),
            _ => assert!(statistics.bad_signatures > 50 && statistics.messages == 0, "{statistics:?}"),
        }
    }
}

#[test]
fn bad_configurations_and_numbers_are_refused() {
    let config = SessionConfig { own_id: 1, ..SessionConfig::default() };
    assert!(OffboardSession::new(config, 0).is_err());
    let config = SessionConfig { lead_ns: 0, ..SessionConfig::default() };
    assert!(OffboardSession::new(config, 0).is_err());
    let mut session = OffboardSession::new(SessionConfig::default(), 0).expect("sound");
    let nan = Reference::resting_at(Vector3::new(0.0, f64::NAN, 0.0), 0.0);
    assert!(
        session.follow(0, &nan).is_err()
            && session.follow(0, &Reference::resting_at(Vector3::repeat(1e300), 0.0)).is_err()
    );
}
