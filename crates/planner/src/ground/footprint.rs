//! The robot's outline on the floor: a convex polygon in the body frame, and a cover of it by discs.

use nalgebra::Point2;

/// A convex polygon with its half-planes, and discs that cover it.
#[derive(Debug, Clone)]
pub struct Footprint {
    /// Corners, counter-clockwise.
    pub corners: Vec<Point2<f64>>,
    /// Unit outward normal and offset of each side: outside where `n.x * x + n.y * y > offset`.
    sides: Vec<[f64; 3]>,
    /// Largest distance of a corner from the body origin.
    pub circumscribed_radius_m: f64,
    /// Centres on one axis, one radius.
    pub(crate) discs: Vec<Point2<f64>>,
    pub(crate) disc_radius_m: f64,
}

impl Footprint {
    /// Convex hull of finite points. `None` if they do not span an area.
    pub fn new(points: &[Point2<f64>]) -> Option<Footprint> {
        if points.iter().any(|p| !(p.x.is_finite() && p.y.is_finite())) {
            return None;
        }
        let corners = convex_hull(points);
        if corners.len() < 3 {
            return None;
        }
        let n = corners.len();
        let sides = (0..n)
            .map(|k| {
                let along = (corners[(k + 1) % n] - corners[k]).normalize();
                [along.y, -along.x, along.y * corners[k].x - along.x * corners[k].y]
            })
            .collect();
        let circumscribed_radius_m = corners.iter().map(|c| c.coords.norm()).fold(0.0, f64::max);
        let (discs, disc_radius_m) = cover(&corners);
        Some(Footprint { corners, sides, circumscribed_radius_m, discs, disc_radius_m })
    }

    /// Largest signed distance to a side: negative inside, and outside never more than the true distance.
    pub fn side_distance(&self, x: f64, y: f64) -> f64 {
        self.sides.iter().map(|s| s[0] * x + s[1] * y - s[2]).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Euclidean distance of an outside point; the negative depth of an inside point.
    pub fn distance(&self, p: &Point2<f64>) -> f64 {
        let side = self.side_distance(p.x, p.y);
        if side <= 0.0 {
            return side;
        }
        let n = self.corners.len();
        (0..n)
            .map(|k| {
                let (a, u) = (self.corners[k], self.corners[(k + 1) % n] - self.corners[k]);
                let t = ((p - a).dot(&u) / u.norm_squared()).clamp(0.0, 1.0);
                (p - (a + u * t)).norm()
            })
            .fold(f64::INFINITY, f64::min)
    }
}

/// Equal discs along the longer side of the bounding box.
fn cover(corners: &[Point2<f64>]) -> (Vec<Point2<f64>>, f64) {
    let low = corners.iter().fold(corners[0], |m, c| Point2::new(m.x.min(c.x), m.y.min(c.y)));
    let high = corners.iter().fold(corners[0], |m, c| Point2::new(m.x.max(c.x), m.y.max(c.y)));
    let (size, centre) = (high - low, nalgebra::center(&low, &high));
    let (long, short) = (size.x.max(size.y), size.x.min(size.y));
    let count = (1.5 * long / short).ceil().clamp(1.0, 6.0);
    let step = long / count;
    let discs = (0..count as usize)
        .map(|k| {
            let along = (k as f64 + 0.5) * step - 0.5 * long;
            if size.x >= size.y {
                Point2::new(centre.x + along, centre.y)
            } else {
                Point2::new(centre.x, centre.y + along)
            }
        })
        .collect();
    (discs, (0.5 * step).hypot(0.5 * short))
}

/// Andrew's monotone chain, counter-clockwise, without collinear points.
fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<Point2<f64>> = Vec::new();
    for half in 0..2 {
        let base = hull.len();
        for p in &sorted {
            while hull.len() >= base + 2
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp(&(p - hull[hull.len() - 1])) <= 1e-12
            {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
        if half == 0 {
            sorted.reverse();
        }
    }
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_a_box() {
        let f = Footprint::new(&[
            Point2::new(0.5, 0.2),
            Point2::new(-0.5, 0.2),
            Point2::new(-0.5, -0.2),
            Point2::new(0.5, -0.2),
            Point2::origin(),
        ])
        .unwrap();
        assert_eq!(f.corners.len(), 4);
        assert!((f.distance(&Point2::new(0.8, 0.6)) - 0.5).abs() < 1e-12);
        assert!((f.side_distance(0.8, 0.6) - 0.4).abs() < 1e-12);
        assert!((f.distance(&Point2::new(0.0, 0.15)) + 0.05).abs() < 1e-12);
        for c in &f.corners {
            assert!(f.discs.iter().any(|d| (d - c).norm() <= f.disc_radius_m + 1e-12));
        }
        assert!(Footprint::new(&[Point2::origin(), Point2::new(1.0, 1.0), Point2::new(2.0, 2.0)]).is_none());
    }
}
