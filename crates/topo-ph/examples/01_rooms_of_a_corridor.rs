//! Three rooms along a corridor: how the clearance of places alone tells where one room ends.
//!
//! The robot drives through room A, a door, a corridor, a wide opening into room B, and a narrow door into room C.
//! At each place it knows one number, the distance to the nearest wall. Run:
//! `cargo run -p topo-ph --example 01_rooms_of_a_corridor`

use topo_ph::{Graph, PinchConfig, PlateauConfig, PlateauOutcome, barcode, betti_curve, nonzero, pinch, plateau};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. The places along the way and their clearance in metres.
    //           room A         door  corridor        opening  room B    door  room C
    let values = vec![1.2, 2.0, 1.5, 0.5, 0.9, 0.92, 0.9, 0.88, 1.1, 1.6, 0.4, 1.3, 1.2];
    let edges = (1..values.len() as u32).map(|v| (v - 1, v)).collect();
    let graph = Graph::new(values, edges, None)?;

    // 2. The barcode: each bar is a peak of clearance, from its height down to the pass that joins it to a higher peak.
    let bars = nonzero(&barcode(&graph));
    println!("bars (peak place, birth, death):");
    for bar in &bars {
        println!("  place {:2}  {:.2} -> {:?}", bar.birth_vertex, bar.birth, bar.death);
    }

    // 3. The Betti curve counts the bars alive at each threshold.
    for interval in betti_curve(&bars).intervals() {
        println!("  {} component(s) for t in ({:.2}, {:.2}]", interval.count, interval.low, interval.high);
    }

    // 4. The paper's rule: one threshold, from the longest plateau (Eq. 5).
    match plateau(&bars, &PlateauConfig::default())? {
        PlateauOutcome::Found(found) => {
            println!("plateau: {} parts at threshold {:.2} m", found.count, found.threshold);
        }
        PlateauOutcome::SinglePart => println!("plateau: one part"),
    }

    // 5. The default rule: each border is judged by itself, relative to the smaller room.
    let rooms = pinch(&graph, &[1.0; 13], &PinchConfig { min_area: 0.0, ..PinchConfig::default() })?;
    println!("pinch: {:?}", rooms.part_of);
    for border in &rooms.borders {
        println!("  room {} | room {} at a clearance of {:.2} m", border.a, border.b, border.saddle);
    }

    // The corridor (clearance 0.92) is no room of its own: its opening towards B (0.88) is not pinched.
    assert_eq!(rooms.part_of, [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 2, 2]);
    Ok(())
}
