//! Laws of the parts: regions, motion, contacts, random numbers.

mod support;

use nalgebra::Isometry3;
use omni_sim::contact::{Contact, TouchCounter};
use omni_sim::ground_base::{GroundBase, GroundBaseConfig, VelocityCommand};
use omni_sim::lidar::RotatingMount;
use omni_sim::motion::Motion;
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig};
use omni_sim::region::{Region, Run, regions_of};
use omni_sim::track::MotionTrack;
use proptest::prelude::*;

const WIDTH: u32 = 14;
const HEIGHT: u32 = 9;

/// Blotches: mostly runs, often full columns, touching the borders and the seam.
fn region() -> impl Strategy<Value = Region> {
    let run = (0..WIDTH, prop_oneof![Just(0), 0..HEIGHT], prop_oneof![Just(HEIGHT), 0..=HEIGHT]);
    prop::collection::vec(run, 0..20).prop_map(|runs| {
        let runs = runs.into_iter().map(|(column, from, to)| Run { column, from, to });
        Region::from_runs(runs.collect())
    })
}

fn pixels(region: &Region) -> Vec<bool> {
    let counts = region.coco_counts(WIDTH, HEIGHT);
    let runs = counts.iter().enumerate();
    runs.flat_map(|(i, &n)| std::iter::repeat_n(i % 2 == 1, n as usize)).collect()
}

fn is_in(pixels: &[bool], column: i64, row: i64) -> Option<bool> {
    ((0..i64::from(WIDTH)).contains(&column) && (0..i64::from(HEIGHT)).contains(&row))
        .then(|| pixels[(column * i64::from(HEIGHT) + row) as usize])
}

/// Whether any (or all) pixels of the picture within `radius` of a pixel are set.
fn around(pixels: &[bool], radius: i64, test: fn(&[bool]) -> bool) -> Vec<bool> {
    let mut out = Vec::new();
    for column in 0..i64::from(WIDTH) {
        for row in 0..i64::from(HEIGHT) {
            let near: Vec<bool> = (-radius..=radius)
                .flat_map(|x| (-radius..=radius).map(move |y| (x, y)))
                .filter(|(x, y)| x * x + y * y <= radius * radius)
                .filter_map(|(x, y)| is_in(pixels, column + x, row + y))
                .collect();
            out.push(test(&near));
        }
    }
    out
}

proptest! {
    #[test]
    fn coco_counts_and_pixels_are_the_same_thing(region in region()) {
        let counts = region.coco_counts(WIDTH, HEIGHT);
        prop_assert_eq!(counts.iter().sum::<u32>(), WIDTH * HEIGHT);
        prop_assert!(counts.iter().skip(1).all(|&n| n > 0));
        let values: Vec<u32> = pixels(&region).iter().map(|&p| u32::from(p)).collect();
        let back = regions_of(&values, HEIGHT).remove(&1).unwrap_or_default();
        prop_assert_eq!(back, region);
    }

    #[test]
    fn dilation_and_erosion_are_those_of_a_disc(region in region(), radius in 0_u32..4) {
        let before = pixels(&region);
        let r = i64::from(radius);
        let grown = pixels(&region.dilated(radius, WIDTH, HEIGHT));
        prop_assert_eq!(grown, around(&before, r, |near| near.contains(&true)));
        let shrunk = pixels(&region.eroded(radius, WIDTH, HEIGHT));
        prop_assert_eq!(shrunk, around(&before, r, |near| !near.contains(&false)));
    }

    #[test]
    fn parts_at_the_seam_are_the_whole(region in region()) {
        let parts = region.clone().split_at_seam(WIDTH);
        prop_assert!(parts.len() <= 2);
        let runs: Vec<Run> = parts.iter().flat_map(|p| p.runs().to_vec()).collect();
        prop_assert_eq!(Region::from_runs(runs), region);
    }

    #[test]
    fn shifting_there_and_back_loses_only_what_left_the_picture(
        region in region(), x in -3_i64..=3, y in -3_i64..=3
    ) {
        let back = region.shifted(x, y, WIDTH, HEIGHT).shifted(-x, -y, WIDTH, HEIGHT);
        let before = pixels(&region);
        for (i, set) in pixels(&back).iter().enumerate() {
            let (column, row) = (i as i64 / i64::from(HEIGHT), i as i64 % i64::from(HEIGHT));
            let stays = is_in(&before, column + x, row + y).is_some();
            prop_assert_eq!(*set, stays && before[i]);
        }
    }
}

