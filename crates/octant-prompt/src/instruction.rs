//! What an instruction asks for, as plain data: steps, each a referring expression with nested relations.
//!
//! `find the red mug on the table next to the window` is one step whose goal is
//! `mug {red, on: table {next to: window}}`. [`crate::parser`] makes these from text; [`crate::grounding`] scores things against them.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::vocabulary::Class;

/// A parsed instruction. Never fails to exist: text that names nothing has no steps.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Instruction {
    /// The text as given (bounded by the parser).
    pub text: String,
    /// Steps to be done in this order.
    pub steps: Vec<Step>,
    /// Words that nobody knows and what they were taken for.
    #[serde(default)]
    pub readings: Vec<Reading>,
}

impl Instruction {
    /// Every object class the instruction mentions, targets and anchors of all steps, normalised, in order of first mention: what an
    /// open-vocabulary segmenter should be asked for.
    pub fn nouns(&self) -> Vec<String> {
        let mut nouns = Vec::new();
        for step in &self.steps {
            step.goal.visit(&mut |referring| {
                if !referring.class.text.is_empty()
                    && !referring.class.is_wildcard()
                    && !nouns.contains(&referring.class.text)
                {
                    nouns.push(referring.class.text.clone());
                    for other in referring.class.said.iter().chain(&referring.class.also) {
                        if !nouns.contains(other) {
                            nouns.push(other.clone());
                        }
                    }
                }
            });
        }
        nouns
    }
}

impl Instruction {
    /// The rooms that the targets of all steps name.
    pub fn rooms(&self) -> Vec<RoomReference> {
        let named = self.steps.iter().filter_map(|step| step.goal.room.clone());
        named.filter(|room| !room.name.is_empty()).collect()
    }
}

/// A word and what it was taken for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// As it was written, normalised.
    pub said: String,
    /// The word of the vocabulary.
    pub meant: String,
    /// How sure, in (0, 1): one less the share of the word that had to be changed.
    pub confidence: f64,
}

/// One step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// What ends the step.
    pub kind: StepKind,
    /// The thing or, for [`StepKind::GoToRoom`], the room (`goal.room`; its class is then empty).
    pub goal: Referring,
}

/// Kinds of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum StepKind {
    /// Find an object and stop beside it ("find", "go to", "bring me to", ... with a thing).
    FindObject,
    /// Be inside a room.
    GoToRoom,
    /// Be back where the robot was when it began ("come back to where you started"); the goal names nothing. The body knows the
    /// place, the graph does not: no reasoner is asked.
    ReturnToStart,
}

/// A referring expression: which thing is meant.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Referring {
    /// The class asked for; a wildcard ("thing") or empty when only a room is meant.
    pub class: Class,
    /// Colours, materials, sizes and other adjectives.
    pub attributes: Vec<Attribute>,
    /// Relations to other things; all must hold.
    pub relations: Vec<RelationClause>,
    /// The room it must be in.
    pub room: Option<RoomReference>,
    /// Rooms it must not be in.
    pub excluded_rooms: Vec<RoomReference>,
    /// Storey.
    pub floor: Option<Floor>,
    /// Extremes among the candidates ("largest", "leftmost", "nearest"), in the order said.
    pub superlatives: Vec<Superlative>,
    /// 1-based rank in the order of the first superlative, or from near to far ("second from the left"); `u32::MAX` is "last".
    pub ordinal: Option<u32>,
    /// From where left, right, front and behind are seen, if the text says so.
    pub view: Option<Box<View>>,
    /// The things among which it is one: "of the 5 chairs closest to the door, ...".
    #[serde(default)]
    pub among: Option<Box<Among>>,
    /// "a", "any", "one of the": whichever will do. "The" says that there is one only.
    #[serde(default)]
    pub is_any: bool,
}

/// Some things that are set apart before one of them is meant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Among {
    /// How many they are.
    pub count: u32,
    /// What they answer to; of more than that, those who answer best.
    pub goal: Referring,
}

impl Referring {
    /// Whether the words themselves pick one of several: an extreme, an order, a size.
    pub fn picks_one(&self) -> bool {
        let by_distance = |relation| matches!(relation, SpatialRelation::Closest | SpatialRelation::Farthest);
        self.ordinal.is_some()
            || self.among.is_some()
            || !self.superlatives.is_empty()
            || self.attributes.iter().any(|attribute| matches!(attribute.kind, AttributeKind::Size(_)))
            || self.relations.iter().any(|clause| by_distance(clause.relation))
    }

