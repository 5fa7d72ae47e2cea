//! A floor plan of 60 thousand free pixels: clearance image in, rooms out, and how long it takes.
//!
//! Twelve rooms in three rows with doors of 0.8 m and one wide opening. Run with --release to see the speed.

use std::time::{Duration, Instant};

use topo_ph::{PinchConfig, grid_graph, pinch};

const CELL_M: f32 = 0.05;
const ROOM: usize = 70; // cells: 3.5 m
const ROWS: usize = 3;
const COLUMNS: usize = 4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. Draw walls one cell thick with a door of 16 cells between neighbours.
    let (width, height) = (COLUMNS * (ROOM + 1) + 1, ROWS * (ROOM + 1) + 1);
    let mut is_free = vec![true; width * height];
    for y in 0..height {
        for x in 0..width {
            let on_wall = |k: usize| k.is_multiple_of(ROOM + 1);
            let is_door = |k: usize| (27..43).contains(&(k % (ROOM + 1)));
            let is_outer = x == 0 || y == 0 || x == width - 1 || y == height - 1;
            let is_wall = (on_wall(x) && !is_door(y)) || (on_wall(y) && !is_door(x));
            is_free[y * width + x] = !is_outer && !is_wall;
        }
    }

    // 2. Clearance by brute force (volumetric-map has the fast one): distance to the nearest wall cell.
    let walls: Vec<(i32, i32)> =
        (0..is_free.len()).filter(|&i| !is_free[i]).map(|i| ((i % width) as i32, (i / width) as i32)).collect();
    let clearance: Vec<f32> = (0..is_free.len())
        .map(|i| {
            let (x, y) = ((i % width) as i32, (i / width) as i32);
            let square = walls.iter().map(|w| (w.0 - x).pow(2) + (w.1 - y).pow(2)).min().unwrap_or(0);
            CELL_M * (square as f32).sqrt()
        })
        .collect();

    // 3. Pixels to a graph, the graph to rooms.
    let cell_area = f64::from(CELL_M * CELL_M);
    let (graph, cell_of) = grid_graph(&clearance, width);
    let areas = vec![cell_area; graph.len()];
    let rooms = pinch(&graph, &areas, &PinchConfig::default())?;
    let building = best_ms(|| assert!(!grid_graph(&clearance, width).1.is_empty()));
    let pinching = best_ms(|| assert!(pinch(&graph, &areas, &PinchConfig::default()).is_ok()));
    println!("{} pixels: graph {building:.1} ms, pinch {pinching:.1} ms", cell_of.len());
    for (index, room) in rooms.parts.iter().enumerate() {
        println!("  room {index:2}: {:5.1} m2, widest circle {:.2} m", room.area, room.peak_value);
    }
    assert_eq!(rooms.parts.len(), ROWS * COLUMNS);
    assert_eq!(rooms.borders.len(), ROWS * (COLUMNS - 1) + COLUMNS * (ROWS - 1));
    Ok(())
}

/// CPU milliseconds (the machine is never alone), best of ten tenths of a second: the counter moves in steps.
fn best_ms(mut work: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..10 {
        let start = cpu_time();
        let mut repeats = 0.0;
        while cpu_time() - start < Duration::from_millis(100) {
            work();
            repeats += 1.0;
        }
        best = best.min((cpu_time() - start).as_secs_f64() * 1e3 / repeats);
    }
    best
}

/// CPU time of this thread where Linux tells it, else time since the first call.
fn cpu_time() -> Duration {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match stat.split_whitespace().next().and_then(|ns| ns.parse().ok()) {
        Some(ns) => Duration::from_nanos(ns),
        None => START.get_or_init(Instant::now).elapsed(),
    }
}
