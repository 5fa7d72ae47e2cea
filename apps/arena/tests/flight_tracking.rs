//! How well the simulated aircraft follows: a circle of 2 m at 1.6 m/s, set-points at 50 Hz as a mission sends them.

mod support;

use arena::body::SimulatedBody;
use arena::estimate_frame::EstimateFrame;
use arena::mission::robot_model::RobotKind;
use arena::mission::stream::{Command, FlightSetPoint};
use nalgebra::{Isometry3, Point3, Vector3};

const RADIUS_M: f64 = 2.0;
const RATE_RADPS: f64 = 1.6 / RADIUS_M;
/// Above every building: nothing to touch.
const HEIGHT_M: f64 = 50.0;

fn circle(t_s: f64) -> FlightSetPoint {
    let (s, c) = (RATE_RADPS * t_s).sin_cos();
    let w = RATE_RADPS;
    FlightSetPoint {
        position_in_world: Point3::new(RADIUS_M * c, RADIUS_M * s, HEIGHT_M),
        velocity_in_world_mps: Vector3::new(-s, c, 0.0) * (RADIUS_M * w),
        acceleration_in_world_mps2: Vector3::new(-c, -s, 0.0) * (RADIUS_M * w * w),
        jerk_in_world_mps3: Vector3::new(s, -c, 0.0) * (RADIUS_M * w * w * w),
        yaw_rad: 0.0,
        yaw_rate_radps: 0.0,
        is_armed: true,
    }
}

/// Root mean square and largest distance to `follow`ed points, from 3 s on.
fn errors(follow: impl Fn(f64) -> FlightSetPoint) -> (f64, f64) {
    const TICK_NS: i64 = 5_000_000;
    let robot = support::robot(RobotKind::Aerial);
    let scene = support::scene("spin");
    let start = Isometry3::translation(RADIUS_M, 0.0, HEIGHT_M);
    let mut body = SimulatedBody::new(&robot, &scene.world, &start, false).expect("a body");
    // It believes what is true: here the controller is measured, not the odometry.
    let believed = EstimateFrame::at_start(&start, &start);
    let (mut sum, mut count, mut most) = (0.0, 0, 0.0f64);
    for tick in 0..3600 {
        let now_ns = tick * TICK_NS;
        let command = Command::Flight(follow(now_ns as f64 * 1e-9));
        if tick % 4 == 0 {
            body.hear(&command, now_ns);
        }
        body.advance(&command, now_ns, TICK_NS, &believed).expect("it flies");
        let t_s = (now_ns + TICK_NS) as f64 * 1e-9;
        if t_s > 3.0 {
            let off = body.state().world_from_body.translation.vector - circle(t_s).position_in_world.coords;
            sum += off.norm_squared();
            count += 1;
            most = most.max(off.norm());
        }
    }
    ((sum / f64::from(count)).sqrt(), most)
}

#[test]
fn a_circle_is_followed_within_eight_centimetres_and_feed_forward_is_why() {
    let (rmse_m, most_m) = errors(circle);
    let without = |t_s: f64| FlightSetPoint {
        acceleration_in_world_mps2: Vector3::zeros(),
        jerk_in_world_mps3: Vector3::zeros(),
        ..circle(t_s)
    };
    let (plain_m, _) = errors(without);
    println!(
        "2 m circle at 1.6 m/s: RMSE {rmse_m:.4} m, largest {most_m:.4} m; without feed-forward RMSE {plain_m:.4} m"
    );
    assert!(rmse_m <= 0.08, "{rmse_m}");
    assert!(plain_m > rmse_m, "{plain_m}");
}
