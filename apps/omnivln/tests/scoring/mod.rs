//! How good a division into rooms is: the measures of `rooms_peers.py` (mIoU and F1 of an optimal one-to-one matching).

use std::path::{Path, PathBuf};

use arena::mission::topo_ph;
use image::GrayImage;

/// The floor plans belong to others and stay outside of the repository.
pub fn floor_plans() -> Option<PathBuf> {
    let folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let found = folders.map(|folder| folder.join("shared/data/rooms")).find(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: shared/data/rooms is not here");
    }
    found
}

/// Regions of a picture with at most so many pixels are nothing.
pub const SPECK_PX: usize = 100;

/// Agreement of a division with the truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Score {
    /// Sum of the intersections over union of the best one-to-one matching, by number of true rooms.
    pub overlap: f64,
    /// F1 of the pairs of that matching that overlap by half.
    pub f1: f64,
}

impl Score {
    /// The mean of some scores.
    pub fn mean(scores: &[Score]) -> Score {
        let mean = |pick: fn(&Score) -> f64| scores.iter().map(pick).sum::<f64>() / scores.len() as f64;
        Score { overlap: mean(|score| score.overlap), f1: mean(|score| score.f1) }
    }
}

/// Compares labels (0 none), pixel by pixel or node by node; labels with at most `speck` members count as none.
pub fn score(truth: &[u32], found: &[u32], speck: usize) -> Score {
    let ((truth, rooms), (found, parts)) = (large_only(truth, speck), large_only(found, speck));
    let mut shared = vec![0.0; (rooms + 1) * (parts + 1)];
    for (room, part) in truth.iter().zip(&found) {
        shared[room * (parts + 1) + part] += 1.0;
    }
    score_of_overlaps(&shared, rooms, parts)
}

/// The same from the numbers of members that room r and part p (0 none) share, at r * (parts + 1) + p.
pub fn score_of_overlaps(shared: &[f64], rooms: usize, parts: usize) -> Score {
    let in_room: Vec<f64> = shared.chunks(parts + 1).map(|row| row.iter().sum()).collect();
    let in_part: Vec<f64> = (0..=parts).map(|part| shared.iter().skip(part).step_by(parts + 1).sum()).collect();
    let iou = |room: usize, part: usize| {
        let both = shared[room * (parts + 1) + part];
        both / (in_room[room] + in_part[part] - both)
    };
    // The matching wants a square: who is matched with nobody costs nothing.
    let n = rooms.max(parts);
    let mut cost = vec![0.0; n * n];
    for (room, part) in (0..rooms).flat_map(|room| (0..parts).map(move |part| (room, part))) {
        cost[room * n + part] = -iou(room + 1, part + 1);
    }
    let partner = topo_ph::assign(&cost, n);
    let matched: Vec<f64> = (0..rooms).map(|room| -cost[room * n + partner[room]]).collect();
    let hits = matched.iter().filter(|iou| **iou >= 0.5).count();
    Score { overlap: matched.iter().sum::<f64>() / rooms as f64, f1: 2.0 * hits as f64 / (rooms + parts) as f64 }
}

/// The labels with more than `speck` members, renumbered from 1; and how many.
pub fn large_only(labels: &[u32], speck: usize) -> (Vec<usize>, usize) {
    let mut counts = vec![0_usize; labels.iter().max().map_or(0, |most| *most as usize) + 1];
    for &label in labels {
        counts[label as usize] += 1;
    }
    let mut next = 0;
    let numbers: Vec<usize> = counts
        .iter()
        .enumerate()
        .map(|(label, count)| {
            let is_region = label > 0 && *count > speck;
            next += usize::from(is_region);
            if is_region { next } else { 0 }
        })
        .collect();
    (labels.iter().map(|&label| numbers[label as usize]).collect(), next)
}

/// The true rooms: what hangs together (eight neighbours) and is lighter than 250.
pub fn true_rooms(drawn: &GrayImage) -> Vec<u32> {
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
