//! When nothing is left to search: is there no such thing, or is this one meant after all?
//!
//! A description is *unproven* where the robot may have misread or missed something, and *false* where what it saw well says otherwise.
//! An unproven one is worth a guess: nobody is sure of a colour that no image showed clearly, of a label that few images gave, of a pen
//! that is not in the map. A false one is an answer: a sofa that is blue in every image is no red sofa, and a sink, which one sees
//! from across the room, is not missed by a search that is over. Then the robot says what is not there, and what comes nearest.

use dsg::ObjectId;

use crate::candidates::{Candidates, ObjectCandidate};
use crate::grounding::{GroundingConfig, Scene, ground};
use crate::instruction::{AttributeKind, Referring, SpatialRelation, Step, StepKind};
use crate::situation::Situation;
use crate::vocabulary::{Class, STAND_IN, is_known, is_small};

/// A relation that holds so much may be true within the error of the boxes: things 1.6 m apart are "near" that much.
const UNPROVEN_RELATION: f64 = 0.3;
/// Class score of what a camera confuses with the class that was asked for.
const LOOK_ALIKE: f64 = 0.45;
/// Least score of an anchor that counts as known.
const KNOWN_ANCHOR: f64 = 0.3;

/// Whether a thing of which not every word was shown to hold may be the one meant.
pub(crate) fn may_be_meant(
    candidate: &ObjectCandidate,
    situation: &Situation,
    known: &Candidates,
    config: &GroundingConfig,
) -> bool {
    let Some(step) = situation.step() else { return false };
    let found = &candidate.found;
    let is_kind = found.class >= config.accept;
    let class = is_kind || (found.class >= LOOK_ALIKE && !is_settled(situation, found.id));
    let room = found.room >= config.accept_at_last;
    class
        && found.weakest_attribute >= config.accept_attributes
        && room
        && may_relate(candidate, step, situation, known)
}

/// A label that stands: from many images, or from nearby.
fn is_settled(situation: &Situation, id: ObjectId) -> bool {
    /// Images from several times as long as one error of a segmenter stays, and the margin of their votes.
    const OFTEN: u32 = 24;
    const CLEAR_MARGIN: f64 = 0.25;
    /// Margin below which a close look has not settled the label.
    const SETTLED_MARGIN: f64 = 0.15;
    situation.graph.object(id).is_some_and(|object| {
        let is_seen_often = object.observations >= OFTEN && object.label_margin >= CLEAR_MARGIN;
        is_seen_often || (situation.inspected.contains(&id) && object.label_margin >= SETTLED_MARGIN)
    })
}

/// Whether the relations may hold: within the error of the boxes, or to things that the search may have missed.
fn may_relate(candidate: &ObjectCandidate, step: &Step, situation: &Situation, known: &Candidates) -> bool {
    if candidate.found.weakest_relation >= UNPROVEN_RELATION {
        return true;
    }
    let unseen = unseen_anchors(&step.goal, &known.scene, situation);
    if unseen.is_empty() || !unseen.iter().all(|anchor| may_be_missed(&anchor.class)) {
        return false;
    }
    // What is said about the missing things aside, does the rest hold?
    let mut rest = step.goal.clone();
    rest.relations.retain(|clause| !clause.anchors.iter().any(|anchor| unseen.contains(&anchor)));
    let found = ground(&rest, &known.scene, &situation.viewer());
    let same = found.iter().find(|found| found.id == candidate.found.id);
    same.is_some_and(|found| found.weakest_relation >= UNPROVEN_RELATION)
}

/// Small things of kinds that cameras know are overlooked; what nobody has a word for is not expected to be there.
fn may_be_missed(class: &Class) -> bool {
    is_known(class) && is_small(class)
}

/// What the expression relates its thing to and nobody has seen.
fn unseen_anchors<'a>(goal: &'a Referring, scene: &Scene, situation: &Situation) -> Vec<&'a Referring> {
    let clauses = goal.relations.iter().filter(|clause| !clause.negated && clause.relation != SpatialRelation::Far);
    let anchors = clauses.flat_map(|clause| &clause.anchors).filter(|anchor| !anchor.class.is_wildcard());
    let is_unseen = |anchor: &&Referring| {
        let best = ground(anchor, scene, &situation.viewer());
        best.first().is_none_or(|best| best.total < KNOWN_ANCHOR || best.class <= STAND_IN)
    };
    anchors.filter(is_unseen).collect()
}

