//! Links that are fixed to each other, merged into one rigid body each.
//!
//! A simulator that makes a body of every link pays for frames, screws and motor housings; the Go1 has 46 links but 13 bodies that
//! move against each other. The merge is exact (parallel axis theorem), and the names of all merged links stay available.

use crate::inertia::MassProperties;
use crate::shape::Geometry;
use crate::tree::{JointKind, KinematicTree};
use nalgebra::Isometry3;

/// Links that move as one.
#[derive(Debug, Clone, PartialEq)]
pub struct MergedBody {
    /// Name of the link nearest to the root; its frame is the frame of the body.
    pub name: String,
    /// Index of the joint that moves the body; `None` for the root body.
    pub joint: Option<usize>,
    /// Index (in the list of bodies) of the body on the other side of that joint, and the pose of the joint in it.
    pub parent: Option<(usize, Isometry3<f64>)>,
    /// Every link of the body, with its pose in the body.
    pub links: Vec<(usize, Isometry3<f64>)>,
    /// Mass of all its links in the frame of the body.
    pub mass: MassProperties,
    /// Collision shapes of all its links in the frame of the body.
    pub shapes: Vec<(Isometry3<f64>, Geometry)>,
}

/// The rigid bodies of a tree, parents before children; the first holds the root link.
pub fn merged_bodies(tree: &KinematicTree) -> Vec<MergedBody> {
    let new_body = |link: usize, joint, parent| MergedBody {
        name: tree.links()[link].name.clone(),
        joint,
        parent,
        links: vec![(link, Isometry3::identity())],
        mass: MassProperties::zero(),
        shapes: Vec::new(),
    };
    let mut bodies = vec![new_body(tree.root(), None, None)];
    // Body and pose in it of every link seen so far.
    let mut home = vec![(0, Isometry3::identity()); tree.links().len()];
    for &index in tree.joints_from_root() {
        let joint = &tree.joints()[index];
        let (body, body_from_parent) = home[joint.parent];
        let body_from_joint = body_from_parent * joint.parent_from_joint;
        if joint.kind == JointKind::Fixed {
            bodies[body].links.push((joint.child, body_from_joint));
            home[joint.child] = (body, body_from_joint);
        } else {
            home[joint.child] = (bodies.len(), Isometry3::identity());
            bodies.push(new_body(joint.child, Some(index), Some((body, body_from_joint))));
        }
    }
    for body in &mut bodies {
        let parts: Vec<_> = body.links.iter().map(|(link, pose)| tree.links()[*link].mass.in_frame(pose)).collect();
        body.mass = MassProperties::combined(&parts);
        for (link, pose) in &body.links {
            body.shapes
                .extend(tree.links()[*link].shapes.iter().map(|(shape, geometry)| (pose * shape, geometry.clone())));
        }
    }
    bodies
}
