//! What keeps a map in bounds and true over a long time: archives, corrected trajectories, names of vertices, full disks.

mod support;

use std::collections::BTreeMap;
use std::io::{self, Write};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use support::{Lidar, World, drive, in_world};
use volumetric_map::{
    Cell, DistanceField, Mesh, PlaceConfig, PlaceGraph, RestoreError, ScanLog, ScanLogError, VertexId, Volume,
    VolumeConfig,
};

type Scan = (Isometry3<f64>, Vec<Point3<f32>>);

/// Scans in the sensor's frame with the sensor somewhere near the origin, turned about z.
fn scan() -> impl Strategy<Value = Scan> {
    let point = (-2.0f32..2.0, -2.0f32..2.0, -1.5f32..1.5).prop_map(|(x, y, z)| Point3::new(x, y, z));
    let pose = (-0.5f64..0.5, -0.5f64..0.5, -3.1f64..3.1).prop_map(|(x, y, yaw)| support::pose(x, y, 0.1, yaw));
    (pose, prop::collection::vec(point, 0..50))
}

fn integrate(volume: &mut Volume, (pose, points): &Scan) -> Vec<Point3<f32>> {
    let points: Vec<_> = points.iter().map(|p| (pose * p.cast::<f64>()).cast::<f32>()).collect();
    volume.integrate(&pose.translation.vector.into(), &points).unwrap();
    points
}

fn volume_of(scans: &[Scan]) -> Volume {
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    for (number, scan) in scans.iter().enumerate() {
        // Twice: one look makes nothing known.
        for _ in 0..2 {
            let points = integrate(&mut volume, scan);
            let tagged: Vec<_> = points.iter().map(|p| (*p, 1 + number as u16 % 2, number as u16)).collect();
            volume.vote_instances(&tagged);
        }
    }
    volume
}

/// The file without its revision and its sum: what the map says.
fn content_of(volume: &Volume) -> Vec<u8> {
    let mut bytes = Vec::new();
    volume.save(&mut bytes).unwrap();
    bytes.truncate(bytes.len() - 8);
    // Head: magic 8, version 4, five lengths, three weights, two counts, revision.
    let revision = 8 + 4 + 40 + 3 + 16;
    bytes[revision..revision + 4].fill(0);
    bytes
}

fn corner() -> impl Strategy<Value = Point3<f64>> {
    (-2.0f64..2.0, -2.0f64..2.0, -1.0f64..1.0).prop_map(|(x, y, z)| Point3::new(x, y, z))
}

mod archive {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn what_goes_to_the_archive_comes_back_as_it_was(scans in prop::collection::vec(scan(), 1..4), a in corner(), b in corner(), next in scan()) {
            let mut volume = volume_of(&scans);
            let whole = content_of(&volume);
            let count = volume.block_count();
            let (min, max) = (a.inf(&b), a.sup(&b));
            let archive = volume.archive_outside(&min, &max);
            volume.check_invariants();
            archive.check_invariants();
            prop_assert_eq!(volume.block_count() + archive.block_count(), count);
            // Blocks that touch the box stay: nobody inside it sees a difference.
            for k in 0..27 {
                let t = |n: i32| f64::from(n) * 0.5;
                let p = min + Vector3::new(t(k % 3), t(k / 3 % 3), t(k / 9)).component_mul(&(max - min)) * 0.999;
                prop_assert_eq!(archive.observe(&p), Cell::Unknown);
            }
            // By way of a file.
            let mut file = Vec::new();
            archive.save(&mut file).unwrap();
            let report = volume.restore(Volume::load(&file[..]).unwrap()).unwrap();
            prop_assert_eq!((report.added, report.joined), (archive.block_count(), 0));
            volume.check_invariants();
            prop_assert_eq!(content_of(&volume), whole);
            // And it goes on as if nothing had been.
            let mut other = volume_of(&scans);
            volume = { let mut bytes = Vec::new(); volume.save(&mut bytes).unwrap(); Volume::load(&bytes[..]).unwrap() };
            integrate(&mut volume, &next);
            integrate(&mut other, &next);
            prop_assert_eq!(content_of(&volume), content_of(&other));
        }

