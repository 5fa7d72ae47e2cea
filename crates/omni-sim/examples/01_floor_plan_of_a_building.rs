//! A building from a seed, drawn as a floor plan.
//!
//! A robot that learns one flat by heart has learned nothing, so every run happens in a building nobody has seen before. This
//! lesson makes one, counts what is in it, and draws each storey as an SVG: rooms with names and areas, doors, furniture from
//! above, small things as dots.
//!
//! `cargo run -p omni-sim --example 01_floor_plan_of_a_building [flat|office|SCENE] [rooms] [seed] [storeys] [FILE.svg]`
//! (all arguments may be left out).

use std::collections::BTreeMap;
use std::fmt::Write as _;

use omni_sim::building::{Building, BuildingConfig, DoorAxis, ObjectTruth, Style, generate};
use omni_sim::scenes::named_scene;

/// Picture points per metre.
const SCALE: f64 = 70.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u32| args.get(i).and_then(|a| a.parse().ok()).unwrap_or(default);
    let first = args.first().map_or("flat", String::as_str);

    // 1. Say what to build. The same configuration gives the same building again.
    let style = if first == "office" { Style::Office } else { Style::Flat };
    let config = BuildingConfig {
        seed: u64::from(number(2, 7)),
        rooms: number(1, 7),
        storeys: number(3, 1),
        style,
        ..Default::default()
    };
    let scene = if args.len() == 1 { named_scene(first) } else { None };
    let building = match scene {
        Some(building) => building,
        None => generate(&config)?,
    };

    // 2. See what is there.
    for room in &building.rooms {
        let things = building.objects.iter().filter(|o| o.room == room.id).count();
        println!("{:16} {:5.1} m2, {} rectangles, {things} things", room.name, room.area_m2(), room.rects.len());
    }
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for object in &building.objects {
        *counts.entry(object.class.as_str()).or_default() += 1;
    }
    let repeated: Vec<String> = counts.iter().filter(|(_, n)| **n > 1).map(|(c, n)| format!("{n} x {c}")).collect();
    println!("{} doors, {} things of {} classes", building.doors.len(), building.objects.len(), counts.len());
    println!("more than once: {}", repeated.join(", "));
    println!("{} triangles, {} movers", building.mesh.faces.len(), building.movers.len());
    for object in building.objects.iter().step_by(building.objects.len() / 5 + 1) {
        println!("  {} {}: {}", object.class, object.id, object.caption);
    }

    // 3. Draw it.
    let path = args
        .get(4)
        .cloned()
        .unwrap_or_else(|| std::env::temp_dir().join("floor-plan.svg").to_string_lossy().into_owned());
    std::fs::write(&path, svg(&building))?;
    println!("floor plan in {path}");

    // 4. What the generator promises: whoever stands in one room can walk to all others.
    let mut known = vec![false; building.rooms.len()];
    known[0] = true;
    for _ in 0..building.rooms.len() {
        for door in &building.doors {
            let (a, b) = (door.rooms.0 as usize, door.rooms.1 as usize);
            (known[a], known[b]) = (known[a] || known[b], known[a] || known[b]);
        }
    }
    assert!(known.iter().all(|k| *k), "every room is reachable");
    Ok(())
}

