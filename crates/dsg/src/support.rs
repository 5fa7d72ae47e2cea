//! What carries each thing. A thing stands on one other, and nothing floats.
//!
//! A robot sees a monitor but not its thin foot, and of a kitchen counter higher than its eyes the front but not the top. The
//! boxes then leave a gap, or do not overlap from above, and what stands there seems to float. A thing that is neither near
//! the floor nor of a kind that hangs on walls must stand on something: of the larger things of its room whose tops are about
//! at its foot, on the one that is nearest to being right below it.

use std::collections::{BTreeMap, BTreeSet};

use crate::contact::{contact, hangs};
use crate::graph::SceneGraph;
use crate::ids::{ObjectId, RoomId};
use crate::object::Object;
use crate::relation::RelationKind;
use crate::relations::RelationConfig;

/// What stands lower than this above the lowest thing of its room may stand on the floor, unseen feet and all.
const OFF_THE_FLOOR_M: f64 = 0.30;
/// The foot of a thing may be unseen up to so much over the top that carries it ...
const UNSEEN_FOOT_M: f64 = 0.30;
/// ... or seem so much lower than that top: both are measured to a voxel or two.
const SUNK_M: f64 = 0.12;
/// The top of a thing may be unseen so far behind its front.
const UNSEEN_TOP_M: f64 = 0.35;

/// What things stand on, as far as their boxes say.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Standing {
    /// Each thing that another one carries: which one, and whether on or inside. A thing stands on one thing.
    pub carrier_of: BTreeMap<ObjectId, (RelationKind, ObjectId)>,
    /// Things off the floor of which nothing is known that carries them.
    pub floating: BTreeSet<ObjectId>,
}

/// Who stands on whom: by touching (`neighbours` are the pairs that may), else by not floating.
pub(crate) fn standing(graph: &SceneGraph, neighbours: &[(&Object, &Object)], config: &RelationConfig) -> Standing {
    let mut best: BTreeMap<ObjectId, (bool, f64, RelationKind, ObjectId)> = BTreeMap::new();
    for (a, b) in neighbours {
        for (thing, other) in [(a, b), (b, a)] {
            let are_in_two_rooms = matches!((thing.room, other.room), (Some(a), Some(b)) if a != b);
            let kind = contact(thing, other, config).filter(|kind| *kind != RelationKind::Under && !are_in_two_rooms);
            let Some(kind) = kind else { continue };
            // A plate is on the table, not on the chair under it between whose seat and back it seems to be; and a bottle beside a
            // keyboard is on the desk: what ends at its foot goes first, then what is large.
            let air_m = (thing.bounds.min.z - other.bounds.max.z).abs();
            let is_top_at_foot = kind == RelationKind::Inside || air_m <= config.contact_m;
            let sides_m = other.bounds.sides_m();
            let rank = (is_top_at_foot, sides_m.x * sides_m.y, kind, other.id);
            let known = best.entry(thing.id).or_insert(rank);
            if (rank.0, rank.1) > (known.0, known.1) {
                *known = rank;
            }
        }
    }
    let mut standing = Standing {
        carrier_of: best.into_iter().map(|(id, (_, _, kind, other))| (id, (kind, other))).collect(),
        floating: BTreeSet::new(),
    };
    let mut of_room: BTreeMap<RoomId, Vec<&Object>> = BTreeMap::new();
    for object in graph.confirmed_objects() {
        if let Some(room) = object.room {
            of_room.entry(room).or_default().push(object);
        }
    }
    for things in of_room.values() {
        let floor_m = things.iter().map(|thing| thing.bounds.min.z).fold(f64::INFINITY, f64::min);
        for thing in things.iter().filter(|thing| !hangs(&thing.label)) {
            let is_low = thing.bounds.min.z - floor_m < OFF_THE_FLOOR_M;
            if is_low || standing.carrier_of.contains_key(&thing.id) {
                continue;
            }
            let misfits = things.iter().filter_map(|other| Some((misfit_m(thing, other)?, other.id)));
            match misfits.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) {
                Some((_, carrier)) => drop(standing.carrier_of.insert(thing.id, (RelationKind::On, carrier))),
                None => drop(standing.floating.insert(thing.id)),
            }
        }
    }
    standing
}

