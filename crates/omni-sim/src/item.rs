//! A thing with a place in a room, and its way into the finished building.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};

use crate::building::{Bounds, Building, ObjectTruth};
use crate::catalog::{Class, Mount};
use crate::mesh::{Mover, TriangleMesh};
use crate::shape::{Model, Placement};

/// A thing no deeper than this on a wall does not narrow the passage, metres.
pub const THIN_M: f64 = 0.065;

/// A thing that has found its place.
#[derive(Debug, Clone)]
pub struct Item {
    /// Class.
    pub class: &'static Class,
    /// Colour name.
    pub color: &'static str,
    /// Colour.
    pub rgb: [u8; 3],
    /// Material.
    pub material: &'static str,
    /// Shape.
    pub model: Model,
    /// Where it stands.
    pub placement: Placement,
    /// Its box.
    pub bounds: Bounds,
    /// Boxes of its parts.
    pub parts: Vec<Bounds>,
    /// Index of the item that carries it.
    pub support: Option<usize>,
    /// Index of the item it was placed with.
    pub with: Option<usize>,
    /// Has a mesh of its own that may move.
    pub is_mover: bool,
}

impl Item {
    /// Direction of its front in plan, unit length.
    pub fn front(&self) -> Vector2<f64> {
        let (s, c) = crate::shape::exact_sin_cos(self.placement.yaw_rad);
        Vector2::new(c, s)
    }

    /// True if it narrows the floor.
    pub fn is_obstacle(&self) -> bool {
        let hung_thin = matches!(self.class.mount, Mount::Wall(_)) && self.class.size_m[1].1 <= THIN_M;
        !hung_thin && self.support.is_none()
    }
}

/// Adds furnished items to a building: triangles or a mover, and the truth, with the next free ids.
pub(crate) fn add_items(building: &mut Building, items: Vec<Item>, room: u32) {
    let first = building.objects.len() as u32 + 1;
    for (k, item) in items.into_iter().enumerate() {
        let id = first + k as u32;
        if item.is_mover {
            let mut mesh = TriangleMesh::default();
            item.model.push(&mut mesh, &Placement { origin: Point3::origin(), yaw_rad: 0.0 }, id);
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), item.placement.yaw_rad);
            let pose = Isometry3::from_parts(Translation3::from(item.placement.origin.coords), rotation);
            building.movers.push(Mover { instance: id, mesh, path: vec![(0, pose)] });
        } else {
            item.model.push(&mut building.mesh, &item.placement, id);
        }
        building.objects.push(ObjectTruth {
            id,
            class: item.class.name.to_string(),
            color: item.color.to_string(),
            rgb: item.rgb,
            material: item.material.to_string(),
            function: item.class.function.to_string(),
            caption: String::new(),
            bounds: item.bounds,
            yaw_rad: item.placement.yaw_rad,
            room,
            supported_by: item.support.map(|s| first + s as u32),
            placed_with: item.with.map(|w| first + w as u32),
        });
    }
}

/// Extent of an item's footprint along a horizontal direction that is parallel to an axis (nearly, for turned chairs).
pub(crate) fn extent(item: &Item, direction: Vector2<f64>) -> f64 {
    let foot = item.bounds.footprint();
    if direction.x.abs() > direction.y.abs() { foot.width_m() } else { foot.height_m() }
}
