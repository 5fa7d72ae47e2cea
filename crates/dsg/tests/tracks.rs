//! Numbers of a video segmenter are evidence and no identities: they help where names and outlines fail, and however they
//! are switched, swapped or repeated, they make neither two objects of one thing nor one object of two.

mod support;

use std::collections::BTreeMap;

use dsg::{AssociationConfig, ObjectEvidence, ObjectId, SceneGraph, observe_objects};
use nalgebra::Point3;
use proptest::prelude::*;
use support::{Dice, Trouble, USUAL, Walk, furniture};

/// How the tracker numbers what it sees.
#[derive(Debug, Clone, Copy)]
struct Tracker {
    /// Chance per frame and thing that it gets a new number for good.
    switch: f64,
    /// Chance per frame that two things in view swap their numbers for good.
    swap: f64,
    /// Chance per view of a number that belongs to something else in this frame only.
    rubbish: f64,
    seed: u64,
}

impl Tracker {
    /// Numbers for the views of all frames.
    fn number(&self, walk: &Walk) -> Vec<(Vec<ObjectEvidence>, Vec<usize>)> {
        let mut dice = Dice(self.seed);
        let mut track_of: Vec<u64> = (0..walk.things.len() as u64).collect();
        let mut next = track_of.len() as u64;
        (0..walk.frames)
            .map(|frame| {
                let (mut evidence, shows) = walk.frame(frame);
                for &thing in &shows {
                    if dice.unit() < self.switch {
                        track_of[thing] = next;
                        next += 1;
                    }
                }
                if shows.len() > 1 && dice.unit() < self.swap {
                    let (a, b) = (dice.next() as usize % shows.len(), dice.next() as usize % shows.len());
                    track_of.swap(shows[a], shows[b]);
                }
                for (view, &thing) in evidence.iter_mut().zip(&shows) {
                    let other = shows[dice.next() as usize % shows.len()];
                    view.track = Some(track_of[if dice.unit() < self.rubbish { other } else { thing }]);
                }
                (evidence, shows)
            })
            .collect()
    }
}

/// The graph, the objects created in all, and how often each thing was put to each object.
fn run(frames: &[(Vec<ObjectEvidence>, Vec<usize>)]) -> (SceneGraph, usize, BTreeMap<(usize, ObjectId), u32>) {
    let mut graph = SceneGraph::new();
    let (mut created, mut seen_as) = (0, BTreeMap::new());
    for (evidence, shows) in frames {
        let report = observe_objects(&mut graph, evidence, &AssociationConfig::default()).expect("sound");
        graph.check_invariants().expect("holds");
        created += report.created.len();
        for (object, thing) in report.object_of.iter().zip(shows) {
            *seen_as.entry((*thing, object.expect("enough points"))).or_insert(0) += 1;
        }
    }
    (graph, created, seen_as)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn however_numbers_switch_there_is_one_object_for_each_thing(
        seed in any::<u64>(), switch in 0.0..0.5_f64, swap in 0.0..1.0_f64, rubbish in 0.0..0.5_f64
    ) {
        let walk = Walk { things: furniture(), trouble: USUAL, frames: 160, seed };
        let numbered = Tracker { switch, swap, rubbish, seed }.number(&walk);
        let unnumbered: Vec<_> = (0..walk.frames).map(|frame| walk.frame(frame)).collect();
        // Without numbers one walk in some dozens ends with a thing too many; with them it is never worse.
        let wrong = |graph: &SceneGraph| graph.confirmed_objects().count().abs_diff(walk.things.len());
        let (with, without) = (wrong(&run(&numbered).0), wrong(&run(&unnumbered).0));
        prop_assert!(with <= without && without <= 1, "{with} wrong with numbers, {without} without");
    }
}

#[test]
fn one_number_for_everything_changes_nothing() {
    let walk = Walk { things: furniture(), trouble: USUAL, frames: 160, seed: 3 };
    let mut frames: Vec<_> = (0..walk.frames).map(|frame| walk.frame(frame)).collect();
    frames.iter_mut().flat_map(|(evidence, _)| evidence).for_each(|view| view.track = Some(7));
    assert_eq!(run(&frames).0.confirmed_objects().count(), walk.things.len());
}

