//! `omnivln rooms` and `omnivln barcode` as a program meets them; and the rooms of real floor plans, where their folder is.

mod scoring;
mod support;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use image::{GrayImage, ImageReader, Luma};
use scoring::{SPECK_PX, Score, floor_plans, score, true_rooms};
use serde_json::{Value, json};
use support::{json, keys, omnivln};

/// Runs the program and expects a refusal that says all of these.
fn check_refused(arguments: &[&str], words: &[&str]) {
    let (code, out, err) = omnivln(arguments);
    assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}: {err}");
    for word in words {
        assert!(err.contains(word), "{arguments:?} does not say {word:?}: {err}");
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Two rooms of 4 m by 4 m at 5 cm, a door of 0.9 m between them.
fn two_rooms() -> GrayImage {
    GrayImage::from_fn(170, 90, |x, y| {
        let is_room = (5..85).contains(&y) && ((3..83).contains(&x) || (86..166).contains(&x));
        let is_door = (36..54).contains(&y) && (83..86).contains(&x);
        Luma([if is_room || is_door { 254 } else { 205 }])
    })
}

#[test]
fn a_floor_plan_becomes_labels() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (folder.path().join("plan.png"), folder.path().join("labels.png"));
    two_rooms().save(&plan).unwrap();
    let answer = json(&["rooms", text(&plan), "--resolution", "0.05", "--out", text(&out), "--json"]);
    assert_eq!(keys(&answer), BTreeSet::from(["rooms", "cpu_s", "areas_m2", "doorways"]));
    assert_eq!(answer["rooms"], 2);
    assert!((answer["doorways"][0]["width_m"].as_f64().unwrap() - 0.9).abs() < 0.11, "{answer}");
    let labels = ImageReader::open(&out).unwrap().decode().unwrap();
    assert_eq!(labels.color(), image::ColorType::L16);
    let labels = labels.into_luma16();
    assert_eq!(labels.dimensions(), (170, 90));
    let seen: BTreeSet<u16> = labels.pixels().map(|pixel| pixel.0[0]).collect();
    assert_eq!(seen, BTreeSet::from([0, 1, 2]));
    let at = |x, y| labels.get_pixel(x, y).0[0];
    assert!(at(40, 45) != at(130, 45) && at(40, 45) > 0 && at(130, 45) > 0 && at(1, 1) == 0);

    let before = fs::read(&out).unwrap();
    let broken = folder.path().join("broken.png");
    fs::write(&broken, &fs::read(&plan).unwrap()[..60]).unwrap();
    check_refused(&["rooms", text(&broken), "--out", text(&out)], &["broken.png"]);
    check_refused(&["rooms", "/nowhere.png"], &["/nowhere.png"]);
    check_refused(&["rooms", text(&plan), "--resolution", "0"], &["--resolution", "0.005"]);
    check_refused(&["rooms"], &["--places"]);
    assert_eq!(fs::read(&out).unwrap(), before, "a refusal overwrites nothing");
}

#[test]
fn a_graph_of_places_becomes_labels() {
    let folder = tempfile::tempdir().unwrap();
    let (places, out) = (folder.path().join("places.json"), folder.path().join("labels.json"));
    // Three places in each of two rooms, a door of 0.4 m clearance.
    let clearances = [1.4, 1.5, 1.4, 1.3, 1.6, 1.2];
    let edges = json!([[0, 1, 1.3], [1, 2, 1.3], [2, 3, 0.4], [3, 4, 1.2], [4, 5, 1.1]]);
    let along = [0.0, 1.0, 2.0, 5.0, 6.0, 7.0];
    let nodes: Vec<Value> = along.iter().zip(clearances).map(|(x, clearance)| json!([x, 0.0, clearance])).collect();
    // With a height the graph itself is cut, wherever its places are.
    let with_height: Vec<Value> = clearances.iter().map(|clearance| json!([0.0, 0.0, 1.0, clearance])).collect();
    for nodes in [&nodes, &with_height] {
        fs::write(&places, json!({ "nodes": nodes, "edges": edges }).to_string()).unwrap();
        let answer = json(&["rooms", "--places", text(&places), "--out", text(&out), "--json"]);
        assert_eq!(keys(&answer), BTreeSet::from(["rooms", "cpu_s", "labels"]));
        assert_eq!(answer["labels"], json!([2, 2, 2, 1, 1, 1]), "numbered by falling peaks");
        assert_eq!(answer["rooms"], 2);
        assert_eq!(serde_json::from_slice::<Value>(&fs::read(&out).unwrap()).unwrap(), answer["labels"]);
    }
    for (bad, word) in [
        (json!({ "nodes": [[0.0, 0.0]], "edges": [] }), "node 0"),
        (json!({ "nodes": nodes, "edges": [[0, 9, 1.0]] }), "edge 0"),
        (json!({ "nodes": with_height, "edges": [[0, 9, 1.0]] }), "edge 0"),
        (json!({ "nodes": [[0, 0, 1.0], [0, 0, 1.0, 1.0]], "edges": [] }), "node 1"),
        (json!({ "nodes": [[0, 0, 1.0], [1e7, 1e7, 1.0]], "edges": [] }), "cells"),
        (json!({ "nodes": nodes }), "edges"),
    ] {
        fs::write(&places, bad.to_string()).unwrap();
        check_refused(&["rooms", "--places", text(&places)], &["places.json", word]);
    }
}

