//! `bench coverage`: what a rotating LiDAR brings over the same sensor held still (OmniVLN, rotating versus fixed).
//!
//! Same building, same way, same pipeline; only the mount differs. What the robot's side knows at the end is matched to the
//! truth: an object that is there twice counts as one right and one wrong.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use mission::dsg::SceneGraph;
use mission::omni_perception::RawScan;
use mission::robot_model::RobotModel;
use mission::stage_clock::CpuScope;
use mission::volumetric_map::{Cell, Volume};
use nalgebra::{Isometry3, Point3, Vector3};
use omni_sim::building::ObjectTruth;
use omni_sim::lidar::RotatingMount;
use serde::Serialize;

use crate::progress::ProgressView;
use crate::run::{RunConfig, with_fixed_lidar};
use crate::scenario::Scene;
use crate::survey::{Moment, survey};
use crate::tour::Tour;
use crate::toured_scene::tour_of;
use crate::workers::on_each_core;

/// Figures of one survey.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Coverage {
    /// Share of the graph's confirmed objects that are a true object of that class at that place, each true one once.
    pub precision: f64,
    /// Share of the true objects that are in the graph.
    pub recall: f64,
    /// Harmonic mean of the two.
    pub f1: f64,
    /// Share of all directions round the body that a ray went to within one turn of the motor, mean over the survey.
    pub solid_angle_fraction: f64,
    /// Share of the surface that can be seen from the way and is in the map, to 10 cm.
    pub map_recall: f64,
    /// Median time until a true object was known, of those that were at the end; seconds.
    pub known_after_s: f64,
    /// True objects known at the end.
    pub objects: f64,
}

/// When a thing was known for good.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KnownThing {
    /// Its class.
    pub class: String,
    /// With the turning LiDAR, seconds; none if it was not known at the end.
    pub rotating_s: Option<f64>,
    /// With the fixed one.
    pub fixed_s: Option<f64>,
}

/// Both mounts in one building.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct SeedCoverage {
    /// Seed of the building and of the noise.
    pub seed: u64,
    /// Length of the way.
    pub path_m: f64,
    /// On a motor.
    pub rotating: Coverage,
    /// Held still.
    pub fixed: Coverage,
    /// Seconds until each true object was known.
    pub known: Vec<KnownThing>,
}

/// A figure for each mount.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct BothMounts {
    /// On a motor.
    pub rotating: Coverage,
    /// Held still.
    pub fixed: Coverage,
}

/// The result, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct BenchCoverage {
    /// Every building.
    pub seeds: Vec<SeedCoverage>,
    /// Means over the buildings.
    pub mean: BothMounts,
    /// Sample standard deviations over the buildings.
    pub std: BothMounts,
}

/// Surveys the buildings of seeds `first_seed..first_seed + count` with both mounts.
///
/// # Errors
/// If a building cannot be surveyed.
pub fn bench_coverage(
    robot: &RobotModel,
    first_seed: u64,
    count: usize,
    config: &RunConfig,
    is_quiet: bool,
    stop: &Arc<AtomicBool>,
) -> Result<BenchCoverage> {
    let view = ProgressView::new(2 * count as u64, "{elapsed_precise} [{bar:30}] {pos}/{len} {msg}", is_quiet);
    let finished = AtomicUsize::new(0);
    let config = RunConfig { cpu_scope: CpuScope::Thread, ..config.clone() };
    let upright = with_fixed_lidar(robot);
    // One piece of work is one building with one mount.
    let surveys = on_each_core(2 * count, |work| {
        let seed = first_seed + (work / 2) as u64;
        ensure!(!stop.load(Ordering::Relaxed), "the bench was interrupted");
        let is_fixed = work % 2 == 1;
        let one = one_survey(if is_fixed { &upright } else { robot }, seed, &config)
            .with_context(|| format!("surveying the building of seed {seed}"));
        let done = finished.fetch_add(1, Ordering::Relaxed) + 1;
        view.show(done as u64, &format!("{done} of {} surveys", 2 * count), true);
        one
    })?;
    view.finish();
    let surveys = surveys.into_iter().collect::<Result<Vec<_>>>()?;
    let seeds: Vec<SeedCoverage> = surveys
        .chunks(2)
        .enumerate()
        .map(|(index, pair)| SeedCoverage {
            seed: first_seed + index as u64,
            path_m: pair[0].path_m,
            rotating: pair[0].coverage,
            fixed: pair[1].coverage,
            known: std::iter::zip(&pair[0].known, &pair[1].known)
                .map(|((class, rotating_s), (_, fixed_s))| KnownThing {
                    class: class.clone(),
                    rotating_s: *rotating_s,
                    fixed_s: *fixed_s,
                })
                .collect(),
        })
        .collect();
    let both = |of: fn(&[f64]) -> f64| BothMounts {
        rotating: summarise(&seeds.iter().map(|seed| seed.rotating).collect::<Vec<_>>(), of),
        fixed: summarise(&seeds.iter().map(|seed| seed.fixed).collect::<Vec<_>>(), of),
    };
    Ok(BenchCoverage { mean: both(mean), std: both(standard_deviation), seeds })
}

