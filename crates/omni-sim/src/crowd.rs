//! Pedestrians with errands: each walks to a place, stays a while, and walks on; they avoid each other and, as people do, the robot.
//!
//! Who walks steers by the time until it would touch somebody (Karamouzas, Skinner, Guy 2014): the energy of two people falls with
//! that time `tau` as `k tau^-2 exp(-tau / tau_0)`, whatever their distance, and each follows its gradient. A robot is one more body
//! to avoid, and a reason to slow down; in the other mode nobody heeds it, and it is met like a pillar that nobody saw.
//!
//! Every step is a function of the seed and of where the robot was: the same run gives the same steps.

use nalgebra::{Point2, Vector2};

use crate::building::Building;
use crate::colors::color_name;
use crate::floor::TrueFloor;
use crate::mesh::{InstanceId, Mover};
use crate::noise::NoiseKey;
use crate::person::{Gait, Stance, limb_poses, person};
use crate::world::Thing;

/// Half a person's shoulders.
pub const PERSON_RADIUS_M: f64 = 0.25;
/// Time between two steps of the crowd, and between two key poses.
pub const STEP_NS: i64 = 50_000_000;
/// What people cannot walk through stands between these heights over the floor.
const SOLID_M: (f64, f64) = (0.10, 1.9);
/// Strength and horizon of the avoidance (the paper's `k`, `tau_0`), and how long ahead anybody looks.
const AVOID: f64 = 1.5;
const HORIZON_S: f64 = 3.0;
const LOOK_AHEAD_S: f64 = 6.0;
/// Within this a person comes up to the speed it wants.
const RELAXATION_S: f64 = 0.5;
/// Nobody pushes off harder.
const MAX_ACCEL_MPS2: f64 = 4.0;
/// A point of the way this far ahead is walked to.
const CARROT_M: f64 = 0.7;
/// Who gets nowhere for so long turns to something else.
const PATIENCE_S: f64 = 4.0;
/// Who is held up by a robot this near for so long lets it pass: goes away from it, and stays there for a while.
const HELD_UP_M: f64 = 1.5;
const COURTESY_S: f64 = 1.5;
/// An errand ends this near to its place.
const ARRIVED_M: f64 = 0.3;

/// How many, and how they behave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CrowdConfig {
    /// Number of people; fewer where there is no room for them. Default 0.
    pub people: u32,
    /// Same seed, same errands. Default 0.
    pub seed: u64,
    /// Whether they avoid the robot and slow down before it. Default true.
    pub heeds_robot: bool,
}

impl Default for CrowdConfig {
    fn default() -> Self {
        CrowdConfig { people: 0, seed: 0, heeds_robot: true }
    }
}

/// The robot as people see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotDisc {
    /// Middle.
    pub at: Point2<f64>,
    /// Velocity, m/s.
    pub velocity: Vector2<f64>,
    /// Circle that it sweeps when it turns: what people keep from.
    pub radius_m: f64,
    /// Half its width: nobody walks through this.
    pub core_m: f64,
}

/// One of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Pedestrian {
    /// Instance of its four movers.
    pub instance: InstanceId,
    /// Where it is.
    pub at: Point2<f64>,
    /// How fast, m/s.
    pub velocity: Vector2<f64>,
    gait: Gait,
    heading_rad: f64,
    walked_m: f64,
    errand: Errand,
    errands: u64,
}

#[derive(Debug, Clone, PartialEq)]
enum Errand {
    Staying { left_s: f64 },
    Walking { way: Vec<Point2<f64>>, stuck_s: f64 },
}

/// People on one storey of a building.
#[derive(Debug, Clone)]
pub struct Crowd {
    config: CrowdConfig,
    floor: TrueFloor,
    roomy: Vec<usize>,
    people: Vec<Pedestrian>,
}

