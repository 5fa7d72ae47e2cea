//! Barcodes and distances that other libraries computed (GUDHI, scipy); see shared/data/ph/README.md.
//! The data does not belong to this repository: where its folder is absent the tests say so and pass.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;
use topo_ph::*;

/// The peers sum in another order; the values themselves are exact.
const DISTANCE_TOL: f64 = 1e-9;

/// Two stored distances that are above a matching one can do by hand, with the value of an exhaustive search.
const GUDHI_TOO_LARGE: [(&str, &str, f64); 2] = [("small_29", "small_27", 0.75), ("small_28", "small_00", 0.625)];

fn load(name: &str) -> Option<Value> {
    // Beside the repository, wherever it is checked out (a worktree lies deeper than the main checkout).
    let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let paths: Vec<_> = folders.map(|folder| folder.join("shared/data/ph").join(name)).collect();
    let Some(text) = paths.iter().find_map(|path| std::fs::read_to_string(path).ok()) else {
        eprintln!("skipped: shared/data/ph/{name} is not here");
        return None;
    };
    Some(serde_json::from_str(&text).expect("golden files are JSON"))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

fn pairs(value: &Value) -> Vec<(u32, u32)> {
    numbers_of_rows(value).iter().map(|row| (row[0] as u32, row[1] as u32)).collect()
}

fn numbers_of_rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().expect("a list").iter().map(numbers).collect()
}

fn graphs() -> Option<BTreeMap<String, (Graph, Value)>> {
    let mut graphs = BTreeMap::new();
    for file in ["small.json", "mid.json"] {
        for golden in load(file)?["graphs"].as_array().expect("a list") {
            let limits = (!golden["edge_value"].is_null()).then(|| numbers(&golden["edge_value"]));
            let graph = Graph::new(numbers(&golden["value"]), pairs(&golden["edges"]), limits);
            let name = golden["name"].as_str().expect("a name").to_string();
            graphs.insert(name, (graph.expect("valid"), golden.clone()));
        }
    }
    Some(graphs)
}

#[test]
fn barcodes_cycles_and_levels_equal_gudhi() {
    let Some(graphs) = graphs() else { return };
    for (name, (graph, golden)) in &graphs {
        let bars = barcode(graph);
        let mut ours: Vec<_> = bars.iter().map(|bar| (bar.birth, bar.death)).collect();
        let rows = golden["h0"].as_array().expect("a list");
        let mut theirs: Vec<_> = rows.iter().map(|bar| (bar[0].as_f64().expect("a birth"), bar[1].as_f64())).collect();
        ours.sort_by(|a, b| a.partial_cmp(b).expect("no NaN"));
        theirs.sort_by(|a, b| a.partial_cmp(b).expect("no NaN"));
        assert_eq!(ours, theirs, "{name}");
        assert_eq!(cycle_births(graph), numbers(&golden["h1_births"]), "{name}");
        let (curve, tree) = (betti_curve(&bars), MergeTree::new(graph));
        for level in golden["levels"].as_array().expect("a list") {
            let t = level["t"].as_f64().expect("a threshold");
            let expected: Vec<u32> =
                numbers(&level["label"]).iter().map(|&x| if x < 0.0 { u32::MAX } else { x as u32 }).collect();
            assert_eq!(u64::from(curve.at(t)), level["betti0"].as_u64().expect("a count"), "{name} {t}");
            assert_eq!(components_at(graph, t), expected, "{name} {t}");
            let cut = tree.cut(t);
            for (v, &smallest) in expected.iter().enumerate() {
                let same = if smallest == u32::MAX { None } else { cut[smallest as usize] };
                assert_eq!(cut[v], same, "{name} {t}");
            }
        }
    }
    assert_eq!(graphs.len(), 55);
}

#[test]
fn distances_equal_gudhi_and_scipy() {
    let (Some(graphs), Some(golden)) = (graphs(), load("distances.json")) else {
        return;
    };
    let finite = |name: &Value| {
        let bars = barcode(&graphs[name.as_str().expect("a name")].0);
        bars.into_iter().filter(|bar| bar.death.is_some()).collect::<Vec<_>>()
    };
    let check = |ours: f64, theirs: &Value, what: &str| {
        let theirs = theirs.as_f64().expect("a distance");
        assert!((ours - theirs).abs() <= DISTANCE_TOL, "{what}: {ours} and {theirs}");
    };
    for pair in golden["pairs"].as_array().expect("a list") {
        let (a, b) = (finite(&pair["a"]), finite(&pair["b"]));
        let names = [&pair["a"], &pair["b"]].map(|name| name.as_str().expect("a name"));
        match GUDHI_TOO_LARGE.iter().find(|case| [case.0, case.1] == names) {
            // Matching every bar with the diagonal costs less than what GUDHI says.
            Some(&(_, _, truth)) => {
                let longest = a.iter().chain(&b).map(Bar::persistence).fold(0.0, f64::max);
                assert!(0.5 * longest < pair["bottleneck"].as_f64().expect("a distance"));
                assert!((bottleneck(&a, &b) - truth).abs() <= DISTANCE_TOL);
            }
            None => check(bottleneck(&a, &b), &pair["bottleneck"], "bottleneck"),
        }
        check(wasserstein1(&a, &b), &pair["wasserstein1_linf"], "wasserstein 1");
        check(wasserstein2(&a, &b), &pair["wasserstein2_l2"], "wasserstein 2");
    }
    for case in golden["stability"].as_array().expect("a list") {
        let bars = |values: &Value| barcode(&Graph::new(numbers(values), pairs(&case["edges"]), None).expect("valid"));
        let distance = bottleneck(&bars(&case["value_a"]), &bars(&case["value_b"]));
        check(distance, &case["bottleneck_all"], "stability");
        assert!(distance <= case["sup_norm"].as_f64().expect("a norm") + DISTANCE_TOL);
    }
}
