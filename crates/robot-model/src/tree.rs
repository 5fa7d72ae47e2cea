//! The kinematic tree: links, joints, and where everything is at given joint angles.
//!
//! ```text
//! root_from_child = root_from_parent * parent_from_joint * motion(q)
//! motion(q) = rotation by q about the axis (revolute, continuous) | translation by q along it (prismatic) | identity (fixed)
//! ```

use crate::error::ModelError;
use crate::inertia::MassProperties;
use crate::shape::Geometry;
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// More links than any robot has; it bounds the work on a hostile file.
pub const MAX_LINKS: usize = 10_000;

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// Turns between its limits.
    Revolute,
    /// Turns without limits: wheels and rotors.
    Continuous,
    /// Slides along its axis.
    Prismatic,
}

/// A joint between two links.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the parent link.
    pub parent: usize,
    /// Index of the child link.
    pub child: usize,
    /// Pose of the joint (and of the child link at zero) in the parent link.
    pub parent_from_joint: Isometry3<f64>,
    /// Axis of motion in the joint frame; meaningless for a fixed joint.
    pub axis: Unit<Vector3<f64>>,
    /// Lower limit, rad or m; `None`: unlimited.
    pub lower: Option<f64>,
    /// Upper limit, rad or m; `None`: unlimited.
    pub upper: Option<f64>,
    /// Largest torque (Nm) or force (N); `None`: the URDF gives none or zero.
    pub max_effort: Option<f64>,
    /// Largest speed, rad/s or m/s; `None`: the URDF gives none or zero.
    pub max_velocity: Option<f64>,
}

/// A link: mass and collision shapes in its own frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Name in the URDF.
    pub name: String,
    /// Mass, centre of mass and inertia in the link frame.
    pub mass: MassProperties,
    /// Collision shapes with their poses in the link frame.
    pub shapes: Vec<(Isometry3<f64>, Geometry)>,
}

/// What is wrong with a list of joint angles.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AnglesError {
    /// Not one angle for each moving joint.
    #[error("{given} joint angles given, the robot has {expected} moving joints")]
    Count {
        /// Number of angles given.
        given: usize,
        /// Number of moving joints.
        expected: usize,
    },
    /// An angle is NaN or infinite.
    #[error("the angle of joint `{joint}` is not finite")]
    NotFinite {
        /// The joint.
        joint: String,
    },
    /// No moving joint has this name.
    #[error("`{joint}` is not a moving joint of the robot")]
    UnknownJoint {
        /// The name given.
        joint: String,
    },
}

/// A tree of links with one root. Made by [`KinematicTree::new`], which checks that it is one.
#[derive(Debug, Clone, PartialEq)]
pub struct KinematicTree {
    links: Vec<Link>,
    joints: Vec<Joint>,
    root: usize,
    /// Joint indices, parents before children.
    order: Vec<usize>,
    /// Indices of the joints that move, in the order of the URDF.
    moving: Vec<usize>,
    /// For each link the joint above it.
    above: Vec<Option<usize>>,
}

