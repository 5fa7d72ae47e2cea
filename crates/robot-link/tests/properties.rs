//! Laws of the edge: conversions undo each other, messages survive the wire, and no bytes do harm.

mod support;

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

fn vector() -> impl Strategy<Value = Vector3<f64>> {
    [-100.0..100.0f64, -100.0..100.0, -100.0..100.0].prop_map(Vector3::from)
}

fn attitude() -> impl Strategy<Value = UnitQuaternion<f64>> {
    use std::f64::consts::{FRAC_PI_2, PI};
    let angle = || prop_oneof![Just(0.0), Just(FRAC_PI_2), Just(PI), Just(-PI), -3.2..3.2f64];
    [angle(), angle(), angle()].prop_map(|[r, p, y]| UnitQuaternion::from_euler_angles(r, p, y))
}

mod frames {
    use super::*;
    use robot_link::frames::*;

    proptest! {
        #[test]
        fn world_vectors_come_back(v in vector()) {
            prop_assert_eq!(enu_from_ned(&ned_from_enu(&v)), v);
            prop_assert_eq!(ned_from_enu(&enu_from_ned(&v)), v);
            prop_assert_eq!(flu_from_frd(&frd_from_flu(&v)), v);
        }

        #[test]
        fn attitudes_come_back(q in attitude()) {
            prop_assert!(enu_flu_attitude(&ned_frd_attitude(&q)).angle_to(&q) < 1e-7);
            prop_assert!(ned_frd_attitude(&enu_flu_attitude(&q)).angle_to(&q) < 1e-7);
            prop_assert!(local_flu_attitude(&local_frd_attitude(&q)).angle_to(&q) < 1e-7);
        }

        /// Turning a body vector into the world and changing axes commute: the law that catches any mix-up.
        #[test]
        fn attitude_and_vectors_agree(q in attitude(), v in vector()) {
            let through_enu = ned_from_enu(&(q * v));
            let through_frd = ned_frd_attitude(&q) * frd_from_flu(&v);
            prop_assert!((through_enu - through_frd).norm() < 1e-9);
            let local = frd_from_flu(&(q * v)) - local_frd_attitude(&q) * frd_from_flu(&v);
            prop_assert!(local.norm() < 1e-9);
        }

        #[test]
        fn handedness_is_kept(a in vector(), b in vector()) {
            prop_assert!((ned_from_enu(&a.cross(&b)) - ned_from_enu(&a).cross(&ned_from_enu(&b))).norm() < 1e-8);
            prop_assert!((frd_from_flu(&a.cross(&b)) - frd_from_flu(&a).cross(&frd_from_flu(&b))).norm() < 1e-8);
        }

        #[test]
        fn yaw_agrees_with_the_attitude(yaw in -10.0..10.0f64) {
            let q = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let ned = ned_frd_attitude(&q).euler_angles().2;
            prop_assert!(wrapped(ned - ned_yaw(yaw)).abs() < 1e-9);
            prop_assert!(wrapped(enu_yaw(ned_yaw(yaw)) - yaw).abs() < 1e-9);
            prop_assert!(ned_yaw(yaw) > -std::f64::consts::PI - 1e-12 && ned_yaw(yaw) <= std::f64::consts::PI);
        }

        /// The variance in any direction is the same in both worlds.
        #[test]
        fn covariance_follows_the_axes(entries in prop::collection::vec(-1.0..1.0f64, 36), a in vector(), b in vector()) {
            let root = Matrix6::from_iterator(entries);
            let covariance = root * root.transpose();
            let stack = |a: Vector3<f64>, b: Vector3<f64>| nalgebra::Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z);
            let direction = stack(a, b).normalize();
            let turned = stack(frd_from_flu(&a), frd_from_flu(&b)).normalize();
            let before = direction.dot(&(covariance * direction));
            let after = turned.dot(&(local_frd_covariance(&covariance) * turned));
            prop_assert!((before - after).abs() < 1e-9, "{before} {after}");
        }
    }
}

