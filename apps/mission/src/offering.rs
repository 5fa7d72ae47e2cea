//! Where the robot cannot go it says why, and the nearest place where it can.

use dsg::{ObjectId, RoomId};
use nalgebra::{Point2, Point3};
use octant_prompt::{Action, StepKind, candidates};
use volumetric_map::Cell;

use crate::mission::Mission;
use crate::navigation::NavigationMap;
use crate::snapshot::Snapshot;

/// What the goal of a step is, as far as it was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    Object(ObjectId),
    Room(RoomId),
}

/// The nearest place to a goal that cannot be reached.
#[derive(Debug, Clone, PartialEq)]
pub struct Offer {
    /// What the robot says.
    pub sentence: String,
    /// The reachable place, in the map.
    pub nearest: Point2<f64>,
    /// How far from the goal it is.
    pub off_m: f64,
}

/// Why there is no way to a place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Obstacle {
    /// In a zone of this name.
    KeepOut(String),
    /// Beyond everything that was seen.
    Outside,
    /// Nobody has seen the floor there.
    Unseen,
    /// Something stands there, or so near that the robot has no room.
    NoRoom,
    /// There is room, and nothing that is known leads there.
    Apart,
}

impl Obstacle {
    /// What is said of the place, after its name.
    fn clause(&self) -> String {
        match self {
            Obstacle::KeepOut(name) => format!("lies in the keep-out zone \"{name}\""),
            Obstacle::Outside => "lies outside of what I have seen".into(),
            Obstacle::Unseen => "lies where I have not seen the floor".into(),
            Obstacle::NoRoom => "stands where I have no room".into(),
            Obstacle::Apart => "is cut off from here in all that I have seen".into(),
        }
    }

    /// Why a body failed to get there.
    pub fn reason(&self) -> &'static str {
        match self {
            Obstacle::KeepOut(_) => "it lies in a zone to keep out of",
            Obstacle::Outside => "it lies outside of what is known",
            Obstacle::Unseen => "the floor there was not seen",
            Obstacle::NoRoom => "there is no room for it there",
            Obstacle::Apart => "no way through what is known",
        }
    }
}

impl NavigationMap {
    /// Why the robot cannot stand at a place, if there is no way to it.
    pub fn obstacle_at(&self, place: &Point2<f64>) -> Obstacle {
        if let Some(keep_out) = self.zones.keep_out_at(place) {
            return Obstacle::KeepOut(keep_out.name.clone());
        }
        let Some((ix, iy)) = self.grid.cell_of(place) else { return Obstacle::Outside };
        match self.grid.get(ix, iy) {
            Cell::Unknown => Obstacle::Unseen,
            Cell::Occupied => Obstacle::NoRoom,
            Cell::Free if self.clearance_at(place) < self.clearance_m() => Obstacle::NoRoom,
            Cell::Free => Obstacle::Apart,
        }
    }
}

impl Mission {
    /// Why it gives up, and, where the goal is known and cannot be reached, what stands against it and how near it could get.
    pub(crate) fn with_offer(&mut self, reason: &str) -> String {
        let Some(snapshot) = self.snapshot() else { return reason.to_owned() };
        if let Some(offer) = self.subject(&snapshot).and_then(|subject| self.offer(subject)) {
            return offer.sentence;
        }
        match self.closed_search() {
            Some(closed) => format!("{reason} {closed}"),
            None => reason.to_owned(),
        }
    }

    /// The known goal that the robot cannot get to: by the rule of reasoner and critic, or because it tried.
    pub(crate) fn subject(&self, snapshot: &Snapshot) -> Option<Subject> {
        let step = self.instruction.steps.get(self.step_index)?;
        let known = snapshot.with_situation(|situation| candidates(situation, &self.critic.grounding));
        if step.kind == StepKind::GoToRoom {
            let room = known.rooms.iter().find(|room| room.score >= self.critic.grounding.accept_relation)?;
            return room.path_m.is_none().then_some(Subject::Room(room.id));
        }
        let out_of_reach = known.objects.iter().find(|object| object.is_accepted && object.path_m.is_none());
        let tried = self.memory.rejected.iter().rev().find_map(|failure| match failure.critique.action {
            Some(Action::GoNear(id)) => self.world.graph.object(id).map(|object| object.id),
            _ => None,
        });
        out_of_reach.map(|object| object.found.id).or(tried).map(Subject::Object)
    }

    pub(crate) fn offer(&self, subject: Subject) -> Option<Offer> {
        let (name, at) = match subject {
            Subject::Object(id) => self.world.graph.object(id).map(|object| (object.label.clone(), object.centroid)),
            Subject::Room(id) => self.world.graph.room(id).map(|room| (room.name.clone(), room.center)),
        }?;
        let here = Point2::from(self.world.odometry?.world_from_body.translation.vector.xy());
        let navigation = &self.world.navigation;
        let (nearest, off_m) = navigation.nearest_reachable(&here, &at.xy())?;
        let obstacle = navigation.obstacle_at(&at.xy());
        let room = self.world.graph.room_at(&Point3::new(nearest.x, nearest.y, at.z));
        let room = room
            .and_then(|id| self.world.graph.room(id))
            .map_or(String::new(), |room| format!(", in the {}", room.name));
        let sentence = format!(
            "I know where the {name} is, but cannot get there: it {}. The nearest place that I can reach is {off_m:.1} m from it, at {:.1}, {:.1}{room}.",
            obstacle.clause(),
            nearest.x,
            nearest.y
        );
        Some(Offer { sentence, nearest, off_m })
    }

    /// A search that left a zone out says so.
    fn closed_search(&self) -> Option<String> {
        let zones = &self.world.zones;
        let closed = self.world.graph.frontiers().find_map(|place| zones.keep_out_at(&place.position.xy()))?;
        Some(format!("What lies in the keep-out zone \"{}\" I did not look at from nearby.", closed.name))
    }
}
