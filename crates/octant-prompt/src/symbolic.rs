//! The embedded reasoner: the paper's hierarchical chain of thought by rules, no model and no training.
//!
//! Room filtering -> orientation -> functional group -> localisation, each with a line of trace in the words a language model would
//! use. The rules of action:
//! 1. a thing (or room) that answers every part of the step is approached, and stopped at once the robot is there, the map still says
//!    so, and the thing was seen well enough;
//! 2. otherwise the robot searches on: frontiers and places not yet looked at closely, by value ([`crate::search`]);
//! 3. otherwise the best guess, if the expression is unproven rather than false;
//! 4. otherwise it gives up and says why. It never gives up while a reachable place is left.

use crate::action::{Action, Target};
use crate::candidates::{Candidates, Choice, candidates, is_well_inside};
use crate::critic::Critique;
use crate::grounding::GroundingConfig;
use crate::instruction::{Step, StepKind};
use crate::names::NameTable;
use crate::octant::octant_of;
use crate::premise;
use crate::prompt::Prompt;
use crate::reasoner::{Reasoner, ReasonerError, ReasoningStep, Reply, TraceStep};
use crate::search::usual_rooms;
use crate::situation::Situation;

/// Decides by rules. Stateless: the same situation gives the same reply.
#[derive(Debug, Clone, Default)]
pub struct SymbolicReasoner {
    /// Thresholds.
    pub grounding: GroundingConfig,
}

impl Reasoner for SymbolicReasoner {
    fn decide(
        &mut self,
        situation: &Situation,
        prompt: &Prompt,
        _critiques: &[Critique],
    ) -> Result<Reply, ReasonerError> {
        self.reply_with(situation, &prompt.names)
    }

    fn name(&self) -> &str {
        "symbolic"
    }
}

impl SymbolicReasoner {
    /// The decision without a prompt, which this reasoner does not read.
    ///
    /// # Errors
    /// [`ReasonerError::NoSuchStep`] when all steps are done.
    pub fn reply(&self, situation: &Situation) -> Result<Reply, ReasonerError> {
        self.reply_with(situation, &NameTable::default())
    }

    /// The same, saying the names of a prompt instead of ids.
    fn reply_with(&self, situation: &Situation, names: &NameTable) -> Result<Reply, ReasonerError> {
        let step = situation.step().ok_or(ReasonerError::NoSuchStep(situation.step_index))?;
        let known = candidates(situation, &self.grounding);
        let action = match known.chosen {
            Some(choice) => approach(situation, &choice),
            None if step.kind == StepKind::ReturnToStart => Action::GiveUp {
                reason: "The way back to the start is the body's own: no map shows where it began.".into(),
            },
            None => match known.places.first() {
                Some(place) => Action::Explore(place.id),
                None => Action::GiveUp { reason: premise::reason_to_give_up(step, situation, &known) },
            },
        };
        let trace = trace(situation, step, &known, &action.text(names), &action);
        let confidence = match (known.chosen, &action) {
            (Some(choice), _) => choice.confidence,
            (None, Action::GiveUp { .. }) => 0.5,
            (None, _) => known.places.first().map_or(0.0, |place| place.likelihood.clamp(0.0, 1.0) * 0.5),
        };
        let text = trace
            .iter()
            .map(|line| format!("{}: {} -> {}\n", line.step.word(), line.input, line.output))
            .chain([action.text(names)])
            .collect();
        Ok(Reply { action, trace, confidence, text, answer_tokens: None })
    }
}

/// Go there, or stop if the robot is there.
fn approach(situation: &Situation, choice: &Choice) -> Action {
    match choice.target {
        Target::Room(id) if is_well_inside(situation, id) => Action::Stop(choice.target),
        Target::Room(id) => Action::GoToRoom(id),
        Target::Object(id) if (situation.can_stop)(id) && is_seen_well(situation, id) => Action::Stop(choice.target),
        Target::Object(id) => Action::GoNear(id),
    }
}

/// A thing seen once or with a doubtful label is looked at from nearby before the robot says "here it is". Seen from nearby, its
/// winning label must be what was asked for, unless nothing else is left to try.
pub(crate) fn is_seen_well(situation: &Situation, id: dsg::ObjectId) -> bool {
    /// Vote margin below which a label may still turn.
    const CLEAR_MARGIN: f64 = 0.25;
    /// Images from several times as long as one error of a segmenter stays.
    const OFTEN: u32 = 24;
    let Some(object) = situation.graph.object(id) else { return false };
    situation.inspected.contains(&id)
        || (object.confirmed && object.label_margin >= CLEAR_MARGIN && object.observations >= OFTEN)
}

