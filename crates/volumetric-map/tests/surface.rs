//! Surface nets and marching cubes: without holes inside observed space, and one surface.

mod support;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;
use volumetric_map::{Mesh, VertexId, Volume, VolumeConfig};

/// Scans of blobs: spheres round random centres, with bumps, seen from the origin.
fn bumpy() -> impl Strategy<Value = Vec<Vec<Point3<f32>>>> {
    let shape = (0.7f64..1.6, -0.4f64..0.4, 1u32..6, 0.0f64..6.3);
    prop::collection::vec(shape, 1..4).prop_map(|shapes| {
        shapes
            .into_iter()
            .map(|(radius, bump, waves, phase)| {
                star(2500, |d| radius + bump * (f64::from(waves) * d.x + phase).sin() * (f64::from(waves) * d.z).cos())
            })
            .collect()
    })
}

/// Points all round the origin at a distance that depends on the direction.
fn star(count: u32, radius: impl Fn(&Vector3<f64>) -> f64) -> Vec<Point3<f32>> {
    let golden = 2.399_963;
    let direction = |i: u32| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
        let r = (1.0 - z * z).sqrt();
        Vector3::new(r * (golden * f64::from(i)).cos(), r * (golden * f64::from(i)).sin(), z)
    };
    (0..count).map(direction).map(|d| Point3::from((d * radius(&d)).cast::<f32>())).collect()
}

fn volume_of(scans: &[Vec<Point3<f32>>]) -> Volume {
    // A coarse grid, so that few points make a dense surface.
    let config = VolumeConfig { voxel_m: 0.1, truncation_m: 0.3, behind_m: 0.2, ..VolumeConfig::default() };
    let mut volume = Volume::new(config).unwrap();
    for points in scans {
        for _ in 0..3 {
            volume.integrate(&Point3::origin(), points).unwrap();
        }
    }
    volume
}

/// Edges that no face passes the other way, with the number by which they are short.
fn open_edges(mesh: &Mesh) -> BTreeMap<(u32, u32), i32> {
    let mut passes = BTreeMap::new();
    for face in &mesh.faces {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            *passes.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    passes.retain(|_, count| *count != 0);
    passes
}

/// The eight voxels of a cell are known.
fn is_observed(volume: &Volume, cell: [i32; 3]) -> bool {
    (0..8).all(|k| {
        let voxel = [0, 1, 2].map(|axis| cell[axis] + (k >> axis & 1));
        volume.signed_distance(&volume.voxel_center(voxel)).is_some()
    })
}

/// Cells round the four edges of the face that two neighbouring cells share.
fn cells_round_the_shared_face(a: [i32; 3], b: [i32; 3]) -> BTreeSet<[i32; 3]> {
    let mut out = BTreeSet::new();
    let axis = (0..3).find(|axis| a[*axis] != b[*axis]).unwrap();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    for cell in [a, b] {
        for (du, dv) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let mut other = cell;
            other[u] += du;
            other[v] += dv;
            out.insert(other);
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn surface_nets_end_only_where_nothing_was_observed(scans in bumpy()) {
        let mut volume = volume_of(&scans);
        volume.complete_mesh();
        let (mesh, ids) = (volume.mesh(), volume.vertex_ids());
        prop_assert!(mesh.faces.len() > 100);
        for ((a, b), _) in open_edges(&mesh) {
            let (VertexId(a), VertexId(b)) = (ids[a as usize], ids[b as usize]);
            let steps: i32 = (0..3).map(|axis| (a[axis] - b[axis]).abs()).sum();
            prop_assert_eq!(steps, 1, "a diagonal is always shared by the two halves of its quad");
            prop_assert!(cells_round_the_shared_face(a, b).into_iter().any(|cell| !is_observed(&volume, cell)));
        }
    }

    #[test]
    fn marching_cubes_end_only_where_nothing_was_observed(scans in bumpy()) {
        let volume = volume_of(&scans);
        let surface = volume.marching_cubes();
        prop_assert!(surface.mesh.faces.len() > 100);
        prop_assert_eq!(surface.edges.len(), surface.mesh.vertices.len());
        for ((a, b), _) in open_edges(&surface.mesh) {
            // Both ends lie on edges of one face of the grid; one of the two cubes that share it was not observed.
            let voxels = [surface.edges[a as usize], surface.edges[b as usize]].map(|(voxel, axis)| {
                let mut next = voxel;
                next[usize::from(axis)] += 1;
                [voxel, next]
            });
            let all = voxels.as_flattened();
            let low = [0, 1, 2].map(|axis| all.iter().map(|v| v[axis]).min().unwrap());
            let high = [0, 1, 2].map(|axis| all.iter().map(|v| v[axis]).max().unwrap());
            let flat: Vec<usize> = (0..3).filter(|axis| low[*axis] == high[*axis]).collect();
            prop_assert_eq!(flat.len(), 1, "an open edge lies in a face of the grid");
            let mut other = low;
            other[flat[0]] -= 1;
            prop_assert!(!is_observed(&volume, low) || !is_observed(&volume, other));
        }
    }
}

#[test]
fn a_ball_seen_from_within_is_closed_and_both_surfaces_are_one() {
    let mut volume = volume_of(&[star(12_000, |_| 1.3)]);
    volume.complete_mesh();
    let (nets, cubes) = (volume.mesh(), volume.marching_cubes().mesh);
    for mesh in [&nets, &cubes] {
        assert_eq!(open_edges(mesh).len(), 0);
        // Euler: V - E + F = 2 for a ball; a closed triangle mesh has 2 E = 3 F.
        assert_eq!(mesh.vertices.len() as i64 - mesh.faces.len() as i64 / 2, 2);
        for vertex in &mesh.vertices {
            assert!((vertex.coords.norm() - 1.3).abs() < 0.03, "{vertex}");
        }
        // Faces look at the sensor: the volume they enclose, seen so, is negative.
        let volume_of_cone = |f: &[u32; 3]| {
            let [a, b, c] = f.map(|v| mesh.vertices[v as usize].coords.cast::<f64>());
            a.cross(&b).dot(&c) / 6.0
        };
        let enclosed: f64 = mesh.faces.iter().map(volume_of_cone).sum();
        let truth = -4.0 / 3.0 * std::f64::consts::PI * 1.3f64.powi(3);
        assert!((enclosed / truth - 1.0).abs() < 0.02, "{enclosed}, {truth}");
    }
    assert!(cubes.faces.len().abs_diff(nets.faces.len()) * 50 < nets.faces.len());
}

#[test]
fn labels_and_instances_ride_on_both_surfaces() {
    let points = star(12_000, |_| 1.3);
    let mut volume = volume_of(std::slice::from_ref(&points));
    let half = |p: &Point3<f32>| if p.x > 0.0 { (3, 11) } else { (3, 12) };
    volume.vote_instances(&points.iter().map(|p| (*p, half(p).0, half(p).1)).collect::<Vec<_>>());
    volume.complete_mesh();
    for mesh in [volume.mesh(), volume.marching_cubes().mesh] {
        let is_right = |k: usize| {
            let p = &mesh.vertices[k];
            p.x.abs() < 0.2 || (mesh.labels[k], mesh.instances[k]) == half(p)
        };
        let right = (0..mesh.vertices.len()).filter(|k| is_right(*k)).count();
        assert!(right * 100 >= 99 * mesh.vertices.len(), "{right} of {}", mesh.vertices.len());
    }
}
