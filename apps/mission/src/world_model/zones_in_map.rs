//! The zones a person drew, in the frame of the map.

use nalgebra::Point2;
use robot_model::RobotKind;

use super::{Frame, WorldModel};
use crate::closed_air::POST_SPACING_M;
use crate::zones::{ZoneFrame, Zones};

impl WorldModel {
    /// Puts the zones where they belong in the map, once that has its frame. Zones of a known map wait until the robot knows where in it
    /// it is.
    pub(super) fn place_zones(&mut self) {
        // On the ground closer than any robot is wide.
        let spacing_m = match self.robot.kind {
            RobotKind::Ground => 0.03,
            RobotKind::Aerial => POST_SPACING_M,
        };
        let Frame::Set(frame) = self.frame else { return };
        let is_waiting = self.config.zones.frame == ZoneFrame::Map && self.looks.is_some();
        if self.zones_placed == Some(frame) || is_waiting {
            return;
        }
        self.zones = match self.config.zones.frame {
            ZoneFrame::Start => self.config.zones.moved(&frame.map_from_odometry),
            ZoneFrame::Map => self.config.zones.clone(),
        };
        self.zone_posts = self.zones.posts(spacing_m);
        self.navigation.heed(&self.zones);
        self.gathered.0 = None;
        self.zones_placed = Some(frame);
    }

    /// The zones, once they lie in the map.
    pub fn placed_zones(&self) -> Option<&Zones> {
        self.zones_placed.map(|_| &self.zones)
    }

    /// Posts round the zones to keep out of, in the map.
    pub fn zone_posts(&self) -> &[Point2<f64>] {
        &self.zone_posts
    }
}
