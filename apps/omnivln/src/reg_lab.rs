//! Descriptions of the things of a laboratory that a robot has surveyed. The robot speaks from its scene graph; whoever hears it stands in
//! the true building, and every clause is looked up in the true boxes, colours and rooms.

use std::collections::BTreeMap;

use arena::lab_survey::SurveyedLab;
use arena::map_score::objects::{Known, Matching};
use arena::mission::dsg::{Aabb, ObjectId};
use arena::mission::octant_prompt::claim::{Claim, Group};
use arena::mission::octant_prompt::clause_truth::{Surroundings, singles_out};
use arena::mission::octant_prompt::describe::{Description, things_in, understood};
use arena::mission::octant_prompt::grounding::{GroupFacts, RoomFacts, Scene, Thing};
use arena::mission::octant_prompt::text_truth::is_true_of_one_alone;
use arena::mission::octant_prompt::vocabulary::{material, normalise};
use arena::omni_sim::building::{Bounds, Building, ObjectTruth};

/// A laboratory: what is known, what is true, and who is whom.
pub struct Lab {
    /// What the robot knows: its confirmed objects.
    pub known: Scene,
    /// The building.
    pub truth: Scene,
    /// The true thing of each known one, by index, where there is one.
    thing_of: Vec<Option<usize>>,
}

/// What the checker says of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verdict {
    /// True of this thing and of no other with its label, and found by the listener.
    pub is_accepted: bool,
    /// What is wrong first, in a word: `no such thing`, `label`, `claims`, `listener`; empty if it is accepted.
    pub fault: &'static str,
    /// It names a room in which the thing is not, or sends the listener to another room.
    pub is_cross_room: bool,
}

impl Lab {
    /// Compares the two sides.
    pub fn new(surveyed: &SurveyedLab) -> Lab {
        let truth = true_scene(&surveyed.building);
        let mut known = Scene::from_graph(&surveyed.graph, 0);
        known.things.retain(|thing| surveyed.graph.object(thing.id).is_some_and(|object| object.confirmed));
        let in_building = |thing: &Thing| {
            let Aabb { min, max } = thing.bounds.transformed(&surveyed.truth_from_map);
            let label =
                thing.classes.first().map_or(String::new(), |(class, _)| known.classes[*class as usize].text.clone());
            Known { id: thing.id, label, bounds: Bounds { min, max } }
        };
        let objects: Vec<Known> = known.things.iter().map(in_building).collect();
        let matching = Matching::of(&objects, &surveyed.building.objects);
        let thing_of: BTreeMap<ObjectId, usize> = matching.thing_of(&objects);
        let thing_of = known.things.iter().map(|thing| thing_of.get(&thing.id).copied()).collect();
        Lab { known, truth, thing_of }
    }

    /// Judges a description of the known thing at `index`.
    pub fn check(&self, found: &Description, index: usize) -> Verdict {
        let thing = self.thing_of[index];
        let heard = understood(&found.text, &self.truth);
        let room_of = |thing: usize| self.truth.things[thing].room;
        let heard_in = heard.and_then(|id| self.truth.things.iter().position(|thing| thing.id == id)).map(room_of);
        let is_named_wrongly =
            |thing: usize| found.room.as_ref().is_some_and(|room| !things_in(&self.truth, room).contains(&thing));
        let is_cross_room =
            thing.is_some_and(|thing| is_named_wrongly(thing) || heard_in.is_some_and(|room| room != room_of(thing)));
        let is_labelled = |thing: usize| self.truth.label(thing) == self.known.label(index);
        let fault = match thing {
            None => "no such thing",
            Some(thing) if !is_labelled(thing) => "label",
            Some(_) if !self.is_true(found, index) => "claims",
            Some(thing) if heard != Some(self.truth.things[thing].id) => "listener",
            Some(_) => "",
        };
        Verdict { is_accepted: fault.is_empty(), fault, is_cross_room }
    }

