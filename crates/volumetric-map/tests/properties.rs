//! Laws of the volume, the grids, the distance field, the mesh, the places and the files.

mod support;

use nalgebra::Point3;
use proptest::prelude::*;
use support::flat_grid;
use volumetric_map::{
    Cell, DistanceField, LineOfSight, LoadError, Mesh, PlaceConfig, PlaceEvent, PlaceGraph, Volume, VolumeConfig,
    clearance, fill_islands,
};

/// A scan: a sensor position near the origin and points around, some of them hostile.
fn scan() -> impl Strategy<Value = (Point3<f64>, Vec<Point3<f32>>)> {
    let coordinate = prop_oneof![8 => -2.0f32..2.0, 1 => Just(0.0f32), 1 => Just(0.05f32)];
    let good = (coordinate.clone(), coordinate.clone(), coordinate).prop_map(|(x, y, z)| Point3::new(x, y, z));
    let bad = prop_oneof![
        Just(Point3::new(f32::NAN, 0.0, 0.0)),
        Just(Point3::new(f32::INFINITY, 1.0, 0.0)),
        Just(Point3::new(3e38, -3e38, 3e38)),
        Just(Point3::new(40.0, 0.0, 0.0)),
    ];
    let point = prop_oneof![20 => good, 1 => bad];
    let origin = (-0.5f64..0.5, -0.5f64..0.5, -0.5f64..0.5).prop_map(|(x, y, z)| Point3::new(x, y, z));
    (origin, prop::collection::vec(point, 0..60))
}

fn volume_of(scans: &[(Point3<f64>, Vec<Point3<f32>>)]) -> Volume {
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    for (origin, points) in scans {
        volume.integrate(origin, points).unwrap();
    }
    volume
}

fn bytes_of(volume: &Volume) -> Vec<u8> {
    let mut bytes = Vec::new();
    volume.save(&mut bytes).unwrap();
    bytes
}

mod volume {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn invariants_hold_after_every_scan_and_every_point_is_accounted_for(scans in prop::collection::vec(scan(), 1..5)) {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            for (origin, points) in &scans {
                let report = volume.integrate(origin, points).unwrap();
                let counted = report.integrated + report.non_finite + report.too_near + report.beyond_range;
                prop_assert_eq!(counted, points.len());
                volume.check_invariants();
            }
        }

        #[test]
        fn the_fast_walk_gives_the_bytes_of_the_plain_one(scans in prop::collection::vec(scan(), 1..6), every in 1usize..4, full in 3usize..200) {
            let max_blocks = if full > 100 { 60_000 } else { full };
            let config = VolumeConfig { clear_every: every, max_blocks, ..VolumeConfig::default() };
            let (mut fast, mut plain) = (Volume::new(config.clone()).unwrap(), Volume::new(config).unwrap());
            for (origin, points) in &scans {
                // Twice, so that the second finds surfaces and settled blocks.
                for _ in 0..2 {
                    let report = fast.integrate(origin, points).unwrap();
                    prop_assert_eq!(report, plain.integrate_plainly(origin, points).unwrap());
                    prop_assert_eq!(bytes_of(&fast), bytes_of(&plain));
                }
            }
        }

        #[test]
        fn the_same_scans_give_the_same_bytes(scans in prop::collection::vec(scan(), 1..4)) {
            prop_assert_eq!(bytes_of(&volume_of(&scans)), bytes_of(&volume_of(&scans)));
        }

        #[test]
        fn a_return_seen_again_and_again_is_occupied_and_the_way_to_it_free(
            x in 0.6f32..3.0, y in -2.0f32..2.0, z in -1.0f32..1.0
        ) {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            let point = Point3::new(x, y, z);
            for _ in 0..5 {
                volume.integrate(&Point3::origin(), &[point]).unwrap();
            }
            // Occupied begins a quarter of a voxel before the surface, so a return at the far end of its voxel closes the next one.
            let point = point.cast::<f64>();
            prop_assert_eq!(volume.observe(&(point + point.coords.normalize() * 0.03)), Cell::Occupied);
            let half = Point3::from(point.coords * 0.5);
            prop_assert_eq!(volume.observe(&half), Cell::Free);
            let behind = Point3::from(point.coords * 1.5);
            prop_assert_eq!(volume.observe(&behind), Cell::Unknown);
        }

