//! The critic: is a proposed action consistent with the graph, the instruction and what the robot can do, now?
//!
//! It checks against the present graph whatever revision the prompt had, so a late answer counts only if it still holds. Each objection
//! has a code for programs and a sentence for the actor's next attempt.

use dsg::{ObjectId, PlaceId, RoomId};

use crate::action::{Action, Target};
use crate::candidates::{Candidates, candidates, is_well_inside};
use crate::grounding::GroundingConfig;
use crate::instruction::StepKind;
use crate::situation::Situation;
use crate::vocabulary::{Class, class_similarity};

/// Why an action is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CritiqueCode {
    /// The reply was no action of the grammar.
    Unparsable,
    /// The id is not in the graph.
    UnknownId,
    /// The id was in the graph at the prompt's revision and is gone.
    StaleName,
    /// The room, or the object's room, does not fit the step.
    RoomFilteredOut,
    /// No way leads there.
    Unreachable,
    /// The place is neither a frontier nor waiting for a closer look.
    NothingToExplore,
    /// The class, an attribute or a relation is false by the operators.
    TargetMismatch,
    /// Stop, but the robot is not within the stop distance in line of sight, or not inside the room.
    NotThereYet,
    /// Stop at a thing whose label is still in doubt, without a closer look.
    NotSureYet,
    /// The same action just had no effect.
    Repeat,
    /// Giving up although there is something left to do.
    Premature,
    /// The robot tried and did not get there. Set by the mission, never by the critic.
    Failed,
}

impl CritiqueCode {
    /// The word in logs.
    pub fn word(self) -> &'static str {
        match self {
            CritiqueCode::Unparsable => "unparsable",
            CritiqueCode::UnknownId => "unknown id",
            CritiqueCode::StaleName => "stale name",
            CritiqueCode::RoomFilteredOut => "room filtered out",
            CritiqueCode::Unreachable => "unreachable",
            CritiqueCode::NothingToExplore => "nothing to explore",
            CritiqueCode::TargetMismatch => "target mismatch",
            CritiqueCode::NotThereYet => "not there yet",
            CritiqueCode::NotSureYet => "not sure yet",
            CritiqueCode::Repeat => "repeat",
            CritiqueCode::Premature => "premature",
            CritiqueCode::Failed => "failed",
        }
    }
}

/// An objection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Critique {
    /// Its kind.
    pub code: CritiqueCode,
    /// The action it is about; None if there was none.
    pub action: Option<Action>,
    /// A sentence for the actor.
    pub message: String,
}

/// Checks actions. Deterministic; asks the situation's closures only.
#[derive(Debug, Clone, Default)]
pub struct Critic {
    /// The thresholds the symbolic reasoner uses, so that both mean the same by "this is it".
    pub grounding: GroundingConfig,
    /// For experiments: accepts everything. Default false.
    pub is_blind: bool,
}

