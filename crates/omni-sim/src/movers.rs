//! Things that move while the robot looks: people who walk, door leaves that swing, chairs that are pushed.
//!
//! Each is one or more [`Mover`]s with key poses, so that every ray and every contact meets it where it is at that
//! moment. A person is four of them under one instance: trunk, head, and two legs that swing about the hip.

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::{InstanceId, Mover, TriangleMesh};
use crate::shape::{Model, Part, Placement, Solid};

/// Key poses of what swings, per second of time.
const KEYS_HZ: f64 = 20.0;

/// How somebody looks and walks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gait {
    /// Height of the person, default 1.75 m.
    pub height_m: f64,
    /// Speed along the way, default 1.2 m/s.
    pub speed_mps: f64,
    /// Length of two steps, default 1.4 m.
    pub stride_m: f64,
    /// Colour of the clothes.
    pub rgb: [u8; 3],
}

impl Default for Gait {
    fn default() -> Self {
        Self { height_m: 1.75, speed_mps: 1.2, stride_m: 1.4, rgb: [70, 80, 120] }
    }
}

/// A person who stands at the first point until `start_ns`, walks along the points at constant speed, and stands at the
/// last. `floor_m` is the height of the floor. No movers for a way without points, or for numbers that are not positive.
pub fn walking_person(
    instance: InstanceId,
    way: &[Point2<f64>],
    floor_m: f64,
    start_ns: i64,
    gait: &Gait,
) -> Vec<Mover> {
    let numbers = [gait.height_m, gait.speed_mps, gait.stride_m];
    let is_usable = numbers.iter().all(|x| x.is_finite() && *x > 0.0)
        && floor_m.is_finite()
        && way.iter().all(|p| p.coords.iter().all(|x| x.is_finite()));
    let Some(first) = way.first().filter(|_| is_usable) else { return Vec::new() };
    let (hip_m, h) = (0.5 * gait.height_m, gait.height_m);
    let part = |solid, rgb| Part { solid, rgb };
    let trunk = part(Solid::block(0.0, 0.0, 0.0, 0.24, 0.44, 0.34 * h), gait.rgb);
    let head = part(
        Solid::Lump { center: Point3::new(0.0, 0.0, 0.43 * h), radii: Vector3::new(0.10, 0.08, 0.07 * h) },
        [215, 175, 150],
    );
    let leg = part(Solid::post(0.0, 0.0, -hip_m + 0.01, 0.07, hip_m - 0.01), [50, 50, 60]);
    let length_m: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    // A swing of the legs that makes the feet touch the floor half a stride apart.
    let swing_rad = (0.25 * gait.stride_m / hip_m).min(0.6).asin();
    let keys = (length_m / gait.speed_mps * KEYS_HZ).ceil() as usize;
    let path = |sideways_m: f64, phase_sign: f64| -> Vec<(i64, Isometry3<f64>)> {
        (0..=keys)
            .map(|key| {
                let along_m = (key as f64 / KEYS_HZ * gait.speed_mps).min(length_m);
                let (at, heading_rad) = along(way, first, along_m);
                let stands = key == 0 || key == keys;
                let phase = std::f64::consts::TAU * along_m / gait.stride_m;
                let pitch_rad = if stands { 0.0 } else { phase_sign * swing_rad * phase.sin() };
                let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading_rad);
                let hip = Point3::new(at.x, at.y, floor_m + hip_m) + yaw * Vector3::new(0.0, sideways_m, 0.0);
                let turn = yaw * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch_rad);
                let stamp_ns = start_ns + (key as f64 / KEYS_HZ * 1e9) as i64;
                (stamp_ns, Isometry3::from_parts(Translation3::from(hip), turn))
            })
            .collect()
    };
    let mover = |part: Part, path| Mover { instance, mesh: mesh_of(vec![part], instance), path };
    vec![
        mover(trunk, path(0.0, 0.0)),
        mover(head, path(0.0, 0.0)),
        mover(leg, path(0.1, 1.0)),
        mover(leg, path(-0.1, -1.0)),
    ]
}