impl Crowd {
    /// People at drawn places of the lowest storey, none within `apart_m` of `keep_clear`. Their instances are `first_instance` and on.
    pub fn new(
        building: &Building,
        config: CrowdConfig,
        first_instance: InstanceId,
        keep_clear: &Point2<f64>,
        apart_m: f64,
    ) -> Crowd {
        const COMFORT_M: f64 = 0.15;
        let floor = TrueFloor::new(building, 0, SOLID_M.0, SOLID_M.1);
        let roomy: Vec<usize> =
            (0..floor.len()).filter(|cell| floor.clearance_m(*cell) >= PERSON_RADIUS_M + COMFORT_M).collect();
        let mut crowd = Crowd { config, floor, roomy, people: Vec::new() };
        for index in 0..config.people {
            const TRIES: u64 = 200;
            let key = NoiseKey::new(config.seed).with_text("crowd").with(u64::from(index));
            let free = (0..TRIES).find_map(|attempt| {
                let at = crowd.drawn_place(key.with(attempt))?;
                let is_free = |p: &Pedestrian| (p.at - at).norm() > 3.0 * PERSON_RADIUS_M;
                ((at - keep_clear).norm() >= apart_m && crowd.people.iter().all(is_free)).then_some(at)
            });
            let Some(at) = free else { break };
            let look = key.with_text("look");
            let tone = |k: u64| (40.0 + 170.0 * look.with(k).uniform()) as u8;
            crowd.people.push(Pedestrian {
                instance: first_instance + index,
                at,
                velocity: Vector2::zeros(),
                gait: Gait {
                    height_m: look.with_text("height").between(1.55, 1.9),
                    speed_mps: look.with_text("speed").between(0.8, 1.4),
                    stride_m: 1.4,
                    rgb: [tone(1), tone(2), tone(3)],
                },
                heading_rad: look.with_text("heading").between(-3.1, 3.1),
                walked_m: 0.0,
                errand: Errand::Staying { left_s: look.with_text("first").between(0.0, 3.0) },
                errands: 0,
            });
        }
        crowd
    }

    /// Those there are.
    pub fn people(&self) -> &[Pedestrian] {
        &self.people
    }

    /// What a viewer would say about them.
    pub fn things(&self) -> Vec<Thing> {
        let thing = |p: &Pedestrian| Thing {
            instance: p.instance,
            class: "person".into(),
            color: color_name(p.gait.rgb).into(),
            caption: "a person".into(),
        };
        self.people.iter().map(thing).collect()
    }

    /// The movers at the beginning: four for each person, in order.
    pub fn movers(&self, stamp_ns: i64) -> Vec<Mover> {
        let floor_m = self.floor.floor_z_m;
        let limbs = |p: &Pedestrian| {
            // A second key: a mover with one pose would count as furniture.
            let limbs = person(p.instance, &p.gait, floor_m, stamp_ns, &p.stance());
            limbs.into_iter().flatten().map(move |mut limb| {
                limb.path.push((stamp_ns + 1, limb.path[0].1));
                limb
            })
        };
        self.people.iter().flat_map(limbs).collect()
    }

    /// Lets everybody go on for [`STEP_NS`]. Returns the new poses of all movers, in the order of [`Crowd::movers`].
    pub fn step(&mut self, robot: Option<&RobotDisc>) -> Vec<nalgebra::Isometry3<f64>> {
        let dt_s = STEP_NS as f64 * 1e-9;
        for index in 0..self.people.len() {
            self.decide(index, robot, dt_s);
        }
        // All decide by where the others were.
        let pushes: Vec<Vector2<f64>> = (0..self.people.len()).map(|index| self.push_on(index, robot)).collect();
        for (index, push) in pushes.into_iter().enumerate() {
            self.walk(index, &push, robot, dt_s);
        }
        let floor_m = self.floor.floor_z_m;
        self.people.iter().flat_map(|p| limb_poses(&p.gait, floor_m, &p.stance())).collect()
    }

    fn drawn_place(&self, key: NoiseKey) -> Option<Point2<f64>> {
        let cell = self.roomy.get(key.index(self.roomy.len()))?;
        Some(self.floor.center_of(*cell))
    }