        #[test]
        fn readers_keep_what_they_saw_and_follow_again(scans in prop::collection::vec(scan(), 1..4), a in corner(), b in corner(), next in scan()) {
            let mut volume = volume_of(&scans);
            let mut field = DistanceField::new(0.1, 1.0);
            field.update(&volume);
            volume.complete_mesh();
            let before = volume.mesh();
            let archive = volume.archive_outside(&a.inf(&b), &a.sup(&b));
            prop_assert_eq!(field.update(&volume).cells_changed, 0);
            volume.complete_mesh();
            prop_assert!(volume.mesh() == before, "the mesh stays");
            integrate(&mut volume, &next);
            volume.update_mesh();
            field.update(&volume);
            volume.restore(archive).unwrap();
            volume.check_invariants();
            field.update(&volume);
            volume.complete_mesh();
            let mut rebuilt = volume.clone();
            rebuilt.rebuild_mesh();
            prop_assert!(volume.mesh() == rebuilt.mesh(), "nothing that waited is forgotten");
            let mut fresh = DistanceField::new(0.1, 1.0);
            fresh.update(&volume);
            for k in 0..300 {
                let f = |m: i32| f64::from(k * m % 299) / 299.0 * 4.0 - 2.0;
                let p = Point3::new(f(3), f(47), f(211));
                prop_assert_eq!(field.distance(&p), fresh.distance(&p));
            }
        }

