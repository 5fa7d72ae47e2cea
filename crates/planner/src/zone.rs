//! Parts of the floor with a rule of their own: a simple polygon, where nobody may be or nobody may be fast.
//!
//! Sides are decided in plain floating point: a polygon whose sides nearly touch is refused like one whose sides do.

use nalgebra::{Isometry2, Point2, Vector2};

/// Coordinates up to this (m): a site.
pub const LARGEST_M: f64 = 1e4;
/// Most corners of one zone: every test asks all sides.
pub const MOST_CORNERS: usize = 256;
/// A polygon with less area than this is a line (m^2).
const LEAST_AREA_M2: f64 = 1e-6;

/// A simple polygon on the floor, of any shape without holes.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Counter-clockwise.
    corners: Vec<Point2<f64>>,
    low: Point2<f64>,
    high: Point2<f64>,
}

/// Within the zone, the largest speed of a robot of which any part is inside.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedZone {
    /// Where.
    pub zone: Zone,
    /// How fast at most (m/s), positive.
    pub max_mps: f64,
}

/// Why a polygon was refused as a zone. Corners and sides are counted from 0; side k leads from corner k to the next.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ZoneError {
    /// A coordinate is not finite or too large.
    #[error("corner {corner} is not two numbers of at most {LARGEST_M} m")]
    NotFinite {
        /// Which.
        corner: usize,
    },
    /// Fewer than three corners.
    #[error("it has {0} corners; a zone needs at least three")]
    TooFewCorners(usize),
    /// More than [`MOST_CORNERS`].
    #[error("it has {0} corners; at most {MOST_CORNERS} are read")]
    TooManyCorners(usize),
    /// Two sides cross or touch, or a corner appears twice.
    #[error("its sides {first} and {second} cross or touch; a zone is a simple polygon")]
    Crossing {
        /// One side.
        first: usize,
        /// The other.
        second: usize,
    },
    /// All corners lie on a line.
    #[error("its corners lie on one line")]
    NoArea,
    /// A largest speed that is not a positive number.
    #[error(
        "its largest speed is {0} m/s; it has to be a positive number (keep_out is for zones that nobody may enter)"
    )]
    BadSpeed(f64),
}

impl SpeedZone {
    /// A zone with a largest speed.
    ///
    /// # Errors
    /// [`ZoneError`].
    pub fn new(corners: &[Point2<f64>], max_mps: f64) -> Result<SpeedZone, ZoneError> {
        let zone = Zone::new(corners)?;
        if !(max_mps.is_finite() && max_mps > 0.0) {
            return Err(ZoneError::BadSpeed(max_mps));
        }
        Ok(SpeedZone { zone, max_mps })
    }

    /// Whether any part of a robot of this radius at `point` is in the zone.
    pub fn holds(&self, point: &Point2<f64>, radius_m: f64) -> bool {
        !self.zone.is_farther(point, radius_m) && self.zone.distance_m(point) <= radius_m
    }

    /// The largest speed at `point` from which a robot of this radius, braking with `brake_mps2`, enters the zone within its limit;
    /// infinite where that is beyond `unlimited_mps`.
    pub fn speed_at(&self, point: &Point2<f64>, radius_m: f64, brake_mps2: f64, unlimited_mps: f64) -> f64 {
        if self.max_mps >= unlimited_mps {
            return f64::INFINITY;
        }
        let far_m = 0.5 * unlimited_mps * unlimited_mps / brake_mps2 + radius_m;
        if self.zone.is_farther(point, far_m) {
            return f64::INFINITY;
        }
        let room_m = (self.zone.distance_m(point) - radius_m).max(0.0);
        (self.max_mps * self.max_mps + 2.0 * brake_mps2 * room_m).sqrt()
    }
}

impl Zone {
    /// A polygon, corners in either order, at least three that are not on a line; its sides may not cross or touch.
    ///
    /// # Errors
    /// [`ZoneError`].
    pub fn new(corners: &[Point2<f64>]) -> Result<Zone, ZoneError> {
        if let Some(corner) = corners.iter().position(|p| !p.iter().all(|x| x.abs() <= LARGEST_M)) {
            return Err(ZoneError::NotFinite { corner });
        }
        let count = corners.len();
        if count < 3 {
            return Err(ZoneError::TooFewCorners(count));
        }
        if count > MOST_CORNERS {
            return Err(ZoneError::TooManyCorners(count));
        }
        let side = |k: usize| (corners[k], corners[(k + 1) % count]);
        for first in 0..count {
            for second in first + 1..count {
                let (a, b) = (side(first), side(second));
                let touches = if second == first + 1 {
                    folds_back(&a.0, &a.1, &b.1)
                } else if first == 0 && second == count - 1 {
                    folds_back(&b.0, &b.1, &a.1)
                } else {
                    do_meet(&a.0, &a.1, &b.0, &b.1)
                };
                if touches {
                    return Err(ZoneError::Crossing { first, second });
                }
            }
        }
        let area: f64 = (0..count).map(|k| 0.5 * side(k).0.coords.perp(&side(k).1.coords)).sum();
        if area.abs() < LEAST_AREA_M2 {
            return Err(ZoneError::NoArea);
        }
        let mut corners = corners.to_vec();
        if area < 0.0 {
            corners.reverse();
        }
        Ok(Zone::bounded(corners))
    }