impl Critic {
    /// Accepts or refuses an action proposed for a prompt of `prompt_revision`, in the situation as it is now.
    ///
    /// # Errors
    /// The first objection found.
    pub fn check(&self, action: &Action, situation: &Situation, prompt_revision: u64) -> Result<(), Critique> {
        let object = |code, message: String| Err(Critique { code, action: Some(action.clone()), message });
        if self.is_blind {
            return Ok(());
        }
        let Some(step) = situation.step() else {
            return object(CritiqueCode::TargetMismatch, "The instruction has no further step.".into());
        };
        let missing = || {
            let stale = prompt_revision != situation.graph.revision();
            if stale {
                object(
                    CritiqueCode::StaleName,
                    "It is no longer in the scene graph; the map has changed since the prompt.".into(),
                )
            } else {
                object(CritiqueCode::UnknownId, "There is no such id in the scene graph.".into())
            }
        };
        if matches!(action, Action::GoToRoom(_) | Action::Explore(_) | Action::GoNear(_))
            && situation.has_failed(action)
        {
            return object(CritiqueCode::Repeat, "This was tried and failed.".into());
        }
        if let (Some(meant), Some(other)) = (situation.meant, action.object())
            && meant != other
        {
            return object(CritiqueCode::TargetMismatch, format!("A person said that {meant} is meant."));
        }
        match action {
            Action::TurnTo(_) if situation.last_action == Some(action) => {
                object(CritiqueCode::Repeat, "You just turned there; choose another action.".into())
            }
            Action::TurnTo(_) => Ok(()),
            Action::GoToRoom(id) | Action::Stop(Target::Room(id)) if situation.graph.room(*id).is_none() => missing(),
            Action::GoNear(id) | Action::Stop(Target::Object(id)) if situation.graph.object(*id).is_none() => missing(),
            Action::Explore(id) if situation.graph.place(*id).is_none() => missing(),
            Action::GoToRoom(id) => self.check_room(*id, action, situation),
            Action::Explore(id) => self.check_place(*id, action, situation),
            Action::GoNear(id) => self.check_approach(*id, action, situation),
            Action::Stop(Target::Room(id)) => {
                if step.kind != StepKind::GoToRoom {
                    return object(CritiqueCode::TargetMismatch, "This step does not end in a room.".into());
                }
                let known = candidates(situation, &self.grounding);
                let chosen = known.chosen.is_some_and(|choice| choice.target == Target::Room(*id));
                if !chosen && known.room_score(*id).is_none_or(|score| score < self.grounding.accept_relation) {
                    return object(
                        CritiqueCode::RoomFilteredOut,
                        format!("Nothing shows that {id} is the {}.", step.goal),
                    );
                }
                if !is_well_inside(situation, *id) {
                    return object(CritiqueCode::NotThereYet, format!("The robot is not inside {id} yet."));
                }
                Ok(())
            }
            Action::Stop(Target::Object(id)) => self.check_stop(*id, action, situation),
            Action::GiveUp { .. } => {
                let known = candidates(situation, &self.grounding);
                if known.chosen.is_some() {
                    object(CritiqueCode::Premature, "A fitting target is known and reachable.".into())
                } else if known.has_search_left() {
                    object(
                        CritiqueCode::Premature,
                        format!("{} reachable places are left to search.", known.places.len()),
                    )
                } else {
                    Ok(())
                }
            }
        }
    }

    fn check_room(&self, id: RoomId, action: &Action, situation: &Situation) -> Result<(), Critique> {
        let object = |code, message: String| Err(Critique { code, action: Some(action.clone()), message });
        if situation.path_to_room(id).is_none() {
            return object(CritiqueCode::Unreachable, format!("No free way leads to {id} with what is mapped so far."));
        }
        if is_well_inside(situation, id) {
            return object(CritiqueCode::Repeat, format!("The robot is already in {id}."));
        }
        let known = candidates(situation, &self.grounding);
        let is_chosen = known.chosen.is_some_and(|choice| choice.target == Target::Room(id));
        // With a named room found, another room is a detour; before that every room may lead there.
        let found = known
            .rooms
            .first()
            .is_some_and(|best| best.score >= self.grounding.accept_relation && best.path_m.is_some());
        if !is_chosen
            && found
            && known.room_score(id).is_some_and(|score| score < self.grounding.accept_relation)
            && !leads_to_search(&known, id)
        {
            return object(
                CritiqueCode::RoomFilteredOut,
                format!("{id} is not the room the instruction names, and that room is known."),
            );
        }
        Ok(())
    }

    fn check_place(&self, id: PlaceId, action: &Action, situation: &Situation) -> Result<(), Critique> {
        let object = |code, message: String| Err(Critique { code, action: Some(action.clone()), message });
        if !situation.frontiers.contains(&id) && !situation.unseen.contains(&id) {
            return object(
                CritiqueCode::NothingToExplore,
                format!("{id} is neither a frontier nor waiting for a closer look."),
            );
        }
        let reachable = situation.graph.place(id).is_some_and(|place| {
            (situation.path_length)(&place.position).is_some_and(|path_m| path_m.is_finite() && path_m >= 0.0)
        });
        if !reachable {
            return object(CritiqueCode::Unreachable, format!("No free way leads to {id} with what is mapped so far."));
        }
        Ok(())
    }

