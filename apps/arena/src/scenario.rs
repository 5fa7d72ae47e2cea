//! Buildings, start poses and instructions, all drawn from seeds.

use anyhow::{Context, Result, bail};
use mission::robot_model::{RobotKind, RobotModel};
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, Vector3};
use omni_sim::building::{Building, BuildingConfig, RoomKind, Style, generate};
use omni_sim::cooccurrence::Cooccurrence;
use omni_sim::scenes::{named_scene_for, scene_names};
use omni_sim::world::{Thing, World};
use rand::{RngExt, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;

use crate::buildings::{Buildings, ENDINGS, scene_of_name, seed_of_name, suffix};
use crate::referee::{Referee, RobotTruth};
use crate::task::{StepTruth, Task, TaskKind, draw};

/// A building with its name and the world made of it.
pub struct Scene {
    /// Name or seed, as given.
    pub name: String,
    /// The truth.
    pub building: Building,
    /// What rays meet.
    pub world: World,
}

impl Scene {
    /// A named scene, one of a file (`buildings::scene_of_name`), or the generated building of a seed that suits the robot.
    pub fn open(name: &str, robot: &RobotModel) -> Result<Scene> {
        let (min_door_m, passage_m) = needs_of(robot);
        if let Some(building) = named_scene_for(name, min_door_m, passage_m) {
            return Scene::new(name, building);
        }
        if scene_names().contains(&name) {
            bail!(
                "{} needs doors of {min_door_m:.2} m, and no building called \"{name}\" has them; --scene takes a number too",
                robot.name
            );
        }
        if let Some(scene) = scene_of_name(name, robot)? {
            return Ok(scene);
        }
        let Some((seed, cooccurrence)) = seed_of_name(name) else {
            bail!(
                "no building is called \"{name}\"; --scene takes {}, a number, the seed of a generated building, or a file \
                 that ends in .{}",
                scene_names().join(", "),
                ENDINGS.join(", .")
            );
        };
        Scene::drawn_with(seed, cooccurrence, robot)
    }

    /// The building of a seed: two to twelve rooms, uniformly, flat or office.
    pub fn drawn(seed: u64, robot: &RobotModel) -> Result<Scene> {
        Scene::drawn_with(seed, Cooccurrence::Usual, robot)
    }

    /// The same with other things in its rooms.
    pub fn drawn_with(seed: u64, cooccurrence: Cooccurrence, robot: &RobotModel) -> Result<Scene> {
        let (rooms, style) = plan_of_seed(seed);
        let (min_door_m, passage_m) = needs_of(robot);
        let config =
            BuildingConfig { seed, rooms, style, min_door_m, passage_m, cooccurrence, ..BuildingConfig::default() };
        let building = generate(&config).with_context(|| format!("generating the building of seed {seed}"))?;
        Scene::new(&format!("{seed}{}", suffix(cooccurrence)), building)
    }

    /// A place of work with a laboratory in it, seven rooms: twice the rooms and more of the paper's Table I.
    pub fn lab(seed: u64, robot: &RobotModel) -> Result<Scene> {
        const ROOMS: u32 = 7;
        /// About every tenth building of this size has a laboratory.
        const TRIES: u64 = 200;
        let (min_door_m, passage_m) = needs_of(robot);
        for seed in (0..TRIES).map(|k| seed.wrapping_add(k)) {
            let config = BuildingConfig {
                seed,
                rooms: ROOMS,
                style: Style::Office,
                min_door_m,
                passage_m,
                ..BuildingConfig::default()
            };
            let building = generate(&config).with_context(|| format!("generating the building of seed {seed}"))?;
            if building.rooms.iter().any(|room| room.kind == RoomKind::Lab) {
                return Scene::new(&seed.to_string(), building);
            }
        }
        bail!("no building with a laboratory was found from seed {seed} on")
    }

    /// From a building.
    pub fn new(name: &str, building: Building) -> Result<Scene> {
        let things = building
            .objects
            .iter()
            .map(|object| Thing {
                instance: object.id,
                class: object.class.clone(),
                color: object.color.clone(),
                caption: object.caption.clone(),
            })
            .collect();
        let world = World::new(building.mesh.clone(), building.movers.clone(), things)
            .with_context(|| format!("building the world of scene {name}"))?;
        Ok(Scene { name: name.to_owned(), building, world })
    }
}

/// Narrowest door and passage that suit a robot: the disc it sweeps when it turns, with a margin.
pub fn needs_of(robot: &RobotModel) -> (f64, f64) {
    let swept_m = 2.0 * robot.circumscribed_radius_m;
    let min_door_m = (swept_m + 0.25).clamp(1.0, 2.0);
    (min_door_m, (swept_m + 0.15).clamp(0.9, min_door_m))
}

/// Number of rooms and style of a seed's building.
pub fn plan_of_seed(seed: u64) -> (u32, Style) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0042_7569_6C64);
    (rng.random_range(2..=12), if rng.random::<bool>() { Style::Flat } else { Style::Office })
}

