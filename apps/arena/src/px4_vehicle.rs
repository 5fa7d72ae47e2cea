//! A PX4 autopilot in the place of the simulated body: where it says it is, there the simulated sensors are.
//!
//! The run's clock is the wall's. When a step takes longer than its 20 ms the next ones are made up for, with the vehicle's poses
//! of their own times; when the run falls behind by more than 0.2 s, what is lost is lost, and counted. Who loses too much of it in
//! the air sees too little of where the vehicle goes: the flight is ended and the vehicle told to land.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::px4::{Px4Config, Px4Link, VehiclePose};
use mission::robot_link::mavlink::signing::SigningKey;
use mission::robot_link::mavlink::stream::StreamConfig;
use mission::robot_link::mavlink::{Phase, SessionConfig};
use mission::robot_model::{RobotKind, RobotModel};
use mission::stream::Command;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use omni_sim::towed::ToldPose;

use crate::options::Px4Options;

/// What a flight keeps from obstacles for an autopilot's tracking: the model of PX4's cascade is off by 3 cm (RMSE).
pub const TRACKING_MARGIN_M: f64 = 0.05;
/// An autopilot must be ready within this.
const READY: Duration = Duration::from_secs(10);
/// It comes down from flight height within this, slowly.
const LANDING: Duration = Duration::from_secs(60);
/// A run may be this much behind the wall clock and make up for it.
const MAX_BEHIND_NS: i64 = 200_000_000;
/// A run that fell further behind than this was no flight in real time.
const TOO_SLOW_S: f64 = 1.0;
/// So much may be lost at once in the air, and this share of the time for ever.
const MOST_BACKLOG_NS: i64 = 1_000_000_000;
const FORGIVEN_SHARE: i64 = 20;
/// Limits of the streamed set-points over those of the planner, so that a late set-point can be caught up with.
const HEADROOM: f64 = 1.3;

/// The autopilot, and where its local world lies in the building.
pub struct Px4Vehicle {
    link: Px4Link,
    truth_from_local: Isometry3<f64>,
    /// The link's time at the run's zero.
    zero_ns: i64,
    is_begun: bool,
    lost_ns: i64,
    backlog: Backlog,
    /// How often the robot's odometry had begun anew when its set-points were first followed.
    resets: Option<u64>,
    last: ToldPose,
}

impl Px4Vehicle {
    /// Waits for the autopilot of the command line; it stands at `start` in the building. `None` if none is named.
    ///
    /// # Errors
    /// Why it does not answer, or cannot be used.
    pub fn open(
        options: &Px4Options,
        robot: &RobotModel,
        start: &Isometry3<f64>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<Px4Vehicle>> {
        let Some(address) = options.address else { return Ok(None) };
        if robot.kind != RobotKind::Aerial {
            bail!("--px4 flies, and {} is no flying robot: use omnivln-aerial", robot.name);
        }
        let key = options.key.as_deref().map(|file| {
            let text = std::fs::read_to_string(file).with_context(|| format!("reading {}", file.display()))?;
            SigningKey::from_hex(&text).with_context(|| format!("reading the key in {}", file.display()))
        });
        let limits = &robot.limits;
        let stream = StreamConfig {
            max_speed_mps: HEADROOM * limits.max_speed_mps,
            max_accel_mps2: HEADROOM * limits.max_accel_mps2,
            max_yaw_rate_radps: limits.max_yaw_rate_radps,
            ..StreamConfig::default()
        };
        let session = SessionConfig { system_id: options.system_id, stream, ..SessionConfig::default() };
        let link = Px4Link::open(&Px4Config { address, session, key: key.transpose()? })?;
        let standing = link.wait_until_ready(READY, stop)?;
        let yaw = |pose: &Isometry3<f64>| pose.rotation.euler_angles().2;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw(start) - yaw(&standing.world_from_body));
        let shift = start.translation.vector - turn * standing.world_from_body.translation.vector;
        let last = ToldPose::resting_at(*start);
        Ok(Some(Px4Vehicle {
            link,
            truth_from_local: Isometry3::from_parts(shift.into(), turn),
            zero_ns: 0,
            is_begun: false,
            lost_ns: 0,
            backlog: Backlog::default(),
            resets: None,
            last,
        }))
    }

