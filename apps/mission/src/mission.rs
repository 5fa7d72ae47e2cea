//! The mission: an instruction, a robot, and everything it knows and has done so far.

use dsg::PlaceId;
use nalgebra::Isometry3;
use octant_prompt::{Critic, GroundingConfig, Instruction, parse_instruction};
use omni_perception::{Equirectangular, OdometryEstimate, Stamp, TrackingStatus};
use robot_model::RobotModel;

use crate::ablation::Part;
use crate::acting::{StepMemory, Target};
use crate::asking::Question;
use crate::body::Body;
use crate::config::MissionConfig;
use crate::error::MissionError;
use crate::journal::Journal;
use crate::link::Link;
use crate::localisation::Lost;
use crate::look_round::LookRound;
use crate::odometer::Odometer;
use crate::reasoning::{Mind, Pending};
use crate::returning::WayHome;
use crate::standstill::Standstill;
use crate::stream::Command;
use crate::world_model::WorldModel;
use crate::zones::ZoneFrame;

/// How a mission ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The robot believes to be there.
    Stopped {
        /// What it decided for, as it would say it.
        target: String,
        /// Where that is in its map.
        at: nalgebra::Point3<f64>,
    },
    /// The robot says why it cannot be done.
    GaveUp {
        /// One sentence.
        reason: String,
    },
}

/// A step of the instruction that the robot says is done.
#[derive(Debug, Clone, PartialEq)]
pub struct StepDone {
    /// Index of the step.
    pub step: usize,
    /// When it said so.
    pub stamp: Stamp,
}

/// How expressions are matched, by reasoner and critic alike.
pub fn grounding(config: &MissionConfig) -> GroundingConfig {
    GroundingConfig { searches_by_steps: config.without.keeps(Part::Steps), ..GroundingConfig::default() }
}

/// One robot carrying out one instruction. Feed it with [`Mission::perceive`], ask it with [`Mission::cycle`].
pub struct Mission {
    pub(crate) config: MissionConfig,
    pub(crate) robot: RobotModel,
    /// What was asked.
    pub instruction: Instruction,
    /// What is known.
    pub world: WorldModel,
    /// Its own odometry, unless somebody else's is in the stream.
    pub(crate) odometer: Option<Odometer>,
    /// What happened.
    pub journal: Journal,
    /// Steps said to be done, in order.
    pub steps_done: Vec<StepDone>,
    /// How it ended, once it has.
    pub outcome: Option<Outcome>,
    pub(crate) body: Body,
    /// `None` while it thinks in another thread.
    pub(crate) reasoner: Option<Mind>,
    pub(crate) critic: Critic,
    /// To a model far away.
    pub(crate) link: Option<Link>,
    pub(crate) pending: Option<Pending>,
    pub(crate) target: Target,
    pub(crate) start: Stamp,
    pub(crate) next_refresh_s: f64,
    pub(crate) looking: LookRound,
    /// It has looked round where it stands.
    pub(crate) has_looked: bool,
    pub(crate) next_sample_s: f64,
    pub(crate) next_decision_s: f64,
    pub(crate) standstill: Standstill,
    pub(crate) t_moved_s: Option<Stamp>,
    pub(crate) is_interrupted: bool,
    pub(crate) is_paused: bool,
    pub(crate) cancelled_s: Option<f64>,
    has_checked_zones: bool,
    pub(crate) interest: Vec<u64>,
    pub(crate) nouns: Vec<octant_prompt::vocabulary::Class>,
    pub(crate) step_index: usize,
    pub(crate) way_home: WayHome,
    /// Whether the present goal is a pose before the object, or only on the way to it.
    pub(crate) stands_before_target: bool,
    /// Since when the robot stands before the thing it went to.
    pub(crate) arrived_s: Option<f64>,
    /// Decisions in a row without an accepted action.
    pub(crate) unsure: u32,
    pub(crate) memory: StepMemory,
    pub(crate) asked_from: nalgebra::Point3<f64>,
    /// Whether somebody answers questions.
    pub(crate) may_ask: bool,
    pub(crate) question: Option<Question>,
    /// Questions about instructions before the present one.
    pub(crate) asked_before: usize,
    /// In a known building, until the robot knows where in it it stands.
    pub(crate) lost: Option<Box<Lost>>,
}

impl Mission {
    /// Prepares a mission. The robot stands on the floor at `world_from_body` in the frame of its odometry at `start`;
    /// `camera` is the panorama that its stream carries.
    ///
    /// # Errors
    /// See [`MissionError`].
    pub fn new(
        robot: &RobotModel,
        instruction: &str,
        mut config: MissionConfig,
        camera: Equirectangular,
        reasoner: Mind,
        start: Stamp,
        world_from_body: &Isometry3<f64>,
    ) -> Result<Mission, MissionError> {
        config.validate()?;
        let instruction = parse_instruction(instruction);
        if instruction.steps.is_empty() {
            return Err(MissionError::EmptyInstruction);
        }
        if config.zones.frame == ZoneFrame::Start {
            config.zones.check_start(&robot.footprint, &Isometry3::identity())?;
            config.zones = config.zones.moved(world_from_body); // from now on in the frame of the odometry
        }
        let odometer = config.odometry.odometer(robot, world_from_body)?;
        let floor_m = world_from_body.translation.vector.z - robot.stance_height_m;
        Ok(Mission {
            world: WorldModel::new(robot, &config, camera, floor_m)?,
            odometer,
            body: Body::new(robot, &config, floor_m)?,
            robot: robot.clone(),
            instruction: instruction.clone(),
            journal: Journal::default(),
            steps_done: Vec::new(),
            outcome: None,
            reasoner: Some(reasoner),
            critic: Critic { is_blind: !config.without.keeps(Part::Critic), grounding: grounding(&config) },
            link: config.link.clone().map(Link::new),
            pending: None,
            target: Target::None,
            start,
            next_refresh_s: 0.0,
            looking: LookRound::default(),
            has_looked: false,
            next_sample_s: 0.0,
            next_decision_s: 0.0,
            standstill: Standstill::default(),
            t_moved_s: None,
            is_interrupted: false,
            is_paused: false,
            cancelled_s: None,
            has_checked_zones: false,
            interest: Vec::new(),
            nouns: instruction.nouns().iter().map(|noun| octant_prompt::vocabulary::Class::new(noun)).collect(),
            step_index: 0,
            way_home: WayHome::default(),
            unsure: 0,
            stands_before_target: false,
            arrived_s: None,
            memory: StepMemory::default(),
            asked_from: nalgebra::Point3::from(world_from_body.translation.vector),
            may_ask: false,
            question: None,
            asked_before: 0,
            lost: None,
            config,
        })
    }