        #[test]
        fn archives_of_two_visits_are_joined(scans in prop::collection::vec(scan(), 2..4)) {
            let mut volume = volume_of(&scans[..1]);
            let archive = volume_of(&scans[1..]);
            let (blocks, others) = (volume.block_count(), archive.block_count());
            let report = volume.restore(archive.clone()).unwrap();
            volume.check_invariants();
            prop_assert_eq!(report.added + report.joined, others);
            prop_assert_eq!(volume.block_count(), blocks + report.added);
            // What only the archive knew is there now.
            let first = volume_of(&scans[..1]);
            for (pose, points) in &scans[1..] {
                for p in points {
                    let p = pose * p.cast::<f64>();
                    if first.observe(&p) == Cell::Unknown && first.label_at(&p).is_none() {
                        prop_assert_eq!(volume.label_at(&p), archive.label_at(&p));
                    }
                }
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_and_given_back() {
        let scan = (support::pose(0.0, 0.0, 0.0, 0.0), vec![Point3::new(1.0, 0.3, 0.2f32); 3]);
        let mut volume = volume_of(&[scan]);
        let coarse = Volume::new(VolumeConfig { voxel_m: 0.1, ..VolumeConfig::default() }).unwrap();
        let refused = *volume.restore(coarse).unwrap_err();
        assert!(matches!(refused.0, RestoreError::OtherGrid { .. }));
        let nowhere = Point3::new(50.0, 50.0, 50.0);
        let archive = volume.archive_outside(&nowhere, &nowhere);
        let (blocks, bytes) = (archive.block_count(), volume.memory_bytes());
        assert!(blocks > 1 && volume.block_count() == 0, "{blocks}");
        let mut small = Volume::new(VolumeConfig { max_blocks: blocks - 1, ..VolumeConfig::default() }).unwrap();
        let (error, archive) = *small.restore(archive).unwrap_err();
        assert_eq!(error, RestoreError::Full { blocks, limit: blocks - 1 });
        assert_eq!((archive.block_count(), small.block_count(), small.revision()), (blocks, 0, 0));
        assert!(volume.memory_bytes() == bytes);
        volume.restore(archive).unwrap();
        assert_eq!(volume.block_count(), blocks);
        let nan = Point3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(volume.archive_outside(&nan, &nan).block_count(), 0);
    }

    #[test]
    fn a_long_way_needs_no_more_memory_than_its_surroundings() {
        let mut volume = Volume::new(VolumeConfig { max_blocks: 2_000, ..VolumeConfig::default() }).unwrap();
        let (mut most, mut archived) = (0, 0);
        for step in 0..100 {
            let here = Point3::new(f64::from(step), 0.0, 0.0);
            let ring = |i: i32| {
                let a = f64::from(i) * 0.05;
                (here + Vector3::new(1.5 * a.cos(), 1.5 * a.sin(), 0.1 * (3.0 * a).sin())).cast::<f32>()
            };
            let points: Vec<_> = (0..126).map(ring).collect();
            assert_eq!(volume.integrate(&here, &points).unwrap().refused_blocks, 0);
            let reach = Vector3::repeat(4.0);
            archived += volume.archive_outside(&(here - reach), &(here + reach)).block_count();
            most = most.max(volume.block_count());
            volume.check_invariants();
        }
        assert!(archived > 10 * most, "{archived} archived, at most {most} in memory");
    }
}

mod corrected_trajectory {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_map_made_again_is_the_map_of_the_corrected_poses(scans in prop::collection::vec(scan(), 1..4),
            drift in prop::collection::vec((-0.3f64..0.3, -0.3f64..0.3, -0.2f64..0.2), 4)) {
            let mut log = ScanLog::new(1 << 20);
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            let mut field = DistanceField::new(0.1, 1.0);
            let wrong = |k: usize| support::pose(drift[k].0, drift[k].1, 0.0, drift[k].2) * scans[k].0;
            for (k, (_, points)) in scans.iter().enumerate() {
                // Thinned to a hair: every point stays.
                log.push(&wrong(k), points, &vec![(2, k as u16); points.len()], 1e-6).unwrap();
                integrate(&mut volume, &(wrong(k), points.clone()));
            }
            field.update(&volume);
            volume.update_mesh();
            let right: Vec<_> = scans.iter().map(|(pose, _)| *pose).collect();
            let moved = log.correct(&right).unwrap();
            prop_assert!(moved[0] < 0.7 && moved[1] < 0.21, "{:?}", moved);
            let before = volume.revision();
            log.rebuild(&mut volume).unwrap();
            volume.check_invariants();
            prop_assert!(volume.revision() > before, "readers go on");
            let mut expected = Volume::new(VolumeConfig::default()).unwrap();
            for (k, scan) in scans.iter().enumerate() {
                let points = integrate(&mut expected, scan);
                expected.vote_instances(&points.iter().map(|p| (*p, 2, k as u16)).collect::<Vec<_>>());
            }
            for k in 0..2000 {
                let f = |m: i32| f64::from(k * m % 1999) / 1999.0 * 5.0 - 2.5;
                let p = Point3::new(f(3), f(47), f(211));
                prop_assert_eq!(volume.observe(&p), expected.observe(&p));
                prop_assert_eq!(volume.signed_distance(&p), expected.signed_distance(&p));
                prop_assert_eq!(volume.instance_at(&p), expected.instance_at(&p));
            }
            // Readers that lived through it hold what a new one reads.
            field.update(&volume);
            let mut fresh = DistanceField::new(0.1, 1.0);
            fresh.update(&expected);
            volume.complete_mesh();
            expected.complete_mesh();
            prop_assert_eq!(volume.mesh(), expected.mesh());
            for k in 0..500 {
                let f = |m: i32| f64::from(k * m % 499) / 499.0 * 5.0 - 2.5;
                let p = Point3::new(f(3), f(47), f(211));
                prop_assert_eq!(field.distance(&p), fresh.distance(&p));
            }
        }
    }

    #[test]
    fn after_a_loop_is_closed_the_ghost_walls_are_gone_and_places_keep_their_names() {
        let world = World::two_rooms();
        let mut lidar = Lidar::new(32, 256, 0.01, 8);
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let mut log = ScanLog::new(64 << 20);
        let (mut field, mut places) = (DistanceField::new(0.1, 2.0), PlaceGraph::new(PlaceConfig::default()).unwrap());
        let poses: Vec<_> = drive(&[[1.5, 1.2], [3.5, 2.0], [6.5, 2.0], [8.0, 2.6]], 0.61, 0.3);
        let drift = |travelled: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.01 * travelled);
            Isometry3::from_parts(Translation3::new(0.03 * travelled, 0.0, 0.0), turn)
        };
        for (pose, travelled) in &poses {
            let scan: Vec<_> = lidar.scan(&world, pose).into_iter().map(|(p, _)| p).collect();
            let estimate = drift(*travelled) * pose;
            let kept = log.push(&estimate, &scan, &[], 0.025).unwrap();
            assert!(kept * 10 > scan.len(), "{kept} of {}", scan.len());
            volume
                .integrate(
                    &estimate.translation.vector.into(),
                    &in_world(&scan.iter().map(|p| (*p, 0)).collect::<Vec<_>>(), &estimate),
                )
                .unwrap();
        }
        field.update(&volume);
        places.update(&field);
        let error = |volume: &mut Volume| {
            volume.complete_mesh();
            let mesh = volume.mesh();
            let off = |v: &Point3<f32>| world.signed_distance(&v.cast::<f64>()).abs();
            mesh.vertices.iter().map(off).sum::<f64>() / mesh.vertices.len() as f64
        };
        let (before, known) = (error(&mut volume), places.places().to_vec());
        let right: Vec<_> = poses.iter().map(|(pose, _)| *pose).collect();
        assert!(log.correct(&right).unwrap()[0] > 0.1);
        let report = log.rebuild(&mut volume).unwrap();
        assert!(report.integrated > 10_000 && report.refused_blocks == 0);
        let after = error(&mut volume);
        assert!(after < 0.012 && after * 3.0 < before, "mean error {before} -> {after}");
        field.update(&volume);
        places.update(&field);
        places.check_invariants();
        let kept = known.iter().filter(|place| places.place(place.id).is_some()).count();
        assert!(kept * 10 >= known.len() * 6, "{kept} of {} places kept", known.len());
    }

    #[test]
    fn a_full_log_and_wrong_numbers_are_refused() {
        let pose = support::pose(0.0, 0.0, 0.0, 0.0);
        let points = vec![Point3::new(1.0f32, 0.0, 0.0), Point3::new(f32::NAN, 0.0, 0.0), Point3::new(1.01, 0.0, 0.0)];
        let mut log = ScanLog::new(300);
        assert_eq!(log.push(&pose, &points, &[], 0.1), Ok(1));
        assert_eq!(log.push(&pose, &points, &[(1, 1)], 0.1), Err(ScanLogError::Tags { points: 3, tags: 1 }));
        assert_eq!(log.push(&pose, &points, &[], 0.0), Err(ScanLogError::NotFinite));
        assert_eq!(log.push(&support::pose(f64::NAN, 0.0, 0.0, 0.0), &points, &[], 0.1), Err(ScanLogError::NotFinite));
        let bytes = log.memory_bytes();
        while log.push(&pose, &points, &[], 0.1).is_ok() {}
        assert!(bytes > 0 && log.memory_bytes() <= 300);
        assert!(matches!(log.push(&pose, &points, &[], 0.1), Err(ScanLogError::Full { limit: 300, .. })));
        assert_eq!(log.correct(&[]), Err(ScanLogError::Poses { poses: 0, scans: log.len() }));
    }
}

