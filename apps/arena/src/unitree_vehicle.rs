//! A Unitree robot in the place of the simulated body: where it says it is, there the simulated sensors are.
//!
//! It stands up before the run begins, and lies down after it. Its own odometry is the truth of the run: where it stands then is the
//! start in the building. The mission does not hear of it: it has its own sensors. A run that falls too far behind the clock is ended.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::{Result, bail};
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::robot_link::unitree::session::Limits;
use mission::robot_link::unitree::{Phase, SessionConfig, Velocity};
use mission::robot_model::{RobotKind, RobotModel};
use mission::stream::Command;
use mission::unitree::{UnitreeConfig, UnitreeError, UnitreeLink};
use nalgebra::Isometry3;
use omni_sim::towed::ToldPose;

use crate::options::UnitreeOptions;
use crate::real_time::RealTime;
use crate::vehicle::{Anchor, Vehicle};

/// A robot must be found within this.
const READY: Duration = Duration::from_secs(10);
/// It stands, or lies, within this.
const STANDING: Duration = Duration::from_secs(25);
/// A body above this share of the model's height stands.
const STANDING_SHARE: f64 = 0.6;

/// The robot, and where the world of its odometry lies in the building.
pub struct UnitreeVehicle {
    link: UnitreeLink,
    anchor: Anchor,
    time: RealTime,
    last: ToldPose,
}

impl UnitreeVehicle {
    /// Has the robot of the command line stand up; it stands at `start` in the building. `None` if none is named.
    ///
    /// # Errors
    /// Why it does not answer, or does not stand.
    pub fn open(
        options: &UnitreeOptions,
        robot: &RobotModel,
        start: &Isometry3<f64>,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<UnitreeVehicle>> {
        let Some(interface) = options.interface.clone() else { return Ok(None) };
        if robot.kind != RobotKind::Ground {
            bail!("--unitree walks, and {} is no walking robot: use omnivln-ground", robot.name);
        }
        let limits = Limits {
            forward_mps: robot.limits.max_speed_mps,
            backward_mps: robot.limits.max_reverse_speed_mps,
            lateral_mps: robot.limits.max_lateral_speed_mps,
            yaw_rate_radps: robot.limits.max_yaw_rate_radps,
        };
        let standing_m = STANDING_SHARE * robot.stance_height_m;
        let session = SessionConfig { limits, standing_m, ..SessionConfig::default() };
        let link = UnitreeLink::open(&UnitreeConfig { interface: interface.clone(), domain: options.domain, session })?;
        link.wait_until_ready(READY, stop)?;
        link.stand_up(STANDING, stop)?;
        let Some(standing) = link.pose_at(link.now_ns()) else {
            return Err(UnitreeError::NoState { interface, bad: 0 }.into());
        };
        Ok(Some(UnitreeVehicle {
            link,
            anchor: Anchor::new(start, &standing.world_from_body),
            time: RealTime::default(),
            last: ToldPose::resting_at(*start),
        }))
    }
}

impl Vehicle for UnitreeVehicle {
    fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose {
        let at_ns = self.time.wait_for(stamp, || self.link.now_ns());
        if let Some(pose) = self.link.pose_at(at_ns) {
            self.last = self.anchor.in_the_building(&pose);
        }
        self.last
    }

    fn obey(&mut self, _: Stamp, command: &Command, _: &Mission) -> Result<()> {
        if let Command::Velocity { forward_mps, left_mps, yaw_rate_radps } = *command {
            self.link.drive(&Velocity { forward_mps, left_mps, yaw_rate_radps });
        }
        if let Some(behind_s) = self.time.hopelessly_behind_s() {
            bail!(
                "the run fell {behind_s:.1} s behind the clock: this machine is too slow or too busy to see where it walks"
            );
        }
        match (self.link.fault(), self.link.phase()) {
            (Some(fault), _) => Err(fault.into()),
            (None, Phase::Walking) => Ok(()),
            (None, phase) => bail!("the robot is not ready to walk any more ({phase:?})"),
        }
    }

    fn rest(&mut self) -> Result<()> {
        Ok(self.link.lie_down(STANDING)?)
    }

    fn deed(&self) -> &'static str {
        "walk"
    }

    fn account(&self) -> String {
        format!("walked by a Unitree robot in real time; {}", self.time.account())
    }
}