/// All storeys side by side.
fn svg(building: &Building) -> String {
    let rects = || building.rooms.iter().flat_map(|r| &r.rects);
    let (x0, y0) = (
        rects().map(|r| r.min.x).fold(f64::INFINITY, f64::min),
        rects().map(|r| r.min.y).fold(f64::INFINITY, f64::min),
    );
    let (x1, y1) = (rects().map(|r| r.max.x).fold(0.0, f64::max), rects().map(|r| r.max.y).fold(0.0, f64::max));
    let storeys = building.rooms.iter().map(|r| r.storey).max().unwrap_or(0) + 1;
    let (w, h) = (x1 - x0 + 1.0, y1 - y0 + 1.0);
    let mut out = String::new();
    let _ = writeln!(
        out,
        "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {:.0} {:.0}' font-family='sans-serif'><rect width='100%' height='100%' fill='white'/>",
        w * SCALE * f64::from(storeys),
        h * SCALE
    );
    for storey in 0..storeys {
        let shift = w * f64::from(storey) + 0.5 - x0;
        let px = |x: f64| (x + shift) * SCALE;
        let py = |y: f64| (y1 + 0.5 - y) * SCALE;
        let mut rect = |x0: f64, y0: f64, x1: f64, y1: f64, style: &str| {
            let _ = writeln!(
                out,
                "<rect x='{:.1}' y='{:.1}' width='{:.1}' height='{:.1}' {style}/>",
                px(x0),
                py(y1),
                (x1 - x0) * SCALE,
                (y1 - y0) * SCALE
            );
        };
        let rooms: Vec<_> = building.rooms.iter().filter(|r| r.storey == storey).collect();
        for r in rooms.iter().flat_map(|r| &r.rects) {
            rect(r.min.x - 0.12, r.min.y - 0.12, r.max.x + 0.12, r.max.y + 0.12, "fill='#333'");
        }
        for room in &rooms {
            let tint = ["#fdf6e3", "#e8f1f8", "#eef6e8", "#f8ecec", "#f1ecf8", "#f6f2dd"][room.kind as usize % 6];
            for r in &room.rects {
                // A hair larger, so that the parts of an L join without a seam.
                rect(r.min.x - 0.005, r.min.y - 0.005, r.max.x + 0.005, r.max.y + 0.005, &format!("fill='{tint}'"));
            }
        }
        for d in building.doors.iter().filter(|d| (d.center.z - rooms[0].floor_z_m).abs() < 0.1) {
            let (dx, dy, fill) = match d.axis {
                DoorAxis::X => (0.06, d.width_m / 2.0, "#fff"),
                DoorAxis::Y => (d.width_m / 2.0, 0.06, "#fff"),
                DoorAxis::Z => (0.2, 0.2, "#88f"),
            };
            rect(d.center.x - dx, d.center.y - dy, d.center.x + dx, d.center.y + dy, &format!("fill='{fill}'"));
        }
        let here = |o: &&ObjectTruth| building.rooms[o.room as usize].storey == storey;
        let mut labels = String::new();
        let mut order: Vec<&ObjectTruth> = building.objects.iter().filter(here).collect();
        order.sort_by(|a, b| a.bounds.min.z.total_cmp(&b.bounds.min.z));
        for o in order {
            let b = &o.bounds;
            let style = format!(
                "fill='rgb({},{},{})' fill-opacity='0.75' stroke='#222' stroke-width='1'",
                o.rgb[0], o.rgb[1], o.rgb[2]
            );
            rect(b.min.x, b.min.y, b.max.x, b.max.y, &style);
            let size = if o.supported_by.is_some() { 7 } else { 10 };
            let c = b.center();
            // The side a thing faces, as a short line.
            let (s, k) = o.yaw_rad.sin_cos();
            let reach = 0.5 * (k.abs() * (b.max.x - b.min.x) + s.abs() * (b.max.y - b.min.y));
            if o.supported_by.is_none() {
                let _ = writeln!(
                    labels,
                    "<line x1='{:.1}' y1='{:.1}' x2='{:.1}' y2='{:.1}' stroke='#c00' stroke-width='1'/>",
                    px(c.x + k * reach * 0.7),
                    py(c.y + s * reach * 0.7),
                    px(c.x + k * reach),
                    py(c.y + s * reach)
                );
            }
            let _ = writeln!(
                labels,
                "<text x='{:.1}' y='{:.1}' font-size='{size}' text-anchor='middle' paint-order='stroke' stroke='white' stroke-width='2'>{}</text>",
                px(c.x),
                py(c.y) + 3.0,
                o.class
            );
        }
        for room in &rooms {
            let _ = writeln!(
                labels,
                "<text x='{:.1}' y='{:.1}' font-size='17' font-weight='bold' fill='#06c' text-anchor='middle' paint-order='stroke' stroke='white' stroke-width='3'>{} {:.0} m2</text>",
                px(room.center().x),
                py(room.center().y) - 16.0,
                room.name,
                room.area_m2()
            );
        }
        out.push_str(&labels);
    }
    out.push_str("</svg>\n");
    out
}
