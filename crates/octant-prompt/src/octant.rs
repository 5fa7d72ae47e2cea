//! The eight egocentric octants (OmniVLN Eq. 8-9) and the eight plan bearings used for far things.
//!
//! Eq. 8 takes a point to the body frame; Eq. 9 reads three signs. The paper leaves ties open; here the function is total: a zero (also
//! `-0.0`) belongs to the non-negative side, so `x' = 0` is Front, `y' = 0` is Left and `z' = h_cam` is Top.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};

/// One cell of the 2 x 2 x 2 partition of space round the agent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[allow(missing_docs)] // the names say it
pub enum Octant {
    FrontLeftTop,
    FrontLeftBottom,
    FrontRightTop,
    FrontRightBottom,
    BackLeftTop,
    BackLeftBottom,
    BackRightTop,
    BackRightBottom,
}

/// Coordinates of a world point in the body frame: `P' = R_wb^T (P - t_wb)`.
pub fn point_in_body(world_from_body: &Isometry3<f64>, point_in_world: &Point3<f64>) -> Point3<f64> {
    world_from_body.inverse_transform_point(point_in_world) // OmniVLN Eq. 8
}

/// The octant of a point given in the body frame (x forward, y left, z up); `camera_height_m` is the height of the camera above the
/// body origin. Total: every input has exactly one octant (NaN counts as negative).
pub fn octant_of(point_in_body: &Point3<f64>, camera_height_m: f64) -> Octant {
    // OmniVLN Eq. 9, with sgn(0) = +
    Octant::from_signs(point_in_body.x >= 0.0, point_in_body.y >= 0.0, point_in_body.z - camera_height_m >= 0.0)
}

impl Octant {
    /// All eight, in the order in which prompts list them.
    pub const ALL: [Octant; 8] = [
        Octant::FrontLeftTop,
        Octant::FrontLeftBottom,
        Octant::FrontRightTop,
        Octant::FrontRightBottom,
        Octant::BackLeftTop,
        Octant::BackLeftBottom,
        Octant::BackRightTop,
        Octant::BackRightBottom,
    ];

    /// The octant with the given sides.
    pub fn from_signs(front: bool, left: bool, top: bool) -> Octant {
        Octant::ALL[usize::from(!front) * 4 + usize::from(!left) * 2 + usize::from(!top)]
    }

    /// (front, left, top).
    pub fn signs(self) -> (bool, bool, bool) {
        let index = self as usize;
        (index & 4 == 0, index & 2 == 0, index & 1 == 0)
    }

    /// The name used in prompts: `front-left-top`.
    pub fn name(self) -> &'static str {
        match self {
            Octant::FrontLeftTop => "front-left-top",
            Octant::FrontLeftBottom => "front-left-bottom",
            Octant::FrontRightTop => "front-right-top",
            Octant::FrontRightBottom => "front-right-bottom",
            Octant::BackLeftTop => "back-left-top",
            Octant::BackLeftBottom => "back-left-bottom",
            Octant::BackRightTop => "back-right-top",
            Octant::BackRightBottom => "back-right-bottom",
        }
    }

    /// The octant after the agent turned by +90 degrees about its z axis (to the left): what was left is now in front.
    pub fn after_left_turn(self) -> Octant {
        let (front, left, top) = self.signs();
        Octant::from_signs(left, !front, top)
    }

    /// Heading of the middle of the octant in the body frame, radians, positive to the left: what `turn_to` means for a controller.
    pub fn heading_rad(self) -> f64 {
        let (front, left, _) = self.signs();
        let size = if front { std::f64::consts::FRAC_PI_4 } else { 3.0 * std::f64::consts::FRAC_PI_4 };
        if left { size } else { -size }
    }
}

impl fmt::Display for Octant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The text is not one of the eight names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not an octant name such as front-left-top")]
pub struct NotAnOctant;

impl FromStr for Octant {
    type Err = NotAnOctant;

