//! A PX4 autopilot in the place of the simulated body: where it says it is, there the simulated sensors are.
//!
//! The run's clock is the wall's ([`RealTime`]); steps that are made up for take the vehicle's poses of their own times. A run that
//! falls too far behind in the air sees too little of where the vehicle goes: the flight is ended and the vehicle told to land.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::px4::{Px4Config, Px4Link};
use mission::robot_link::mavlink::signing::SigningKey;
use mission::robot_link::mavlink::stream::StreamConfig;
use mission::robot_link::mavlink::{Phase, SessionConfig};
use mission::robot_model::{RobotKind, RobotModel};
use mission::stream::Command;
use nalgebra::Isometry3;
use omni_sim::towed::ToldPose;

use crate::options::Px4Options;
use crate::real_time::RealTime;
use crate::vehicle::{Anchor, Vehicle};

/// What a flight keeps from obstacles for an autopilot's tracking: the model of PX4's cascade is off by 3 cm (RMSE).
pub const TRACKING_MARGIN_M: f64 = 0.05;
/// An autopilot must be ready within this.
const READY: Duration = Duration::from_secs(10);
/// It comes down from flight height within this, slowly.
const LANDING: Duration = Duration::from_secs(60);
/// Odometry and autopilot may put the body so far apart before nobody knows what its set-points mean (m): more than an estimator smooths or a
/// report is late by, less than a flight keeps from walls.
const MOST_APART_M: f64 = 0.3;
/// Limits of the streamed set-points over those of the planner, so that a late set-point can be caught up with.
const HEADROOM: f64 = 1.3;

/// The autopilot, and where its local world lies in the building.
pub struct Px4Vehicle {
    link: Px4Link,
    anchor: Anchor,
    time: RealTime,
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
        let last = ToldPose::resting_at(*start);
        Ok(Some(Px4Vehicle {
            link,
            anchor: Anchor::new(start, &standing.world_from_body),
            time: RealTime::default(),
            resets: None,
            last,
        }))
    }
}

impl Vehicle for Px4Vehicle {
    fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose {
        let at_ns = self.time.wait_for(stamp, || self.link.now_ns());
        if let Some(pose) = self.link.pose_at(at_ns) {
            self.last = self.anchor.in_the_building(&pose);
        }
        self.last
    }

    fn obey(&mut self, stamp: Stamp, command: &Command, mission: &Mission) -> Result<()> {
        let odometry = mission.odometry();
        if let Some(odometry) = odometry {
            self.link.tell_odometry(self.time.link_ns(odometry.stamp), odometry, mission.odometry_resets());
        }
        if let Command::Flight(point) = command {
            self.link.obey(self.time.link_ns(stamp), point, odometry);
            if point.is_armed && *self.resets.get_or_insert(mission.odometry_resets()) != mission.odometry_resets() {
                bail!("the robot's own odometry lost its way and began anew, so its set-points mean other places");
            }
            if point.is_armed
                && let Some(odometry) = odometry
                && let Some(apart_m) = self.link.disagreement_m(self.time.link_ns(odometry.stamp), odometry)
                && apart_m > MOST_APART_M
            {
                bail!(
                    "the robot's own odometry and the autopilot put it {apart_m:.2} m apart, so its set-points may mean other places"
                );
            }
            if point.is_armed
                && let Some(behind_s) = self.time.hopelessly_behind_s()
            {
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

    fn charge(&self) -> Option<f64> {
        self.link.charge()
    }

    fn rest(&mut self) -> Result<()> {
        Ok(self.link.land(LANDING)?)
    }

    fn deed(&self) -> &'static str {
        "flight"
    }

    fn account(&self) -> String {
        format!("flown by a PX4 autopilot in real time; {}", self.time.account())
    }
}
