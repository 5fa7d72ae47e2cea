//! What is known at one moment, owned, so that a reasoner may keep it while the robot goes on; and one decision on it.

use std::collections::BTreeMap;

use dsg::{ObjectId, PlaceId, RoomId, SceneGraph};
use nalgebra::{Isometry3, Point2, Point3};
use octant_prompt::{
    Action, Critic, Critique, DecisionRecord, Estimate, Instruction, Prompt, Reasoner, Situation, SymbolicReasoner,
    build_prompt_for, candidates, decide_with_critic,
};

use crate::acting::Target;
use crate::approach::{floor_distance_m, in_front_of};
use crate::config::MissionConfig;
use crate::gain::gain_m2;
use crate::mission::Mission;
use crate::reach::ReachMap;

/// Something can be reached if the robot can stand within this of it.
const BESIDE_M: f64 = 1.3;
/// ... and, when nothing else is left to search, looked at if it can stand within this of it.
const IN_VIEW_M: f64 = 3.5;

/// Everything a reasoner may look at, owned, as it was when the question was asked.
#[derive(Clone)]
pub struct Snapshot {
    pub(crate) graph: SceneGraph,
    pub(crate) world_from_body: Isometry3<f64>,
    instruction: Instruction,
    step_index: usize,
    camera_height_m: f64,
    reach: ReachMap,
    beside_m: f64,
    stoppable: Vec<ObjectId>,
    frontiers: Vec<PlaceId>,
    /// What the way to each frontier would show.
    gains_m2: BTreeMap<PlaceId, f64>,
    visited: Vec<RoomId>,
    inspected: Vec<ObjectId>,
    rejected: Vec<Critique>,
    stop_distance_m: f64,
    asked_from: Point3<f64>,
    last_action: Option<Action>,
    may_ask: bool,
    meant: Option<ObjectId>,
}

impl Snapshot {
    /// Whether nothing is left to search, by the rule of reasoner and critic.
    pub(crate) fn search_is_over(&self, critic: &Critic) -> bool {
        self.places_left(critic).is_empty()
    }

    /// The reachable places that are left to search, best first.
    pub(crate) fn places_left(&self, critic: &Critic) -> Vec<PlaceId> {
        self.with_situation(|situation| {
            candidates(situation, &critic.grounding).places.iter().map(|place| place.id).collect()
        })
    }

    /// Calls `use_it` with the borrowed form that the prompt crate takes.
    pub(crate) fn with_situation<T>(&self, use_it: impl FnOnce(&Situation) -> T) -> T {
        let path_length = |point: &Point3<f64>| self.reach.length_to(point, self.beside_m);
        let can_stop = |id: ObjectId| self.stoppable.contains(&id);
        let gain_m2 = |id: PlaceId| self.gains_m2.get(&id).copied();
        let situation = Situation {
            step_index: self.step_index,
            camera_height_m: self.camera_height_m,
            frontiers: &self.frontiers,
            gain_m2: Some(&gain_m2),
            visited: &self.visited,
            inspected: &self.inspected,
            rejected: &self.rejected,
            stop_distance_m: self.stop_distance_m,
            asked_from: Some(self.asked_from),
            last_action: self.last_action.as_ref(),
            may_ask: self.may_ask,
            meant: self.meant,
            ..Situation::new(&self.graph, self.world_from_body, &self.instruction, &path_length, &can_stop)
        };
        use_it(&situation)
    }

    /// Prompt, reasoner, critic: one decision on this snapshot.
    pub(crate) fn decide(&self, reasoner: &mut dyn Reasoner, critic: &Critic, config: &MissionConfig) -> Answer {
        self.with_situation(|situation| {
            let prompt_config =
                octant_prompt::PromptConfig { camera_height_m: self.camera_height_m, ..config.prompt.clone() };
            let prompt = build_prompt_for(situation, &prompt_config, &Estimate);
            let record = decide_with_critic(
                reasoner,
                critic,
                situation,
                &prompt,
                config.max_retries,
                &mut SymbolicReasoner { grounding: critic.grounding.clone() },
            );
            Answer { prompt, record }
        })
    }
}

