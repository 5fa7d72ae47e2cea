//! dsg
pub mod agent;
mod apply;
pub mod bounds;
pub mod graph;
pub mod group;
pub mod ids;
pub mod invariants;
pub mod memory;
pub mod object;
pub mod op;
pub mod place;
pub mod relation;
pub mod room;
pub mod vote;

pub use agent::{Agent, AgentPose};
pub use bounds::Aabb;
pub use graph::SceneGraph;
pub use group::Group;
pub use ids::{AgentId, BuildingId, GroupId, ObjectId, PlaceId, RoomId};
pub use invariants::InvariantError;
pub use object::Object;
pub use op::{Change, ConfigError, Event, LoggedEvent, Op, OpError};
pub use place::{Place, PlaceEdge};
pub use relation::{Evidence, EvidenceSource, Relation, RelationKind, Verdict};
pub use room::{Building, Room, RoomEdge, Storey};
