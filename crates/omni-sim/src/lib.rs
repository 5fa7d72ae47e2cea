//! omni-sim
pub mod bvh;
pub mod mesh;
pub mod motion;
pub mod noise;
pub mod track;
pub mod world;
