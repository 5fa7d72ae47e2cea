//! What carries a thing whose box touches nothing: nothing floats.
//!
//! A robot sees a monitor but not its thin foot, and of a kitchen counter higher than its eyes the front but not the top. The
//! boxes then leave a gap, or do not overlap from above, and what stands there seems to float. A thing that is neither near
//! the floor nor of a kind that hangs on walls must stand on something: of the larger things of its room whose tops are about
//! at its foot, on the one that is nearest to being right below it.

use std::collections::BTreeMap;

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

/// Each thing that stands on another without touching it, and the other one.
pub(crate) fn supports(graph: &SceneGraph, config: &RelationConfig) -> BTreeMap<ObjectId, ObjectId> {
    let mut of_room: BTreeMap<RoomId, Vec<&Object>> = BTreeMap::new();
    for object in graph.confirmed_objects() {
        if let Some(room) = object.room {
            of_room.entry(room).or_default().push(object);
        }
    }
    let mut found = BTreeMap::new();
    for things in of_room.values() {
        let floor_m = things.iter().map(|thing| thing.bounds.min.z).fold(f64::INFINITY, f64::min);
        for thing in things.iter().filter(|thing| !hangs(&thing.label)) {
            let is_low = thing.bounds.min.z - floor_m < OFF_THE_FLOOR_M;
            let rests = |kind| matches!(kind, Some(RelationKind::On | RelationKind::Inside));
            let is_held = || things.iter().any(|o| o.id != thing.id && rests(contact(thing, o, config)));
            if is_low || is_held() {
                continue;
            }
            let misfits = things.iter().filter_map(|other| Some((misfit_m(thing, other)?, other.id)));
            if let Some((_, carrier)) = misfits.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) {
                found.insert(thing.id, carrier);
            }
        }
    }
    found
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
        supports(&graph, &RelationConfig::default()).get(&ObjectId(2)).copied()
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
    fn what_touches_needs_no_guess() {
        assert_eq!(carrier_of_second(&[DESK, ("mug", [0.0, 0.0, 0.79], [0.1, 0.1, 0.1])]), None, "it is on it anyway");
    }
}