/// A decision and the prompt it answers.
pub struct Answer {
    pub(crate) prompt: Prompt,
    pub(crate) record: DecisionRecord,
}

impl Mission {
    /// What is known now, in the form that a reasoner may keep.
    pub(crate) fn snapshot(&mut self) -> Option<Snapshot> {
        let odometry = self.world.odometry?;
        let here = Point2::from(odometry.world_from_body.translation.vector.xy());
        self.remember_room(&odometry.world_from_body);
        let now_s = self.seconds(odometry.stamp);
        let meant = self.meant();
        let reach = self.reach_from(&here);
        let graph = self.world.graph.snapshot();
        let eye_m = self.world.floor_m + self.world.camera_height_m();
        let eye = Point3::new(here.x, here.y, eye_m);
        const BEST_EFFORT_M: f64 = 1.35;
        let my_room = graph.room_at(&Point3::from(odometry.world_from_body.translation.vector));
        let stoppable = graph
            .objects()
            .filter(|object| {
                let distance_m = floor_distance_m(&object.bounds, &here);
                let has_arrived = self.memory.inspected.contains(&object.id);
                let is_visible =
                    || self.world.is_clear(&eye, &in_front_of(&eye, &object.bounds.center(), &object.bounds));
                // Behind clutter in the same room is as good as visible, behind a wall is not.
                let is_in_my_room = || object.room.is_some() && object.room == my_room;
                let limit_m = if has_arrived { BEST_EFFORT_M } else { self.config.stop_distance_m };
                distance_m <= limit_m && (is_visible() || (has_arrived && is_in_my_room()))
            })
            .map(|object| object.id)
            .collect();
        let frontiers = graph.frontiers().map(|place| place.id).collect();
        let beside_m = if self.memory.reprieves == 0 { BESIDE_M } else { IN_VIEW_M };
        let gains_m2 = self.journal.clock.time("gain", || {
            let world = &self.world;
            let gain = |place: &dsg::Place| {
                gain_m2(&reach.way_to(&place.position.xy(), beside_m), &world.slice, &world.coverage)
            };
            graph.frontiers().map(|place| (place.id, gain(place))).collect()
        });
        Some(Snapshot {
            world_from_body: odometry.world_from_body,
            instruction: self.instruction.clone(),
            step_index: self.step_index,
            // One height for every robot, or two robots at one pose would split the same room differently.
            camera_height_m: self.config.prompt.camera_height_m,
            reach,
            beside_m,
            stoppable,
            frontiers,
            gains_m2,
            visited: self.memory.visited.clone(),
            inspected: self.memory.inspected.clone(),
            rejected: self
                .memory
                .rejected
                .iter()
                .filter(|failure| failure.until_s > now_s)
                .map(|failure| failure.critique.clone())
                .collect(),
            stop_distance_m: self.config.stop_distance_m,
            asked_from: self.asked_from,
            last_action: match &self.target {
                Target::Action(action) => Some(action.clone()),
                Target::None | Target::Start => None,
            },
            may_ask: self.may_ask && !self.memory.any_will_do,
            meant,
            graph,
        })
    }

    pub(crate) fn reach_from(&self, here: &Point2<f64>) -> ReachMap {
        let navigation = &self.world.navigation;
        ReachMap::new(&navigation.grid, here, navigation.clearance_m(), &navigation.gates())
    }

    fn remember_room(&mut self, world_from_body: &Isometry3<f64>) {
        let at = Point3::from(world_from_body.translation.vector);
        if let Some(room) = self.world.graph.room_at(&at)
            && !self.memory.visited.contains(&room)
        {
            self.memory.visited.push(room);
        }
    }
}
