//! Is a free description true of one thing alone? For sentences that somebody else wrote: each clause that the parser finds is looked up in
//! the boxes ([`crate::clause_truth`]). What cannot be looked up counts as not true: a description is as good as its worst clause.

use crate::claim::{Claim, Order};
use crate::clause_truth::{Surroundings, is_true};
use crate::instruction::{AttributeKind, Referring, RelationClause, SpatialRelation, Superlative};
use crate::parser::parse_referring;
use crate::scene::Scene;
use crate::vocabulary::{class_similarity, room_kind};

/// Largest gap that is called "near", metres.
const NEAR_M: f64 = 1.0;
/// Deepest nesting that is followed.
const MAX_DEPTH: usize = 3;

/// Whether every clause of the text holds of the thing at `index` and of no other that its noun fits. Left and right are those of a viewer in the
/// middle of the room that is named, or of everything.
pub fn is_true_of_one_alone(text: &str, scene: &Scene, index: usize) -> bool {
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    let Some(goal) = parse_referring(text, &labels) else { return false };
    if goal.class.is_wildcard() || goal.among.is_some() || goal.view.is_some() || goal.floor.is_some() {
        return false;
    }
    let around = Surroundings::of(scene, (0..scene.things.len()).filter(|at| is_in_room(&goal, scene, *at)).collect());
    let answers: Vec<usize> = answers(&goal, &around, 0);
    answers == [index]
}

/// The things of which every clause holds; none if one cannot be looked up.
fn answers(goal: &Referring, around: &Surroundings, depth: usize) -> Vec<usize> {
    if depth > MAX_DEPTH || !goal.excluded_rooms.is_empty() {
        return Vec::new();
    }
    let scene = around.scene;
    let fits = |at: &usize| {
        let class = scene.things[*at].classes.first().map(|(class, _)| &scene.classes[*class as usize]);
        class.is_some_and(|class| class_similarity(&goal.class, class) >= 0.8) && is_in_room(goal, scene, *at)
    };
    let of_class: Vec<usize> = around.things.iter().copied().filter(fits).collect();
    let holds = |at: usize, claim: Claim| {
        let rivals: Vec<usize> = of_class.iter().copied().filter(|other| *other != at).collect();
        is_true(&claim, around, at, &rivals)
    };
    let of_class_only = of_class.iter().copied();
    of_class_only
        .filter(|at| {
            goal.attributes.iter().all(|attribute| {
                let claim = match attribute.kind {
                    AttributeKind::Color => crate::color_truth::COLORS
                        .into_iter()
                        .find(|color| *color == attribute.word || (*color == "gray" && attribute.word == "grey"))
                        .map(Claim::Color),
                    AttributeKind::Material => Some(Claim::Material(attribute.word.clone())),
                    AttributeKind::Function => Some(Claim::Function(attribute.word.clone())),
                    AttributeKind::Size(size) => order_of(size).map(|order| Claim::Nth(1, order)),
                    AttributeKind::Other => None,
                };
                claim.is_some_and(|claim| holds(*at, claim) != attribute.negated)
            })
        })
        .filter(|at| {
            let n = goal.ordinal.filter(|_| goal.ordinal_clause().is_none()).unwrap_or(1);
            goal.superlatives.iter().all(|said| order_of(*said).is_some_and(|order| holds(*at, Claim::Nth(n, order))))
        })
        .filter(|at| {
            goal.relations.iter().enumerate().all(|(position, clause)| {
                let n = goal.ordinal.filter(|_| goal.ordinal_clause() == Some(position)).unwrap_or(1);
                relation_holds(clause, n, around, *at, &holds, depth).is_some_and(|holds| holds != clause.negated)
            })
        })
        .collect()
}

