//! What a robot sees and what it makes of it: a panorama and the labelled surface of its map from the same place, and its maps with a LiDAR that
//! turns and one that does not.

use std::fmt::Write;

use anyhow::{Context, Result};
use arena::map_picture::{MapDrawing, escape, map_svg, png_img};
use arena::mission::dsg::SceneGraph;
use arena::mission::octant_prompt::describe::is_hull;
use arena::mission::omni_perception::{Equirectangular, MaskedPanorama, RgbImage};
use arena::mission::robot_model::{RobotKind, RobotModel};
use arena::mission::world_model::WorldModel;
use arena::name_color::name_color;
use arena::run::{RunConfig, with_fixed_lidar};
use arena::scenario::Scene;
use arena::survey::{Moment, survey};
use arena::toured_scene::tour_of;
use arena::workers::on_each_core;
use nalgebra::{Isometry3, Point2, Point3};

use super::layout::{Section, paragraph};

/// What a survey leaves for pictures.
struct Look {
    world: WorldModel,
    path: Vec<Point2<f64>>,
    camera: Equirectangular,
    /// A picture with many things in it, and the camera's pose in the map then, as the robot believed.
    picture: Option<(MaskedPanorama, Isometry3<f64>)>,
}

fn look(robot: &RobotModel, scene: &Scene, seed: u64) -> Result<Look> {
    let config = RunConfig::default();
    let (start, tour) = tour_of(scene, robot, &config, seed).context("this robot fits nowhere in the building")?;
    let floor_z_m = start.translation.vector.z - robot.stance_height_m;
    let (mut path, mut best, mut most) = (Vec::new(), None, 0);
    let surveyed = survey(&config, robot, scene, &start, &tour, floor_z_m, seed, &mut |_, moment| match moment {
        Moment::Scan(_) => {}
        Moment::Picture { picture, map_from_body } => {
            if let Some(map_from_body) = map_from_body.filter(|_| picture.masks.len() > most) {
                most = picture.masks.len();
                best = Some((picture.clone(), map_from_body * robot.sensors.body_from_camera));
            }
        }
        Moment::Refreshed { world, .. } => {
            let Some(odometry) = &world.odometry else { return };
            path.push(odometry.world_from_body.translation.vector.xy().into());
        }
    })?;
    let camera = surveyed.camera;
    Ok(Look { world: surveyed.world, path, camera, picture: best })
}

/// The picture with the outlines and names of what the segmenter found.
fn panorama_html(picture: &MaskedPanorama) -> String {
    let Some(image) = &picture.image else { return "<p>The camera gave no picture.</p>".into() };
    let mut image: RgbImage = image.clone();
    let (width, height) = (image.width, image.height);
    let mut labels = Vec::new();
    for mask in &picture.masks {
        let is_edge = |column: u32, row: u32| {
            [(column + 1, row), (column.wrapping_sub(1), row), (column, row + 1), (column, row.wrapping_sub(1))]
                .into_iter()
                .any(|(column, row)| column >= width || row >= height || !mask.rle.contains(column, row))
        };
        let Some([left, top, right, bottom]) = mask.rle.bounds() else { continue };
        for row in top..=bottom.min(height - 1) {
            for column in left..=right.min(width - 1) {
                if mask.rle.contains(column, row) && is_edge(column, row) {
                    let at = 3 * (row * width + column) as usize;
                    image.rgb[at..at + 3].copy_from_slice(&name_color(&mask.label));
                }
            }
        }
        // Round the seam a box says nothing.
        if right - left < width / 2 {
            let area = u64::from(right - left) * u64::from(bottom - top);
            labels.push((area, 0.5 * f64::from(left + right), 0.5 * f64::from(top + bottom), mask.label.clone()));
        }
    }
    labelled(image, labels)
}

/// The surface of the map in the colours of its labels, as a camera at this pose would see it, with names and ids of the things in it.
fn cloud_html(world: &WorldModel, map_from_camera: &Isometry3<f64>, camera: &Equirectangular) -> String {
    /// Of the map, and a bit more, that surfaces have no holes.
    const HALF_VOXEL_M: f64 = 0.03;
    let (width, height) = (camera.width_px, camera.height_px);
    let mut depth = vec![f64::INFINITY; (width * height) as usize];
    let mut image = RgbImage { width, height, rgb: vec![24; 3 * (width * height) as usize] };
    let (mesh, names) = (world.volume.mesh(), world.label_names());
    for (vertex, label) in mesh.vertices.iter().zip(&mesh.labels) {
        let in_camera = map_from_camera.inverse_transform_point(&vertex.cast());
        let (Some(pixel), distance_m) = (camera.project(&in_camera), in_camera.coords.norm()) else { continue };
        let name = names.get(label).map_or("", String::as_str);
        let [r, g, b] = if name.is_empty() || is_hull(name) { [150, 150, 155] } else { name_color(name) };
        let shade = (1.15 - 0.07 * distance_m).clamp(0.35, 1.0);
        // A point is as large as its voxel looks; off the horizon a picture of this kind is stretched.
        let pixels = HALF_VOXEL_M / distance_m.max(0.1) * f64::from(width) / std::f64::consts::TAU;
        let cosine = (in_camera.coords.xy().norm() / distance_m.max(1e-9)).max(0.1);
        let [reach_u, reach_v] = [pixels / cosine, pixels].map(|pixels| pixels.ceil().min(60.0) as i64);
        for dv in -reach_v..=reach_v {
            for du in -reach_u..=reach_u {
                let (u, v) = ((pixel.u as i64 + du).rem_euclid(i64::from(width)), pixel.v as i64 + dv);
                if !(0..i64::from(height)).contains(&v) {
                    continue;
                }
                let at = (v * i64::from(width) + u) as usize;
                if distance_m < depth[at] {
                    depth[at] = distance_m;
                    let shaded = [r, g, b].map(|channel: u8| (f64::from(channel) * shade) as u8);
                    image.rgb[3 * at..3 * at + 3].copy_from_slice(&shaded);
                }
            }
        }
    }
    let labels = visible_names(&world.graph, map_from_camera, camera, &depth);
    labelled(image, labels)
}