    /// The newest estimate of its own odometry, in the odometry's frame: for a flight controller that has no eyes of its own.
    pub fn odometry(&self) -> Option<&OdometryEstimate> {
        self.odometer.as_ref().and_then(Odometer::newest)
    }

    /// How often its own odometry lost its way and began anew: its poses before and after do not belong together.
    pub fn odometry_resets(&self) -> u64 {
        self.odometer.as_ref().map_or(0, |odometer| odometer.refused.restarts)
    }

    /// What the sensors said that could not be used, and what the vision model was asked, one sentence each; nothing where all was
    /// used and nothing asked.
    pub fn unused(&self) -> Vec<String> {
        let mut sentences = self.odometer.as_ref().map(|odometer| odometer.refused.sentences()).unwrap_or_default();
        sentences.extend(self.world.account());
        sentences
    }

    /// Whether the robot knows where it is in the frame of its odometry.
    pub fn has_pose(&self) -> bool {
        self.world.odometry.is_some_and(|odometry| odometry.status != TrackingStatus::Lost)
    }

    /// Nouns of the instruction: what the segmenter should look for besides its standing list.
    pub fn phrases(&self) -> Vec<String> {
        self.instruction.nouns()
    }

    /// What the segmenter should always look for.
    pub fn standing_phrases(&self) -> &[String] {
        &self.config.standing_phrases
    }

    /// Once the zones lie in the map: who stands in one that it must keep out of does not move.
    pub(crate) fn refuse_to_stand_in_a_zone(&mut self) {
        let (false, Some(odometry), Some(zones)) =
            (self.has_checked_zones, &self.world.odometry, self.world.placed_zones())
        else {
            return;
        };
        self.has_checked_zones = true;
        if let Err(error) = zones.check_start(&self.robot.footprint, &odometry.world_from_body) {
            self.finish(Outcome::GaveUp { reason: error.to_string() });
        }
    }

    /// Frontiers that the robot could still go to, by the rule of reasoner and critic: empty where a search has ended.
    pub fn places_left(&mut self) -> Vec<PlaceId> {
        self.snapshot().map_or_else(Vec::new, |snapshot| snapshot.places_left(&self.critic))
    }

    /// The robot that carries it out.
    pub fn robot(&self) -> &RobotModel {
        &self.robot
    }

    /// Seconds since the mission began.
    pub fn seconds(&self, now: Stamp) -> f64 {
        (now.0 - self.start.0) as f64 * 1e-9
    }

    /// A person wants the robot to stop: it holds, or comes down where it is.
    pub fn interrupt(&mut self) {
        self.is_interrupted = true;
    }

    /// Whether a person stopped it.
    pub fn is_interrupted(&self) -> bool {
        self.is_interrupted
    }

    /// Whether nothing is left to do: an outcome, or stopped by a person and at rest.
    pub fn is_over(&self) -> bool {
        const RESTING_MPS: f64 = 0.05;
        // Who does not know where it is does not know its speed either.
        let rests = || self.world.odometry.is_none_or(|odometry| odometry.velocity_in_world_mps.norm() < RESTING_MPS);
        self.outcome.is_some() || (self.is_interrupted && self.body.is_down() && (!self.has_pose() || rests()))
    }

    /// One line for people: what it is doing now.
    pub fn activity(&self) -> String {
        if let (None, false, Some(question)) = (&self.outcome, self.is_interrupted, &self.question) {
            return question.which.text.clone();
        }
        match &self.outcome {
            Some(Outcome::Stopped { target, .. }) => format!("stopped at {target}"),
            Some(Outcome::GaveUp { reason }) => reason.clone(),
            None if self.is_interrupted => "stopping".into(),
            None if self.is_paused && self.body.emergency().is_none() => "paused".into(),
            None if self.body.emergency().is_some() => "going back or down: the battery is low".into(),
            None if self.is_lost() => "finding out where it is in the known map".into(),
            None if self.world.odometry.is_some() && !self.has_pose() => {
                "standing still: the odometry has lost its way".into()
            }
            None if !self.body.is_ready() => "getting ready".into(),
            None => self.target.describe(&self.world.graph),
        }
    }

    /// Length of the way still to go to the present goal.
    pub fn distance_left_m(&self) -> f64 {
        let steps = self.body.path().windows(2).map(|pair| (pair[1] - pair[0]).norm());
        steps.fold(0.0, |sum, step| sum + step) // an empty sum of floats is -0
    }

    /// What to command before the first cycle: nothing that moves.
    pub fn idle(&mut self) -> Command {
        self.body.idle()
    }

    /// The present path, for pictures.
    pub fn path(&self) -> &[nalgebra::Point2<f64>] {
        self.body.path()
    }
}
