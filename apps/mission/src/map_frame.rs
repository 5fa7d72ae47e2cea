//! The map's frame: that of the odometry, turned once about the robot's start so that the walls lie along its axes.
//!
//! Everything the robot knows is in this frame. Only two things cross over: estimates come in, and commands that name places go
//! out, for a body knows its odometry and nothing else.

use nalgebra::{Isometry3, Translation3};
use omni_perception::{DeskewConfig, EncoderTrack, OdometryEstimate, ReferenceTime, RotatingMount, Trajectory, deskew};

use crate::alignment::turn_to_walls;
use crate::stream::{Command, SensorEvent};

/// Where the odometry's frame lies in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapFrame {
    /// Takes what the odometry says into the map; a turn about the vertical.
    pub map_from_odometry: Isometry3<f64>,
}

impl Default for MapFrame {
    /// The odometry's own.
    fn default() -> Self {
        Self { map_from_odometry: Isometry3::identity() }
    }
}

impl MapFrame {
    /// From what the sensors said before the robot moved; the odometry's own frame if no direction of walls stands out.
    /// `encoder` is the track of the motor before them; `floor_m` is the height of the floor in the odometry's frame.
    pub fn of_first_look(
        events: &[SensorEvent],
        mount: &RotatingMount,
        mut encoder: EncoderTrack,
        floor_m: f64,
    ) -> MapFrame {
        let (mut trajectory, mut start) = (Trajectory::default(), None);
        for event in events {
            // What is out of order is counted when the events are taken.
            match event {
                SensorEvent::Encoder(sample) => {
                    let _ = encoder.push(*sample);
                }
                SensorEvent::Odometry(estimate) => {
                    start.get_or_insert(estimate.world_from_body.translation.vector);
                    let _ = trajectory.push(estimate);
                }
                _ => {}
            }
        }
        let config = DeskewConfig::default();
        let mut points = Vec::new();
        for event in events {
            if let SensorEvent::Scan(scan) = event
                && let Ok(straight) = deskew(scan, &encoder, mount, &trajectory, ReferenceTime::End, &config)
            {
                points.extend(straight.points_in_world());
            }
        }
        let Some(turn) = turn_to_walls(&points, floor_m) else { return MapFrame::default() };
        let pivot = Translation3::from(start.unwrap_or_default());
        MapFrame { map_from_odometry: pivot * turn * pivot.inverse() }
    }

    /// An estimate of the odometry as one in the map. Its rotation errors are the body's and stay as they are.
    pub fn estimate_in_map(&self, estimate: &OdometryEstimate) -> OdometryEstimate {
        let map_from_odometry = self.map_from_odometry;
        let mut covariance = estimate.covariance;
        let turn = map_from_odometry.rotation.to_rotation_matrix();
        let of_translation = turn * covariance.fixed_rows::<3>(0);
        covariance.fixed_rows_mut::<3>(0).copy_from(&of_translation);
        let of_translation = covariance.fixed_columns::<3>(0) * turn.matrix().transpose();
        covariance.fixed_columns_mut::<3>(0).copy_from(&of_translation);
        OdometryEstimate {
            world_from_body: map_from_odometry * estimate.world_from_body,
            velocity_in_world_mps: map_from_odometry * estimate.velocity_in_world_mps,
            covariance,
            ..*estimate
        }
    }

    /// A command in the map as the body's odometry has it.
    pub fn command_for_body(&self, command: Command) -> Command {
        let Command::Flight(mut point) = command else { return command };
        let odometry_from_map = self.map_from_odometry.inverse();
        point.position_in_world = odometry_from_map * point.position_in_world;
        for vector in
            [&mut point.velocity_in_world_mps, &mut point.acceleration_in_world_mps2, &mut point.jerk_in_world_mps3]
        {
            *vector = odometry_from_map * *vector;
        }
        point.yaw_rad += odometry_from_map.rotation.euler_angles().2;
        Command::Flight(point)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Point3, UnitQuaternion, Vector3};
    use omni_perception::Stamp;
    use proptest::prelude::*;

    use super::*;
    use crate::stream::FlightSetPoint;

    fn vector() -> impl Strategy<Value = Vector3<f64>> {
        proptest::array::uniform3(-5.0..5.0f64).prop_map(Vector3::from)
    }

    proptest! {
        /// A body told to be where the map says it is has nothing to correct, and what it measures means the same in both.
        #[test]
        fn to_be_where_one_is_costs_nothing(
            turn in -0.8..0.8f64, pivot in vector(), position in vector(), velocity in vector(), yaw in -3.1..3.1f64,
            root in proptest::collection::vec(-1.0..1.0f64, 36),
        ) {
            let about = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
            let pivot = Translation3::from(pivot);
            let frame = MapFrame { map_from_odometry: pivot * about * pivot.inverse() };
            let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let root = Matrix6::from_iterator(root);
            let said = OdometryEstimate {
                velocity_in_world_mps: velocity,
                covariance: root * root.transpose(),
                ..OdometryEstimate::at_rest(Stamp(5), Isometry3::from_parts(position.into(), heading))
            };
            let known = frame.estimate_in_map(&said);
            let wish = FlightSetPoint {
                position_in_world: Point3::from(known.world_from_body.translation.vector),
                velocity_in_world_mps: known.velocity_in_world_mps,
                acceleration_in_world_mps2: Vector3::zeros(),
                jerk_in_world_mps3: Vector3::zeros(),
                yaw_rad: known.world_from_body.rotation.euler_angles().2,
                yaw_rate_radps: 0.0,
                is_armed: true,
            };
            let Command::Flight(told) = frame.command_for_body(Command::Flight(wish)) else { unreachable!() };
            prop_assert!((told.position_in_world.coords - position).norm() < 1e-9);
            prop_assert!((told.velocity_in_world_mps - velocity).norm() < 1e-9);
            prop_assert!(crate::goal::wrap(told.yaw_rad - yaw).abs() < 1e-9);
            // The size of an error does not depend on the frame it is told in.
            let (a, b) = (said.covariance, known.covariance);
            prop_assert!((b - b.transpose()).norm() < 1e-9 && (a.trace() - b.trace()).abs() < 1e-9);
            prop_assert!((a.determinant() - b.determinant()).abs() < 1e-6 * (1.0 + a.determinant().abs()));
        }
    }
}
