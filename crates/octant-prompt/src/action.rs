//! The five actions of the grammar, and giving up.

use std::fmt;

use dsg::{ObjectId, PlaceId, RoomId};

use crate::names::{NameTable, Named};
use crate::octant::Octant;

/// What the robot is to do next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// Drive into a room.
    GoToRoom(RoomId),
    /// Turn towards the middle of an octant.
    TurnTo(Octant),
    /// Drive to a pose from which the object can be stopped at.
    GoNear(ObjectId),
    /// Drive to a frontier place, or to a place from which things were not yet seen closely.
    Explore(PlaceId),
    /// Declare the present step done.
    Stop(Target),
    /// Declare that the step cannot be done, with a sentence for people.
    GiveUp {
        /// Why.
        reason: String,
    },
}

/// What a step is done at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Target {
    /// Beside an object.
    Object(ObjectId),
    /// Inside a room.
    Room(RoomId),
}

impl Action {
    /// The verb of the grammar.
    pub fn verb(&self) -> &'static str {
        match self {
            Action::GoToRoom(_) => "go_to_room",
            Action::TurnTo(_) => "turn_to",
            Action::GoNear(_) => "go_near",
            Action::Explore(_) => "explore",
            Action::Stop(_) => "stop",
            Action::GiveUp { .. } => "give_up",
        }
    }

    /// The object the action is about.
    pub fn object(&self) -> Option<ObjectId> {
        match self {
            Action::GoNear(id) | Action::Stop(Target::Object(id)) => Some(*id),
            _ => None,
        }
    }

    /// The action in the grammar of the prompt, with the prompt's names: `go_near(chair1)`. What has no name there is printed by id.
    pub fn text(&self, names: &NameTable) -> String {
        let name = |named: Named, id: String| names.name_of(named).map_or(id, str::to_string);
        let argument = match self {
            Action::GoToRoom(id) | Action::Stop(Target::Room(id)) => name(Named::Room(*id), id.to_string()),
            Action::TurnTo(octant) => octant.to_string(),
            Action::GoNear(id) | Action::Stop(Target::Object(id)) => name(Named::Object(*id), id.to_string()),
            Action::Explore(id) => name(Named::Place(*id), id.to_string()),
            Action::GiveUp { reason } => reason.clone(),
        };
        format!("{}({argument})", self.verb())
    }
}

impl fmt::Display for Action {
    /// By ids: `go_near(O12)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Action::GoToRoom(id) => write!(f, "go_to_room({id})"),
            Action::TurnTo(octant) => write!(f, "turn_to({octant})"),
            Action::GoNear(id) => write!(f, "go_near({id})"),
            Action::Explore(id) => write!(f, "explore({id})"),
            Action::Stop(Target::Object(id)) => write!(f, "stop({id})"),
            Action::Stop(Target::Room(id)) => write!(f, "stop({id})"),
            Action::GiveUp { reason } => write!(f, "give_up({reason})"),
        }
    }
}
