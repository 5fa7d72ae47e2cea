//! What guards the claims of speed: a barcode of a million vertices in half a second (GUDHI takes thirty times as long, ripser ten), rooms of a
//! floor plan in a tenth. `cargo bench -p topo-ph`
//!
//! The graphs are grids with noise, half of the diagonals, and edges in no order: mean degree 5, as places in a building have.

use divan::{Bencher, black_box};
use topo_ph::{Graph, PinchConfig, barcode, deaths, grid_graph, pinch};

fn main() {
    divan::main();
}

/// A small generator of numbers, so that the input is the same everywhere.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 33
    }

    fn unit(&mut self) -> f64 {
        self.next() as f64 / (1_u64 << 31) as f64
    }
}

/// Clearance of rooms of 40 by 40 places, with noise.
fn height(x: usize, y: usize, numbers: &mut Numbers) -> f64 {
    let to_wall = |k: usize| 1.0 - ((k as f64 / 40.0).fract() - 0.5).abs() * 2.0;
    let noise: f64 = (0..4).map(|_| numbers.unit() - 0.5).sum::<f64>() * 0.26;
    (0.35 + 2.0 * to_wall(x).min(to_wall(y)) + noise).max(0.0)
}

fn places(side: usize) -> Graph {
    let mut numbers = Numbers(7);
    let values = (0..side * side).map(|i| height(i % side, i / side, &mut numbers)).collect();
    let mut edges = Vec::new();
    for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
        let at = |x: usize, y: usize| (y * side + x) as u32;
        if x + 1 < side {
            edges.push((at(x, y), at(x + 1, y)));
        }
        if y + 1 < side {
            edges.push((at(x, y), at(x, y + 1)));
        }
        if x + 1 < side && y + 1 < side && numbers.unit() < 0.5 {
            edges.push((at(x, y), at(x + 1, y + 1)));
        }
    }
    for last in (1..edges.len()).rev() {
        let other = numbers.next() as usize % (last + 1);
        edges.swap(last, other);
    }
    Graph::new(values, edges, None).expect("valid")
}

#[divan::bench(args = [100, 316, 1000], sample_count = 5, sample_size = 1)]
fn deaths_of_a_grid_with_this_side(bencher: Bencher, side: usize) {
    let graph = places(side);
    bencher.counter(divan::counter::ItemsCount::new(graph.len())).bench_local(|| deaths(black_box(&graph)));
}

/// The plain way: all edges sorted, every bar with its edge.
#[divan::bench(args = [100, 316], sample_count = 5, sample_size = 1)]
fn bars_of_a_grid_with_this_side(bencher: Bencher, side: usize) {
    let graph = places(side);
    bencher.counter(divan::counter::ItemsCount::new(graph.len())).bench_local(|| barcode(black_box(&graph)));
}

/// A floor of 25 m by 25 m in pixels of 5 cm, without noise.
#[divan::bench(sample_count = 10, sample_size = 1)]
fn rooms_of_a_floor(bencher: Bencher) {
    let side = 500;
    let to_wall = |k: usize| 1.75 - ((k % 71) as f32 - 35.0).abs() * 0.05;
    let door = |k: usize| (27..43).contains(&(k % 71));
    let clearance: Vec<f32> = (0..side * side)
        .map(|i| {
            let (x, y) = (i % side, i / side);
            let inside = to_wall(x).min(to_wall(y));
            if inside <= 0.0 && (door(x) || door(y)) { 0.4 } else { inside.max(0.0) }
        })
        .collect();
    bencher.bench_local(|| {
        let (graph, _) = grid_graph(black_box(&clearance), side);
        let areas = vec![0.0025; graph.len()];
        pinch(&graph, &areas, &PinchConfig::default()).expect("valid")
    });
}
