//! Where the sensors sit, from the static transforms of a bag.
//!
//! A cloud whose frame hangs together with the IMU's is one of a fixed LiDAR, or was put into the stator's frame by its driver.
//! A cloud whose chain of static transforms ends in another root is one of a turning LiDAR: that root is the rotor, the frame
//! of the joint's messages is the stator, and the joint's angle turns the one against the other about z.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use omni_perception::RotatingMount;

use super::error::BagError;
use super::ros_messages::{Quaternion, TfMessage, Transform, Vector3};
use crate::recording::RecordedRig;

/// Frames that are taken for the robot's body, in this order, if they hang together with the IMU; else the IMU is the body.
const BODY_FRAMES: [&str; 3] = ["base_link", "body", "base_footprint"];
/// Longest chain of transforms.
const LONGEST_CHAIN: usize = 64;

/// Child -> parent with the child's pose in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StaticFrames {
    parents: BTreeMap<String, (String, Isometry3<f64>)>,
}

impl StaticFrames {
    /// Takes the transforms of a message; a later one replaces an earlier one of the same child, as in ROS.
    ///
    /// # Errors
    /// [`BagError::BadTransform`] for a quaternion that is none.
    pub fn add(&mut self, message: &TfMessage) -> Result<(), BagError> {
        for transform in &message.transforms {
            let child = bare(&transform.child_frame_id).to_owned();
            let Some(pose) = isometry(&transform.transform) else {
                return Err(BagError::BadTransform { frame: child });
            };
            self.parents.insert(child, (bare(&transform.header.frame_id).to_owned(), pose));
        }
        Ok(())
    }

    /// Frames that are named anywhere.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.parents.iter().flat_map(|(child, (parent, _))| [child.clone(), parent.clone()]).collect();
        names.sort();
        names.dedup();
        names
    }

    /// The frame at the end of the chain above `frame`, and the pose of `frame` in it.
    fn root<'a>(&'a self, frame: &'a str) -> Result<(&'a str, Isometry3<f64>), BagError> {
        let (mut at, mut at_from_frame) = (bare(frame), Isometry3::identity());
        for _ in 0..LONGEST_CHAIN {
            let Some((parent, parent_from_at)) = self.parents.get(at) else { return Ok((at, at_from_frame)) };
            at_from_frame = parent_from_at * at_from_frame;
            at = parent;
        }
        Err(BagError::BadTransform { frame: frame.to_owned() })
    }

    /// Pose of frame `of` in frame `within`; `None` if nothing joins them.
    ///
    /// # Errors
    /// [`BagError::BadTransform`] if the chain goes round in a circle.
    pub fn pose(&self, within: &str, of: &str) -> Result<Option<Isometry3<f64>>, BagError> {
        if bare(within) == bare(of) {
            return Ok(Some(Isometry3::identity()));
        }
        let ((root, root_from_within), (other_root, root_from_of)) = (self.root(within)?, self.root(of)?);
        Ok((root == other_root).then(|| root_from_within.inverse() * root_from_of))
    }

    /// The rig of a recording whose clouds come in frame `cloud`, whose IMU sits in frame `imu` and whose joint, if there is
    /// one, turns against frame `stator`.
    ///
    /// # Errors
    /// [`BagError::NoTransform`] if the frames do not hang together.
    pub fn rig(&self, cloud: &str, imu: &str, stator: Option<&str>) -> Result<RecordedRig, BagError> {
        let body = self.body(imu)?;
        let body_from_imu = self.need(body, imu)?;
        if let Some(body_from_stator) = self.pose(body, cloud)? {
            let mount = RotatingMount { body_from_stator, rotor_from_sensor: Isometry3::identity() };
            return Ok(RecordedRig { mount, is_rotating: false, body_from_imu });
        }
        let Some(stator) = stator else { return Err(self.no_transform(imu, cloud)) };
        let (_, rotor_from_sensor) = self.root(cloud)?;
        let mount = RotatingMount { body_from_stator: self.need(body, stator)?, rotor_from_sensor };
        Ok(RecordedRig { mount, is_rotating: true, body_from_imu })
    }

    /// The frame that counts as the body.
    ///
    /// # Errors
    /// [`BagError::BadTransform`] if the chain goes round in a circle.
    pub fn body<'a>(&self, imu: &'a str) -> Result<&'a str, BagError> {
        for name in BODY_FRAMES {
            if self.pose(name, imu)?.is_some() {
                return Ok(name);
            }
        }
        Ok(imu)
    }

    fn need(&self, within: &str, of: &str) -> Result<Isometry3<f64>, BagError> {
        self.pose(within, of)?.ok_or_else(|| self.no_transform(within, of))
    }

    fn no_transform(&self, from: &str, to: &str) -> BagError {
        BagError::NoTransform { from: from.to_owned(), to: to.to_owned(), known: self.names() }
    }
}