    /// "the mug", and nothing else is said of it: whoever speaks like that takes it for the only one.
    pub fn is_bare(&self) -> bool {
        let says_nothing_else = self.attributes.is_empty() && self.relations.is_empty() && self.room.is_none();
        says_nothing_else && self.excluded_rooms.is_empty() && self.floor.is_none() && !self.picks_one()
    }
    /// The clause by which an ordinal counts ("the second chair from the window"), by position; None if it counts by a superlative.
    pub fn ordinal_clause(&self) -> Option<usize> {
        let by_distance = |clause: &RelationClause| {
            !clause.negated && matches!(clause.relation, SpatialRelation::Closest | SpatialRelation::Farthest)
        };
        let counts = self.ordinal.is_some() && self.superlatives.is_empty();
        counts.then(|| self.relations.iter().position(by_distance)).flatten()
    }

    /// Calls `visit` for this expression and every nested one, outer first.
    pub fn visit<'a>(&'a self, visit: &mut impl FnMut(&'a Referring)) {
        visit(self);
        for anchor in self.relations.iter().flat_map(|relation| &relation.anchors) {
            anchor.visit(visit);
        }
        for room in self.room.iter().chain(&self.excluded_rooms) {
            for content in &room.contains {
                content.visit(visit);
            }
        }
        if let Some(view) = &self.view {
            view.anchor.visit(visit);
        }
        if let Some(among) = &self.among {
            among.goal.visit(visit);
        }
    }
}

impl fmt::Display for Referring {
    /// The expression in plain words, for traces and reasons: `red mug near (sink) in the kitchen`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut words: Vec<String> =
            self.superlatives.iter().map(|superlative| superlative.word().to_string()).collect();
        let said = |attribute: &Attribute| {
            let purpose = if attribute.kind == AttributeKind::Function { "used for " } else { "" };
            format!("{}{purpose}{}", if attribute.negated { "not " } else { "" }, attribute.word)
        };
        let (purposes, adjectives): (Vec<&Attribute>, Vec<&Attribute>) =
            self.attributes.iter().partition(|attribute| attribute.kind == AttributeKind::Function);
        words.extend(adjectives.into_iter().map(said));
        if !self.class.text.is_empty() {
            words.push(self.class.text.clone());
        }
        words.extend(purposes.into_iter().map(said));
        for clause in &self.relations {
            let anchors: Vec<String> = clause
                .anchors
                .iter()
                .map(|anchor| if anchor.relations.is_empty() { anchor.to_string() } else { format!("({anchor})") })
                .collect();
            words.push(format!(
                "{}{} {}",
                if clause.negated { "not " } else { "" },
                clause.relation.word(),
                anchors.join(" and ")
            ));
        }
        words.extend(
            self.room.iter().map(
                |room| {
                    if self.class.text.is_empty() { room.to_string() } else { format!("in the {room}") }
                },
            ),
        );
        words.extend(self.excluded_rooms.iter().map(|room| format!("not in the {room}")));
        words.extend(self.among.iter().map(|among| format!("(of the {} {})", among.count, among.goal)));
        f.write_str(&words.join(" "))
    }
}

/// A property of one thing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Attribute {
    /// What kind of word it is.
    pub kind: AttributeKind,
    /// The word, normalised; a material in its canonical form (`wooden` is `wood`).
    pub word: String,
    /// "not red".
    pub negated: bool,
}

/// Kinds of adjectives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AttributeKind {
    /// A colour of [`crate::vocabulary::color_rgb`].
    Color,
    /// A material of [`crate::vocabulary::material`].
    Material,
    /// What it is for ("used for sitting at a desk"): the words of the purpose.
    Function,
    /// A size word ("large"): compared with the other candidates.
    Size(Superlative),
    /// Any other word: looked up in caption and attributes.
    Other,
}

/// A relation between the thing and its anchors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RelationClause {
    /// What must hold.
    pub relation: SpatialRelation,
    /// The things it is relative to: two for [`SpatialRelation::Between`] (or one plural class), else one.
    pub anchors: Vec<Referring>,
    /// "not near the sink".
    pub negated: bool,
}

/// Spatial relations of the grammar. The subject is the thing referred to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum SpatialRelation {
    /// Near, next to, beside, by.
    Near,
    /// Far from.
    Far,
    /// Closest to: the candidate with the least gap.
    Closest,
    /// Farthest from.
    Farthest,
    /// Resting on.
    On,
    /// Below, underneath.
    Under,
    /// Over, higher, above the footprint.
    Above,
    /// In a container.
    Inside,
    /// "table with a mug on it".
    Supporting,
    /// "shelf with books in it".
    Containing,
    /// "desk with a monitor": on, in or near it.
    With,
    /// To the left, seen by the viewer.
    LeftOf,
    /// To the right, seen by the viewer.
    RightOf,
    /// Between viewer and anchor, or at the anchor's front.
    InFrontOf,
    /// Behind the anchor.
    Behind,
    /// Between two anchors.
    Between,
    /// Across from, facing.
    Opposite,
    /// In the functional group round the anchor ("in the dining table group").
    InGroup,
    /// At one of the short sides ("at the end of the table").
    AtEnd,
}