/// What the referee needs to know of a robot model.
pub fn robot_truth(robot: &RobotModel, flight_height_m: f64) -> RobotTruth {
    let (low_m, high_m) = robot.height_span_m;
    let camera_m = robot.sensors.body_from_camera.translation.vector.z;
    let (body_m, low_m) = match robot.kind {
        // The feet are on the floor; what lies lower than a step is walked over.
        RobotKind::Ground => (robot.stance_height_m, (robot.stance_height_m + low_m).max(0.08)),
        RobotKind::Aerial => (flight_height_m, flight_height_m + low_m),
    };
    RobotTruth {
        radius_m: robot.circumscribed_radius_m,
        inscribed_radius_m: robot.inscribed_radius_m,
        solid_m: (low_m, body_m + high_m),
        camera_heights_m: vec![body_m + camera_m],
    }
}

/// Pose on the floor of the lowest storey at a drawn free place with a drawn heading.
pub fn draw_start(referee: &Referee, robot: &RobotModel, seed: u64) -> Result<Isometry3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0053_7461_7274);
    let cells = start_cells(referee, robot);
    let cell = *cells.choose(&mut rng).context("this robot fits nowhere in the building")?;
    Ok(pose_at(&referee.floor().center_of(cell), rng.random_range(-3.1..3.1), referee, robot))
}

/// Pose of the body on the floor at a place.
pub fn pose_at(at: &Point2<f64>, yaw_rad: f64, referee: &Referee, robot: &RobotModel) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(at.x, at.y, referee.floor().floor_z_m + robot.stance_height_m),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
    )
}

/// Cells with a hand's breadth more room than the robot's circle. The landing gear needs the floor as well as the flight height.
fn start_cells(referee: &Referee, robot: &RobotModel) -> Vec<usize> {
    const ROOM_M: f64 = 0.15;
    (0..referee.floor().len())
        .filter(|cell| referee.floor().clearance_m(*cell) >= robot.circumscribed_radius_m + ROOM_M)
        .filter(|cell| referee.stands_free(*cell, robot.circumscribed_radius_m + 0.05))
        .collect()
}

/// One drawn run: a building, a start and a sentence with a clear meaning that this robot can fulfil.
pub struct Scenario {
    /// Where.
    pub scene: Scene,
    /// What.
    pub task: Task,
    /// From where.
    pub start: Isometry3<f64>,
    /// Seed of noise and drift.
    pub seed: u64,
    /// Whether a target is visible from the start.
    pub is_target_visible: bool,
    /// Whether another thing of the target's class exists that is not a target.
    pub has_rival: bool,
    /// Length of the shortest way.
    pub shortest_m: f64,
    /// Number of rooms.
    pub rooms: usize,
}

