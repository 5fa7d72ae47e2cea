//! Observations, places and parts of free space go in; a five-layer dynamic scene graph comes out: mesh, objects, places,
//! rooms, building, with verified relations, functional groups, a log of every change, and files.
//!
//! # The problem
//! ```text
//! G = (V, E)             five layers: L1 mesh, L2 objects, L3 places, L4 rooms, L5 building
//! L(o) = argmax_l  sum_t  [label of o in frame t is l]                          (Eq. 4)
//! e_ij falls if some point of line(p_i, p_j) is closer than eps to the map      (Eq. 6)
//! e_ij, if short, holds if VLM(image, labels of i and j) > tau                  (Eq. 7)
//! ```
//! | paper | here | unit |
//! |---|---|---|
//! | L1, P_map | opaque PLY bytes beside the graph ([`folder`]); the closure `line_of_sight` | m |
//! | o_j, p_j, L(o_j) | [`Object`], `centroid`, `label` with `votes` and `label_margin` | m |
//! | v in G_P, R(v) | [`Place`], `clearance_m` | m |
//! | V_room | [`Room`], [`RoomEdge`] | |
//! | e_ij | [`Relation`] with its [`Evidence`] | |
//! | tau_vlm | [`RelationConfig::verify_threshold`] | |
//!
//! # Example
//! ```
//! use dsg::*;
//! use nalgebra::Point3;
//!
//! // Three frames of one thing, one of them mislabelled.
//! let frame = |stamp_ns: i64, label: &str| ObjectEvidence {
//!     stamp_ns,
//!     label_weights: vec![(label.to_owned(), 1.0)],
//!     caption: format!("a red {label}"),
//!     score: 0.9,
//!     points: (0..30).map(|i| Point3::new(1.0 + 0.01 * (i % 10) as f32, 2.0, 0.8 + 0.03 * (i / 10) as f32)).collect(),
//!     color: None,
//!     track: None,
//! };
//! let mut graph = SceneGraph::new();
//! for (t, label) in ["mug", "vase", "mug"].into_iter().enumerate() {
//!     observe_objects(&mut graph, &[frame(t as i64, label)], &AssociationConfig::default())?;
//! }
//! let mug = graph.objects().next().expect("one object");
//! assert_eq!((graph.objects().count(), mug.label.as_str(), mug.observations), (1, "mug", 3));
//! assert_eq!(mug.attributes["color"], "red");
//! assert_eq!(graph.revision(), 3);
//! # Ok::<(), OpError>(())
//! ```
//!
//! # How it works
//! 1. Every change is an [`Op`] through [`SceneGraph::apply`]: whole or not at all, one revision, an [`Event`] with the state
//!    of each touched node before and after. [`Event::inverse`] is the undo, [`SceneGraph::changes_since`] the news ([`op`]).
//! 2. [`observe_objects`] finds for each view of a frame the object it shows, by points first and labels second, folds it in
//!    (Eq. 4) and joins duplicates ([`observe`], [`memory`], [`duplicates`]); [`forget_ghosts`] drops what is not there.
//! 3. [`update_places`] mirrors the place graph of the map, frontiers included ([`places`]).
//! 4. [`update_rooms`] turns a partition of the places into rooms that keep their ids, names them after their contents
//!    ([`mod@room_kind`]), joins them by doorways and hangs them under a building ([`rooms`]).
//! 5. [`update_relations`] computes relations from boxes, prunes by the map (Eq. 6) and asks a verifier (Eq. 7)
//!    ([`relations`]); [`update_groups`] gathers objects that are used together ([`groups`]).
//! 6. [`folder`] saves graph.json, mesh.ply and ops.log so that a crash leaves the old or the new; [`spark`] reads and writes
//!    the graphs of others without loss, [`mod@open`] takes any file, whole or damaged, [`mod@diff`] compares two;
//!    [`scene_graph_text`] and [`scene_objects_json`] are for language models and people.
//! 7. [`correct_poses`] moves everything by a corrected trajectory ([`correct`]); [`observe_movers`] follows what moves by itself
//!    ([`movers`], [`presence`]).
//!
//! # Conventions
//! World frame right-handed, z up, metres, nanoseconds. All listings ascend by id; ids are never reused; ties go to the
//! smaller id. Same input, same bytes: no hash map, no clock, no thread. An empty graph is a graph; empty evidence changes
//! nothing. NaN is refused at the door ([`OpError`], [`LoadError`]) or, in evidence, skipped and counted. The log is bounded
//! ([`SceneGraph::log_start`]).
//!
//! # What it does not do
//! It knows no voxels (the map comes in as closures), makes no partition (that is `topo-ph`), asks no model (the verifier is
//! a closure), and closes no loops (it takes the corrected trajectory).
//!
//! # References
//! OmniVLN: Omnidirectional 3D Perception and Token-Efficient LLM Reasoning for Visual-Language Navigation across Air and
//! Ground Platforms. File format of others: MIT-SPARK/Spark-DSG 1.1.3.

pub mod agent;
mod apply;
mod associate;
pub mod attributes;
pub mod bounds;
mod check;
pub mod co_occurrence;
mod contact;
pub mod correct;
pub mod diff;
pub mod duplicates;
mod edit_frame;
mod edit_objects;
mod edit_rooms;
mod faults;
pub mod file;
pub mod folder;
pub mod graph;
pub mod group;
pub mod groups;
pub mod ids;
pub mod invariants;
pub mod labels;
pub mod load;
pub mod memory;
pub mod mesh;
pub mod movers;
pub mod object;
pub mod observe;
pub mod op;
pub mod open;
pub mod oplog;
pub mod place;
pub mod places;
pub mod presence;
mod records;
pub mod relation;
pub mod relations;
pub mod room;
pub mod room_kind;
pub mod rooms;
mod scan;
mod sight;
pub mod spark;
mod splits;
mod support;
pub mod text;
pub mod vote;
mod write;

pub use agent::{Agent, AgentPose};
pub use bounds::Aabb;
pub use correct::{CorrectionError, PoseCorrection, correct_poses};
pub use diff::{Difference, diff};
pub use duplicates::forget_ghosts;
pub use file::{graph_from_json, graph_to_json};
pub use folder::{Loaded, MeshPly};
pub use graph::SceneGraph;
pub use group::Group;
pub use groups::{GroupConfig, update_groups};
pub use ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
pub use invariants::InvariantError;
pub use labels::label_similarity;
pub use load::{JsonPath, LoadError};
pub use mesh::Mesh;
pub use movers::{MoverConfig, MoverEvidence, forget_movers, observe_movers, velocity_m_s};
pub use object::Object;
pub use observe::{AssociationConfig, AssociationReport, ObjectEvidence, observe_objects};
pub use op::{Change, ConfigError, Event, LoggedEvent, Op, OpError};
pub use open::{Format, Opened, Salvaged, open, salvage};
pub use place::{Place, PlaceEdge};
pub use places::{PlaceState, PlaceUpdate, update_places};
pub use presence::{Presence, TrackPoint};
pub use relation::{Evidence, EvidenceSource, Relation, RelationKind, Verdict};
pub use relations::{RelationConfig, RelationReport, SightLine, update_relations};
pub use room::{Building, Room, RoomEdge, Storey};
pub use room_kind::room_kind;
pub use rooms::{RoomConfig, RoomPart, RoomReport, update_rooms};
pub use spark::{read_spark_dsg, write_spark_dsg};
pub use text::{scene_graph_text, scene_objects_json};
