//! URDF text to a [`KinematicTree`]: cleaned, decoded by urdf-rs, checked, with meshes read.

use crate::error::ModelError;
use crate::inertia::{InertiaFault, MassProperties};
use crate::mesh;
use crate::sanitise::{Element, sanitise};
use crate::shape::Geometry;
use crate::tree::{Joint, JointKind, KinematicTree, Link};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;

/// Limits as large as this stand for "none" (converters write +-1e16 for rotors).
const NO_LIMIT: f64 = 1e10;

/// A closure that finds the bytes of a mesh by the name the URDF gives it.
pub type MeshReader<'a> = &'a dyn Fn(&str) -> Option<Vec<u8>>;

/// Reads the robot's name and its kinematic tree. Only meshes of collision shapes are asked for.
///
/// # Errors
/// Everything of [`ModelError`] that concerns the URDF.
pub fn read(text: &str, read_mesh: MeshReader<'_>) -> Result<(String, KinematicTree), ModelError> {
    let cleaned = sanitise(text)?;
    let robot = decode(&cleaned)?;
    let links = robot.links.iter().map(|link| read_link(link, read_mesh)).collect::<Result<Vec<_>, _>>()?;
    let index: BTreeMap<&str, usize> = links.iter().enumerate().map(|(i, link)| (link.name.as_str(), i)).collect();
    let joints = robot.joints.iter().map(|joint| read_joint(joint, &index)).collect::<Result<Vec<_>, _>>()?;
    Ok((robot.name, KinematicTree::new(links, joints)?))
}

/// The `name` of the `<robot>` element, without reading the rest; `None` when there is none. It chooses the TOML
/// ([`crate::builtin_toml`]).
pub fn robot_name(text: &str) -> Option<String> {
    let name = sanitise(text).ok()?.attribute("name")?.trim().to_owned();
    (!name.is_empty()).then_some(name)
}

/// urdf-rs says what is wrong but not where; each element is then tried alone, which names the first bad one.
fn decode(cleaned: &Element) -> Result<urdf_rs::Robot, ModelError> {
    let mut xml = String::new();
    cleaned.write(&mut xml);
    let whole = match urdf_rs::read_from_string(&xml) {
        Ok(robot) => return Ok(robot),
        Err(error) => error,
    };
    for child in &cleaned.children {
        let alone = Element {
            name: "robot".into(),
            attributes: " name=\"r\"".into(),
            line: child.line,
            children: vec![child.clone()],
        };
        let mut xml = String::new();
        alone.write(&mut xml);
        if let Err(error) = urdf_rs::read_from_string(&xml) {
            let element = format!("{} `{}`", child.name, child.attribute("name").unwrap_or("without a name"));
            return Err(ModelError::UnreadableElement { element, line: child.line, detail: error.to_string() });
        }
    }
    Err(ModelError::UnreadableElement { element: "robot".into(), line: cleaned.line, detail: whole.to_string() })
}

fn read_link(link: &urdf_rs::Link, read_mesh: MeshReader<'_>) -> Result<Link, ModelError> {
    let inertia = &link.inertial.inertia;
    let inertia = Matrix3::new(
        inertia.ixx,
        inertia.ixy,
        inertia.ixz, //
        inertia.ixy,
        inertia.iyy,
        inertia.iyz, //
        inertia.ixz,
        inertia.iyz,
        inertia.izz,
    );
    let not_finite = || ModelError::NotFinite { element: format!("link `{}`", link.name) };
    let own = MassProperties { mass_kg: link.inertial.mass.value, center_of_mass: Point3::origin(), inertia };
    own.check().map_err(|fault| match fault {
        InertiaFault::NotFinite => not_finite(),
        fault => ModelError::Inertia { link: link.name.clone(), fault },
    })?;
    let link_from_inertial = read_pose(&link.inertial.origin).ok_or_else(not_finite)?;
    let mut shapes = Vec::new();
    for collision in &link.collision {
        let pose = read_pose(&collision.origin).ok_or_else(not_finite)?;
        read_geometry(&link.name, pose, &collision.geometry, read_mesh, &mut shapes)?;
    }
    Ok(Link { name: link.name.clone(), mass: own.in_frame(&link_from_inertial), shapes })
}