    fn bounded(corners: Vec<Point2<f64>>) -> Zone {
        let low = corners.iter().fold(corners[0], |low, corner| low.inf(corner));
        let high = corners.iter().fold(corners[0], |high, corner| high.sup(corner));
        Zone { corners, low, high }
    }

    /// Counter-clockwise.
    pub fn corners(&self) -> &[Point2<f64>] {
        &self.corners
    }

    /// Lowest and highest coordinates.
    pub fn bounds(&self) -> (Point2<f64>, Point2<f64>) {
        (self.low, self.high)
    }

    fn sides(&self) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
        self.corners.iter().zip(self.corners.iter().cycle().skip(1))
    }

    /// Whether a point is inside; on the border it may count either way.
    pub fn contains(&self, point: &Point2<f64>) -> bool {
        let mut is_inside = false;
        for (a, b) in self.sides() {
            if (a.y > point.y) != (b.y > point.y) && point.x < a.x + (b.x - a.x) * (point.y - a.y) / (b.y - a.y) {
                is_inside = !is_inside;
            }
        }
        is_inside
    }

    /// Distance to the border, negative inside.
    pub fn distance_m(&self, point: &Point2<f64>) -> f64 {
        let squared = self.sides().map(|(a, b)| (point - nearest_on(a, b, point)).norm_squared());
        let away_m = squared.fold(f64::INFINITY, f64::min).sqrt();
        if self.contains(point) { -away_m } else { away_m }
    }

    /// Whether the box round the zone is farther than `far_m`: cheap, and then the zone is too.
    pub fn is_farther(&self, point: &Point2<f64>, far_m: f64) -> bool {
        let out = (self.low - point).sup(&(point - self.high));
        out.max() > far_m
    }

    /// Whether the zone and another polygon, corners in order, have a point in common.
    pub fn overlaps(&self, outline: &[Point2<f64>]) -> bool {
        let Some(first) = outline.first() else { return false };
        let others = || outline.iter().zip(outline.iter().cycle().skip(1));
        self.contains(first)
            || self.sides().any(|(a, b)| others().any(|(c, d)| do_meet(a, b, c, d)))
            || Zone::bounded(outline.to_vec()).contains(&self.corners[0])
    }

    /// The same zone in another frame.
    pub fn moved(&self, new_from_old: &Isometry2<f64>) -> Zone {
        Zone::bounded(self.corners.iter().map(|corner| new_from_old * corner).collect())
    }

    /// Points on the line that keeps `off_m` from the zone, all round, at most `spacing_m` apart along each side and round each corner
    /// (at a notch twice that): a fence of points through which nothing passes that is wider.
    pub fn fence(&self, off_m: f64, spacing_m: f64) -> Vec<Point2<f64>> {
        let count = self.corners.len();
        let outward = |k: usize| {
            let along = (self.corners[(k + 1) % count] - self.corners[k % count]).normalize();
            Vector2::new(along.y, -along.x)
        };
        let mut points = Vec::new();
        for k in 0..count {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % count]);
            let (here, next) = (outward(k), outward(k + 1));
            let steps = ((b - a).norm() / spacing_m).ceil().max(1.0) as usize;
            points.extend((0..=steps).map(|step| a + (b - a) * (step as f64 / steps as f64) + here * off_m));
            let turn_rad = here.perp(&next).atan2(here.dot(&next));
            if turn_rad > 0.0 && off_m > 0.0 {
                let steps = (turn_rad * off_m / spacing_m).ceil().max(1.0) as usize;
                let turned = |step: usize| nalgebra::Rotation2::new(turn_rad * step as f64 / steps as f64) * here;
                points.extend((1..steps).map(|step| b + turned(step) * off_m));
            }
        }
        const ROUNDING_M: f64 = 1e-9;
        points.retain(|point| self.distance_m(point) >= off_m - ROUNDING_M);
        points
    }
}