    /// A new errand when the old one is over, or goes nowhere.
    fn decide(&mut self, index: usize, robot: Option<&RobotDisc>, dt_s: f64) {
        let heeded = robot.filter(|_| self.config.heeds_robot);
        let person = &mut self.people[index];
        let before = heeded.filter(|robot| (robot.at - person.at).norm() < robot.radius_m + HELD_UP_M);
        let is_over = match &mut person.errand {
            Errand::Staying { left_s } => {
                *left_s -= dt_s;
                *left_s <= 0.0
            }
            Errand::Walking { way, stuck_s } => {
                let moves = person.velocity.norm() > 0.3 * person.gait.speed_mps;
                *stuck_s = if moves { (*stuck_s - dt_s).max(0.0) } else { *stuck_s + dt_s };
                let is_there = way.last().is_none_or(|end| (end - person.at).norm() < ARRIVED_M);
                if is_there {
                    let key = NoiseKey::new(self.config.seed).with_text("stay").with(u64::from(person.instance));
                    person.errand = Errand::Staying { left_s: key.with(person.errands).between(1.0, 8.0) };
                    return;
                }
                *stuck_s > if before.is_some() { COURTESY_S } else { PATIENCE_S }
            }
        };
        let is_held_up = is_over && matches!(person.errand, Errand::Walking { .. });
        if let Some(robot) = before.filter(|_| is_held_up) {
            self.let_pass(index, robot);
        } else if is_over {
            let (instance, errands, at) = (person.instance, person.errands, person.at);
            let key = NoiseKey::new(self.config.seed).with_text("errand").with(u64::from(instance)).with(errands);
            self.people[index].errands += 1;
            let way = self.drawn_place(key).map(|goal| self.way(&at, &goal)).unwrap_or_default();
            self.people[index].errand = match way.len() {
                0 | 1 => Errand::Staying { left_s: 1.0 },
                _ => Errand::Walking { way, stuck_s: 0.0 },
            };
        }
    }

    /// Walks to somewhere that is no nearer to the robot than it is now; where nothing is, it stays.
    fn let_pass(&mut self, index: usize, robot: &RobotDisc) {
        const TRIES: u64 = 12;
        let me = &self.people[index];
        let (instance, errands, at) = (me.instance, me.errands, me.at);
        let key = NoiseKey::new(self.config.seed).with_text("let pass").with(u64::from(instance)).with(errands);
        let away = at - robot.at;
        let goal = (0..TRIES).filter_map(|attempt| self.drawn_place(key.with(attempt))).find(|place| {
            let step = place - at;
            step.norm() > 2.0 * PERSON_RADIUS_M && step.dot(&away) > 0.5 * step.norm() * away.norm()
        });
        let way = goal.map(|goal| self.way(&at, &goal)).unwrap_or_default();
        let is_away = way.iter().all(|p| (p - robot.at).norm() >= away.norm() - PERSON_RADIUS_M);
        let me = &mut self.people[index];
        me.errands += 1;
        me.errand = match way.len() {
            2.. if is_away => Errand::Walking { way, stuck_s: 0.0 },
            _ => Errand::Staying { left_s: key.with_text("stay").between(2.0, 5.0) },
        };
    }

    /// A way for a person's circle that keeps a little off the walls; empty if there is none.
    fn way(&self, from: &Point2<f64>, to: &Point2<f64>) -> Vec<Point2<f64>> {
        const OFF_WALL_M: f64 = 0.5;
        let Some(goal) = self.floor.cell_of(to) else { return Vec::new() };
        let Some(start) = self.floor.cell_of(from) else { return Vec::new() };
        let weight = |cell: usize| 1.0 + 2.0 * (OFF_WALL_M - self.floor.clearance_m(cell)).max(0.0);
        let costs = self.floor.costs_from(&[start], PERSON_RADIUS_M, weight);
        let way = self.floor.way_to(&costs, goal, weight);
        way.into_iter().map(|cell| self.floor.center_of(cell)).collect()
    }

