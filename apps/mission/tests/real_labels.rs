//! Labels on two real frames (KITTI and nuScenes, as mmdetection3d ships them): loose masks around cars and people, with road
//! and walls inside them, and boxes in space that say which points are theirs.
//!
//! The frames carry other people's terms and are not ours to ship: the tests skip where `../shared/data/lidar` is absent.

use std::path::PathBuf;

use mission::omni_perception::{Equirectangular, LabelConfig, Mask, Rle, transfer_labels};
use nalgebra::{Isometry3, Matrix3, Matrix4, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;

/// A panorama fine enough for a road: 21 pixels a degree, 15 degrees up and 20 down.
fn camera() -> Equirectangular {
    Equirectangular {
        width_px: 7680,
        height_px: 747,
        phi_top_rad: 15_f64.to_radians(),
        phi_bottom_rad: -20_f64.to_radians(),
    }
}

fn folder(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/lidar")).join(name);
    if !path.is_dir() {
        eprintln!("skipped: {} is absent", path.display());
        return None;
    }
    Some(path)
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("readable")).expect("JSON")
}

/// Positions from records of `fields` single-precision numbers.
fn points(path: PathBuf, fields: usize) -> Vec<Point3<f64>> {
    let bytes = std::fs::read(path).expect("readable");
    let number = |at: &[u8]| f64::from(f32::from_le_bytes([at[0], at[1], at[2], at[3]]));
    let record = |r: &[u8]| Point3::new(number(&r[0..]), number(&r[4..]), number(&r[8..]));
    bytes.chunks_exact(4 * fields).map(record).collect()
}

/// The pose in a 4 x 4 matrix, whose rotation is rounded.
fn pose(rows: &Value) -> Isometry3<f64> {
    let matrix = Matrix4::from_fn(|row, column| rows[row][column].as_f64().expect("a number"));
    let rotation: Matrix3<f64> = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Isometry3::from_parts(Translation3::new(matrix[(0, 3)], matrix[(1, 3)], matrix[(2, 3)]), turn)
}

/// x forward, y left, z up from x right, y down, z forward.
fn level(p: &Point3<f64>) -> Point3<f64> {
    Point3::new(p.z, -p.x, -p.y)
}

/// A thing: where it is, half its sides, and its outline in the panorama.
struct Thing {
    camera_from_box: Isometry3<f64>,
    half_m: Vector3<f64>,
    mask: Mask,
}

impl Thing {
    /// Boxes are drawn a little tight or loose: points this near belong to them.
    fn has(&self, point: &Point3<f64>, margin_m: f64) -> bool {
        let p = self.camera_from_box.inverse() * point;
        (0..3).all(|k| p[k].abs() <= self.half_m[k] + margin_m)
    }
}

/// The mask of an outline given by directions, and a score that falls with the distance: nearer things are on top.
fn mask(outline: &[Vector3<f64>], distance_m: f64) -> Option<Mask> {
    let camera = camera();
    let corner = |d: &Vector3<f64>| {
        let u = (0.5 - d.y.atan2(d.x) / std::f64::consts::TAU) * f64::from(camera.width_px);
        let v = (camera.phi_top_rad - d.z.atan2(d.x.hypot(d.y))) / camera.row_angle_rad();
        [u, v]
    };
    let corners: Vec<[f64; 2]> = outline.iter().map(corner).collect();
    // What crosses the seam would be drawn all round: left out here.
    let (left, right) = corners.iter().fold((f64::MAX, f64::MIN), |(l, r), c| (l.min(c[0]), r.max(c[0])));
    if right - left > f64::from(camera.width_px) / 2.0 {
        return None;
    }
    let rle = Rle::from_polygons(camera.width_px, camera.height_px, &[corners]).expect("sound");
    (rle.area() >= 25).then(|| Mask::new(rle, "thing", (1.0 / (1.0 + 0.01 * distance_m)) as f32))
}

