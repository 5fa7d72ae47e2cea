//! A polyline to follow: projection, look-ahead.

use nalgebra::{Point2, Vector2};

/// A polyline with the arc length at each point.
#[derive(Debug, Clone)]
pub(crate) struct Path<'a> {
    points: &'a [Point2<f64>],
    at: Vec<f64>,
}

impl<'a> Path<'a> {
    /// `None` for an empty path or one with numbers that are not finite.
    pub fn new(points: &'a [Point2<f64>]) -> Option<Path<'a>> {
        if points.is_empty() || points.iter().any(|p| !(p.x.is_finite() && p.y.is_finite())) {
            return None;
        }
        let mut at = vec![0.0];
        for leg in points.windows(2) {
            at.push(at[at.len() - 1] + (leg[1] - leg[0]).norm());
        }
        Some(Path { points, at })
    }

    pub fn length(&self) -> f64 {
        self.at[self.at.len() - 1]
    }

    pub fn end(&self) -> Point2<f64> {
        self.points[self.points.len() - 1]
    }

    /// Arc length of the nearest point of the path and the distance to it; the first one where several are.
    pub fn project(&self, p: &Point2<f64>) -> (f64, f64) {
        let mut best = (0.0, (p - self.points[0]).norm_squared());
        for (k, leg) in self.points.windows(2).enumerate() {
            let u = leg[1] - leg[0];
            let length = self.at[k + 1] - self.at[k];
            if length <= 0.0 {
                continue;
            }
            let t = ((p - leg[0]).dot(&u) / (length * length)).clamp(0.0, 1.0);
            let squared = (p - (leg[0] + u * t)).norm_squared();
            if squared < best.1 - 1e-12 {
                best = (self.at[k] + t * length, squared);
            }
        }
        (best.0, best.1.sqrt())
    }

    /// The point at an arc length (clamped).
    pub fn point(&self, s: f64) -> Point2<f64> {
        for (k, leg) in self.points.windows(2).enumerate() {
            if s <= self.at[k + 1] {
                let length = self.at[k + 1] - self.at[k];
                let t = if length > 0.0 { ((s - self.at[k]) / length).max(0.0) } else { 0.0 };
                return leg[0] + (leg[1] - leg[0]) * t;
            }
        }
        self.end()
    }

    /// Direction of travel toward the point `ahead` further on than the projection.
    pub fn toward(&self, p: &Point2<f64>, s: f64, ahead: f64) -> Vector2<f64> {
        self.point(s + ahead) - p
    }
}