mod names_of_vertices {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn replaying_the_deltas_gives_the_mesh(scans in prop::collection::vec(scan(), 1..5)) {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            let mut patches = BTreeMap::new();
            for (number, scan) in scans.iter().enumerate() {
                for _ in 0..3 {
                    let points = integrate(&mut volume, scan);
                    volume.vote_instances(&points.iter().map(|p| (*p, 4, number as u16)).collect::<Vec<_>>());
                    let delta = volume.update_mesh();
                    for key in delta.updated {
                        patches.insert(key, volume.mesh_patch(key).unwrap());
                    }
                    for key in delta.removed {
                        patches.remove(&key);
                        prop_assert!(volume.mesh_patch(key).is_none());
                    }
                    let mut replayed: BTreeMap<VertexId, (Point3<f32>, u16, u16)> = BTreeMap::new();
                    for patch in patches.values() {
                        for (k, id) in patch.ids.iter().enumerate() {
                            let instance = patch.vertices.instances.get(k).copied().unwrap_or(0);
                            let vertex = (patch.vertices.vertices[k], patch.vertices.labels[k], instance);
                            prop_assert!(replayed.insert(*id, vertex).is_none(), "a name is used twice");
                        }
                    }
                    let faces: Vec<_> = patches.values().flat_map(|patch| &patch.quads)
                        .filter(|quad| quad.iter().all(|id| replayed.contains_key(id)))
                        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
                    let (mesh, ids) = (volume.mesh(), volume.vertex_ids());
                    prop_assert_eq!(ids.len(), mesh.vertices.len());
                    for (k, id) in ids.iter().enumerate() {
                        let instance = mesh.instances.get(k).copied().unwrap_or(0);
                        prop_assert_eq!(replayed[id], (mesh.vertices[k], mesh.labels[k], instance));
                    }
                    let named: Vec<_> = mesh.faces.iter().map(|face| face.map(|v| ids[v as usize])).collect();
                    prop_assert_eq!(named, faces);
                }
            }
        }

        #[test]
        fn instances_survive_the_file(scans in prop::collection::vec(scan(), 1..3)) {
            let mut volume = volume_of(&scans);
            volume.complete_mesh();
            let mesh = volume.mesh();
            prop_assert!(mesh.instances.is_empty() || mesh.instances.len() == mesh.vertices.len());
            let mut bytes = Vec::new();
            mesh.write_ply(&mut bytes).unwrap();
            prop_assert_eq!(Mesh::read_ply(&bytes[..]).unwrap(), mesh);
            let mut file = Vec::new();
            volume.save(&mut file).unwrap();
            let mut loaded = Volume::load(&file[..]).unwrap();
            loaded.complete_mesh();
            prop_assert_eq!(loaded.mesh(), volume.mesh());
        }
    }
}

/// A disk with this much room left.
struct Disk(usize);

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = bytes.len().min(self.0);
        self.0 -= n;
        if n == 0 && !bytes.is_empty() { Err(io::ErrorKind::StorageFull.into()) } else { Ok(n) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_full_disk_is_an_error_at_every_byte() {
    let scan = (support::pose(0.0, 0.0, 0.0, 0.0), vec![Point3::new(0.6, 0.3, 0.2f32); 3]);
    let volume = volume_of(&[scan]);
    let mut bytes = Vec::new();
    volume.save(&mut bytes).unwrap();
    for room in (0..bytes.len()).step_by(97).chain([bytes.len() - 1]) {
        assert_eq!(volume.save(Disk(room)).unwrap_err().kind(), io::ErrorKind::StorageFull, "{room}");
    }
    volume.save(Disk(bytes.len())).unwrap();
}
