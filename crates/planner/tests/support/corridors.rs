//! Random chains of polytopes and the limits they are flown with.

use nalgebra::Vector3;
use planner::{Airframe, FlightLimits, HalfSpace, Polytope};

use super::SplitMix;

/// A small multirotor; agile: faster, and time is dearer.
pub fn limits(is_agile: bool) -> FlightLimits {
    FlightLimits {
        max_speed_mps: if is_agile { 12.0 } else { 4.0 },
        max_accel_mps2: f64::INFINITY,
        airframe: Some(Airframe {
            mass_kg: 0.61,
            gravity_mps2: 9.8,
            drag_across: 0.7,
            drag_along: 0.8,
            drag_parasitic: 0.01,
            speed_epsilon: 1e-4,
        }),
        max_tilt_rad: 1.05,
        max_rate_radps: 2.1,
        min_thrust_n: 2.0,
        max_thrust_n: 12.0,
        min_duration_s: 0.05,
        time_weight: if is_agile { 500.0 } else { 20.0 },
    }
}

/// A chain of polytopes round a random polyline; odd seeds start in motion.
pub fn chain(seed: u64, count: usize) -> ([Vector3<f64>; 3], [Vector3<f64>; 3], Vec<Polytope>) {
    let mut random = SplitMix(seed);
    let mut between = |low: f64, high: f64| low + (high - low) * random.unit();
    let mut yaw = between(0.0, std::f64::consts::TAU);
    let mut way = vec![Vector3::new(0.0, 0.0, between(1.5, 3.5))];
    for k in 0..count {
        let length = between(2.5, 6.0);
        yaw += between(-70.0, 70.0f64).to_radians();
        let z = (way[k].z + between(-0.8, 0.8)).clamp(1.0, 5.0);
        way.push(Vector3::new(way[k].x + length * yaw.cos(), way[k].y + length * yaw.sin(), z));
    }
    let corridor = way
        .windows(2)
        .map(|w| {
            let mut faces = Vec::new();
            let mut add = |normal: Vector3<f64>, margin: f64| {
                faces.push(HalfSpace { normal, offset_m: normal.dot(&w[0]).max(normal.dot(&w[1])) + margin });
            };
            for k in 0..6 {
                let mut normal = Vector3::zeros();
                normal[k / 2] = if k % 2 == 0 { 1.0 } else { -1.0 };
                add(normal, if k < 4 { between(0.8, 2.0) } else { between(0.6, 1.2) });
            }
            for _ in 0..4 + between(0.0, 9.0) as usize {
                let v = Vector3::new(between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0));
                add(v.try_normalize(1e-6).unwrap_or(Vector3::x()), between(0.4, 1.4));
            }
            Polytope { faces }
        })
        .collect();
    let zero = Vector3::zeros();
    let v = if seed % 2 == 1 { 1.5 * (way[1] - way[0]).normalize() } else { zero };
    ([way[0], v, zero], [way[count], zero, zero], corridor)
}
