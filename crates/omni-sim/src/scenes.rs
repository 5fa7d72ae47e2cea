//! Named scenes: two default buildings and three special ones that test one thing each.

use crate::building::{Building, BuildingConfig, RoomKind, Style, generate};
use crate::cooccurrence::Cooccurrence;
use crate::doors::PlanDoor;
use crate::floorplan::{Border, Cells, PlanRoom, StoreyPlan};
use crate::generator::{Furnishing, raise};

/// First seed looked at for `"flat"`. The scene is the first from here on that keeps its promise, so a change of the generator
/// may change the scene but not the promise.
const FLAT_SEED: u64 = 55;
/// First seed looked at for `"office"`.
const OFFICE_SEED: u64 = 78;
/// Seeds looked at.
const SEEDS: u64 = 400;

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
    named_scene_for(name, 1.0, 0.9)
}

/// The same for a robot that needs doors of `min_door_m` and `passage_m` of room (as in [`BuildingConfig`]): `"flat"` and
/// `"office"` are the usual ones if these are wide enough, and wider ones that keep the same promise if not. The special
/// scenes are as they are. `None` also if no building keeps the promise.
pub fn named_scene_for(name: &str, min_door_m: f64, passage_m: f64) -> Option<Building> {
    let room = |kind, x0, y0, x1, y1| PlanRoom { kind, parts: vec![Cells::new(x0, y0, x1, y1)] };
    let build = |rooms, doors: Vec<PlanDoor>, seed, furnishing| {
        raise(&[StoreyPlan { rooms }], &[doors], seed, 0.95, furnishing)
    };
    match name {
        "flat" => first_that(FLAT_SEED, Style::Flat, min_door_m, passage_m, keeps_flat_promise),
        "office" => first_that(OFFICE_SEED, Style::Office, min_door_m, passage_m, keeps_office_promise),
        "corridor" => Some(build(vec![room(RoomKind::Corridor, 0, 0, 600, 38)], vec![], 1, Furnishing::Bare)),
        "narrow-door" => {
            let rooms = vec![room(RoomKind::Study, 0, 0, 90, 84), room(RoomKind::LivingRoom, 90, 0, 190, 90)];
            let opening = Border { vertical: true, line: 90, from: 36, to: 50 };
            Some(build(rooms, vec![PlanDoor { rooms: (0, 1), opening }], 5, Furnishing::Full(Cooccurrence::Usual)))
        }
        "spin" => Some(build(
            vec![room(RoomKind::LivingRoom, 0, 0, 110, 100)],
            vec![],
            3,
            Furnishing::Full(Cooccurrence::Usual),
        )),
        _ => None,
    }
}

/// The first building of five rooms that keeps a promise and is wide enough.
fn first_that(
    seed: u64,
    style: Style,
    min_door_m: f64,
    passage_m: f64,
    promise: impl Fn(&Building) -> bool,
) -> Option<Building> {
    let usual = BuildingConfig { rooms: 5, style, ..BuildingConfig::default() };
    let is_wide = |building: &Building| building.doors.iter().all(|door| door.width_m >= min_door_m - 1e-9);
    let first = |config: &BuildingConfig| {
        (seed..seed + SEEDS)
            .find_map(|seed| generate(&BuildingConfig { seed, ..config.clone() }).ok().filter(|b| promise(b)))
    };
    first(&usual)
        .filter(|building| passage_m <= usual.passage_m && is_wide(building))
        .or_else(|| first(&BuildingConfig { min_door_m, passage_m, ..usual }))
}

/// One mug in the kitchen, within 0.45 m of the sink; a mug in another room; a bathroom with its own sink.
fn keeps_flat_promise(building: &Building) -> bool {
    let Some(kitchen) = building.rooms.iter().find(|r| r.kind == RoomKind::Kitchen) else {
        return false;
    };
    let of = |class: &'static str| building.objects.iter().filter(move |o| o.class == class);
    let (here, elsewhere): (Vec<_>, Vec<_>) = of("mug").partition(|m| m.room == kitchen.id);
    let near_sink =
        |m: &&&crate::building::ObjectTruth| of("sink").any(|s| s.room == m.room && s.bounds.gap_m(&m.bounds) <= 0.45);
    here.len() == 1
        && here.iter().filter(near_sink).count() == 1
        && !elsewhere.is_empty()
        && elsewhere.iter().filter(near_sink).count() == 0
        && of("sink").any(|s| s.room != kitchen.id)
}

/// One meeting room with one plant; a plant elsewhere.
fn keeps_office_promise(building: &Building) -> bool {
    let meeting: Vec<u32> = building.rooms.iter().filter(|r| r.kind == RoomKind::MeetingRoom).map(|r| r.id).collect();
    let plants: Vec<u32> = building.objects.iter().filter(|o| o.class == "plant").map(|o| o.room).collect();
    meeting.len() == 1 && plants.iter().filter(|p| **p == meeting[0]).count() == 1 && plants.len() > 1
}
