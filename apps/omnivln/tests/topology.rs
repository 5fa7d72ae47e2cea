//! `omnivln rooms` and `omnivln barcode` as a program meets them; and the rooms of real floor plans, where their folder is.

mod support;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use image::{GrayImage, ImageReader, Luma};
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
    let nodes = [1.4, 1.5, 1.4, 1.3, 1.6, 1.2].map(|clearance| json!([0.0, 0.0, clearance]));
    let edges = json!([[0, 1, 1.3], [1, 2, 1.3], [2, 3, 0.4], [3, 4, 1.2], [4, 5, 1.1]]);
    fs::write(&places, json!({ "nodes": nodes, "edges": edges }).to_string()).unwrap();
    let answer = json(&["rooms", "--places", text(&places), "--out", text(&out), "--json"]);
    assert_eq!(keys(&answer), BTreeSet::from(["rooms", "cpu_s", "labels"]));
    assert_eq!(answer["labels"], json!([2, 2, 2, 1, 1, 1]), "numbered by falling peaks");
    assert_eq!(serde_json::from_slice::<Value>(&fs::read(&out).unwrap()).unwrap(), answer["labels"]);
    for (bad, word) in [
        (json!({ "nodes": [[0.0, 0.0]], "edges": [] }), "node 0"),
        (json!({ "nodes": nodes, "edges": [[0, 9, 1.0]] }), "edge 0"),
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

/// The floor plans belong to others and stay outside of the repository.
fn floor_plans() -> Option<PathBuf> {
    let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let found = folders.map(|folder| folder.join("shared/data/rooms")).find(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: shared/data/rooms is not here");
    }
    found
}

/// The regions of a picture of labels (0 none) with more than 100 pixels, renumbered from 1; and how many.
fn large_only(labels: &[u32]) -> (Vec<usize>, usize) {
    let mut counts = vec![0_usize; labels.iter().max().map_or(0, |most| *most as usize) + 1];
    for &label in labels {
        counts[label as usize] += 1;
    }
    let mut next = 0;
    let numbers: Vec<usize> = counts
        .iter()
        .enumerate()
        .map(|(label, count)| {
            let is_region = label > 0 && *count > 100;
            next += usize::from(is_region);
            if is_region { next } else { 0 }
        })
        .collect();
    (labels.iter().map(|&label| numbers[label as usize]).collect(), next)
}

/// The true rooms: what hangs together (eight neighbours) and is lighter than 250.
fn true_rooms(drawn: &GrayImage) -> Vec<u32> {
    let (width, height) = (drawn.width() as i64, drawn.height() as i64);
    let mut labels = vec![0_u32; (width * height) as usize];
    let is_free = |x: i64, y: i64| drawn.get_pixel(x as u32, y as u32).0[0] > 250;
    let mut rooms = 0;
    for start in 0..width * height {
        if labels[start as usize] > 0 || !is_free(start % width, start / width) {
            continue;
        }
        rooms += 1;
        labels[start as usize] = rooms;
        let mut open = vec![start];
        while let Some(cell) = open.pop() {
            for (dx, dy) in (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy))) {
                let (x, y) = (cell % width + dx, cell / width + dy);
                let is_inside = (0..width).contains(&x) && (0..height).contains(&y);
                if is_inside && is_free(x, y) && labels[(y * width + x) as usize] == 0 {
                    labels[(y * width + x) as usize] = rooms;
                    open.push(y * width + x);
                }
            }
        }
    }
    labels
}

/// Mean overlap over the true rooms and F1 of pairs that overlap by half. Pairs are taken greedily, best first: at most the optimum.
fn score(truth: &[u32], found: &[u32]) -> (f64, f64) {
    let ((truth, rooms), (found, parts)) = (large_only(truth), large_only(found));
    let mut shared = vec![0.0; (rooms + 1) * (parts + 1)];
    for (room, part) in truth.iter().zip(&found) {
        shared[room * (parts + 1) + part] += 1.0;
    }
    let in_room = |room: usize| (0..=parts).map(|part| shared[room * (parts + 1) + part]).sum::<f64>();
    let in_part = |part: usize| (0..=rooms).map(|room| shared[room * (parts + 1) + part]).sum::<f64>();
    let mut pairs = Vec::new();
    for (room, part) in (1..=rooms).flat_map(|room| (1..=parts).map(move |part| (room, part))) {
        let both = shared[room * (parts + 1) + part];
        if both > 0.0 {
            pairs.push((both / (in_room(room) + in_part(part) - both), room, part));
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut used_rooms, mut used_parts) = (BTreeSet::new(), BTreeSet::new());
    let (mut overlap, mut hits) = (0.0, 0.0);
    for (iou, room, part) in pairs {
        if !used_rooms.contains(&room) && !used_parts.contains(&part) {
            used_rooms.insert(room);
            used_parts.insert(part);
            overlap += iou;
            hits += f64::from(u8::from(iou >= 0.5));
        }
    }
    (overlap / rooms as f64, 2.0 * hits / (rooms + parts) as f64)
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
            scores.push(score(&true_rooms(&drawn), &found));
        }
        let mean = |pick: fn(&(f64, f64)) -> f64| scores.iter().map(pick).sum::<f64>() / scores.len() as f64;
        let (overlap, f1) = (mean(|s| s.0), mean(|s| s.1));
        println!("{} plans{suffix}: mean overlap {overlap:.3}, F1 {f1:.3}", scores.len());
        assert_eq!(scores.len(), 10);
        assert!(overlap >= least_overlap && f1 >= least_f1, "{suffix}: {overlap:.3} {f1:.3}");
    }
}
