//! Places and doorways of the graph against the rooms and doors of the building.
//!
//! Which room of the graph is which true room is the one-to-one choice under which most places are right. Not counted are
//! frontier places (no skeleton) and places in a doorway: in the box of the opening, which reaches a cell of the place graph
//! beyond the wall on both sides. A place without a room, or outside of the building, is wrong.

use std::collections::{BTreeMap, BTreeSet};

use mission::dsg::RoomId;
use nalgebra::{Point2, Point3};
use omni_sim::building::{Building, DoorAxis, DoorTruth};
use serde::Serialize;

use super::assign::assign;
use super::ratio::{Ratio, Spread};

/// Half the depth of a door's box: half of the thickest wall (0.12 m) and one cell of the place graph.
const DOOR_REACH_M: f64 = 0.06 + 0.10;
/// A doorway of the graph this near to the middle of a door is that door.
const DOOR_PLACE_M: f64 = 0.5;

/// A place of the skeleton, in the coordinates of the building, and its room in the graph.
pub type KnownPlace = (Point3<f64>, Option<RoomId>);

/// Figures of layer 3 and 4.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PlaceFigures {
    /// Of the places that count, those whose room is the true room's.
    pub right_room: Ratio,
    /// Of these places, those in no room of the building.
    pub outside: usize,
    /// Of these places, those without a room in the graph.
    pub without_room: usize,
    /// Places in doorways: not counted.
    pub in_doorways: usize,
    /// Frontier places: not counted.
    pub frontiers: usize,
    /// Rooms of the building.
    pub true_rooms: usize,
    /// Rooms of the graph.
    pub known_rooms: usize,
}

impl PlaceFigures {
    /// Of several buildings.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a PlaceFigures> + Clone) -> PlaceFigures {
        let sum = |pick: fn(&PlaceFigures) -> usize| all.clone().map(pick).sum();
        PlaceFigures {
            right_room: Ratio::pooled(all.clone().map(|figures| figures.right_room)),
            outside: sum(|f| f.outside),
            without_room: sum(|f| f.without_room),
            in_doorways: sum(|f| f.in_doorways),
            frontiers: sum(|f| f.frontiers),
            true_rooms: sum(|f| f.true_rooms),
            known_rooms: sum(|f| f.known_rooms),
        }
    }
}

/// Figures of the doorways.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct DoorwayFigures {
    /// Of the doors between two rooms that were both entered, those with a doorway of the graph within 0.5 m.
    pub found: Ratio,
    /// ... and that doorway joins the two rooms of the graph that are the door's.
    pub found_between_its_rooms: Ratio,
    /// Of the graph's doorways, those within 0.5 m of any door.
    pub precision: Ratio,
    /// Distance between the middles, of those found.
    pub place_error_m: Spread,
    /// Difference of the widths, of those found.
    pub width_error_m: Spread,
}

impl DoorwayFigures {
    /// Of several buildings.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a DoorwayFigures> + Clone) -> DoorwayFigures {
        let ratio = |pick: fn(&DoorwayFigures) -> Ratio| Ratio::pooled(all.clone().map(pick));
        DoorwayFigures {
            found: ratio(|f| f.found),
            found_between_its_rooms: ratio(|f| f.found_between_its_rooms),
            precision: ratio(|f| f.precision),
            place_error_m: Spread::pooled(all.clone().map(|f| &f.place_error_m)),
            width_error_m: Spread::pooled(all.clone().map(|f| &f.width_error_m)),
        }
    }
}

/// Which room of the graph each true room is.
pub fn identify_rooms(building: &Building, places: &[KnownPlace]) -> BTreeMap<u32, RoomId> {
    let known: Vec<RoomId> = places.iter().filter_map(|(_, id)| *id).collect::<BTreeSet<_>>().into_iter().collect();
    let mut common = vec![vec![0.0; known.len()]; building.rooms.len()];
    for (at, id) in counted(building, places) {
        if let (Some(room), Some(id)) = (building.room_at(at), id) {
            let column = known.binary_search(id).expect("the list has every id");
            common[room.id as usize][column] += 1.0;
        }
    }
    let chosen = assign(&common).into_iter().enumerate();
    chosen.filter_map(|(room, column)| Some((room as u32, known[column?]))).collect()
}

