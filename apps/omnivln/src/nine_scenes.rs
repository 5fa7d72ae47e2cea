//! The nine scenes of the paper's Table II (D1 to D9), drawn from a seed, and buildings of any size for the growth of a prompt.
//!
//! Four rooms of 5 m x 5 m x 2.5 m; the agent stands in the middle of the first, at the origin of its yaw, camera at 1.2 m. D1-D3: 5, 10,
//! 15 objects within 3 m, all octants in turn; D4-D6: as many in the same room beyond 3 m; D7-D9: 15, 30, 50 in the other rooms. Each
//! object has a caption of 20 to 40 words, as a vision model would write it.

use arena::mission::dsg::{Aabb, Object, ObjectId, Op, Place, PlaceId, Room, RoomId, SceneGraph};
use arena::mission::octant_prompt::{Situation, parse_instruction};
use nalgebra::{Isometry3, Point3, Vector3};

/// Objects of each scene.
pub const OBJECTS: [usize; 9] = [5, 10, 15, 5, 10, 15, 15, 30, 50];
/// Height of the camera above the body origin, metres.
pub const CAMERA_HEIGHT_M: f64 = 1.2;
const FOCAL_M: f64 = 3.0;
const ROOM_M: f64 = 5.0;
const CLASSES: [&str; 4] = ["chair", "table", "cabinet", "screen"];
const ADJECTIVES: [&str; 10] =
    ["plain", "heavy", "narrow", "pale", "green", "steel", "striped", "low", "battered", "polished"];
const PHRASES: [&str; 16] = [
    "beside the long radiator",
    "made of dark walnut and brushed steel",
    "with a deep scratch across the front",
    "half covered by a folded striped cloth",
    "standing under the round skylight",
    "with small brass handles on both sides",
    "leaning a little to the left side",
    "next to a tall stack of blue folders",
    "whose white paint has begun to flake",
    "holding a lamp and two sharp pencils",
    "that casts a soft shadow on the wall",
    "with a paper tag tied to one leg",
    "facing away from the only window",
    "on four worn castors of grey rubber",
    "lit by the evening sun from behind",
    "and as clean as on the first day",
];

/// A small generator of numbers (SplitMix64), so that the scenes are the same everywhere and for ever.
struct Draw(u64);