#[test]
fn a_barcode_is_counted_and_written_and_broken_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (graph, bars) = (folder.path().join("g.phg"), folder.path().join("bars.bin"));
    // Two rooms (2.0 and 1.8) behind a door of 0.4, and one vertex alone.
    let (values, edges) = ([2.0, 1.5, 0.4, 1.2, 1.8, 0.7_f64], [[0, 1], [1, 2], [3, 2], [3, 4_u32]]);
    let mut bytes = b"PHG1".to_vec();
    bytes.extend([6_u32, 4].iter().flat_map(|n| n.to_le_bytes()));
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    for end in 0..2 {
        bytes.extend(edges.iter().flat_map(|edge| edge[end].to_le_bytes()));
    }
    fs::write(&graph, &bytes).unwrap();
    let answer = json(&["barcode", text(&graph), "--bars", text(&bars), "--json"]);
    let wanted = ["n", "m", "bars", "bars_nonzero", "essential", "cpu_s", "peak_extra_bytes"];
    assert_eq!(keys(&answer), BTreeSet::from(wanted));
    let count = |key: &str| answer[key].as_u64().unwrap();
    assert_eq!((count("n"), count("m"), count("bars"), count("bars_nonzero"), count("essential")), (6, 4, 6, 3, 2));
    let numbers: Vec<f64> =
        fs::read(&bars).unwrap().chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    assert_eq!(numbers.iter().step_by(2).copied().collect::<Vec<_>>(), values);
    let deaths: Vec<f64> = numbers.iter().skip(1).step_by(2).copied().collect();
    assert!(deaths[0].is_nan() && deaths[5].is_nan());
    assert_eq!(deaths[1..5], [1.5, 0.4, 1.2, 0.4]);

    let check = |bytes: &[u8], words: &[&str]| {
        fs::write(&graph, bytes).unwrap();
        check_refused(&["barcode", text(&graph)], &[&["g.phg"], words].concat());
    };
    check(&bytes[..7], &["too short"]);
    check(&bytes[..40], &["92 bytes", "40"]);
    check(&[b"PHG2".as_slice(), &bytes[4..]].concat(), &["PHG1"]);
    // Four thousand million vertices must not be believed.
    check(&[b"PHG1".as_slice(), &[255; 8]].concat(), &["bytes"]);
    let mut nan = bytes.clone();
    nan[12..20].copy_from_slice(&f64::NAN.to_le_bytes());
    check(&nan, &["vertex 0"]);
    let mut outside = bytes.clone();
    let last = bytes.len() - 4;
    outside[last..].copy_from_slice(&6_u32.to_le_bytes());
    check(&outside, &["edge 3"]);
}

#[test]
fn the_rooms_of_ten_real_floor_plans_are_found_empty_and_furnished() {
    let Some(folder) = floor_plans() else { return };
    let work = tempfile::tempdir().unwrap();
    for (suffix, least_overlap, least_f1) in [("", 0.92, 0.92), ("_furnitures", 0.85, 0.87)] {
        let mut scores = Vec::new();
        for entry in fs::read_dir(&folder).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            let Some(plan) = name.strip_suffix("_gt_segmentation.png") else { continue };
            let out = work.path().join("labels.png");
            json(&["rooms", text(&folder.join(format!("{plan}{suffix}.png"))), "--out", text(&out), "--json"]);
            let labels = ImageReader::open(&out).unwrap().decode().unwrap().into_luma16();
            let found: Vec<u32> = labels.pixels().map(|pixel| u32::from(pixel.0[0])).collect();
            let drawn = ImageReader::open(folder.join(&name)).unwrap().decode().unwrap().into_luma8();
            scores.push(score(&true_rooms(&drawn), &found, SPECK_PX));
        }
        let Score { overlap, f1 } = Score::mean(&scores);
        println!("{} plans{suffix}: mean overlap {overlap:.3}, F1 {f1:.3}", scores.len());
        assert_eq!(scores.len(), 10);
        assert!(overlap >= least_overlap && f1 >= least_f1, "{suffix}: {overlap:.3} {f1:.3}");
    }
}

#[test]
fn the_places_of_ten_furnished_floor_plans_get_their_rooms() {
    let Some(folder) = floor_plans() else { return };
    let mut scores = Vec::new();
    for entry in fs::read_dir(folder.join("places")).unwrap() {
        let path = entry.unwrap().path();
        if !path.to_string_lossy().ends_with("_furnitures.json") {
            continue;
        }
        let numbers = |value: &Value| -> Vec<u32> { serde_json::from_value(value.clone()).unwrap() };
        let truth: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        let answer = json(&["rooms", "--places", text(&path), "--json"]);
        scores.push(score(&numbers(&truth["gt_room"]), &numbers(&answer["labels"]), 0));
    }
    let Score { overlap, f1 } = Score::mean(&scores);
    println!("{} graphs of places: mean overlap {overlap:.3}, F1 {f1:.3}", scores.len());
    assert_eq!(scores.len(), 10);
    // The graph itself, cut by the same rule, has 0.57 and 0.25.
    assert!(overlap >= 0.86 && f1 >= 0.80, "{overlap:.3} {f1:.3}");
}