/// The figures of the places.
pub fn place_figures(
    building: &Building,
    places: &[KnownPlace],
    room_of: &BTreeMap<u32, RoomId>,
    frontiers: usize,
) -> PlaceFigures {
    let all: Vec<&KnownPlace> = counted(building, places).collect();
    let room_at = |at: &Point3<f64>| building.room_at(at).map(|room| room.id);
    let is_right =
        |(at, id): &KnownPlace| id.is_some() && room_at(at).and_then(|room| room_of.get(&room)) == id.as_ref();
    PlaceFigures {
        right_room: Ratio::counted(all.iter().map(|place| is_right(place))),
        outside: all.iter().filter(|(at, _)| room_at(at).is_none()).count(),
        without_room: all.iter().filter(|(_, id)| id.is_none()).count(),
        in_doorways: places.len() - all.len(),
        frontiers,
        true_rooms: building.rooms.len(),
        known_rooms: places.iter().filter_map(|(_, id)| *id).collect::<BTreeSet<_>>().len(),
    }
}

/// The places that are not in a doorway.
fn counted<'a>(building: &'a Building, places: &'a [KnownPlace]) -> impl Iterator<Item = &'a KnownPlace> {
    places.iter().filter(|(at, _)| !building.doors.iter().any(|door| is_in_door(door, &at.xy())))
}

/// Whether a point lies in the box of an opening.
fn is_in_door(door: &DoorTruth, at: &Point2<f64>) -> bool {
    let off = at - door.center.xy();
    match door.axis {
        DoorAxis::X => off.x.abs() <= DOOR_REACH_M && off.y.abs() <= door.width_m / 2.0,
        DoorAxis::Y => off.y.abs() <= DOOR_REACH_M && off.x.abs() <= door.width_m / 2.0,
        DoorAxis::Z => false,
    }
}

/// A doorway of the graph, in the coordinates of the building.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownDoorway {
    /// Its rooms.
    pub rooms: (RoomId, RoomId),
    /// Its middle.
    pub at: Point2<f64>,
    /// Its width.
    pub width_m: f64,
}

/// The doorway of each door that counts: `None` if there is none. A doorway is the door of nobody else.
pub fn find_doors<'a>(
    building: &'a Building,
    doorways: &[KnownDoorway],
    entered: &BTreeSet<u32>,
) -> Vec<(&'a DoorTruth, Option<usize>)> {
    let is_asked = |door: &&DoorTruth| {
        door.axis != DoorAxis::Z && entered.contains(&door.rooms.0) && entered.contains(&door.rooms.1)
    };
    let doors: Vec<&DoorTruth> = building.doors.iter().filter(is_asked).collect();
    let nearness = |door: &DoorTruth, doorway: &KnownDoorway| {
        let distance_m = (doorway.at - door.center.xy()).norm();
        // Nearer is more, and every one within reach is more than none.
        if distance_m <= DOOR_PLACE_M { 1.0 + DOOR_PLACE_M - distance_m } else { 0.0 }
    };
    let weights: Vec<Vec<f64>> =
        doors.iter().map(|door| doorways.iter().map(|doorway| nearness(door, doorway)).collect()).collect();
    std::iter::zip(doors, assign(&weights)).collect()
}

