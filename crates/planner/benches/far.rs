//! Claims: in a building of 30 rooms, with FAR's window of 401 x 401 cells of 15 cm, an update takes <= 8 ms (median) and <= 20 ms (99th
//! percentile) of thread CPU time, a search <= 1 ms, and neither grows with the age of the map. The table is printed before the benches.
#[path = "../tests/support/mod.rs"]
mod support;

use cpu_time::ThreadTime;
use divan::Bencher;
use planner::ground::far::tile::Through;
use planner::ground::far::window::Window;
use support::building::{Building, ground};
use support::drive::{Patrol, median_p99};

fn main() {
    figures();
    divan::main();
}

fn building(voxel_m: f64) -> Building {
    Building::of_rooms(6, 5, voxel_m, 4, 3, 2)
}

fn timed(work: &mut dyn FnMut()) -> f64 {
    let start = ThreadTime::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

/// A patrol of 3000 cycles: the first hundred, all, the last hundred.
fn figures() {
    println!("patrol of 30 rooms, 3000 cycles, a box moves every 50: thread CPU ms, median / p99 / most");
    for (voxel_m, noise_m, name) in [
        (0.15, 0.0, "401 x 401 cells of 15 cm"),
        (0.15, 0.02, "401 x 401 cells of 15 cm, ranges off by 2 cm"),
        (0.05, 0.0, "401 x 401 cells of 5 cm"),
    ] {
        let mut patrol = Patrol::new(building(voxel_m), 401);
        patrol.noise_m = noise_m;
        let (mut updates, mut searches, mut quiet) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..3000 {
            let (update, search, what) = patrol.step(&mut timed);
            updates.push(update);
            searches.push(search);
            if what.changed_cells == 0 && what.unsettled == 0 {
                quiet.push(update);
            }
        }
        let (nodes, edges) = (patrol.graph.nodes().count(), patrol.graph.edges().count());
        println!("{name}: {:.0} m driven; {nodes} nodes, {edges} edges at the end", patrol.metres);
        assert!(patrol.metres > 300.0, "the patrol is stuck");
        for (what, times) in [("update", &updates), ("search", &searches)] {
            for (part, of) in
                [("first 100", &times[..100]), ("all", &times[..]), ("last 100", &times[times.len() - 100..])]
            {
                let mut of = of.to_vec();
                let (median, p99) = median_p99(&mut of);
                println!("  {what} {part:9}: {median:7.3} / {p99:7.3} / {:7.3}", of[of.len() - 1]);
            }
        }
        if !quiet.is_empty() {
            let (median, p99) = median_p99(&mut quiet);
            println!("  update of a window that says nothing new ({}): {median:.3} / {p99:.3}", quiet.len());
        }
    }
}

/// Windows of a hundred further cycles, one after the other, at two ages of the map.
#[divan::bench(args = [100, 2000], sample_size = 10)]
fn update(bencher: Bencher, age: u32) {
    let mut patrol = Patrol::new(building(0.15), 401);
    for _ in 0..age {
        patrol.step(&mut |work| work());
    }
    let windows = patrol.record(100);
    let mut next = 0;
    bencher.bench_local(|| {
        let (at, first_cell, seen) = &windows[next % windows.len()];
        next += 1;
        patrol.graph.update(at, &Window { first_cell: *first_cell, width: 401, height: 401, seen })
    });
}

#[divan::bench]
fn search_across_the_building(bencher: Bencher) {
    let mut patrol = Patrol::new(building(0.15), 401);
    for _ in 0..2000 {
        patrol.step(&mut |work| work());
    }
    let (from, to) = (ground(&patrol.building.rooms[0]), ground(&patrol.building.rooms[29]));
    bencher.bench_local(|| patrol.graph.route_through(&from, &to, Through::Known));
}
