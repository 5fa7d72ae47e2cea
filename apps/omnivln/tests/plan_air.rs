//! `omnivln plan-air` as a program meets it: stable keys, flights that hold when they are sampled, complaints with the place.

mod support;

use std::collections::BTreeSet;
use std::fs;

use serde_json::{Value, json};
use support::omnivln;

fn plan_air(arguments: &[&str]) -> (Option<i32>, String, String) {
    omnivln(&[&["plan-air", "--repeats", "1", "--quiet"], arguments].concat())
}

/// Boxes in a row along x, each overlapping the next by a metre; one turns off to the side.
fn corridors() -> Value {
    let cell = |x: f64, y: f64| {
        json!([
            [1.0, 0.0, 0.0, -(x + 4.0)],
            [-1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, -(y + 2.0)],
            [0.0, -1.0, 0.0, y],
            [0.0, 0.0, 1.0, -3.0],
            [0.0, 0.0, -1.0, 0.0],
        ])
    };
    let state = |p: [f64; 3]| json!({"p": p, "v": [0.0, 0.0, 0.0], "a": [0.0, 0.0, 0.0]});
    let straight = json!({
        "id": "turn", "start": state([0.5, 1.0, 1.5]), "goal": state([9.0, 2.5, 1.0]),
        "polytopes": [cell(0.0, 0.0), cell(3.0, 0.5), cell(6.0, 1.0)],
    });
    let apart = json!({
        "id": "apart", "start": state([0.5, 1.0, 1.5]), "goal": state([19.0, 1.0, 1.0]),
        "polytopes": [cell(0.0, 0.0), cell(16.0, 0.0)],
    });
    json!({
        "meta": {
            "limits": {"v_max": 4.0, "omega_max": 2.1, "tilt_max": 1.05, "thrust_min": 2.0, "thrust_max": 12.0},
            "vehicle": {"mass": 0.61, "g": 9.8, "drag_h": 0.7, "drag_v": 0.8, "drag_parasitic": 0.01, "speed_eps": 1e-4},
            "weights": {"rho_time": 20.0},
        },
        "problems": [straight, apart],
    })
}

