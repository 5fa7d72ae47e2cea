//! omni-sim
pub mod bvh;
pub mod encoder;
pub mod equirect;
pub mod imu;
pub mod lidar;
pub mod lookalike;
pub mod mesh;
pub mod motion;
pub mod noise;
pub mod panorama;
pub mod region;
pub mod render;
pub mod segmenter;
pub mod track;
pub mod world;