/// Names of frames began with a slash once.
fn bare(frame: &str) -> &str {
    frame.strip_prefix('/').unwrap_or(frame)
}

/// A pose in the form of ROS.
pub fn transform(pose: &Isometry3<f64>) -> Transform {
    let (t, q) = (pose.translation.vector, pose.rotation.quaternion().coords);
    Transform {
        translation: Vector3 { x: t.x, y: t.y, z: t.z },
        rotation: Quaternion { x: q.x, y: q.y, z: q.z, w: q.w },
    }
}

/// A pose of ours. `None` if a number is not finite or the quaternion's length is off by more than a thousandth.
pub fn isometry(transform: &Transform) -> Option<Isometry3<f64>> {
    let (t, q) = (transform.translation, transform.rotation);
    let quaternion = nalgebra::Quaternion::new(q.w, q.x, q.y, q.z);
    let is_sound = (quaternion.norm() - 1.0).abs() < 1e-3 && [t.x, t.y, t.z].iter().all(|v| v.is_finite());
    // What is of length one to the last bits stays as it is: dividing it again would change them.
    let rotation = if (quaternion.norm_squared() - 1.0).abs() < 1e-14 {
        UnitQuaternion::new_unchecked(quaternion)
    } else {
        UnitQuaternion::new_normalize(quaternion)
    };
    is_sound.then(|| Isometry3::from_parts(Translation3::new(t.x, t.y, t.z), rotation))
}

#[cfg(test)]
mod tests {
    use super::super::ros_messages::{Header, TransformStamped};
    use super::*;

    fn tree(edges: &[(&str, &str, [f64; 3])]) -> StaticFrames {
        let transforms = edges
            .iter()
            .map(|(parent, child, [x, y, z])| TransformStamped {
                header: Header { frame_id: (*parent).into(), ..Header::default() },
                child_frame_id: (*child).into(),
                transform: transform(&Isometry3::translation(*x, *y, *z)),
            })
            .collect();
        let mut frames = StaticFrames::default();
        frames.add(&TfMessage { transforms }).unwrap();
        frames
    }

    #[test]
    fn a_cloud_in_the_bodys_tree_is_fixed_and_one_in_a_tree_of_its_own_turns() {
        let frames = tree(&[
            ("base_link", "imu", [0.1, 0.0, 0.0]),
            ("imu", "lidar", [0.0, 0.0, 0.2]),
            ("rotor", "lidar_raw", [0.0, 0.3, 0.0]),
        ]);
        let fixed = frames.rig("/lidar", "imu", Some("lidar")).unwrap();
        assert!(!fixed.is_rotating);
        assert_eq!(fixed.mount.body_from_stator.translation.vector, nalgebra::Vector3::new(0.1, 0.0, 0.2));
        let turning = frames.rig("lidar_raw", "imu", Some("lidar")).unwrap();
        assert!(turning.is_rotating);
        assert_eq!(turning.mount.body_from_stator, fixed.mount.body_from_stator);
        assert_eq!(turning.mount.rotor_from_sensor.translation.vector.y, 0.3);
        let error = frames.rig("lidar_raw", "imu", None).unwrap_err().to_string();
        assert!(error.contains("\"imu\" to frame \"lidar_raw\"") && error.contains("rotor"), "{error}");
    }

    #[test]
    fn without_transforms_one_frame_is_enough_and_circles_are_refused() {
        let none = StaticFrames::default();
        let rig = none.rig("sensor", "sensor", None).unwrap();
        assert_eq!(rig.body_from_imu, Isometry3::identity());
        assert!(none.rig("lidar", "imu", None).is_err());
        let circle = tree(&[("a", "b", [0.0; 3]), ("b", "a", [0.0; 3])]);
        assert!(matches!(circle.rig("a", "imu", None), Err(BagError::BadTransform { .. })));
        let mut frames = StaticFrames::default();
        let bad = TfMessage { transforms: vec![TransformStamped::default()] };
        assert!(matches!(frames.add(&bad), Err(BagError::BadTransform { .. })));
    }
}
