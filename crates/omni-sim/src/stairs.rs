//! The stairwell of a building with two storeys: where its shaft opens, its flights of steps, its railing.

use nalgebra::{Point3, Vector2};
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use crate::building::{Building, DoorAxis, DoorTruth, Rect, RoomKind};
use crate::catalog::class;
use crate::colors::draw_color;
use crate::doors::PlanDoor;
use crate::floorplan::{StoreyPlan, UNIT_M};
use crate::item::{Item, add_items};
use crate::shape::{Model, Part, Placement, Solid};
use crate::walls::{CEILING_M, SLAB_M, STOREY_M};

/// The hole above a stairwell, in the storey's coordinates: everything but the landing at the corridor. `None` without one.
pub fn stair_shaft(plan: &StoreyPlan, doors: &[PlanDoor], thickness_m: f64) -> Option<StairShaft> {
    let room = plan.rooms.iter().position(|r| r.kind == RoomKind::Stairwell)?;
    let c = plan.rooms[room].parts[0];
    let half = thickness_m / 2.0;
    let units = |v: i32| f64::from(v) * UNIT_M;
    let free = Rect::new(units(c.x0) + half, units(c.y0) + half, units(c.x1) - half, units(c.y1) - half);
    let door = doors.iter().find(|d| d.rooms.0 == room || d.rooms.1 == room)?.opening;
    // From the corridor's wall into the stairwell.
    let inward = match door.vertical {
        true if door.line == c.x0 => Vector2::new(1.0, 0.0),
        true => Vector2::new(-1.0, 0.0),
        false if door.line == c.y0 => Vector2::new(0.0, 1.0),
        false => Vector2::new(0.0, -1.0),
    };
    let mut hole = free;
    if inward.x > 0.0 {
        hole.min.x += LANDING_M;
    } else if inward.x < 0.0 {
        hole.max.x -= LANDING_M;
    } else if inward.y > 0.0 {
        hole.min.y += LANDING_M;
    } else {
        hole.max.y -= LANDING_M;
    }
    Some(StairShaft { room, hole, inward })
}

/// Depth of the landing at the corridor, metres.
const LANDING_M: f64 = 1.3;

/// Where the stairs are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StairShaft {
    /// Index of the stairwell in the storey's plan.
    pub room: usize,
    /// Opening in the slab above.
    pub hole: Rect,
    /// From the landing towards the flights, unit length, along an axis.
    pub inward: Vector2<f64>,
}

/// Two flights of solid steps with a landing half-way, turning left or right of the middle.
pub(crate) fn add_stairs(building: &mut Building, rng: &mut ChaCha8Rng, shaft: &StairShaft, room: u32) {
    let Some(class) = class("staircase") else {
        return;
    };
    let color = class.colors.choose(rng).copied().unwrap_or("grey");
    let rgb = draw_color(rng, color);
    // Model frame: x from the landing inwards, y to the left, origin in the middle of the hole.
    let along_x = shaft.inward.x.abs() > 0.5;
    let (deep, wide) = if along_x {
        (shaft.hole.width_m(), shaft.hole.height_m())
    } else {
        (shaft.hole.height_m(), shaft.hole.width_m())
    };
    let steps = 8;
    let rise = STOREY_M / (2 * steps) as f64;
    let half_landing = 1.1f64.min(deep * 0.35);
    let run = (deep - half_landing) / steps as f64;
    let mut model = Model::default();
    let mut block = |x0: f64, x1: f64, y0: f64, y1: f64, z1: f64| {
        model
            .parts
            .push(Part { solid: Solid::Block { min: Point3::new(x0, y0, 0.0), max: Point3::new(x1, y1, z1) }, rgb });
    };
    let x0 = -deep / 2.0;
    for k in 0..steps {
        let x = x0 + run * k as f64;
        block(x, x + run, 0.0, wide / 2.0, rise * (k + 1) as f64);
        // The second flight comes back towards the landing; its last step is the upper floor itself.
        let high = rise * (2 * steps - k) as f64;
        block(x, x + run, -wide / 2.0, 0.0, if k == 0 { high - 0.001 } else { high });
    }
    block(deep / 2.0 - half_landing, deep / 2.0, -wide / 2.0, wide / 2.0, rise * steps as f64);
    let middle = shaft.hole.center();
    let placement =
        Placement { origin: Point3::new(middle.x, middle.y, 0.0), yaw_rad: shaft.inward.y.atan2(shaft.inward.x) };
    let item = Item {
        class,
        color,
        rgb,
        material: "concrete",
        bounds: model.bounds(&placement),
        parts: model.part_bounds(&placement),
        model,
        placement,
        support: None,
        with: None,
        is_mover: false,
    };
    // A railing of 0.9 m on the upper floor before the lower flight.
    let rail = Model {
        parts: vec![Part {
            solid: Solid::block(x0 - 0.03, wide / 4.0, STOREY_M, 0.04, wide / 2.0, 0.9),
            rgb: [120, 120, 125],
        }],
        ..Default::default()
    };
    rail.push(&mut building.mesh, &placement, 0);
    add_items(building, vec![item], room);
}

/// The shaft as an opening between the two stairwells.
pub(crate) fn add_shaft(building: &mut Building, plans: &[StoreyPlan], shaft: &StairShaft) {
    let upper = plans[1].rooms.iter().position(|r| r.kind == RoomKind::Stairwell);
    let Some(upper) = upper else { return };
    let (w, h) = (shaft.hole.width_m(), shaft.hole.height_m());
    let middle = shaft.hole.center();
    building.doors.push(DoorTruth {
        rooms: (shaft.room as u32, (plans[0].rooms.len() + upper) as u32),
        center: Point3::new(middle.x, middle.y, CEILING_M + SLAB_M),
        width_m: w.min(h),
        height_m: w.max(h),
        axis: DoorAxis::Z,
    });
}
