//! Things that are moved while the robot looks: door leaves that swing, chairs that are pushed.
//!
//! Each is a [`Mover`] with key poses, so that every ray and every contact meets it where it is at that moment. People are in
//! [`crate::person`].

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::{InstanceId, Mover, TriangleMesh};
use crate::shape::{Model, Part, Placement, Solid};

/// A leaf of `width_m` x `height_m` on a hinge at `hinge` (its lower end). It stands at the first angle until its time and
/// swings from key to key; angles in radians from world x, keys in time order. `None` without keys.
pub fn door_leaf(
    instance: InstanceId,
    hinge: Point3<f64>,
    width_m: f64,
    height_m: f64,
    keys: &[(i64, f64)],
    rgb: [u8; 3],
) -> Option<Mover> {
    let leaf = Part { solid: Solid::block(0.5 * width_m, 0.0, 0.01, width_m, 0.04, height_m), rgb };
    let pose = |angle_rad: f64| {
        Isometry3::from_parts(Translation3::from(hinge), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad))
    };
    let mut path: Vec<(i64, Isometry3<f64>)> = Vec::new();
    for pair in keys.windows(2) {
        // Poses are interpolated along the shortest rotation: a wide swing needs keys between.
        let ((t0, from), (t1, to)) = (pair[0], pair[1]);
        let parts = ((to - from).abs() / 1.0).ceil().max(1.0) as i64;
        path.extend((0..parts).map(|k| {
            let s = k as f64 / parts as f64;
            (t0 + (t1 - t0) * k / parts, pose(from + s * (to - from)))
        }));
    }
    path.extend(keys.last().map(|(stamp, angle_rad)| (*stamp, pose(*angle_rad))));
    (!path.is_empty()).then(|| Mover { instance, mesh: mesh_of(vec![leaf], instance), path })
}

/// A thing of the catalogue's `model` that somebody pushes over the floor from key to key: stamp, place of its footprint's
/// middle, heading. `None` without keys.
pub fn pushed(instance: InstanceId, model: &Model, keys: &[(i64, Point3<f64>, f64)]) -> Option<Mover> {
    let path: Vec<(i64, Isometry3<f64>)> = keys
        .iter()
        .map(|(stamp, at, yaw_rad)| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *yaw_rad);
            (*stamp, Isometry3::from_parts(Translation3::from(*at), turn))
        })
        .collect();
    (!path.is_empty()).then(|| Mover { instance, mesh: mesh_of(model.parts.clone(), instance), path })
}

pub(crate) fn mesh_of(parts: Vec<Part>, instance: InstanceId) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let model = Model { parts, ..Model::default() };
    model.push(&mut mesh, &Placement { origin: Point3::origin(), yaw_rad: 0.0 }, instance);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    const THING: InstanceId = 7;

    #[test]
    fn a_door_swings_round_its_hinge_even_by_more_than_half_a_turn() {
        let keys = [(0, 0.0), (4_000_000_000, 4.0)];
        let leaf = door_leaf(THING, Point3::new(1.0, 1.0, 0.0), 0.9, 2.0, &keys, [200; 3]).unwrap();
        for k in 0..=8 {
            let (s, c) = (0.5 * f64::from(k)).sin_cos();
            let tip = leaf.pose_at(i64::from(k) * 500_000_000) * Point3::new(0.9, 0.0, 1.0);
            assert!((tip - Point3::new(1.0 + 0.9 * c, 1.0 + 0.9 * s, 1.0)).norm() < 1e-6);
        }
        assert!(door_leaf(THING, Point3::origin(), 0.9, 2.0, &[], [0; 3]).is_none());
    }

    #[test]
    fn a_chair_goes_where_it_is_pushed() {
        let model = Model {
            parts: vec![Part { solid: Solid::block(0.0, 0.0, 0.0, 0.5, 0.5, 0.9), rgb: [90; 3] }],
            ..Model::default()
        };
        let keys = [(0, Point3::origin(), 0.0), (1_000_000_000, Point3::new(1.0, 0.0, 0.0), 0.5)];
        let chair = pushed(THING, &model, &keys).unwrap();
        assert!((chair.pose_at(500_000_000).translation.vector.x - 0.5).abs() < 1e-9);
    }
}