        #[test]
        fn a_thin_thing_that_is_hit_stays_however_many_rays_pass_beside_it(
            x in 0.8f32..3.0, y in -1.0f32..1.0, z in -0.5f32..0.5,
            beside in prop::collection::vec((-0.03f32..0.03, -0.03f32..0.03), 1..20)
        ) {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            let leg = Point3::new(x, y, z);
            for _ in 0..5 {
                volume.integrate(&Point3::origin(), &[leg]).unwrap();
            }
            // Rays to a wall behind that pass through the leg's own voxel or its neighbours.
            let mut points: Vec<_> = beside.iter().map(|(dy, dz)| Point3::new(x * 1.6, (y + dy) * 1.6, (z + dz) * 1.6)).collect();
            points.push(leg);
            for _ in 0..20 {
                volume.integrate(&Point3::origin(), &points).unwrap();
            }
            let leg = leg.cast::<f64>();
            let is_there = [0.0, 0.03].iter().any(|d| volume.observe(&(leg + leg.coords.normalize() * *d)) == Cell::Occupied);
            prop_assert!(is_there);
        }

        #[test]
        fn a_full_volume_refuses_and_says_so(points in scan()) {
            let config = VolumeConfig { max_blocks: 3, ..VolumeConfig::default() };
            let mut volume = Volume::new(config).unwrap();
            let report = volume.integrate(&points.0, &points.1).unwrap();
            prop_assert!(volume.block_count() <= 3);
            let far = points.1.iter().filter(|p| p.coords.norm() > 1.5 && p.coords.norm() < 12.0).count();
            if far > 8 {
                prop_assert!(report.refused_blocks > 0);
            }
            volume.check_invariants();
        }

        #[test]
        fn the_majority_label_wins_in_any_order(mut votes in prop::collection::vec(1u16..4, 1..30), seed in 0usize..100) {
            let point = Point3::new(1.0f32, 0.2, 0.3);
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            volume.integrate(&Point3::origin(), &[point]).unwrap();
            let n = votes.len();
            votes.rotate_left(seed % n);
            for vote in &votes {
                volume.vote_labels(&[(point, *vote)]);
            }
            for label in 1..4 {
                if votes.iter().filter(|v| **v == label).count() * 2 > n {
                    prop_assert_eq!(volume.label_at(&point.cast::<f64>()), Some(label));
                }
            }
        }

        #[test]
        fn save_and_load_give_the_same_map_and_the_same_bytes(scans in prop::collection::vec(scan(), 0..4), probes in scan()) {
            let mut volume = volume_of(&scans);
            let labelled: Vec<_> = probes.1.iter().map(|p| (*p, 3)).collect();
            volume.vote_labels(&labelled);
            let bytes = bytes_of(&volume);
            let mut loaded = Volume::load(&bytes[..]).unwrap();
            loaded.check_invariants();
            prop_assert_eq!(bytes_of(&loaded), bytes);
            for p in &probes.1 {
                let p = p.cast::<f64>();
                prop_assert_eq!(loaded.observe(&p), volume.observe(&p));
                prop_assert_eq!(loaded.signed_distance(&p), volume.signed_distance(&p));
                prop_assert_eq!(loaded.label_at(&p), volume.label_at(&p));
            }
            volume.update_mesh();
            loaded.update_mesh();
            prop_assert_eq!(loaded.mesh(), volume.mesh());
            // And it goes on like the one that was saved.
            volume.integrate(&probes.0, &probes.1).unwrap();
            loaded.integrate(&probes.0, &probes.1).unwrap();
            prop_assert_eq!(bytes_of(&loaded), bytes_of(&volume));
        }

