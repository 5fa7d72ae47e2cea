//! The robot's side of a mission: one sensor stream in, one command sink out, the closed loop between.
//!
//! ```text
//! source (simulator | bag | live robot) --SensorEvent--> Mission --Command--> sink (simulator | PX4 | Unitree)
//! ```
//!
//! [`cycle`] is the reading file: perceive, abstract, reason, verify, plan, move, in the order of the paper's system figure. This crate wires the
//! independent crates of the house together and holds what only makes sense for a robot that has all of them. It does not know the
//! simulator: the truth cannot reach it, for it does not compile.

pub mod ablation;
pub mod acting;
mod air_checks;
pub mod alignment;
pub mod approach;
pub mod archive;
pub mod asking;
pub mod autopilot;
pub mod blind_spot;
pub mod body;
pub mod chat_stream;
pub mod closed_air;
pub mod config;
pub mod coverage;
pub mod cycle;
pub mod drive;
pub mod emergency;
pub mod error;
pub mod event_log;
pub mod flanks;
pub mod flight_limits;
pub mod fly;
pub mod gain;
pub mod goal;
pub mod graph_builder;
pub mod http_post;
pub mod journal;
pub mod link;
pub mod llm_reasoner;
pub mod localisation;
pub mod look_round;
pub mod map_frame;
pub mod mapping_run;
pub mod mission;
pub mod movers;
pub mod navigation;
pub mod odometer;
pub mod odometry_run;
pub mod offering;
pub mod openai;
pub mod overhead;
pub mod people;
pub mod perspective_crop;
pub mod posed_scans;
pub mod px4;
pub mod reach;
pub mod reasoning;
pub mod recording;
pub mod relation_question;
pub mod relation_verifier;
mod returning;
pub mod rig;
pub mod rooms;
pub mod route_plan;
#[cfg(test)]
mod same_mind;
pub mod scan_queue;
pub mod segmentation_files;
pub mod segmented;
pub mod segmenter;
pub mod segmenter_folder;
pub mod segmenter_http;
pub mod snapshot;
pub mod stage_clock;
mod standstill;
pub mod steering;
pub mod stream;
#[cfg(test)]
mod test_events;
pub mod time_histogram;
pub mod tum;
#[cfg(feature = "unitree")]
pub mod unitree;
pub mod vision_config;
pub mod vision_verifier;
pub mod world_model;
pub mod zones;

// The parts, for those who hold a mission: the arena and the toolbox see the crates of the robot's side only through it.
pub use dsg;
pub use octant_prompt;
pub use omni_perception;
pub use planner;
pub use robot_link;
pub use robot_model;
pub use topo_ph;
pub use volumetric_map;