#[test]
fn numbers_keep_badly_named_views_with_their_thing() {
    let trouble = Trouble { confusion: 0.3, miss: 0.3, ..USUAL };
    let (mut with, mut without) = (0, 0);
    for seed in 0..6 {
        let walk = Walk { things: furniture(), trouble, frames: 160, seed };
        let tracker = Tracker { switch: 0.02, swap: 0.05, rubbish: 0.02, seed };
        let frames = tracker.number(&walk);
        let numbered = run(&frames);
        let unnumbered = run(&(0..walk.frames).map(|frame| walk.frame(frame)).collect::<Vec<_>>());
        let wrong = |graph: &SceneGraph| graph.confirmed_objects().count().abs_diff(walk.things.len());
        assert!(wrong(&numbered.0) <= wrong(&unnumbered.0), "seed {seed}");
        with += numbered.1;
        without += unnumbered.1;
    }
    eprintln!("objects begun: {with} with numbers, {without} without, {} things", 6 * furniture().len());
    assert!(with < without);
}

/// Points of a rectangle 2 cm apart.
fn top(center: [f32; 3], sides: [f32; 2]) -> Vec<Point3<f32>> {
    let (columns, rows) = ((sides[0] / 0.02) as usize + 1, (sides[1] / 0.02) as usize + 1);
    let point = |i: usize| {
        let (u, v) = ((i % columns) as f32 * 0.02, (i / columns) as f32 * 0.02);
        Point3::new(center[0] - sides[0] / 2.0 + u, center[1] - sides[1] / 2.0 + v, center[2])
    };
    (0..columns * rows).map(point).collect()
}

fn view(frame: i64, label: &str, track: Option<u64>, points: Vec<Point3<f32>>) -> ObjectEvidence {
    ObjectEvidence {
        stamp_ns: frame * 500_000_000,
        label_weights: vec![(label.to_owned(), 1.0)],
        caption: String::new(),
        score: 0.9,
        points,
        color: None,
        track,
    }
}

/// Ten frames of a table numbered 4, then one more view: how many objects are there then?
fn objects_after(last: ObjectEvidence) -> usize {
    let mut graph = SceneGraph::new();
    let config = AssociationConfig::default();
    for frame in 0..10 {
        let table = view(frame, "coffee table", Some(4), top([0.0, 0.0, 0.44], [1.0, 0.6]));
        observe_objects(&mut graph, &[table], &config).expect("sound");
    }
    observe_objects(&mut graph, &[last], &config).expect("sound");
    graph.objects().count()
}

#[test]
fn a_number_joins_what_lies_on_its_object_for_a_while() {
    // A fifth of the table under a name that has nothing to do with it.
    let piece = || top([-0.33, 0.0, 0.44], [0.34, 0.34]);
    assert_eq!(objects_after(view(10, "guitar", None, piece())), 2);
    assert_eq!(objects_after(view(10, "guitar", Some(5), piece())), 2);
    assert_eq!(objects_after(view(10, "guitar", Some(4), piece())), 1);
    // Seconds later the number says nothing any more, and elsewhere it never does.
    assert_eq!(objects_after(view(20, "guitar", Some(4), piece())), 2);
    assert_eq!(objects_after(view(10, "coffee table", Some(4), top([3.0, 0.0, 0.44], [1.0, 0.6]))), 2);
    // A mug that got the number of the table it stands on is a mug.
    assert_eq!(objects_after(view(10, "mug", Some(4), top([0.1, 0.1, 0.47], [0.08, 0.08]))), 2);
}

/// Two pieces a frame are one look: a number needs three frames, whatever the segmenter cuts.
#[test]
fn a_thing_cut_in_two_does_not_prove_its_number_twice_a_frame() {
    let after = |frames: i64| {
        let mut graph = SceneGraph::new();
        let config = AssociationConfig::default();
        for frame in 0..frames {
            let half = |x: f32| view(frame, "coffee table", Some(4), top([x, 0.0, 0.44], [0.5, 0.6]));
            let whole = view(frame, "coffee table", None, top([0.0, 0.0, 0.44], [1.0, 0.6]));
            let pieces = if frame == 0 { vec![whole] } else { vec![half(-0.25), half(0.25)] };
            observe_objects(&mut graph, &pieces, &config).expect("sound");
        }
        let last = view(frames, "guitar", Some(4), top([-0.33, 0.0, 0.44], [0.34, 0.34]));
        observe_objects(&mut graph, &[last], &config).expect("sound");
        graph.objects().count()
    };
    // The first frame shows it whole, without a number.
    assert_eq!([after(2), after(3), after(4)], [2, 2, 1]);
}
