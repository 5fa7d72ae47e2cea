//! The tiers of attention from above: the nine scenes as the prompt sorts them.

use std::fmt::Write;

use anyhow::Result;
use arena::map_picture::escape;
use arena::mission::dsg::{Object, ObjectId, SceneGraph};
use arena::mission::octant_prompt::tiers::{View, tiers};
use nalgebra::Point3;

use super::layout::{Section, paragraph};
use crate::bench_tokens::roomy;
use crate::nine_scenes::{CAMERA_HEIGHT_M, agent, nine_scene};

/// How much of a thing the prompt tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tier {
    /// Listed with octant and distance, with its caption if it is asked about.
    Focal,
    /// In the own room, beyond the focal radius.
    Peripheral,
    /// Counted with others of its class in another room.
    Global,
}

/// The tier of every object, as the prompt has it.
fn tier_of(graph: &SceneGraph) -> impl Fn(ObjectId) -> Tier {
    let config = roomy();
    let pose = agent();
    let here = Point3::from(pose.translation.vector);
    let sorted = tiers(&View {
        graph,
        world_from_body: &pose,
        frontiers: &[],
        unseen: &[],
        path_length: &|point| Some((point - here).norm()),
        nouns: &["chair".to_owned()],
        rooms: &[],
        config: &config,
    });
    move |id| {
        if sorted.focal.iter().any(|item| item.id == id) {
            Tier::Focal
        } else if sorted.peripheral.iter().any(|item| item.id == id) {
            Tier::Peripheral
        } else {
            Tier::Global
        }
    }
}

fn color(class: &str) -> &'static str {
    match class {
        "chair" => "#1f6fd0",
        "table" => "#2a9d3a",
        "cabinet" => "#e8871e",
        _ => "#8246af",
    }
}

/// The colour of a class as the paper has it, and what it stands for.
const LEGEND: &str = "<b style=\"color:#1f6fd0\">chair</b>, <b style=\"color:#2a9d3a\">table</b>, <b style=\"color:#e8871e\">cabinet</b>, \
    <b style=\"color:#8246af\">screen</b>; the red diamond is the agent, the dashed circle its focal radius of 3 m, the dotted cross parts its octants (each \
    upper and lower: &#9650; above the camera, &#9660; below).";

/// A scene from above. With `shows_tiers` things are drawn as the prompt tells them: whole, small, or as a number in their room.
fn top_view(graph: &SceneGraph, shows_tiers: bool) -> String {
    const SIDE_M: f64 = 10.0;
    let y = |meters: f64| SIDE_M - meters;
    let at = agent().translation.vector;
    let mut svg = String::from(
        "<svg viewBox=\"-0.2 -0.2 10.4 10.4\" width=\"360\" height=\"360\" xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\">",
    );
    for room in graph.rooms() {
        let (x, top) = (room.center.x - 2.5, y(room.center.y + 2.5));
        let _ = write!(
            svg,
            "<rect x=\"{x}\" y=\"{top}\" width=\"5\" height=\"5\" fill=\"#fbfaf6\" stroke=\"#555\" stroke-width=\"0.06\"/>\
             <text x=\"{:.2}\" y=\"{:.2}\" font-size=\"0.32\" fill=\"#777\">Room {}</text>",
            x + 0.12,
            top + 0.4,
            room.id.0
        );
    }
    let (ax, ay) = (at.x, y(at.y));
    let _ = write!(
        svg,
        "<circle cx=\"{ax}\" cy=\"{ay}\" r=\"3\" fill=\"#ff00000c\" stroke=\"#c00\" stroke-width=\"0.04\" stroke-dasharray=\"0.2 0.12\"/>\
         <path d=\"M{ax} {} V{} M{} {ay} H{}\" stroke=\"#c00\" stroke-width=\"0.03\" stroke-dasharray=\"0.05 0.1\"/>",
        ay - 2.5,
        ay + 2.5,
        ax - 2.5,
        ax + 2.5
    );
    let tier = tier_of(graph);
    for object in graph.objects() {
        match tier(object.id) {
            Tier::Global if shows_tiers => {}
            found => thing(&mut svg, object, shows_tiers && found == Tier::Peripheral, y(object.centroid.y)),
        }
    }
    if shows_tiers {
        counted_rooms(&mut svg, graph, &tier);
    }
    let _ = write!(
        svg,
        "<path d=\"M{ax} {} L{} {ay} L{ax} {} L{} {ay} Z\" fill=\"#c00\"/></svg>",
        ay - 0.25,
        ax + 0.25,
        ay + 0.25,
        ax - 0.25
    );
    svg
}

