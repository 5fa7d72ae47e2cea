//! The plain way to plan through the unknown: A* on the cells, unknown counts as free, anew in every cycle, followed as far as one can see.

use std::collections::BinaryHeap;

use nalgebra::Point2;
use planner::ground::far::window::Seen;

use super::building::Belief;

/// Cells in which the middle of a robot of this clearance may be.
pub fn passable(belief: &Belief, clearance_m: f64) -> Vec<bool> {
    let r = clearance_m / belief.voxel_m;
    let reach = r.ceil() as i64;
    let mut free = vec![true; belief.seen.len()];
    for y in 0..belief.height {
        for x in 0..belief.width {
            if belief.get(x, y) != Seen::Occupied {
                continue;
            }
            for j in (y - reach).max(0)..(y + reach + 1).min(belief.height) {
                for i in (x - reach).max(0)..(x + reach + 1).min(belief.width) {
                    // From the middle of one cell to the square of the other.
                    let gap = |d: i64| (d.abs() as f64 - 0.5).max(0.0);
                    if gap(i - x).hypot(gap(j - y)) < r {
                        free[(j * belief.width + i) as usize] = false;
                    }
                }
            }
        }
    }
    free
}

/// The bends of the shortest way over the eight neighbours, cut short where the straight line stays on passable cells.
pub fn route(belief: &Belief, clearance_m: f64, from: &Point2<f64>, to: &Point2<f64>) -> Option<Vec<Point2<f64>>> {
    let mut free = passable(belief, clearance_m);
    let (w, h) = (belief.width, belief.height);
    let cell = |p: &Point2<f64>| (p.y / belief.voxel_m) as i64 * w + (p.x / belief.voxel_m) as i64;
    let (start, goal) = (cell(from), cell(to));
    free[start as usize] = true;
    if !free[goal as usize] {
        return None;
    }
    let bound = |k: i64| {
        let (dx, dy) = ((k % w - goal % w).abs() as f64, (k / w - goal / w).abs() as f64);
        dx.max(dy) + (2f64.sqrt() - 1.0) * dx.min(dy)
    };
    let mut best = vec![(f64::INFINITY, -1i64); free.len()];
    let mut open = BinaryHeap::new();
    best[start as usize].0 = 0.0;
    open.push((std::cmp::Reverse((bound(start) * 1e6) as u64), start));
    while let Some((std::cmp::Reverse(key), k)) = open.pop() {
        let g = best[k as usize].0;
        if key > ((g + bound(k)) * 1e6) as u64 {
            continue;
        }
        if k == goal {
            let mut cells = vec![goal];
            while best[cells[cells.len() - 1] as usize].1 >= 0 {
                cells.push(best[cells[cells.len() - 1] as usize].1);
            }
            cells.reverse();
            let middle = |k: &i64| Point2::new((k % w) as f64 + 0.5, (k / w) as f64 + 0.5) * belief.voxel_m;
            let points: Vec<Point2<f64>> = cells.iter().map(middle).collect();
            return Some(cut_short(&free, belief, from, &points));
        }
        for (dx, dy) in [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)] {
            let (x, y) = (k % w + dx, k / w + dy);
            let other = y * w + x;
            let length = g + if dx * dy == 0 { 1.0 } else { 2f64.sqrt() };
            if x >= 0 && y >= 0 && x < w && y < h && free[other as usize] && length < best[other as usize].0 - 1e-9 {
                best[other as usize] = (length, k);
                open.push((std::cmp::Reverse(((length + bound(other)) * 1e6) as u64), other));
            }
        }
    }
    None
}

fn cut_short(free: &[bool], belief: &Belief, from: &Point2<f64>, points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let sees = |a: &Point2<f64>, b: &Point2<f64>| {
        let n = ((b - a).norm() / belief.voxel_m * 4.0).ceil().max(1.0) as usize;
        (1..=n).all(|k| {
            let p = (a + (b - a) * (k as f64 / n as f64)) / belief.voxel_m;
            free[(p.y as i64 * belief.width + p.x as i64) as usize]
        })
    };
    let (mut at, mut kept, mut next) = (*from, Vec::new(), 0);
    while next < points.len() {
        let last = (next..points.len()).rev().find(|&k| sees(&at, &points[k])).unwrap_or(next);
        at = points[last];
        kept.push(at);
        next = last + 1;
    }
    kept
}
