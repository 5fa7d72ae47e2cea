//! A robot stands in the door of a kitchen and looks. Frame by frame it is told of labelled points; some labels are wrong, one
//! thing is not there. What remains is a scene graph one can ask.
//!
//! Run: `cargo run -p dsg --example 01_a_kitchen_is_seen`

use dsg::{
    AssociationConfig, GroupConfig, Object, ObjectEvidence, PlaceId, PlaceState, PlaceUpdate, RelationConfig,
    RelationKind, RoomConfig, RoomPart, SceneGraph, forget_ghosts, observe_objects, scene_graph_text, update_groups,
    update_places, update_relations, update_rooms,
};
use nalgebra::{Point3, Vector3};

/// Points on the surface of a box, as a LiDAR might return them.
fn surface(center: [f32; 3], sides: [f32; 3], frame: usize) -> Vec<Point3<f32>> {
    let point = |i: usize| {
        // A low-discrepancy walk over the faces; every frame begins elsewhere.
        let a = ((i + 97 * frame) as f32 * 0.618_034) % 1.0 - 0.5;
        let b = ((i + 31 * frame) as f32 * 0.754_878) % 1.0 - 0.5;
        let side = if i.is_multiple_of(2) { 0.5 } else { -0.5 };
        let share = match i % 3 {
            0 => [side, a, b],
            1 => [a, side, b],
            _ => [a, b, side],
        };
        Point3::from(center) + Vector3::from(sides).component_mul(&Vector3::from(share))
    };
    (0..240).map(point).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. The places of the map: a kitchen (0..6) and, behind a door at x = 4, a hallway (6..9) of which the end is unknown.
    let mut graph = SceneGraph::new();
    let place = |id: u64, x: f64, y: f64, frontier_cells: u32| PlaceState {
        id: PlaceId(id),
        position: Point3::new(x, y, 0.7),
        clearance_m: 0.9,
        basis_points: 3,
        frontier_cells,
    };
    let mut put: Vec<PlaceState> = (0..6).map(|i| place(i, 1.0 + (i % 3) as f64, 1.0 + (i / 3) as f64, 0)).collect();
    put.extend((6..9).map(|i| place(i, i as f64 - 1.0, 1.5, u32::from(i == 8) * 40)));
    update_places(&mut graph, &PlaceUpdate { put, ..PlaceUpdate::default() })?;

    // 2. Eight frames. The mug is called a bowl in two of them; in frame 1 there is a suitcase that nobody will see again.
    let things = [
        ("stove", [0.4, 2.6, 0.45], [0.6, 0.6, 0.9], "a white metal stove"),
        ("sink", [1.6, 2.6, 0.85], [0.6, 0.5, 0.2], "a steel sink, used for washing dishes"),
        ("mug", [1.05, 2.6, 0.95], [0.09, 0.09, 0.1], "a red ceramic mug"),
        ("fridge", [2.8, 2.6, 0.9], [0.6, 0.6, 1.8], "a tall grey fridge"),
    ];
    let config = AssociationConfig::default();
    for frame in 0..8_usize {
        let stamp_ns = frame as i64 * 500_000_000;
        let see = |label: &str, center, sides, caption: &str| ObjectEvidence {
            stamp_ns,
            label_weights: vec![(label.to_owned(), 1.0)],
            caption: caption.to_owned(),
            score: 0.8,
            points: surface(center, sides, frame),
            color: None,
            track: None,
        };
        let mut evidence: Vec<ObjectEvidence> = things
            .iter()
            .map(|(label, center, sides, caption)| {
                let is_wrong = *label == "mug" && frame % 4 == 1;
                if is_wrong { see("bowl", *center, *sides, "a bowl") } else { see(label, *center, *sides, caption) }
            })
            .collect();
        if frame == 1 {
            evidence.push(see("suitcase", [3.2, 0.4, 0.3], [0.3, 0.4, 0.6], "a suitcase"));
        }
        let report = observe_objects(&mut graph, &evidence, &config)?;
        println!("frame {frame}: {} views, {} new, revision {}", evidence.len(), report.created.len(), report.revision);
        // Everything is in view; where something was seen, something is.
        forget_ghosts(&mut graph, stamp_ns, &|_: &Object| Some(false), &config)?;
    }
    for frame in 8..12_i64 {
        forget_ghosts(
            &mut graph,
            frame * 500_000_000,
            &|o: &Object| (o.label == "suitcase").then_some(false),
            &config,
        )?;
    }

    // 3. Two parts of free space become rooms; what stands in the first names it.
    let part = |places: std::ops::Range<u64>, x| RoomPart {
        places: places.map(PlaceId).collect(),
        center: Point3::new(x, 1.5, 0.7),
        area_m2: 12.0,
        floor: 0,
    };
    let parts = [part(0..6, 2.0), part(6..9, 6.0)];
    let part_of_point = |p: &Point3<f64>| Some(usize::from(p.x > 4.0));
    let doorways = [(0, 1, Point3::new(4.0, 1.5, 0.7), 0.9)];
    update_rooms(&mut graph, &parts, &doorways, &part_of_point, &RoomConfig::default())?;

    // 4. Relations, checked against a map without walls and a verifier that agrees, and groups.
    let clear = |_: &Point3<f64>, _: &Point3<f64>| None;
    let yes = |_: &Object, _: &Object, _: RelationKind| 1.0;
    update_relations(&mut graph, &clear, &yes, &RelationConfig::default())?;
    update_groups(&mut graph, &GroupConfig::default())?;

    // 5. What a language model is told.
    println!("\n{}", scene_graph_text(&graph));

    // 6. The news since the third frame, and the last of them undone.
    let news = graph.changes_since(3);
    println!("{} events since revision 3", news.len());
    let last = news.last().expect("there was news").inverse();
    let groups = graph.groups().count();
    graph.apply(last)?;
    assert_eq!((groups, graph.groups().count()), (1, 0), "the last event made the group");

    let mug = graph.objects().find(|object| object.label == "mug").expect("the vote was for the mug");
    assert!((mug.centroid - Point3::new(1.05, 2.6, 0.95)).norm() < 0.02);
    assert_eq!(graph.rooms().next().expect("two rooms").name, "kitchen");
    assert!(graph.objects().all(|object| object.label != "suitcase"));
    assert!(graph.relations_of(mug.id).any(|relation| relation.kind == RelationKind::Near));
    graph.check_invariants()?;
    Ok(())
}
