//! Which furniture a kind of room has: recipes, read from top to bottom, that name what goes where and what comes with it.
//!
//! What occurs together in real rooms is written together here: a nightstand only beside a bed, a coffee table only before a
//! sofa. Chances below one and ranges of counts make rooms of a kind differ.

use rand::RngExt;
use rand::seq::IndexedRandom;

use crate::building::RoomKind;
use crate::cooccurrence::{Cooccurrence, Habits};
use crate::placement::{Furnisher, Place};

/// One line of a recipe.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    class: &'static str,
    count: (u32, u32),
    chance: f64,
    place: Place,
    with: &'static [Line],
}

const fn one(class: &'static str, chance: f64, place: Place) -> Line {
    Line { class, count: (1, 1), chance, place, with: &[] }
}

const fn some(class: &'static str, count: (u32, u32), chance: f64, place: Place) -> Line {
    Line { class, count, chance, place, with: &[] }
}

const fn set(class: &'static str, chance: f64, place: Place, with: &'static [Line]) -> Line {
    Line { class, count: (1, 1), chance, place, with }
}

const fn sets(class: &'static str, count: (u32, u32), place: Place, with: &'static [Line]) -> Line {
    Line { class, count, chance: 1.0, place, with }
}

/// Furnishes one room: by its recipe, or by what gives it its name and what the habits of the building put there besides.
pub fn furnish(furnisher: &mut Furnisher, kind: RoomKind, habits: &Habits) {
    follow(furnisher, daylight(kind), None);
    if habits.cooccurrence == Cooccurrence::Usual {
        follow(furnisher, recipe(kind), None);
        return;
    }
    let is_own = |line: &&Line| essentials(kind).contains(&line.class);
    recipe(kind).iter().filter(is_own).for_each(|line| follow(furnisher, std::slice::from_ref(line), None));
    if habits.cooccurrence == Cooccurrence::Shuffled {
        let lines = recipe(habits.table_of(kind)).iter().filter(|line| !names_a_room(line.class));
        lines.for_each(|line| follow(furnisher, std::slice::from_ref(line), None));
        return;
    }
    const THINGS: usize = 10;
    for _ in 0..THINGS {
        let lines: Vec<&Line> =
            recipe(Habits::any_kind(furnisher.rng)).iter().filter(|line| !names_a_room(line.class)).collect();
        if let Some(line) = lines.choose(furnisher.rng) {
            follow(furnisher, std::slice::from_ref(*line), None);
        }
    }
}

/// Some kind of room is known by it, so it stands in no other when things are exchanged.
fn names_a_room(class: &str) -> bool {
    use RoomKind::*;
    let named = [
        LivingRoom,
        Kitchen,
        DiningRoom,
        Bedroom,
        Bathroom,
        Office,
        LaundryRoom,
        MeetingRoom,
        Lab,
        PrintRoom,
        Reception,
    ];
    class != "chair" && class != "coffee table" && named.iter().any(|kind| essentials(*kind).contains(&class))
}

fn follow(furnisher: &mut Furnisher, lines: &[Line], parent: Option<usize>) {
    for line in lines {
        let count = furnisher.rng.random_range(line.count.0..=line.count.1);
        for _ in 0..count {
            if !furnisher.rng.random_bool(line.chance) {
                continue;
            }
            if let Some(index) = furnisher.put(line.class, line.place, parent) {
                follow(furnisher, line.with, Some(index));
            }
        }
    }
}

use Place::*;

const WINDOWS: &[Line] = &[Line { class: "window", count: (1, 2), chance: 0.9, place: OuterWall, with: RADIATOR }];
const RADIATOR: &[Line] = &[one("radiator", 0.45, Below)];
const ONE_WINDOW: &[Line] = &[one("window", 0.6, OuterWall)];

fn daylight(kind: RoomKind) -> &'static [Line] {
    use RoomKind::*;
    match kind {
        Bathroom | Restroom | LaundryRoom | Hallway | Corridor | Kitchen => ONE_WINDOW,
        StorageRoom | Stairwell | PrintRoom => &[],
        _ => WINDOWS,
    }
}

