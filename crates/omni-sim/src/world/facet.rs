//! Facets: coplanar triangles of one thing, which a renderer may fill without looking twice.

use super::InstanceId;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;

/// Numbers groups of coplanar triangles of one instance and colour. Planes are compared after rounding (1e-3 in the
/// normal, 1 mm in the offset): a group that rounding tears apart only costs a renderer a few more rays.
#[derive(Default)]
pub struct Facets {
    mesh: u32,
    known: BTreeMap<(u32, InstanceId, [u8; 3], [i32; 4]), u32>,
}

impl Facets {
    /// Triangles of different meshes never share a facet.
    pub fn next_mesh(&mut self) {
        self.mesh += 1;
    }

    pub fn number(&mut self, instance: InstanceId, color: [u8; 3], normal: &Vector3<f32>, corner: &Point3<f32>) -> u32 {
        let round = |x: f32| (x * 1000.0).round() as i32;
        let plane = [round(normal.x), round(normal.y), round(normal.z), round(normal.dot(&corner.coords))];
        let next = self.known.len() as u32;
        *self.known.entry((self.mesh, instance, color, plane)).or_insert(next)
    }
}
