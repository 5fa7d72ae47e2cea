//! From what the map shows to the five layers: objects when an image was labelled, the rest at every refresh.

use std::collections::BTreeMap;

use dsg::{
    Aabb, AgentId, AgentPose, AssociationConfig, GroupConfig, ObjectEvidence, Op, Place, PlaceEdge, PlaceState,
    PlaceUpdate, RelationConfig, RoomPart, SceneGraph,
};
use nalgebra::{Point3, Vector3};
use omni_perception::OdometryEstimate;
use volumetric_map::{Cell, DistanceField, LineOfSight, PlaceEvent, Volume};

use crate::ablation::{Ablation, Part};
use crate::coverage::Frontier;
use crate::goal::wrap;
use crate::relation_verifier::geometric_score;
use crate::rooms::RoomMap;
use crate::vision_verifier::VisionVerifier;

/// Frontier places are numbered from here, apart from the places of the skeleton.
const FRONTIER_BASE: u64 = 1 << 32;
/// The robot itself.
const SELF: AgentId = AgentId(0);

/// What an image shows of the plane: from where, in which direction, how wide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    /// The camera.
    pub eye: Point3<f64>,
    /// The middle of the view.
    pub heading_rad: f64,
    /// Its width; all round is a whole turn.
    pub view_rad: f64,
}

impl Sector {
    /// Whether the direction of a point is in the view.
    pub fn holds(&self, point: &Point3<f64>) -> bool {
        let way = point - self.eye;
        wrap(way.y.atan2(way.x) - self.heading_rad).abs() <= 0.5 * self.view_rad
    }
}

/// Settings and memory of the construction.
#[derive(Debug, Clone, Default)]
pub struct GraphBuilder {
    association: AssociationConfig,
    rooms: dsg::RoomConfig,
    relations: RelationConfig,
    groups: GroupConfig,
    /// Frontier places in the graph.
    frontiers: BTreeMap<dsg::PlaceId, Frontier>,
    last_pose_ns: i64,
    refusals: u64,
    without: Ablation,
}

impl GraphBuilder {
    /// Nothing built yet. `without` names the parts that an experiment leaves out.
    pub fn new(without: &Ablation) -> GraphBuilder {
        let association = AssociationConfig { counts_votes: without.keeps(Part::Vote), ..AssociationConfig::default() };
        GraphBuilder { association, without: without.clone(), ..GraphBuilder::default() }
    }

    /// How many changes the graph has refused since this was asked last. Every change is checked before anything of it is
    /// made, so a refusal leaves the graph as it was, and the next image or refresh tries again.
    pub fn take_refusals(&mut self) -> u64 {
        std::mem::take(&mut self.refusals)
    }

    fn count<T, E>(&mut self, change: Result<T, E>) {
        self.refusals += u64::from(change.is_err());
    }

    /// Takes the places of a loaded graph away: the skeleton and the frontiers of this map come anew with the first refresh.
    pub fn forget_frontiers(&mut self, graph: &mut SceneGraph) {
        let removed = graph.places().map(|place| place.id).collect();
        let change = dsg::update_places(graph, &PlaceUpdate { removed, ..PlaceUpdate::default() });
        self.count(change);
        self.frontiers.clear();
    }

    /// Layer 2: objects from one labelled image, seen from `eye`. Things that should have been in it and were not are
    /// looked at again, and forgotten after a while.
    pub fn observe(
        &mut self,
        graph: &mut SceneGraph,
        now_ns: i64,
        evidence: &[ObjectEvidence],
        view: &Sector,
        volume: &Volume,
    ) {
        const LOOK_RANGE_M: f64 = 3.5;
        let change = dsg::observe_objects(graph, evidence, &self.association);
        self.count(change);
        let looked_at = |object: &dsg::Object| -> Option<bool> {
            let eye = &view.eye;
            if (object.centroid - eye).norm() > LOOK_RANGE_M || !view.holds(&object.centroid) {
                return None;
            }
            is_visible(eye, &object.bounds, volume).then(|| is_empty(&object.bounds, volume))
        };
        let change = dsg::forget_ghosts(graph, now_ns, &looked_at, &self.association);
        self.count(change);
    }

