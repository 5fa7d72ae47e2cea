//! The way of a robot through a building that it knows, without sensors: what the reasoner would go to, where it would stand, and how it
//! would get there, step by step of an instruction.
//!
//! There is no second planner here. A mission is begun on the saved graph and map, its own decision, stand and way are asked for, and
//! instead of moving it is then thought to stand at the end of that way. What a run in that building does differently it does because its
//! sensors show something else.

use dsg::ObjectId;
use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use octant_prompt::{Action, StepKind, SymbolicReasoner, Target};
use omni_perception::{Equirectangular, Stamp};
use robot_model::RobotModel;
use thiserror::Error;

use crate::acting::{ROOM_TOLERANCE_M, STAND_TOLERANCE_M, StepMemory};
use crate::approach::floor_distance_m;
use crate::archive::Known;
use crate::body::{Body, with_air};
use crate::config::MissionConfig;
use crate::drive::{Drive, DriveConfig};
use crate::error::MissionError;
use crate::goal::{Goal, GoalStatus, wrap};
use crate::mission::Mission;
use crate::odometer::OdometrySource;
use crate::offering::{Offer, Subject};
use crate::reasoning::Mind;
use crate::stage_clock::StageClock;
use crate::stream::Command;

/// A way begins where the robot stands, or at most so far away, out of a place where it has no room to turn.
const ESCAPE_M: f64 = 0.6;
/// Ways are looked at in steps of this length.
const STEP_M: f64 = 0.02;

/// Why there is no plan at all.
#[derive(Debug, Error)]
pub enum RoutePlanError {
    /// The mission cannot begin.
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// Without a start there is no way.
    #[error("the known building has no start pose: where the robot stands has to be given")]
    NoStart,
    /// The robot cannot stand there.
    #[error("at {x:.2}, {y:.2} the robot has no room: {why}; give a pose on free floor of the map")]
    Start {
        /// Of the pose, in the map.
        x: f64,
        /// Of the pose, in the map.
        y: f64,
        /// What stands against it.
        why: &'static str,
    },
}

/// The ways of an instruction's steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RoutePlan {
    /// In order; all steps, or those before the one to which there is no way.
    pub legs: Vec<PlannedLeg>,
    /// Why the next step has none.
    pub why_not: Option<NoRoute>,
}

/// The way of one step.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedLeg {
    /// The step of the instruction, from 0.
    pub step: usize,
    /// What it leads to: `O12`, `R3`; nothing: back to the start.
    pub target: Option<Target>,
    /// Label of the thing, name of the room.
    pub label: String,
    /// Where the body stands in the end, in the map.
    pub stand: Point2<f64>,
    /// Where it faces there; `None` where that does not matter.
    pub heading_rad: Option<f64>,
    /// From there to the box of the thing, along the floor; 0 for rooms.
    pub distance_m: f64,
    /// Whether the map shows nothing between the eye and the thing.
    pub is_visible: bool,
    /// The way, in the map: of the body's middle on the floor, or in the air.
    pub route: Vec<Point3<f64>>,
    /// Its length.
    pub length_m: f64,
    /// The least distance of the body's middle to what is not known to be free, on the way.
    pub min_clearance_m: f64,
    /// How long it takes; `None` where no rehearsal came to its end.
    pub seconds: Option<f64>,
    /// In the air: whether every instant of it was proved. On the ground there is nothing to prove.
    pub is_proved: bool,
}

/// There is no way for this robot.
#[derive(Debug, Clone, PartialEq)]
pub struct NoRoute {
    /// The step of the instruction, from 0.
    pub step: usize,
    /// For people.
    pub sentence: String,
    /// Where it could get instead, and how far from the goal that is; `None` where nobody knows the goal.
    pub nearest: Option<(Point2<f64>, f64)>,
}

