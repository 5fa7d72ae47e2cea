//! Safe flight corridor: one convex polytope round each leg of the route.
//!
//! Every obstacle that some face does not yet part from the leg gets the plane through its nearest point of the leg,
//! nearest obstacle first. The plane is moved toward the leg by the distance the obstacle must keep, and further where
//! there is room (the comfort), but only by a share of it. So: no point of a polytope is nearer to an obstacle point than
//! demanded, the whole leg is inside, and consecutive polytopes share at least the route point between them.

use nalgebra::{Point3, Vector3};

use super::obstacles::{Surroundings, nearest_on_segment};
use super::polytope::{HalfSpace, Polytope};

/// Share of the space to spare beside a leg that is left to the flight before comfort takes any.
const ROOM: f64 = 0.5;

/// The polytope round one leg, inside the box `[low, high]`. The leg must be clear.
pub(crate) fn polytope_around(
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    reach_m: f64,
    low: &Point3<f64>,
    high: &Point3<f64>,
    surroundings: &Surroundings,
) -> Polytope {
    let reach = Vector3::repeat(reach_m);
    let box_low = Point3::from((a.inf(b) - reach).sup(&low.coords).inf(&a.inf(b)));
    let box_high = Point3::from((a.sup(b) + reach).inf(&high.coords).sup(&a.sup(b)));
    let mut polytope = Polytope::from_box(&box_low, &box_high);
    // Obstacles outside the box by less than what they demand bind as well.
    let mut open: Vec<Binding> = Vec::new();
    for o in surroundings.near(a, b, reach_m + surroundings.furthest_m()) {
        if !polytope.faces.iter().any(|face| is_parted(face, &o.at, o.needed_m)) {
            let nearest = nearest_on_segment(a, b, &o.at);
            let distance = (o.at - nearest).norm();
            open.push(Binding {
                at: o.at,
                nearest,
                distance,
                spare: distance - o.needed_m,
                needed_m: o.needed_m,
                liked_m: o.liked_m,
            });
        }
    }
    while let Some(o) = tightest(&open) {
        let normal = (o.at - o.nearest) / o.distance.max(1e-9);
        let keep = (o.distance - ROOM * o.spare).min(o.liked_m.max(o.needed_m));
        let face = HalfSpace { normal, offset_m: normal.dot(&o.at) - keep };
        polytope.faces.push(face);
        open.retain(|other| other.at != o.at && !is_parted(&face, &other.at, other.needed_m));
    }
    polytope
}

/// An obstacle that the box does not keep away.
#[derive(Clone, Copy)]
struct Binding {
    at: Vector3<f64>,
    nearest: Vector3<f64>,
    distance: f64,
    spare: f64,
    needed_m: f64,
    liked_m: f64,
}

/// The obstacle with the least to spare; ties by coordinates, so that the order of the points does not matter.
fn tightest(open: &[Binding]) -> Option<Binding> {
    let key = |o: &Binding| (o.spare, o.at.x, o.at.y, o.at.z);
    open.iter().copied().reduce(|best, o| {
        if o.spare < best.spare || (o.spare == best.spare && key(&o) < key(&best)) { o } else { best }
    })
}

/// Whether every point of the half-space keeps the demanded distance from an obstacle.
fn is_parted(face: &HalfSpace, at: &Vector3<f64>, needed_m: f64) -> bool {
    face.normal.dot(at) - face.offset_m >= needed_m
}
