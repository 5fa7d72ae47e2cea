//! Raw LiDAR scans, motor angles, inertial samples and segmented panoramas go in; the body's motion, deskewed scans,
//! labelled points, observations of objects, the pose between two scans and the place in a known map come out.
//!
//! # The problem
//! ```text
//! x = argmin |x - x_imu|_P^2 + sum_i w_i (n_i . (R q_i + p) - d_i)^2    motion    FAST-LIO2 Eq. 14
//! P_i = T_wb(t_i) T_bl(angle(t_i)) P_raw                     deskew             OmniVLN Eq. 1
//! theta = atan2(y, x), phi = atan2(z, hypot(x, y))           direction          OmniVLN Eq. 2
//! u = W/2 (1 - theta/pi), v = H (phi_top - phi) / span       pixel              OmniVLN Eq. 3
//! L(o) = argmax_l sum_t I(label of o in frame t = l)         majority vote      OmniVLN Eq. 4
//! ```
//! | paper | here | unit |
//! | --- | --- | --- |
//! | x | [`odometry::state::ImuState`], [`OdometryEstimate`] | m, rad, s |
//! | n, d | [`odometry::voxel_map::Cell::plane`] | m |
//! | T_wb | [`Trajectory::world_from_body`] | m, rad |
//! | T_bc (of the LiDAR) | [`RotatingMount::body_from_sensor`] | m, rad |
//! | (u, v), W, H | [`Pixel`], [`Equirectangular`] | pixels |
//! | other lenses | [`Camera`], [`Stitcher`] | |
//! | M_t | [`MaskedPanorama`] | |
//! | L_p | [`LabelTransfer::mask_of_point`] | index of a mask |
//! | L(o) | [`LabelVote::result`] | |
//!
//! # Example
//! ```
//! use nalgebra::{Isometry3, Point3};
//! use omni_perception::*;
//! let camera = Equirectangular::default();
//! // A thing of 30 x 30 pixels straight ahead, and its mask.
//! let rows: Vec<bool> = (0..640 * 1920).map(|i| (940..970).contains(&(i % 1920)) && (310..340).contains(&(i / 1920))).collect();
//! let rle = Rle::from_rows(1920, 640, &rows)?;
//! let mask = Mask::new(rle, "mug", 0.9);
//! let panorama = MaskedPanorama { masks: vec![mask], ..Default::default() };
//! // Points on the thing at 2 m and on the wall behind it.
//! let on = |v: u32, range: f64| Point3::from(camera.unproject(955.5, f64::from(v)).into_inner() * range).cast::<f32>();
//! let points: Vec<Point3<f32>> = (315..335).flat_map(|v| [on(v, 2.0), on(v, 3.0)]).collect();
//! let things = observe_objects(&panorama, &points, &Isometry3::identity(), &camera, &ObservationConfig::default());
//! assert_eq!((things.len(), things[0].points_in_world.len()), (1, 20));
//! # Ok::<(), RleError>(())
//! ```
//!
//! # How it works
//! 0. [`LidarInertialOdometry`]: an iterated Kalman filter on the manifold over the IMU and the planes of a hashed map, from
//!    rest or in motion, with a status that says how far to trust it ([`odometry`] is written to be read).
//! 1. [`Trajectory`]: a smooth curve through odometry knots, position and rotation at any time ([`trajectory`]).
//! 2. [`deskew()`]: each point goes through the mount at the motor's angle at its own time ([`encoder`]) and the pose
//!    at its own time to one reference time (Eq. 1).
//! 3. [`Equirectangular`]: the panorama (Eq. 2, 3), or a [`Stitcher`] that makes it of the lenses of a [`camera`] rig
//!    ([`stitch`]); [`Rle`]: COCO masks (counts, string, polygons), looked up without expanding them; [`LabelNames`]: one name
//!    for one kind of thing.
//! 4. [`transfer_labels`]: erosion of the masks, a range buffer for what the camera cannot see, and of each thing the
//!    near mode, so that the wall behind a thing does not become part of it ([`label_transfer`]).
//! 5. [`observe_panorama`]: points, names, colour, video number and weight of each thing; [`LabelVote`]: the vote over
//!    frames (Eq. 4). [`visible_points`]: the range buffer alone.
//! 6. [`MoverTracker`]: who walks where the map has nothing, and what an image calls them ([`mover_tracker`]).
//! 7. [`register`]: the pose between two scans, from a guess ([`registration`]); [`localise()`]: the place of a few scans in a
//!    known map, without any ([`localisation`]).
//!
//! # Conventions
//! Frames are named `target_from_source`; world z up, body and camera x forward, y left, z up. The result of a deskew
//! stands at its reference time and carries that pose. The odometry's world is level, its origin is the body's first pose.
//! Noise parameters are continuous densities. Times are [`Stamp`]s from the data; there is no pose outside
//! the knots. Points that are not finite are skipped and counted. Where masks overlap, one
//! inside another is on top of it, else the one with the higher score. Same input, same bytes. Empty input gives empty output.
//!
//! # What it does not do
//! It does not close loops (the odometry's map forgets, and is never moved), calibrate the mount or the clocks, run a
//! segmenter, associate things that stand over time, or keep a map for anyone but the odometry.
//!
//! # References
//! - Xu, Cai, He, Lin, Zhang, "FAST-LIO2: Fast Direct LiDAR-Inertial Odometry", T-RO 2022 (filter, deskew on knots).
//! - Yuan et al., "Efficient and Probabilistic Adaptive Voxel Mapping", RA-L 2022 (planes kept in voxels).
//! - Zhang, Kaess, Singh, "On Degeneracy of Optimization-based State Estimation Problems", ICRA 2016.
//! - Zhu, Ren, Zhang, "Robust Real-time LiDAR-inertial Initialization", IROS 2022 (start in motion).
//! - Segal, Haehnel, Thrun, "Generalized-ICP", RSS 2009 (registration).
//! - Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016 (branch and bound over a pyramid).
//! - Lin et al., COCO, pycocotools `maskApi.c` (run-length encoding).

