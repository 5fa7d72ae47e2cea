//! Shortest ways between polygons: against stored lengths, against brute force, and laws.
#![cfg(feature = "ground")]
mod support;

use nalgebra::Point2;
use planner::{NoWay, PolygonError, PolygonMap};
use serde_json::Value;

fn point(value: &Value) -> Point2<f64> {
    Point2::new(value[0].as_f64().expect("a number"), value[1].as_f64().expect("a number"))
}

fn ring(value: &Value) -> Vec<Point2<f64>> {
    value.as_array().expect("a list").iter().map(point).collect()
}

/// The maps of the MovingAI benchmark as polygons, with true lengths.
#[test]
fn every_stored_length_is_reached() {
    for (name, tolerance) in [
        ("arena", 1e-9),
        ("den312d", 1e-9),
        ("maze512-32-0", 1e-9),
        ("64room_000", 1e-9),
        ("den520d", 1e-9),
        ("Berlin_0_256", 1e-6),
    ] {
        let Some(text) = support::shared(&format!("maps/{name}.json")) else { return };
        let file: Value = serde_json::from_str(&text).expect("JSON");
        let holes: Vec<Vec<Point2<f64>>> = file["holes"].as_array().expect("a list").iter().map(ring).collect();
        let started = std::time::Instant::now();
        let map = PolygonMap::new(&ring(&file["outer"]), &holes).expect("a map");
        let build_ms = started.elapsed().as_secs_f64() * 1e3;
        let started = std::time::Instant::now();
        let mut worst: f64 = 0.0;
        let pairs = file["pairs"].as_array().expect("a list");
        for pair in pairs {
            let wanted = pair["length"].as_f64().or(pair["length_polyanya"].as_f64()).expect("a length");
            let route = map.route(&point(&pair["start"]), &point(&pair["goal"])).expect("a way");
            worst = worst.max((route.length - wanted).abs() / wanted);
        }
        let query_us = started.elapsed().as_secs_f64() * 1e6 / pairs.len() as f64;
        println!(
            "{name}: {} corners, {} tangents, build {build_ms:.2} ms, query {query_us:.1} us, worst {worst:.1e}",
            map.corner_count(),
            map.tangent_count()
        );
        assert!(worst <= tolerance, "{name}: {worst:e}");
    }
}