mod mavlink {
    use super::*;
    use robot_link::mavlink::offboard::{SetPoint, odometry, position_target};
    use robot_link::mavlink::*;
    use support::messages::message;

    proptest! {
        #[test]
        fn messages_survive_the_wire(messages in prop::collection::vec(message(), 1..6), cut in 1..40usize) {
            let mut writer = FrameWriter { sequence: 254, ..FrameWriter::new(7, 8) };
            let stream: Vec<u8> = messages.iter().flat_map(|message| writer.write(message)).collect();
            // Fed in pieces of any size.
            let mut reader = FrameReader::new();
            let received: Vec<Received> = stream.chunks(cut).flat_map(|piece| reader.read(piece)).collect();
            prop_assert_eq!(received.iter().map(|r| r.message.clone()).collect::<Vec<_>>(), messages);
            prop_assert!(received.iter().enumerate().all(|(i, r)| r.sequence == 254u8.wrapping_add(i as u8) && r.system_id == 7));
            prop_assert_eq!(reader.statistics.skipped_bytes, 0);
        }

        #[test]
        fn a_flipped_bit_is_noticed(message in message(), at in any::<prop::sample::Index>(), bit in 0..8u32) {
            let mut frame = FrameWriter::new(7, 8).write(&message);
            let at = at.index(frame.len());
            frame[at] ^= 1 << bit;
            let mut reader = FrameReader::new();
            let received = reader.read(&frame);
            // The compat byte is the only one outside meaning, and it is inside the checksum: nothing gets through.
            prop_assert!(received.is_empty(), "{received:?}");
        }

        #[test]
        fn good_frames_are_found_in_noise(message in message(), before in prop::collection::vec(any::<u8>(), 0..300)) {
            let frame = FrameWriter::new(7, 8).write(&message);
            // Noise may look like the start of a long frame; its end must then arrive before it is given up.
            let stream: Vec<u8> = before.iter().copied().chain(frame).chain([0; 300]).collect();
            let mut reader = FrameReader::new();
            let received = reader.read(&stream);
            prop_assert!(received.iter().any(|r| r.message == message));
        }

        #[test]
        fn noise_never_panics_and_is_not_kept(noise in prop::collection::vec(prop_oneof![Just(0xFDu8), Just(0xFE), Just(0), any::<u8>()], 0..600), cut in 1..64usize) {
            let mut reader = FrameReader::new();
            let taken: usize = noise.chunks(cut).map(|piece| reader.read(piece).len()).sum();
            prop_assert!(taken <= noise.len() / 8);
            let before_end = reader.statistics.skipped_bytes;
            reader.end_of_datagram();
            prop_assert!(reader.statistics.skipped_bytes - before_end < 300, "at most one unfinished frame is held");
            if taken == 0 {
                prop_assert_eq!(reader.statistics.skipped_bytes, noise.len() as u64);
            }
        }

        #[test]
        fn payloads_of_any_length_are_read(id in prop_oneof![Just(0u32), Just(31), Just(32), Just(76), Just(77), Just(84), Just(111), Just(253), Just(331), any::<u32>()], payload in prop::collection::vec(any::<u8>(), 0..260)) {
            let known = robot_link::mavlink::message::specification(id);
            prop_assert_eq!(Message::from_payload(id, &payload).is_some(), known.is_some());
        }

        #[test]
        fn a_set_point_is_the_same_place_for_px4(p in vector(), v in vector(), yaw in -3.0..3.0f64, rate in -2.0..2.0f64) {
            let set_point = SetPoint { position_in_world: Some(p), velocity_in_world: Some(v), yaw_rad: Some(yaw), yaw_rate_radps: Some(rate), ..SetPoint::default() };
            let target = position_target(1, (1, 1), &set_point).expect("finite");
            let back = |ned: [f32; 3]| robot_link::frames::enu_from_ned(&Vector3::from(ned.map(f64::from)));
            prop_assert!((back(target.position) - p).amax() < 1e-5 && (back(target.velocity) - v).amax() < 1e-5);
            prop_assert!((robot_link::frames::enu_yaw(f64::from(target.yaw)) - yaw).abs() < 1e-6);
            prop_assert!((f64::from(target.yaw_rate) + rate).abs() < 1e-6);
        }

        /// PX4 turns the body velocity with the attitude it is given: the result must be the velocity we meant.
        #[test]
        fn odometry_is_consistent(p in vector(), q in attitude(), v in vector()) {
            let pose = Isometry3::from_parts(Translation3::from(p), q);
            let sent = odometry(1, &pose, &(q.inverse() * v), &Vector3::zeros(), Some(&Matrix6::identity()), 0).expect("finite");
            let [w, x, y, z] = sent.attitude.map(f64::from);
            let attitude = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            let in_local_frd = attitude * Vector3::from(sent.velocity.map(f64::from));
            prop_assert!((robot_link::frames::flu_from_frd(&in_local_frd) - v).amax() < 1e-3);
            prop_assert_eq!(sent.pose_covariance[0], 1.0);
            prop_assert_eq!(sent.pose_covariance[6], 1.0, "row 1 begins behind six entries");
        }
    }
}