        #[test]
        fn a_damaged_file_is_refused(scans in prop::collection::vec(scan(), 1..2), at in 0.0f64..1.0, bit in 0u8..8) {
            let mut bytes = bytes_of(&volume_of(&scans));
            let at = (at * bytes.len() as f64) as usize;
            prop_assert!(Volume::load(&bytes[..at]).is_err(), "cut at {}", at);
            bytes[at] ^= 1 << bit;
            // The minor version says nothing about damage but is summed too.
            prop_assert!(Volume::load(&bytes[..]).is_err(), "bit {} of byte {}", bit, at);
        }
    }

    #[test]
    fn a_sensor_nowhere_is_an_error_and_changes_nothing() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        assert!(volume.integrate(&Point3::new(f64::NAN, 0.0, 0.0), &[Point3::new(1.0, 0.0, 0.0)]).is_err());
        assert!(volume.integrate(&Point3::new(1e9, 0.0, 0.0), &[]).is_err());
        assert_eq!((volume.block_count(), volume.revision()), (0, 0));
        assert_eq!(volume.observe(&Point3::new(f64::NAN, 0.0, 0.0)), Cell::Unknown);
    }

    #[test]
    fn foreign_and_newer_files_are_named() {
        assert!(matches!(Volume::load(&b"hello"[..]), Err(LoadError::NotAVolume)));
        let mut bytes = bytes_of(&Volume::new(VolumeConfig::default()).unwrap());
        assert_eq!(Volume::load(&bytes[..]).unwrap().block_count(), 0);
        bytes[8] = 3;
        assert!(matches!(Volume::load(&bytes[..]), Err(LoadError::NewerVersion { found: 3, supported: 2 })));
    }

    #[test]
    fn empty_volumes_give_empty_things() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        assert_eq!(volume.slice(0.0, 1.0, None).cells.len(), 0);
        assert_eq!(volume.ground_grid(0.0, 0.1, 1.0).cells.len(), 0);
        assert_eq!(volume.slice(0.0, 1.0, Some([0.0, 0.0, 0.5, 1.0])).cells, vec![Cell::Unknown; 200]);
        assert_eq!(volume.slice(0.0, 1.0, Some([1.0, 0.0, 0.5, 1.0])).cells.len(), 0);
        assert_eq!(volume.slice(f64::NAN, 1.0, None).cells.len(), 0);
        assert_eq!(volume.update_mesh().faces, 0);
        let mut field = DistanceField::new(0.1, 2.0);
        field.update(&volume);
        assert_eq!(field.distance(&Point3::origin()), None);
        assert_eq!(
            field.line_of_sight(&Point3::origin(), &Point3::origin(), 0.1),
            LineOfSight::Unknown { at: Point3::origin() }
        );
        assert!(PlaceGraph::new(PlaceConfig::default()).unwrap().update(&field).is_empty());
    }
}

mod flat_grids {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn clearance_equals_brute_force(grid in flat_grid(12, 6), unknown in any::<bool>()) {
            let found = clearance(&grid, unknown);
            let is_obstacle = |c: Cell| c == Cell::Occupied || unknown && c == Cell::Unknown;
            for (i, value) in found.iter().enumerate() {
                let mut best = f64::INFINITY;
                for (j, cell) in grid.cells.iter().enumerate() {
                    if is_obstacle(*cell) {
                        let dx = (i % grid.width) as f64 - (j % grid.width) as f64;
                        let dy = (i / grid.width) as f64 - (j / grid.width) as f64;
                        best = best.min(dx.hypot(dy));
                    }
                }
                let expected = best * grid.resolution_m;
                prop_assert!(f64::from(*value) == expected || (f64::from(*value) - expected).abs() < 1e-6);
            }
        }

        #[test]
        fn filling_only_frees_and_a_second_time_does_nothing(grid in flat_grid(12, 6), area in 0.0f64..0.1, side in 0.0f64..0.3) {
            let filled = fill_islands(&grid, area, side);
            for (before, after) in grid.cells.iter().zip(&filled.cells) {
                prop_assert!(before == after || *after == Cell::Free);
            }
            prop_assert_eq!(fill_islands(&filled, area, side), filled);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn a_slice_agrees_with_its_voxels(scans in prop::collection::vec(scan(), 1..3), low in -1.0f64..0.5, height in 0.05f64..1.0) {
            let volume = volume_of(&scans);
            let grid = volume.slice(low, low + height, None);
            for iy in 0..grid.height {
                for ix in 0..grid.width {
                    let c = grid.center(ix, iy);
                    let (mut occupied, mut free, mut total) = (0, 0, 0);
                    for k in -60..60 {
                        let z = (f64::from(k) + 0.5) * 0.05;
                        if z >= low && z <= low + height {
                            total += 1;
                            match volume.observe(&Point3::new(c.x, c.y, z)) {
                                Cell::Occupied => occupied += 1,
                                Cell::Free => free += 1,
                                Cell::Unknown => {}
                            }
                        }
                    }
                    let expected = if occupied > 0 {
                        Cell::Occupied
                    } else if total > 0 && 2 * free >= total {
                        Cell::Free
                    } else {
                        Cell::Unknown
                    };
                    prop_assert_eq!(grid.get(ix, iy), expected);
                }
            }
        }
    }
}

