//! The world's side of a mission: the simulator, the referee, the figures and the run folder.
//!
//! A run is [`run::run`]: it puts a robot into a scene, lets the mission see and command, and judges from the truth what came of it.
//! [`record::record`] takes a robot on a tour instead and leaves a bag of ROS 2 with masks, truth and tasks.
//! The mission cannot see this crate, so nothing true can leak into what the robot knows except through its sensors.

pub mod arms;
pub mod bench_arms;
pub mod bench_coverage;
pub mod bench_map;
pub mod bench_nav;
pub mod body;
pub mod building_ply;
pub mod buildings;
pub mod chart;
pub mod cli;
pub mod dataset;
pub mod drift;
pub mod estimate_frame;
pub mod flight_options;
pub mod frame;
pub mod instructions;
pub mod intervals;
pub mod known_building;
pub mod lab_survey;
pub mod legs;
pub mod map_picture;
pub mod map_score;
pub mod name_color;
pub mod options;
pub mod orders;
pub mod patrol;
pub mod people;
pub mod pilot;
pub mod plan_file;
pub mod progress;
pub mod px4_vehicle;
pub mod quantile;
pub mod real_time;
pub mod record;
pub mod record_topics;
pub mod record_truth;
pub mod referee;
pub mod report;
pub mod rule;
pub mod run;
pub mod run_folder;
pub mod run_setup;
pub mod say;
pub mod scenario;
pub mod scene_error;
pub mod scene_file;
pub mod scene_gltf;
pub mod scene_obj;
pub mod simulation;
pub mod summary;
pub mod surround;
pub mod survey;
pub mod task;
pub mod tour;
pub mod toured_scene;
pub mod trot;
pub mod truth_folder;
#[cfg(feature = "unitree")]
pub mod unitree_vehicle;
pub mod vehicle;
pub mod verdict;
#[cfg(feature = "viz")]
pub mod viz;
pub mod whole_file;
pub mod workers;
pub mod write_run;
pub mod zone_watch;

pub use mission;
pub use omni_sim;
