//! The space a robot takes: placed and swept collision shapes, footprint polygon, radii, height span.
//!
//! A shape below a continuous joint (rotor, wheel) is replaced by the cylinder it sweeps in a full turn, so the envelope holds
//! at any angle of it. The footprint is the convex hull of all shapes seen from above.

use crate::shape::{CollisionShape, Geometry};
use crate::tree::{JointKind, KinematicTree};
use nalgebra::{Isometry3, Point2, Point3, Translation3, Unit, UnitQuaternion, Vector3};

/// Half the height of a propeller disc whose link has no shape, m.
const BARE_DISC_HALF_HEIGHT_M: f64 = 0.005;

/// A disc that stands for all shapes of a link: the propeller of a rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Index of the link.
    pub link: usize,
    /// Radius, m.
    pub radius_m: f64,
}

/// What is needed to keep clear of walls, floor and ceiling, in the body frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    /// Convex hull of all shapes seen from above, counter-clockwise, starting at the lowest (x, y).
    pub footprint: Vec<Point2<f64>>,
    /// Lowest and highest z.
    pub height_span_m: (f64, f64),
    /// Radius of the smallest vertical cylinder about the body origin that holds the footprint: free to turn in place.
    pub circumscribed_radius_m: f64,
    /// Radius of the largest circle about the body origin inside the footprint; 0 when the origin is outside.
    pub inscribed_radius_m: f64,
    /// Radius of the smallest ball about the body origin that holds all shapes, at most 0.5 % too large.
    pub bounding_sphere_radius_m: f64,
}

/// Collision shapes in the body frame exactly as the URDF has them, at the given link poses, nothing swept.
pub fn placed_shapes(tree: &KinematicTree, body_from_links: &[Isometry3<f64>]) -> Vec<CollisionShape> {
    let links = tree.links().iter().zip(body_from_links);
    links
        .flat_map(|(link, body_from_link)| {
            link.shapes.iter().map(move |(link_from_shape, geometry)| CollisionShape {
                link: link.name.clone(),
                body_from_shape: body_from_link * link_from_shape,
                geometry: geometry.clone(),
            })
        })
        .collect()
}

/// Collision shapes in the body frame with everything below a continuous joint swept a full turn and `discs` in place of the
/// shapes of their links. `angles` as for [`KinematicTree::body_from_links`], already checked.
pub(crate) fn swept_shapes(tree: &KinematicTree, angles: &[f64], discs: &[Disc]) -> Vec<CollisionShape> {
    let mut angle_of = vec![0.0; tree.joints().len()];
    for (joint, angle) in tree.moving_joints().iter().zip(angles) {
        angle_of[*joint] = *angle;
    }
    let mut shapes = Vec::new();
    for (index, link) in tree.links().iter().enumerate() {
        let own = match discs.iter().find(|disc| disc.link == index) {
            Some(disc) => vec![propeller_disc(tree, disc)],
            None => link.shapes.clone(),
        };
        for (link_from_shape, geometry) in own {
            let (body_from_shape, geometry) = swept_to_root(tree, &angle_of, index, link_from_shape, geometry);
            shapes.push(CollisionShape { link: link.name.clone(), body_from_shape, geometry });
        }
    }
    shapes
}

/// Radius that the shapes of a link sweep about the axis of the joint above it; `None` without shapes.
pub(crate) fn swept_radius(tree: &KinematicTree, link: usize) -> Option<f64> {
    let axis = spin_axis(tree, link);
    let radii = tree.links()[link].shapes.iter().map(|(pose, geometry)| geometry.swept_about(&axis, pose).radius);
    radii.reduce(f64::max)
}

/// Footprint, radii and height span of placed shapes; `None` without shapes.
pub fn envelope(shapes: &[CollisionShape]) -> Option<Envelope> {
    let (low, high) = crate::shape::bounds(shapes)?;
    let outline: Vec<Point3<f64>> =
        shapes.iter().flat_map(|shape| shape.geometry.outline(&shape.body_from_shape)).collect();
    let footprint = convex_hull(outline.iter().map(|p| p.xy()).collect());
    Some(Envelope {
        height_span_m: (low.z, high.z),
        circumscribed_radius_m: footprint.iter().map(|p| p.coords.norm()).fold(0.0, f64::max),
        inscribed_radius_m: inscribed_radius(&footprint),
        bounding_sphere_radius_m: shapes.iter().map(reach_from_origin).fold(0.0, f64::max),
        footprint,
    })
}

/// Convex hull by Andrew's monotone chain: counter-clockwise from the lowest (x, y), without collinear points.
///
/// Corners are right to 2^-36 m: nearer points count as one, because the way from one to the other would be rounding, and the chain would
/// take a turn of it for a corner.
pub fn convex_hull(mut points: Vec<Point2<f64>>) -> Vec<Point2<f64>> {
    const GRAINS_PER_M: f64 = (1_u64 << 36) as f64;
    let snapped = |x: f64| {
        let on_grain = (x * GRAINS_PER_M).round() / GRAINS_PER_M;
        // Minus zero would be sorted before zero.
        if on_grain.is_finite() { on_grain + 0.0 } else { x }
    };
    points.iter_mut().for_each(|p| *p = p.map(snapped));
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let mut hull: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while hull.len() >= 2
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp(&(p - hull[hull.len() - 2])) <= 0.0
            {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter());
    hull.extend(chain(&mut points.iter().rev()));
    hull
}