mod distance {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        #[test]
        fn incremental_equals_batch_and_brute_force(scans in prop::collection::vec(scan(), 1..4), reach in 0.3f64..1.2) {
            let mut volume = Volume::new(VolumeConfig { max_range_m: 2.5, ..VolumeConfig::default() }).unwrap();
            let mut field = DistanceField::new(0.2, reach);
            for (origin, points) in &scans {
                let few: Vec<_> = points.iter().take(12).copied().collect();
                volume.integrate(origin, &few).unwrap();
                volume.integrate(origin, &few).unwrap();
                field.update(&volume);
            }
            field.check_invariants();
            prop_assert_eq!(field.update(&volume).cells_changed, 0);
            let mut batch = DistanceField::new(0.2, reach);
            batch.update(&volume);
            for k in 0..500 {
                let f = |m: i32| f64::from(k * m % 499) / 499.0 * 5.0 - 2.5;
                let p = Point3::new(f(3), f(47), f(211));
                prop_assert_eq!(field.distance(&p), batch.distance(&p));
                // Beside the map the two grids may end at different places.
                if field.distance(&p).is_some() {
                    prop_assert_eq!(field.nearest_obstacle(&p), batch.nearest_obstacle(&p));
                }
                if let (Some(d), Some(at)) = (field.distance(&p), field.nearest_obstacle(&p)) {
                    // Interpolation is between cells; a cell's own obstacle is at most a cell's diagonal farther.
                    prop_assert!(d <= (at - p).norm() + 2.0 * 0.2 * 3f64.sqrt());
                }
            }
        }