    /// Layers 3 to 5, relations and groups. `vision` scores short relations (Eq. 7) where there is one, else geometry does.
    #[allow(clippy::too_many_arguments)] // one argument for each thing the graph is made of
    pub fn update(
        &mut self,
        graph: &mut SceneGraph,
        events: &[PlaceEvent],
        rooms: Option<&RoomMap>,
        frontiers: &[Frontier],
        field: &DistanceField,
        odometry: &OdometryEstimate,
        floor_m: f64,
        vision: Option<&mut VisionVerifier>,
    ) {
        let update = self.places_of(graph, events, frontiers, floor_m);
        let change = dsg::update_places(graph, &update);
        self.count(change);
        if let Some(map) = rooms {
            let change = self.update_rooms(graph, map, floor_m);
            self.count(change);
        }
        let (prunes, verifies) = (self.without.keeps(Part::Pruning), self.without.keeps(Part::Verify));
        let blocked = |a: &Point3<f64>, b: &Point3<f64>| match field.line_of_sight(a, b, 0.0) {
            LineOfSight::Blocked { at } if prunes => Some(at),
            _ => None,
        };
        let change = match vision {
            _ if !verifies => dsg::update_relations(graph, &blocked, &|_, _, _| 1.0, &self.relations),
            None => dsg::update_relations(graph, &blocked, &geometric_score, &self.relations),
            Some(vision) => {
                let answers = vision.settle(graph, self.relations.verify_threshold, odometry.stamp);
                if !answers.is_empty() {
                    let change = graph.apply(Op::Batch(answers));
                    self.count(change);
                }
                let score = |a: &dsg::Object, b: &dsg::Object, kind| vision.score(a, b, kind);
                dsg::update_relations(graph, &blocked, &score, &self.relations)
            }
        };
        self.count(change);
        let change = dsg::update_groups(graph, &self.groups);
        self.count(change);
        self.add_pose(graph, odometry);
    }

    /// The frontier places alone, without a new look at the map.
    pub fn put_frontiers(&mut self, graph: &mut SceneGraph, frontiers: &[Frontier], floor_m: f64) {
        let update = self.places_of(graph, &[], frontiers, floor_m);
        let change = dsg::update_places(graph, &update);
        self.count(change);
    }

    /// Skeleton places as they come and go, and one place per frontier.
    fn places_of(
        &mut self,
        graph: &SceneGraph,
        events: &[PlaceEvent],
        frontiers: &[Frontier],
        floor_m: f64,
    ) -> PlaceUpdate {
        let mut update = PlaceUpdate::default();
        for event in events {
            match event {
                PlaceEvent::Created(place) | PlaceEvent::Updated(place) => update.put.push(PlaceState {
                    id: dsg::PlaceId(place.id.0),
                    position: place.position,
                    clearance_m: place.clearance_m,
                    basis_points: place.basis_points,
                    // Where to look next is judged by coverage, not by the skeleton's rim.
                    frontier_cells: 0,
                }),
                PlaceEvent::Removed(id) => update.removed.push(dsg::PlaceId(id.0)),
                PlaceEvent::EdgeAdded(edge) => update.edges_put.push(PlaceEdge {
                    a: dsg::PlaceId(edge.a.0.min(edge.b.0)),
                    b: dsg::PlaceId(edge.a.0.max(edge.b.0)),
                    clearance_m: edge.clearance_m,
                }),
                PlaceEvent::EdgeRemoved(a, b) => {
                    update.edges_removed.push((dsg::PlaceId(a.0), dsg::PlaceId(b.0)));
                }
            }
        }
        let now: BTreeMap<dsg::PlaceId, Frontier> =
            frontiers.iter().map(|frontier| (dsg::PlaceId(FRONTIER_BASE + frontier.id), frontier.clone())).collect();
        for id in self.frontiers.keys().filter(|id| !now.contains_key(id)) {
            update.removed.push(*id);
        }
        for (id, frontier) in &now {
            if self.frontiers.get(id) == Some(frontier) && graph.place(*id).is_some() {
                continue;
            }
            let position = Point3::new(frontier.at.x, frontier.at.y, floor_m + 1.0);
            update.put.push(PlaceState {
                id: *id,
                position,
                clearance_m: 0.0,
                basis_points: 0,
                frontier_cells: frontier.cells.max(1),
            });
            if let Some(nearest) = nearest_place(graph, &position, &update) {
                update.edges_put.push(PlaceEdge { a: nearest, b: *id, clearance_m: 0.0 });
            }
        }
        self.frontiers = now;
        update
    }