/// Carries a shape from its link up to the root; a continuous joint on the way turns it into the cylinder it sweeps.
fn swept_to_root(
    tree: &KinematicTree,
    angle_of: &[f64],
    link: usize,
    mut pose: Isometry3<f64>,
    mut geometry: Geometry,
) -> (Isometry3<f64>, Geometry) {
    let mut at = link;
    while let Some(index) = tree.joint_above(at) {
        let joint = &tree.joints()[index];
        if joint.kind == JointKind::Continuous {
            (pose, geometry) = swept_cylinder(&geometry, &pose, &joint.axis);
        }
        pose = joint.parent_from_child(angle_of[index]) * pose;
        at = joint.parent;
    }
    (pose, geometry)
}

fn swept_cylinder(geometry: &Geometry, pose: &Isometry3<f64>, axis: &Unit<Vector3<f64>>) -> (Isometry3<f64>, Geometry) {
    let swept = geometry.swept_about(axis, pose);
    // Opposite vectors have no unique rotation; a half turn about x does.
    let turned = UnitQuaternion::rotation_between(&Vector3::z(), axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let center = axis.scale((swept.low + swept.high) / 2.0);
    let cylinder = Geometry::Cylinder { radius: swept.radius, half_length: (swept.high - swept.low) / 2.0 };
    (Isometry3::from_parts(Translation3::from(center), turned), cylinder)
}

/// The disc in the link frame: radius as given, height range as far as the shapes of the link reach.
fn propeller_disc(tree: &KinematicTree, disc: &Disc) -> (Isometry3<f64>, Geometry) {
    let axis = spin_axis(tree, disc.link);
    let swept = tree.links()[disc.link].shapes.iter().map(|(pose, geometry)| geometry.swept_about(&axis, pose));
    let range = swept.fold(None, |range: Option<(f64, f64)>, s| {
        Some(range.map_or((s.low, s.high), |(low, high)| (low.min(s.low), high.max(s.high))))
    });
    let (low, high) = range.unwrap_or((-BARE_DISC_HALF_HEIGHT_M, BARE_DISC_HALF_HEIGHT_M));
    let lying = Geometry::Cylinder { radius: disc.radius_m, half_length: (high - low) / 2.0 };
    let upright = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    (Isometry3::from_parts(Translation3::from(axis.scale((low + high) / 2.0)), upright), lying)
}

/// The axis of the joint above a rotor; z where the rotor is fixed to its arm.
fn spin_axis(tree: &KinematicTree, link: usize) -> Unit<Vector3<f64>> {
    match tree.joint_above(link).map(|joint| &tree.joints()[joint]) {
        Some(joint) if joint.kind != JointKind::Fixed => joint.axis,
        _ => Vector3::z_axis(),
    }
}

fn inscribed_radius(hull: &[Point2<f64>]) -> f64 {
    if hull.len() < 3 {
        return 0.0;
    }
    let next = hull.iter().cycle().skip(1);
    let distance = |(a, b): (&Point2<f64>, &Point2<f64>)| {
        let edge = b - a;
        edge.perp(&-a.coords) / edge.norm()
    };
    hull.iter().zip(next).map(distance).fold(f64::INFINITY, f64::min).max(0.0)
}

fn reach_from_origin(shape: &CollisionShape) -> f64 {
    match &shape.geometry {
        Geometry::Sphere { radius } => shape.body_from_shape.translation.vector.norm() + radius,
        geometry => geometry.outline(&shape.body_from_shape).iter().map(|p| p.coords.norm()).fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(x: f64, y: f64, geometry: Geometry) -> CollisionShape {
        CollisionShape { link: "a".into(), body_from_shape: Isometry3::translation(x, y, 0.0), geometry }
    }

    #[test]
    fn a_box_beside_the_origin() {
        let found =
            envelope(&[shape(0.5, 0.0, Geometry::Box { half: Vector3::new(1.0, 0.5, 0.25) })]).expect("a shape");
        assert_eq!(found.footprint.len(), 4);
        assert_eq!(found.footprint[0], Point2::new(-0.5, -0.5));
        assert_eq!(found.height_span_m, (-0.25, 0.25));
        assert!((found.circumscribed_radius_m - 1.5f64.hypot(0.5)).abs() < 1e-12);
        assert!((found.inscribed_radius_m - 0.5).abs() < 1e-12);
        assert!((found.bounding_sphere_radius_m - (1.5f64 * 1.5 + 0.25 + 0.0625).sqrt()).abs() < 1e-12);
        assert_eq!(envelope(&[]), None);
    }

    #[test]
    fn an_origin_outside_the_footprint_has_no_inscribed_circle() {
        let found = envelope(&[shape(3.0, 0.0, Geometry::Sphere { radius: 1.0 })]).expect("a shape");
        assert_eq!(found.inscribed_radius_m, 0.0);
        assert!((found.bounding_sphere_radius_m - 4.0).abs() < 1e-12);
        assert!(found.circumscribed_radius_m >= 4.0 && found.circumscribed_radius_m < 4.0 + 0.005 * 1.0 + 1e-12);
    }

    #[test]
    fn hulls_of_few_points() {
        let p = Point2::new;
        assert_eq!(convex_hull(vec![]), vec![]);
        assert_eq!(convex_hull(vec![p(1.0, 1.0), p(1.0, 1.0)]), vec![p(1.0, 1.0)]);
        assert_eq!(convex_hull(vec![p(0.0, 0.0), p(2.0, 2.0), p(1.0, 1.0)]), vec![p(0.0, 0.0), p(2.0, 2.0)]);
    }
}
