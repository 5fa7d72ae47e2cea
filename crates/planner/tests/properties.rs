//! Laws of the planner.
mod support;

#[cfg(feature = "ground")]
mod routes {
    use super::support::clutter::{clutter, place};
    use super::support::{Picture, flat};
    use nalgebra::Point2;
    use planner::VisibilityGraph;
    use proptest::prelude::*;

    const RADIUS_M: f64 = 0.386;

    fn check_clearance(picture: &Picture, points: &[Point2<f64>], clearance_m: f64) {
        for leg in points.windows(2) {
            let n = ((leg[1] - leg[0]).norm() / 0.02).ceil().max(1.0) as usize;
            for k in 0..=n {
                let p = leg[0] + (leg[1] - leg[0]) * (k as f64 / n as f64);
                let d = picture.distance(&p);
                assert!(d >= clearance_m - 1e-6, "clearance {d} at {p:?}");
            }
        }
    }

    /// How far a bend is moved away from walls.
    const MAX_SHIFT_M: f64 = 0.3;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_leg_keeps_the_clearance(picture in clutter(0..9, 1.2), start in place(), goal in place(), r in 0.12..0.5f64) {
            let graph = VisibilityGraph::build(&picture.view(), r).unwrap();
            if let Some(route) = graph.route(&start, &goal) {
                check_clearance(&picture, &route.points, r);
                let sum: f64 = route.points.windows(2).map(|l| (l[1] - l[0]).norm()).sum();
                prop_assert!((sum - route.length_m).abs() < 1e-9);
                prop_assert!((route.points[0] - start).norm() <= route.start_pull_m + 1e-9);
                prop_assert!((route.points[route.points.len() - 1] - goal).norm() <= route.goal_pull_m + 1e-9);
            }
        }

        #[test]
        fn lengths_agree_with_routes_and_with_each_other(picture in clutter(0..9, 1.2), start in place(), goals in proptest::collection::vec(place(), 1..6)) {
            let graph = VisibilityGraph::build(&picture.view(), 0.3).unwrap();
            let lengths = graph.lengths_from(&start, &goals);
            for (goal, length) in goals.iter().zip(&lengths) {
                let route = graph.route(&start, goal);
                prop_assert_eq!(route.is_some(), length.is_some());
                if let (Some(route), Some(length)) = (route, length) {
                    // Only the bends of a route are moved, `MAX_SHIFT_M` at most, and with each the two legs beside it.
                    let bends = route.points.len().saturating_sub(2) as f64;
                    let apart_m = (route.length_m - length).abs();
                    prop_assert!(apart_m <= 2.0 * MAX_SHIFT_M * bends + 1e-9, "{} vs {}", route.length_m, length);
                }
            }
        }

        #[test]
        fn nearest_reachable_is_reachable(picture in clutter(0..9, 1.2), start in place(), goal in place()) {
            let graph = VisibilityGraph::build(&picture.view(), 0.3).unwrap();
            if let Some((point, distance_m)) = graph.nearest_reachable(&start, &goal) {
                prop_assert!(((point - goal).norm() - distance_m).abs() < 1e-9);
                prop_assert!(graph.route(&start, &point).is_some());
            }
        }
    }

    #[test]
    fn one_metre_doors_are_passed_at_any_offset() {
        for seed in 1..=5 {
            let picture = flat(1.0, seed * 1000);
            let graph = VisibilityGraph::build(&picture.view(), RADIUS_M + 0.02).unwrap();
            let route = graph.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0));
            if let Some(route) = route {
                check_clearance(&picture, &route.points, RADIUS_M + 0.02);
            }
        }
        // A wall with a door of 1.0 m: the cells it touches leave 18 to 20 free cells, wherever it lies.
        for free_cells in [17, 18, 19, 20] {
            for shift in 0..4 {
                let mut picture = Picture::free(4.0, 4.0, 0.05);
                picture.block(2.0, 0.0, 2.12, 4.0);
                let y = 1.5 + 0.05 * f64::from(shift);
                picture.fill(1.95, y, 2.2, y + 0.05 * f64::from(free_cells), false);
                let graph = VisibilityGraph::build(&picture.view(), RADIUS_M).unwrap();
                let route =
                    graph.route(&Point2::new(1.0, 1.0), &Point2::new(3.2, 3.0)).expect("the door is wide enough");
                check_clearance(&picture, &route.points, RADIUS_M);
            }
        }
        // Without furniture the way must exist.
        let picture = flat(1.0, 0);
        let graph = VisibilityGraph::build(&picture.view(), RADIUS_M + 0.02).unwrap();
        let route = graph.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0)).expect("doors are wide enough");
        check_clearance(&picture, &route.points, RADIUS_M + 0.02);
    }
}

