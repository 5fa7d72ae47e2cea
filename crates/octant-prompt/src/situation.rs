//! Everything a decision may look at besides the prompt: the graph, the pose, what the robot tried, and what the planner says.

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point3};

use crate::action::Action;
use crate::critic::{Critique, CritiqueCode};
use crate::instruction::{Instruction, Step};
use crate::octant::point_in_body;

/// The state of a mission at one decision. Borrowed; make it anew for each decision, with [`Situation::new`] for the usual defaults.
#[derive(Clone, Copy)]
pub struct Situation<'a> {
    /// The scene graph, or a snapshot.
    pub graph: &'a SceneGraph,
    /// The robot's pose.
    pub world_from_body: Isometry3<f64>,
    /// The whole instruction.
    pub instruction: &'a Instruction,
    /// Which step is being done; steps before it are done.
    pub step_index: usize,
    /// Height of the camera above the body origin, metres: h_cam of Eq. 9.
    pub camera_height_m: f64,
    /// Length of the way to a point for this robot, metres; None = unreachable as far as the map tells. For an object's centre or a room's
    /// centre the closure is expected to answer for the nearest pose the robot can stand at.
    pub path_length: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
    /// True if the robot, standing where it stands, may declare the object reached: within the stop distance of its box, in line of sight.
    pub can_stop: &'a dyn Fn(ObjectId) -> bool,
    /// Places that border unknown space and are worth driving to; empty when the building is explored.
    pub frontiers: &'a [PlaceId],
    /// What the way to a frontier would show that was not seen yet, in square metres, if somebody counts it; None there: unknown.
    pub gain_m2: Option<&'a dyn Fn(PlaceId) -> Option<f64>>,
    /// Places not yet seen from nearby, where small things may have been missed.
    pub unseen: &'a [PlaceId],
    /// Rooms the robot has been in during this step.
    pub visited: &'a [RoomId],
    /// Objects the robot has arrived at during this step (after `go_near`).
    pub inspected: &'a [ObjectId],
    /// Failures of earlier decisions of this mission: targets of [`CritiqueCode::Unreachable`] and [`CritiqueCode::Failed`] are not tried again.
    pub rejected: &'a [Critique],
    /// Largest distance to the object's box at which the step counts as done, metres. For texts; `can_stop` decides.
    pub stop_distance_m: f64,
    /// Where the robot stood when the instruction was given: the viewer of "left of" and of "nearest".
    pub asked_from: Option<Point3<f64>>,
    /// The action before this one.
    pub last_action: Option<&'a Action>,
    /// Whether there is somebody who can say which of several things is meant.
    pub may_ask: bool,
    /// The thing that somebody said is meant.
    pub meant: Option<ObjectId>,
}

impl<'a> Situation<'a> {
    /// A situation at the first step with nothing visited, nothing rejected and no frontiers; change fields with struct update.
    pub fn new(
        graph: &'a SceneGraph,
        world_from_body: Isometry3<f64>,
        instruction: &'a Instruction,
        path_length: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
        can_stop: &'a dyn Fn(ObjectId) -> bool,
    ) -> Situation<'a> {
        Situation {
            graph,
            world_from_body,
            instruction,
            step_index: 0,
            camera_height_m: 0.42,
            path_length,
            can_stop,
            frontiers: &[],
            gain_m2: None,
            unseen: &[],
            visited: &[],
            inspected: &[],
            rejected: &[],
            stop_distance_m: 1.0,
            asked_from: None,
            last_action: None,
            may_ask: false,
            meant: None,
        }
    }

    /// The present step.
    pub fn step(&self) -> Option<&'a Step> {
        self.instruction.steps.get(self.step_index)
    }

    /// Where the robot is.
    pub fn position(&self) -> Point3<f64> {
        self.world_from_body.translation.vector.into()
    }

    /// From where directions are judged.
    pub fn viewer(&self) -> Point3<f64> {
        self.asked_from.unwrap_or_else(|| self.position())
    }

    /// The room the robot is in.
    pub fn room(&self) -> Option<RoomId> {
        room_of(self.graph, &self.position())
    }

    /// The robot's storey.
    pub fn floor(&self) -> i32 {
        self.room().and_then(|id| self.graph.room(id)).map_or(0, |room| room.floor)
    }

    /// A world point in the body frame (Eq. 8).
    pub fn in_body(&self, point_in_world: &Point3<f64>) -> Point3<f64> {
        point_in_body(&self.world_from_body, point_in_world)
    }

    /// Whether an earlier attempt at exactly this target failed in the world (not merely in an argument).
    pub fn has_failed(&self, action: &Action) -> bool {
        let same = |other: &Action| match (action.object(), other.object()) {
            (Some(a), Some(b)) => a == b,
            _ => action == other,
        };
        self.rejected.iter().any(|critique| {
            matches!(critique.code, CritiqueCode::Unreachable | CritiqueCode::Failed)
                && critique.action.as_ref().is_some_and(same)
        })
    }

    /// Length of the way to the object's box, for choosing among candidates.
    pub fn path_to_object(&self, id: ObjectId) -> Option<f64> {
        (self.path_length)(&self.graph.object(id)?.centroid)
    }

    /// Length of the way to a room: to its centre, else to the nearest of its places.
    pub fn path_to_room(&self, id: RoomId) -> Option<f64> {
        /// Places of a room that are tried when its centre cannot be reached.
        const MAX_PLACES: usize = 64;
        let room = self.graph.room(id)?;
        (self.path_length)(&room.center).or_else(|| {
            let lengths = room
                .places
                .iter()
                .take(MAX_PLACES)
                .filter_map(|place| (self.path_length)(&self.graph.place(*place)?.position));
            lengths.reduce(f64::min)
        })
    }
}

/// The room of a point: by the places of the graph; in a graph whose places know no rooms the room with the nearest centre.
pub fn room_of(graph: &SceneGraph, point: &Point3<f64>) -> Option<RoomId> {
    graph.room_at(point).or_else(|| {
        let nearest = graph
            .rooms()
            .min_by(|a, b| (a.center - point).norm_squared().total_cmp(&(b.center - point).norm_squared()));
        nearest.map(|room| room.id)
    })
}