fn read_geometry(
    link: &str,
    pose: Isometry3<f64>,
    geometry: &urdf_rs::Geometry,
    read_mesh: MeshReader<'_>,
    shapes: &mut Vec<(Isometry3<f64>, Geometry)>,
) -> Result<(), ModelError> {
    let positive = |shape: &'static str, sizes: &[f64]| {
        if sizes.iter().all(|size| size.is_finite() && *size > 0.0) {
            Ok(())
        } else {
            Err(ModelError::BadShape { link: link.to_owned(), shape })
        }
    };
    match geometry {
        urdf_rs::Geometry::Box { size } => {
            positive("box", &size.0)?;
            shapes.push((pose, Geometry::Box { half: Vector3::from(size.0) / 2.0 }));
        }
        urdf_rs::Geometry::Cylinder { radius, length } => {
            positive("cylinder", &[*radius, *length])?;
            shapes.push((pose, Geometry::Cylinder { radius: *radius, half_length: length / 2.0 }));
        }
        urdf_rs::Geometry::Capsule { radius, length } => {
            positive("capsule", &[*radius, *length])?;
            shapes.push((pose, Geometry::Cylinder { radius: *radius, half_length: length / 2.0 }));
            for end in [-length / 2.0, length / 2.0] {
                shapes.push((pose * Translation3::new(0.0, 0.0, end), Geometry::Sphere { radius: *radius }));
            }
        }
        urdf_rs::Geometry::Sphere { radius } => {
            positive("sphere", &[*radius])?;
            shapes.push((pose, Geometry::Sphere { radius: *radius }));
        }
        urdf_rs::Geometry::Mesh { filename, scale } => {
            let scale = scale.map_or(Vector3::repeat(1.0), |scale| Vector3::from(scale.0));
            positive("mesh", &scale.abs().data.0[0])?;
            let missing = || ModelError::MissingMesh { link: link.to_owned(), file: filename.clone() };
            let bytes = read_mesh(filename).ok_or_else(missing)?;
            let points = mesh::vertices(filename, &bytes, &scale).map_err(|fault| ModelError::BadMesh {
                link: link.to_owned(),
                file: filename.clone(),
                fault,
            })?;
            shapes.push((pose, Geometry::ConvexHull(points)));
        }
    }
    Ok(())
}

fn read_joint(joint: &urdf_rs::Joint, link_index: &BTreeMap<&str, usize>) -> Result<Joint, ModelError> {
    let name = &joint.name;
    let find = |link: &str| {
        let missing = || ModelError::UnknownLink { joint: name.clone(), link: link.to_owned() };
        link_index.get(link).copied().ok_or_else(missing)
    };
    let not_finite = || ModelError::NotFinite { element: format!("joint `{name}`") };
    let unsupported = |kind| Err(ModelError::UnsupportedJoint { joint: name.clone(), kind });
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => JointKind::Fixed,
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Continuous => JointKind::Continuous,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        urdf_rs::JointType::Floating => return unsupported("floating"),
        urdf_rs::JointType::Planar => return unsupported("planar"),
        urdf_rs::JointType::Spherical => return unsupported("spherical"),
    };
    if kind != JointKind::Fixed && joint.mimic.is_some() {
        return unsupported("mimic");
    }
    let limit = &joint.limit;
    if [limit.lower, limit.upper, limit.effort, limit.velocity].iter().any(|v| v.is_nan()) {
        return Err(not_finite());
    }
    let is_limited = matches!(kind, JointKind::Revolute | JointKind::Prismatic);
    let lower = (is_limited && limit.lower > -NO_LIMIT).then_some(limit.lower);
    let upper = (is_limited && limit.upper < NO_LIMIT).then_some(limit.upper);
    if let (Some(lower), Some(upper)) = (lower, upper)
        && lower > upper
    {
        return Err(ModelError::CrossedLimits { joint: name.clone(), lower, upper });
    }
    let is_unlimited = lower.is_none() && upper.is_none();
    let positive = |value: f64| (value > 0.0 && value < NO_LIMIT).then_some(value);
    let axis = Vector3::from(joint.axis.xyz.0);
    let axis = match Unit::try_new(axis, 1e-9) {
        Some(axis) if axis.iter().all(|v| v.is_finite()) => axis,
        Some(_) => return Err(not_finite()),
        None if kind == JointKind::Fixed => Vector3::x_axis(),
        None => {
            return Err(ModelError::ZeroAxis { joint: name.clone() });
        }
    };
    Ok(Joint {
        name: name.clone(),
        kind: if kind == JointKind::Revolute && is_unlimited { JointKind::Continuous } else { kind },
        parent: find(&joint.parent.link)?,
        child: find(&joint.child.link)?,
        parent_from_joint: read_pose(&joint.origin).ok_or_else(not_finite)?,
        axis,
        lower,
        upper,
        max_effort: positive(limit.effort),
        max_velocity: positive(limit.velocity),
    })
}

