//! Motion, contacts and the IMU together.

mod support;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use omni_sim::contact::{CollisionShape, ContactWorld, ShapeGeometry, TouchCounter};
use omni_sim::ground_base::{GroundBase, GroundBaseConfig, VelocityCommand};
use omni_sim::imu::{Imu, ImuConfig, ImuRecord};
use omni_sim::mesh::TriangleMesh;
use omni_sim::motion::Motion;
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig};
use omni_sim::world::World;

/// What an odometry without noise may lose in ten seconds.
const POSE_TOL_M: f64 = 1e-3;

fn trunk() -> Vec<CollisionShape> {
    vec![
        CollisionShape {
            body_from_shape: Isometry3::identity(),
            geometry: ShapeGeometry::Box { half_m: Vector3::new(0.35, 0.16, 0.1) },
        },
        CollisionShape {
            body_from_shape: Isometry3::translation(0.0, 0.0, -0.2),
            geometry: ShapeGeometry::Cylinder { radius_m: 0.1, half_length_m: 0.11 },
        },
    ]
}

fn frame() -> Vec<CollisionShape> {
    vec![CollisionShape {
        body_from_shape: Isometry3::identity(),
        geometry: ShapeGeometry::Box { half_m: Vector3::new(0.25, 0.25, 0.08) },
    }]
}

/// A floor, a wall with its face at x = 2, a table (instance 3) at y = 2.
fn yard() -> World {
    let mut mesh = TriangleMesh::default();
    support::push_box(&mut mesh, [-9.0, -9.0, -0.2], [9.0, 9.0, 0.0], 0, [99; 3]);
    support::push_box(&mut mesh, [2.0, -9.0, 0.0], [2.1, 9.0, 2.5], 0, [99; 3]);
    support::push_box(&mut mesh, [-0.5, 2.0, 0.2], [0.5, 2.5, 0.7], 3, [99; 3]);
    World::new(mesh, vec![support::walker(77)], vec![]).unwrap()
}

/// Strapdown integration: trapezoidal rate and force, as a textbook has it.
fn integrate(
    motion: &dyn Motion,
    samples: &[ImuRecord],
    body_from_imu: &Isometry3<f64>,
) -> (Point3<f64>, UnitQuaternion<f64>) {
    let start = motion.at(samples[0].stamp_ns);
    let world_from_imu = start.world_from_body * body_from_imu;
    let mut rotation = world_from_imu.rotation;
    let mut position = Point3::from(world_from_imu.translation.vector);
    let lever = body_from_imu.translation.vector;
    let mut velocity =
        start.velocity_world + start.world_from_body.rotation * start.angular_velocity_body.cross(&lever);
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    for pair in samples.windows(2) {
        let dt = (pair[1].stamp_ns - pair[0].stamp_ns) as f64 * 1e-9;
        let rate = (pair[0].angular_velocity_radps + pair[1].angular_velocity_radps) / 2.0;
        // Second-order coning term of two neighbouring samples.
        let coning = pair[0].angular_velocity_radps.cross(&pair[1].angular_velocity_radps) * (dt * dt / 12.0);
        let next = rotation * UnitQuaternion::from_scaled_axis(rate * dt + coning);
        let a0 = rotation * pair[0].specific_force_mps2 + gravity;
        let a1 = next * pair[1].specific_force_mps2 + gravity;
        position += velocity * dt + (a0 / 3.0 + a1 / 6.0) * (dt * dt);
        velocity += (a0 + a1) * (dt / 2.0);
        rotation = next;
    }
    (position, rotation)
}

fn check_imu(motion: &dyn Motion, seconds: i64) {
    let body_from_imu = Isometry3::new(Vector3::new(0.1, -0.05, 0.12), Vector3::new(0.3, -0.2, 1.0));
    let mut imu = Imu::new(ImuConfig::noise_free(), body_from_imu).unwrap();
    let samples: Vec<ImuRecord> = (0..=seconds * 200).map(|i| imu.sample(motion, i * 5_000_000).unwrap()).collect();
    let (position, rotation) = integrate(motion, &samples, &body_from_imu);
    let truth = motion.at(seconds * 1_000_000_000).world_from_body * body_from_imu;
    let error = (position.coords - truth.translation.vector).norm();
    assert!(error < POSE_TOL_M, "position off by {error} m after {seconds} s");
    let turned = rotation.angle_to(&truth.rotation);
    assert!(turned < 1e-4, "rotation off by {turned} rad");
}