/// Position, velocity, acceleration, rotation, rate and angular acceleration agree where pieces meet.
fn check_joints(track: &MotionTrack) -> Result<(), TestCaseError> {
    let pieces: Vec<_> = track.pieces().collect();
    for pair in pieces.windows(2) {
        let meet = pair[1].start_ns;
        prop_assert_eq!(pair[0].start_ns + pair[0].duration_ns, meet);
        let (a, b) = (pair[0].at(meet), pair[1].at(meet));
        let scale = 1.0 + a.acceleration_world.norm() + a.angular_acceleration_body.norm();
        let jump = (a.world_from_body.translation.vector - b.world_from_body.translation.vector).norm()
            + a.world_from_body.rotation.angle_to(&b.world_from_body.rotation)
            + (a.velocity_world - b.velocity_world).norm()
            + (a.angular_velocity_body - b.angular_velocity_body).norm()
            + (a.acceleration_world - b.acceleration_world).norm()
            + (a.angular_acceleration_body - b.angular_acceleration_body).norm();
        prop_assert!(jump < 1e-7 * scale, "a jump of {} at {}", jump, meet);
    }
    Ok(())
}

fn command() -> impl Strategy<Value = VelocityCommand> {
    let number = || prop_oneof![Just(0.0), Just(5.0), Just(-5.0), -1.0..1.0];
    (number(), number(), number()).prop_map(|(forward_mps, left_mps, yaw_rate_radps)| VelocityCommand {
        forward_mps,
        left_mps,
        yaw_rate_radps,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn any_commands_give_a_smooth_walk_within_the_limits(
        commands in prop::collection::vec((command(), 1_usize..30, 0.001_f64..0.05), 1..8)
    ) {
        let config = GroundBaseConfig::default();
        let mut base = GroundBase::new(config.clone(), 17, (0.0, 0.0, 3.1), 0.0).unwrap();
        for (command, times, dt_s) in commands {
            for _ in 0..times {
                base.step(dt_s, &command, None).unwrap();
                let v = base.velocity();
                // A command that turns round in full acceleration overshoots by what the jerk limit needs.
                prop_assert!(v.forward_mps < config.max_speed_mps + 0.1, "{:?}", v);
                prop_assert!(v.forward_mps > -config.max_reverse_mps - 0.1, "{:?}", v);
                prop_assert!(v.left_mps.abs() < config.max_lateral_mps + 0.1, "{:?}", v);
                prop_assert!(v.yaw_rate_radps.abs() < config.max_yaw_rate_radps + 0.2, "{:?}", v);
                let z = base.state().world_from_body.translation.z - config.stance_height_m;
                prop_assert!(z.abs() < 0.03, "the trunk is {} m off", z);
            }
        }
        check_joints(base.track())?;
    }

    #[test]
    fn any_rotor_commands_give_a_smooth_flight(
        commands in prop::collection::vec((prop::array::uniform4(0.0_f64..1200.0), 0.0005_f64..0.03), 1..12)
    ) {
        let start = Isometry3::translation(0.0, 0.0, 50.0);
        let mut robot = Quadrotor::new(QuadrotorConfig::x500(), -5, start, 700.0).unwrap();
        for (command, dt_s) in commands {
            robot.step(dt_s, &command, None).unwrap();
            prop_assert!(robot.state().is_finite());
            prop_assert!(robot.rotor_speeds_radps().iter().all(|w| (0.0..=1000.0).contains(w)));
        }
        check_joints(robot.track())?;
        // The track answers inside its span, and forgetting the past does not change the rest.
        let (from, to) = robot.track().span_ns();
        let middle = (from + to) / 2;
        let before = robot.track().at(middle);
        robot.forget_before(middle);
        prop_assert_eq!(robot.track().at(middle), before);
    }

    #[test]
    fn the_motor_turns_evenly(stamp_ns in -10_i64.pow(18)..10_i64.pow(18), dt_ns in 0_i64..1_000_000_000) {
        let mount = RotatingMount::rotating(Isometry3::identity());
        let turned = mount.angle_rad(stamp_ns + dt_ns) - mount.angle_rad(stamp_ns);
        let expected = std::f64::consts::PI * dt_ns as f64 * 1e-9;
        let apart = (turned - expected).rem_euclid(std::f64::consts::TAU);
        prop_assert!(apart.min(std::f64::consts::TAU - apart) < 1e-6);
        prop_assert!((0.0..std::f64::consts::TAU).contains(&mount.angle_rad(stamp_ns)));
    }

    #[test]
    fn a_lasting_touch_is_one_collision(gaps_ms in prop::collection::vec(1_i64..900, 1..30)) {
        let mut counter = TouchCounter::new(0.5);
        let mut stamp_ns = 0;
        let mut expected = 1;
        let touch = |stamp_ns| Contact {
            stamp_ns,
            instance: 3,
            point: nalgebra::Point3::origin(),
            normal: nalgebra::Vector3::x(),
            depth_m: 0.01,
        };
        counter.observe(&[touch(0), touch(0)]);
        for gap in gaps_ms {
            stamp_ns += gap * 1_000_000;
            expected += usize::from(gap >= 500);
            counter.observe(&[touch(stamp_ns)]);
        }
        prop_assert_eq!(counter.touches().len(), expected);
    }
}
