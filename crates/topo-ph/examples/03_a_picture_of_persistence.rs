//! A floor plan, its barcode and its merge tree in one picture: where the bars of the paper's figures come from.
//!
//! `cargo run -p topo-ph --example 03_a_picture_of_persistence -- picture.svg`
//!
//! Flood the plan with the clearance of its floor as height: let the water fall from the widest spot down. Islands rise (a bar begins), grow, and
//! join at the doors (the younger bar ends). A room is a bar that lives long before its door joins it to a wider one.

use std::fmt::Write as _;

use topo_ph::{Bar, Graph, MergeTree, PinchConfig, barcode, grid_graph, pinch};

const CELL_M: f32 = 0.1;
const WIDTH: usize = 140;
const HEIGHT: usize = 90;
/// Bars shorter than this are noise of the pixels, and are not drawn.
const SHORTEST_M: f64 = 0.1;
const COLOURS: [&str; 6] = ["#4e79a7", "#f28e2b", "#59a14f", "#b07aa1", "#edc948", "#76b7b2"];

/// A corridor along the middle; three rooms above it and two below, doors of 0.9 m, and one opening of 1.2 m.
fn is_free(x: usize, y: usize) -> bool {
    let (x, y) = (x as f32 * CELL_M, y as f32 * CELL_M);
    let within = |v: f32, from: f32, to: f32| (from..to).contains(&v);
    let corridor = within(y, 4.0, 5.6) && within(x, 0.5, 13.5);
    let above = within(y, 0.5, 3.8) && (within(x, 0.5, 4.5) || within(x, 4.7, 8.0) || within(x, 8.2, 13.5));
    let below = within(y, 5.8, 8.5) && (within(x, 0.5, 6.5) || within(x, 6.7, 13.5));
    let doors_above = within(y, 3.8, 4.0) && (within(x, 2.0, 2.9) || within(x, 6.0, 6.9) || within(x, 10.0, 10.9));
    let doors_below = within(y, 5.6, 5.8) && (within(x, 3.0, 3.9) || within(x, 9.0, 10.2));
    corridor || above || below || doors_above || doors_below
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. The clearance of every pixel: distance to the nearest wall, by brute force.
    let walls: Vec<(usize, usize)> =
        (0..WIDTH * HEIGHT).map(|i| (i % WIDTH, i / WIDTH)).filter(|&(x, y)| !is_free(x, y)).collect();
    let clearance: Vec<f32> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let to = |w: &(usize, usize)| w.0.abs_diff(i % WIDTH).pow(2) + w.1.abs_diff(i / WIDTH).pow(2);
            CELL_M * (walls.iter().map(to).min().unwrap_or(0) as f32).sqrt()
        })
        .collect();

    // 2. Pixels to a graph; the graph to bars, to a tree and to rooms.
    let (graph, cell_of) = grid_graph(&clearance, WIDTH);
    let mut bars = barcode(&graph);
    bars.retain(|bar| bar.persistence() >= SHORTEST_M);
    let tree = MergeTree::new(&graph);
    let areas = vec![f64::from(CELL_M * CELL_M); graph.len()];
    let rooms = pinch(&graph, &areas, &PinchConfig::default())?;
    assert_eq!(rooms.parts.len(), 6, "five rooms and the corridor");

    // 3. A bar has the colour of the room in which its peak stands.
    let colour = |bar: &Bar| COLOURS[rooms.part_of[bar.birth_vertex as usize] as usize % COLOURS.len()];
    let mut picture = String::from(
        "<svg xmlns='http://www.w3.org/2000/svg' width='1330' height='430' font-family='sans-serif' font-size='13'>\
         <rect width='1330' height='430' fill='white'/>",
    );
    draw_plan(&mut picture, &cell_of, &rooms.part_of)?;
    draw_bars(&mut picture, &bars, colour)?;
    draw_tree(&mut picture, &graph, &tree, &bars, colour)?;
    picture.push_str("</svg>\n");
    let file = std::env::args().nth(1).unwrap_or_else(|| "picture.svg".to_owned());
    std::fs::write(&file, picture)?;
    println!("{} bars of {SHORTEST_M} m and more, {} rooms: {file}", bars.len(), rooms.parts.len());
    Ok(())
}