const DESK_SET: &[Line] = &[one("office chair", 1.0, InFront(0.05)), one("trash bin", 0.45, Beside)];
const SOFA_SET: &[Line] = &[
    one("tv stand", 0.9, Opposite),
    one("coffee table", 0.85, InFront(0.38)),
    one("side table", 0.5, Beside),
    one("floor lamp", 0.5, Beside),
];
const LOUNGE_SET: &[Line] = &[one("coffee table", 0.9, InFront(0.38)), one("floor lamp", 0.5, Beside)];
const COFFEE_TABLE: &[Line] = &[one("coffee table", 0.7, InFront(0.38))];
const CHAIRS_4: &[Line] = &[some("chair", (2, 4), 1.0, Around)];
const CHAIRS_6: &[Line] = &[some("chair", (4, 6), 0.9, Around)];
const CHAIRS_8: &[Line] = &[some("chair", (4, 8), 0.95, Around)];
const MEETING_CHAIRS: &[Line] = &[some("office chair", (4, 8), 0.95, Around)];
const NIGHTSTANDS: &[Line] = &[some("nightstand", (1, 2), 0.95, Beside)];
const LAB_STOOL: &[Line] = &[one("stool", 0.8, InFront(0.06))];
const LAMP_OR_PLANT: &[Line] = &[one("side table", 0.35, Beside), one("floor lamp", 0.4, Beside)];

/// Without these a room does not deserve its name.
pub fn essentials(kind: RoomKind) -> &'static [&'static str] {
    use RoomKind::*;
    match kind {
        LivingRoom | Lounge => &["sofa", "coffee table"],
        Kitchen => &["counter", "sink", "stove", "fridge"],
        DiningRoom => &["dining table", "chair"],
        Bedroom => &["bed", "wardrobe"],
        Bathroom | Restroom => &["toilet", "sink"],
        Study | Office => &["desk", "office chair"],
        LaundryRoom => &["washing machine"],
        StorageRoom => &["storage rack"],
        MeetingRoom => &["conference table", "office chair"],
        Lab => &["workbench"],
        PrintRoom => &["copier"],
        Reception => &["reception desk"],
        Hallway | Corridor | Stairwell => &[],
    }
}