/// What is not there, and what comes nearest: "There is no red sofa here: I searched everywhere I can reach. What comes nearest is a blue
/// sofa in the living room (O12)."
pub(crate) fn reason_to_give_up(step: &Step, situation: &Situation, known: &Candidates) -> String {
    let goal = &step.goal;
    if step.kind == StepKind::GoToRoom {
        let blocked = known.rooms.iter().any(|room| room.score >= 0.5);
        return if blocked {
            format!("I know the {goal}, but found no way into it.")
        } else {
            format!("There is no {goal} here: I searched everywhere I can reach.")
        };
    }
    if known.objects.iter().any(|candidate| candidate.is_accepted) {
        return format!("I know where the {goal} is, but found no way to it.");
    }
    let mut reason = format!("There is no {} here: I searched everywhere I can reach.", phrase(goal));
    let unseen: Vec<String> = unseen_anchors(goal, &known.scene, situation)
        .into_iter()
        .map(|anchor| format!("no {}", phrase(anchor)))
        .collect();
    let room = goal.room.iter().filter(|_| known.rooms.first().is_none_or(|room| room.score < KNOWN_ANCHOR));
    let unseen: Vec<String> = unseen.into_iter().chain(room.map(|room| format!("no {room}"))).collect();
    if !unseen.is_empty() {
        reason.push_str(&format!(" I saw {}.", unseen.join(" and ")));
    }
    if let Some(nearest) = nearest(known) {
        reason.push_str(&format!(" What comes nearest is {}.", mention(situation, known, nearest)));
    }
    reason
}

/// The known thing that answers best: of the class if there is one, else what looks like it.
fn nearest(known: &Candidates) -> Option<&ObjectCandidate> {
    let key = |candidate: &&ObjectCandidate| (candidate.found.class >= 0.6, candidate.found.total);
    known.objects.iter().filter(|candidate| candidate.found.class >= LOOK_ALIKE).max_by(|a, b| {
        let (a_key, b_key) = (key(a), key(b));
        a_key.0.cmp(&b_key.0).then(a_key.1.total_cmp(&b_key.1)).then(b.found.id.cmp(&a.found.id))
    })
}

/// "a blue sofa in the living room (O12)".
fn mention(situation: &Situation, known: &Candidates, candidate: &ObjectCandidate) -> String {
    let thing = &known.scene.things[candidate.found.index];
    let words = plain_words(known, candidate);
    let room = thing.room.and_then(|room| situation.graph.room(known.scene.rooms[room].id));
    let place = room.map_or(String::new(), |room| format!(" in the {}", room.name));
    format!("{} {words}{place} ({})", article(&words), candidate.found.id)
}

/// Colour, if it is known, and label.
pub(crate) fn plain_words(known: &Candidates, candidate: &ObjectCandidate) -> String {
    let label = known.scene.label(candidate.found.index);
    match &known.scene.things[candidate.found.index].color_name {
        Some(color) => format!("{color} {label}"),
        None => label.to_owned(),
    }
}

/// "a" or "an".
pub(crate) fn article(words: &str) -> &'static str {
    if words.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" }
}

/// The expression as one says it: "red mug near the sink in the kitchen".
fn phrase(goal: &Referring) -> String {
    let mut words: Vec<String> = goal.superlatives.iter().map(|superlative| superlative.word().to_owned()).collect();
    for attribute in goal.attributes.iter().filter(|attribute| attribute.kind != AttributeKind::Function) {
        words.push(format!("{}{}", if attribute.negated { "not " } else { "" }, attribute.word));
    }
    words.push(if goal.class.is_wildcard() { "thing".into() } else { goal.class.text.clone() });
    for attribute in goal.attributes.iter().filter(|attribute| attribute.kind == AttributeKind::Function) {
        words.push(format!("{}used for {}", if attribute.negated { "not " } else { "" }, attribute.word));
    }
    for clause in &goal.relations {
        let anchors: Vec<String> = clause.anchors.iter().map(|anchor| format!("the {}", phrase(anchor))).collect();
        let not = if clause.negated { "not " } else { "" };
        words.push(format!("{not}{} {}", clause.relation.word(), anchors.join(" and ")));
    }
    // What stands near something in the kitchen is in the kitchen: once is enough.
    let is_said = |room: &&crate::instruction::RoomReference| {
        let anchors = goal.relations.iter().flat_map(|clause| &clause.anchors);
        !anchors.into_iter().any(|anchor| anchor.room.as_ref() == Some(room))
    };
    words.extend(goal.room.iter().filter(is_said).map(|room| format!("in the {room}")));
    words.extend(goal.excluded_rooms.iter().map(|room| format!("not in the {room}")));
    words.join(" ")
}
