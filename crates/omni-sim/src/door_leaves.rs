//! Leaves of inner doors, opened flat against the wall beside their doorway, and the closed entrance of the building.

use nalgebra::{Point3, Vector2};
use rand::RngExt;
use rand::seq::IndexedRandom;

use crate::building::RoomKind;
use crate::catalog::class;
use crate::colors::draw_color;
use crate::item::Item;
use crate::models::build;
use crate::placement::{Furnisher, Place};
use crate::shape::Placement;

/// Some doorways have a leaf, opened flat against the wall beside them.
pub fn hang_leaves(furnisher: &mut Furnisher, kind: RoomKind) {
    if matches!(kind, RoomKind::Hallway | RoomKind::Corridor | RoomKind::Stairwell) {
        return; // leaves open into the rooms
    }
    let Some(leaf_class) = class("door") else {
        return;
    };
    for (middle, inward, width) in furnisher.space.doors.clone() {
        if !furnisher.rng.random_bool(0.45) {
            continue;
        }
        let along = Vector2::new(-inward.y, inward.x);
        let color = leaf_class.colors.choose(furnisher.rng).copied().unwrap_or("white");
        let rgb = draw_color(furnisher.rng, color);
        let model = build(leaf_class.form, width, 0.04, 2.0, rgb);
        let side = if furnisher.rng.random_bool(0.5) { 1.0 } else { -1.0 };
        for s in [side, -side] {
            // 3 cm clear of the wall and 6 cm clear of the jamb.
            let p = middle + along * s * (width + 0.06) + inward * 0.05;
            let origin = Point3::new(p.x, p.y, furnisher.space.floor_z_m + 0.01);
            let placement = Placement { origin, yaw_rad: inward.y.atan2(inward.x) };
            let bounds = model.bounds(&placement);
            // The wall behind the leaf must be whole.
            let foot = bounds.footprint();
            let backed = furnisher.space.faces.iter().any(|f| {
                let r = f.rect().grown(0.08);
                f.inward == inward && r.contains(&foot.min) && r.contains(&foot.max)
            });
            if !backed || !furnisher.is_clear(leaf_class, &bounds) {
                continue;
            }
            let item = Item {
                class: leaf_class,
                color,
                rgb,
                material: "wood",
                parts: model.part_bounds(&placement),
                model: model.clone(),
                placement,
                bounds,
                support: None,
                with: None,
                is_mover: true,
            };
            if furnisher.accept(item) {
                break;
            }
        }
    }
}

impl Furnisher<'_> {
    /// The closed door to the outside, on an outer wall; its front stays free.
    pub fn put_entrance(&mut self) {
        if let Some(index) = self.put("door", Place::OuterWall, None) {
            self.keep_front_free(index);
        }
    }
}
