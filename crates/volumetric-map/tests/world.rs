//! End to end in a synthetic world: what the robot must be able to rely on.

mod support;

use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector3};
use support::{DOOR_HEIGHT, HEIGHT, Lidar, World, drive, in_world, pose};
use volumetric_map::{
    Cell, DistanceField, LineOfSight, OccupancyGrid, PlaceConfig, PlaceGraph, Volume, VolumeConfig, clearance,
};

const LIDAR_HEIGHT: f64 = 0.61;
const NOISE_M: f64 = 0.015;
/// A cell may stick out by one voxel (0.05 m): then its centre is at most half a voxel off the surface; a thin thing (a leg, an edge) may
/// throw a shadow of one more behind it.
const STICK_OUT_M: f64 = 0.051;

/// Drives a way with perfect poses.
fn mapped(world: &World, way: &[[f64; 2]], step_m: f64) -> Volume {
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(32, 512, NOISE_M, 1);
    for (pose, _) in drive(way, LIDAR_HEIGHT, step_m) {
        let points = in_world(&lidar.scan(world, &pose), &pose);
        volume.integrate(&pose.translation.vector.into(), &points).unwrap();
    }
    volume
}

/// The two rooms, mapped once for all tests that only read.
fn two_rooms_mapped() -> &'static Volume {
    static MAP: std::sync::OnceLock<Volume> = std::sync::OnceLock::new();
    MAP.get_or_init(|| mapped(&World::two_rooms(), &TWO_ROOMS_WAY, 0.1))
}

const TWO_ROOMS_WAY: [[f64; 2]; 5] = [[1.5, 1.2], [3.5, 2.0], [6.5, 2.0], [8.0, 2.6], [8.4, 3.0]];

/// Ground cells that are wrong against the truth: occupied although more than `tolerance` from anything, and free although inside a
/// solid.
fn ground_errors(world: &World, grid: &OccupancyGrid, tolerance: f64) -> (usize, usize) {
    let (mut sticking_out, mut eaten) = (0, 0);
    for iy in 0..grid.height {
        for ix in 0..grid.width {
            let c = grid.center(ix, iy);
            match grid.get(ix, iy) {
                Cell::Occupied if world.flat_distance(c.x, c.y, 0.1, 1.2) > tolerance => sticking_out += 1,
                // The table tops are left out: most of their underside, 9 cm above the sensor, is never hit by any ray.
                Cell::Free if world.flat_distance(c.x, c.y, 0.1, 0.65) == 0.0 => eaten += 1,
                _ => {}
            }
        }
    }
    (sticking_out, eaten)
}

#[test]
fn walls_legs_and_doors_of_two_rooms_are_right() {
    let world = World::two_rooms();
    let volume = two_rooms_mapped();
    volume.check_invariants();
    let grid = volume.ground_grid(0.0, 0.10, 1.2);
    let (sticking_out, eaten) = ground_errors(&world, &grid, STICK_OUT_M);
    assert_eq!(sticking_out, 0, "occupied cells that stick out");
    assert_eq!(eaten, 0, "free cells inside solids");
    // The door stays open over its whole width less a voxel on each side, and the wall beside it is closed.
    for y in [1.575, 1.725, 2.0, 2.275, 2.425] {
        for x in [4.925, 4.975, 5.025, 5.075] {
            assert_eq!(grid.at(&Point2::new(x, y)), Cell::Free, "door at {x} {y}");
        }
    }
    for y in [0.5, 1.0, 1.4, 2.6, 3.0, 3.7] {
        let is_closed = [4.975, 5.025, 5.075].iter().any(|x| grid.at(&Point2::new(*x, y)) == Cell::Occupied);
        assert!(is_closed, "wall at y = {y}");
    }
    // Every table leg is there.
    for (x, y) in
        [(0.95, 2.7), (2.05, 2.7), (0.95, 3.3), (2.05, 3.3), (7.45, 0.7), (8.55, 0.7), (7.45, 1.3), (8.55, 1.3)]
    {
        let c = [-0.02, 0.02];
        let found = c.iter().any(|dx| c.iter().any(|dy| grid.at(&Point2::new(x + dx, y + dy)) == Cell::Occupied));
        assert!(found, "leg at {x} {y}");
    }
    // The slice above the doors is closed there.
    let lintel = volume.slice(DOOR_HEIGHT + 0.05, HEIGHT - 0.1, None);
    assert!((0..4).any(|k| lintel.at(&Point2::new(4.925 + 0.05 * f64::from(k), 2.0)) == Cell::Occupied), "lintel");
}

