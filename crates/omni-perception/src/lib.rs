//! omni-perception
pub mod deskew;
pub mod encoder;
pub mod equirectangular;
mod fast_projection;
pub mod label_transfer;
pub mod mask;
mod mask_group;
mod mask_index;
mod motion_table;
mod near_mode;
pub mod observation;
pub mod odometry;
mod range_buffer;
pub mod rle;
pub mod sensors;
pub mod so3;
pub mod stamp;
pub mod trajectory;
pub mod vote;

pub use deskew::{
    DeskewConfig, DeskewError, DeskewedScan, Dropped, ReferenceTime, deskew, deskew_exactly,
};
pub use encoder::{EncoderError, EncoderSample, EncoderTrack};
pub use equirectangular::{CameraError, Equirectangular, Pixel, pixel_as_printed};
pub use label_transfer::{
    LabelConfig, LabelError, LabelReport, LabelTransfer, label_points, transfer_labels,
};
pub use mask::{Mask, MaskedPanorama, RgbImage};
pub use observation::{
    ObjectObservation, ObservationConfig, Observations, observe_objects, observe_panorama,
};
pub use odometry::{OdometryEstimate, TrackingStatus};
pub use rle::{Rle, RleError, Span};
pub use sensors::{ImuSample, RawPoint, RawScan, RotatingMount};
pub use stamp::Stamp;
pub use trajectory::{Trajectory, TrajectoryError};
pub use vote::{LabelVote, VoteResult};
