//! Everything that can be wrong with a robot description, said so that its author finds the place.

use crate::inertia::InertiaFault;
use crate::mesh::MeshFault;

/// Why a robot was refused. Each message names the element or the key to look at.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The URDF text is larger than any robot needs.
    #[error("the URDF has {bytes} bytes; more than {limit} are not read")]
    TooLarge {
        /// Size of the text.
        bytes: usize,
        /// Largest accepted size.
        limit: usize,
    },
    /// The text is not well-formed XML.
    #[error("URDF line {line}: not well-formed XML (an element is not closed, or a tag or attribute is broken)")]
    Markup {
        /// Line of the text, from 1.
        line: usize,
    },
    /// The text has no `<robot>` element at its top.
    #[error("the URDF has no <robot> element")]
    NoRobotElement,
    /// A xacro element is left in the text.
    #[error("URDF line {line}: <{element}> is a xacro element; expand the file first (`xacro in.xacro > out.urdf`)")]
    UnexpandedXacro {
        /// Line of the text, from 1.
        line: usize,
        /// Name of the element.
        element: String,
    },
    /// An element lacks a required part, or a number in it cannot be read.
    #[error("URDF line {line}: {element} cannot be read: {detail}")]
    UnreadableElement {
        /// `link NAME` or `joint NAME`.
        element: String,
        /// Line of the text, from 1.
        line: usize,
        /// What the reader said.
        detail: String,
    },
    /// Two links or two joints have the same name.
    #[error("{element} is defined twice")]
    DuplicateName {
        /// `link NAME` or `joint NAME`.
        element: String,
    },
    /// The robot has no link.
    #[error("the robot has no link")]
    NoLinks,
    /// The robot has more links than are read.
    #[error("the robot has {links} links; more than {limit} are not read")]
    TooManyLinks {
        /// Number of links.
        links: usize,
        /// Largest accepted number.
        limit: usize,
    },
    /// A joint names a link that does not exist.
    #[error("joint `{joint}` names the link `{link}`, which does not exist")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The missing link.
        link: String,
    },
    /// A link is the child of two joints.
    #[error("link `{link}` has two parents: joints `{first}` and `{second}`")]
    TwoParents {
        /// The link.
        link: String,
        /// One joint.
        first: String,
        /// The other joint.
        second: String,
    },
    /// The joints form a loop.
    #[error("the joints form a cycle through link `{link}`")]
    Cycle {
        /// A link on the loop.
        link: String,
    },
    /// More than one link has no parent.
    #[error("the robot has two roots: links `{first}` and `{second}` have no parent joint")]
    SeveralRoots {
        /// One root.
        first: String,
        /// Another root.
        second: String,
    },
    /// A joint type that a walking or flying robot model has no use for here.
    #[error("joint `{joint}`: joints of type {kind} are not supported (fixed, revolute, continuous and prismatic are)")]
    UnsupportedJoint {
        /// The joint.
        joint: String,
        /// Its type, or `mimic`.
        kind: &'static str,
    },
    /// A number of an element is NaN or infinite.
    #[error("{element} has a number that is not finite")]
    NotFinite {
        /// `link NAME` or `joint NAME`.
        element: String,
    },
    /// A moving joint has the zero vector as its axis.
    #[error("joint `{joint}` moves but its axis is zero")]
    ZeroAxis {
        /// The joint.
        joint: String,
    },
    /// The lower limit is above the upper one.
    #[error("joint `{joint}`: its lower limit {lower} is above its upper limit {upper}")]
    CrossedLimits {
        /// The joint.
        joint: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// A collision shape has a negative or zero size.
    #[error("link `{link}`: a collision {shape} has a size that is not positive")]
    BadShape {
        /// The link.
        link: String,
        /// `box`, `cylinder`, `capsule`, `sphere` or `mesh`.
        shape: &'static str,
    },
    /// A link has impossible mass properties.
    #[error("link `{link}`: <inertial> {fault}")]
    Inertia {
        /// The link.
        link: String,
        /// What is wrong.
        fault: InertiaFault,
    },
    /// The mesh of a collision shape was not found.
    #[error("link `{link}`: collision mesh `{file}` was not found")]
    MissingMesh {
        /// The link.
        link: String,
        /// File name as the URDF gives it.
        file: String,
    },
    /// The mesh of a collision shape cannot be read.
    #[error("link `{link}`: collision mesh `{file}` {fault}")]
    BadMesh {
        /// The link.
        link: String,
        /// File name as the URDF gives it.
        file: String,
        /// What is wrong.
        fault: MeshFault,
    },
    /// No link has any mass.
    #[error("the robot has no mass: no <inertial> element has a positive mass")]
    NoMass,
    /// No link has a collision shape, so the robot has no size.
    #[error("the robot has no collision shape, so its size is unknown")]
    NoCollisionShape,
    /// The TOML text is not valid, or has a key or type that does not belong there.
    #[error("robot TOML line {line}: {detail}")]
    Toml {
        /// Line of the text, from 1.
        line: usize,
        /// What the reader said.
        detail: String,
    },
    /// What a URDF cannot carry is not in the TOML.
    #[error("the TOML of robot `{robot}` lacks {}: a URDF cannot carry these, so write them into a TOML beside the URDF file", keys.join(", "))]
    MissingKeys {
        /// Name of the robot.
        robot: String,
        /// All keys that are missing, with their tables.
        keys: Vec<String>,
    },
    /// A value of the TOML is outside its range.
    #[error("robot TOML: `{key}` must be {expected}")]
    OutOfRange {
        /// The key, with its table.
        key: String,
        /// The range in words.
        expected: &'static str,
    },
    /// The TOML names a link that the URDF does not have.
    #[error("robot TOML: `{key}` names the link `{link}`, which the URDF does not have")]
    UnknownFrame {
        /// The key, with its table.
        key: String,
        /// The missing link.
        link: String,
    },
    /// The TOML names a joint that the URDF does not have or that does not move.
    #[error("robot TOML: `{key}` names the joint `{joint}`, which the URDF does not have as a moving joint")]
    UnknownJoint {
        /// The key, with its table.
        key: String,
        /// The joint.
        joint: String,
    },
    /// A stance angle is outside the limits of its joint.
    #[error("robot TOML: `stance.{joint}` = {angle} is outside the limits of the joint, [{lower}, {upper}]")]
    StanceOutsideLimits {
        /// The joint.
        joint: String,
        /// The angle given.
        angle: f64,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// The rotors cannot lift the robot.
    #[error("the rotors lift {thrust_n:.2} N at full speed, the robot weighs {weight_n:.2} N: it cannot hover")]
    CannotHover {
        /// Sum of the largest thrusts.
        thrust_n: f64,
        /// Weight.
        weight_n: f64,
    },
}
