//! What moves, from the scene graph to the planner: balls that hold each mover where it is now, and go on as it does.
//!
//! The graph keeps a box and a trajectory of whatever moves by itself ([`dsg::observe_movers`]). Since it was last seen it went on at
//! its velocity, give or take what is not known about that. A person is no ball: a column of balls over the box is tighter.

use dsg::{Aabb, MoverConfig, Object, SceneGraph};
use nalgebra::{Point3, Vector3};
use omni_perception::Stamp;
use planner::Mover;

/// Not seen for longer, nobody knows where it is: as long as a prediction counts ([`planner::AirConfig::prediction_s`]).
const BELIEVED_S: f64 = 3.0;
/// What is not known about a velocity (m/s): two middles half a second apart, each off by up to 8 cm.
pub(crate) const VELOCITY_ERROR_MPS: f64 = 0.3;
/// A thing is seen from one side at a time, so it may reach beyond its box (m).
const UNSEEN_SIDE_M: f64 = 0.1;
/// Most balls for one mover.
const MOST_BALLS: usize = 8;

/// All movers of the graph that were seen lately, in its frame, as they are at `now`.
pub fn movers(graph: &SceneGraph, now: Stamp) -> Vec<Mover> {
    graph.objects().filter(|object| object.confirmed).flat_map(|object| balls_of(object, now)).collect()
}

fn balls_of(object: &Object, now: Stamp) -> Vec<Mover> {
    let Some(last) = object.trajectory.last() else { return Vec::new() };
    let unseen_s = (now.0.saturating_sub(last.stamp_ns) as f64 * 1e-9).max(0.0);
    if unseen_s > BELIEVED_S || !object.bounds.is_valid() {
        return Vec::new();
    }
    let velocity_mps = dsg::velocity_m_s(object, &MoverConfig::default());
    let grown_m = UNSEEN_SIDE_M + VELOCITY_ERROR_MPS * unseen_s;
    column(&object.bounds)
        .map(|(centre, radius_m)| Mover {
            position: centre + velocity_mps * unseen_s,
            velocity_mps,
            radius_m: radius_m + grown_m,
            growth_mps: VELOCITY_ERROR_MPS,
        })
        .collect()
}

/// Balls one over the other that hold a box, each about as high as it is wide.
fn column(bounds: &Aabb) -> impl Iterator<Item = (Point3<f64>, f64)> {
    let half = (bounds.max - bounds.min) / 2.0;
    let across_m = half.xy().norm();
    let count = (half.z / across_m.max(1e-3)).ceil().clamp(1.0, MOST_BALLS as f64);
    let slab_m = half.z / count;
    let lowest = bounds.center() - Vector3::z() * (half.z - slab_m);
    let radius_m = across_m.hypot(slab_m);
    (0..count as usize).map(move |k| (lowest + Vector3::z() * (2.0 * slab_m * k as f64), radius_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsg::{MoverEvidence, observe_movers};

    const SIDES: Vector3<f64> = Vector3::new(0.4, 0.5, 1.7);

    /// Seen at a place, at a time.
    fn seen(graph: &mut SceneGraph, x: f64, stamp_ns: i64) {
        let bounds = Aabb::from_center(Point3::new(x, 1.0, 0.85), SIDES);
        let view = MoverEvidence { stamp_ns, label: "person".into(), score: 0.9, bounds, track: None };
        observe_movers(graph, &[view], &MoverConfig::default()).unwrap();
    }

    #[test]
    fn a_walker_is_where_he_has_walked_since_and_all_of_him_is_in_the_balls() {
        let mut graph = SceneGraph::new();
        for k in 0..6i64 {
            // 1.2 m/s along x.
            seen(&mut graph, 0.24 * k as f64, 200_000_000 * k);
        }
        let now = Stamp(1_500_000_000);
        let balls = movers(&graph, now);
        assert!((2..=MOST_BALLS).contains(&balls.len()), "{}", balls.len());
        for ball in &balls {
            assert!((ball.velocity_mps - Vector3::new(1.2, 0.0, 0.0)).norm() < 1e-9 && ball.growth_mps > 0.0);
            assert!((ball.position.x - 1.8).abs() < 1e-9, "half a second later: {}", ball.position);
            assert!(ball.radius_m < 0.75, "a ball round all of him would have 0.9: {}", ball.radius_m);
        }
        // Every part of the box where he is now, and of one a little slower or faster.
        for k in 0..1000u32 {
            let share = |step: u32| f64::from(k * step % 101) / 101.0 - 0.5;
            let part = Vector3::new(SIDES.x * share(17), SIDES.y * share(29), SIDES.z * share(43));
            let at = Point3::new(1.8 + 0.12 * share(7), 1.0, 0.85) + part;
            assert!(balls.iter().any(|ball| (at - ball.position).norm() <= ball.radius_m), "{at} is in none");
        }
        assert!(movers(&graph, Stamp(5_000_000_000)).is_empty(), "nobody knows where he is now");
        assert!(movers(&SceneGraph::new(), now).is_empty());
    }
}