/// The figures of the doorways.
pub fn doorway_figures(
    building: &Building,
    doorways: &[KnownDoorway],
    found: &[(&DoorTruth, Option<usize>)],
    room_of: &BTreeMap<u32, RoomId>,
) -> DoorwayFigures {
    let pairs = || found.iter().filter_map(|(door, index)| Some((*door, doorways[(*index)?])));
    let is_between = |door: &DoorTruth, doorway: &KnownDoorway| {
        let rooms = (room_of.get(&door.rooms.0), room_of.get(&door.rooms.1));
        let (a, b) = (Some(&doorway.rooms.0), Some(&doorway.rooms.1));
        rooms == (a, b) || rooms == (b, a)
    };
    let is_a_door = |doorway: &KnownDoorway| {
        building.doors.iter().any(|door| (door.center.xy() - doorway.at).norm() <= DOOR_PLACE_M)
    };
    DoorwayFigures {
        found: Ratio::counted(found.iter().map(|(_, index)| index.is_some())),
        found_between_its_rooms: Ratio::new(
            pairs().filter(|(door, doorway)| is_between(door, doorway)).count(),
            found.len(),
        ),
        precision: Ratio::counted(doorways.iter().map(is_a_door)),
        place_error_m: Spread::of(pairs().map(|(door, doorway)| (doorway.at - door.center.xy()).norm())),
        width_error_m: Spread::of(pairs().map(|(door, doorway)| (doorway.width_m - door.width_m).abs())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map_score::test_things::{building_of, room};

    fn two_rooms() -> Building {
        let mut building = building_of(vec![room(0, [0.0, 0.0, 4.0, 4.0]), room(1, [4.1, 0.0, 8.0, 4.0])], Vec::new());
        building.doors.push(DoorTruth {
            rooms: (0, 1),
            center: Point3::new(4.05, 2.0, 0.0),
            width_m: 1.0,
            height_m: 2.05,
            axis: DoorAxis::X,
        });
        building
    }

    fn places(of: &[(f64, u64)]) -> Vec<KnownPlace> {
        of.iter().map(|(x, id)| (Point3::new(*x, 2.0, 1.0), (*id > 0).then_some(RoomId(*id)))).collect()
    }

    #[test]
    fn a_room_cut_in_two_keeps_its_larger_half_and_doorway_places_are_left_out() {
        let building = two_rooms();
        // Left room: three places of R1, two of R3. Right: one of R2, one without a room. One in the door, one outside.
        let places =
            places(&[(1.0, 1), (1.5, 1), (2.0, 1), (2.5, 3), (3.0, 3), (5.0, 2), (6.0, 0), (4.2, 1), (9.0, 2)]);
        let room_of = identify_rooms(&building, &places);
        assert_eq!(room_of, BTreeMap::from([(0, RoomId(1)), (1, RoomId(2))]));
        let figures = place_figures(&building, &places, &room_of, 7);
        assert_eq!(figures.right_room, Ratio::new(4, 8));
        assert_eq!((figures.outside, figures.without_room, figures.in_doorways, figures.frontiers), (1, 1, 1, 7));
        assert_eq!((figures.true_rooms, figures.known_rooms), (2, 3));
    }

    #[test]
    fn one_id_over_two_rooms_is_right_in_one_of_them_only() {
        let building = two_rooms();
        let places = places(&[(1.0, 1), (2.0, 1), (5.0, 1)]);
        let room_of = identify_rooms(&building, &places);
        assert_eq!(place_figures(&building, &places, &room_of, 0).right_room, Ratio::new(2, 3));
    }

    #[test]
    fn a_doorway_is_found_within_half_a_metre_and_only_where_both_rooms_were_entered() {
        let building = two_rooms();
        let room_of = BTreeMap::from([(0, RoomId(1)), (1, RoomId(2))]);
        let doorway = |a: u64, b: u64, x: f64| KnownDoorway {
            rooms: (RoomId(a), RoomId(b)),
            at: Point2::new(x, 2.0),
            width_m: 0.9,
        };
        let figures = |doorways: &[KnownDoorway], entered: &[u32]| {
            let entered = entered.iter().copied().collect();
            doorway_figures(&building, doorways, &find_doors(&building, doorways, &entered), &room_of)
        };
        let good = figures(&[doorway(1, 2, 4.25), doorway(1, 3, 1.0)], &[0, 1]);
        assert_eq!((good.found, good.found_between_its_rooms), (Ratio::new(1, 1), Ratio::new(1, 1)));
        assert_eq!(good.precision, Ratio::new(1, 2));
        assert!((good.place_error_m.all[0] - 0.2).abs() < 1e-9 && (good.width_error_m.all[0] - 0.1).abs() < 1e-9);
        let other_room = figures(&[doorway(1, 3, 4.25)], &[0, 1]);
        assert_eq!((other_room.found.hits, other_room.found_between_its_rooms.hits), (1, 0));
        assert_eq!(figures(&[doorway(1, 2, 4.6)], &[0, 1]).found, Ratio::new(0, 1));
        assert_eq!(figures(&[doorway(1, 2, 4.05)], &[0]).found.of, 0);
    }
}