impl KinematicTree {
    /// Checks that links and joints form one tree.
    ///
    /// # Errors
    /// No links, duplicate names, two parents, several roots, cycles.
    pub fn new(links: Vec<Link>, joints: Vec<Joint>) -> Result<Self, ModelError> {
        if links.is_empty() {
            return Err(ModelError::NoLinks);
        }
        if links.len() > MAX_LINKS {
            return Err(ModelError::TooManyLinks { links: links.len(), limit: MAX_LINKS });
        }
        refuse_duplicates("link", links.iter().map(|link| link.name.as_str()))?;
        refuse_duplicates("joint", joints.iter().map(|joint| joint.name.as_str()))?;
        let mut joint_above: Vec<Option<usize>> = vec![None; links.len()];
        let mut joints_below: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        for (index, joint) in joints.iter().enumerate() {
            if let Some(other) = joint_above[joint.child] {
                return Err(ModelError::TwoParents {
                    link: links[joint.child].name.clone(),
                    first: joints[other].name.clone(),
                    second: joint.name.clone(),
                });
            }
            joint_above[joint.child] = Some(index);
            joints_below[joint.parent].push(index);
        }
        let mut roots = (0..links.len()).filter(|link| joint_above[*link].is_none());
        let Some(root) = roots.next() else {
            // Every link has a parent: every link is on or below a loop.
            return Err(ModelError::Cycle { link: links[0].name.clone() });
        };
        let second_root = roots.next();

        let mut order = Vec::with_capacity(joints.len());
        let mut is_reached = vec![false; links.len()];
        let mut stack = vec![root];
        is_reached[root] = true;
        while let Some(link) = stack.pop() {
            for &joint in &joints_below[link] {
                order.push(joint);
                is_reached[joints[joint].child] = true;
                stack.push(joints[joint].child);
            }
        }
        if let Some(second) = second_root {
            return Err(ModelError::SeveralRoots {
                first: links[root].name.clone(),
                second: links[second].name.clone(),
            });
        }
        if let Some(link) = is_reached.iter().position(|reached| !reached) {
            return Err(ModelError::Cycle { link: links[link].name.clone() });
        }
        let moving = (0..joints.len()).filter(|joint| joints[*joint].kind != JointKind::Fixed).collect();
        Ok(Self { links, joints, root, order, moving, above: joint_above })
    }

    /// All links, in the order of the URDF.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// All joints, in the order of the URDF.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Index of the root link, whose frame is the body frame.
    pub fn root(&self) -> usize {
        self.root
    }

    /// Indices of the joints, each parent before its children.
    pub fn joints_from_root(&self) -> &[usize] {
        &self.order
    }

    /// Indices of the joints that move, in the order of the URDF: the order of every list of angles.
    pub fn moving_joints(&self) -> &[usize] {
        &self.moving
    }

    /// Index of the link with this name.
    pub fn link_named(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    /// Index of the joint with this name.
    pub fn joint_named(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Index of the joint whose child is this link; `None` for the root.
    pub fn joint_above(&self, link: usize) -> Option<usize> {
        self.above.get(link).copied().flatten()
    }

    /// Turns named angles into a list in the order of [`KinematicTree::moving_joints`]; joints not named stand at zero.
    ///
    /// # Errors
    /// A name that is not a moving joint, or an angle that is not finite.
    pub fn angles_from(&self, named: &BTreeMap<String, f64>) -> Result<Vec<f64>, AnglesError> {
        let mut angles = vec![0.0; self.moving.len()];
        for (name, angle) in named {
            let slot = self.moving.iter().position(|joint| self.joints[*joint].name == *name);
            let slot = slot.ok_or_else(|| AnglesError::UnknownJoint { joint: name.clone() })?;
            angles[slot] = *angle;
        }
        self.check_angles(&angles)?;
        Ok(angles)
    }

    /// Pose of every link in the root link (the body frame), in the order of [`KinematicTree::links`].
    ///
    /// # Errors
    /// A wrong number of angles, or one that is not finite. Limits are not enforced here.
    pub fn body_from_links(&self, angles: &[f64]) -> Result<Vec<Isometry3<f64>>, AnglesError> {
        self.check_angles(angles)?;
        let mut angle_of = vec![0.0; self.joints.len()];
        for (joint, angle) in self.moving.iter().zip(angles) {
            angle_of[*joint] = *angle;
        }
        let mut poses = vec![Isometry3::identity(); self.links.len()];
        for &index in &self.order {
            let joint = &self.joints[index];
            poses[joint.child] = poses[joint.parent] * joint.parent_from_child(angle_of[index]);
        }
        Ok(poses)
    }

    /// Mass, centre of mass and inertia of the whole robot in the body frame at the given angles.
    ///
    /// # Errors
    /// As [`KinematicTree::body_from_links`].
    pub fn mass_properties(&self, angles: &[f64]) -> Result<MassProperties, AnglesError> {
        let poses = self.body_from_links(angles)?;
        let parts: Vec<MassProperties> =
            self.links.iter().zip(&poses).map(|(link, pose)| link.mass.in_frame(pose)).collect();
        Ok(MassProperties::combined(&parts))
    }

    fn check_angles(&self, angles: &[f64]) -> Result<(), AnglesError> {
        if angles.len() != self.moving.len() {
            return Err(AnglesError::Count { given: angles.len(), expected: self.moving.len() });
        }
        match angles.iter().position(|angle| !angle.is_finite()) {
            Some(slot) => Err(AnglesError::NotFinite { joint: self.joints[self.moving[slot]].name.clone() }),
            None => Ok(()),
        }
    }
}

impl Joint {
    /// Pose of the child link in the parent link at joint position `q` (rad or m).
    pub fn parent_from_child(&self, q: f64) -> Isometry3<f64> {
        let motion = match self.kind {
            JointKind::Fixed => return self.parent_from_joint,
            JointKind::Revolute | JointKind::Continuous => {
                Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&self.axis, q))
            }
            JointKind::Prismatic => {
                Isometry3::from_parts(Translation3::from(self.axis.scale(q)), UnitQuaternion::identity())
            }
        };
        self.parent_from_joint * motion
    }
}