    /// Acceleration that a person wants: toward its goal, away from those it would run into.
    fn push_on(&self, index: usize, robot: Option<&RobotDisc>) -> Vector2<f64> {
        let me = &self.people[index];
        let heeded = robot.filter(|_| self.config.heeds_robot);
        let mut wanted = Vector2::zeros();
        if let Errand::Walking { way, .. } = &me.errand {
            let toward = carrot(way, &me.at) - me.at;
            let slow = heeded.map_or(1.0, |robot| me.caution(robot, &toward));
            wanted = toward.try_normalize(1e-9).unwrap_or_default() * me.gait.speed_mps * slow;
        }
        let mut push = (wanted - me.velocity) / RELAXATION_S;
        for (other, them) in self.people.iter().enumerate() {
            if other != index {
                push += avoidance(me, &them.at, &them.velocity, 2.0 * PERSON_RADIUS_M);
            }
        }
        if let Some(robot) = heeded {
            push += avoidance(me, &robot.at, &robot.velocity, PERSON_RADIUS_M + robot.radius_m);
        }
        push.cap_magnitude(MAX_ACCEL_MPS2)
    }

    fn walk(&mut self, index: usize, push: &Vector2<f64>, robot: Option<&RobotDisc>, dt_s: f64) {
        let others: Vec<Point2<f64>> =
            self.people.iter().enumerate().filter(|(k, _)| *k != index).map(|(_, p)| p.at).collect();
        let me = &self.people[index];
        let mut velocity = (me.velocity + push * dt_s).cap_magnitude(1.3 * me.gait.speed_mps);
        if matches!(me.errand, Errand::Staying { .. }) && velocity.norm() < 0.05 {
            velocity = Vector2::zeros();
        }
        // Bodies are solid: what would bring two together is not walked. An unheeded robot is met by its core.
        let core_m = robot.map(|robot| if self.config.heeds_robot { robot.radius_m } else { robot.core_m });
        let solids = others
            .iter()
            .map(|at| (*at, 2.0 * PERSON_RADIUS_M))
            .chain(robot.zip(core_m).map(|(robot, core_m)| (robot.at, core_m + 0.8 * PERSON_RADIUS_M)));
        for (at, least_m) in solids {
            let apart = me.at - at;
            let next = apart + velocity * dt_s;
            if next.norm() < least_m
                && next.norm() < apart.norm()
                && let Some(outward) = apart.try_normalize(1e-9)
            {
                velocity -= outward * velocity.dot(&outward).min(0.0);
            }
        }
        let (at, velocity) = self.along_walls(&me.at, &velocity, dt_s);
        let me = &mut self.people[index];
        me.walked_m += (at - me.at).norm();
        (me.at, me.velocity) = (at, velocity);
        if velocity.norm() > 0.1 {
            const TURN_RADPS: f64 = 4.0;
            let error = wrap(velocity.y.atan2(velocity.x) - me.heading_rad);
            me.heading_rad = wrap(me.heading_rad + error.clamp(-TURN_RADPS * dt_s, TURN_RADPS * dt_s));
        }
    }

    /// One step that does not enter a wall: straight, else along it, else none.
    fn along_walls(&self, at: &Point2<f64>, velocity: &Vector2<f64>, dt_s: f64) -> (Point2<f64>, Vector2<f64>) {
        // Ways are planned for the whole circle; who was pushed aside may brush a wall with a shoulder, not leave the room.
        const SHOULDER_M: f64 = 0.8 * PERSON_RADIUS_M;
        let room_m = |p: &Point2<f64>| self.floor.cell_of(p).map_or(0.0, |cell| self.floor.clearance_m(cell));
        let here_m = room_m(at);
        let tries = [*velocity, Vector2::new(velocity.x, 0.0), Vector2::new(0.0, velocity.y)];
        for velocity in tries {
            let next = at + velocity * dt_s;
            let next_m = room_m(&next);
            if next_m >= SHOULDER_M || next_m > here_m {
                return (next, velocity);
            }
        }
        (*at, Vector2::zeros())
    }
}

