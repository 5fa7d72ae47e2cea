//! Named scenes: two default buildings and three special ones that test one thing each.

use crate::building::{Building, BuildingConfig, RoomKind, Style, generate};
use crate::doors::PlanDoor;
use crate::floorplan::{Border, Cells, PlanRoom, StoreyPlan};
use crate::generator::{Furnishing, raise};

/// The seed of `"flat"`: a kitchen with a mug within reach of the sink, and a mug in another room.
const FLAT_SEED: u64 = 0;
/// The seed of `"office"`: a plant in the meeting room and a plant elsewhere.
const OFFICE_SEED: u64 = 0;

/// Names that [`named_scene`] knows.
pub fn scene_names() -> &'static [&'static str] {
    &["flat", "office", "corridor", "narrow-door", "spin"]
}

/// A building by name:
/// - `"flat"`: five rooms; a mug near the kitchen sink, another mug elsewhere.
/// - `"office"`: five rooms; a meeting room with a plant, another plant elsewhere.
/// - `"corridor"`: 30 m long, 1.8 m wide, empty: nothing tells one place from the next.
/// - `"narrow-door"`: two rooms joined by a door of 0.7 m.
/// - `"spin"`: one furnished living room to turn round in.
///
/// `None` for any other name.
pub fn named_scene(name: &str) -> Option<Building> {
    let room = |kind, x0, y0, x1, y1| PlanRoom {
        kind,
        parts: vec![Cells::new(x0, y0, x1, y1)],
    };
    let build = |rooms, doors: Vec<PlanDoor>, seed, furnishing| {
        raise(&[StoreyPlan { rooms }], &[doors], seed, 0.95, furnishing)
    };
    match name {
        "flat" => generate(&BuildingConfig {
            seed: FLAT_SEED,
            rooms: 5,
            ..Default::default()
        })
        .ok(),
        "office" => generate(&BuildingConfig {
            seed: OFFICE_SEED,
            rooms: 5,
            style: Style::Office,
            ..Default::default()
        })
        .ok(),
        "corridor" => Some(build(
            vec![room(RoomKind::Corridor, 0, 0, 600, 38)],
            vec![],
            1,
            Furnishing::Bare,
        )),
        "narrow-door" => {
            let rooms = vec![
                room(RoomKind::Study, 0, 0, 90, 84),
                room(RoomKind::LivingRoom, 90, 0, 190, 90),
            ];
            let opening = Border {
                vertical: true,
                line: 90,
                from: 36,
                to: 50,
            };
            Some(build(
                rooms,
                vec![PlanDoor {
                    rooms: (0, 1),
                    opening,
                }],
                5,
                Furnishing::Full,
            ))
        }
        "spin" => Some(build(
            vec![room(RoomKind::LivingRoom, 0, 0, 110, 100)],
            vec![],
            3,
            Furnishing::Full,
        )),
        _ => None,
    }
}