#[test]
fn the_fast_walk_gives_the_bytes_of_the_plain_one_in_a_building() {
    let world = World::two_rooms();
    let mut lidar = Lidar::new(32, 256, NOISE_M, 9);
    let (mut fast, mut plain) =
        (Volume::new(VolumeConfig::default()).unwrap(), Volume::new(VolumeConfig::default()).unwrap());
    for (pose, _) in drive(&TWO_ROOMS_WAY, LIDAR_HEIGHT, 0.4) {
        let points = in_world(&lidar.scan(&world, &pose), &pose);
        let origin = pose.translation.vector.into();
        let report = fast.integrate(&origin, &points).unwrap();
        assert_eq!(report, plain.integrate_plainly(&origin, &points).unwrap());
    }
    let (mut a, mut b) = (Vec::new(), Vec::new());
    fast.save(&mut a).unwrap();
    plain.save(&mut b).unwrap();
    assert!(a == b, "the maps differ");
    fast.check_invariants();
}

#[test]
fn a_ghost_wall_is_gone_a_second_after_the_pose_was_corrected() {
    let world = World::two_rooms();
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(32, 1024, NOISE_M, 2);
    // Three seconds with a pose that is 0.25 m and 3 degrees off, then the right one.
    let wrong = Isometry3::from_parts(
        Translation3::new(0.25, 0.15, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 3f64.to_radians()),
    );
    let sensor = pose(2.0, 1.8, LIDAR_HEIGHT, 0.0);
    // Occupied voxels in the open of the robot's room (behind its walls nothing can be seen), two voxels off everything.
    let ghosts = |volume: &Volume| {
        // Up to 1.2 m: what a ground robot meets.
        let mut count = 0;
        for (z, y, x) in (2..24).flat_map(|z| (2..79).flat_map(move |y| (2..98).map(move |x| (z, y, x)))) {
            let p = volume.voxel_center([x, y, z]);
            count += usize::from(volume.observe(&p) == Cell::Occupied && world.distance(&p) > 0.10);
        }
        count
    };
    let mut history = Vec::new();
    for k in 0..50 {
        let estimate = if k < 30 { wrong * sensor } else { sensor };
        let points = in_world(&lidar.scan(&world, &sensor), &estimate);
        volume.integrate(&estimate.translation.vector.into(), &points).unwrap();
        if k >= 29 {
            history.push(ghosts(&volume));
        }
    }
    // The tilted sensor sees each direction for about half of its two-second turn, so the last ones take that long.
    assert!(history[0] > 3000, "the wrong pose makes ghosts: {history:?}");
    assert!(history[10] * 20 <= history[0], "after a second at most a twentieth is left: {history:?}");
    assert!(history[15] * 100 <= history[0], "after a second and a half at most a hundredth: {history:?}");
}

#[test]
fn a_floor_seen_at_grazing_angles_and_both_walls_stay() {
    let world = World::corridor();
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(32, 512, NOISE_M, 3);
    // Drive down, then stand at the end and look back for four seconds.
    let mut poses: Vec<_> = drive(&[[1.0, 1.0], [12.5, 1.0]], LIDAR_HEIGHT, 0.1).into_iter().map(|p| p.0).collect();
    let check = |volume: &Volume| {
        let (mut floor, mut walls, mut cells) = (0, 0, 0);
        for k in 0..110 {
            let x = 1.5 + 0.1 * f64::from(k);
            let solid = |y: f64, z: f64, dy: f64, dz: f64| {
                [-0.5, 0.5].iter().any(|s| volume.observe(&Point3::new(x, y + s * dy, z + s * dz)) == Cell::Occupied)
            };
            for j in 0..8 {
                cells += 1;
                floor += usize::from(solid(0.3 + 0.2 * f64::from(j), 0.0, 0.0, 0.05));
                walls += usize::from(solid(0.05, 0.2 + 0.25 * f64::from(j), 0.05, 0.0));
            }
        }
        (floor, walls, cells)
    };
    for pose in &poses {
        let points = in_world(&lidar.scan(&world, pose), pose);
        volume.integrate(&pose.translation.vector.into(), &points).unwrap();
    }
    let before = check(&volume);
    poses = vec![pose(12.5, 1.0, LIDAR_HEIGHT, 3.0); 40];
    for pose in &poses {
        let points = in_world(&lidar.scan(&world, pose), pose);
        volume.integrate(&pose.translation.vector.into(), &points).unwrap();
    }
    let after = check(&volume);
    assert!(before.0 * 100 >= 99 * before.2 && before.1 * 100 >= 99 * before.2, "mapped: {before:?}");
    assert!(after.0 * 100 >= 99 * after.2 && after.1 * 100 >= 99 * after.2, "kept: {after:?}");
}