/// The recipe of a kind of room.
fn recipe(kind: RoomKind) -> &'static [Line] {
    use RoomKind as K;
    match kind {
        K::LivingRoom => {
            const {
                &[
                    set("sofa", 1.0, WallMiddle, SOFA_SET),
                    some("bookshelf", (1, 2), 0.7, WallCorner),
                    set("armchair", 0.7, WallMiddle, LAMP_OR_PLANT),
                    one("armchair", 0.35, WallCorner),
                    set("dining table", 0.25, WallMiddle, CHAIRS_6),
                    one("sideboard", 0.5, WallMiddle),
                    some("plant", (1, 2), 0.75, Corner),
                    one("guitar", 0.25, Corner),
                    some("picture", (1, 3), 0.8, Hung),
                    one("clock", 0.3, Hung),
                ]
            }
        }
        K::Kitchen => {
            const {
                &[
                    one("counter", 1.0, Row),
                    one("sink", 1.0, Row),
                    one("counter", 1.0, Row),
                    one("stove", 1.0, Row),
                    some("counter", (0, 2), 1.0, Row),
                    one("dishwasher", 0.4, Row),
                    one("fridge", 1.0, Row),
                    set("kitchen table", 0.75, Center, CHAIRS_4),
                    one("cabinet", 0.35, WallCorner),
                    one("trash bin", 0.8, Corner),
                    some("stool", (1, 2), 0.3, WallCorner),
                    one("plant", 0.25, Corner),
                    one("clock", 0.5, Hung),
                    one("picture", 0.4, Hung),
                    one("towel", 0.3, Hung),
                ]
            }
        }
        K::DiningRoom => {
            const {
                &[
                    set("dining table", 1.0, Center, CHAIRS_8),
                    one("sideboard", 0.9, WallMiddle),
                    one("cabinet", 0.4, WallCorner),
                    some("plant", (1, 2), 0.6, Corner),
                    one("floor lamp", 0.4, Corner),
                    some("picture", (1, 2), 0.8, Hung),
                    one("mirror", 0.25, Hung),
                    one("clock", 0.3, Hung),
                ]
            }
        }
        K::Bedroom => {
            const {
                &[
                    set("bed", 1.0, WallMiddle, NIGHTSTANDS),
                    one("wardrobe", 0.95, WallCorner),
                    one("dresser", 0.55, WallCorner),
                    set("desk", 0.35, WallCorner, DESK_SET),
                    one("bookshelf", 0.3, WallCorner),
                    one("armchair", 0.25, WallCorner),
                    one("chair", 0.25, WallCorner),
                    one("floor lamp", 0.3, Corner),
                    one("plant", 0.4, Corner),
                    one("suitcase", 0.2, WallCorner),
                    one("backpack", 0.2, WallCorner),
                    one("guitar", 0.12, Corner),
                    one("laundry basket", 0.25, Corner),
                    some("picture", (1, 2), 0.7, Hung),
                    one("mirror", 0.4, Hung),
                ]
            }
        }
        K::Bathroom => {
            const {
                &[
                    one("bathtub", 0.85, WallCorner),
                    one("toilet", 1.0, WallMiddle),
                    one("sink", 1.0, WallMiddle),
                    one("washing machine", 0.3, WallCorner),
                    one("cabinet", 0.3, WallCorner),
                    one("laundry basket", 0.4, Corner),
                    one("trash bin", 0.4, Corner),
                    one("stool", 0.2, WallCorner),
                    one("mirror", 0.8, Hung),
                    some("towel", (1, 2), 0.8, Hung),
                ]
            }
        }
        K::Restroom => {
            const {
                &[
                    one("toilet", 1.0, WallMiddle),
                    one("sink", 1.0, WallMiddle),
                    one("toilet", 0.7, WallMiddle),
                    one("sink", 0.5, Row),
                    some("trash bin", (1, 2), 0.8, Corner),
                    one("cabinet", 0.3, WallCorner),
                    some("mirror", (1, 2), 0.9, Hung),
                    one("towel", 0.7, Hung),
                ]
            }
        }
        K::Study => {
            const {
                &[
                    set("desk", 1.0, WallMiddle, DESK_SET),
                    some("bookshelf", (1, 3), 0.85, WallCorner),
                    set("armchair", 0.5, WallCorner, LAMP_OR_PLANT),
                    one("filing cabinet", 0.4, WallCorner),
                    one("guitar", 0.3, Corner),
                    one("plant", 0.5, Corner),
                    one("box", 0.3, WallCorner),
                    one("backpack", 0.25, WallCorner),
                    some("picture", (1, 2), 0.7, Hung),
                    one("clock", 0.4, Hung),
                ]
            }
        }
        K::LaundryRoom => {
            const {
                &[
                    one("washing machine", 1.0, Row),
                    one("dryer", 0.8, Row),
                    one("sink", 0.6, Row),
                    some("laundry basket", (1, 2), 0.8, WallCorner),
                    one("storage rack", 0.6, WallCorner),
                    one("ironing board", 0.5, WallMiddle),
                    one("vacuum cleaner", 0.5, Corner),
                    one("cabinet", 0.3, WallCorner),
                    one("towel", 0.6, Hung),
                ]
            }
        }
        K::StorageRoom => {
            const {
                &[
                    some("storage rack", (1, 3), 1.0, WallCorner),
                    one("cabinet", 0.5, WallCorner),
                    some("box", (1, 4), 0.8, WallCorner),
                    one("vacuum cleaner", 0.5, Corner),
                    some("suitcase", (1, 2), 0.5, WallCorner),
                    one("trash bin", 0.3, Corner),
                    one("fire extinguisher", 0.3, WallCorner),
                ]
            }
        }
        K::Office => {
            const {
                &[
                    sets("desk", (1, 3), WallMiddle, DESK_SET),
                    one("filing cabinet", 0.7, WallCorner),
                    one("bookshelf", 0.6, WallCorner),
                    one("cabinet", 0.4, WallCorner),
                    some("plant", (1, 2), 0.5, Corner),
                    some("chair", (1, 2), 0.5, WallCorner),
                    one("coat rack", 0.35, Corner),
                    one("box", 0.25, WallCorner),
                    one("backpack", 0.3, WallCorner),
                    one("whiteboard", 0.35, Hung),
                    some("picture", (1, 2), 0.5, Hung),
                    one("clock", 0.35, Hung),
                ]
            }
        }
        K::MeetingRoom => {
            const {
                &[
                    one("whiteboard", 0.9, Hung),
                    set("conference table", 1.0, Center, MEETING_CHAIRS),
                    one("sideboard", 0.45, WallMiddle),
                    one("tv stand", 0.5, WallMiddle),
                    some("plant", (1, 2), 0.9, Corner),
                    some("chair", (1, 2), 0.3, WallCorner),
                    one("trash bin", 0.5, Corner),
                    one("coat rack", 0.3, Corner),
                    one("clock", 0.5, Hung),
                    one("picture", 0.5, Hung),
                ]
            }
        }
        K::Lab => {
            const {
                &[
                    Line { class: "workbench", count: (2, 4), chance: 1.0, place: WallMiddle, with: LAB_STOOL },
                    one("sink", 0.7, WallCorner),
                    some("cabinet", (1, 2), 0.8, WallCorner),
                    one("storage rack", 0.6, WallCorner),
                    one("fridge", 0.35, WallCorner),
                    set("desk", 0.4, WallCorner, DESK_SET),
                    one("fire extinguisher", 0.8, Corner),
                    some("trash bin", (1, 2), 0.7, Corner),
                    one("whiteboard", 0.6, Hung),
                    one("clock", 0.5, Hung),
                ]
            }
        }
        K::PrintRoom => {
            const {
                &[
                    some("copier", (1, 2), 1.0, WallMiddle),
                    one("storage rack", 0.8, WallCorner),
                    one("side table", 0.4, WallCorner),
                    one("filing cabinet", 0.5, WallCorner),
                    some("box", (1, 2), 0.6, WallCorner),
                    one("trash bin", 0.9, Corner),
                    one("clock", 0.3, Hung),
                ]
            }
        }
        K::Lounge => {
            const {
                &[
                    set("sofa", 1.0, WallMiddle, LOUNGE_SET),
                    set("sofa", 0.5, WallMiddle, COFFEE_TABLE),
                    one("vending machine", 0.7, WallCorner),
                    one("water dispenser", 0.6, WallCorner),
                    set("armchair", 0.7, WallMiddle, LAMP_OR_PLANT),
                    one("armchair", 0.5, WallCorner),
                    set("dining table", 0.3, WallMiddle, CHAIRS_4),
                    one("bookshelf", 0.4, WallCorner),
                    some("plant", (1, 3), 0.8, Corner),
                    one("trash bin", 0.6, Corner),
                    some("picture", (1, 3), 0.8, Hung),
                    one("clock", 0.4, Hung),
                ]
            }
        }
        K::Reception => {
            const {
                &[
                    one("reception desk", 1.0, Center),
                    set("sofa", 0.7, WallMiddle, COFFEE_TABLE),
                    some("armchair", (1, 2), 0.6, WallMiddle),
                    some("chair", (1, 3), 0.5, WallCorner),
                    one("filing cabinet", 0.4, WallCorner),
                    one("water dispenser", 0.5, WallCorner),
                    one("coat rack", 0.5, Corner),
                    some("plant", (1, 3), 0.85, Corner),
                    one("clock", 0.6, Hung),
                    some("picture", (1, 2), 0.8, Hung),
                ]
            }
        }
        K::Hallway => {
            const {
                &[
                    one("shoe cabinet", 0.7, WallCorner),
                    one("coat rack", 0.6, Corner),
                    one("console table", 0.5, WallMiddle),
                    one("bench", 0.3, WallCorner),
                    one("plant", 0.3, Corner),
                    some("picture", (1, 3), 0.7, Hung),
                    one("mirror", 0.6, Hung),
                ]
            }
        }
        K::Corridor => {
            const {
                &[
                    one("fire extinguisher", 0.9, WallCorner),
                    one("bench", 0.35, WallMiddle),
                    some("plant", (1, 2), 0.4, Corner),
                    one("water dispenser", 0.3, WallCorner),
                    one("trash bin", 0.4, WallCorner),
                    some("picture", (1, 3), 0.7, Hung),
                    one("clock", 0.3, Hung),
                ]
            }
        }
        K::Stairwell => const { &[one("fire extinguisher", 0.5, WallCorner), one("picture", 0.6, Hung)] },
    }
}
