//! What the body shall do next, after the mind has decided.

use nalgebra::Point2;

/// A goal of motion in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Stand (or hover) where you are.
    Stay,
    /// Be somewhere.
    Reach {
        /// Where, in the frame of the odometry.
        target: Point2<f64>,
        /// Near enough.
        tolerance_m: f64,
        /// Heading at the end, if it matters.
        heading_rad: Option<f64>,
    },
    /// Look another way.
    Turn {
        /// Heading, counter-clockwise from x.
        heading_rad: f64,
    },
}

/// How far a goal is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GoalStatus {
    /// On the way.
    Underway,
    /// There.
    Arrived,
    /// Not possible, and why.
    Failed(&'static str),
}

/// An angle in (-pi, pi].
pub fn wrap(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(std::f64::consts::TAU);
    if turned > std::f64::consts::PI { turned - std::f64::consts::TAU } else { turned }
}
