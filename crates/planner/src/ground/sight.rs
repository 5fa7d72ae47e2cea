//! What can be seen from a point: the cone of sight goes from triangle to triangle and narrows at every corner.
//!
//! A cone is bounded by two points of the map, never by computed ones, so every decision is one exact predicate: triangular
//! expansion (Bungiu et al. 2014). A corner is seen if it lies strictly inside the cone; what lies behind another corner on the
//! very same line is seen from that corner.

use nalgebra::Point2;

use super::triangles::{Triangles, WALL, turn};

/// Where somebody looks from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Eye {
    /// A point of the map.
    Corner(u32),
    /// Any place in a triangle, its border included, its corners not.
    Inside(u32),
}

/// Points of the map between which the eye looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub right: Point2<f64>,
    pub left: Point2<f64>,
}

/// A triangle that a cone is about to enter by its side `side`.
#[derive(Debug, Clone, Copy)]
struct Cone {
    triangle: u32,
    side: usize,
    bounds: Bounds,
}

/// Room for the cones that wait, to be used again and again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sight {
    waiting: Vec<Cone>,
}

impl Sight {
    /// Calls `corner` for every point of the map that is seen from `at`, and `triangle` for every triangle that is entered, with the
    /// bounds of the cone (`None` for where the eye is); it says whether to look on. From a border a point may be seen twice.
    pub fn look(
        &mut self,
        map: &Triangles,
        eye: Eye,
        at: &Point2<f64>,
        mut corner: impl FnMut(u32),
        mut triangle: impl FnMut(u32, Option<Bounds>) -> bool,
    ) {
        self.waiting.clear();
        match eye {
            Eye::Inside(first) => {
                if !triangle(first, None) {
                    return;
                }
                map.corners[first as usize].iter().for_each(|p| corner(*p));
                (0..3).for_each(|side| self.cross(map, first, side, None));
            }
            Eye::Corner(p) => {
                for (first, k) in map.fan(p) {
                    if !triangle(first, None) {
                        return;
                    }
                    let corners = map.corners[first as usize];
                    corner(corners[(k + 1) % 3]);
                    // The other one belongs to the next triangle of the fan too, unless a wall comes first.
                    if map.behind[first as usize][(k + 2) % 3] == WALL {
                        corner(corners[(k + 2) % 3]);
                    }
                    self.cross(map, first, (k + 1) % 3, None);
                }
            }
        }
        while let Some(Cone { triangle: entered, side, bounds }) = self.waiting.pop() {
            if !triangle(entered, Some(bounds)) {
                return;
            }
            let Bounds { right, left } = bounds;
            let apex = map.corners[entered as usize][(side + 2) % 3];
            let p = map.points[apex as usize];
            let is_right_of_left = turn(at, &left, &p) < 0.0;
            let is_left_of_right = turn(at, &right, &p) > 0.0;
            if is_right_of_left && is_left_of_right {
                corner(apex);
            }
            // The right side is seen if something of it lies right of the left bound, which its right end does unless the apex is
            // beyond the right bound; likewise the left one.
            if is_left_of_right {
                let left = if is_right_of_left { p } else { left };
                self.cross(map, entered, (side + 1) % 3, Some(Bounds { right, left }));
            }
            if is_right_of_left {
                let right = if is_left_of_right { p } else { right };
                self.cross(map, entered, (side + 2) % 3, Some(Bounds { right, left }));
            }
        }
    }

    /// Looks across a side, if it is no wall; without bounds through the whole of it.
    fn cross(&mut self, map: &Triangles, from: u32, side: usize, bounds: Option<Bounds>) {
        let behind = map.behind[from as usize][side];
        if behind != WALL {
            let corners = map.places(from);
            let bounds = bounds.unwrap_or(Bounds { right: *corners[side], left: *corners[(side + 1) % 3] });
            self.waiting.push(Cone { triangle: behind / 4, side: (behind % 4) as usize, bounds });
        }
    }
}