        #[test]
        fn sight_is_blocked_exactly_when_a_sample_is_below_the_margin(scans in prop::collection::vec(scan(), 1..3),
            a in (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0), b in (-2.0f64..2.0, -2.0f64..2.0, -2.0f64..2.0), margin in 0.0f64..0.3) {
            let volume = volume_of(&[scans.clone(), scans].concat());
            let mut field = DistanceField::new(0.1, 1.0);
            field.update(&volume);
            let (a, b) = (Point3::new(a.0, a.1, a.2), Point3::new(b.0, b.1, b.2));
            let on_segment = |at: Point3<f64>| ((at - a).norm() + (b - at).norm() - (b - a).norm()).abs() < 1e-6;
            match field.line_of_sight(&a, &b, margin) {
                LineOfSight::Blocked { at } => {
                    prop_assert!(on_segment(at));
                    prop_assert!(field.state(&at) == Cell::Occupied || field.distance(&at).unwrap() < margin);
                }
                LineOfSight::Unknown { at } => {
                    prop_assert!(on_segment(at));
                    prop_assert_eq!(field.state(&at), Cell::Unknown);
                }
                LineOfSight::Clear => {
                    for k in 0..=10 {
                        let p = a + (b - a) * (f64::from(k) / 10.0);
                        // Between the samples the line may dip below by what the distance changes over a quarter of a cell.
                        if let Some(d) = field.distance(&p) {
                            prop_assert!(d >= margin - 0.06, "{} at {}", d, p);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_field_that_may_not_grow_leaves_the_rest_out_and_keeps_what_it_has() {
        let wall = |x: f32| (0..400).map(move |i| Point3::new(x, (i % 20) as f32 * 0.04, (i / 20) as f32 * 0.04));
        let mut volume = Volume::new(VolumeConfig { min_weight: 1, ..VolumeConfig::default() }).unwrap();
        volume.integrate(&Point3::origin(), &wall(1.0).collect::<Vec<_>>()).unwrap();
        let (mut free, mut bounded) = (DistanceField::new(0.1, 1.0), DistanceField::new(0.1, 1.0).limited_to(100_000));
        assert_eq!((free.update(&volume).refused_blocks, bounded.update(&volume).refused_blocks), (0, 0));
        let near = Point3::new(0.55, 0.3, 0.3);
        let before = bounded.distance(&near);
        assert!(before.is_some() && before == free.distance(&near));
        volume.integrate(&Point3::origin(), &wall(-9.0).collect::<Vec<_>>()).unwrap();
        assert_eq!(free.update(&volume).refused_blocks, 0);
        assert!(bounded.update(&volume).refused_blocks > 0);
        let far = Point3::new(-8.45, 0.3, 0.3);
        assert!(free.distance(&far).is_some() && bounded.distance(&far).is_none());
        assert_eq!((bounded.distance(&near), free.distance(&near)), (before, before));
    }

    #[test]
    fn occupied_points_are_the_occupied_cells_of_the_box() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        for _ in 0..4 {
            volume
                .integrate(&Point3::origin(), &[Point3::new(1.02, 0.02, 0.02), Point3::new(0.02, 1.52, 0.02)])
                .unwrap();
        }
        let mut field = DistanceField::new(0.1, 2.0);
        field.update(&volume);
        let inside = field.occupied_points(&Point3::new(0.5, -0.5, -0.5), &Point3::new(1.4, 0.5, 0.5));
        assert!(!inside.is_empty());
        for p in &inside {
            assert_eq!(field.state(p), Cell::Occupied);
            assert!(p.x > 0.9 && p.x < 1.3 && p.y.abs() < 0.15, "{p}");
        }
        let all = field.occupied_points(&Point3::new(-9.0, -9.0, -9.0), &Point3::new(9.0, 9.0, 9.0));
        assert!(all.len() > inside.len());
        assert!(field.occupied_points(&Point3::new(f64::NAN, 0.0, 0.0), &Point3::origin()).is_empty());
    }
}

mod mesh {
    use super::*;

    /// A wall of returns x = 1.5 + slope * y, seen from the origin.
    fn wall(slope: f32) -> Vec<Point3<f32>> {
        let mut points = Vec::new();
        for i in -50..=50i16 {
            for j in -50..=50i16 {
                let (y, z) = (f32::from(i) * 0.02, f32::from(j) * 0.02);
                points.push(Point3::new(1.5 + slope * y, y, z));
            }
        }
        points
    }

    #[test]
    fn a_plane_is_meshed_on_the_plane_facing_the_sensor() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let points = wall(0.2);
        for _ in 0..5 {
            volume.integrate(&Point3::origin(), &points).unwrap();
        }
        volume.vote_labels(&points.iter().map(|p| (*p, 7)).collect::<Vec<_>>());
        let delta = volume.update_mesh();
        let mesh = volume.mesh();
        assert_eq!((delta.vertices, delta.removed.len()), (mesh.vertices.len(), 0));
        assert!(mesh.faces.len() > 1000, "{} faces", mesh.faces.len());
        let mut error = 0.0;
        for v in &mesh.vertices {
            error += ((v.x - 1.5 - 0.2 * v.y) / 1.0198).abs();
        }
        error /= mesh.vertices.len() as f32;
        assert!(error < 0.008, "mean distance to the plane {error}");
        let labelled = mesh.labels.iter().filter(|l| **l == 7).count();
        assert!(labelled * 10 > mesh.labels.len() * 9, "{labelled} of {}", mesh.labels.len());
        let mut facing = 0;
        for face in &mesh.faces {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            facing += usize::from((b - a).cross(&(c - a)).dot(&-a.coords) > 0.0);
        }
        assert!(facing * 100 > mesh.faces.len() * 98, "{facing} of {} face the sensor", mesh.faces.len());
        // Nothing new: nothing to do. A block on its own is a part of the whole.
        assert!(volume.update_mesh().updated.is_empty());
        let parts: usize = delta.updated.iter().map(|key| volume.block_mesh(*key).unwrap().faces.len()).sum();
        assert_eq!(parts, mesh.faces.len());
    }

    #[test]
    fn incremental_follows_a_wall_that_goes_away() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        for _ in 0..5 {
            volume.integrate(&Point3::origin(), &wall(0.0)).unwrap();
        }
        volume.update_mesh();
        let farther: Vec<_> = wall(0.0).iter().map(|p| Point3::new(p.x * 1.6, p.y * 1.6, p.z * 1.6)).collect();
        for _ in 0..10 {
            volume.integrate(&Point3::origin(), &farther).unwrap();
        }
        let delta = volume.update_mesh();
        assert!(!delta.removed.is_empty() && !delta.updated.is_empty());
        let mesh = volume.mesh();
        let left =
            mesh.vertices.iter().filter(|v| (v.x - 1.5).abs() < 0.2 && v.y.abs() < 0.9 && v.z.abs() < 0.9).count();
        let new = mesh.vertices.iter().filter(|v| (v.x - 2.4).abs() < 0.05).count();
        assert!(left * 100 <= new, "{left} left, {new} new");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn every_face_names_vertices_and_ply_gives_the_mesh_back(scans in prop::collection::vec(scan(), 1..3)) {
            let mut volume = volume_of(&[scans.clone(), scans].concat());
            volume.update_mesh();
            let mesh = volume.mesh();
            prop_assert_eq!(mesh.vertices.len(), mesh.labels.len());
            for face in &mesh.faces {
                prop_assert!(face.iter().all(|v| (*v as usize) < mesh.vertices.len()));
            }
            let mut bytes = Vec::new();
            volume.write_mesh_ply(&mut bytes).unwrap();
            prop_assert_eq!(Mesh::read_ply(&bytes[..]).unwrap(), mesh);
        }

        #[test]
        fn completing_the_mesh_again_and_again_gives_what_a_rebuild_gives(scans in prop::collection::vec(scan(), 1..5), lags in any::<u8>()) {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            for (k, (origin, points)) in scans.iter().enumerate() {
                for _ in 0..3 {
                    volume.integrate(origin, points).unwrap();
                    // Some updates leave small changes out: they must not be forgotten.
                    if lags >> k & 1 == 1 {
                        volume.update_mesh();
                    }
                }
                let labelled: Vec<_> = points.iter().take(k).map(|p| (*p, 3)).collect();
                volume.vote_labels(&labelled);
                volume.complete_mesh();
                let mut rebuilt = volume.clone();
                let delta = rebuilt.rebuild_mesh();
                prop_assert_eq!(volume.mesh(), rebuilt.mesh());
                prop_assert_eq!((delta.vertices, delta.faces / 2), (volume.mesh().vertices.len(), delta.faces - delta.faces / 2));
            }
        }

        #[test]
        fn broken_ply_is_an_error_and_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..80), cut in 0usize..300) {
            let header = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty ushort label\nelement face 9\nproperty list uchar uint vertex_indices\nend_header\n";
            let mut file = header.to_vec();
            file.extend_from_slice(&bytes);
            file.truncate(cut.max(1));
            let _ = Mesh::read_ply(&file[..]);
            prop_assert!(Mesh::read_ply(&bytes[..]).is_err());
        }
    }
}

