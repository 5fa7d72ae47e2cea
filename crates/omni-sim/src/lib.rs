//! Buildings that never existed, and robots that see, move and collide in them: a seed goes in; LiDAR scans, encoder and
//! IMU samples, panoramas with segmented masks and contacts come out, together with the truth about all of it.
//!
//! # The problem
//! A robot's software can be trusted only after thousands of runs in places it has never seen, with sensors as bad as real
//! ones, and with somebody who knows the truth. Everything a robot senses here is one motion seen through different
//! eyes: a body at `T(t) = (p(t), R(t))`, twice differentiable,
//! ```text
//! LiDAR ray i     q_i = (T(t_i) B Rz(a(t_i)) S)^-1 * first hit of the ray cast at its own time t_i     + noise
//! gyroscope       w_m = C^T w                                                                 + bias + noise
//! accelerometer   f_m = C^T (R^T (p'' - g) + w' x r + w x (w x r))                            + bias + noise
//! panorama        u = W/2 (1 - theta/pi),   v = H (phi_top - phi)/(phi_top - phi_bottom)
//! rotor           k w^2 along its axis, dw/dt = (w_cmd - w)/tau;   m v' = sum R f - R D R^T v + m g + contacts
//! ```
//! | symbol | in code | unit |
//! |---|---|---|
//! | `T(t)`, `p''`, `w`, `w'` | [`motion::KinematicState`] | m, m/s^2, rad/s, rad/s^2 |
//! | `B`, `S`, `a(t)` | [`lidar::RotatingMount`] `body_from_stator`, `rotor_from_sensor`, `angle_rad` | m, rad |
//! | `C`, `r` | rotation and translation of `body_from_imu` | m |
//! | `theta`, `phi` | [`equirect::Equirect`] | rad |
//! | `k`, `tau`, `D` | [`quadrotor::RotorConfig`], [`quadrotor::QuadrotorConfig`] `drag_ns_per_m` | N s^2, s, N s/m |
//!
//! # Example
//! A base walks half a second towards the wall of a generated flat and looks around:
//! ```
//! use nalgebra::Isometry3;
//! use omni_sim::ground_base::{GroundBase, GroundBaseConfig, VelocityCommand};
//! use omni_sim::lidar::{LidarConfig, RotatingMount, scan};
//! use omni_sim::{scenes::named_scene, world::World};
//!
//! let building = named_scene("flat").expect("the scene exists");
//! let world = World::of_building(&building)?;
//! let start = building.rooms[0].center();
//! let mut base = GroundBase::new(GroundBaseConfig::default(), 0, (start.x, start.y, 0.0), 0.0)?;
//! base.step(0.5, &VelocityCommand { forward_mps: 0.5, ..Default::default() }, None)?;
//! let mount = RotatingMount::rotating(Isometry3::translation(0.0, 0.0, 0.3));
//! let record = scan(&world, base.track(), &mount, &LidarConfig::default(), 300_000_000)?;
//! assert!(record.points.len() > 30_000); // indoors nearly each of the 32 x 1024 rays comes back
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How it works
//! 1. Buildings: [`generator`] (see the README for its steps); the truth about one is [`building::Building`].
//! 2. [`world::World`] puts the triangles into a tree of boxes ([`bvh`]) and answers rays at any time, movers included.
//! 3. [`track::MotionTrack`] is a motion of pieces with constant jerk: exact derivatives at any time.
//!    [`ground_base`] and [`quadrotor`] make one from commands, [`towed`] from told poses; [`contact`] tells them, by rapier, what
//!    they run into. [`articulated`] is for robots that could fall: bodies on motors, stepped by rapier.
//! 4. [`lidar`], [`encoder`] and [`imu`] sample the motion.
//! 5. [`panorama`] and [`fisheye`] render ([`render`]: few rays, subdivided) and have the picture segmented ([`segmenter`], [`region`]) with
//!    errors that hang together over time and view.
//! 6. All noise comes from [`noise`]: random numbers by address, not by order.
//!
//! # Conventions
//! World and body: z up, body x forward, y left; metres, seconds, radians, stamps in nanoseconds. Points of a scan come by
//! time and ring, masks by their first pixel, contacts by depth. The same input gives the same bytes at any number of
//! threads; renumbering the instances changes no byte of what a robot gets. Instance 0 is the structure. Instances, true
//! poses and biases are in no record. Empty worlds give empty scans; NaN and infinity are refused with typed errors
//! ([`world::World::ray`] answers `None`).
//!
//! # What it does not do
//! No soft things, no water or glass (windows are opaque), no rolling shutter in the panorama, no multipath. The ground robot's
//! base has no legs: its trunk moves as a gait would move it ([`articulated`] stands on legs, on a flat floor only). Contacts push robots,
//! not things.
//!
//! # References
//! - I. Wald, On fast construction of SAH-based bounding volume hierarchies, 2007. T. Moeller, B. Trumbore, Fast minimum
//!   storage ray/triangle intersection, 1997. T. Ize, Robust BVH ray traversal, 2013.
//! - J. Warnock, A hidden surface algorithm for computer generated halftone pictures, 1969.
//! - G. Steele, D. Lea, C. Flood, Fast splittable pseudorandom number generators, 2014.

pub mod articulated;
pub mod building;
pub mod bvh;
pub mod caption;
pub mod catalog;
pub mod colors;
pub mod contact;
pub mod cooccurrence;
pub mod crowd;
pub mod door_leaves;
pub mod doors;
pub mod earlier;
pub mod encoder;
pub mod equirect;
pub mod fisheye;
pub mod fitness;
pub mod floor;
pub mod floorplan;
pub mod furniture;
pub mod generator;
pub mod ground_base;
pub mod imported;
pub mod imu;
pub mod item;
pub mod lidar;
pub mod mesh;
pub mod mesh_name;
pub mod models;
pub mod motion;
pub mod movers;
pub mod noise;
pub mod panorama;
pub mod passage;
pub mod person;
pub mod placement;
pub mod plan_image;
pub mod plan_rooms;
pub mod program;
pub mod quadrotor;
pub mod region;
pub mod render;
pub mod scenes;
pub mod segmenter;
pub mod shape;
pub mod skeleton;
pub mod small_things;
pub mod stairs;
pub mod touch;
pub mod towed;
pub mod track;
pub mod truth_relations;
pub mod variations;
pub mod viewing;
pub mod walls;
pub mod world;
