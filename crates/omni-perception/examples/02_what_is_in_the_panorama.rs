//! A furnished room, a second of LiDAR, one segmented panorama: which things are where?
//!
//! The masks bleed by two pixels over the borders of things, and the LiDAR sees behind things the camera cannot. Both
//! would make things grow into the wall behind them. Run:
//! `cargo run --release -p omni-perception --example 02_what_is_in_the_panorama`

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Point3;
use omni_perception::*;
use support::Moment;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // 1. Ten scans of 32768 points around the time of the image, deskewed; nine masks of a 1920 x 640 panorama.
    let moment = Moment::new(7, 0.015, 2);
    println!("{} points, {} masks", moment.points_in_world.len(), moment.masks.len());

    // 2. Which mask does each point belong to, seen from the camera? Erosion, range buffer, near mode.
    let config = ObservationConfig::default();
    let (points, pose) = (&moment.points_in_world, &moment.world_from_camera);
    let seen = observe_panorama(&moment.panorama(), points, pose, &moment.camera, &config)?;
    println!("{:?}", seen.report);

    // 3. Each thing with its box, beside the true one.
    let mut votes = LabelVote::default();
    for object in &seen.objects {
        let (name, share) = &object.label_weights[0];
        let start = (Point3::from([f32::MAX; 3]), Point3::from([f32::MIN; 3]));
        let (low, high) = object.points_in_world.iter().fold(start, |(low, high), p| (low.inf(p), high.sup(p)));
        let thing = moment.scene.names.iter().position(|n| n == name).ok_or("an unknown name")?;
        let (true_low, true_high) = moment.scene.bounds(thing);
        println!(
            "{name:10} ({share:.1}) {:4} points at {:.1} m, box {:.2} .. {:.2}, truly {:.2} .. {:.2}",
            object.points_in_world.len(),
            object.range_m,
            low,
            high,
            true_low,
            true_high
        );
        if name == "mug" {
            votes.add(object, 1.0);
        }
    }

    // 4. Small things count too, and votes are counted by frames (OmniVLN Eq. 4).
    let vote = votes.result().ok_or("the mug is not seen")?;
    println!("the small one is a {} (margin {:.2})", vote.label, vote.margin);
    assert_eq!(vote.label, "mug");
    assert_eq!(seen.objects.len(), 9);
    Ok(())
}
