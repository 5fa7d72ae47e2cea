//! The scene as the grounder sees it: plain things and rooms, from a scene graph or from a data set.

use std::collections::HashMap;

use dsg::{Aabb, GroupId, ObjectId, RoomId, SceneGraph};
use nalgebra::Point3;

use crate::oriented_box::OrientedBox;
use crate::vocabulary::{Class, kind_probabilities, material, normalise};

/// One thing of the scene.
#[derive(Debug, Clone)]
pub struct Thing {
    /// The caller's id.
    pub id: ObjectId,
    /// Classes it may be: index into [`Scene::classes`] and weight in [0, 1], the winner with 1.
    pub classes: Vec<(u32, f64)>,
    /// Its box in the world.
    pub bounds: Aabb,
    /// Mean colour.
    pub color: Option<[f64; 3]>,
    /// Colour, material and other words said about it (normalised, one space between).
    pub words: String,
    /// Name of its colour, if the graph holds one.
    pub color_name: Option<String>,
    /// What it is made of, in its canonical word ("wood"), if the graph holds that.
    pub material: Option<String>,
    /// What it is for ("sitting at a desk", normalised), if the graph holds that.
    pub function: Option<String>,
    /// Index into [`Scene::groups`].
    pub group: Option<usize>,
    /// Index into [`Scene::rooms`].
    pub room: Option<usize>,
    /// A point on its front face, if known.
    pub front: Option<Point3<f64>>,
    /// Its box along its own axes, if known.
    pub oriented: Option<OrientedBox>,
    /// How far the observation is trusted, in (0, 1].
    pub trust: f64,
}

/// One room of the scene.
#[derive(Debug, Clone)]
pub struct RoomFacts {
    /// The caller's id.
    pub id: RoomId,
    /// Its name, normalised.
    pub name: String,
    /// Whether somebody gave it that name; otherwise it was made from a guess of the kind and says no more than that.
    pub is_name_given: bool,
    /// What the graph takes it for, with confidence.
    pub kind: Option<(String, f64)>,
    /// Probability of each kind of [`kind_probabilities`] from its contents.
    pub probabilities: Vec<(&'static str, f64)>,
    /// Storey.
    pub floor: i32,
}

/// A functional group: things that are used together round one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GroupFacts {
    /// The thing that names it: the table, the desk, the bed.
    pub support: Option<ObjectId>,
}

/// Error of the faces of a mapped box, metres: two voxels.
const MAPPED_BOX_ERROR_M: f64 = 0.1;

/// Everything the grounder knows.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The things, in ascending order of ids.
    pub things: Vec<Thing>,
    /// The rooms, in ascending order of ids.
    pub rooms: Vec<RoomFacts>,
    /// The functional groups.
    pub groups: Vec<GroupFacts>,
    /// Distinct classes.
    pub classes: Vec<Class>,
    /// Storey of the viewer.
    pub floor: i32,
    /// How far the faces of the boxes may be off, metres: two voxels for a map, zero for the truth and for recorded boxes.
    pub box_error_m: f64,
    index: HashMap<String, u32>,
}

impl Scene {
    /// The label of the thing at `index`, as its class is written (singular, lower case); empty if it has none.
    ///
    /// # Panics
    /// If there is no such thing.
    pub fn label(&self, index: usize) -> &str {
        self.things[index].classes.first().map_or("", |(class, _)| self.classes[*class as usize].text.as_str())
    }

    /// Reads a scene graph. `floor` is the storey the robot is on. Movers (people) are left out as targets only by their class.
    pub fn from_graph(graph: &SceneGraph, floor: i32) -> Scene {
        let mut scene = Scene { floor, box_error_m: MAPPED_BOX_ERROR_M, ..Scene::default() };
        let room_index: HashMap<RoomId, usize> =
            graph.rooms().enumerate().map(|(index, room)| (room.id, index)).collect();
        let group_index: HashMap<GroupId, usize> =
            graph.groups().enumerate().map(|(index, group)| (group.id, index)).collect();
        scene.groups = graph.groups().map(|group| GroupFacts { support: group.support }).collect();
        let mut contents: Vec<Vec<u32>> = vec![Vec::new(); room_index.len()];
        for object in graph.objects() {
            let top = object.votes.values().copied().fold(0.0, f64::max);
            let mut classes: Vec<(u32, f64)> = vec![(scene.intern(&object.label), 1.0)];
            for (label, votes) in &object.votes {
                if *label != object.label && top > 0.0 && *votes > 0.0 {
                    classes.push((scene.intern(label), (votes / top).min(1.0)));
                }
            }
            let room = object.room.and_then(|id| room_index.get(&id).copied());
            if let Some(room) = room {
                contents[room].push(classes[0].0);
            }
            let mut words = normalise(&object.caption);
            for value in object.attributes.values() {
                words.push(' ');
                words.push_str(&normalise(value));
            }
            scene.things.push(Thing {
                id: object.id,
                classes,
                bounds: object.bounds,
                color: object.color.map(|rgb| rgb.map(f64::from)),
                words,
                color_name: object.attributes.get("color").map(|name| normalise(name)),
                material: object
                    .attributes
                    .get("material")
                    .and_then(|name| material(&normalise(name)))
                    .map(str::to_owned),
                function: object.attributes.get("function").map(|phrase| normalise(phrase)),
                group: object.group.and_then(|id| group_index.get(&id).copied()),
                room,
                front: None,
                oriented: None,
                trust: trust(object),
            });
        }
        for (room, mut seen) in graph.rooms().zip(contents) {
            seen.sort_unstable();
            seen.dedup();
            let seen: Vec<Class> = seen.into_iter().map(|index| scene.classes[index as usize].clone()).collect();
            scene.rooms.push(RoomFacts {
                id: room.id,
                name: normalise(&room.name),
                is_name_given: room.is_user_named || room.kind.is_none(),
                kind: room.kind.as_ref().map(|kind| (normalise(kind), room.kind_confidence)),
                probabilities: kind_probabilities(&seen),
                floor: room.floor,
            });
        }
        scene
    }

    /// The index of a label in [`Scene::classes`], added if it is new.
    pub fn intern(&mut self, label: &str) -> u32 {
        if let Some(index) = self.index.get(label) {
            return *index;
        }
        let index = self.classes.len() as u32;
        self.classes.push(Class::new(label));
        self.index.insert(label.to_string(), index);
        index
    }

    /// The room with this id.
    pub fn room(&self, id: RoomId) -> Option<&RoomFacts> {
        self.rooms.binary_search_by(|room| room.id.cmp(&id)).ok().map(|index| &self.rooms[index])
    }
}

/// Confirmed objects count fully; a first sight counts for something.
fn trust(object: &dsg::Object) -> f64 {
    if object.confirmed {
        1.0
    } else if object.observations >= 2 {
        0.85
    } else {
        0.7
    }
}