/// Plans the ways of `robot` to what `instruction` asks for, from [`Known::start`] in a known building. The mission that was asked is
/// handed back too: it holds the map as this robot meets it.
///
/// # Errors
/// See [`RoutePlanError`]; that there is no way is a value.
pub fn plan_routes(
    robot: &RobotModel,
    known: Known,
    instruction: &str,
    config: &MissionConfig,
) -> Result<(RoutePlan, Mission), RoutePlanError> {
    let start = known.start.ok_or(RoutePlanError::NoStart)?;
    let config = MissionConfig { odometry: OdometrySource::Stream, ..config.clone() };
    let mind = Mind::Embedded(Box::new(SymbolicReasoner::default()));
    let floor_m = known.floor_m;
    let on_floor = Isometry3::from_parts(
        Translation3::new(start.translation.x, start.translation.y, floor_m + robot.stance_height_m),
        start.rotation,
    );
    let mut mission = Mission::new(robot, instruction, config, Equirectangular::default(), mind, Stamp(0), &on_floor)?;
    mission.know(known);
    let begin = on_floor.translation.vector.xy();
    mission.imagine_at(&Point2::from(begin), on_floor.rotation.euler_angles().2);
    mission.world.refresh(0.0, &mut StageClock::default());
    mission.check_start(&Point2::from(begin))?;
    let plan = mission.plan_steps(&Point2::from(begin));
    Ok((plan, mission))
}

impl Mission {
    fn imagine_at(&mut self, at: &Point2<f64>, yaw_rad: f64) {
        let z_m = self.world.floor_m + self.world.body_height_m;
        self.world.imagine_at(Isometry3::from_parts(
            Translation3::new(at.x, at.y, z_m),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
        ));
    }

    fn check_start(&self, at: &Point2<f64>) -> Result<(), RoutePlanError> {
        let navigation = &self.world.navigation;
        let pull_m = navigation.route(at, at).map(|route| route.start_pull_m);
        match pull_m {
            Some(pull_m) if pull_m <= ESCAPE_M => Ok(()),
            _ => Err(RoutePlanError::Start { x: at.x, y: at.y, why: navigation.obstacle_at(at).reason() }),
        }
    }

    /// Step after step from where the one before ended.
    fn plan_steps(&mut self, begin: &Point2<f64>) -> RoutePlan {
        let mut plan = RoutePlan::default();
        while let Some(step) = self.instruction.steps.get(self.step_index) {
            let leg = match step.kind {
                StepKind::ReturnToStart => self.way_back(begin),
                StepKind::FindObject | StepKind::GoToRoom => self.next_leg(),
            };
            match leg {
                Ok(mut leg) => {
                    if plan.legs.is_empty()
                        && let Body::Air(fly) = &self.body
                    {
                        leg.seconds = leg.seconds.and_then(|flight_s| Some(flight_s + fly.climb_s(begin)?));
                    }
                    self.imagine_at(&leg.stand, leg.heading_rad.unwrap_or(0.0));
                    plan.legs.push(leg);
                }
                Err(no_route) => {
                    plan.why_not = Some(no_route);
                    return plan;
                }
            }
            self.step_index += 1;
            self.memory = StepMemory::default();
        }
        plan
    }

    /// What the mission decides where it is thought to stand, and the way there.
    fn next_leg(&mut self) -> Result<PlannedLeg, NoRoute> {
        /// It may turn to look before it goes.
        const DECISIONS: usize = 4;
        let mut said = "no decision was made".to_owned();
        for _ in 0..DECISIONS {
            let Some(snapshot) = self.snapshot() else { break };
            let mut mind = SymbolicReasoner { grounding: self.critic.grounding.clone() };
            let answer = snapshot.decide(&mut mind, &self.critic, &self.config);
            let Some(reply) = answer.record.reply else { break };
            match reply.action {
                Action::GoNear(id) => return self.way_before(id),
                Action::Stop(Target::Object(id)) => return self.way_before(id),
                Action::GoToRoom(id) | Action::Stop(Target::Room(id)) => {
                    let Some(room) = self.world.graph.room(id) else { break };
                    let (center, name) = (room.center.xy(), room.name.clone());
                    let leg = self.leg_to(Some(Target::Room(id)), name, &center, ROOM_TOLERANCE_M, None);
                    return leg.ok_or_else(|| self.no_route(Some(Subject::Room(id)), "no way leads there"));
                }
                Action::TurnTo(octant) => {
                    let Some(odometry) = &self.world.odometry else { break };
                    let yaw_rad = odometry.world_from_body.rotation.euler_angles().2 + octant.heading_rad();
                    let at = Point2::from(odometry.world_from_body.translation.vector.xy());
                    self.imagine_at(&at, wrap(yaw_rad));
                }
                Action::Explore(_) | Action::GiveUp { .. } => {
                    let subject = self.subject(&snapshot);
                    said = match reply.action {
                        Action::GiveUp { reason } => reason,
                        _ => "nothing in the saved map answers to it; a robot would look where it has not been"
                            .to_owned(),
                    };
                    return Err(self.no_route(subject, &said));
                }
            }
        }
        Err(self.no_route(None, &said))
    }