#[test]
fn a_drifting_robot_keeps_doors_open_and_walls_closed_where_it_is() {
    let world = World::two_rooms();
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(32, 512, NOISE_M, 4);
    // Three times through the door and back: 40 m with 0.5 % of the way and 0.5 degrees per 10 m, as issue 2 has it.
    let lap = [[1.5, 1.2], [3.5, 2.0], [6.5, 2.0], [8.0, 2.6], [6.5, 2.0], [3.5, 2.0]];
    let way: Vec<[f64; 2]> = lap.iter().cycle().take(3 * lap.len() + 1).copied().collect();
    let (mut doors, mut checks) = (0, 0);
    let (mut ghosts, mut cells) = (0, 0);
    let mut poses = drive(&way, LIDAR_HEIGHT, 0.12);
    // Then stand for a second and a half.
    let driven = poses.len();
    poses.extend(vec![*poses.last().unwrap(); 15]);
    for (step, (sensor, travelled)) in poses.into_iter().enumerate() {
        let drift = Isometry3::from_parts(
            Translation3::new(0.004 * travelled, 0.003 * travelled, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), (0.05 * travelled).to_radians()),
        );
        let estimate = drift * sensor;
        let points = in_world(&lidar.scan(&world, &sensor), &estimate);
        volume.integrate(&estimate.translation.vector.into(), &points).unwrap();
        let is_end = step + 1 == driven + 15;
        if step % 20 != 19 && !is_end {
            continue;
        }
        // Around the robot, the map must be right in the robot's own (drifted) frame: 2.5 m is what it needs to stop and turn.
        let grid = volume.ground_grid(0.0, 0.10, 1.2);
        let back = drift.inverse();
        let here = estimate.translation.vector;
        let mut stick_out = 0;
        for iy in 0..grid.height {
            for ix in 0..grid.width {
                let c = grid.center(ix, iy);
                let true_c = back * Point3::new(c.x, c.y, 0.5);
                // What the robot can see: not through walls.
                let ray = Vector3::new(c.x - here.x, c.y - here.y, 0.0);
                let length = ray.norm();
                if length > 2.5 || grid.get(ix, iy) != Cell::Occupied {
                    continue;
                }
                let in_true = back.rotation * ray;
                let origin = sensor.translation.vector;
                let is_visible =
                    world.cast(&origin, &(in_true / length)).is_none_or(|(range, _)| range > length + 0.05);
                cells += usize::from(is_visible);
                if is_visible && world.flat_distance(true_c.x, true_c.y, 0.1, 1.2) > 0.08 {
                    stick_out += 1;
                }
            }
        }
        ghosts += stick_out;
        assert!(!is_end || stick_out <= 2, "ghost cells in view after standing still: {stick_out}");
        if (sensor.translation.x - 5.0).abs() < 2.0 {
            checks += 1;
            let is_open = [-0.3, -0.15, 0.0, 0.15, 0.3].iter().all(|dy| {
                let p = drift * Point3::new(5.02, 2.0 + dy, 0.5);
                grid.at(&Point2::new(p.x, p.y)) == Cell::Free
            });
            doors += usize::from(is_open);
        }
    }
    assert!(checks >= 8);
    assert_eq!(doors, checks, "the door was open whenever the robot was near it");
    // What was seen long ago from another drift and comes into view again is wrong for the moment it takes to look at it.
    assert!(ghosts * 50 <= cells, "{ghosts} ghost cells of {cells} in view");
}