    /// A thing may be approached if it may be meant, or is an anchor of what is meant.
    fn check_approach(&self, id: ObjectId, action: &Action, situation: &Situation) -> Result<(), Critique> {
        let object = |code, message: String| Err(Critique { code, action: Some(action.clone()), message });
        let Some(step) = situation.step() else {
            return Ok(());
        };
        if situation.path_to_object(id).is_none() {
            return object(CritiqueCode::Unreachable, format!("No free way leads to {id} with what is mapped so far."));
        }
        let known = candidates(situation, &self.grounding);
        if known.chosen.is_some_and(|choice| choice.target == Target::Object(id)) {
            return Ok(());
        }
        let clear = known.chosen.is_some_and(|choice| !choice.is_guess);
        let label = situation.graph.object(id).map(|object| Class::new(&object.label)).unwrap_or_default();
        let mut is_mentioned = false;
        step.goal.visit(&mut |referring| is_mentioned |= class_similarity(&referring.class, &label) >= 0.5);
        let Some(candidate) = known.object(id) else {
            if is_mentioned && !clear {
                return Ok(()); // an anchor: looking there is a sensible search
            }
            return object(CritiqueCode::TargetMismatch, format!("{id} is a {}, not a {}.", label.text, step.goal));
        };
        if candidate.found.room < 0.2 {
            return object(CritiqueCode::RoomFilteredOut, format!("{id} is not in the room the instruction names."));
        }
        if clear && !candidate.is_accepted {
            return object(
                CritiqueCode::TargetMismatch,
                format!("{id} does not fit \"{}\", and another object does.", step.goal),
            );
        }
        Ok(())
    }

    fn check_stop(&self, id: ObjectId, action: &Action, situation: &Situation) -> Result<(), Critique> {
        let object = |code, message: String| Err(Critique { code, action: Some(action.clone()), message });
        let Some(step) = situation.step() else {
            return Ok(());
        };
        if step.kind != StepKind::FindObject {
            return object(CritiqueCode::TargetMismatch, "This step does not end at an object.".into());
        }
        let known = candidates(situation, &self.grounding);
        let is_chosen = known.chosen.is_some_and(|choice| choice.target == Target::Object(id));
        if !is_chosen {
            match known.object(id) {
                None => {
                    return object(CritiqueCode::TargetMismatch, format!("{id} is not a {}.", step.goal.class.text));
                }
                Some(candidate) if candidate.found.room < self.grounding.accept_relation => {
                    return object(
                        CritiqueCode::RoomFilteredOut,
                        format!("{id} is not in the room the instruction names."),
                    );
                }
                Some(candidate) if !candidate.is_accepted => {
                    return object(
                        CritiqueCode::TargetMismatch,
                        format!("{id} does not fit \"{}\" by the relations of the graph.", step.goal),
                    );
                }
                // Another one is chosen: fine only if this one is as good (two mugs on the table).
                Some(candidate) => {
                    let best = known
                        .objects
                        .iter()
                        .filter(|other| other.is_accepted)
                        .map(|other| other.found.total)
                        .fold(0.0, f64::max);
                    if known.chosen.is_none() || candidate.found.total < 0.8 * best {
                        return object(
                            CritiqueCode::TargetMismatch,
                            format!("another object fits \"{}\" better, or the search is not over.", step.goal),
                        );
                    }
                }
            }
        }
        if !(situation.can_stop)(id) {
            return object(
                CritiqueCode::NotThereYet,
                format!(
                    "The robot is not within {:.1} m of {id} in line of sight; go near it first.",
                    situation.stop_distance_m
                ),
            );
        }
        if !crate::symbolic::is_seen_well(situation, id) {
            return object(
                CritiqueCode::NotSureYet,
                format!("The label of {id} is still in doubt; go near it for a closer look."),
            );
        }
        Ok(())
    }
}

/// True if search places lie in the room.
fn leads_to_search(known: &Candidates, id: RoomId) -> bool {
    known.places.iter().any(|place| place.room == Some(id))
}