fn nearest_on(a: &Point2<f64>, b: &Point2<f64>, point: &Point2<f64>) -> Point2<f64> {
    let along = b - a;
    let squared = along.norm_squared();
    let t = if squared > 0.0 { ((point - a).dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    a + along * t
}

/// Twice the area of a triangle, positive if it turns left.
fn turn(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> f64 {
    (b - a).perp(&(c - a))
}

/// Whether two segments have a point in common.
fn do_meet(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>, d: &Point2<f64>) -> bool {
    let (c_side, d_side) = (turn(a, b, c), turn(a, b, d));
    let (a_side, b_side) = (turn(c, d, a), turn(c, d, b));
    if c_side == 0.0 && d_side == 0.0 {
        let boxes_meet =
            |axis: usize| a[axis].min(b[axis]) <= c[axis].max(d[axis]) && c[axis].min(d[axis]) <= a[axis].max(b[axis]);
        return boxes_meet(0) && boxes_meet(1);
    }
    c_side * d_side <= 0.0 && a_side * b_side <= 0.0
}

/// Whether the side from `b` to `c` has no length or leads back over the one from `a` to `b`.
fn folds_back(a: &Point2<f64>, b: &Point2<f64>, c: &Point2<f64>) -> bool {
    b == c || a == b || (turn(a, b, c) == 0.0 && (c - b).dot(&(b - a)) < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(points: &[[f64; 2]]) -> Vec<Point2<f64>> {
        points.iter().map(|p| Point2::from(*p)).collect()
    }

    /// An L: a square of 4 m without its upper right quarter.
    fn ell() -> Zone {
        Zone::new(&corners(&[[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]])).unwrap()
    }

    #[test]
    fn a_zone_is_a_simple_polygon_or_refused() {
        let refused = |points: &[[f64; 2]]| Zone::new(&corners(points)).unwrap_err();
        assert_eq!(refused(&[[0.0, 0.0], [1.0, 0.0]]), ZoneError::TooFewCorners(2));
        assert_eq!(refused(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0]]), ZoneError::NotFinite { corner: 1 });
        assert_eq!(refused(&[[0.0, 0.0], [1e9, 0.0], [1.0, 1.0]]), ZoneError::NotFinite { corner: 1 });
        let bow_tie = [[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]];
        assert_eq!(refused(&bow_tie), ZoneError::Crossing { first: 0, second: 2 });
        let pinched = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]];
        assert!(matches!(refused(&pinched), ZoneError::Crossing { .. }));
        assert!(matches!(
            refused(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]),
            ZoneError::Crossing { .. } | ZoneError::NoArea
        ));
        assert!(matches!(refused(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), ZoneError::Crossing { .. }));
        let square = corners(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        assert_eq!(SpeedZone::new(&square, -1.0).unwrap_err(), ZoneError::BadSpeed(-1.0));
        assert!(matches!(SpeedZone::new(&square, f64::NAN).unwrap_err(), ZoneError::BadSpeed(_)));
        assert_eq!(refused(&vec![[0.0, 0.0]; 300]), ZoneError::TooManyCorners(300));
    }

    #[test]
    fn distances_are_signed_whichever_way_the_corners_turn() {
        let zone = ell();
        let reversed: Vec<Point2<f64>> = zone.corners().iter().rev().copied().collect();
        for zone in [zone, Zone::new(&reversed).unwrap()] {
            assert_eq!(zone.distance_m(&Point2::new(1.0, 1.0)), -1.0);
            assert_eq!(zone.distance_m(&Point2::new(3.0, 3.0)), 1.0);
            assert_eq!(zone.distance_m(&Point2::new(7.0, 6.0)), 5.0);
            assert!(zone.is_farther(&Point2::new(7.0, 6.0), 2.9) && !zone.is_farther(&Point2::new(7.0, 6.0), 3.1));
        }
    }

    #[test]
    fn overlaps_are_found_without_a_corner_in_the_other() {
        let zone = ell();
        let bar = |x: f64| corners(&[[x, -1.0], [x + 0.5, -1.0], [x + 0.5, 9.0], [x, 9.0]]);
        assert!(zone.overlaps(&bar(3.0)), "it lies across an arm");
        assert!(!zone.overlaps(&bar(4.1)));
        assert!(zone.overlaps(&corners(&[[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])), "the zone is inside");
        assert!(zone.overlaps(&corners(&[[0.5, 0.5], [0.6, 0.5], [0.6, 0.6]])), "the other is inside");
        assert!(!zone.overlaps(&corners(&[[2.5, 2.5], [3.0, 2.5], [3.0, 3.0]])), "in the notch");
    }

    #[test]
    fn a_fence_stands_all_round_at_its_distance() {
        let zone = ell();
        let fence = zone.fence(0.3, 0.05);
        assert!(fence.iter().all(|post| (zone.distance_m(post) - 0.3).abs() < 1e-9));
        // From any place at that distance the next post is near.
        for step in 0..720 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(step) / 720.0).sin_cos();
            let toward = Vector2::new(cos, sin);
            let inside = Point2::new(1.0, 1.0);
            let (mut near, mut far) = (0.0, 9.0);
            while far - near > 1e-6 {
                let middle = 0.5 * (near + far);
                if zone.distance_m(&(inside + toward * middle)) < 0.3 { near = middle } else { far = middle }
            }
            let place = inside + toward * near;
            let gap_m = fence.iter().map(|post| (post - place).norm()).fold(f64::INFINITY, f64::min);
            assert!(gap_m <= 0.05, "{gap_m} at {place}");
        }
    }

    #[test]
    fn the_speed_falls_to_the_limit_at_the_border() {
        let slow = SpeedZone::new(&corners(&[[2.0, -1.0], [4.0, -1.0], [4.0, 1.0], [2.0, 1.0]]), 0.2).unwrap();
        let at = |x: f64| slow.speed_at(&Point2::new(x, 0.0), 0.5, 1.0, 1.0);
        assert_eq!(at(3.0), 0.2);
        assert_eq!(at(1.5), 0.2);
        assert!((at(1.3) - (0.04_f64 + 0.4).sqrt()).abs() < 1e-12);
        assert_eq!(at(0.0), f64::INFINITY);
    }
}