fn refuse_duplicates<'a>(kind: &str, names: impl Iterator<Item = &'a str>) -> Result<(), ModelError> {
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(ModelError::DuplicateName { element: format!("{kind} `{}`", pair[0]) }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn link(name: &str) -> Link {
        Link { name: name.into(), mass: MassProperties::zero(), shapes: Vec::new() }
    }

    fn joint(name: &str, kind: JointKind, parent: usize, child: usize) -> Joint {
        Joint {
            name: name.into(),
            kind,
            parent,
            child,
            parent_from_joint: Isometry3::translation(1.0, 0.0, 0.0),
            axis: Vector3::z_axis(),
            lower: None,
            upper: None,
            max_effort: None,
            max_velocity: None,
        }
    }

    #[test]
    fn an_elbow_turned_by_a_right_angle() {
        let links = vec![link("a"), link("b"), link("c")];
        let joints = vec![joint("ab", JointKind::Revolute, 0, 1), joint("bc", JointKind::Prismatic, 1, 2)];
        let tree = KinematicTree::new(links, joints).expect("a chain");
        let poses = tree.body_from_links(&[std::f64::consts::FRAC_PI_2, 0.5]).expect("two angles");
        assert!((poses[2] * Point3::origin() - Point3::new(1.0, 1.0, 0.5)).norm() < 1e-12);
        assert_eq!(tree.body_from_links(&[0.0]), Err(AnglesError::Count { given: 1, expected: 2 }));
        assert_eq!(tree.body_from_links(&[0.0, f64::NAN]), Err(AnglesError::NotFinite { joint: "bc".into() }));
    }

    #[test]
    fn what_is_not_a_tree_is_refused() {
        let check = |links: &[&str], joints: &[(&str, usize, usize)], expected: ModelError| {
            let links = links.iter().map(|name| link(name)).collect();
            let joints = joints.iter().map(|(name, a, b)| joint(name, JointKind::Fixed, *a, *b)).collect();
            assert_eq!(KinematicTree::new(links, joints), Err(expected));
        };
        check(&[], &[], ModelError::NoLinks);
        check(&["a", "b"], &[], ModelError::SeveralRoots { first: "a".into(), second: "b".into() });
        check(&["a", "a"], &[("j", 0, 1)], ModelError::DuplicateName { element: "link `a`".into() });
        check(&["a", "b"], &[("j", 0, 1), ("k", 1, 0)], ModelError::Cycle { link: "a".into() });
        check(&["a", "b", "c"], &[("j", 1, 2), ("k", 2, 1)], ModelError::Cycle { link: "b".into() });
        check(
            &["a", "b"],
            &[("j", 0, 1), ("k", 0, 1)],
            ModelError::TwoParents { link: "b".into(), first: "j".into(), second: "k".into() },
        );
    }
}