/// A thing that was looked at from nearby and whose votes still speak for something else, or for nothing clearly.
pub(crate) fn is_doubtful(situation: &Situation, id: dsg::ObjectId, asked: &crate::vocabulary::Class) -> bool {
    /// Vote margin below which a close look has not settled the label.
    const SETTLED_MARGIN: f64 = 0.15;
    /// Class similarity of synonyms, kinds and general words; look-alikes are below.
    const SAME_KIND: f64 = 0.6;
    situation.inspected.contains(&id)
        && situation.graph.object(id).is_some_and(|object| {
            let label = crate::vocabulary::Class::new(&object.label);
            object.label_margin < SETTLED_MARGIN
                || (!asked.text.is_empty() && crate::vocabulary::class_similarity(asked, &label) < SAME_KIND)
        })
}

/// The four steps in words; `named` is the action with the names of the prompt.
fn trace(situation: &Situation, step: &Step, known: &Candidates, named: &str, action: &Action) -> Vec<TraceStep> {
    let line = |step: ReasoningStep, input: String, output: String| TraceStep { step, input, output };
    vec![
        line(ReasoningStep::RoomFiltering, format!("rooms for \"{}\"", step.goal), rooms_line(situation, known)),
        line(ReasoningStep::Orientation, format!("direction of {named}"), orientation_line(situation, known, action)),
        line(
            ReasoningStep::FunctionalGroup,
            format!(
                "where is a {} usual",
                if step.goal.class.text.is_empty() { step.goal.to_string() } else { step.goal.class.text.clone() }
            ),
            group_line(situation, step, known),
        ),
        line(
            ReasoningStep::Localisation,
            format!("\"{}\" among {} objects", step.goal, known.scene.things.len()),
            localisation_line(situation, known, named),
        ),
    ]
}

fn rooms_line(situation: &Situation, known: &Candidates) -> String {
    let name = |id| situation.graph.room(id).map_or_else(|| format!("{id}"), |room| room.name.clone());
    if known.rooms.is_empty() {
        let reachable = known.scene.rooms.iter().filter(|room| situation.path_to_room(room.id).is_some()).count();
        return format!("no room named; {reachable} of {} rooms reachable", known.scene.rooms.len());
    }
    let list: Vec<String> = known
        .rooms
        .iter()
        .take(3)
        .map(|room| {
            format!("{} {:.2}{}", name(room.id), room.score, if room.path_m.is_none() { " (no way)" } else { "" })
        })
        .collect();
    list.join(", ")
}

fn orientation_line(situation: &Situation, known: &Candidates, action: &Action) -> String {
    let point = match action {
        Action::GoToRoom(id) | Action::Stop(Target::Room(id)) => situation.graph.room(*id).map(|room| room.center),
        Action::GoNear(id) | Action::Stop(Target::Object(id)) => {
            situation.graph.object(*id).map(|object| object.centroid)
        }
        Action::Explore(id) => known.place(*id).map(|place| place.position),
        Action::TurnTo(octant) => return octant.to_string(),
        Action::GiveUp { .. } => None,
    };
    point.map_or_else(
        || "nowhere left to go".to_string(),
        |point| {
            let in_body = situation.in_body(&point);
            format!("{} {:.1} m", octant_of(&in_body, situation.camera_height_m), in_body.coords.norm())
        },
    )
}

fn group_line(situation: &Situation, step: &Step, known: &Candidates) -> String {
    let groups = situation.graph.groups().filter(|group| {
        group.members.iter().any(|member| known.objects.iter().take(3).any(|candidate| candidate.found.id == *member))
    });
    let named: Vec<String> = groups.take(2).map(|group| group.name.clone()).collect();
    let usual = usual_rooms(&step.goal, 3).join(", ");
    match (named.is_empty(), usual.is_empty()) {
        (false, _) => format!("{} (usual in: {usual})", named.join(", ")),
        (true, false) => format!("usual in: {usual}"),
        (true, true) => "nothing is known about where it is usual".to_string(),
    }
}

fn localisation_line(situation: &Situation, known: &Candidates, named: &str) -> String {
    let list: Vec<String> = known
        .objects
        .iter()
        .take(3)
        .map(|candidate| {
            let label = situation.graph.object(candidate.found.id).map_or("", |object| object.label.as_str());
            format!(
                "{} {label} {:.2}{}",
                candidate.found.id,
                candidate.found.total,
                if candidate.is_accepted { "" } else { " (not all parts hold)" }
            )
        })
        .collect();
    let list = if list.is_empty() { "no candidate".to_string() } else { list.join(", ") };
    let guess =
        if known.chosen.is_some_and(|choice| choice.is_guess) { "; nothing left to search, best guess" } else { "" };
    format!("{list}{guess} => {named}")
}