/// None if nobody can say.
fn relation_holds(
    clause: &RelationClause,
    n: u32,
    around: &Surroundings,
    at: usize,
    holds: &dyn Fn(usize, Claim) -> bool,
    depth: usize,
) -> Option<bool> {
    let bounds = |at: usize| &around.scene.things[at].bounds;
    let anchors: Vec<Vec<usize>> = clause
        .anchors
        .iter()
        .map(|anchor| answers(anchor, around, depth + 1).into_iter().filter(|other| *other != at).collect())
        .collect();
    let first = anchors.first().filter(|first| !first.is_empty())?;
    let any = |make: &dyn Fn(usize) -> Claim| Some(first.iter().any(|anchor| holds(at, make(*anchor))));
    match clause.relation {
        SpatialRelation::InGroup => any(&Claim::InGroup),
        SpatialRelation::On => any(&Claim::On),
        SpatialRelation::Inside => any(&Claim::In),
        SpatialRelation::Under => any(&Claim::Under),
        SpatialRelation::Supporting => Some(first.iter().any(|anchor| holds(*anchor, Claim::On(at)))),
        SpatialRelation::Above => Some(first.iter().any(|anchor| holds(*anchor, Claim::Under(at)))),
        SpatialRelation::LeftOf => any(&Claim::LeftOf),
        SpatialRelation::RightOf => any(&Claim::RightOf),
        SpatialRelation::InFrontOf => any(&Claim::InFrontOf),
        SpatialRelation::Behind => any(&Claim::Behind),
        SpatialRelation::Closest => any(&|anchor| Claim::Nth(n, Order::ClosestTo(anchor))),
        SpatialRelation::Farthest => any(&|anchor| Claim::Nth(n, Order::FarthestFrom(anchor))),
        SpatialRelation::Near => Some(first.iter().any(|anchor| bounds(at).gap_m(bounds(*anchor)) <= NEAR_M)),
        SpatialRelation::Between => {
            let second = anchors.get(1).unwrap_or(first);
            let pairs = first.iter().flat_map(|a| second.iter().map(move |b| (*a, *b)));
            Some(pairs.into_iter().any(|(a, b)| a != b && holds(at, Claim::Between(a, b))))
        }
        _ => None,
    }
}

fn order_of(said: Superlative) -> Option<Order> {
    Some(match said {
        Superlative::Largest => Order::Largest,
        Superlative::Smallest => Order::Smallest,
        Superlative::Highest => Order::Highest,
        Superlative::Lowest => Order::Lowest,
        Superlative::Leftmost => Order::FromLeft,
        Superlative::Rightmost => Order::FromRight,
        _ => return None,
    })
}

/// Whether the thing is in a room of the name or kind that is said; without one, anything is.
fn is_in_room(goal: &Referring, scene: &Scene, at: usize) -> bool {
    let Some(room) = goal.room.as_ref().filter(|room| !room.name.is_empty()) else { return true };
    scene.things[at].room.is_some_and(|index| {
        let facts = &scene.rooms[index];
        let kind = facts.kind.as_ref().map(|(kind, _)| room_kind(kind).unwrap_or(kind.as_str()));
        facts.name == room.name || room.kind.as_deref().is_some_and(|said| kind == Some(said))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refer_set::read_scene;

    #[test]
    fn every_clause_is_looked_up() {
        let line = r#"{"scene":"s","objects":[[1,"chair",0,0,0.4,0.5,0.5,0.8,200,20,20,null,null,null],[2,"chair",4,0,0.4,0.5,0.5,0.8,30,60,200,null,null,null],
            [3,"window",-0.5,0,1.5,0.1,1,1,20,20,20,null,null,null],[4,"table",2,2,0.35,1,1,0.7,12,9,6,null,null,null],[5,"mug",2,2,0.75,0.1,0.1,0.1,9,9,9,null,null,null]]}"#;
        let scene = read_scene(&line.replace('\n', "")).expect("sound").1;
        let is_true = |text: &str, index: usize| is_true_of_one_alone(text, &scene, index);
        assert!(is_true("the red chair", 0) && !is_true("the red chair", 1));
        assert!(is_true("the chair near the window", 0) && !is_true("the chair near the window", 1));
        assert!(!is_true("the chair opposite the window", 1), "who could say");
        assert!(is_true("the black mug on the table", 4));
        assert!(!is_true("the white mug on the table", 4), "the colour is wrong");
        assert!(!is_true("the chair", 0), "there are two");
        assert!(!is_true("the comfortable chair near the window", 0), "who could look that up");
        assert!(is_true("the table with a mug on top", 3));
        assert!(!is_true("", 0) && !is_true("the thing", 0));
    }
}