impl Pedestrian {
    fn stance(&self) -> Stance {
        let swing = (self.velocity.norm() / (0.5 * self.gait.speed_mps)).min(1.0);
        Stance { at: self.at, heading_rad: self.heading_rad, walked_m: self.walked_m, swing }
    }

    /// Share of its speed that somebody keeps when a robot stands or drives before it.
    fn caution(&self, robot: &RobotDisc, toward: &Vector2<f64>) -> f64 {
        const NOTICE_M: f64 = 1.2;
        const LEAST: f64 = 0.3;
        let to_robot = robot.at - self.at;
        let gap_m = to_robot.norm() - robot.radius_m - PERSON_RADIUS_M;
        let is_ahead = to_robot.dot(toward) > 0.5 * to_robot.norm() * toward.norm();
        if is_ahead { (gap_m / NOTICE_M).clamp(LEAST, 1.0) } else { 1.0 }
    }
}

/// The gradient of the interaction energy: where to push off so as not to meet `at`, which moves with `velocity`.
fn avoidance(me: &Pedestrian, at: &Point2<f64>, velocity: &Vector2<f64>, radii_m: f64) -> Vector2<f64> {
    // Two who meet head on both pass on the right: each sees the other a little to the left.
    const KEEP_RIGHT_RAD: f64 = 0.1;
    let apart = nalgebra::Rotation2::new(KEEP_RIGHT_RAD) * (at - me.at);
    let closing = me.velocity - velocity;
    // Who already touches is as if it just did not.
    let radii_m = radii_m.min(0.99 * apart.norm());
    let a = closing.norm_squared();
    let b = apart.dot(&closing);
    let c = apart.norm_squared() - radii_m * radii_m;
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 || a < 1e-6 {
        return Vector2::zeros();
    }
    let root = discriminant.sqrt();
    let tau_s = (b - root) / a;
    if !(tau_s > 0.0 && tau_s < LOOK_AHEAD_S) {
        return Vector2::zeros();
    }
    let gradient = closing - (closing * b - apart * a) / root;
    gradient * (-AVOID * (-tau_s / HORIZON_S).exp() / (a * tau_s * tau_s) * (2.0 / tau_s + 1.0 / HORIZON_S))
}