    /// Layer 4 and 5: rooms with their doorways; objects go to the room they stand in.
    fn update_rooms(&self, graph: &mut SceneGraph, map: &RoomMap, floor_m: f64) -> Result<(), dsg::OpError> {
        let mut parts: Vec<RoomPart> = map
            .rooms
            .iter()
            .map(|shape| RoomPart {
                places: Vec::new(),
                center: Point3::new(shape.center.x, shape.center.y, floor_m + 1.0),
                area_m2: shape.area_m2,
                floor: 0,
            })
            .collect();
        for place in graph.places() {
            if let Some(part) = map.room_at(&place.position) {
                parts[part].places.push(place.id);
            }
        }
        let doorways: Vec<(usize, usize, Point3<f64>, f64)> = map
            .doorways
            .iter()
            .map(|door| {
                let (a, b) = door.between;
                (a, b, Point3::new(door.at.x, door.at.y, floor_m + 1.0), door.width_m)
            })
            .collect();
        dsg::update_rooms(graph, &parts, &doorways, &|point| map.room_at(point), &self.rooms).map(|_| ())
    }

    /// The robot's own track, one pose per refresh.
    fn add_pose(&mut self, graph: &mut SceneGraph, odometry: &OdometryEstimate) {
        if odometry.stamp.0 <= self.last_pose_ns && self.last_pose_ns != 0 {
            return;
        }
        self.last_pose_ns = odometry.stamp.0;
        if graph.agent(SELF).is_none() {
            let robot = dsg::Agent { id: SELF, name: "robot".into(), trajectory: Vec::new() };
            let change = graph.apply(Op::PutAgent(Box::new(robot)));
            self.count(change);
        }
        let pose = AgentPose { stamp_ns: odometry.stamp.0, world_from_body: odometry.world_from_body };
        let change = graph.apply(Op::AddAgentPose(SELF, pose));
        self.count(change);
    }
}

/// The skeleton place nearest to a point, among those in the graph that this update does not remove.
fn nearest_place(graph: &SceneGraph, point: &Point3<f64>, update: &PlaceUpdate) -> Option<dsg::PlaceId> {
    graph
        .places()
        .filter(|place: &&Place| place.id.0 < FRONTIER_BASE && !update.removed.contains(&place.id))
        .min_by(|a, b| {
            let distance = |place: &Place| (place.position - point).norm_squared();
            distance(a).total_cmp(&distance(b)).then(a.id.cmp(&b.id))
        })
        .map(|place| place.id)
}

/// Whether the map shows nothing between the eye and a box (up to a hand's breadth before it).
pub(crate) fn is_visible(eye: &Point3<f64>, bounds: &Aabb, volume: &Volume) -> bool {
    let middle = bounds.center();
    let way: Vector3<f64> = middle - eye;
    let radius_m = 0.5 * (bounds.max - bounds.min).norm() + 0.10;
    let length_m = way.norm() - radius_m;
    let step_m = 0.05;
    let steps = (length_m / step_m).max(0.0) as usize;
    (0..=steps).all(|step| {
        let point = eye + way * (step as f64 * step_m / way.norm().max(1e-9));
        volume.observe(&point) != Cell::Occupied
    })
}

/// Whether the map has seen through the box: most of its inner voxels are free.
fn is_empty(bounds: &Aabb, volume: &Volume) -> bool {
    const STEP_M: f64 = 0.05;
    let size = bounds.max - bounds.min;
    let counts = size.map(|side| ((side / STEP_M).floor() as usize).clamp(1, 8));
    let (mut free, mut all) = (0, 0);
    for ix in 0..counts.x {
        for iy in 0..counts.y {
            for iz in 0..counts.z {
                let part = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
                let point = bounds.min
                    + Vector3::new(
                        part(ix, counts.x) * size.x,
                        part(iy, counts.y) * size.y,
                        part(iz, counts.z) * size.z,
                    );
                all += 1;
                free += usize::from(volume.observe(&point) == Cell::Free);
            }
        }
    }
    free * 10 >= all * 9
}