fn keys(value: &Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn corridors_become_flights_with_stable_keys_that_hold_when_sampled() {
    let folder = tempfile::tempdir().unwrap();
    let (file, dump) = (folder.path().join("corridors.json"), folder.path().join("coeffs.json"));
    fs::write(&file, corridors().to_string()).unwrap();
    let (file, dump) = (file.to_str().unwrap(), dump.to_str().unwrap());
    for extra in [&[][..], &["--hard"], &["--profile", "agile"]] {
        let (code, out, _) = plan_air(&[&[file, "--json", "--coeffs", dump], extra].concat());
        assert_eq!(code, Some(1), "one of two cannot be flown");
        assert_eq!(out.trim_end().lines().count(), 1, "one JSON object");
        let result: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(result["solved"], 1);
        let rows = result["problems"].as_array().unwrap();
        let expected = BTreeSet::from([
            "id",
            "status",
            "cost",
            "energy",
            "time_s",
            "pieces",
            "cpu_ms",
            "cpu_ms_certificate",
            "iterations",
            "violation",
        ]);
        assert!(expected.is_subset(&keys(&rows[0])), "{}", rows[0]);
        let limits = BTreeSet::from(["corridor_m", "speed_mps", "tilt_rad", "thrust_n", "rate_radps"]);
        assert_eq!(keys(&rows[0]["violation"]), limits);
        assert!(limits.iter().all(|limit| rows[0]["violation"][limit] == 0.0));
        assert_eq!((&rows[0]["status"], &rows[0]["pieces"]), (&json!("solved"), &json!(3)));
        assert_eq!(rows[1]["status"], "no_overlap");
        assert!(rows[1]["reason"].as_str().unwrap().contains("polytopes 0 and 1"), "{}", rows[1]);
        check_dump(dump, &rows[0], if extra.contains(&"agile") { 12.0 } else { 4.0 });
    }
}

/// What the dump says, evaluated here: inside the boxes, not too fast, from start to goal, at the cost that was told.
fn check_dump(path: &str, row: &Value, fastest: f64) {
    let dump: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let problem = &dump["problems"][0];
    assert_eq!(dump["problems"].as_array().unwrap().len(), 1, "only what was solved");
    let number = |v: &Value| v.as_f64().unwrap();
    let cells = corridors()["problems"][0]["polytopes"].clone();
    let coefficients = problem["coeffs"].as_array().unwrap();
    let mut energy = 0.0;
    for (i, duration) in problem["durations"].as_array().unwrap().iter().enumerate() {
        let duration = number(duration);
        let at = |t: f64, order: i32| -> [f64; 3] {
            std::array::from_fn(|axis| {
                (order..6)
                    .map(|j| {
                        let falling: f64 = (0..order).map(|m| f64::from(j - m)).product();
                        number(&coefficients[6 * i + j as usize][axis]) * falling * t.powi(j - order)
                    })
                    .sum()
            })
        };
        let steps = 2000;
        for k in 0..=steps {
            let t = duration * f64::from(k) / f64::from(steps);
            let (p, v, jerk) = (at(t, 0), at(t, 1), at(t, 3));
            for face in cells[problem["poly_index"][i].as_u64().unwrap() as usize].as_array().unwrap() {
                let outside = (0..3).map(|axis| number(&face[axis]) * p[axis]).sum::<f64>() + number(&face[3]);
                assert!(outside <= 1e-9, "{outside} m outside");
            }
            assert!(v.iter().map(|x| x * x).sum::<f64>().sqrt() <= fastest + 1e-9);
            // Simpson.
            let weight = if k == 0 || k == steps {
                1.0
            } else if k % 2 == 1 {
                4.0
            } else {
                2.0
            };
            energy += weight * jerk.iter().map(|x| x * x).sum::<f64>() * duration / f64::from(steps) / 3.0;
        }
    }
    assert!((energy / number(&row["energy"]) - 1.0).abs() < 1e-6);
    let price = if fastest > 10.0 { 500.0 } else { 20.0 };
    assert!((number(&row["energy"]) + price * number(&row["time_s"]) - number(&row["cost"])).abs() < 1e-6);
}

#[test]
fn a_forest_is_flown_through_by_the_whole_pipeline_the_same_at_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("forest.json");
    let problem = |id: &str, goal: [f64; 3]| {
        json!({"id": id, "start": [-4.0, 0.0, 1.5], "goal": goal,
               "boxes": [[-0.5, -3.0, 0.0, 0.5, 2.0, 3.0], [2.0, -1.0, 0.0, 2.5, 4.0, 3.0]]})
    };
    let forest = json!({
        "meta": {"bounds": [-5.0, -5.0, 0.0, 5.0, 5.0, 3.0], "voxel": 0.25, "dilate_voxels": 1},
        "problems": [problem("through", [4.0, 1.0, 1.5]), problem("into a box", [0.0, 0.0, 1.0]), problem("back", [-4.0, 4.0, 1.0])],
    });
    fs::write(&file, forest.to_string()).unwrap();
    let mut seen = Vec::new();
    for threads in ["1", "3"] {
        let dump = folder.path().join(threads);
        let (code, out, _) =
            plan_air(&[file.to_str().unwrap(), "--json", "--threads", threads, "--coeffs", dump.to_str().unwrap()]);
        assert_eq!(code, Some(1));
        let result: Value = serde_json::from_str(&out).unwrap();
        let status: Vec<&str> =
            result["problems"].as_array().unwrap().iter().map(|row| row["status"].as_str().unwrap()).collect();
        assert_eq!(status, ["solved", "goal_blocked", "solved"]);
        seen.push(fs::read(dump).unwrap());
    }
    assert_eq!(seen[0], seen[1]);
    let (code, _, err) = plan_air(&[file.to_str().unwrap(), "--hard"]);
    assert!(code == Some(2) && err.contains("--hard is for corridors"), "{err}");
}

