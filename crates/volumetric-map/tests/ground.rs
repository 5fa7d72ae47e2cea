//! Height maps, footing, and skeletons of flat maps.

mod support;

use nalgebra::{Point2, Point3};
use proptest::prelude::*;
use support::{CABINET, HEIGHT, Lidar, TABLE, World, drive, flat_grid, in_world};
use volumetric_map::{Cell, Column, Footing, GroundLimits, HeightMap, Volume, VolumeConfig, clearance, skeleton};

/// A hall of 6 m x 4 m: a platform of 0.10 m, a crate of 0.35 m, a beam 0.6 m above the floor, and a ramp of small steps.
fn hall() -> World {
    let mut world = World::default();
    world.push([-1.0, -1.0, -0.2], [7.0, 5.0, 0.0], support::FLOOR);
    world.push([-1.0, -1.0, HEIGHT], [7.0, 5.0, HEIGHT + 0.2], support::CEILING);
    world.wall(false, 0.0, -0.05, 4.05, &[]);
    world.wall(false, 6.0, -0.05, 4.05, &[]);
    world.wall(true, 0.0, -0.05, 6.05, &[]);
    world.wall(true, 4.0, -0.05, 6.05, &[]);
    world.push([0.05, 2.6, 0.0], [1.6, 3.95, 0.10], TABLE);
    world.push([4.6, 2.8, 0.0], [5.4, 3.6, 0.35], CABINET);
    world.push([2.8, 0.05, 0.6], [3.2, 1.4, 0.75], TABLE);
    world
}

fn mapped() -> &'static Volume {
    static MAP: std::sync::OnceLock<Volume> = std::sync::OnceLock::new();
    MAP.get_or_init(|| {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let mut lidar = Lidar::new(48, 512, 0.01, 3);
        lidar.fov_rad = 80f64.to_radians();
        let way = [[1.0, 1.0], [2.4, 2.0], [4.0, 2.0], [5.3, 1.2], [4.0, 1.6], [2.2, 3.0], [1.9, 0.7]];
        for (pose, _) in drive(&way, 0.9, 0.15) {
            let points = in_world(&lidar.scan(&hall(), &pose), &pose);
            volume.integrate(&pose.translation.vector.into(), &points).unwrap();
        }
        volume
    })
}

fn map() -> HeightMap {
    mapped().height_map(&Point3::new(2.0, 2.0, 0.3), 0.15, 4.5)
}

#[test]
fn floor_platform_crate_and_beam_are_told_apart() {
    let map = map();
    let ground = |x: f64, y: f64| map.ground_at(&Point2::new(x, y));
    for (x, y, height, headroom) in
        [(2.0, 1.0, 0.0, HEIGHT), (3.9, 3.0, 0.0, HEIGHT), (0.8, 3.2, 0.10, HEIGHT - 0.10), (3.0, 0.8, 0.0, 0.6)]
    {
        let found = ground(x, y).unwrap_or_else(|| panic!("no ground at {x} {y}"));
        assert!((f64::from(found.z_m) - height).abs() < 0.03, "{x} {y}: {found:?}");
        assert!((f64::from(found.headroom_m) - headroom).abs() < 0.08, "{x} {y}: {found:?}");
        assert!(found.is_covered, "{x} {y}: {found:?}");
    }
    assert_eq!(ground(5.0, 3.2), None, "the crate is too high to climb");
    let limits = GroundLimits::default();
    let footing = map.footing(&limits);
    let at = |x: f64, y: f64| footing[map.column_of(&Point2::new(x, y)).unwrap()];
    assert_eq!([at(2.0, 1.0), at(0.8, 3.2), at(3.0, 0.8)], [Footing::Good, Footing::Good, Footing::Low]);
    // Round the crate there is a wall, and nothing beyond the walls is known.
    assert!((0..16).any(|k| at(4.3 + 0.05 * f64::from(k), 3.2) == Footing::Step));
    assert_eq!(at(-0.4, 2.0), Footing::Unknown);
    // The crate can be climbed by who climbs 0.4 m, and then has ground.
    let climber = mapped().height_map(&Point3::new(2.0, 2.0, 0.3), 0.4, 4.5);
    let top = climber.ground_at(&Point2::new(5.0, 3.2)).unwrap();
    assert!((top.z_m - 0.35).abs() < 0.03, "{top:?}");
    let strict = GroundLimits { max_step_m: 0.07, ..limits };
    let (lenient, strict) = (map.drivable_grid(&limits), map.drivable_grid(&strict));
    assert!(strict.count(Cell::Free) < lenient.count(Cell::Free), "the edge of the platform is a step to some");
    // A taller robot gets no more room.
    let tall = map.drivable_grid(&GroundLimits { height_m: 1.5, ..limits });
    for (low, tall) in lenient.cells.iter().zip(&tall.cells) {
        assert!(*tall != Cell::Free || *low == Cell::Free);
    }
}