#[cfg(feature = "ground")]
mod local {
    use super::support::base::step;
    use super::support::{Picture, SplitMix, flat};
    use nalgebra::Point2;
    use planner::ground::footprint::Footprint;
    use planner::{LocalPolicy, LocalPolicyConfig, LocalStatus, VisibilityGraph};
    use proptest::prelude::*;

    /// Points of the outlines of the blocked squares, every quarter of a cell.
    fn points_of(picture: &Picture) -> Vec<Point2<f32>> {
        let r = picture.resolution_m;
        let blocked = |x: i64, y: i64| {
            x >= 0
                && y >= 0
                && x < picture.width as i64
                && y < picture.height as i64
                && picture.blocked[y as usize * picture.width + x as usize]
        };
        let mut points = Vec::new();
        for y in 0..picture.height as i64 {
            for x in 0..picture.width as i64 {
                let inner = blocked(x - 1, y) && blocked(x + 1, y) && blocked(x, y - 1) && blocked(x, y + 1);
                if blocked(x, y) && !inner {
                    for k in 0..3 {
                        let t = f64::from(k) * 0.5;
                        for (dx, dy) in [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] {
                            points.push(Point2::new(((x as f64 + dx) * r) as f32, ((y as f64 + dy) * r) as f32));
                        }
                    }
                }
            }
        }
        points
    }

    fn least_distance(footprint: &Footprint, pose: (f64, f64, f64), points: &[Point2<f32>]) -> f64 {
        let (sin, cos) = pose.2.sin_cos();
        points
            .iter()
            .map(|p| (f64::from(p.x) - pose.0, f64::from(p.y) - pose.1))
            .filter(|(dx, dy)| dx.abs() < 1.0 && dy.abs() < 1.0)
            .map(|(dx, dy)| footprint.distance(&Point2::new(cos * dx + sin * dy, cos * dy - sin * dx)))
            .fold(1.0, f64::min)
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

        /// Goals behind and inside obstacles, speeds up to 1.5 m/s: the footprint never touches a point.
        #[test]
        fn never_touches_what_the_scan_shows(
            boxes in proptest::collection::vec((0.0..5.5f64, 0.0..5.5f64, 0.02..0.8f64, 0.02..0.8f64), 1..12),
            goals in proptest::collection::vec((0.0..6.0f64, 0.0..6.0f64), 1..4),
            speed in 0.3..1.5f64, accel in 0.5..2.0f64, yaw in -3.1..3.1f64, lateral in prop_oneof![Just(0.0), 0.05..0.5f64],
        ) {
            let mut picture = Picture::free(6.0, 6.0, 0.05);
            for (x, y, w, h) in boxes {
                picture.block(x, y, x + w, y + h);
            }
            picture.fill(2.4, 2.4, 3.6, 3.6, false);
            let points = points_of(&picture);
            let config = LocalPolicyConfig { max_speed_mps: speed, max_accel_mps2: accel, max_lateral_speed_mps: lateral, ..LocalPolicyConfig::default() };
            let footprint = Footprint::new(&config.footprint).unwrap();
            let mut policy = LocalPolicy::new(config).unwrap();
            let mut pose = (3.0, 3.0, yaw);
            let mut velocity = (0.0, 0.0, 0.0);
            for (gx, gy) in goals {
                let path = [Point2::new(pose.0, pose.1), Point2::new(gx, gy)];
                for _ in 0..110 {
                    let c = policy.command(pose, velocity, &path, None, &points, &[]);
                    prop_assert!(c.vx.hypot(c.vy) <= speed + 1e-9 && c.vy.abs() <= lateral + 1e-9);
                    let change = (c.vx - velocity.0).hypot(c.vy - velocity.1);
                    prop_assert!(change <= accel * 0.02 + 1e-9, "acceleration {}", change / 0.02);
                    pose = step(pose, &c, 0.02);
                    velocity = (c.vx, c.vy, c.yaw_rate);
                    prop_assert!(least_distance(&footprint, pose, &points) > 0.0);
                }
            }
        }
    }