/// One building with one mount.
struct Survey {
    coverage: Coverage,
    path_m: f64,
    /// Every true object: its class, and when it was known for good.
    known: Vec<(String, Option<f64>)>,
}

fn one_survey(robot: &RobotModel, seed: u64, config: &RunConfig) -> Result<Survey> {
    let scene = Scene::drawn(seed, robot)?;
    let (start, tour) = tour_of(&scene, robot, config, seed).context("this robot fits nowhere in the building")?;
    let mut directions = Directions::new(robot);
    let mut first_known: Vec<Option<f64>> = vec![None; scene.building.objects.len()];
    let mut truth_from_map = Isometry3::identity();
    let floor_z_m = start.translation.vector.z - robot.stance_height_m;
    let surveyed = survey(config, robot, &scene, &start, &tour, floor_z_m, seed, &mut |now_s, moment| match moment {
        Moment::Scan(scan) => directions.see(scan),
        Moment::Picture { .. } => {}
        Moment::Refreshed { world, truth_from_map: frame, .. } => {
            truth_from_map = frame;
            for (truth, known) in
                matches(&scene.building.objects, &world.graph, &frame).into_iter().zip(&mut first_known)
            {
                *known = if truth.is_some() { known.or(Some(now_s)) } else { None };
            }
        }
    })?;
    let world = surveyed.world;
    let score = Score::of(&scene.building.objects, &world.graph, &truth_from_map);
    let eye_m = robot.stance_height_m + robot.sensors.body_from_lidar_stator.translation.vector.z;
    let surface = visible_surface(&scene, &tour, floor_z_m + eye_m);
    let coverage = Coverage {
        precision: score.right / score.known.max(1.0),
        recall: score.right / score.there.max(1.0),
        f1: 2.0 * score.right / (score.known + score.there).max(1.0),
        solid_angle_fraction: directions.mean_fraction(),
        map_recall: mapped_fraction(&surface, &world.volume, &truth_from_map),
        known_after_s: median(first_known.iter().flatten().copied().collect()),
        objects: score.right,
    };
    let classes = scene.building.objects.iter().map(|object| object.class.clone());
    Ok(Survey { coverage, path_m: tour.length_m, known: classes.zip(first_known).collect() })
}

/// Objects known, there, and both.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Score {
    right: f64,
    known: f64,
    there: f64,
}

impl Score {
    fn of(objects: &[ObjectTruth], graph: &SceneGraph, truth_from_map: &Isometry3<f64>) -> Score {
        let right = matches(objects, graph, truth_from_map).iter().flatten().count() as f64;
        Score { right, known: graph.confirmed_objects().count() as f64, there: objects.len() as f64 }
    }
}

