//! The ray caster against parry's and against brute force.

mod support;

use nalgebra::{Point3, Vector3};
use omni_sim::bvh::{Bvh, RayStack};
use omni_sim::noise::NoiseKey;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use proptest::prelude::*;

/// f32 rounding of a distance of some metres through two different formulas.
const DISTANCE_TOL_M: f32 = 2e-4;

fn random_unit(key: NoiseKey) -> Vector3<f32> {
    let (a, b) = key.normal_pair();
    let (c, _) = key.with(9).normal_pair();
    Vector3::new(a as f32, b as f32, c as f32).normalize()
}

fn parry_mesh(vertices: &[Point3<f32>], faces: &[[u32; 3]]) -> TriMesh {
    let vertices = vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    TriMesh::new(vertices, faces.to_vec()).unwrap()
}

/// From inside the room of [`support::closed_room`], by hand.
fn distance_to_the_walls(origin: &Point3<f32>, direction: &Vector3<f32>) -> f32 {
    let size = [4.0_f32, 5.0, 2.5];
    (0..3)
        .map(|k| match direction[k] {
            d if d > 0.0 => (size[k] - origin[k]) / d,
            d if d < 0.0 => -origin[k] / d,
            _ => f32::INFINITY,
        })
        .fold(f32::INFINITY, f32::min)
}

#[test]
fn no_ray_leaves_a_closed_room_and_all_agree_with_parry() {
    let mesh = support::closed_room(23);
    let bvh = Bvh::build(&mesh.vertices, &mesh.faces);
    let parry = parry_mesh(&mesh.vertices, &mesh.faces);
    let mut stack = RayStack::default();
    for i in 0..1_000_000_u64 {
        let key = NoiseKey::new(1).with(i);
        let origin = Point3::new(
            key.with(1).between(0.2, 3.8) as f32,
            key.with(2).between(0.2, 4.8) as f32,
            key.with(3).between(0.2, 2.3) as f32,
        );
        // Every other ray aims exactly at an edge or corner of the grid.
        let direction = if i % 2 == 0 {
            random_unit(key.with(4))
        } else {
            let face = mesh.faces[key.with(5).index(mesh.faces.len())];
            let [a, b] = [face[0], face[1]].map(|v| mesh.vertices[v as usize]);
            let s = key.with(6).uniform() as f32;
            (a + (b - a) * s - origin).normalize()
        };
        let ours = bvh.cast(&origin, &direction, 100.0, &mut stack);
        let ours = ours.unwrap_or_else(|| panic!("ray {i} leaks: {origin:?} {direction:?}"));
        let ray =
            Ray::new(Vector::new(origin.x, origin.y, origin.z), Vector::new(direction.x, direction.y, direction.z));
        let exact = distance_to_the_walls(&origin, &direction);
        assert!((ours.distance - exact).abs() < DISTANCE_TOL_M, "ray {i}: {} {exact}", ours.distance);
        // Parry itself misses a few of the rays that aim at an edge; it need not be asked for those.
        if i % 2 == 0 {
            let theirs = parry.cast_local_ray(&ray, 100.0, false).expect("parry hits");
            assert!((ours.distance - theirs).abs() < DISTANCE_TOL_M, "ray {i}: {} {theirs}", ours.distance);
        }
    }
}

#[test]
fn a_furnished_flat_agrees_with_parry() {
    let (mesh, _) = support::flat(12, 24);
    let bvh = Bvh::build(&mesh.vertices, &mesh.faces);
    let parry = parry_mesh(&mesh.vertices, &mesh.faces);
    let mut stack = RayStack::default();
    let mut differ = 0;
    for i in 0..50_000_u64 {
        let key = NoiseKey::new(2).with(i);
        let origin = Point3::new(
            key.with(1).between(0.2, 14.8) as f32,
            key.with(2).between(0.2, 7.8) as f32,
            key.with(3).between(0.2, 2.3) as f32,
        );
        let direction = random_unit(key.with(4));
        let ray =
            Ray::new(Vector::new(origin.x, origin.y, origin.z), Vector::new(direction.x, direction.y, direction.z));
        let ours = bvh.cast(&origin, &direction, 30.0, &mut stack);
        let theirs = parry.cast_local_ray(&ray, 30.0, false);
        match (ours, theirs) {
            (None, None) => {}
            (Some(a), Some(b)) if (a.distance - b).abs() < DISTANCE_TOL_M * 5.0 => {}
            _ => differ += 1,
        }
    }
    // Silhouettes within the tolerance of an edge may go either way.
    assert!(differ <= 3, "{differ} of 50000 rays differ");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Any soup of triangles, coincident and degenerate ones included.
    #[test]
    fn the_tree_finds_what_brute_force_finds(
        corners in prop::collection::vec(prop::array::uniform3(prop_oneof![
            (-3i8..=3).prop_map(f32::from), -3.0f32..3.0
        ]), 3..90),
        rays in prop::collection::vec((prop::array::uniform3(-4.0f32..4.0), prop::array::uniform3(prop_oneof![
            Just(0.0f32), Just(1.0), Just(-1.0), -1.0f32..1.0
        ])), 1..20),
    ) {
        let vertices: Vec<Point3<f32>> = corners.iter().map(|&c| Point3::from(c)).collect();
        let faces: Vec<[u32; 3]> =
            (0..vertices.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let tree = Bvh::build(&vertices, &faces);
        let mut stack = RayStack::default();
        for (origin, direction) in rays {
            let direction = Vector3::from(direction);
            prop_assume!(direction.norm() > 0.1);
            let origin = Point3::from(origin);
            let ours = tree.cast(&origin, &direction, 50.0, &mut stack);
            // One tree a triangle is the brute force: the same triangle test, no tree over them.
            let brute = faces.iter().enumerate().filter_map(|(i, face)| {
                let single = Bvh::build(&vertices, std::slice::from_ref(face));
                let hit = single.cast(&origin, &direction, 50.0, &mut stack)?;
                Some((hit.distance, i as u32))
            }).min_by(|a, b| a.partial_cmp(b).unwrap());
            // The boxes are exact; a triangle's tolerance may reach out of its box by rounding.
            match (ours, brute) {
                (Some(a), Some(b)) => {
                    prop_assert!((a.distance - b.0).abs() <= 1e-4 * (1.0 + b.0), "{:?} {:?}", a, b);
                }
                (a, b) => prop_assert!(a.is_none() && b.is_none(), "{:?} {:?}", a, b),
            }
        }
    }
}