/// A leaf of `width_m` x `height_m` on a hinge at `hinge` (its lower end). It stands at the first angle until its time and
/// swings from key to key; angles in radians from world x, keys in time order. `None` without keys.
pub fn door_leaf(
    instance: InstanceId,
    hinge: Point3<f64>,
    width_m: f64,
    height_m: f64,
    keys: &[(i64, f64)],
    rgb: [u8; 3],
) -> Option<Mover> {
    let leaf = Part { solid: Solid::block(0.5 * width_m, 0.0, 0.01, width_m, 0.04, height_m), rgb };
    let pose = |angle_rad: f64| {
        Isometry3::from_parts(Translation3::from(hinge), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle_rad))
    };
    let mut path: Vec<(i64, Isometry3<f64>)> = Vec::new();
    for pair in keys.windows(2) {
        // Poses are interpolated along the shortest rotation: a wide swing needs keys between.
        let ((t0, from), (t1, to)) = (pair[0], pair[1]);
        let parts = ((to - from).abs() / 1.0).ceil().max(1.0) as i64;
        path.extend((0..parts).map(|k| {
            let s = k as f64 / parts as f64;
            (t0 + (t1 - t0) * k / parts, pose(from + s * (to - from)))
        }));
    }
    path.extend(keys.last().map(|(stamp, angle_rad)| (*stamp, pose(*angle_rad))));
    (!path.is_empty()).then(|| Mover { instance, mesh: mesh_of(vec![leaf], instance), path })
}

/// A thing of the catalogue's `model` that somebody pushes over the floor from key to key: stamp, place of its footprint's
/// middle, heading. `None` without keys.
pub fn pushed(instance: InstanceId, model: &Model, keys: &[(i64, Point3<f64>, f64)]) -> Option<Mover> {
    let path: Vec<(i64, Isometry3<f64>)> = keys
        .iter()
        .map(|(stamp, at, yaw_rad)| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *yaw_rad);
            (*stamp, Isometry3::from_parts(Translation3::from(*at), turn))
        })
        .collect();
    (!path.is_empty()).then(|| Mover { instance, mesh: mesh_of(model.parts.clone(), instance), path })
}

/// Place and heading after `along_m` of a way.
fn along(way: &[Point2<f64>], first: &Point2<f64>, along_m: f64) -> (Point2<f64>, f64) {
    let (mut left_m, mut heading_rad, mut at) = (along_m, 0.0, *first);
    for leg in way.windows(2) {
        let step = leg[1] - leg[0];
        let length_m = step.norm();
        if length_m < 1e-9 {
            continue;
        }
        heading_rad = step.y.atan2(step.x);
        at = leg[0] + step * (left_m / length_m).min(1.0);
        if left_m <= length_m {
            break;
        }
        left_m -= length_m;
    }
    (at, heading_rad)
}