#[test]
fn integrating_imu_samples_of_a_walk_gives_the_pose() {
    let mut base = GroundBase::new(GroundBaseConfig::default(), 0, (1.0, 2.0, 0.5), 0.0).unwrap();
    for i in 0..501 {
        let t = f64::from(i) * 0.02;
        let command = VelocityCommand {
            forward_mps: 0.5 + 0.5 * (0.9 * t).sin(),
            left_mps: 0.2 * (1.3 * t).cos(),
            yaw_rate_radps: (0.7 * t).sin(),
        };
        base.step(0.02, &command, None).unwrap();
    }
    let height = base.track().pieces().map(|p| p.position[2].start.value);
    let (low, high) = height.fold((9.0_f64, 0.0_f64), |(l, h), z| (l.min(z), h.max(z)));
    assert!(high - low > 0.01 && high - low < 0.02, "the trunk heaves {} m", high - low);
    check_imu(base.track(), 10);
}

#[test]
fn integrating_imu_samples_of_a_flight_gives_the_pose() {
    let config = QuadrotorConfig {
        vibration_m: 0.0, // 120 Hz cannot be integrated from 200 samples a second
        ..QuadrotorConfig::x500()
    };
    let hover = config.hover_speed_radps();
    let start = Isometry3::translation(0.0, 0.0, 5.0);
    let mut robot = Quadrotor::new(config, 0, start, hover).unwrap();
    for i in 0..2501 {
        // A damped attitude loop around slowly moving angles keeps the flight within bounds.
        let t = f64::from(i) * 0.004;
        let state = robot.state();
        let (roll, pitch, _) = state.world_from_body.rotation.euler_angles();
        let w = state.angular_velocity_body;
        let x = 60.0 * (0.2 * (1.1 * t).sin() - roll) - 12.0 * w.x;
        let y = 60.0 * (0.15 * (0.8 * t).cos() - pitch) - 12.0 * w.y;
        let z = 30.0 * ((0.5 * t).sin() - w.z);
        let lift = hover - 20.0 * state.velocity_world.z;
        let commands = [lift - x - y - z, lift + x + y - z, lift + x - y + z, lift - x + y + z];
        robot.step(0.004, &commands, None).unwrap();
    }
    let end = robot.state();
    assert!(end.world_from_body.translation.vector.norm() < 100.0 && end.velocity_world.norm() > 0.1);
    check_imu(robot.track(), 10);
}

#[test]
fn half_the_step_gives_the_same_flight() {
    // The default steps of 1 ms against steps of 0.25 ms, open loop for two seconds with jumps of the commands.
    let flight = |step_s: f64| {
        let config = QuadrotorConfig::x500();
        let hover = config.hover_speed_radps();
        let mut robot = Quadrotor::new(config, 0, Isometry3::translation(0.0, 0.0, 5.0), hover).unwrap();
        for i in 0..8 {
            let d = if i % 2 == 0 { 3.0 } else { -3.0 };
            let commands = [hover + d, hover - d, hover + d, hover - d + 1.0];
            for _ in 0..(0.25 / step_s).round() as usize {
                robot.step(step_s, &commands, None).unwrap();
            }
        }
        robot.state().world_from_body
    };
    let (coarse, fine) = (flight(1e-3), flight(0.25e-3));
    let apart = (coarse.translation.vector - fine.translation.vector).norm();
    assert!(apart < 1e-3, "{apart} m apart after 2 s");
}

#[test]
fn a_wall_stops_the_base() {
    for yaw in [0.0, 0.4, -0.9] {
        let world = yard();
        let mut contacts = ContactWorld::new(&world, &trunk(), &[]).unwrap();
        let mut base = GroundBase::new(GroundBaseConfig::default(), 0, (0.3, -3.0, yaw), 0.0).unwrap();
        let ahead = VelocityCommand { forward_mps: 1.0, ..VelocityCommand::default() };
        let mut counter = TouchCounter::new(0.5);
        let mut deepest: f64 = 0.0;
        for _ in 0..250 {
            let touched = base.step(0.02, &ahead, Some(&mut contacts)).unwrap();
            counter.observe(&touched);
            deepest = touched.iter().map(|c| c.depth_m).fold(deepest, f64::max);
            assert!(touched.iter().all(|c| c.instance == 0 && c.normal.x < -0.9));
        }
        let x = base.state().world_from_body.translation.x;
        assert!((1.5..1.95).contains(&x), "yaw {yaw}: stands at x = {x}");
        assert!(deepest < 0.03, "yaw {yaw}: {deepest} m deep in the wall");
        assert_eq!(counter.touches().len(), 1, "yaw {yaw}");
        // And it can leave again, backwards or sideways: whatever leads away from the wall.
        let (_, _, yaw) = base.state().world_from_body.rotation.euler_angles();
        for _ in 0..100 {
            let back = VelocityCommand {
                forward_mps: -0.5 * yaw.cos(),
                left_mps: 0.4 * yaw.sin(),
                ..VelocityCommand::default()
            };
            base.step(0.02, &back, Some(&mut contacts)).unwrap();
        }
        let away = x - base.state().world_from_body.translation.x;
        assert!(away > 0.4, "yaw {yaw}: {away} m away from the wall");
    }
}