/// How far a thing is from standing right on another; `None` if the other cannot carry it.
fn misfit_m(thing: &Object, other: &Object) -> Option<f64> {
    let (s, o) = (&thing.bounds, &other.bounds);
    let longest_m = |sides: nalgebra::Vector3<f64>| sides.x.max(sides.y);
    let is_larger = longest_m(o.sides_m()) >= 0.9 * longest_m(s.sides_m()) && o.volume_m3() > s.volume_m3();
    let (air_m, beside_m) = (s.min.z - o.max.z, s.horizontal_gap_m(o));
    let is_at_its_foot = (-SUNK_M..=UNSEEN_FOOT_M).contains(&air_m);
    let can = thing.id != other.id && !hangs(&other.label) && is_larger && is_at_its_foot && beside_m <= UNSEEN_TOP_M;
    can.then_some(air_m.abs() + beside_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Aabb;
    use crate::op::Op;
    use crate::room::Room;
    use nalgebra::{Point3, Vector3};

    fn carrier_of_second(things: &[(&str, [f64; 3], [f64; 3])]) -> Option<ObjectId> {
        let mut graph = SceneGraph::new();
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).unwrap();
        for (at, (label, center, sides)) in things.iter().enumerate() {
            let bounds = Aabb::from_center(Point3::from(*center), Vector3::from(*sides));
            let object = Object { room: Some(RoomId(1)), ..Object::new(ObjectId(at as u64 + 1), label, bounds) };
            graph.apply(Op::PutObject(Box::new(object))).unwrap();
        }
        let things: Vec<&Object> = graph.objects().collect();
        let pairs: Vec<(&Object, &Object)> =
            things.iter().enumerate().flat_map(|(at, a)| things[at + 1..].iter().map(move |b| (*a, *b))).collect();
        standing(&graph, &pairs, &RelationConfig::default()).carrier_of.get(&ObjectId(2)).map(|(_, carrier)| *carrier)
    }

    const DESK: (&str, [f64; 3], [f64; 3]) = ("desk", [0.0, 0.0, 0.37], [1.4, 0.7, 0.74]);

    #[test]
    fn a_monitor_without_a_foot_and_a_mug_behind_the_front_of_a_counter() {
        assert_eq!(carrier_of_second(&[DESK, ("monitor", [0.0, 0.1, 1.1], [0.5, 0.2, 0.4])]), Some(ObjectId(1)));
        let front = ("counter", [0.0, 0.0, 0.44], [0.8, 0.06, 0.88]);
        assert_eq!(carrier_of_second(&[front, ("mug", [0.1, 0.2, 0.93], [0.1, 0.1, 0.1])]), Some(ObjectId(1)));
    }

    #[test]
    fn what_hangs_is_low_far_or_larger_is_not_carried() {
        assert_eq!(carrier_of_second(&[DESK, ("picture", [0.0, 0.3, 1.2], [0.5, 0.03, 0.4])]), None);
        assert_eq!(carrier_of_second(&[DESK, ("trash bin", [1.0, 0.0, 0.2], [0.3, 0.3, 0.4])]), None);
        assert_eq!(carrier_of_second(&[DESK, ("mug", [1.3, 0.0, 0.8], [0.1, 0.1, 0.1])]), None);
        assert_eq!(carrier_of_second(&[DESK, ("bed", [0.0, 0.0, 1.0], [2.0, 1.6, 0.5])]), None);
    }

    #[test]
    fn a_thing_stands_on_one_thing_and_rather_on_furniture() {
        let mug = ("mug", [0.0, 0.0, 0.79], [0.1, 0.1, 0.1]);
        assert_eq!(carrier_of_second(&[DESK, mug]), Some(ObjectId(1)));
        // Its box overlaps that of the keyboard beside it, and the chair's back is higher than the desk.
        let keyboard = ("keyboard", [0.1, 0.0, 0.76], [0.4, 0.15, 0.03]);
        let chair = ("office chair", [0.0, -0.1, 0.5], [0.6, 0.6, 1.0]);
        assert_eq!(carrier_of_second(&[keyboard, mug, DESK, chair]), Some(ObjectId(3)));
        assert_eq!(carrier_of_second(&[keyboard, mug, chair]), Some(ObjectId(1)));
        let pillow = ("pillow", [0.0, 0.0, 0.55], [0.4, 0.3, 0.1]);
        assert_eq!(carrier_of_second(&[chair, pillow]), Some(ObjectId(1)));
    }
}