    fn way_before(&self, id: ObjectId) -> Result<PlannedLeg, NoRoute> {
        let refused = || self.no_route(Some(Subject::Object(id)), "the robot finds no place to stand before it");
        let object = self.world.graph.object(id).ok_or_else(refused)?;
        let here = self.here().ok_or_else(refused)?;
        let stand = self.stand_for(id, &here).ok_or_else(refused)?;
        let target = Some(Target::Object(id));
        let leg = self.leg_to(target, object.label.clone(), &stand.at, STAND_TOLERANCE_M, Some(stand.heading_rad));
        let mut leg = leg.ok_or_else(refused)?;
        leg.distance_m = floor_distance_m(&object.bounds, &leg.stand);
        leg.is_visible = stand.is_visible;
        Ok(leg)
    }

    fn way_back(&self, begin: &Point2<f64>) -> Result<PlannedLeg, NoRoute> {
        const TOLERANCE_M: f64 = 0.3;
        let leg = self.leg_to(None, "start".to_owned(), begin, TOLERANCE_M, None);
        leg.ok_or_else(|| self.no_route(None, "no way leads back to the start"))
    }

    /// The way to a place in the plane, and in the air the flights along it.
    fn leg_to(
        &self,
        target: Option<Target>,
        label: String,
        at: &Point2<f64>,
        tolerance_m: f64,
        heading_rad: Option<f64>,
    ) -> Option<PlannedLeg> {
        let here = self.here()?;
        let navigation = &self.world.navigation;
        let mut way = navigation.route_toward(&here, at, tolerance_m)?;
        // Out of a place where there is no room to turn.
        if way.first().is_none_or(|first| (first - here).norm() > 1e-9) {
            way.insert(0, here);
        }
        let stand = *way.last()?;
        let leg = PlannedLeg {
            step: self.step_index,
            target,
            label,
            stand,
            heading_rad,
            distance_m: 0.0,
            is_visible: true,
            route: Vec::new(),
            length_m: 0.0,
            min_clearance_m: 0.0,
            seconds: None,
            is_proved: false,
        };
        Some(match &self.body {
            Body::Ground(_) => {
                let z_m = self.world.floor_m;
                let goal = Goal::Reach { target: *at, tolerance_m, heading_rad };
                PlannedLeg {
                    length_m: way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum(),
                    min_clearance_m: along(&way).map(|p| navigation.clearance_at(&p)).fold(f64::INFINITY, f64::min),
                    seconds: self.rehearse_drive(&here, goal),
                    route: way.iter().map(|p| Point3::new(p.x, p.y, z_m)).collect(),
                    ..leg
                }
            }
            Body::Air(fly) => {
                let route = |from: &Point2<f64>| navigation.route_toward(from, at, tolerance_m);
                let flights = with_air(&self.world, |air| fly.rehearse(&here, at, tolerance_m, &route, air));
                let z_m = self.world.floor_m + self.world.body_height_m;
                let at_height = || along(&way).map(|p| Point3::new(p.x, p.y, z_m)).collect::<Vec<_>>();
                let (route, seconds) = match &flights {
                    Ok(flights) if !flights.is_empty() => {
                        let seconds = flights.iter().map(|plan| plan.trajectory.duration()).sum();
                        (flights.iter().flat_map(|plan| samples(&plan.trajectory)).collect(), Some(seconds))
                    }
                    _ => (at_height(), None),
                };
                let clearance = |p: &Point3<f64>| self.world.field.distance(p).unwrap_or(0.0);
                PlannedLeg {
                    stand: route.last().map_or(stand, |end: &Point3<f64>| end.xy()),
                    length_m: route.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum(),
                    min_clearance_m: route.iter().map(clearance).fold(f64::INFINITY, f64::min),
                    route,
                    seconds,
                    is_proved: seconds.is_some(),
                    ..leg
                }
            }
        })
    }