mod places {
    use super::*;

    #[test]
    fn replaying_the_events_gives_the_graph() {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let mut field = DistanceField::new(0.1, 2.0);
        let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
        let mut places = std::collections::BTreeMap::new();
        let mut edges = std::collections::BTreeMap::new();
        let mut ever = std::collections::BTreeSet::new();
        // A sphere of returns round a robot that moves, with a pillar that comes and goes.
        for step in 0..8 {
            let origin = Point3::new(0.3 * f64::from(step), 0.0, 0.0);
            let mut points = Vec::new();
            for i in 0..4000 {
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 4000.0;
                let a = f64::from(i) * 2.399_963;
                let r = (1.0 - z * z).sqrt();
                let direction = nalgebra::Vector3::new(r * a.cos(), r * a.sin(), z);
                let is_pillar = step % 3 == 1 && direction.y > 0.95;
                points.push((origin + direction * if is_pillar { 1.0 } else { 2.2 }).cast::<f32>());
            }
            for _ in 0..3 {
                volume.integrate(&origin, &points).unwrap();
            }
            field.update(&volume);
            for event in graph.update(&field) {
                match event {
                    PlaceEvent::Created(p) => {
                        assert!(ever.insert(p.id), "{} is used twice", p.id);
                        assert!(places.insert(p.id, p).is_none());
                    }
                    PlaceEvent::Updated(p) => assert!(places.insert(p.id, p).is_some()),
                    PlaceEvent::Removed(id) => {
                        assert!(places.remove(&id).is_some());
                        assert!(edges.keys().all(|(a, b)| *a != id && *b != id), "edges go before their places");
                    }
                    PlaceEvent::EdgeAdded(e) => {
                        assert!(places.contains_key(&e.a) && places.contains_key(&e.b));
                        edges.insert((e.a, e.b), e);
                    }
                    PlaceEvent::EdgeRemoved(a, b) => assert!(edges.remove(&(a, b)).is_some()),
                }
            }
            graph.check_invariants();
            assert_eq!(places.values().copied().collect::<Vec<_>>(), graph.places());
            assert_eq!(edges.values().copied().collect::<Vec<_>>(), graph.edges());
        }
        assert!(!graph.places().is_empty());
    }

    #[test]
    fn settings_that_make_no_sense_are_refused() {
        let base = PlaceConfig::default;
        assert!(PlaceGraph::new(PlaceConfig { spacing_m: f64::NAN, ..base() }).is_err());
        assert!(PlaceGraph::new(PlaceConfig { merge_m: 2.0, ..base() }).is_err());
        assert!(PlaceGraph::new(PlaceConfig { height_band_m: Some([1.0, 1.0]), ..base() }).is_err());
    }
}
