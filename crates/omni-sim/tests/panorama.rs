//! The panorama and its masks.

mod support;

use nalgebra::{Isometry3, Vector3};
use omni_sim::mesh::InstanceId;
use omni_sim::motion::KinematicState;
use omni_sim::panorama::{PanoramaConfig, PanoramaRecord, capture, capture_with_truth};
use omni_sim::render::{render, render_every_pixel};
use omni_sim::segmenter::{MaskRecord, SegmenterConfig, segment};
use omni_sim::world::{Thing, World};
use std::collections::BTreeMap;

const SECOND: i64 = 1_000_000_000;

fn still(x: f64, y: f64) -> impl Fn(i64) -> KinematicState + Sync {
    move |stamp_ns| {
        let pose = Isometry3::new(Vector3::new(x, y, 0.9), Vector3::new(0.05, -0.1, 0.7));
        KinematicState::at_rest(stamp_ns, pose)
    }
}

fn small() -> PanoramaConfig {
    PanoramaConfig { width: 960, height: 320, ..PanoramaConfig::default() }
}

fn quiet() -> SegmenterConfig {
    SegmenterConfig { noise_scale: 0.0, ..SegmenterConfig::default() }
}

fn take(world: &World, segmenter: &SegmenterConfig, stamp_ns: i64) -> PanoramaRecord {
    capture(world, &still(2.5, 2.0), &Isometry3::identity(), &small(), segmenter, stamp_ns).unwrap()
}

/// Column-major pixels of a mask.
fn pixels(mask: &MaskRecord) -> Vec<bool> {
    let runs = mask.counts.iter().enumerate();
    runs.flat_map(|(i, &n)| std::iter::repeat_n(i % 2 == 1, n as usize)).collect()
}

#[test]
fn few_rays_give_nearly_the_picture_of_one_ray_a_pixel() {
    let world = support::flat_world(12, 16);
    for (x, y, turn) in [(2.5, 2.0, 0.0), (7.0, 6.0, 1.0), (5.0, 2.0, 2.5)] {
        let pose = Isometry3::new(Vector3::new(x, y, 1.0), Vector3::new(0.1, 0.05, turn));
        let snapshot = world.at(SECOND);
        let view = PanoramaConfig::default().view();
        let fast = render(&snapshot, &pose, &view, 60.0);
        let slow = render_every_pixel(&snapshot, &pose, &view, 60.0);
        let differ = fast.instances.iter().zip(&slow.instances).filter(|(a, b)| a != b).count();
        let share = differ as f64 / slow.instances.len() as f64;
        assert!(share < 1e-3, "{share} of the pixels show another thing");
        let far = fast.rgb.iter().zip(&slow.rgb).filter(|(a, b)| a.abs_diff(**b) > 24).count();
        assert!((far as f64) < 0.01 * slow.rgb.len() as f64, "{far} colours are far off");
        assert!(fast.rays * 8 < slow.rays, "{} of {} rays", fast.rays, slow.rays);
        // No thing of some size is overlooked.
        let mut areas: BTreeMap<InstanceId, (usize, usize)> = BTreeMap::new();
        for (a, b) in fast.instances.iter().zip(&slow.instances) {
            areas.entry(*a).or_default().0 += 1;
            areas.entry(*b).or_default().1 += 1;
        }
        for (instance, (fast, slow)) in areas {
            assert!(slow < 16 || fast * 2 > slow, "instance {instance}: {fast} of {slow} pixels");
        }
    }
}

#[test]
fn without_noise_masks_are_the_pixels_of_the_things() {
    let world = support::flat_world(8, 16);
    let (record, truth) =
        capture_with_truth(&world, &still(2.5, 2.0), &Isometry3::identity(), &small(), &quiet(), 0).unwrap();
    assert!(record.masks.len() >= 5);
    let total = (record.width * record.height) as usize;
    let mut covered = vec![false; total];
    for mask in &record.masks {
        let pixels = pixels(mask);
        assert_eq!(pixels.len(), total, "run lengths sum to the picture");
        let first = pixels.iter().position(|&p| p).unwrap();
        let thing = world.thing(truth.instances[first]).unwrap();
        assert_eq!((&mask.label, &mask.caption), (&thing.class, &thing.caption));
        for (i, _) in pixels.iter().enumerate().filter(|(_, p)| **p) {
            assert_eq!(truth.instances[i], thing.instance);
            assert!(!covered[i], "masks without noise do not overlap");
            covered[i] = true;
        }
    }
    // What has no mask is structure or too small to be seen.
    let mut left: BTreeMap<InstanceId, usize> = BTreeMap::new();
    for (i, &instance) in truth.instances.iter().enumerate() {
        if !covered[i] && instance != 0 {
            *left.entry(instance).or_default() += 1;
        }
    }
    assert!(left.values().all(|&n| n < 50), "{left:?}");
}