    /// The time it takes to drive there: the mission's own local policy on a body that does what it is told, with nothing round it but
    /// the map.
    fn rehearse_drive(&self, here: &Point2<f64>, goal: Goal) -> Option<f64> {
        /// What is nearer than that counts.
        const SIGHT_M: f64 = 1.2;
        const MOST_S: f64 = 1200.0;
        let period_s = self.config.control_period_s;
        let config = DriveConfig { period_s, max_attempts: self.config.max_attempts };
        let mut drive = Drive::new(&self.robot, config).ok()?;
        drive.limit_speed(&self.world.zones);
        drive.set_goal(goal);
        let z_m = self.world.floor_m + self.world.body_height_m;
        let mut yaw_rad = self.world.odometry?.world_from_body.rotation.euler_angles().2;
        let (mut at, mut velocity) = (*here, Vector3::zeros());
        let mut obstacles = Vec::new();
        for tick in 0..(MOST_S / period_s) as usize {
            let pose = Isometry3::from_parts(
                Translation3::new(at.x, at.y, z_m),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
            );
            if tick % 25 == 0 {
                drive.replan(&self.world.navigation, &pose);
            }
            if tick % 5 == 0 {
                obstacles = self.world.navigation.barred_near(&at, SIGHT_M);
            }
            match drive.status() {
                GoalStatus::Underway => {}
                GoalStatus::Arrived => return Some(tick as f64 * period_s),
                GoalStatus::Failed(_) => return None,
            }
            let Command::Velocity { forward_mps, left_mps, yaw_rate_radps } =
                drive.command(&pose, velocity, &obstacles, &[])
            else {
                return None;
            };
            velocity = Vector3::new(forward_mps, left_mps, yaw_rate_radps);
            let (sin, cos) = yaw_rad.sin_cos();
            at.x += period_s * (cos * forward_mps - sin * left_mps);
            at.y += period_s * (sin * forward_mps + cos * left_mps);
            yaw_rad = wrap(yaw_rad + period_s * yaw_rate_radps);
        }
        None
    }

    fn here(&self) -> Option<Point2<f64>> {
        self.world.odometry.map(|odometry| odometry.world_from_body.translation.vector.xy().into())
    }

    fn no_route(&self, subject: Option<Subject>, why: &str) -> NoRoute {
        let offer = subject.and_then(|subject| self.offer(subject));
        match offer {
            Some(Offer { sentence, nearest, off_m }) => {
                NoRoute { step: self.step_index, sentence, nearest: Some((nearest, off_m)) }
            }
            None => NoRoute { step: self.step_index, sentence: why.to_owned(), nearest: None },
        }
    }
}

/// Points along a way, its corners among them.
pub fn along(way: &[Point2<f64>]) -> impl Iterator<Item = Point2<f64>> {
    let legs = way.windows(2).flat_map(|pair| {
        let (from, leg) = (pair[0], pair[1] - pair[0]);
        let steps = (leg.norm() / STEP_M).ceil().max(1.0) as usize;
        (0..steps).map(move |k| from + leg * (k as f64 / steps as f64))
    });
    legs.chain(way.last().copied())
}

/// Places of a flight, ten a second.
fn samples(flight: &planner::PolynomialTrajectory) -> Vec<Point3<f64>> {
    const RATE_HZ: f64 = 10.0;
    let duration_s = flight.duration();
    let steps = (duration_s * RATE_HZ).ceil().max(1.0) as usize;
    (0..=steps).map(|k| flight.sample(duration_s * k as f64 / steps as f64).p).collect()
}
