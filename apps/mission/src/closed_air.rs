//! The air with the zones to keep out of closed, from the floor to the sky: what a planner asks about the map, and the posts besides.

use nalgebra::{Point2, Point3};

use crate::zones::Zones;

/// Spacing of the posts round a zone: a corridor that keeps its distance from each keeps all but 2 mm of it between them.
pub const POST_SPACING_M: f64 = 0.08;
/// Spacing of points up a post.
const STEP_M: f64 = 0.1;

/// Zones and the posts round them, in one frame.
#[derive(Debug, Clone, Copy)]
pub struct ClosedAir<'a> {
    /// The zones.
    pub zones: &'a Zones,
    /// [`Zones::posts`] at [`POST_SPACING_M`].
    pub posts: &'a [Point2<f64>],
    /// Distances beyond this do not matter.
    pub far_m: f64,
}

impl ClosedAir<'_> {
    /// Distance to the nearest obstacle or zone, where the map says `known`. Inside a zone nothing has to be known: there is no way.
    pub fn distance_m(&self, point: &Point3<f64>, known: Option<f64>) -> Option<f64> {
        let kept_m = self.zones.kept_m(&point.xy(), self.far_m);
        match known {
            None => (kept_m < 0.0).then_some(kept_m),
            Some(distance_m) => Some(distance_m.min(kept_m)),
        }
    }

    /// Obstacle points of a box: those of the map, and of each post one above the other.
    pub fn obstacles(&self, low: &Point3<f64>, high: &Point3<f64>, mut known: Vec<Point3<f64>>) -> Vec<Point3<f64>> {
        let steps = ((high.z - low.z) / STEP_M).floor().max(0.0) as usize;
        let inside = |post: &&Point2<f64>| (0..2).all(|axis| (low[axis]..=high[axis]).contains(&post[axis]));
        for post in self.posts.iter().filter(inside) {
            known.extend((0..=steps).map(|step| Point3::new(post.x, post.y, low.z + step as f64 * STEP_M)));
        }
        known
    }
}
