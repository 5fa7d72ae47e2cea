//! "In the dining table group": is a thing used together with another one?

use crate::grounding::shape;
use crate::instruction::SpatialRelation;
use crate::relations::{Viewer, relation_score};
use crate::scene::Scene;

/// How well the thing at `own` is in the group round the one at `support`, in [0, 1]. Where the scene knows the group of either, membership
/// decides; where it knows neither (recorded boxes, a graph that is not yet grouped), what is on, in or near the support may be of its group.
pub(crate) fn group_score(own: usize, support: usize, scene: &Scene, viewer: &Viewer) -> f64 {
    /// In one group, but another thing names it.
    const MEMBER_OF_SAME: f64 = 0.7;
    const OUTSIDE: f64 = 0.05;
    let (thing, anchor) = (&scene.things[own], &scene.things[support]);
    match (thing.group, anchor.group) {
        (Some(a), Some(b)) if a == b => {
            if scene.groups[a].support == Some(anchor.id) {
                1.0
            } else {
                MEMBER_OF_SAME
            }
        }
        (None, None) => {
            0.8 * relation_score(SpatialRelation::InGroup, &shape(thing, scene), &shape(anchor, scene), viewer)
        }
        _ => OUTSIDE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::claim::Claim;
    use crate::describe::{describe, describe_without_a_view};
    use crate::grounding::ground;
    use crate::parser::parse_referring;
    use dsg::{Aabb, GroupConfig, Object, ObjectId, Op, Room, RoomId, SceneGraph, update_groups};
    use nalgebra::{Point3, Vector3};

    /// A dining table with two chairs and a desk with one; a fourth chair stands between them, in no group.
    fn scene() -> Scene {
        let mut graph = SceneGraph::new();
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).expect("room");
        let things =
            [("dining table", 0.0), ("chair", 0.9), ("chair", -0.9), ("desk", 7.0), ("chair", 6.2), ("chair", 3.4)];
        for (id, (label, x)) in (1..).zip(things) {
            let bounds = Aabb::from_center(Point3::new(x, 0.0, 0.4), Vector3::new(0.6, 0.6, 0.8));
            let mut object = Object { room: Some(RoomId(1)), ..Object::new(ObjectId(id), label, bounds) };
            if id == 6 {
                object.attributes.insert("function".into(), "reaching the top shelf".into());
            }
            graph.apply(Op::PutObject(Box::new(object))).expect("object");
        }
        update_groups(&mut graph, &GroupConfig::default()).expect("groups");
        Scene::from_graph(&graph, 0)
    }

    fn best(text: &str, scene: &Scene) -> u64 {
        let goal = parse_referring(text, &["chair", "desk", "dining table"]).expect("an expression");
        ground(&goal, scene, &Point3::new(3.5, 0.2, 1.5))[0].id.0
    }

    #[test]
    fn membership_decides_not_distance() {
        let scene = scene();
        assert_eq!(best("the chair in the desk group", &scene), 5);
        assert_eq!(best("the chair that belongs to the desk", &scene), 5);
        assert_eq!(best("the chair in the group of the desk farthest from the dining table", &scene), 5);
        assert_eq!(best("the chair in the dining table group closest to the desk", &scene), 2);
        assert_eq!(best("the chair used for reaching the top shelf", &scene), 6);
        assert!(
            [2, 3]
                .contains(&best("the chair in the dining table group and not used for reaching the top shelf", &scene))
        );
        let viewer = Viewer { position: Point3::new(3.5, 0.2, 1.5), forward: None };
        assert_eq!(group_score(4, 3, &scene, &viewer), 1.0);
        assert!(group_score(5, 3, &scene, &viewer) < 0.1, "it stands by itself");
    }

    #[test]
    fn descriptions_say_the_group_and_the_purpose() {
        let scene = scene();
        let said = describe(&scene, ObjectId(5)).expect("the chair at the desk");
        assert_eq!(said.text, "the chair in the desk group");
        assert_eq!(said.claims, [Claim::InGroup(3)]);
        // Two chairs that differ in nothing else, seen from no side.
        let mut graph = SceneGraph::new();
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).expect("room");
        for (id, purpose) in [(1, "sitting at a desk"), (2, "reaching the top shelf")] {
            let bounds = Aabb::from_center(Point3::new(id as f64, 0.0, 0.4), Vector3::new(0.6, 0.6, 0.8));
            let mut object = Object { room: Some(RoomId(1)), ..Object::new(ObjectId(id), "chair", bounds) };
            object.attributes.insert("function".into(), purpose.into());
            graph.apply(Op::PutObject(Box::new(object))).expect("object");
        }
        let said = describe_without_a_view(&Scene::from_graph(&graph, 0), ObjectId(2)).expect("by its purpose");
        assert_eq!(said.text, "the chair used for reaching the top shelf");
    }
}
