//! A URDF, and a small TOML for what a URDF cannot carry, in; envelope, inertia, limits, sensor frames and kinematics out.
//!
//! # The problem
//!
//! A planner must know how wide a robot is, a controller how heavy, a projection where the camera sits. Written into code these
//! numbers make a program for one robot. Here they come from the robot's own description, so that another file is another robot.
//!
//! ```text
//! root_from_child = root_from_parent * parent_from_joint * motion(q)          forward kinematics
//! m = sum m_i     c = sum m_i c_i / m     I = sum I_i + m_i (|d_i|^2 E - d_i d_i^T),  d_i = c_i - c
//! footprint = convex hull of { (x, y) of p : p in some collision shape, rotors and wheels swept a full turn }
//! ```
//!
//! | symbol | name in code | unit |
//! |---|---|---|
//! | q | `stance`, or the angles given to [`RobotModel::frames_at`] | rad, m |
//! | m, c, I | `mass_kg`, `center_of_mass`, `inertia` | kg, m, kg m^2 |
//! | k, k_m | `thrust_coefficient_n_s2`, `moment_ratio_m` of a [`Rotor`] | N s^2, m |
//!
//! # Example
//!
//! ```
//! use robot_model::RobotModel;
//!
//! let urdf = r#"<robot name="cart">
//!   <link name="base">
//!     <inertial><mass value="12"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
//!     <collision><geometry><box size="0.6 0.4 0.2"/></geometry></collision>
//!   </link>
//! </robot>"#;
//! // Without a TOML the robot is refused with a sentence that names every missing key.
//! let refusal = RobotModel::parse(urdf, "kind = 'ground'", &|_mesh| None).unwrap_err();
//! assert!(refusal.to_string().contains("limits.max_speed_mps, limits.max_lateral_speed_mps"));
//!
//! let quadruped = RobotModel::builtin_quadruped();
//! let camera_height_m = quadruped.stance_height_m + quadruped.sensors.body_from_camera.translation.z;
//! assert!((camera_height_m - 0.73).abs() < 0.01);
//! ```
//!
//! # How it works
//!
//! 1. The text is cleaned: only what a kinematic tree is made of passes, once.
//! 2. [`urdf`] decodes links and joints, reads collision meshes ([`mesh`]) through the caller's closure, checks masses ([`inertia`]).
//! 3. [`tree`] checks that it is one tree, and gives the pose of every link at any joint angles. [`merge`] makes one body of links
//!    that are fixed to each other.
//! 4. [`description`] reads the TOML against the tree and lists every missing key at once.
//! 5. [`envelope`] sweeps rotors and wheels ([`shape`]) and takes footprint, radii and height span of all shapes.
//! 6. [`sensors`] and [`leg`] place the LiDAR, IMU and camera and solve three-joint legs. [`RobotModel::parse`] is the whole in order.
//! 7. [`gait`] moves the legs along with a base that moves: footholds after Raibert, feet that stand still while they stand.
//!
//! # The TOML
//!
//! ```toml
//! kind = "aerial"                      # or "ground"
//! [limits]                             # both kinds: speed, yaw rate, acceleration, yaw acceleration
//! max_speed_mps = 2.0
//! max_yaw_rate_radps = 1.2
//! max_accel_mps2 = 2.5
//! max_yaw_accel_radps2 = 3.0
//! max_climb_mps = 1.0                  # air only; ground: max_lateral_speed_mps, max_reverse_speed_mps
//! max_tilt_rad = 0.5                   # air only
//! [stance]                             # an angle for every joint with limits: FL_hip_joint = 0.0
//! [sensors.lidar]                      # a link of the URDF, or a pose relative to one where no such link exists
//! link = "base_link"
//! xyz_m = [0.0, 0.0, 0.06]             # optional, as is rpy_rad
//! sensor_offset_m = [0.0, 0.0, 0.04]   # optional: from the motor to the optical centre
//! rotation_hz = 0.5                    # 0: fixed
//! tilt_rad = 0.52
//! [sensors.imu]
//! link = "imu_link"
//! [sensors.camera]
//! link = "base_link"
//! xyz_m = [0.0, 0.0, 0.19]
//! [rotor]                              # air only, as are [[rotors]] and [drag]
//! thrust_coefficient_n_s2 = 8.54858e-6
//! moment_ratio_m = 0.016
//! max_speed_radps = 1000.0
//! time_constant_up_s = 0.0125
//! time_constant_down_s = 0.025
//! [[rotors]]                           # one for each rotor
//! link = "rotor_0"
//! direction = "ccw"                    # seen from above
//! radius_m = 0.127                     # optional: what the shapes of the link sweep
//! [drag]
//! linear_n_s_per_m = [0.25, 0.25, 0.12]
//! [[payload]]                          # optional: things bolted on that the URDF does not know
//! name = "mast"
//! link = "base_link"
//! xyz_m = [0.0, 0.0, 0.1]
//! shape = { cylinder = { radius_m = 0.04, length_m = 0.2 } }    # or box = { box_m = [..] }, sphere = { radius_m = .. }
//! mass_kg = 0.3
//! # [[legs]] (optional): name = "FL", joints = [hip, thigh, calf], foot = "FL_foot"
//! ```
//!
//! # Conventions
//!
//! Body frame: the root link, x forward, y left, z up; SI units and radians. Lists of angles are in the order of
//! [`KinematicTree::moving_joints`]. Links without mass or shape keep their frames. A limit of 1e10 or more means none. Bounds,
//! masses and poses are exact; round shapes enter the footprint as polygons round them, at most 0.5 % of their radius outside. The
//! same texts give the same model, byte for byte; nothing is read but the two texts and what the closure returns.
//!
//! # What it does not do
//!
//! No xacro (expand it first), no visuals, no COLLADA meshes, no mimic, floating, planar or spherical joints: each is refused with
//! its name. A collision mesh stands for its convex hull. It opens no file: [`mesh_candidates`] says where a mesh may lie.
//!
//! # References
//!
//! URDF: <http://wiki.ros.org/urdf/XML>. Parallel axis theorem and triangle inequality of principal moments: any text on rigid bodies.
//! A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions", Information Processing Letters 9(5), 1979.

pub mod builtin;
pub mod description;
pub mod envelope;
pub mod error;
pub mod gait;
pub mod inertia;
mod keys;
pub mod leg;
pub mod merge;
pub mod mesh;
pub mod model;
mod sanitise;
pub mod sensors;
pub mod shape;
pub mod tree;
pub mod urdf;

pub use builtin::{builtin_toml, quadrotor_texts, quadruped_texts};
pub use description::{MotionLimits, RobotKind};
pub use error::ModelError;
pub use gait::{BaseMotion, Foot, Gait, GaitConfig, GaitError};
pub use inertia::MassProperties;
pub use leg::Leg;
pub use merge::{MergedBody, merged_bodies};
pub use mesh::mesh_candidates;
pub use model::{RobotModel, Rotor};
pub use sensors::{LidarMotor, SensorMounts};
pub use shape::{CollisionShape, Geometry};
pub use tree::{AnglesError, Joint, JointKind, KinematicTree, Link};
pub use urdf::robot_name;
