//! Pictures of fisheyes against one ray a pixel, and against the panorama of the same place.

mod support;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use omni_sim::fisheye::{Curve, Fisheye, FisheyeConfig};
use omni_sim::panorama::PanoramaConfig;
use omni_sim::render::render;
use omni_sim::scenes::named_scene;
use omni_sim::world::World;

fn fisheye() -> Fisheye {
    let config = FisheyeConfig {
        width: 512,
        height: 512,
        curve: Curve::OddPolynomial { k: [0.004, -0.002, 0.0005, -0.0001] },
        focal_px: [152.0, 152.0],
        slant: [0.0, 0.0],
        center_px: [255.5, 255.5],
        max_angle_rad: 95_f64.to_radians(),
        max_range_m: 60.0,
    };
    Fisheye::new(config).expect("sound")
}

fn place(world_yaw_rad: f64) -> (World, Isometry3<f64>) {
    let building = named_scene("flat").expect("it exists");
    let world = World::of_building(&building).expect("sound");
    let at = building.rooms[0].center();
    let pose = Isometry3::from_parts(
        nalgebra::Translation3::new(at.x, at.y, 0.7),
        UnitQuaternion::from_euler_angles(0.05, -0.03, world_yaw_rad),
    );
    (world, pose)
}

#[test]
fn few_rays_show_what_all_rays_show() {
    let fisheye = fisheye();
    for yaw in [0.3, 2.0] {
        let (world, pose) = place(yaw);
        let snapshot = world.at(0);
        let (rgb, instances) = fisheye.render(&snapshot, &pose);
        let (all_rgb, all_instances) = fisheye.render_every_pixel(&snapshot, &pose);
        let wrong = instances.iter().zip(&all_instances).filter(|(a, b)| a != b).count() as f64;
        assert!(wrong / (instances.len() as f64) < 0.005, "{wrong} pixels of another thing");
        // Every thing of a hand's size is there.
        let areas = |pixels: &[u32]| {
            let mut areas = std::collections::BTreeMap::new();
            pixels.iter().for_each(|id| *areas.entry(*id).or_insert(0_usize) += 1);
            areas
        };
        let (few, all) = (areas(&instances), areas(&all_instances));
        for (id, area) in all.iter().filter(|(_, area)| **area >= 30) {
            assert!(few.get(id).is_some_and(|few| *few * 2 > *area), "thing {id} of {area} pixels: {:?}", few.get(id));
        }
        let sum: f64 = rgb.iter().zip(&all_rgb).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
        let rms = (sum / rgb.len() as f64).sqrt();
        assert!(rms < 6.0, "{rms} grey levels"); // borders inside one thing are exact to 2 pixels
    }
}

#[test]
fn the_fisheye_sees_what_the_panorama_sees_in_the_same_direction() {
    let (world, pose) = place(1.0);
    let snapshot = world.at(0);
    let fisheye = fisheye();
    let (_, instances) = fisheye.render_every_pixel(&snapshot, &pose);
    let view = PanoramaConfig::default().view();
    let panorama = render(&snapshot, &pose, &view, 60.0);
    let (mut same, mut compared) = (0, 0);
    for row in (6..512_u32).step_by(5) {
        for column in (6..512_u32).step_by(5) {
            let Some(direction) = fisheye.direction_at(f64::from(column) + 0.5, f64::from(row) + 0.5) else { continue };
            let (u, v) = view.pixel(&direction);
            if !(1.0..639.0).contains(&v) {
                continue;
            }
            compared += 1;
            let seen = panorama.instances[(u as usize % 1920) * 640 + v as usize];
            same += usize::from(seen == instances[(column * 512 + row) as usize]);
        }
    }
    let share = same as f64 / f64::from(compared);
    assert!(compared > 4000 && share > 0.97, "{share} of {compared}");
}

#[test]
fn a_thing_to_the_left_is_left_in_the_picture() {
    // Independent of all tables: the ray of a pixel, cast by hand.
    let (world, pose) = place(0.0);
    let snapshot = world.at(0);
    let fisheye = fisheye();
    let (_, instances) = fisheye.render_every_pixel(&snapshot, &pose);
    for (column, row) in [(60_u32, 256_u32), (256, 400), (450, 300), (256, 256)] {
        // Equidistant to a per cent at these angles: enough to hit the same thing away from its border.
        let (right, down) = ((f64::from(column) - 255.5) / 152.0, (f64::from(row) - 255.5) / 152.0);
        let angle = right.hypot(down);
        let side = angle.sin() / angle;
        let direction = pose.rotation * Vector3::new(angle.cos(), -side * right, -side * down);
        let hit = world.ray(&Point3::from(pose.translation.vector), &direction, 60.0, 0);
        let around: Vec<u32> = (-6..=6)
            .flat_map(|dx: i32| (-6..=6).map(move |dy: i32| (dx, dy)))
            .map(|(dx, dy)| instances[((column as i32 + dx) * 512 + row as i32 + dy) as usize])
            .collect();
        let expected = hit.map_or(0, |hit| hit.instance);
        assert!(around.contains(&expected), "{column} {row}: {expected} is not in {around:?}");
    }
}
