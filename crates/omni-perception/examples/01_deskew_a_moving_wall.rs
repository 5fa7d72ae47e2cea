//! A robot turns while its LiDAR sweeps a room. Raw, the flat wall is bent; deskewed, it is flat again.
//!
//! Run: `cargo run -p omni-perception --example 01_deskew_a_moving_wall`

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use omni_perception::*;

const SWEEP_NS: u32 = 100_000_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. The motion: 1 m/s ahead while turning left with 2 rad/s. Odometry gives a knot every 5 ms.
    let world_from_body = |t_s: f64| {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0 * t_s);
        Isometry3::from_parts(Vector3::new(t_s, 0.0, 0.3).into(), turn)
    };
    let knots: Vec<OdometryEstimate> = (0..=20)
        .map(|k| OdometryEstimate {
            velocity_in_world_mps: Vector3::new(1.0, 0.0, 0.0),
            angular_velocity_in_body_radps: Vector3::new(0.0, 0.0, 2.0),
            ..OdometryEstimate::at_rest(Stamp(5_000_000 * k), world_from_body(0.005 * k as f64))
        })
        .collect();
    let trajectory = Trajectory::from_estimates(&knots)?;

    // 2. The LiDAR turns on a motor (half a turn a second) above the body; the encoder reads its angle.
    let mount = RotatingMount {
        body_from_stator: Isometry3::translation(0.0, 0.0, 0.3),
        rotor_from_sensor: Isometry3::rotation(Vector3::new(0.0, 0.5, 0.0)),
    };
    let angle = |t_s: f64| std::f64::consts::PI * t_s;
    let samples: Vec<EncoderSample> =
        (0..=50).map(|k| EncoderSample { stamp: Stamp(2_000_000 * k), angle_rad: angle(0.002 * k as f64) }).collect();
    let encoder = EncoderTrack::from_samples(&samples)?;

    // 3. One sweep of a wall at x = 4 m, each point seen from where the sensor is at its own time.
    let mut scan = RawScan { start: Stamp(0), points: Vec::new() };
    for k in 0..500_u32 {
        let offset_ns = k * (SWEEP_NS / 500);
        let t_s = f64::from(offset_ns) * 1e-9;
        let on_wall = Point3::new(4.0, -2.0 + 0.008 * f64::from(k), 0.5 + 0.002 * f64::from(k % 100));
        let world_from_sensor = world_from_body(t_s) * mount.body_from_sensor(angle(t_s));
        let position = (world_from_sensor.inverse() * on_wall).cast::<f32>();
        scan.points.push(RawPoint { position, offset_ns, ring: 0 });
    }

    // 4. With the pose of the start for all points the wall bends by decimetres.
    let world_from_sensor = (world_from_body(0.0) * mount.body_from_sensor(0.0)).cast::<f32>();
    let bent = scan.points.iter().map(|p| (world_from_sensor * p.position).x - 4.0);
    println!("as measured: the wall is off by up to {:.2} m", bent.fold(0.0, |worst: f32, x| worst.max(x.abs())));

    // 5. Deskewed (OmniVLN Eq. 1 on the knots) it is flat.
    let still = deskew(&scan, &encoder, &mount, &trajectory, ReferenceTime::End, &DeskewConfig::default())?;
    let flat = still.points_in_world().iter().map(|p| (p.x - 4.0).abs()).fold(0.0, f32::max);
    println!("deskewed: {} points off by at most {:.3} mm", still.points_in_body.len(), flat * 1e3);
    assert!(flat < 1e-4);
    Ok(())
}
