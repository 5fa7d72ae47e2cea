//! What a robot sees, feels and runs into.
//!
//! A robot knows nothing of the building but what its sensors tell, and each of them lies a little: the LiDAR is on the move
//! while it measures, the accelerometer feels the gait, the segmenter takes a bowl for a cup. This lesson puts a walking
//! base into a flat it does not know, walks it until it touches something, and looks at what each sensor said on the
//! way, beside the truth. The panorama is written as a picture, with the masks' outlines drawn in.
//!
//! `cargo run --release -p omni-sim --example 02_what_a_robot_sees [SCENE] [FILE.ppm]` (both may be left out)

use std::error::Error;

use nalgebra::{Isometry3, Vector3};
use omni_sim::contact::{CollisionShape, ContactWorld, ShapeGeometry, TouchCounter};
use omni_sim::ground_base::{GroundBase, GroundBaseConfig, VelocityCommand};
use omni_sim::imu::{Imu, ImuConfig};
use omni_sim::lidar::{LidarConfig, RotatingMount, scan};
use omni_sim::motion::Motion;
use omni_sim::panorama::{PanoramaConfig, PanoramaRecord, capture_with_truth};
use omni_sim::scenes::named_scene;
use omni_sim::segmenter::SegmenterConfig;
use omni_sim::world::World;

