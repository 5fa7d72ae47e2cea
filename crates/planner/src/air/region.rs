//! A large convex piece of free space round a straight line: no part of an occupied voxel is inside, the line is.
//!
//! After FIRI (Wang et al. 2024): planes are chosen where an ellipsoid sees the voxels nearest, the largest ellipsoid inside
//! what they leave is found, and seen through that one the planes are chosen again. Departure: obstacles are whole cubes, not
//! points. A plane has the direction of a nearest point and the offset of the cube's own support, so it parts all of the
//! cube however well the nearest point was found; where such a plane would cut the line, the direction between the nearest
//! points of line and cube takes its place.

use nalgebra::{Matrix3, Vector3};

use super::ellipsoid::inscribed_ellipsoid;
use super::polytope::{HalfSpace, Polytope};

/// The line keeps at least this share of its distance to a cube from the plane before that cube: thin joints cannot be flown.
const CLEAR_SHARE: f64 = 0.4;
/// Radius of the first ellipsoid across the line, as a share of its half length, and at least (m).
const FIRST_WIDTH: f64 = 0.4;
const FIRST_WIDTH_M: f64 = 0.5;

/// The region round segment `a`-`b` inside `around`, given the centres of the occupied voxels near it. `None` if a voxel comes
/// nearer to the line than `least_m`, or if a number is not finite or the edge of a voxel, `voxel_m`, not positive.
pub fn region(
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    around: &Polytope,
    voxels: &[Vector3<f64>],
    voxel_m: f64,
    least_m: f64,
) -> Option<Polytope> {
    let is_known = voxels.iter().chain([a, b]).all(|p| p.iter().all(|x| x.is_finite()));
    if !(is_known && voxel_m > 0.0 && voxel_m.is_finite()) {
        return None;
    }
    let half = 0.5 * voxel_m;
    let length = (b - a).norm();
    let along = if length > 1e-9 { (b - a) / length } else { Vector3::x() };
    let (ahead, across) = (0.5 * length + FIRST_WIDTH_M, (FIRST_WIDTH * 0.5 * length).max(FIRST_WIDTH_M));
    let shape = Matrix3::identity() * across + along * along.transpose() * (ahead - across);
    let first = planes(a, b, around, voxels, half, least_m, &((a + b) * 0.5), &shape)?;
    let Some(ellipsoid) = inscribed_ellipsoid(&first) else { return Some(first) };
    // The volume hardly grows after this second choice.
    planes(a, b, around, voxels, half, least_m, &ellipsoid.centre, &ellipsoid.shape).or(Some(first))
}

/// One choice: nearest cube first, each plane drops all the cubes it parts.
#[allow(clippy::too_many_arguments)]
fn planes(
    a: &Vector3<f64>,
    b: &Vector3<f64>,
    around: &Polytope,
    voxels: &[Vector3<f64>],
    half: f64,
    least_m: f64,
    centre: &Vector3<f64>,
    shape: &Matrix3<f64>,
) -> Option<Polytope> {
    let ball_from_world = shape.try_inverse()?;
    let mut polytope = around.clone();
    let support = |n: &Vector3<f64>| half * (n.x.abs() + n.y.abs() + n.z.abs());
    let mut open: Vec<(f64, Vector3<f64>)> = voxels
        .iter()
        .filter(|v| !around.faces.iter().any(|f| f.normal.dot(v) - support(&f.normal) >= f.offset_m))
        .map(|v| ((ball_from_world * (v - centre)).norm_squared(), *v))
        .collect();
    while let Some(&(_, voxel)) = open.iter().min_by(|p, q| p.0.total_cmp(&q.0).then_with(|| order(&p.1, &q.1))) {
        let near = nearest_in_cube(&voxel, half, centre, &ball_from_world);
        // Tangent in the ball's frame: the normal is A^T A (x - c).
        let seen = ball_from_world.tr_mul(&(ball_from_world * (near - centre)));
        let (on_line, on_cube) = nearest_pair(a, b, &voxel, half);
        let apart = on_cube - on_line;
        if apart.norm() < least_m {
            return None;
        }
        let plane = |direction: Vector3<f64>| {
            let normal = direction.try_normalize(1e-12)?;
            let face = HalfSpace { normal, offset_m: normal.dot(&voxel) - support(&normal) };
            let slack = face.offset_m - normal.dot(a).max(normal.dot(b));
            (slack >= CLEAR_SHARE * apart.norm()).then_some(face)
        };
        let face = plane(seen).or_else(|| plane(apart))?;
        polytope.faces.push(face);
        let before = open.len();
        open.retain(|(_, v)| face.normal.dot(v) - support(&face.normal) < face.offset_m - 1e-12);
        if open.len() == before {
            // Rounding left the very cube; it touches the plane, which is all that can be asked.
            open.retain(|(_, v)| *v != voxel);
        }
    }
    Some(polytope)
}

fn order(p: &Vector3<f64>, q: &Vector3<f64>) -> std::cmp::Ordering {
    p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)).then(p.z.total_cmp(&q.z))
}

/// The point of a cube nearest to the centre in the metric of the ellipsoid, by a few rounds over the axes.
fn nearest_in_cube(
    voxel: &Vector3<f64>,
    half: f64,
    centre: &Vector3<f64>,
    ball_from_world: &Matrix3<f64>,
) -> Vector3<f64> {
    let metric = ball_from_world.tr_mul(ball_from_world);
    let mut p = *voxel;
    for _ in 0..6 {
        for k in 0..3 {
            let slope = (metric * (p - centre))[k];
            p[k] = (p[k] - slope / metric[(k, k)]).clamp(voxel[k] - half, voxel[k] + half);
        }
    }
    p
}

/// Nearest points of a segment and a cube, by going to and fro between them.
fn nearest_pair(a: &Vector3<f64>, b: &Vector3<f64>, voxel: &Vector3<f64>, half: f64) -> (Vector3<f64>, Vector3<f64>) {
    let in_cube = |p: &Vector3<f64>| Vector3::from_fn(|k, _| p[k].clamp(voxel[k] - half, voxel[k] + half));
    // The distance to the cube is convex along the segment: a golden search finds its minimum.
    let at = |t: f64| a + (b - a) * t;
    let distance = |t: f64| (at(t) - in_cube(&at(t))).norm_squared();
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let (mut low, mut high) = (0.0, 1.0);
    let (mut s, mut t) = (1.0 - GOLDEN, GOLDEN);
    let (mut at_s, mut at_t) = (distance(s), distance(t));
    for _ in 0..40 {
        if at_s <= at_t {
            (high, t, at_t) = (t, s, at_s);
            s = high - GOLDEN * (high - low);
            at_s = distance(s);
        } else {
            (low, s, at_s) = (s, t, at_t);
            t = low + GOLDEN * (high - low);
            at_t = distance(t);
        }
    }
    let best = [0.0, 0.5 * (low + high), 1.0].into_iter().min_by(|p, q| distance(*p).total_cmp(&distance(*q)));
    let on_line = at(best.unwrap_or(0.5));
    (on_line, in_cube(&on_line))
}