/// URDF's fixed-axis roll, pitch, yaw: `R = Rz(yaw) Ry(pitch) Rx(roll)`.
pub(crate) fn pose(xyz: [f64; 3], rpy: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(xyz)),
        UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]),
    )
}

fn read_pose(origin: &urdf_rs::Pose) -> Option<Isometry3<f64>> {
    let numbers = origin.xyz.0.iter().chain(&origin.rpy.0);
    numbers.copied().all(f64::is_finite).then(|| pose(origin.xyz.0, origin.rpy.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(body: &str) -> ModelError {
        read(&format!("<robot name='r'>\n{body}\n</robot>"), &|_| None).expect_err("must be refused")
    }

    #[test]
    fn errors_name_the_element() {
        let inertial = |mass: f64, ixx: f64| {
            format!(
                "<link name='arm'><inertial><mass value='{mass}'/><inertia ixx='{ixx}' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>"
            )
        };
        let cases = [
            (inertial(-1.0, 1.0), "link `arm`: <inertial> has a negative mass"),
            (inertial(1.0, -1.0), "link `arm`: <inertial> has a negative principal moment of inertia"),
            (inertial(1.0, 9.0), "link `arm`: <inertial> breaks the triangle inequality of principal moments of inertia"),
            (
                "<link name='a'><collision><geometry><mesh filename='package://p/a.stl'/></geometry></collision></link>".into(),
                "link `a`: collision mesh `package://p/a.stl` was not found",
            ),
            (
                "<link name='a'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/></joint>".into(),
                "joint `j` names the link `b`, which does not exist",
            ),
            ("<link name='a'><collision><geometry><sphere radius='0'/></geometry></collision></link>".into(), "link `a`: a collision sphere has a size that is not positive"),
        ];
        for (body, expected) in cases {
            assert_eq!(refused(&body).to_string(), expected);
        }
        let unreadable = refused(
            "<link name='ok'/>\n<link name='bad'><inertial><mass value='x'/><inertia ixx='1'/></inertial></link>",
        );
        assert!(unreadable.to_string().starts_with("URDF line 3: link `bad` cannot be read"), "{unreadable}");
    }

    #[test]
    fn visual_meshes_are_never_asked_for() {
        let text = "<robot name='r'><link name='a'><visual><geometry><mesh filename='x.dae'/></geometry></visual></link></robot>";
        let (name, tree) = read(text, &|file| panic!("asked for {file}")).expect("a robot of one link");
        assert_eq!((name.as_str(), tree.links().len()), ("r", 1));
    }

    #[test]
    fn huge_limits_mean_none() {
        let text = "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='revolute'><parent link='a'/><child link='b'/>
            <axis xyz='0 0 2'/><limit lower='-1e16' upper='1e16' effort='0' velocity='0'/></joint></robot>";
        let (_, tree) = read(text, &|_| None).expect("a rotor");
        let joint = &tree.joints()[0];
        assert_eq!((joint.kind, joint.lower, joint.upper, joint.max_effort), (JointKind::Continuous, None, None, None));
        assert_eq!(joint.axis, Vector3::z_axis());
    }
}