#[test]
fn distances_sight_and_places_of_two_rooms_are_true() {
    let world = World::two_rooms();
    let volume = two_rooms_mapped();
    let mut field = DistanceField::new(0.10, 2.0);
    field.update(volume);
    let cell = field.resolution_m();
    let mut worst = 0.0f64;
    for k in 0..2000 {
        let f = |m: u32, n: f64| f64::from(k * m % 1999) / 1999.0 * n;
        let p = Point3::new(0.3 + f(7, 9.4), 0.3 + f(131, 3.4), 0.3 + f(577, 1.9));
        let truth = world.distance(&p);
        if truth > 0.15
            && let Some(d) = field.distance(&p)
        {
            worst = worst.max((d - truth).abs());
        }
    }
    assert!(worst < 2.0 * cell, "worst distance error {worst}");
    let a = Point3::new(2.0, 2.0, 1.2);
    assert_eq!(field.line_of_sight(&a, &Point3::new(8.0, 2.0, 1.2), 0.1), LineOfSight::Clear);
    let LineOfSight::Blocked { at } = field.line_of_sight(&a, &Point3::new(8.0, 3.6, 1.2), 0.1) else { panic!("wall") };
    assert!((at.x - 5.0).abs() < 0.35, "{at}");
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    let events = graph.update(&field);
    graph.check_invariants();
    assert!(events.len() >= graph.places().len());
    for place in graph.places() {
        let truth = world.distance(&place.position).min(2.0);
        assert!((place.clearance_m - truth).abs() <= cell, "{place:?}, truth {truth}");
    }
    // Connected through the door: from the place of one room to the place of the other.
    let from = graph.place_at(&Point3::new(2.5, 2.0, 1.2)).unwrap();
    let to = graph.place_at(&Point3::new(7.0, 2.0, 1.2)).unwrap();
    let mut reached = vec![from];
    let mut narrowest = f64::INFINITY;
    let mut next = 0;
    while next < reached.len() {
        for edge in graph.edges() {
            for (a, b) in [(edge.a, edge.b), (edge.b, edge.a)] {
                if a == reached[next] && !reached.contains(&b) {
                    reached.push(b);
                    narrowest = narrowest.min(edge.clearance_m);
                }
            }
        }
        next += 1;
    }
    assert!(reached.contains(&to), "graph is connected through the door");
    // The next update without new scans changes nothing; ids stay.
    let again = graph.update(&field);
    assert!(again.is_empty(), "{again:?}");
}

#[test]
fn place_ids_stay_while_the_robot_goes_on() {
    let world = World::two_rooms();
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(32, 512, NOISE_M, 5);
    let mut field = DistanceField::new(0.10, 2.0);
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    let mut history = Vec::new();
    for (step, (pose, _)) in drive(&TWO_ROOMS_WAY, LIDAR_HEIGHT, 0.1).into_iter().enumerate() {
        let points = in_world(&lidar.scan(&world, &pose), &pose);
        volume.integrate(&pose.translation.vector.into(), &points).unwrap();
        if step % 5 == 4 {
            field.update(&volume);
            graph.update(&field);
            graph.check_invariants();
            history.push(graph.places().iter().map(|p| p.id).collect::<Vec<_>>());
        }
    }
    // Of the places known half-way, most are still there at the end under their own names.
    let (half, last) = (&history[history.len() / 2], history.last().unwrap());
    let kept = half.iter().filter(|id| last.contains(id)).count();
    assert!(kept * 10 >= half.len() * 7, "{kept} of {} kept, {} at the end", half.len(), last.len());
    assert!(graph.places().len() < 120, "{} places", graph.places().len());
}

#[test]
fn clearance_in_the_door_is_half_its_width() {
    let grid = two_rooms_mapped().ground_grid(0.0, 0.10, 1.2);
    let c = clearance(&grid, false);
    let (ix, iy) = grid.cell_of(&Point2::new(5.025, 2.0)).unwrap();
    let d = f64::from(c[iy * grid.width + ix]);
    assert!((d - 0.5).abs() < 0.08, "{d}");
}