/// Share of right labels, without any defence and with ours, and the share of the things' points under their masks that are found.
fn judge(points: &[Point3<f64>], things: &[Thing]) -> [f64; 3] {
    let masks: Vec<Mask> = things.iter().map(|thing| thing.mask.clone()).collect();
    let single: Vec<Point3<f32>> = points.iter().map(|p| p.cast()).collect();
    let naive = LabelConfig {
        erosion_px: 0,
        hidden_step_m: 1e3,
        link_share: 1e3,
        max_link_m: 1e3,
        depth_ratio: 1e3,
        ..LabelConfig::default()
    };
    // Two pixels of this panorama are 0.09 degrees: a LiDAR's rows are 0.4 to 1.3 degrees apart.
    let ours = LabelConfig { cell_px: 8, ..LabelConfig::default() };
    let run = |config: &LabelConfig| transfer_labels(&single, &camera(), &masks, config).expect("sound").mask_of_point;
    let share = |labels: &[Option<u16>]| {
        let labelled = labels.iter().zip(points).filter_map(|(label, point)| Some((label.as_ref()?, point)));
        let right = labelled.map(|(label, point)| things[usize::from(*label)].has(point, 0.25));
        let (right, all) = right.fold((0, 0), |(right, all), is_right| (right + usize::from(is_right), all + 1));
        right as f64 / f64::from(all.max(1))
    };
    let (naive, ours) = (run(&naive), run(&ours));
    let own = |label: &Option<u16>, point| label.is_some_and(|label: u16| things[usize::from(label)].has(point, 0.0));
    let under = naive.iter().zip(points).filter(|(label, point)| own(label, point)).count();
    let found = ours.iter().zip(points).filter(|(label, point)| own(label, point)).count();
    [share(&naive), share(&ours), found as f64 / under.max(1) as f64]
}

#[test]
fn kitti_boxes_of_the_picture_label_the_points_of_the_cars() {
    let Some(folder) = folder("kitti") else { return };
    let calibration = json(folder.join("000008_calib.json"));
    let camera2 = &calibration["images"]["CAM2"];
    let camera_from_lidar = pose(&camera2["lidar2cam"]);
    let points: Vec<Point3<f64>> =
        points(folder.join("000008.bin"), 4).iter().map(|p| level(&(camera_from_lidar * p))).collect();
    assert_eq!(points.len(), 17_238);
    let focal = |row: usize, column: usize| camera2["cam2img"][row][column].as_f64().expect("a number");
    let ray = |u: f64, v: f64| {
        level(&Point3::new((u - focal(0, 2)) / focal(0, 0), (v - focal(1, 2)) / focal(1, 1), 1.0)).coords
    };
    let mut things = Vec::new();
    for instance in calibration["instances"].as_array().expect("a list") {
        let numbers = |key: &str| -> Vec<f64> {
            instance[key].as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
        };
        let (picture, space) = (numbers("bbox"), numbers("bbox_3d"));
        if space[3] < 0.0 {
            continue; // "do not care"
        }
        // The annotated rectangle of the picture, side by side with some points on each.
        let (left, top, right, bottom) = (picture[0], picture[1], picture[2], picture[3]);
        let side = |a: [f64; 2], b: [f64; 2]| {
            (0..16).map(move |k| f64::from(k) / 16.0).map(move |s| [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])])
        };
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        let outline: Vec<Vector3<f64>> =
            (0..4).flat_map(|k| side(corners[k], corners[(k + 1) % 4])).map(|[u, v]| ray(u, v)).collect();
        // Position of the middle of the lower face, length, height, width, turn about the camera's y axis.
        let bottom = level(&Point3::new(space[0], space[1], space[2]));
        let middle = bottom + Vector3::z() * (space[4] / 2.0);
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -space[6] - std::f64::consts::FRAC_PI_2);
        let camera_from_box = Isometry3::from_parts(middle.into(), turn);
        let half_m = Vector3::new(space[3], space[5], space[4]) / 2.0;
        if let Some(mask) = mask(&outline, middle.coords.norm()) {
            things.push(Thing { camera_from_box, half_m, mask });
        }
    }
    assert!(things.len() >= 5, "{} things", things.len());
    let [naive, ours, found] = judge(&points, &things);
    println!("KITTI: {} things, right {naive:.3} without defences, {ours:.3} with, found {found:.3}", things.len());
    assert!(ours >= 0.9 && ours > naive && found >= 0.7, "{naive} {ours} {found}");
}