#[test]
fn walking_on_the_floor_is_no_contact_and_movers_touch() {
    let world = yard();
    let mut contacts = ContactWorld::new(&world, &trunk(), &[]).unwrap();
    // The walker (radius 0.2) goes along y = 1.5 from x = 1.5 to 3.5 within 4 s; the trunk reaches y = 1.41.
    let stand = |x: f64, y: f64, contacts: &mut ContactWorld| {
        let mut base = GroundBase::new(GroundBaseConfig::default(), 0, (x, y, 0.0), 0.0).unwrap();
        let mut touched = Vec::new();
        for _ in 0..200 {
            touched.extend(base.step(0.02, &VelocityCommand::default(), Some(contacts)).unwrap());
        }
        touched
    };
    assert!(stand(0.0, 0.0, &mut contacts).is_empty());
    let touched = stand(1.4, 1.25, &mut contacts);
    assert!(!touched.is_empty() && touched.iter().all(|c| c.instance == 77), "{touched:?}");
    let mut unheeding = ContactWorld::new(&world, &trunk(), &[77]).unwrap();
    assert!(stand(1.4, 1.25, &mut unheeding).is_empty());
}

#[test]
fn a_dropped_quadrotor_comes_to_rest_on_the_floor() {
    let world = yard();
    let mut contacts = ContactWorld::new(&world, &frame(), &[]).unwrap();
    let start = Isometry3::new(Vector3::new(0.0, -3.0, 0.6), Vector3::new(0.2, 0.1, 0.4));
    let mut robot = Quadrotor::new(QuadrotorConfig::x500(), 0, start, 0.0).unwrap();
    let mut counter = TouchCounter::new(0.5);
    for _ in 0..200 {
        let touched = robot.step(0.02, &[0.0; 4], Some(&mut contacts)).unwrap();
        counter.observe(&touched);
    }
    let state = robot.state();
    let z = state.world_from_body.translation.z;
    assert!((z - 0.08).abs() < 0.005, "rests at {z}");
    assert!(state.velocity_world.norm() < 0.02, "{}", state.velocity_world.norm());
    assert!((1..=2).contains(&counter.touches().len()));
}

#[test]
fn a_quadrotor_bounces_off_a_wall() {
    let world = yard();
    let mut contacts = ContactWorld::new(&world, &frame(), &[]).unwrap();
    let config = QuadrotorConfig::x500();
    let hover = config.hover_speed_radps();
    // Leaning forward towards the wall at x = 2.
    let start = Isometry3::new(Vector3::new(0.0, -3.0, 1.2), Vector3::new(0.0, 0.15, 0.0));
    let mut robot = Quadrotor::new(config, 0, start, hover).unwrap();
    let mut touched = Vec::new();
    let mut farthest: f64 = 0.0;
    for _ in 0..150 {
        touched.extend(robot.step(0.02, &[hover; 4], Some(&mut contacts)).unwrap());
        farthest = farthest.max(robot.state().world_from_body.translation.x);
    }
    assert!(touched.iter().any(|c| c.normal.x < -0.9), "it touches the wall");
    assert!(farthest < 1.85, "and does not go through: x = {farthest}");
    assert!(robot.state().is_finite());
}

#[test]
fn contact_of_a_box_with_a_wall_by_hand() {
    let world = yard();
    let mut contacts = ContactWorld::new(&world, &frame(), &[]).unwrap();
    // Half size 0.25: at x = 1.76 it is 1 cm in the wall.
    let found = contacts.contacts(&Isometry3::translation(1.76, -3.0, 1.0), 0);
    assert!(!found.is_empty());
    for c in &found {
        assert!((c.depth_m - 0.01).abs() < 1e-4, "{c:?}");
        assert!((c.normal + Vector3::x()).norm() < 1e-4, "{c:?}");
        assert!((c.point.x - 2.0).abs() < 1e-3 && c.instance == 0, "{c:?}");
    }
    assert!(contacts.contacts(&Isometry3::translation(1.74, -3.0, 1.0), 0).is_empty());
    // From above on the thing with instance 3 (its top is at 0.7).
    let found = contacts.contacts(&Isometry3::translation(0.0, 2.2, 0.775), 0);
    assert!(found.iter().all(|c| c.instance == 3 && c.normal.z > 0.99) && !found.is_empty());
}