#[test]
fn renumbering_the_instances_changes_no_byte() {
    let (mesh, things) = support::flat(9, 12);
    let renumber = |id: InstanceId| if id == 0 { 0 } else { (id * 7919) % 100_003 };
    let mut mesh2 = mesh.clone();
    mesh2.instances.iter_mut().for_each(|i| *i = renumber(*i));
    let renamed = things.iter().map(|t| Thing { instance: renumber(t.instance), ..t.clone() });
    let world = World::new(mesh, vec![], things.clone()).unwrap();
    let world2 = World::new(mesh2, vec![], renamed.collect()).unwrap();
    for k in 0..6 {
        let noise = SegmenterConfig { noise_scale: 2.0, ..SegmenterConfig::default() };
        assert_eq!(take(&world, &noise, k * SECOND), take(&world2, &noise, k * SECOND));
    }
}

#[test]
fn the_same_bytes_at_one_and_at_three_threads() {
    let world = support::flat_world(10, 16);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| take(&world, &SegmenterConfig::default(), SECOND))
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn errors_come_as_often_as_they_should_and_stay_for_a_while() {
    let world = support::flat_world(12, 8);
    let rooms = [(2.5, 2.0), (7.5, 2.0), (12.5, 2.0), (2.5, 6.0), (7.5, 6.0), (12.5, 6.0)];
    let (mut seen, mut missed, mut confused, mut false_positives, mut frames) = (0, 0, 0, 0, 0);
    let (mut changes, mut steps) = (0, 0);
    for (x, y) in rooms {
        // Everything stands still and is rendered once: masks of one thing have the same pixels in every frame.
        let (snapshot, pose) = (world.at(0), still(x, y)(0).world_from_body);
        let rendering = render(&snapshot, &pose, &small().view(), 60.0);
        let truth = segment(&snapshot, &rendering, &pose, 0, &quiet());
        let mut last: BTreeMap<usize, String> = BTreeMap::new();
        for k in 0..60 {
            let config = SegmenterConfig { bleed_px: 0.0, ..SegmenterConfig::default() };
            let masks = segment(&snapshot, &rendering, &pose, k * SECOND / 2, &config);
            frames += 1;
            let mut labels: BTreeMap<usize, String> = BTreeMap::new();
            for (i, expected) in truth.iter().enumerate() {
                seen += 1;
                match masks.iter().find(|m| m.counts == expected.counts) {
                    None => missed += 1,
                    Some(mask) if mask.label == expected.label => {
                        assert_eq!(mask.caption, expected.caption);
                        labels.insert(i, mask.label.clone());
                    }
                    Some(mask) => {
                        confused += 1;
                        assert_ne!(mask.caption, expected.caption, "a wrong label has a wrong caption");
                        labels.insert(i, mask.label.clone());
                    }
                }
            }
            for (i, label) in &labels {
                if let Some(before) = last.get(i) {
                    steps += 1;
                    changes += usize::from(before != label);
                }
            }
            false_positives += masks.len() - labels.len();
            last = labels;
        }
    }
    let share = |n: usize, of: usize| n as f64 / of as f64;
    let (miss, confusion) = (share(missed, seen), share(confused, seen - missed));
    eprintln!("missed {miss:.3}, confused {confusion:.3}");
    assert!((0.08..0.25).contains(&miss), "missed {miss}");
    assert!((0.04..0.13).contains(&confusion), "confused {confusion}");
    let false_rate = share(false_positives, frames);
    assert!((0.1..0.6).contains(&false_rate), "false positives {false_rate}");
    // Independent draws would change a label in 2 * 0.08 * 0.92 = 15 % of the steps; errors that last 4 s, in 2 %.
    assert!(share(changes, steps) < 0.05, "labels change in {} of steps", share(changes, steps));
}

#[test]
fn phrases_and_blank_mode() {
    let world = support::flat_world(12, 8);
    let asked =
        SegmenterConfig { phrases: vec!["Tables".into(), "wooden chair".into()], only_phrases: true, ..quiet() };
    let masks = take(&world, &asked, 0).masks;
    assert!(!masks.is_empty() && masks.iter().all(|m| m.label == "table" || m.label == "chair"));
    let blank = SegmenterConfig { blank: true, ..SegmenterConfig::default() };
    let record = take(&world, &blank, 0);
    assert!(record.masks.is_empty() && record.rgb.iter().any(|&c| c > 0));
}

#[test]
fn a_thing_behind_the_robot_gives_two_masks_at_the_seam() {
    let mut mesh = omni_sim::mesh::TriangleMesh::default();
    support::push_box(&mut mesh, [-3.0, -1.0, 0.0], [-2.0, 1.0, 2.0], 4, [200; 3]);
    let thing = Thing { instance: 4, class: "sofa".into(), ..Thing::default() };
    let world = World::new(mesh, vec![], vec![thing]).unwrap();
    let ahead = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(0.0, 0.0, 1.0));
    let masks = capture(&world, &ahead, &Isometry3::identity(), &small(), &quiet(), 0).unwrap().masks;
    assert_eq!(masks.iter().map(|m| m.label.as_str()).collect::<Vec<_>>(), ["sofa", "sofa"]);
    // Symmetric: the same number of pixels left and right, up to a column.
    let area = |m: &MaskRecord| pixels(m).iter().filter(|p| **p).count() as i64;
    assert!((area(&masks[0]) - area(&masks[1])).abs() < 320);
}