fn thing(svg: &mut String, object: &Object, is_pale: bool, y: f64) {
    let x = object.centroid.x;
    let mark = if object.centroid.z >= CAMERA_HEIGHT_M { "\u{25b2}" } else { "\u{25bc}" };
    let _ = write!(
        svg,
        "<g opacity=\"{}\"><rect x=\"{:.2}\" y=\"{:.2}\" width=\"0.3\" height=\"0.3\" fill=\"{}\"><title>{} {}: {}</title></rect>\
         <text x=\"{:.2}\" y=\"{:.2}\" font-size=\"0.24\">{}{mark}</text></g>",
        if is_pale { 0.55 } else { 1.0 },
        x - 0.15,
        y - 0.15,
        color(&object.label),
        escape(&object.label),
        object.id,
        escape(&object.caption),
        x + 0.18,
        y + 0.08,
        object.id.0
    );
}

/// Rooms whose things are only counted: a number for each class.
fn counted_rooms(svg: &mut String, graph: &SceneGraph, tier: &dyn Fn(ObjectId) -> Tier) {
    for room in graph.rooms() {
        let things = || graph.objects().filter(|o| o.room == Some(room.id) && tier(o.id) == Tier::Global);
        let classes = ["chair", "table", "cabinet", "screen"];
        for (row, class) in classes.into_iter().enumerate() {
            let count = things().filter(|object| object.label == class).count();
            if count > 0 {
                let _ = write!(
                    svg,
                    "<text x=\"{:.2}\" y=\"{:.2}\" font-size=\"0.42\" fill=\"{}\">{count} x {class}</text>",
                    room.center.x - 1.2,
                    10.0 - room.center.y - 0.5 + 0.5 * row as f64,
                    color(class)
                );
            }
        }
    }
}

/// The scenes D3, D6 and D9, and how the prompt sees a scene that has all tiers.
pub fn section(paper: &super::Paper) -> Result<Section> {
    let mut body = paragraph("The scenes of Table II, seed 0, and below them what the prompt makes of D3, D6 and D9.");
    for shows_tiers in [false, true] {
        body.push_str("<div style=\"display:flex;flex-wrap:wrap;gap:1rem\">");
        for (number, name) in [(3, "focal"), (6, "peripheral"), (9, "global memory")] {
            let _ = write!(
                body,
                "<figure>{}<figcaption>D{number}, {name} tier{}</figcaption></figure>",
                top_view(&nine_scene(number, 0), shows_tiers),
                if shows_tiers { ": as told" } else { "" }
            );
        }
        body.push_str("</div>");
    }
    let _ = write!(
        body,
        "<p class=\"dim\">{LEGEND} As told: full colour is listed one by one within 3 m, with its caption if the instruction asks for its class; pale is the same room \
         beyond; other rooms are counted by class.</p>"
    );
    body.push_str(&paper.own_command("tiers"));
    Ok(Section { id: "tiers", title: "Tiers of attention; D3, D6 and D9 from above", body, claims: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_lie_in_the_tiers_that_they_are_named_for() {
        for (number, wanted) in [(3, Tier::Focal), (6, Tier::Peripheral), (9, Tier::Global)] {
            let graph = nine_scene(number, 0);
            let tier = tier_of(&graph);
            assert!(graph.objects().all(|object| tier(object.id) == wanted), "D{number}");
        }
    }

    #[test]
    fn what_is_only_counted_is_not_drawn() {
        let graph = nine_scene(9, 0);
        let count = |svg: &str| svg.matches("<title>").count();
        assert_eq!((count(&top_view(&graph, false)), count(&top_view(&graph, true))), (50, 0));
        assert!(top_view(&graph, true).contains(" x chair"));
    }
}
