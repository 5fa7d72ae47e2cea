//! Those who move near the robot: followed by their points and by what images call them, kept out of the map, told to the planners and
//! to the graph.

use dsg::{Aabb, MoverEvidence, SceneGraph};
use nalgebra::{Point3, Vector3};
use omni_perception::{MoverTrack, MoverTracker, ObjectObservation, Stamp};
use planner::GroundMover;
use volumetric_map::DistanceField;

use crate::movers::VELOCITY_ERROR_MPS;

/// Kinds of things that move by themselves.
const KINDS: [&str; 3] = ["person", "dog", "cat"];

/// Whether a thing of this label moves by itself.
pub fn moves_by_itself(label: &str) -> bool {
    KINDS.contains(&label)
}

/// Everybody near, and who of them the graph has heard of.
#[derive(Debug, Clone, Default)]
pub struct People {
    tracker: MoverTracker,
}

impl People {
    /// One scan, straightened, seen from `eye`.
    pub fn see(
        &mut self,
        stamp: Stamp,
        eye: &Point3<f64>,
        floor_m: f64,
        points: &[Point3<f32>],
        field: &DistanceField,
    ) {
        self.tracker.observe(stamp, eye, floor_m, points, &|point| field.distance(point));
    }

    /// What of a scan of the last two seconds is nobody's body, as far as is known by now: that is for the map.
    pub fn without<'a>(&'a self, points: &'a [Point3<f32>], stamp: Stamp) -> impl Iterator<Item = Point3<f32>> + 'a {
        let bodies = self.tracker.bodies_at(stamp);
        points.iter().filter(move |point| !bodies.iter().any(|body| body.holds(point))).copied()
    }

    /// Whether nobody is near.
    pub fn is_empty(&self) -> bool {
        self.tracker.movers().next().is_none()
    }

    /// An image shows one of them.
    pub fn name(&mut self, observation: &ObjectObservation) {
        if let Some((label, _)) = observation.label_weights.first() {
            self.tracker.name(observation.stamp, label, &observation.points_in_world);
        }
    }

    /// Where everybody is at a time, for the local policy.
    pub fn on_the_ground(&self, stamp: Stamp) -> Vec<GroundMover> {
        let mover = |track: &MoverTrack| GroundMover {
            position: track.position_at(stamp),
            velocity_mps: track.velocity_mps,
            radius_m: track.radius_m,
            growth_mps: VELOCITY_ERROR_MPS,
        };
        self.tracker.movers().map(mover).collect()
    }

    /// Those who have a name go into the graph, with what is theirs in time and place; who was long unseen is forgotten.
    ///
    /// # Errors
    /// What the graph refuses; it stays as it was.
    pub fn tell(&self, graph: &mut SceneGraph, stamp: Stamp) -> Result<(), dsg::OpError> {
        let evidence = |track: &MoverTrack| {
            let label = track.label.clone()?;
            // Who is not in the newest scan was not seen now.
            (track.seen == track.stamp && track.stamp <= stamp).then(|| MoverEvidence {
                stamp_ns: track.stamp.0,
                label,
                score: 1.0,
                bounds: bounds_of(track),
                track: Some(track.id),
            })
        };
        let seen: Vec<MoverEvidence> = self.tracker.movers().filter_map(evidence).collect();
        let config = dsg::MoverConfig::default();
        dsg::forget_movers(graph, stamp.0, &config)?;
        dsg::observe_movers(graph, &seen, &config).map(|_| ())
    }
}

/// The box of somebody's cylinder.
fn bounds_of(track: &MoverTrack) -> Aabb {
    let [low_m, high_m] = track.heights_m;
    let low = Point3::new(track.position.x, track.position.y, low_m);
    let half = Vector3::new(track.radius_m, track.radius_m, 0.0);
    Aabb { min: low - half, max: low + half + Vector3::z() * (high_m - low_m).max(0.0) }
}
