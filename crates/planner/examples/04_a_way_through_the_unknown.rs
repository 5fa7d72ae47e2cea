//! A robot that knows nothing drives through a building of twenty rooms, and the graph grows with what it sees.
//!
//! Every cycle: look, hand the window to the graph, ask the guide for the way, drive 20 cm of it. The way leads through known free space if
//! there is one and is an attempt otherwise; a door closes behind the robot, and it comes home another way.
//!
//! Run: `cargo run -p planner --example 04_a_way_through_the_unknown [PICTURE.svg]`. The picture has four moments: what is seen (white), known
//! edges (blue), attempts (orange), nodes, trajectory nodes (green), frontiers (rings), the way (red), the way driven (black).
#[path = "../tests/support/mod.rs"]
mod support;

use std::fmt::Write;

use nalgebra::Point2;
use planner::ground::far::config::FarConfig;
use planner::ground::far::guidance::{Guidance, Guide};
use planner::ground::far::node::NodeKind;
use planner::ground::far::tile::Through;
use planner::ground::far::window::Seen;
use planner::ground::far::{DynamicVisibilityGraph, search::FarRoute};
use support::building::{Belief, Building, advance, ground};

fn main() {
    // 1. The building, a tree of rooms with some loops; the robot stands in the first room.
    let mut building = Building::of_rooms(5, 4, 0.15, 11, 3, 2);
    let (home, away) = (building.rooms[0], building.rooms[19]);
    let mut belief = Belief::new(&building);
    let mut graph = DynamicVisibilityGraph::new(FarConfig::default()).expect("the defaults hold");
    let mut at = home;
    let mut driven = vec![at];
    let mut strips = Vec::new();
    let mut cells = Vec::new();

    // 2. There, and home again; on the way back the door that the robot came through last is shut.
    let mut metres = [0.0, 0.0];
    for (leg, goal) in [away, home].into_iter().enumerate() {
        if leg == 1 {
            let last = driven.iter().rev().find_map(|p| building.doors.iter().find(|(d, ..)| is_in(d, p, 0.15)));
            let door = last.expect("the robot came through a door").0;
            building.fill(door, true);
        }
        let mut guide = Guide::new(ground(&goal));
        for cycle in 0..1500 {
            // 3. Look, and tell the graph: the window is FAR's, 401 x 401 cells of 15 cm.
            belief.scan(&building, &at, 8.0, 720);
            let update = graph.update(&ground(&at), &belief.window(&at, 401, &mut cells)).expect("a good window");
            // 4. Ask, and drive.
            let Guidance::Drive { route, .. } = guide.next(&graph, &ground(&at)) else { break };
            let drive: Vec<Point2<f64>> = route.points.iter().map(|p| p.xy()).collect();
            let next = advance(&at, &drive, 0.2);
            metres[leg] += (next - at).norm();
            at = next;
            driven.push(at);
            if cycle % 60 == 40 {
                println!(
                    "{:5.1} m driven, {:5.1} m to go through the {:7}; {:3} nodes, {:4} edges, {} new cells, {} segments measured",
                    metres[0] + metres[1],
                    route.length_m,
                    if route.through == Through::Known { "known" } else { "unknown" },
                    graph.nodes().count(),
                    graph.edges().count(),
                    update.changed_cells,
                    update.tested
                );
                strips.push(strip(&graph, &belief, &route, &driven));
            }
        }
        assert!((goal - at).norm() <= 0.5, "the robot arrives");
    }
    println!("{:.1} m there, {:.1} m home; {} frontiers are left", metres[0], metres[1], graph.frontiers().len());
    assert!(metres.iter().all(|m| *m < 100.0));

    // 5. The picture: four of the moments side by side.
    if let Some(path) = std::env::args().nth(1) {
        let chosen = (0..4usize).map(|k| strips[k * (strips.len() - 1) / 3].as_str());
        let (w, h) = (building.width as f64 * 0.15, building.height as f64 * 0.15);
        let mut svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {} {}' width='1800'>",
            2.0 * w + 1.0,
            2.0 * h + 1.0
        );
        for (k, strip) in chosen.enumerate() {
            let (x, y) = ((k % 2) as f64 * (w + 1.0), (k / 2) as f64 * (h + 1.0) + h);
            // y upward.
            let _ = write!(svg, "<g transform='translate({x} {y}) scale(1 -1)'>{strip}</g>");
        }
        svg.push_str("</svg>");
        std::fs::write(&path, svg).expect("the picture can be written");
        println!("{path}");
    }
}

fn is_in(rect: &[i64; 4], p: &Point2<f64>, voxel_m: f64) -> bool {
    let (x, y) = ((p.x / voxel_m).floor() as i64, (p.y / voxel_m).floor() as i64);
    (rect[0] - 1..rect[2] + 1).contains(&x) && (rect[1] - 1..rect[3] + 1).contains(&y)
}

fn strip(graph: &DynamicVisibilityGraph, belief: &Belief, route: &FarRoute, driven: &[Point2<f64>]) -> String {
    let v = belief.voxel_m;
    let (w, h) = (belief.width as f64 * v, belief.height as f64 * v);
    let mut out = format!("<rect width='{w}' height='{h}' fill='#b8bcc4'/>");
    for (kind, colour) in [(Seen::Free, "#ffffff"), (Seen::Occupied, "#303438")] {
        let mut d = String::new();
        for y in 0..belief.height {
            let mut x = 0;
            while x < belief.width {
                let start = x;
                while x < belief.width && belief.get(x, y) == kind {
                    x += 1;
                }
                if x > start {
                    let _ = write!(
                        d,
                        "M{:.2} {:.2}h{:.2}v{v}h{:.2}z",
                        start as f64 * v,
                        y as f64 * v,
                        (x - start) as f64 * v,
                        (start - x) as f64 * v
                    );
                }
                x += i64::from(x == start);
            }
        }
        let _ = write!(out, "<path d='{d}' fill='{colour}'/>");
    }
    for (a, b, through) in graph.edges() {
        let colour = if through == Through::Known { "#4a90d9" } else { "#f0a030" };
        let _ = write!(
            out,
            "<path d='M{:.2} {:.2}L{:.2} {:.2}' stroke='{colour}' stroke-width='.025' opacity='.6'/>",
            a.x, a.y, b.x, b.y
        );
    }
    for node in graph.nodes() {
        let colour = match node.kind {
            NodeKind::Trajectory => "#2e9e4f",
            _ if node.is_frontier => "#c030c0",
            _ => "#1d4f91",
        };
        let _ = write!(out, "<circle cx='{:.2}' cy='{:.2}' r='.09' fill='{colour}'/>", node.at.x, node.at.y);
    }
    for frontier in graph.frontiers() {
        let _ = write!(
            out,
            "<circle cx='{:.2}' cy='{:.2}' r='.25' fill='none' stroke='#c030c0' stroke-width='.08'/>",
            frontier.at.x, frontier.at.y
        );
    }
    let mut line = |points: &mut dyn Iterator<Item = Point2<f64>>, colour: &str| {
        let d: Vec<String> = points.map(|p| format!("{:.2},{:.2}", p.x, p.y)).collect();
        let _ = write!(out, "<polyline points='{}' fill='none' stroke='{colour}' stroke-width='.1'/>", d.join(" "));
    };
    line(&mut driven.iter().copied(), "#000000");
    line(&mut route.points.iter().map(|p| p.xy()), "#e03030");
    out
}