impl Draw {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn index(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn caption(&mut self, class: &str) -> String {
        let count = 20 + self.index(21);
        let adjective = |draw: &mut Draw| ADJECTIVES[draw.index(ADJECTIVES.len())];
        let mut words = vec!["a", adjective(self), adjective(self), class];
        let mut left: Vec<&str> = PHRASES.to_vec();
        while words.len() < count {
            let at = self.index(left.len());
            words.extend(left.swap_remove(at).split(' '));
        }
        words.truncate(count);
        words.join(" ")
    }
}

/// The pose of the agent in all scenes made here: where the graph's first room has its middle.
pub fn agent() -> Isometry3<f64> {
    Isometry3::translation(ROOM_M / 2.0, ROOM_M / 2.0, 0.0)
}

/// Calls `then` with the situation of the agent in a scene made here, with an instruction: every way is straight, and nothing is reached yet.
pub fn in_situation<T>(graph: &SceneGraph, instruction: &str, then: impl FnOnce(&Situation) -> T) -> T {
    let instruction = parse_instruction(instruction);
    let here = Point3::from(agent().translation.vector);
    let path_length = |point: &Point3<f64>| Some((point - here).norm());
    let can_stop = |_: ObjectId| false;
    then(&Situation {
        camera_height_m: CAMERA_HEIGHT_M,
        ..Situation::new(graph, agent(), &instruction, &path_length, &can_stop)
    })
}

/// Scene `number` (1 to 9) of a seed. Ids are shuffled, so that their order tells nothing.
pub fn nine_scene(number: usize, seed: u64) -> SceneGraph {
    let mut draw = Draw(seed.wrapping_mul(1_000_003).wrapping_add(number as u64));
    let middle = Point3::new(ROOM_M / 2.0, ROOM_M / 2.0, 0.0);
    let mut things = Vec::new();
    for index in 0..OBJECTS[number - 1] {
        let class = CLASSES[draw.index(CLASSES.len())];
        let (at, room) = loop {
            let z = draw.between(0.1, 2.4);
            let (at, room) = match number {
                1..=3 => {
                    let side = |bit: usize| if index & bit != 0 { 1.0 } else { -1.0 };
                    let z = if index & 4 != 0 {
                        draw.between(CAMERA_HEIGHT_M, 2.4)
                    } else {
                        draw.between(0.1, CAMERA_HEIGHT_M)
                    };
                    let (x, y) = (side(1) * draw.between(0.2, 2.4), side(2) * draw.between(0.2, 2.4));
                    (Point3::new(middle.x + x, middle.y + y, z), 0)
                }
                4..=6 => (Point3::new(draw.between(0.0, ROOM_M), draw.between(0.0, ROOM_M), z), 0),
                _ => {
                    let room = 1 + draw.index(3);
                    let (x, y) = corner(room, 2);
                    (Point3::new(x + draw.between(0.2, 4.8), y + draw.between(0.2, 4.8), z), room)
                }
            };
            let distance_m = (at - middle).norm();
            if number > 6 || (number <= 3) == (distance_m <= FOCAL_M) {
                break (at, room);
            }
        };
        things.push((class, at, room, draw.caption(class)));
    }
    graph(2, &things, &mut draw)
}

/// `side` x `side` rooms with `each` objects apiece; the agent's pose is [`middle_of`].
pub fn grid(side: usize, each: usize, seed: u64) -> SceneGraph {
    let mut draw = Draw(seed);
    let mut things = Vec::new();
    for room in 0..side * side {
        let (x, y) = corner(room, side);
        for _ in 0..each {
            let class = CLASSES[draw.index(CLASSES.len())];
            let at = Point3::new(x + draw.between(0.2, 4.8), y + draw.between(0.2, 4.8), draw.between(0.1, 2.4));
            things.push((class, at, room, draw.caption(class)));
        }
    }
    graph(side, &things, &mut draw)
}

/// In the middle of the middle room of a grid.
pub fn middle_of(side: usize) -> Isometry3<f64> {
    let (x, y) = corner(side / 2 * side + side / 2, side);
    Isometry3::translation(x + ROOM_M / 2.0, y + ROOM_M / 2.0, 0.0)
}

fn corner(room: usize, side: usize) -> (f64, f64) {
    (ROOM_M * (room % side) as f64, ROOM_M * (room / side) as f64)
}

fn graph(side: usize, things: &[(&str, Point3<f64>, usize, String)], draw: &mut Draw) -> SceneGraph {
    let mut graph = SceneGraph::new();
    let mut apply = |op| {
        graph.apply(op).expect("a generated graph is sound");
    };
    for room in 0..side * side {
        let (x, y) = corner(room, side);
        let center = Point3::new(x + ROOM_M / 2.0, y + ROOM_M / 2.0, 0.0);
        let id = PlaceId(room as u64);
        let place = Place { id, position: center, clearance_m: 1.0, basis_points: 2, frontier_cells: 0, room: None };
        apply(Op::PutPlace(place));
        apply(Op::PutRoom(Box::new(Room { places: vec![id], ..Room::new(RoomId(room as u64), center) })));
    }
    let mut ids: Vec<u64> = (1..=things.len() as u64).collect();
    for at in (1..ids.len()).rev() {
        ids.swap(at, draw.index(at + 1));
    }
    for ((class, at, room, caption), id) in things.iter().zip(ids) {
        let bounds = Aabb::from_center(*at, Vector3::repeat(0.3));
        let mut object = Object::new(ObjectId(id), class, bounds);
        object.caption.clone_from(caption);
        object.room = Some(RoomId(*room as u64));
        apply(Op::PutObject(Box::new(object)));
    }
    graph
}

/// The classes present, sorted.
pub fn classes_of(graph: &SceneGraph) -> Vec<String> {
    let mut classes: Vec<String> = graph.objects().map(|object| object.label.clone()).collect();
    classes.sort();
    classes.dedup();
    classes
}