    /// Waits until it is `stamp` on the run's clock, and says where in the building the body is then.
    pub fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose {
        if !self.is_begun {
            (self.is_begun, self.zero_ns) = (true, self.link.now_ns() - stamp.0);
        }
        let ahead_ns = self.zero_ns + stamp.0 - self.link.now_ns();
        if ahead_ns > 0 {
            std::thread::sleep(Duration::from_nanos(ahead_ns.unsigned_abs()));
        }
        let mut lost_ns = 0;
        if -ahead_ns > MAX_BEHIND_NS {
            lost_ns = -ahead_ns;
            self.zero_ns += lost_ns;
            self.lost_ns += lost_ns;
        }
        self.backlog.add(stamp.0, lost_ns);
        if let Some(pose) = self.link.pose_at(self.zero_ns + stamp.0) {
            self.last = self.in_the_building(&pose);
        }
        self.last
    }

    /// Takes the mission's command of a time, and what its odometry believes.
    ///
    /// # Errors
    /// Why the vehicle obeys no more.
    pub fn obey(&mut self, stamp: Stamp, command: &Command, mission: &Mission) -> Result<()> {
        let at_ns = self.zero_ns + stamp.0;
        let odometry = mission.odometry();
        if let Some(odometry) = odometry {
            self.link.tell_odometry(self.zero_ns + odometry.stamp.0, odometry, mission.odometry_resets());
        }
        if let Command::Flight(point) = command {
            self.link.obey(at_ns, point, odometry);
            if point.is_armed && *self.resets.get_or_insert(mission.odometry_resets()) != mission.odometry_resets() {
                bail!("the robot's own odometry lost its way and began anew, so its set-points mean other places");
            }
            if point.is_armed && self.backlog.recent_ns > MOST_BACKLOG_NS {
                let behind_s = self.backlog.recent_ns as f64 * 1e-9;
                bail!(
                    "the run fell {behind_s:.1} s behind the clock: this machine is too slow or too busy to see where it flies"
                );
            }
        }
        match (self.link.fault(), self.link.phase()) {
            (Some(fault), _) => Err(fault.into()),
            (None, Phase::Ended) => bail!("the link to the autopilot ended"),
            (None, _) => Ok(()),
        }
    }

    /// How full its battery is, by its own gauge (1 full, 0 empty), if it says so.
    pub fn charge(&self) -> Option<f64> {
        self.link.charge()
    }

    /// Brings it down and waits until it stands with motors off.
    ///
    /// # Errors
    /// Why that did not happen.
    pub fn land(&mut self) -> Result<()> {
        Ok(self.link.land(LANDING)?)
    }

    /// One sentence with figures for the report.
    pub fn account(&self) -> String {
        let lost_s = self.lost_ns as f64 * 1e-9;
        let verdict = if lost_s > TOO_SLOW_S {
            ": this machine is too slow or too busy for it, and set-points stalled"
        } else {
            ""
        };
        format!("flown by a PX4 autopilot in real time; the run fell behind the clock by {lost_s:.1} s in all{verdict}")
    }

    fn in_the_building(&self, pose: &VehiclePose) -> ToldPose {
        ToldPose {
            world_from_body: self.truth_from_local * pose.world_from_body,
            velocity_world: self.truth_from_local * pose.velocity_in_world_mps,
            angular_velocity_body: pose.angular_velocity_in_body_radps,
        }
    }
}

/// How far a run has fallen behind lately: what was lost, less a share of the time that has passed since.
#[derive(Debug, Clone, Copy, Default)]
struct Backlog {
    recent_ns: i64,
    at_ns: i64,
}

impl Backlog {
    fn add(&mut self, stamp_ns: i64, lost_ns: i64) {
        let passed_ns = (stamp_ns - self.at_ns).max(0);
        self.at_ns = stamp_ns;
        self.recent_ns = (self.recent_ns - passed_ns / FORGIVEN_SHARE).max(0) + lost_ns;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hiccup_now_and_then_is_forgiven_and_a_run_that_falls_behind_for_good_is_not() {
        let after = |period_ns: i64, lost_ns: i64, steps: i64| {
            let mut backlog = Backlog::default();
            (1..=steps).for_each(|k| backlog.add(k * period_ns, lost_ns));
            backlog.recent_ns
        };
        // A quarter of a second lost every ten seconds, for an hour.
        assert!(after(10_000_000_000, 250_000_000, 360) < MOST_BACKLOG_NS);
        // 25 s lost in 235 s: as the overloaded machine did that touched the building.
        assert!(after(2_000_000_000, 215_000_000, 20) > MOST_BACKLOG_NS);
        assert!(after(20_000_000, 1_100_000_000, 1) > MOST_BACKLOG_NS, "at once");
    }
}