    /// Judges a text about the known thing at `index` that somebody else wrote.
    pub fn check_text(&self, text: &str, index: usize) -> Verdict {
        let Some(thing) = self.thing_of[index] else {
            return Verdict { is_accepted: false, fault: "no such thing", is_cross_room: false };
        };
        let heard = understood(text, &self.truth);
        let heard_in =
            heard.and_then(|id| self.truth.things.iter().find(|thing| thing.id == id)).map(|thing| thing.room);
        let fault = if !is_true_of_one_alone(text, &self.truth, thing) {
            "claims"
        } else if heard != Some(self.truth.things[thing].id) {
            "listener"
        } else {
            ""
        };
        Verdict {
            is_accepted: fault.is_empty(),
            fault,
            is_cross_room: heard_in.is_some_and(|room| room != self.truth.things[thing].room),
        }
    }

    /// Every clause in the truth: labels, room, group, claims, and what the other things are called by.
    fn is_true(&self, found: &Description, index: usize) -> bool {
        let has_its_name =
            |known: usize| self.thing_of[known].filter(|thing| self.truth.label(*thing) == self.known.label(known));
        let Some(thing) = has_its_name(index) else { return false };
        let around = match &found.room {
            None => Surroundings::whole(&self.truth),
            Some(room) => Surroundings::of(&self.truth, things_in(&self.truth, room)),
        };
        let in_truth = |claim: &Claim| claim.with_anchors(&has_its_name);
        let Some(claims) = found.claims.iter().map(in_truth).collect::<Option<Vec<Claim>>>() else { return false };
        let group = match &found.group {
            None => None,
            Some(group) => match in_truth(&group.by) {
                Some(by) => Some(Group { count: group.count, by }),
                None => return false,
            },
        };
        let is_called_rightly = |(anchor, claim): &(usize, Option<Claim>)| {
            let Some(anchor) = has_its_name(*anchor) else { return false };
            let claim = claim.iter().map(in_truth).collect::<Option<Vec<Claim>>>();
            claim.is_some_and(|claim| singles_out(None, &claim, &around, anchor))
        };
        found.anchors.iter().all(is_called_rightly) && singles_out(group.as_ref(), &claims, &around, thing)
    }
}

/// The building as somebody who knows it sees it.
fn true_scene(building: &Building) -> Scene {
    let mut scene = Scene::default();
    for room in &building.rooms {
        scene.rooms.push(RoomFacts {
            id: arena::mission::dsg::RoomId(room.id.into()),
            name: normalise(&room.name),
            is_name_given: true,
            kind: Some((normalise(room.kind.name()), 1.0)),
            probabilities: Vec::new(),
            floor: room.storey as i32,
        });
    }
    // A functional group is a thing with all that was placed with it or stands on it, and is called after that thing.
    let by_id: BTreeMap<u32, &ObjectTruth> = building.objects.iter().map(|object| (object.id, object)).collect();
    let support_of = |object: &ObjectTruth| {
        let next = |object: &&ObjectTruth| by_id.get(&object.placed_with.or(object.supported_by)?).copied();
        // Longer chains than there are things would be circles.
        let chain = std::iter::successors(Some(object), next).take(building.objects.len());
        chain.last().map_or(object.id, |last| last.id)
    };
    let supports: Vec<u32> = building.objects.iter().map(support_of).collect();
    let mut group_of: BTreeMap<u32, usize> = BTreeMap::new();
    for (object, support) in building.objects.iter().zip(&supports) {
        if object.id != *support && !group_of.contains_key(support) {
            group_of.insert(*support, scene.groups.len());
            scene.groups.push(GroupFacts { support: Some(ObjectId((*support).into())) });
        }
    }
    for (object, support) in building.objects.iter().zip(&supports) {
        let class = scene.intern(&object.class);
        scene.things.push(Thing {
            id: ObjectId(object.id.into()),
            classes: vec![(class, 1.0)],
            bounds: Aabb { min: object.bounds.min, max: object.bounds.max },
            color: Some(object.rgb.map(f64::from)),
            words: normalise(&format!("{} {}", object.color, object.material)),
            color_name: Some(normalise(&object.color)),
            material: normalise(&object.material).split(' ').find_map(material).map(str::to_owned),
            function: Some(normalise(&object.function)),
            group: group_of.get(support).copied(),
            room: Some(object.room as usize),
            front: None,
            oriented: None,
            trust: 1.0,
        });
    }
    scene
}