    /// Follows routes through doors to the end, replanning nothing. Returns seconds and least distance.
    fn drive(
        picture: &Picture,
        start: (f64, f64, f64),
        goal: Point2<f64>,
        config: LocalPolicyConfig,
    ) -> (f64, f64, LocalStatus) {
        let graph = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
        let route = graph.route(&Point2::new(start.0, start.1), &goal).expect("a route");
        let points = points_of(picture);
        let footprint = Footprint::new(&config.footprint).unwrap();
        let mut policy = LocalPolicy::new(config).unwrap();
        let (mut pose, mut velocity, mut least) = (start, (0.0, 0.0, 0.0), 1.0f64);
        let mut status = LocalStatus::Driving;
        let mut near: Vec<Point2<f32>> = Vec::new();
        for cycle in 0..8000 {
            if cycle % 5 == 0 {
                // A scan every tenth of a second.
                near = points
                    .iter()
                    .filter(|p| (f64::from(p.x) - pose.0).hypot(f64::from(p.y) - pose.1) < 3.0)
                    .copied()
                    .collect();
            }
            let c = policy.command(pose, velocity, &route.points, Some(1.0), &near, &[]);
            pose = step(pose, &c, 0.02);
            velocity = (c.vx, c.vy, c.yaw_rate);
            if cycle % 5 == 0 {
                least = least.min(least_distance(&footprint, pose, &near));
            }
            status = c.status;
            if status == LocalStatus::Arrived {
                return (f64::from(cycle) * 0.02, least, status);
            }
        }
        (160.0, least, status)
    }

    #[test]
    fn passes_one_metre_doors_and_arrives() {
        let mut driven = 0;
        for seed in 0..5 {
            let picture = flat(1.0, seed * 77);
            let mut random = SplitMix(seed);
            let graph = VisibilityGraph::build(&picture.view(), 0.406).unwrap();
            let start = Point2::new(2.5, 2.0);
            let wish = Point2::new(1.0 + 15.0 * random.unit(), 1.0 + 8.0 * random.unit());
            let (goal, _) = graph.nearest_reachable(&start, &wish).expect("the start is free");
            let route = graph.route(&start, &goal).expect("reachable");
            if route.length_m < 2.0 {
                continue;
            }
            let (start, goal) = (route.points[0], route.points[route.points.len() - 1]);
            let (seconds, least, status) = drive(&picture, (start.x, start.y, 3.0), goal, LocalPolicyConfig::default());
            println!("seed {seed}: {:.1} m in {seconds:.1} s, least distance {least:.3} m, {status:?}", route.length_m);
            assert_eq!(status, LocalStatus::Arrived, "seed {seed}");
            assert!(least > 0.03 && seconds < 10.0 + route.length_m / 0.25, "seed {seed}: {seconds} s, {least} m");
            driven += 1;
        }
        assert!(driven >= 3, "{driven} flats had a route");
    }

    #[test]
    fn a_wall_across_the_path_ends_in_blocked_then_recovering_then_again() {
        let mut picture = Picture::free(6.0, 6.0, 0.05);
        picture.block(4.0, 0.0, 4.2, 6.0);
        let points = points_of(&picture);
        let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
        let (mut pose, mut velocity) = ((2.0, 3.0, 0.0), (0.0, 0.0, 0.0));
        let mut seen = Vec::new();
        for _ in 0..1500 {
            let c = policy.command(pose, velocity, &[Point2::new(2.0, 3.0), Point2::new(5.5, 3.0)], None, &points, &[]);
            pose = step(pose, &c, 0.02);
            velocity = (c.vx, c.vy, c.yaw_rate);
            if seen.last() != Some(&c.status) {
                seen.push(c.status);
            }
        }
        assert!(seen.contains(&LocalStatus::Blocked) && seen.contains(&LocalStatus::Recovering), "{seen:?}");
        assert!(pose.0 < 3.65);
    }

    #[test]
    fn rubbish_brakes() {
        let mut policy = LocalPolicy::new(LocalPolicyConfig::default()).unwrap();
        let path = [Point2::new(3.0, 0.0)];
        for _ in 0..50 {
            policy.command((0.0, 0.0, 0.0), (0.3, 0.0, 0.0), &path, None, &[Point2::new(f32::NAN, 0.0)], &[]);
        }
        let c = policy.command((f64::NAN, 0.0, 0.0), (0.3, 0.0, 0.0), &path, None, &[], &[]);
        assert_eq!(c.status, LocalStatus::Blocked);
        assert!(LocalPolicy::new(LocalPolicyConfig { max_accel_mps2: 0.0, ..LocalPolicyConfig::default() }).is_err());
        assert!(LocalPolicy::new(LocalPolicyConfig { footprint: vec![], ..LocalPolicyConfig::default() }).is_err());
    }
}