/// For each true object the confirmed object of the graph that is it: same class, near enough, nearest pairs first.
fn matches(objects: &[ObjectTruth], graph: &SceneGraph, truth_from_map: &Isometry3<f64>) -> Vec<Option<usize>> {
    let known: Vec<(String, Point3<f64>)> =
        graph.confirmed_objects().map(|object| (object.label.clone(), truth_from_map * object.centroid)).collect();
    let mut pairs = Vec::new();
    for (truth, object) in objects.iter().enumerate() {
        for (index, (label, at)) in known.iter().enumerate() {
            let distance_m = (at - object.bounds.center()).norm();
            if *label == object.class && distance_m <= reach_m(object) {
                pairs.push((distance_m, truth, index));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut matched = vec![None; objects.len()];
    let mut taken = BTreeSet::new();
    for (_, truth, index) in pairs {
        if matched[truth].is_none() && taken.insert(index) {
            matched[truth] = Some(index);
        }
    }
    matched
}

/// A known object is this one if its centre is within half the diagonal, at least 30 cm.
fn reach_m(object: &ObjectTruth) -> f64 {
    (0.5 * (object.bounds.max - object.bounds.min).norm()).max(0.3)
}

/// Directions round the body in cells of equal solid angle, over one turn of the motor at a time.
struct Directions {
    mount: RotatingMount,
    seen: Vec<bool>,
    scans: usize,
    fractions: Vec<f64>,
}

impl Directions {
    const AZIMUTHS: usize = 72;
    const ELEVATIONS: usize = 36;
    /// Two seconds at 10 Hz: one turn of the motor.
    const SCANS: usize = 20;

    fn new(robot: &RobotModel) -> Directions {
        let mount = RotatingMount {
            body_from_stator: robot.sensors.body_from_lidar_stator,
            rotor_from_sensor: robot.sensors.rotor_from_sensor,
            rate_hz: robot.sensors.lidar.rotation_hz,
            phase_rad: 0.0,
        };
        Directions { mount, seen: vec![false; Self::AZIMUTHS * Self::ELEVATIONS], scans: 0, fractions: Vec::new() }
    }

    fn see(&mut self, scan: &RawScan) {
        for point in &scan.points {
            let stamp_ns = scan.start.0 + i64::from(point.offset_ns);
            let ray = self.mount.body_from_sensor(stamp_ns).rotation * point.position.coords.cast::<f64>();
            let Some(ray) = ray.try_normalize(1e-9) else { continue };
            let azimuth = (ray.y.atan2(ray.x) / std::f64::consts::TAU + 0.5) * Self::AZIMUTHS as f64;
            // The sine of the elevation is uniform on the sphere.
            let elevation = (ray.z + 1.0) * 0.5 * Self::ELEVATIONS as f64;
            let row = (elevation as usize).min(Self::ELEVATIONS - 1);
            self.seen[row * Self::AZIMUTHS + (azimuth as usize) % Self::AZIMUTHS] = true;
        }
        self.scans += 1;
        if self.scans == Self::SCANS {
            self.fractions.push(self.seen.iter().filter(|seen| **seen).count() as f64 / self.seen.len() as f64);
            self.seen.fill(false);
            self.scans = 0;
        }
    }

    fn mean_fraction(&self) -> f64 {
        mean(&self.fractions)
    }
}

/// Points of the building's surface, about 15 cm apart, that an eye at `eye_z_m` on the way has a free ray to.
fn visible_surface(scene: &Scene, tour: &Tour, eye_z_m: f64) -> Vec<Point3<f64>> {
    const SPACING_M: f64 = 0.15;
    const EYE_EVERY: usize = 10;
    const RANGE_M: f64 = 10.0;
    let eyes: Vec<Point3<f64>> =
        tour.way.iter().step_by(EYE_EVERY).map(|point| Point3::new(point.x, point.y, eye_z_m)).collect();
    let mut points = Vec::new();
    for face in &scene.building.mesh.faces {
        let [a, b, c] = face.map(|index| scene.building.mesh.vertices[index as usize].cast::<f64>());
        let (u, v): (Vector3<f64>, Vector3<f64>) = (b - a, c - a);
        let steps = (u.norm().max(v.norm()).max((c - b).norm()) / SPACING_M).ceil().max(1.0);
        // Middles of the sub-triangles' edges: no corner is sampled, where rays slip by.
        for i in 0..steps as usize {
            for j in 0..(steps as usize - i) {
                points.push(a + u * ((i as f64 + 0.33) / steps) + v * ((j as f64 + 0.33) / steps));
            }
        }
    }
    points.retain(|point| {
        eyes.iter().any(|eye| {
            let ray = point - eye;
            let distance_m = ray.norm();
            distance_m < RANGE_M
                && scene.world.ray(eye, &ray, distance_m + 0.1, 0).is_some_and(|hit| hit.distance_m > distance_m - 0.02)
        })
    });
    points
}

/// Share of the points that have an occupied voxel within 10 cm.
fn mapped_fraction(surface: &[Point3<f64>], volume: &Volume, truth_from_map: &Isometry3<f64>) -> f64 {
    let map_from_truth = truth_from_map.inverse();
    let near: Vec<Vector3<f64>> = (-1..=1)
        .flat_map(|x| {
            (-1..=1).flat_map(move |y| (-1..=1).map(move |z| Vector3::new(x.into(), y.into(), z.into()) * 0.05))
        })
        .collect();
    let mapped = surface
        .iter()
        .filter(|point| near.iter().any(|shift| volume.observe(&(map_from_truth * *point + shift)) == Cell::Occupied))
        .count();
    mapped as f64 / surface.len().max(1) as f64
}

fn summarise(all: &[Coverage], of: fn(&[f64]) -> f64) -> Coverage {
    let figure = |pick: fn(&Coverage) -> f64| of(&all.iter().map(pick).collect::<Vec<_>>());
    Coverage {
        precision: figure(|c| c.precision),
        recall: figure(|c| c.recall),
        f1: figure(|c| c.f1),
        solid_angle_fraction: figure(|c| c.solid_angle_fraction),
        map_recall: figure(|c| c.map_recall),
        known_after_s: figure(|c| c.known_after_s),
        objects: figure(|c| c.objects),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn standard_deviation(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    (squares / values.len().saturating_sub(1).max(1) as f64).sqrt()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mission::dsg::{Aabb, Object, ObjectId, Op};
    use omni_sim::building::Building;

    /// The first few things of a flat.
    fn things() -> Vec<ObjectTruth> {
        let mut building: Building =
            crate::scenario::Scene::open("flat", &RobotModel::builtin_quadruped()).expect("it exists").building;
        building.objects.truncate(4);
        building.objects
    }

    fn graph_of(known: &[(&str, Point3<f64>)]) -> SceneGraph {
        let mut graph = SceneGraph::new();
        for (index, (label, at)) in known.iter().enumerate() {
            let bounds = Aabb { min: at - Vector3::repeat(0.1), max: at + Vector3::repeat(0.1) };
            let object = Object { confirmed: true, ..Object::new(ObjectId(index as u64), label, bounds) };
            graph.apply(Op::PutObject(Box::new(object))).expect("sound");
        }
        graph
    }

    #[test]
    fn a_duplicate_is_one_right_and_one_wrong() {
        let things = things();
        let at = |k: usize| things[k].bounds.center();
        let class = |k: usize| things[k].class.as_str();
        let score = |known: &[(&str, Point3<f64>)]| Score::of(&things, &graph_of(known), &Isometry3::identity());
        let all: Vec<_> = (0..4).map(|k| (class(k), at(k))).collect();
        assert_eq!(score(&all), Score { right: 4.0, known: 4.0, there: 4.0 });
        let twice = [(class(0), at(0)), (class(0), at(0) + Vector3::x() * 0.05)];
        assert_eq!(score(&twice), Score { right: 1.0, known: 2.0, there: 4.0 });
        // Another name, or another place.
        assert_eq!(score(&[("unicorn", at(0)), (class(1), at(1) + Vector3::z() * 9.0)]).right, 0.0);
        assert_eq!(score(&[]), Score { right: 0.0, known: 0.0, there: 4.0 });
    }

    #[test]
    fn the_promised_keys() {
        let figures = [
            Coverage { f1: 0.5, known_after_s: f64::NAN, ..Coverage::default() },
            Coverage { f1: 0.7, ..Coverage::default() },
        ];
        let known = vec![KnownThing { class: "mug".into(), rotating_s: Some(3.0), fixed_s: None }];
        let seeds: Vec<SeedCoverage> =
            figures.map(|rotating| SeedCoverage { rotating, known: known.clone(), ..SeedCoverage::default() }).into();
        let both = |of: fn(&[f64]) -> f64| BothMounts { rotating: summarise(&figures, of), fixed: Coverage::default() };
        let bench = BenchCoverage { mean: both(mean), std: both(standard_deviation), seeds };
        let value = serde_json::to_value(&bench).expect("it serialises");
        let keys =
            |value: &serde_json::Value| value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&value), ["mean", "seeds", "std"]);
        assert_eq!(keys(&value["seeds"][0]), ["fixed", "known", "path_m", "rotating", "seed"]);
        let of_mount = ["f1", "known_after_s", "map_recall", "objects", "precision", "recall", "solid_angle_fraction"];
        for place in [&value["seeds"][1]["rotating"], &value["mean"]["fixed"], &value["std"]["rotating"]] {
            assert_eq!(keys(place), of_mount);
        }
        assert!((value["mean"]["rotating"]["f1"].as_f64().unwrap() - 0.6).abs() < 1e-12);
        assert!((value["std"]["rotating"]["f1"].as_f64().unwrap() - 0.02_f64.sqrt()).abs() < 1e-12);
        assert!(value["seeds"][0]["rotating"]["known_after_s"].is_null(), "nothing was known");
        assert_eq!(value["seeds"][0]["known"][0]["rotating_s"], 3.0);
    }

    #[test]
    fn a_turning_sensor_sees_more_directions_than_a_still_one() {
        let robot = RobotModel::builtin_quadruped();
        let seen = |robot: &RobotModel| {
            let mut directions = Directions::new(robot);
            for scan in 0..Directions::SCANS as i64 {
                let points = (0..32_u32 * 360).map(|k| {
                    let (azimuth, elevation) =
                        (f64::from(k / 32).to_radians(), (f64::from(k % 32) * 45.0 / 31.0 - 22.5).to_radians());
                    let (sin, cos) = azimuth.sin_cos();
                    mission::omni_perception::RawPoint {
                        position: Point3::new(cos * elevation.cos(), sin * elevation.cos(), elevation.sin()).cast(),
                        offset_ns: k / 32 * 277_777,
                        ring: 0,
                    }
                });
                let start = mission::omni_perception::Stamp(scan * 100_000_000);
                directions.see(&RawScan { start, points: points.collect() });
            }
            directions.mean_fraction()
        };
        let (rotating, fixed) = (seen(&robot), seen(&with_fixed_lidar(&robot)));
        // A band of 45 degrees is sin(22.5 degrees) of the sphere.
        assert!((fixed - 0.38).abs() < 0.03 && rotating > 0.8, "{fixed} {rotating}");
    }
}