    /// Accepts any case and `-`, `_` or spaces between the words.
    fn from_str(text: &str) -> Result<Octant, NotAnOctant> {
        if text.len() > 32 {
            return Err(NotAnOctant);
        }
        let wanted: String =
            text.trim().chars().map(|c| if c == '_' || c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect();
        Octant::ALL.into_iter().find(|octant| octant.name() == wanted).ok_or(NotAnOctant)
    }
}

/// One of eight plan directions of 45 degrees each, for rooms and frontiers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Bearing {
    Front,
    FrontLeft,
    Left,
    BackLeft,
    Back,
    BackRight,
    Right,
    FrontRight,
}

impl Bearing {
    /// All eight, counter-clockwise from the front.
    pub const ALL: [Bearing; 8] = [
        Bearing::Front,
        Bearing::FrontLeft,
        Bearing::Left,
        Bearing::BackLeft,
        Bearing::Back,
        Bearing::BackRight,
        Bearing::Right,
        Bearing::FrontRight,
    ];

    /// The bearing of a point in the body frame. The origin itself is Front; a direction on a border belongs to the sector further left.
    pub fn of(point_in_body: &Point3<f64>) -> Bearing {
        let angle_rad = point_in_body.y.atan2(point_in_body.x);
        let sector = (angle_rad / std::f64::consts::FRAC_PI_4 + 0.5).floor();
        Bearing::ALL[(sector as i64).rem_euclid(8) as usize]
    }

    /// The name used in prompts: `front-left`.
    pub fn name(self) -> &'static str {
        match self {
            Bearing::Front => "front",
            Bearing::FrontLeft => "front-left",
            Bearing::Left => "left",
            Bearing::BackLeft => "back-left",
            Bearing::Back => "back",
            Bearing::BackRight => "back-right",
            Bearing::Right => "right",
            Bearing::FrontRight => "front-right",
        }
    }
}

impl fmt::Display for Bearing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_zero_belongs_to_the_non_negative_side() {
        assert_eq!(octant_of(&Point3::new(0.0, 0.0, 0.5), 0.5), Octant::FrontLeftTop);
        assert_eq!(octant_of(&Point3::new(-0.0, -0.0, 0.5), 0.5), Octant::FrontLeftTop);
        assert_eq!(octant_of(&Point3::new(-1e-12, 0.0, 0.5), 0.5), Octant::BackLeftTop);
        assert_eq!(octant_of(&Point3::new(1.0, -1.0, 0.4), 0.5), Octant::FrontRightBottom);
    }

    #[test]
    fn eq_8_of_a_turned_robot() {
        // The robot stands at (1, 2, 0.3) and looks along +y (yaw 90 degrees): a point 2 m further along y is in front of it.
        let world_from_body = Isometry3::new(Vector3::new(1.0, 2.0, 0.3), Vector3::z() * std::f64::consts::FRAC_PI_2);
        let p = point_in_body(&world_from_body, &Point3::new(0.5, 4.0, 0.3));
        assert!((p - Point3::new(2.0, 0.5, 0.0)).norm() < 1e-12);
        assert_eq!(octant_of(&p, 0.42), Octant::FrontLeftBottom);
    }

    #[test]
    fn names_round_trip_in_any_spelling() {
        for octant in Octant::ALL {
            assert_eq!(octant.name().parse(), Ok(octant));
            assert_eq!(octant.name().to_uppercase().replace('-', "_").parse(), Ok(octant));
        }
        assert!("front".parse::<Octant>().is_err());
    }

    #[test]
    fn bearings_of_the_axes() {
        assert_eq!(Bearing::of(&Point3::new(1.0, 0.0, 0.0)), Bearing::Front);
        assert_eq!(Bearing::of(&Point3::new(0.0, 1.0, 0.0)), Bearing::Left);
        assert_eq!(Bearing::of(&Point3::new(-1.0, 0.0, 0.0)), Bearing::Back);
        assert_eq!(Bearing::of(&Point3::new(-1.0, -0.0, 0.0)), Bearing::Back);
        assert_eq!(Bearing::of(&Point3::new(1.0, -1.0, 9.0)), Bearing::FrontRight);
    }
}
