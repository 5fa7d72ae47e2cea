//! All the space that moving things will pass, as obstacles that stand.

use nalgebra::{Point3, Vector3};

use super::movers::Movers;
use super::obstacles::nearest_on_segment;

/// Distance between the points that stand for a surface (m).
const SPACING_M: f64 = 0.1;

/// Balls drawn along their ways, each with the radius it will have at the end.
pub(crate) struct Swept {
    capsules: Vec<Capsule>,
    obstacle_radius_m: f64,
}

struct Capsule {
    from: Vector3<f64>,
    to: Vector3<f64>,
    radius_m: f64,
}

impl Swept {
    pub fn new(movers: &Movers, obstacle_radius_m: f64) -> Self {
        let capsules = movers.list.iter().map(|mover| Capsule {
            from: mover.position.coords,
            to: mover.position.coords + mover.velocity_mps * movers.horizon_s,
            radius_m: (mover.radius_m + mover.growth_mps * movers.horizon_s).max(0.0),
        });
        Swept { capsules: capsules.collect(), obstacle_radius_m }
    }

    /// Distance to the nearest obstacle point if the surfaces were made of them: a point's own ball begins at the surface.
    pub fn distance_m(&self, p: &Point3<f64>) -> f64 {
        let beside = |c: &Capsule| (p.coords - nearest_on_segment(&c.from, &c.to, &p.coords)).norm() - c.radius_m;
        self.capsules.iter().map(beside).fold(f64::INFINITY, f64::min).max(0.0) + self.obstacle_radius_m
    }

    /// Points of the surfaces in a box.
    pub fn points_in(&self, low: &Point3<f64>, high: &Point3<f64>) -> Vec<Point3<f64>> {
        const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
        let mut points = Vec::new();
        for capsule in &self.capsules {
            let length = (capsule.to - capsule.from).norm();
            // Numbers that make no sense would be points without end.
            if !(length < 100.0 && capsule.radius_m < 10.0) {
                continue;
            }
            let balls = (length / SPACING_M).ceil() as usize + 1;
            let inner_m = (capsule.radius_m - self.obstacle_radius_m).max(0.0);
            let count = (4.0 * std::f64::consts::PI * (inner_m / SPACING_M).powi(2)).ceil().max(1.0) as usize;
            for ball in 0..balls {
                let centre = capsule.from + (capsule.to - capsule.from) * (ball as f64 / (balls - 1).max(1) as f64);
                for k in 0..count {
                    let z = 1.0 - 2.0 * (k as f64 + 0.5) / count as f64;
                    let (sin, cos) = (GOLDEN_ANGLE * k as f64).sin_cos();
                    let across = (1.0 - z * z).max(0.0).sqrt();
                    let p = Point3::from(centre + Vector3::new(across * cos, across * sin, z) * inner_m);
                    if (0..3).all(|axis| p[axis] >= low[axis] && p[axis] <= high[axis]) {
                        points.push(p);
                    }
                }
            }
        }
        points
    }
}