pub mod camera;
pub mod deskew;
pub mod encoder;
pub mod equirectangular;
mod fast_projection;
pub mod label_names;
pub mod label_transfer;
pub mod localisation;
pub mod mask;
mod mask_group;
mod mask_index;
mod mask_order;
mod mask_outline;
mod motion_table;
pub mod mover_tracker;
mod near_mode;
pub mod observation;
pub mod odometry;
mod polygon;
mod range_buffer;
pub mod registration;
pub mod rle;
pub mod sensors;
pub mod so3;
pub mod stamp;
pub mod stitch;
pub mod trajectory;
mod vector_loops;
pub mod visibility;
pub mod vote;

pub use camera::{Camera, Domain, Intrinsics, camera_from_optical};
pub use deskew::{DeskewConfig, DeskewError, DeskewedScan, Dropped, ReferenceTime, deskew, deskew_exactly};
pub use encoder::{EncoderError, EncoderSample, EncoderTrack};
pub use equirectangular::{CameraError, Equirectangular, Pixel, pixel_as_printed};
pub use label_names::{LabelNames, LabelTableError, UNKNOWN};
pub use label_transfer::{LabelConfig, LabelError, LabelReport, LabelTransfer, label_points, transfer_labels};
pub use localisation::{Candidate, KnownPlace, LocalisationConfig, LocalisationError, Look, Verdict, judge, localise};
pub use mask::{Mask, MaskedPanorama, RgbImage};
pub use mover_tracker::{MoverBody, MoverConfig, MoverTrack, MoverTracker};
pub use observation::{ObjectObservation, ObservationConfig, Observations, observe_objects, observe_panorama};
pub use odometry::config::{LioConfig, LioConfigError};
pub use odometry::inertial::ImuFault;
pub use odometry::report::{ScanFault, ScanReport};
pub use odometry::voxel_map::{MapFileError, VoxelMap};
pub use odometry::{LidarInertialOdometry, OdometryEstimate, TrackingStatus};
pub use registration::{
    Cloud, Fit, Freedom, Registration, RegistrationConfig, RegistrationError, Surface, align, fit, register,
};
pub use rle::{Rle, RleError, Span};
pub use sensors::{ImuSample, RawPoint, RawScan, RotatingMount};
pub use stamp::Stamp;
pub use stitch::{Gain, Lens, LensPixel, StitchConfig, StitchError, Stitcher, stitch_plainly};
pub use trajectory::{Trajectory, TrajectoryError};
pub use visibility::{Visibility, visible_points};
pub use vote::{LabelVote, VoteResult};