fn mesh_of(parts: Vec<Part>, instance: InstanceId) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let model = Model { parts, ..Model::default() };
    model.push(&mut mesh, &Placement { origin: Point3::origin(), yaw_rad: 0.0 }, instance);
    mesh
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::world::{Thing, World};

    const PERSON: InstanceId = 7;

    fn world_with(movers: Vec<Mover>) -> World {
        let thing = Thing { instance: PERSON, class: "person".into(), ..Thing::default() };
        World::new(TriangleMesh::default(), movers, vec![thing]).unwrap()
    }

    #[test]
    fn a_person_is_met_where_it_is_at_that_moment_and_nowhere_else() {
        let way = [Point2::new(0.0, 0.0), Point2::new(6.0, 0.0)];
        let world = world_with(walking_person(PERSON, &way, 0.0, 1_000_000_000, &Gait::default()));
        for (seconds, x) in [(0.0, 0.0), (1.0, 0.0), (2.0, 1.2), (3.5, 3.0), (60.0, 6.0)] {
            let stamp_ns = (seconds * 1e9) as i64;
            let eye = Point3::new(x, -5.0, 1.2);
            let hit = world.ray(&eye, &Vector3::y(), 10.0, stamp_ns).expect("the trunk is before the eye");
            assert_eq!(hit.instance, PERSON);
            assert!((hit.point.y + 0.22).abs() < 0.02, "{}", hit.point);
            let beside = Point3::new(x + 1.0, -5.0, 1.2);
            assert!(world.ray(&beside, &Vector3::y(), 10.0, stamp_ns).is_none());
        }
    }

    #[test]
    fn a_door_swings_round_its_hinge_even_by_more_than_half_a_turn() {
        let keys = [(0, 0.0), (4_000_000_000, 4.0)];
        let leaf = door_leaf(PERSON, Point3::new(1.0, 1.0, 0.0), 0.9, 2.0, &keys, [200; 3]).unwrap();
        for k in 0..=8 {
            let (s, c) = (0.5 * f64::from(k)).sin_cos();
            let tip = leaf.pose_at(i64::from(k) * 500_000_000) * Point3::new(0.9, 0.0, 1.0);
            assert!((tip - Point3::new(1.0 + 0.9 * c, 1.0 + 0.9 * s, 1.0)).norm() < 1e-6);
        }
        assert!(door_leaf(PERSON, Point3::origin(), 0.9, 2.0, &[], [0; 3]).is_none());
    }

    #[test]
    fn a_chair_goes_where_it_is_pushed() {
        let model = Model {
            parts: vec![Part { solid: Solid::block(0.0, 0.0, 0.0, 0.5, 0.5, 0.9), rgb: [90; 3] }],
            ..Model::default()
        };
        let keys = [(0, Point3::origin(), 0.0), (1_000_000_000, Point3::new(1.0, 0.0, 0.0), 0.5)];
        let chair = pushed(PERSON, &model, &keys).unwrap();
        assert!((chair.pose_at(500_000_000).translation.vector.x - 0.5).abs() < 1e-9);
    }

    proptest! {
        /// Feet stay on the floor or above it, the trunk upright, and the motion has no jump beyond the speed.
        #[test]
        fn people_walk_on_the_floor(
            points in proptest::collection::vec(proptest::array::uniform2(-10.0..10.0f64), 1..6), speed in 0.3..2.0f64, floor in -1.0..4.0f64,
        ) {
            let way: Vec<Point2<f64>> = points.iter().map(|p| Point2::new(p[0], p[1])).collect();
            let movers = walking_person(PERSON, &way, floor, 0, &Gait { speed_mps: speed, ..Gait::default() });
            prop_assert_eq!(movers.len(), 4);
            for mover in &movers {
                prop_assert!(mover.path.windows(2).all(|keys| keys[0].0 < keys[1].0));
                for k in 0..40 {
                    let stamp = k * 400_000_000;
                    let low = mover.mesh.vertices.iter().map(|v| (mover.pose_at(stamp) * v.cast::<f64>()).z).fold(f64::INFINITY, f64::min);
                    prop_assert!(low >= floor - 0.06, "{low} under {floor}");
                }
            }
            let trunk = &movers[0];
            for k in 0..100 {
                let (a, b) = (trunk.pose_at(k * 50_000_000), trunk.pose_at((k + 1) * 50_000_000));
                prop_assert!((a.translation.vector - b.translation.vector).norm() <= 0.05 * speed + 1e-6);
                prop_assert!((a.rotation * Vector3::z()).z > 1.0 - 1e-9);
            }
        }

        /// Rubbish makes nothing, and never panics.
        #[test]
        fn rubbish_makes_nobody(x in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-1.0)]) {
            let way = [Point2::new(0.0, 0.0), Point2::new(1.0, 0.0)];
            let gait = Gait { speed_mps: x, ..Gait::default() };
            prop_assert!(walking_person(PERSON, &way, 0.0, 0, &gait).is_empty());
            prop_assert!(walking_person(PERSON, &[], 0.0, 0, &Gait::default()).is_empty());
        }
    }
}