#[test]
fn nuscenes_things_all_round_are_labelled() {
    let Some(folder) = folder("surround") else { return };
    let calibration = json(folder.join("calibration.json"));
    // The panorama stands where the front camera is: 0.4 m before the LiDAR and 0.3 m below.
    let front = pose(&calibration["cameras"]["CAM_FRONT"]["lidar2cam"]);
    let to_camera = |p: Point3<f64>| level(&(front * p));
    let points: Vec<Point3<f64>> =
        points(folder.join("LIDAR_TOP__1532402927647951.pcd.bin"), 5).into_iter().map(to_camera).collect();
    assert_eq!(points.len(), 34_688);
    let level_from_camera = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&Matrix3::new(
        0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0,
    )));
    let camera_from_lidar = level_from_camera * front;
    let mut things = Vec::new();
    for instance in calibration["instances"].as_array().expect("a list") {
        let n: Vec<f64> =
            instance["bbox_3d"].as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect();
        if instance["num_lidar_pts"].as_u64().is_none_or(|count| count < 5) {
            continue;
        }
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), n[6]);
        // Unlike KITTI's, the position is the middle of the box: with it the boxes hold `num_lidar_pts` points.
        let in_lidar = Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), turn);
        let camera_from_box = camera_from_lidar * in_lidar;
        let half_m = Vector3::new(n[3], n[4], n[5]) / 2.0;
        let corner = |k: u32| {
            let sign = |bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            (camera_from_box * Point3::from(half_m.component_mul(&Vector3::new(sign(0), sign(1), sign(2))))).coords
        };
        let corners: Vec<Vector3<f64>> = (0..8).map(corner).collect();
        if let Some(mask) = mask(&hull(&corners), camera_from_box.translation.vector.norm()) {
            things.push(Thing { camera_from_box, half_m, mask });
        }
    }
    assert!(things.len() >= 20, "{} things", things.len());
    cut_what_is_hidden(&mut things, &points);
    assert!(things.len() >= 15, "{} things in sight", things.len());
    let [naive, ours, found] = judge(&points, &things);
    println!("nuScenes: {} things, right {naive:.3} without defences, {ours:.3} with, found {found:.3}", things.len());
    assert!(ours >= 0.9 && ours > naive && found >= 0.7, "{naive} {ours} {found}");
}

/// A segmenter draws what it sees, but the hull of a box covers what stands before the thing too. The pixels of nearer boxes
/// are taken out of each mask, and things are left out that something without a box hides: a fifth of the points under
/// their masks, or more, lie before them.
fn cut_what_is_hidden(things: &mut Vec<Thing>, points: &[Point3<f64>]) {
    let (width, height) = (camera().width_px, camera().height_px);
    things.sort_by(|a, b| b.mask.score.total_cmp(&a.mask.score));
    let mut is_taken = vec![false; (width * height) as usize];
    for thing in things.iter_mut() {
        let mut pixels = vec![false; is_taken.len()];
        for span in thing.mask.rle.spans() {
            for row in span.top..span.bottom {
                let index = (row * width + span.column) as usize;
                pixels[index] = !std::mem::replace(&mut is_taken[index], true);
            }
        }
        thing.mask.rle = Rle::from_rows(width, height, &pixels).expect("all pixels");
    }
    let pixel = |p| camera().project(p).map(|at| (at.u as u32, at.v as u32));
    let pixels: Vec<Option<(u32, u32)>> = points.iter().map(pixel).collect();
    things.retain(|thing| {
        let is_under =
            |pixel: &Option<(u32, u32)>| pixel.is_some_and(|(column, row)| thing.mask.rle.contains(column, row));
        let under: Vec<&Point3<f64>> =
            points.iter().zip(&pixels).filter(|(_, at)| is_under(at)).map(|(p, _)| p).collect();
        let middle_m = thing.camera_from_box.translation.vector.norm();
        let is_before = |p: &&&Point3<f64>| p.coords.norm() < middle_m && !thing.has(p, 0.25);
        5 * under.iter().filter(is_before).count() < under.len()
    });
}

/// Convex hull of directions as the panorama shows them, in order round it (gift wrapping).
fn hull(directions: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let flat = |d: &Vector3<f64>| [d.y.atan2(d.x), d.z.atan2(d.x.hypot(d.y))];
    let first = (0..directions.len())
        .min_by(|&a, &b| flat(&directions[a])[0].total_cmp(&flat(&directions[b])[0]))
        .expect("eight corners");
    let (mut here, mut order) = (first, vec![directions[first]]);
    for _ in 0..directions.len() {
        let turns_right = |from: [f64; 2], a: [f64; 2], b: [f64; 2]| {
            (a[0] - from[0]) * (b[1] - from[1]) - (a[1] - from[1]) * (b[0] - from[0]) < 0.0
        };
        let mut next = (here + 1) % directions.len();
        for other in 0..directions.len() {
            if turns_right(flat(&directions[here]), flat(&directions[next]), flat(&directions[other])) {
                next = other;
            }
        }
        if next == first {
            break;
        }
        order.push(directions[next]);
        here = next;
    }
    order
}