/// Rooms in colours, one rectangle for each run of pixels.
fn draw_plan(out: &mut String, cell_of: &[u32], part_of: &[u32]) -> std::fmt::Result {
    write!(out, "<g transform='translate(20,50)'><text y='-14'>Rooms (Pinch)</text>")?;
    let mut start = 0;
    while start < cell_of.len() {
        let mut end = start + 1;
        let row = cell_of[start] as usize / WIDTH;
        let goes_on = |end: usize| {
            end < cell_of.len()
                && cell_of[end] == cell_of[end - 1] + 1
                && cell_of[end] as usize / WIDTH == row
                && part_of[end] == part_of[start]
        };
        while goes_on(end) {
            end += 1;
        }
        let (x, colour) = (4 * (cell_of[start] as usize % WIDTH), COLOURS[part_of[start] as usize % COLOURS.len()]);
        write!(out, "<rect x='{x}' y='{}' width='{}' height='4' fill='{colour}'/>", 4 * row, 4 * (end - start))?;
        start = end;
    }
    write!(out, "</g>")
}

/// Pixels of a metre of clearance.
const METRE: f64 = 130.0;

fn draw_bars(out: &mut String, bars: &[Bar], colour: impl Fn(&Bar) -> &'static str) -> std::fmt::Result {
    write!(out, "<g transform='translate(610,50)'><text y='-14'>Barcode: death to birth, metres</text>")?;
    for (row, bar) in bars.iter().enumerate() {
        let (from, to, y) = (METRE * bar.death.unwrap_or(0.0), METRE * bar.birth, 14 + 26 * row);
        let (length, fill) = (to - from, colour(bar));
        write!(out, "<rect x='{from:.1}' y='{y}' width='{length:.1}' height='14' fill='{fill}'/>")?;
    }
    let bottom = 26 * bars.len() + 20;
    for tick in 0..=3 {
        let (x, metres) = (METRE * 0.5 * f64::from(tick), 0.5 * f64::from(tick));
        write!(out, "<line x1='{x}' x2='{x}' y1='6' y2='{bottom}' stroke='#ccc'/>")?;
        write!(out, "<text x='{x}' y='{}' text-anchor='middle'>{metres}</text>", bottom + 16)?;
    }
    write!(out, "</g>")
}

/// Each bar as an upright line; where it ends, a line to the bar it joined.
fn draw_tree(
    out: &mut String,
    graph: &Graph,
    tree: &MergeTree,
    bars: &[Bar],
    colour: impl Fn(&Bar) -> &'static str,
) -> std::fmt::Result {
    write!(out, "<g transform='translate(930,50)'><text y='-14'>Merge tree: doors join rooms</text>")?;
    let (step, top) = (40.0, graph.value(bars[0].birth_vertex));
    let y = |value: f64| 10.0 + METRE * 1.4 * (top - value);
    let place = |peak: u32| bars.iter().position(|bar| bar.birth_vertex == peak);
    for (column, bar) in bars.iter().enumerate() {
        let (x, end, stroke) = (20.0 + step * column as f64, bar.death.unwrap_or(0.0), colour(bar));
        let (from, to) = (y(bar.birth), y(end));
        write!(out, "<line x1='{x}' x2='{x}' y1='{from:.1}' y2='{to:.1}' stroke='{stroke}' stroke-width='6'/>")?;
        // The inner node of the edge that ended the bar carries the peak of the older side.
        let joined = tree.nodes.iter().find(|node| node.edge.is_some() && node.edge == bar.death_edge);
        if let Some(older) = joined.and_then(|node| place(node.peak)) {
            let other = 20.0 + step * older as f64;
            write!(out, "<line x1='{x}' x2='{other}' y1='{to:.1}' y2='{to:.1}' stroke='#444'/>")?;
            write!(out, "<text x='{}' y='{:.1}' font-size='11'>{end:.2}</text>", x + 5.0, to + 12.0)?;
        }
    }
    write!(out, "</g>")
}