/// The plan is followed by the simulated aircraft; what cannot be planned is not flown. Slowed down by nobody, it stays out of
/// everything grown.
#[test]
fn a_forest_is_flown_without_touching_anything() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("forest.json");
    let problem = |id: &str, goal: [f64; 3]| {
        json!({"id": id, "start": [-4.0, 0.0, 1.5], "goal": goal,
               "boxes": [[-0.5, -3.0, 0.0, 0.5, 2.0, 3.0], [2.0, -1.0, 0.0, 2.5, 4.0, 3.0]]})
    };
    let mut forest = json!({
        "meta": {"bounds": [-5.0, -5.0, 0.0, 5.0, 5.0, 3.0], "voxel": 0.25, "dilate_voxels": 2},
        "problems": [problem("through", [4.0, 1.0, 1.5])],
    });
    let fly = |forest: &Value| {
        fs::write(&file, forest.to_string()).unwrap();
        let (code, out, err) = plan_air(&[file.to_str().unwrap(), "--json", "--fly"]);
        (code, serde_json::from_str::<Value>(&out).unwrap_or_else(|_| panic!("{err}")))
    };
    let number = |value: &Value| value.as_f64().unwrap();
    let (code, result) = fly(&forest);
    let flown = &result["problems"][0]["flown"];
    assert_eq!((code, &result["flown_clean"], &flown["clean"]), (Some(0), &json!(1), &json!(true)), "{flown}");
    assert_eq!(flown["samples_in_grown_voxels"], 0);
    assert!(number(&flown["clearance_m"]) > 0.1 && number(&flown["tracking_max_m"]) < 0.08, "{flown}");
    assert!(
        number(&flown["tracking_rmse_m"]) > 0.0
            && flown["tracking_rmse_m"].as_f64() <= flown["tracking_max_m"].as_f64()
    );
    // Nothing to fly: not clean, and said so by the exit code.
    forest["problems"].as_array_mut().unwrap().push(problem("into a box", [0.0, 0.0, 1.0]));
    let (code, result) = fly(&forest);
    assert_eq!((code, &result["flown_clean"], &result["problems"][1]["flown"]), (Some(1), &json!(1), &Value::Null));
}

/// The shared forests: all of them, without a contact and outside every grown voxel.
#[test]
fn the_shared_forests_are_flown() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/aerial/forest_maps.json");
    if !std::path::Path::new(path).exists() {
        return println!("skipped: {path} is not here");
    }
    let (code, out, err) = plan_air(&[path, "--json", "--fly", "--threads", "2"]);
    let result: Value = serde_json::from_str(&out).unwrap_or_else(|_| panic!("{err}"));
    assert_eq!((code, &result["flown_clean"]), (Some(0), &json!(16)));
}

#[test]
fn bad_files_and_numbers_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("corridors.json");
    let path = file.to_str().unwrap();
    let refused = |text: &str, words: &[&str]| {
        fs::write(&file, text).unwrap();
        let (code, out, err) = plan_air(&[path, "--json"]);
        assert_eq!((code, out.as_str()), (Some(2), ""));
        assert!(words.iter().all(|word| err.contains(word)), "{err}");
    };
    refused("{", &["corridors.json", "line 1"]);
    refused(r#"{"meta": {}, "problems": [{"id": "x"}]}"#, &["missing field `start`", "line 1"]);
    refused(
        r#"{"meta": {"bounds": [0, 0, 0, 0, 1, 1], "voxel": 0.1, "dilate_voxels": 1}, "problems": []}"#,
        &["meta.bounds"],
    );
    assert_eq!(plan_air(&[path, "--threads", "0"]).0, Some(2));
    assert_eq!(plan_air(&["nowhere.json"]).0, Some(2));
    // No mass, no corridor, a row without direction: each a status of its problem.
    let mut massless = corridors();
    massless["meta"]["vehicle"]["mass"] = json!(0.0);
    let mut empty = corridors();
    empty["problems"][0]["polytopes"] = json!([]);
    let mut flat = corridors();
    flat["problems"][0]["polytopes"][1][0] = json!([0.0, 0.0, 0.0, 1.0]);
    for (file, status) in [(massless, "bad_limits"), (empty, "empty_corridor"), (flat, "bad_polytope")] {
        fs::write(path, file.to_string()).unwrap();
        let (code, out, _) = plan_air(&[path, "--json"]);
        let result: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((code, &result["problems"][0]["status"]), (Some(1), &json!(status)));
    }
}