/// Draws run `index` of a bench with `seed`: kinds of sentences in turn, so that each is a fifth of the runs.
pub fn draw_scenario(
    seed: u64,
    index: usize,
    robot: &RobotModel,
    flight_height_m: f64,
    buildings: &Buildings,
) -> Result<Scenario> {
    const KINDS: [TaskKind; 5] =
        [TaskKind::Class, TaskKind::Relation, TaskKind::Room, TaskKind::Attribute, TaskKind::TwoSteps];
    let kind = KINDS[index % KINDS.len()];
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index as u64);
    // The number of rooms is drawn first and kept, so that buildings without a sentence of this kind, which are passed
    // over, do not push the distribution toward large ones.
    let rooms: u32 = rng.random_range(2..=12);
    const BUILDINGS: usize = 30;
    for _ in 0..BUILDINGS {
        let scene = buildings.draw(index, rooms, robot, &mut || rng.random::<u32>().into())?;
        let referee = Referee::new(&scene.building, &scene.world, robot_truth(robot, flight_height_m), 0);
        let starts = start_cells(&referee, robot);
        if starts.is_empty() {
            continue;
        }
        let tasks = draw(kind, &scene.building, &mut rng);
        let Some(found) = first_fitting(&tasks, &referee, &scene, &starts, &mut rng) else { continue };
        let Fit { task, cell, shortest_m, is_target_visible } = found;
        let yaw_rad = rng.random_range(-3.1..3.1);
        let start = pose_at(&referee.floor().center_of(cell), yaw_rad, &referee, robot);
        let has_rival = has_rival(&task, &scene.building);
        let rooms = scene.building.rooms.len();
        drop(referee);
        return Ok(Scenario {
            scene,
            task,
            start,
            seed: rng.random::<u32>().into(),
            is_target_visible,
            has_rival,
            shortest_m,
            rooms,
        });
    }
    bail!("no building with an instruction of kind {kind:?} was found in {BUILDINGS} draws of seed {seed}, run {index}")
}

struct Fit {
    task: Task,
    cell: usize,
    shortest_m: f64,
    is_target_visible: bool,
}

/// The first sentence that can be fulfilled, with a start far from its target and, if that can be had, out of its sight.
fn first_fitting(
    tasks: &[Task],
    referee: &Referee,
    scene: &Scene,
    starts: &[usize],
    rng: &mut ChaCha8Rng,
) -> Option<Fit> {
    const TASKS: usize = 12;
    const STARTS: usize = 12;
    for task in tasks.iter().take(TASKS) {
        let mut best: Option<Fit> = None;
        for _ in 0..STARTS {
            let cell = *starts.choose(rng)?;
            let at = referee.floor().center_of(cell);
            let Some(shortest_m) = referee.shortest_m(&task.steps, &at) else { break };
            let is_target_visible = sees_target(task, referee, scene, &at);
            let fit = Fit { task: task.clone(), cell, shortest_m, is_target_visible };
            const FAR_M: f64 = 8.0;
            let rank = |fit: &Fit| (!fit.is_target_visible, fit.shortest_m.min(FAR_M));
            if best.as_ref().is_none_or(|best| rank(&fit) > rank(best)) {
                best = Some(fit);
            }
            if best.as_ref().is_some_and(|best| !best.is_target_visible && best.shortest_m >= FAR_M) {
                break;
            }
        }
        // A target that lies at the robot's feet is no task.
        if let Some(fit) = best
            && fit.shortest_m > 1.5
        {
            return Some(fit);
        }
    }
    None
}

fn sees_target(task: &Task, referee: &Referee, scene: &Scene, at: &Point2<f64>) -> bool {
    task.targets().iter().filter_map(|id| scene.building.object(*id)).any(|object| referee.sees_from(at, object))
}

fn has_rival(task: &Task, building: &Building) -> bool {
    let targets = match task.steps.last() {
        Some(StepTruth::Object { ids }) => ids,
        _ => return false,
    };
    targets.first().and_then(|id| building.object(*id)).is_some_and(|target| {
        building.objects.iter().any(|other| other.class == target.class && !targets.contains(&other.id))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawn_scenarios_can_be_fulfilled_and_are_the_same_for_the_same_seed() {
        let robot = RobotModel::builtin_quadruped();
        for index in 0..5 {
            let a = draw_scenario(1, index, &robot, 1.2, &Buildings::default()).unwrap();
            let b = draw_scenario(1, index, &robot, 1.2, &Buildings::default()).unwrap();
            assert_eq!((&a.task, a.start, a.seed), (&b.task, b.start, b.seed));
            assert!(a.shortest_m.is_finite());
            assert!((2..=12).contains(&a.rooms));
        }
    }
}