mod unitree {
    use super::*;
    use robot_link::unitree::cdr::CdrReader;
    use robot_link::unitree::*;

    proptest! {
        #[test]
        fn requests_come_back(
            id in any::<i64>(), api_id in any::<i64>(), lease_id in any::<i64>(), priority in any::<i32>(), no_reply in any::<bool>(),
            parameter in ".{0,40}", binary in prop::collection::vec(any::<u8>(), 0..20)
        ) {
            let request = Request { id, api_id, lease_id, priority, no_reply, parameter: parameter.clone(), binary: binary.clone() };
            prop_assert_eq!(Request::from_cdr(&request.to_cdr()), Ok(request));
            let response = Response { id, api_id, code: priority, data: parameter, binary };
            prop_assert_eq!(Response::from_cdr(&response.to_cdr()), Ok(response));
        }

        #[test]
        fn a_cut_payload_is_refused(at in any::<prop::sample::Index>(), text in "[a-z]{0,20}") {
            let request = Request { parameter: text.clone(), binary: vec![1], ..Request::default() }.to_cdr();
            prop_assert!(Request::from_cdr(&request[..at.index(request.len())]).is_err());
            let response = Response { data: text, binary: vec![1], ..Response::default() }.to_cdr();
            prop_assert!(Response::from_cdr(&response[..at.index(response.len())]).is_err());
            let state = SportModeState::default().to_cdr();
            prop_assert!(SportModeState::from_cdr(&state[..at.index(state.len())]).is_err());
        }

        #[test]
        fn random_bytes_never_panic(mut bytes in prop::collection::vec(prop_oneof![Just(0u8), Just(255), any::<u8>()], 0..400), is_headed in any::<bool>()) {
            if is_headed {
                bytes.splice(0..0, [0, 1, 0, 0]);
            }
            let _ = Request::from_cdr(&bytes);
            let _ = Response::from_cdr(&bytes);
            let _ = SportModeState::from_cdr(&bytes);
            if let Ok(mut reader) = CdrReader::new(&bytes) {
                for _ in 0..8 {
                    let _ = reader.string();
                    let _ = reader.number::<8>();
                }
            }
        }

        #[test]
        fn velocities_are_json_numbers(x in prop_oneof![Just(-0.0), Just(1e300), Just(5e-324), -4.0..4.0f64], y in -1.0..1.0f64) {
            let request = Call::Move { forward_mps: x, left_mps: y, yaw_rate_radps: 0.0 }.request(1).expect("finite");
            let inner = request.parameter.strip_prefix("{\"x\":").and_then(|t| t.strip_suffix(",\"z\":0}")).expect("the two ends");
            let (first, second) = inner.split_once(",\"y\":").expect("the middle");
            prop_assert!(first.chars().chain(second.chars()).all(|c| c.is_ascii_digit() || c == '.' || c == '-'), "plain JSON numbers");
            prop_assert_eq!((first.parse(), second.parse()), (Ok(x), Ok(y)));
        }
    }
}
