//! Laws of the planner.
mod support;

#[cfg(feature = "ground")]
mod routes {
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

    /// Scattered rectangles in a 5 m square.
    fn clutter() -> impl Strategy<Value = Picture> {
        proptest::collection::vec((0.0..4.8f64, 0.0..4.8f64, 0.02..1.2f64, 0.02..1.2f64), 0..9).prop_map(|boxes| {
            let mut picture = Picture::free(5.0, 5.0, 0.05);
            for (x, y, w, h) in boxes {
                picture.block(x, y, x + w, y + h);
            }
            picture
        })
    }

    fn place() -> impl Strategy<Value = Point2<f64>> {
        (0.0..5.0f64, 0.0..5.0f64).prop_map(|(x, y)| Point2::new(x, y))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

        #[test]
        fn every_leg_keeps_the_clearance(picture in clutter(), start in place(), goal in place(), r in 0.12..0.5f64) {
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
        fn lengths_agree_with_routes_and_with_each_other(picture in clutter(), start in place(), goals in proptest::collection::vec(place(), 1..6)) {
            let graph = VisibilityGraph::build(&picture.view(), 0.3).unwrap();
            let lengths = graph.lengths_from(&start, &goals);
            for (goal, length) in goals.iter().zip(&lengths) {
                let route = graph.route(&start, goal);
                prop_assert_eq!(route.is_some(), length.is_some());
                if let (Some(route), Some(length)) = (route, length) {
                    prop_assert!(route.length_m <= length + 2.0, "{} vs {}", route.length_m, length);
                    prop_assert!(*length <= route.length_m * 1.09 + 0.15, "{} vs {}", route.length_m, length);
                }
            }
        }

        #[test]
        fn nearest_reachable_is_reachable(picture in clutter(), start in place(), goal in place()) {
            let graph = VisibilityGraph::build(&picture.view(), 0.3).unwrap();
            if let Some((point, distance_m)) = graph.nearest_reachable(&start, &goal) {
                prop_assert!(((point - goal).norm() - distance_m).abs() < 1e-9);
                prop_assert!(graph.route(&start, &point).is_some());
            }
        }
    }

    #[test]
    fn one_metre_doors_are_passed_at_any_offset() {
        for seed in 1..=20 {
            let picture = flat(1.0, seed * 1000);
            let empty = flat(1.0, seed * 1000);
            let graph = VisibilityGraph::build(&empty.view(), RADIUS_M + 0.02).unwrap();
            let route = graph.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0));
            if let Some(route) = route {
                check_clearance(&picture, &route.points, RADIUS_M + 0.02);
            }
        }
        // Without furniture the way must exist.
        let picture = flat(1.0, 0);
        let graph = VisibilityGraph::build(&picture.view(), RADIUS_M + 0.02).unwrap();
        let route = graph.route(&Point2::new(2.5, 2.0), &Point2::new(14.5, 8.0)).expect("doors are wide enough");
        check_clearance(&picture, &route.points, RADIUS_M + 0.02);
    }
}