/// Names and ids of the things that nothing in the map hides: how near, column, row, text.
fn visible_names(
    graph: &SceneGraph,
    map_from_camera: &Isometry3<f64>,
    camera: &Equirectangular,
    depth: &[f64],
) -> Vec<(u64, f64, f64, String)> {
    const HIDDEN_M: f64 = 0.3;
    let mut names = Vec::new();
    for object in graph.confirmed_objects() {
        let in_camera: Point3<f64> = map_from_camera.inverse_transform_point(&object.centroid);
        let Some(pixel) = camera.project(&in_camera) else { continue };
        let (distance_m, half_m) = (in_camera.coords.norm(), 0.5 * (object.bounds.max - object.bounds.min).norm());
        let (width, height) = (camera.width_px as usize, camera.height_px as usize);
        let at = (pixel.v as usize).min(height - 1) * width + (pixel.u as usize).min(width - 1);
        if depth[at] + half_m + HIDDEN_M > distance_m {
            names.push(((1e3 / distance_m) as u64, pixel.u, pixel.v, format!("{} {}", object.label, object.id)));
        }
    }
    names
}

/// A picture with names over it, the largest or nearest first; a name that would cover another is left out.
fn labelled(image: RgbImage, mut labels: Vec<(u64, f64, f64, String)>) -> String {
    let (width, height) = (image.width, image.height);
    let size = f64::from(width) / 90.0;
    labels.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.3.cmp(&b.3)));
    let mut texts = String::new();
    let mut taken: Vec<(f64, f64, f64)> = Vec::new();
    for (_, u, v, text) in labels {
        let half = 0.3 * size * text.chars().count() as f64;
        if taken.iter().any(|(x, y, other)| (x - u).abs() < half + other && (y - v).abs() < 1.1 * size) {
            continue;
        }
        taken.push((u, v, half));
        let _ = write!(
            texts,
            "<text x=\"{u:.0}\" y=\"{v:.0}\" font-size=\"{size:.1}\" text-anchor=\"middle\" fill=\"#fff\" style=\"paint-order:stroke;stroke:#000;\
             stroke-width:{:.1}px\">{}</text>",
            0.25 * size,
            escape(&text)
        );
    }
    let Some(picture) = image::RgbImage::from_raw(width, height, image.rgb) else {
        return "<p>The picture is broken.</p>".into();
    };
    format!(
        "<div style=\"position:relative\">{}<svg viewBox=\"0 0 {width} {height}\" style=\"position:absolute;left:0;top:0;width:100%;height:100%\" \
         font-family=\"sans-serif\">{texts}</svg></div>",
        png_img(&picture, "width:100%;display:block")
    )
}

/// Panorama and labelled map from the same place, in a laboratory.
pub fn perception(paper: &super::Paper) -> Result<Section> {
    let robot = arena::cli::load_robot(None, RobotKind::Ground)?;
    eprintln!("   a survey of a laboratory, for pictures");
    let scene = Scene::lab(1, &robot)?;
    let look = look(&robot, &scene, 1)?;
    let (picture, map_from_camera) = look.picture.context("the survey brought no picture")?;
    let camera = look.camera;
    let body = paragraph(
        "Above: what the camera saw of a generated laboratory, with the outlines and names that the segmenter gave (it errs). Below: the surface of the robot's own map at the end of its \
         survey, seen from where it believed to be, in the colours of its labels, with names and ids of the things in its scene graph.",
    ) + "<figure>"
        + &panorama_html(&picture)
        + "</figure><figure>"
        + &cloud_html(&look.world, &map_from_camera, &camera)
        + "</figure>"
        + &paper.own_command("perception");
    Ok(Section { id: "perception", title: "What it sees and what it makes of it", body, claims: Vec::new() })
}

/// The maps that both mounts leave of one building, side by side.
pub fn maps(paper: &super::Paper) -> Result<Section> {
    let robot = arena::cli::load_robot(None, RobotKind::Ground)?;
    let fixed = with_fixed_lidar(&robot);
    let scene = Scene::open("flat", &robot)?;
    let mut body = paragraph(
        "The flat after the same way, as the robot knows it. Faint boxes were seen too rarely to be believed.",
    );
    body.push_str("<div style=\"display:grid;grid-template-columns:1fr 1fr;gap:1rem\">");
    eprintln!("   two surveys, for pictures");
    let mounts = [("rotating", &robot), ("fixed", &fixed)];
    let looks = on_each_core(mounts.len(), |at| look(mounts[at].1, &scene, 1))?;
    for ((name, _), look) in mounts.into_iter().zip(looks) {
        let Look { world, path, .. } = look?;
        let drawing = MapDrawing { rooms: world.rooms.as_ref(), path: &path, ..MapDrawing::default() };
        let _ = write!(
            body,
            "<figure>{}<figcaption>{name} LiDAR: {} things believed in</figcaption></figure>",
            map_svg(&world.graph, &drawing),
            world.graph.confirmed_objects().count()
        );
    }
    body.push_str("</div>");
    body.push_str(&paper.own_command("maps"));
    Ok(Section { id: "maps", title: "Maps with a rotating and a fixed LiDAR", body, claims: Vec::new() })
}