const SECOND: i64 = 1_000_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let scene = args.first().map_or("flat", String::as_str);

    // 1. A world: triangles to see, shapes to touch, names to be confused.
    let building = named_scene(scene).ok_or("no such scene")?;
    let world = World::of_building(&building)?;
    println!(
        "The {scene} has {} rooms, {} objects and {} triangles.",
        building.rooms.len(),
        building.objects.len(),
        world.static_mesh().faces.len()
    );

    // 2. A robot: a box with a footprint. It starts in the largest room, where nothing is in its way.
    let trunk = CollisionShape {
        body_from_shape: Isometry3::identity(),
        geometry: ShapeGeometry::Box { half_m: Vector3::new(0.35, 0.16, 0.2) },
    };
    let mut contacts = ContactWorld::new(&world, &[trunk], &[])?;
    let room = building.rooms.iter().max_by(|a, b| a.area_m2().total_cmp(&b.area_m2())).ok_or("no room")?;
    let config = GroundBaseConfig::default();
    let height = room.floor_z_m + config.stance_height_m;
    let free = (0..400).find_map(|i| {
        // Outwards from the middle of the room in a spiral.
        let (radius, angle) = (0.1 * f64::from(i).sqrt(), 2.4 * f64::from(i));
        let (x, y) = (room.center().x + radius * angle.cos(), room.center().y + radius * angle.sin());
        let wide = Isometry3::translation(x, y, height);
        contacts.contacts(&wide, 0).is_empty().then_some((x, y))
    });
    let (x, y) = free.ok_or("no free place in the largest room")?;
    println!("It starts in the {} at ({x:.1}, {y:.1}).", room.name);
    let mut base = GroundBase::new(config, 0, (x, y, 0.3), room.floor_z_m)?;

    // 3. It walks ahead until it touches something, and a second longer.
    let ahead = VelocityCommand { forward_mps: 0.6, ..VelocityCommand::default() };
    let mut counter = TouchCounter::new(0.5);
    let mut steps_left = 50;
    while steps_left > 0 && base.state().stamp_ns < 30 * SECOND {
        let touched = base.step(0.02, &ahead, Some(&mut contacts))?;
        counter.observe(&touched);
        steps_left -= i32::from(!counter.touches().is_empty());
    }
    let (_, end_ns) = base.track().span_ns();
    for touch in counter.touches() {
        let name = world.thing(touch.instance).map_or("the structure", |t| &t.class);
        println!("After {:.2} s it touches {name}, {:.1} mm deep.", touch.stamp_ns as f64 * 1e-9, 1e3 * touch.depth_m);
    }
    let speed = base.velocity().forward_mps;
    println!("A second later it wants 0.6 m/s and makes {speed:.2} m/s.");

    // 4. The accelerometer felt the gait: the vertical force swings around gravity.
    let mut imu = Imu::new(ImuConfig::default(), Isometry3::translation(0.0, 0.0, 0.05))?;
    let mut forces = Vec::new();
    for i in 0..=end_ns / 5_000_000 {
        forces.push(imu.sample(base.track(), i * 5_000_000)?.specific_force_mps2.z);
    }
    let (low, high) = forces.iter().fold((f64::MAX, f64::MIN), |(l, h), f| (l.min(*f), h.max(*f)));
    println!("The accelerometer's z read {low:.1} to {high:.1} m/s^2 around 9.81.");

    // 5. The LiDAR measures while it moves: freeze the pose at the scan's start and the points are off.
    let mount = RotatingMount::rotating(Isometry3::translation(0.0, 0.0, 0.3));
    let start_ns = (end_ns / 2).min(SECOND);
    let record = scan(&world, base.track(), &mount, &LidarConfig::default(), start_ns)?;
    let place = |stamp_ns| base.track().at(stamp_ns).world_from_body * mount.body_from_sensor(stamp_ns);
    let off: f64 = record
        .points
        .iter()
        .map(|p| {
            let point = p.position.cast::<f64>();
            let own = place(start_ns + i64::from(p.offset_ns)) * point;
            (own - place(start_ns) * point).norm()
        })
        .fold(0.0, f64::max);
    println!("A scan has {} points; without deskewing the worst is off by {off:.2} m.", record.points.len());

    // 6. The panorama and what a segmenter makes of it.
    let camera = Isometry3::translation(0.0, 0.0, 0.42);
    let (view, segmenter) = (PanoramaConfig::default(), SegmenterConfig::default());
    let (picture, truth) = capture_with_truth(&world, base.track(), &camera, &view, &segmenter, start_ns)?;
    println!(
        "The picture has {} pixels from {} rays; the segmenter found {} masks:",
        truth.instances.len(),
        truth.rays,
        picture.masks.len()
    );
    for mask in &picture.masks {
        println!("  {:.2} {:15} {}", mask.score, mask.label, mask.caption);
    }

    // 7. The same without noise: what it missed or made up.
    let quiet = SegmenterConfig { noise_scale: 0.0, ..segmenter };
    let (honest, _) = capture_with_truth(&world, base.track(), &camera, &view, &quiet, start_ns)?;
    println!("Without noise there are {} masks.", honest.masks.len());

    let file = args.get(1).map_or_else(|| std::env::temp_dir().join("omni-sim-panorama.ppm"), |f| f.into());
    std::fs::write(&file, outlined(&picture))?;
    println!("The picture is in {}.", file.display());

    assert!(off > 0.02, "the robot moves during a scan");
    assert!(!honest.masks.is_empty() && speed < 0.3);
    Ok(())
}

/// The picture as PPM with the masks' outlines in red.
fn outlined(picture: &PanoramaRecord) -> Vec<u8> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mut rgb = picture.rgb.clone();
    for mask in &picture.masks {
        let runs = mask.counts.iter().enumerate();
        // COCO: column-major, zeros first.
        let inside: Vec<bool> = runs.flat_map(|(i, &n)| std::iter::repeat_n(i % 2 == 1, n as usize)).collect();
        for x in 1..width {
            for y in 1..height {
                let at = x * height + y;
                if inside[at] != inside[at - 1] || inside[at] != inside[at - height] {
                    let pixel = 3 * (y * width + x);
                    rgb[pixel..pixel + 3].copy_from_slice(&[230, 30, 30]);
                }
            }
        }
    }
    let mut file = format!("P6\n{width} {height}\n255\n").into_bytes();
    file.extend_from_slice(&rgb);
    file
}
