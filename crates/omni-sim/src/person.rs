//! People: a trunk, a head and two legs that swing about the hip, four [`Mover`]s under one instance.

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::{InstanceId, Mover};
use crate::movers::mesh_of;
use crate::shape::{Part, Solid};

/// Key poses of what swings, per second of time.
const KEYS_HZ: f64 = 20.0;
/// Height of the hip as a share of the person's.
const HIP_SHARE: f64 = 0.5;
/// From the middle to each leg.
const LEG_BESIDE_M: f64 = 0.1;

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

impl Gait {
    /// Whether all lengths and speeds are positive and finite.
    pub fn is_usable(&self) -> bool {
        [self.height_m, self.speed_mps, self.stride_m].iter().all(|x| x.is_finite() && *x > 0.0)
    }
}

/// Where somebody is in a walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stance {
    /// On the floor, under the hip.
    pub at: Point2<f64>,
    /// From world x.
    pub heading_rad: f64,
    /// How far it has walked: says where the legs are in their swing.
    pub walked_m: f64,
    /// Share of the full swing, 0 for somebody who stands, up to 1.
    pub swing: f64,
}

/// Trunk, head and two legs, in this order, each standing at `stance` from `stamp_ns` on. `None` for numbers that are not usable.
pub fn person(instance: InstanceId, gait: &Gait, floor_m: f64, stamp_ns: i64, stance: &Stance) -> Option<[Mover; 4]> {
    if !gait.is_usable() || !floor_m.is_finite() || !stance.at.iter().all(|x| x.is_finite()) {
        return None;
    }
    let (hip_m, h) = (HIP_SHARE * gait.height_m, gait.height_m);
    let part = |solid, rgb| Part { solid, rgb };
    let trunk = part(Solid::block(0.0, 0.0, 0.0, 0.24, 0.44, 0.34 * h), gait.rgb);
    let head = part(
        Solid::Lump { center: Point3::new(0.0, 0.0, 0.43 * h), radii: Vector3::new(0.10, 0.08, 0.07 * h) },
        [215, 175, 150],
    );
    let leg = part(Solid::post(0.0, 0.0, -hip_m + 0.01, 0.07, hip_m - 0.01), [50, 50, 60]);
    let poses = limb_poses(gait, floor_m, stance);
    let parts = [trunk, head, leg, leg];
    let mut poses = poses.into_iter();
    Some(parts.map(|part| {
        let pose = poses.next().unwrap_or_else(Isometry3::identity);
        Mover { instance, mesh: mesh_of(vec![part], instance), path: vec![(stamp_ns, pose)] }
    }))
}

/// Where trunk, head and legs are, in the world.
pub fn limb_poses(gait: &Gait, floor_m: f64, stance: &Stance) -> [Isometry3<f64>; 4] {
    let hip_m = HIP_SHARE * gait.height_m;
    // A swing of the legs that makes the feet touch the floor half a stride apart.
    let swing_rad = (0.25 * gait.stride_m / hip_m).min(0.6).asin();
    let phase = std::f64::consts::TAU * stance.walked_m / gait.stride_m;
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), stance.heading_rad);
    [(0.0, 0.0), (0.0, 0.0), (LEG_BESIDE_M, 1.0), (-LEG_BESIDE_M, -1.0)].map(|(sideways_m, sign)| {
        let pitch_rad = sign * stance.swing * swing_rad * phase.sin();
        let hip = Point3::new(stance.at.x, stance.at.y, floor_m + hip_m) + yaw * Vector3::new(0.0, sideways_m, 0.0);
        let turn = yaw * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch_rad);
        Isometry3::from_parts(Translation3::from(hip), turn)
    })
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
    let is_usable = way.iter().all(|p| p.coords.iter().all(|x| x.is_finite()));
    let Some(first) = way.first().filter(|_| is_usable && gait.is_usable()) else { return Vec::new() };
    let length_m: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    let keys = (length_m / gait.speed_mps * KEYS_HZ).ceil() as usize;
    let stance_at = |key: usize| {
        let walked_m = (key as f64 / KEYS_HZ * gait.speed_mps).min(length_m);
        let (at, heading_rad) = along(way, first, walked_m);
        let swing = if key == 0 || key == keys { 0.0 } else { 1.0 };
        Stance { at, heading_rad, walked_m, swing }
    };
    let Some(mut limbs) = person(instance, gait, floor_m, start_ns, &stance_at(0)) else { return Vec::new() };
    for key in 1..=keys {
        let stamp_ns = start_ns + (key as f64 / KEYS_HZ * 1e9) as i64;
        for (limb, pose) in limbs.iter_mut().zip(limb_poses(gait, floor_m, &stance_at(key))) {
            limb.path.push((stamp_ns, pose));
        }
    }
    limbs.into()
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::TriangleMesh;
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