impl SpatialRelation {
    /// The word in traces and tools.
    pub fn word(self) -> &'static str {
        match self {
            SpatialRelation::Near => "near",
            SpatialRelation::Far => "far from",
            SpatialRelation::Closest => "closest to",
            SpatialRelation::Farthest => "farthest from",
            SpatialRelation::On => "on",
            SpatialRelation::Under => "under",
            SpatialRelation::Above => "above",
            SpatialRelation::Inside => "in",
            SpatialRelation::Supporting => "supporting",
            SpatialRelation::Containing => "containing",
            SpatialRelation::With => "with",
            SpatialRelation::LeftOf => "left of",
            SpatialRelation::RightOf => "right of",
            SpatialRelation::InFrontOf => "in front of",
            SpatialRelation::Behind => "behind",
            SpatialRelation::Between => "between",
            SpatialRelation::Opposite => "opposite",
            SpatialRelation::InGroup => "in the group of",
            SpatialRelation::AtEnd => "at the end of",
        }
    }
}

/// Extremes among candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[allow(missing_docs)] // the names say it
pub enum Superlative {
    Nearest,
    Farthest,
    Largest,
    Smallest,
    Tallest,
    Shortest,
    Longest,
    Widest,
    Narrowest,
    Highest,
    Lowest,
    Leftmost,
    Rightmost,
    Frontmost,
    Backmost,
    Middle,
    Corner,
    Alone,
}

impl Superlative {
    /// The word in traces.
    pub fn word(self) -> &'static str {
        match self {
            Superlative::Nearest => "nearest",
            Superlative::Farthest => "farthest",
            Superlative::Largest => "largest",
            Superlative::Smallest => "smallest",
            Superlative::Tallest => "tallest",
            Superlative::Shortest => "shortest",
            Superlative::Longest => "longest",
            Superlative::Widest => "widest",
            Superlative::Narrowest => "narrowest",
            Superlative::Highest => "highest",
            Superlative::Lowest => "lowest",
            Superlative::Leftmost => "leftmost",
            Superlative::Rightmost => "rightmost",
            Superlative::Frontmost => "frontmost",
            Superlative::Backmost => "backmost",
            Superlative::Middle => "in the middle",
            Superlative::Corner => "in the corner",
            Superlative::Alone => "alone",
        }
    }
}

/// A room as the instruction names it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RoomReference {
    /// The phrase, normalised: `conference room`, `room 3`; empty for "the room with ...".
    pub name: String,
    /// The kind of [`crate::vocabulary::room_kind`], if the phrase names one.
    pub kind: Option<String>,
    /// Things it must contain ("the room with the piano").
    pub contains: Vec<Referring>,
}

impl RoomReference {
    /// Whether a room of the graph may be the one meant, by its name or its kind.
    pub fn is_answered_by(&self, room: &dsg::Room) -> bool {
        if self.name.is_empty() {
            return false;
        }
        let name = crate::vocabulary::normalise(&room.name);
        let kind = || {
            room.kind.as_deref().and_then(crate::vocabulary::room_kind).or_else(|| crate::vocabulary::room_kind(&name))
        };
        name == self.name || self.kind.as_deref().is_some_and(|wanted| kind() == Some(wanted))
    }
}

impl fmt::Display for RoomReference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.name.is_empty() { "room" } else { &self.name })?;
        for content in &self.contains {
            write!(f, " with {content}")?;
        }
        Ok(())
    }
}

/// Storeys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Floor {
    /// Counted from 0 = the ground floor ("first floor" is 0, as in American English).
    Number(i32),
    /// "upstairs" (+1) or "downstairs" (-1), relative to the robot's storey.
    Relative(i32),
}

/// Where the viewer of an expression stands or looks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// How the viewer relates to `anchor`.
    pub kind: ViewKind,
    /// The thing looked at, turned away from, or stood at.
    pub anchor: Referring,
}

/// Kinds of view clauses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ViewKind {
    /// "facing the window", "looking at the window".
    Facing,
    /// "with your back to the window".
    BackTo,
    /// "standing at the door", "when you enter (by the door)": looks from there into the room.
    From,
}
