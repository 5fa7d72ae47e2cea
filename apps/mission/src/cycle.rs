//! One cycle of the closed loop, in the order of the paper's system figure: perceive, abstract, reason, verify, plan, move.

use nalgebra::{Point2, Point3, Vector3};
use omni_perception::Stamp;

use crate::body::Body;
use crate::goal::{Goal, GoalStatus};
use crate::journal::CurveSample;
use crate::mission::{Mission, Outcome};
use crate::odometer::with_poses;
use crate::stream::{Command, SensorEvent};
use crate::vision_verifier::VisionVerifier;

impl Mission {
    /// What the sensors said since the last cycle, in time order (OmniVLN III-A).
    pub fn perceive(&mut self, events: impl IntoIterator<Item = SensorEvent>) {
        for event in events {
            for event in with_poses(&mut self.odometer, event, &mut self.journal.clock) {
                if let Some(lost) = &mut self.lost {
                    lost.keep(&event, self.config.obstacle_memory_s + 0.4);
                }
                self.world.see(event, &mut self.journal.clock);
            }
        }
    }

    /// One cycle at `now`: what the robot shall do until the next.
    pub fn cycle(&mut self, now: Stamp) -> Command {
        let t_s = self.seconds(now);
        if self.world.odometry.is_none() {
            return self.body.idle();
        }

        // 1. Abstract: surface, distances, places, rooms, relations (III-B), twice a second.
        if t_s >= self.next_refresh_s {
            self.next_refresh_s = t_s + self.config.refresh_period_s;
            self.world.refresh(t_s, &mut self.journal.clock);
            let news = self.world.vision.as_mut().map(VisionVerifier::take_news).unwrap_or_default();
            self.journal.notes.extend(news.into_iter().map(|sentence| (t_s, sentence)));
            self.body.replan(&self.world, &mut self.journal.clock);
            self.refuse_to_stand_in_a_zone();
        }

        // 2. Begin: a first look all round, in a known building until it shows where in it the robot stands, and off the floor.
        //    Nobody who does not know where it is leaves the floor, and who forgets it on the way up comes down again.
        let has_pose = self.has_pose();
        if !has_pose && self.body.is_taking_off() {
            self.body.land();
            let reason = "the odometry lost its way during take-off, so it came down again".into();
            self.finish(Outcome::GaveUp { reason });
        }
        if t_s >= self.config.first_look_s && has_pose {
            self.find_itself(t_s);
            let may_begin = self.outcome.is_none() && !self.is_paused && !self.waits_for_zones();
            if may_begin && let Err(reason) = self.body.begin(&self.world) {
                self.finish(Outcome::GaveUp { reason: reason.into() });
            }
        }

        // 3. Reason (III-C): an answer that is due is verified at the present graph and becomes the goal; a new question
        //    is asked when the last goal is done, has failed, or something that matters was seen. Nobody waits.
        let emergency = self.body.emergency();
        if let Some(emergency) = emergency.filter(|_| self.body.is_down() && self.outcome.is_none()) {
            self.finish(Outcome::GaveUp { reason: emergency.reason().into() });
        }
        let can_think = has_pose
            && !self.is_paused
            && emergency.is_none()
            && !self.is_lost()
            && self.body.is_ready()
            && t_s >= self.config.first_look_s;
        if self.outcome.is_none() && can_think {
            self.remember_start();
            self.wait_for_answer(t_s);
            self.take_answer(t_s);
            if self.outcome.is_none() && self.question.is_some() {
                // It holds until somebody has said which one is meant.
            } else if self.outcome.is_none() && self.is_returning() {
                self.return_to_start(t_s);
            } else if self.outcome.is_none() && !self.is_looking_round(t_s) && self.must_think(t_s) {
                self.ask(t_s);
            }
        }

        // 4. Move: the body follows its goal on certified or checked ways only, and stands while it has lost its way.
        let command = match (&self.outcome, self.is_interrupted) {
            (None, false) if has_pose && !self.is_paused => self.drive(),
            _ => self.hold(),
        };
        self.sample_curves(t_s);
        self.world.frame().command_for_body(command)
    }

    /// Toward the goal, past what the last scans show.
    fn drive(&mut self) -> Command {
        let odometry = self.world.odometry.expect("a cycle without odometry ends before");
        let at = Point3::from(odometry.world_from_body.translation.vector);
        let velocity = velocity_in_body(&odometry);
        let pose = odometry.world_from_body;
        let distance_m = self.world.field.distance(&at);
        let movers = self.world.people.on_the_ground(odometry.stamp);
        let obstacles = match self.body {
            Body::Ground(_) => self.world.obstacles_near(&Point2::new(at.x, at.y)),
            Body::Air(_) => &[],
        };
        let body = &mut self.body;
        let command =
            self.journal.clock.time("control", || body.command(&pose, velocity, obstacles, &movers, distance_m));
        if self.t_moved_s.is_none() && odometry.velocity_in_world_mps.norm() > 0.05 {
            self.t_moved_s = Some(odometry.stamp);
        }
        command
    }

    /// Stands still; an interrupted aerial robot comes down. What a battery demands is done all the same.
    fn hold(&mut self) -> Command {
        if self.is_interrupted {
            self.body.land();
        }
        if *self.body.status() == GoalStatus::Underway {
            self.body.set_goal(Goal::Stay);
        }
        self.drive()
    }

    fn sample_curves(&mut self, t_s: f64) {
        const PERIOD_S: f64 = 0.2;
        if t_s < self.next_sample_s {
            return;
        }
        self.next_sample_s = t_s + PERIOD_S * f64::from(1_u32 << self.journal.thinned.min(16));
        let Some(odometry) = &self.world.odometry else { return };
        let at = odometry.world_from_body.translation.vector;
        let (_, _, yaw_rad) = odometry.world_from_body.rotation.euler_angles();
        let sample = CurveSample {
            t_s,
            pose: [at.x, at.y, at.z, yaw_rad],
            speed_mps: odometry.velocity_in_world_mps.norm(),
            clearance_m: self.body.clearance_m(),
            prompt_tokens: self.journal.prompt_tokens(),
            objects: self.world.graph.confirmed_objects().count(),
            rooms: self.world.graph.rooms().count(),
        };
        self.journal.sample(sample);
    }

    /// Ends the mission.
    pub(crate) fn finish(&mut self, outcome: Outcome) {
        self.body.set_goal(Goal::Stay);
        self.outcome = Some(outcome);
    }
}

/// Forward, left and yaw rate.
fn velocity_in_body(odometry: &omni_perception::OdometryEstimate) -> Vector3<f64> {
    let linear = odometry.world_from_body.rotation.inverse() * odometry.velocity_in_world_mps;
    Vector3::new(linear.x, linear.y, odometry.angular_velocity_in_body_radps.z)
}