/// The point of a way to walk to: a little further than the nearest one.
fn carrot(way: &[Point2<f64>], at: &Point2<f64>) -> Point2<f64> {
    let distance = |k: &usize| (way[*k] - at).norm();
    let nearest = (0..way.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let Some(nearest) = nearest else { return *at };
    let ahead = (nearest..way.len()).find(|k| distance(k) >= CARROT_M);
    way[ahead.unwrap_or(way.len() - 1)]
}

fn wrap(angle: f64) -> f64 {
    let turned = angle.rem_euclid(std::f64::consts::TAU);
    if turned > std::f64::consts::PI { turned - std::f64::consts::TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::building::{BuildingConfig, generate};
    use crate::scenes::named_scene;

    fn flat() -> Building {
        named_scene("flat").expect("the scene exists")
    }

    fn crowd(building: &Building, people: u32, seed: u64) -> Crowd {
        let config = CrowdConfig { people, seed, ..CrowdConfig::default() };
        Crowd::new(building, config, 1000, &building.rooms[0].center(), 1.5)
    }

    #[test]
    fn people_get_about_and_keep_their_bodies_apart() {
        let building = flat();
        let mut crowd = crowd(&building, 6, 1);
        assert_eq!(crowd.people().len(), 6);
        let starts: Vec<Point2<f64>> = crowd.people().iter().map(|p| p.at).collect();
        let mut furthest_m = vec![0.0_f64; starts.len()];
        let mut nearest_m = f64::INFINITY;
        for _ in 0..20 * 120 {
            crowd.step(None);
            for (k, person) in crowd.people().iter().enumerate() {
                furthest_m[k] = furthest_m[k].max((person.at - starts[k]).norm());
                for other in &crowd.people()[k + 1..] {
                    nearest_m = nearest_m.min((person.at - other.at).norm());
                }
            }
        }
        assert!(furthest_m.iter().filter(|m| **m > 2.0).count() >= 5, "{furthest_m:?}");
        // Shoulders may brush, bodies do not pass through each other.
        assert!(nearest_m > 1.2 * PERSON_RADIUS_M, "{nearest_m}");
    }

    /// A robot that stands in the way is walked round by those who heed it, and walked into by those who do not.
    #[test]
    fn a_robot_is_heeded_or_not() {
        let building = flat();
        let gap_m = |heeds_robot: bool| {
            let mut least_m = f64::INFINITY;
            for seed in 0..4 {
                let config = CrowdConfig { people: 5, seed, heeds_robot };
                let at = building.doors[0].center.xy();
                let mut crowd = Crowd::new(&building, config, 1000, &at, 1.5);
                let robot = RobotDisc { at, velocity: Vector2::zeros(), radius_m: 0.4, core_m: 0.16 };
                for _ in 0..20 * 60 {
                    crowd.step(Some(&robot));
                    least_m = crowd.people().iter().map(|p| (p.at - at).norm()).fold(least_m, f64::min);
                }
            }
            least_m
        };
        assert!(gap_m(true) > 0.4 + 0.7 * PERSON_RADIUS_M, "{}", gap_m(true));
        assert!(gap_m(false) < 0.4, "{}", gap_m(false));
    }

    #[test]
    fn poses_are_those_of_the_movers_and_equal_for_equal_seeds() {
        let building = flat();
        let (mut a, mut b) = (crowd(&building, 4, 7), crowd(&building, 4, 7));
        assert_eq!(a.movers(0).len(), 4 * a.people().len());
        for _ in 0..200 {
            assert_eq!(a.step(None), b.step(None));
        }
        let poses = a.step(None);
        assert_eq!(poses.len(), 4 * a.people().len());
        for (pose, person) in poses.chunks(4).zip(a.people()) {
            assert!((pose[0].translation.vector.xy() - person.at.coords).norm() < 1e-9);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// In any building nobody walks into a wall, faster than a person can, or with a jump; however a robot rushes about.
        #[test]
        fn nobody_leaves_the_floor(seed in 0_u64..1000, people in 1_u32..11, heeds_robot: bool, speed in 0.0..2.0f64) {
            let rooms = 2 + (seed % 6) as u32;
            let building = generate(&BuildingConfig { seed, rooms, ..BuildingConfig::default() }).unwrap();
            let center = building.rooms[0].center();
            let config = CrowdConfig { people, seed, heeds_robot };
            let mut crowd = Crowd::new(&building, config, 1000, &center, 1.0);
            let floor = TrueFloor::new(&building, 0, SOLID_M.0, SOLID_M.1);
            let mut before: Vec<Point2<f64>> = crowd.people().iter().map(|p| p.at).collect();
            for k in 0..400 {
                let angle = f64::from(k) * 0.05 * speed;
                let (sin, cos) = angle.sin_cos();
                let at = center + Vector2::new(cos, sin);
                let robot = RobotDisc { at, velocity: Vector2::new(-sin, cos) * speed, radius_m: 0.4, core_m: 0.2 };
                crowd.step(Some(&robot));
                for (person, old) in crowd.people().iter().zip(&before) {
                    let clearance_m = floor.cell_of(&person.at).map_or(0.0, |cell| floor.clearance_m(cell));
                    prop_assert!(clearance_m > 0.0, "in a wall at {}", person.at);
                    prop_assert!((person.at - old).norm() <= 1.3 * 1.4 * 0.05 + 1e-9);
                    prop_assert!(person.at.iter().chain(person.velocity.iter()).all(|x| x.is_finite()));
                }
                before = crowd.people().iter().map(|p| p.at).collect();
            }
        }
    }
}