#[test]
fn what_is_drivable_is_free_up_to_the_robots_height() {
    let (volume, map) = (mapped(), map());
    let limits = GroundLimits::default();
    let mut good = 0;
    for (column, footing) in map.footing(&limits).into_iter().enumerate() {
        let Column::Ground(ground) = map.columns[column] else {
            assert_ne!(footing, Footing::Good);
            continue;
        };
        let center = |k: usize| map.resolution_m * (k as f64 + 0.5);
        let (x, y) = (map.origin.x + center(column % map.width), map.origin.y + center(column / map.width));
        // Brute force: the first voxel above the surface that is not free.
        let mut z = (f64::from(ground.z_m) / 0.05 - 1e-4).floor();
        while volume.observe(&Point3::new(x, y, (z + 0.5) * 0.05)) == Cell::Occupied {
            z += 1.0;
        }
        while volume.observe(&Point3::new(x, y, (z + 0.5) * 0.05)) == Cell::Free {
            z += 1.0;
        }
        assert!((z * 0.05 - f64::from(ground.z_m) - f64::from(ground.headroom_m)).abs() < 1e-4, "{x} {y}");
        good += usize::from(footing == Footing::Good);
    }
    assert!(good > 4000, "{good}");
}

#[test]
fn nowhere_and_nothing_give_unknown() {
    let volume = mapped();
    assert!(volume.height_map(&Point3::new(f64::NAN, 0.0, 0.0), 0.1, 2.0).columns.is_empty());
    assert!(volume.height_map(&Point3::origin(), 0.1, f64::INFINITY).columns.is_empty());
    let far = volume.height_map(&Point3::new(50.0, 0.0, 0.0), 0.1, 1.0);
    assert!(far.columns.iter().all(|column| *column == Column::Unknown) && far.columns.len() == 41 * 41);
    assert_eq!(far.ground_at(&Point2::new(50.0, 0.0)), None);
}

#[test]
fn the_ground_ends_at_a_drop_that_was_looked_into() {
    // A landing at z = 0 for x < 2, a hall one metre below for x > 2.
    let mut world = World::default();
    world.push([-3.0, -3.0, -0.3], [2.0, 3.0, 0.0], support::FLOOR);
    world.push([1.0, -3.0, -1.3], [6.0, 3.0, -1.0], support::FLOOR);
    world.push([-3.1, -3.1, -1.3], [-3.0, 3.1, 2.0], support::WALL);
    world.push([6.0, -3.1, -1.3], [6.1, 3.1, 2.0], support::WALL);
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut lidar = Lidar::new(64, 512, 0.005, 3);
    (lidar.fov_rad, lidar.tilt_rad) = (100f64.to_radians(), 0.0);
    for (pose, _) in drive(&[[0.0, 0.0], [1.7, 0.0]], 0.8, 0.1) {
        let points = in_world(&lidar.scan(&world, &pose), &pose);
        volume.integrate(&pose.translation.vector.into(), &points).unwrap();
    }
    let map = volume.height_map(&Point3::new(1.0, 0.0, 0.5), 0.15, 2.5);
    assert!(map.ground_at(&Point2::new(1.2, 0.0)).is_some());
    assert!(map.ground_at(&Point2::new(2.5, 0.0)).is_none(), "nobody steps down a metre");
    let footing = map.footing(&GroundLimits::default());
    let at = |x: f64| footing[map.column_of(&Point2::new(x, 0.0)).unwrap()];
    let edge: Vec<_> = (0..12).map(|k| at(1.775 + 0.05 * f64::from(k))).collect();
    assert!(edge.contains(&Footing::Drop), "{edge:?}");
    assert!((0..4).all(|k| at(1.2 + 0.1 * f64::from(k)) == Footing::Good));
}

/// Pieces of true cells; `diagonal` joins eight neighbours instead of four.
fn pieces(width: usize, is_in: &[bool], diagonal: bool) -> usize {
    let height = is_in.len() / width;
    let mut seen = vec![false; is_in.len()];
    let mut count = 0;
    for start in 0..is_in.len() {
        if seen[start] || !is_in[start] {
            continue;
        }
        count += 1;
        seen[start] = true;
        let mut stack = vec![start];
        while let Some(cell) = stack.pop() {
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
                let x = (cell % width).wrapping_add_signed(dx);
                let y = (cell / width).wrapping_add_signed(dy);
                if (dx == 0 || dy == 0 || diagonal) && x < width && y < height {
                    let other = y * width + x;
                    if is_in[other] && !seen[other] {
                        seen[other] = true;
                        stack.push(other);
                    }
                }
            }
        }
    }
    count
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_skeleton_is_as_connected_as_free_space_and_knows_its_clearance(grid in flat_grid(18, 9), angle in 0.5f64..3.2) {
        let found = skeleton(&grid, angle, 0.0);
        prop_assert!(found.cells.windows(2).all(|w| w[0] < w[1]));
        let truth = clearance(&grid, true);
        let mut is_line = vec![false; grid.cells.len()];
        for (cell, metres) in found.cells.iter().zip(&found.clearance_m) {
            prop_assert_eq!(grid.cells[*cell], Cell::Free);
            prop_assert_eq!(*metres, truth[*cell]);
            is_line[*cell] = true;
        }
        let is_free: Vec<bool> = grid.cells.iter().map(|cell| *cell == Cell::Free).collect();
        prop_assert_eq!(pieces(grid.width, &is_line, true), pieces(grid.width, &is_free, true));
        // Holes are pieces of the rest, which hangs together outside the grid: so give it a margin.
        let rest = |is_in: &[bool]| {
            let width = grid.width + 2;
            let mut framed = vec![true; width * (grid.height + 2)];
            for (cell, inside) in is_in.iter().enumerate() {
                framed[(cell / grid.width + 1) * width + cell % grid.width + 1] = !inside;
            }
            pieces(width, &framed, false)
        };
        prop_assert_eq!(rest(&is_line), rest(&is_free));
    }
}
