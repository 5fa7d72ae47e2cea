//! Laws of generated buildings: checked on a fixed mixed bag of configurations and on random ones.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use nalgebra::{Point2, Point3, Vector3};
use omni_sim::building::{
    Bounds, Building, BuildingConfig, DoorAxis, ObjectTruth, Rect, RoomKind, SceneError, Style, generate,
};
use omni_sim::catalog::class;
use omni_sim::colors::color_name;
use omni_sim::scenes::{named_scene, named_scene_for, scene_names};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Rounding of f32 coordinates of buildings up to 60 m: 60 * 2^-24, generously.
const F32_TOL_M: f64 = 1e-5;

fn config(seed: u64, rooms: u32, storeys: u32, style: Style) -> BuildingConfig {
    BuildingConfig { seed, rooms, storeys, style, ..Default::default() }
}

/// Small and large, flat and office, one and two storeys.
fn bag() -> &'static [(BuildingConfig, Building)] {
    static BAG: OnceLock<Vec<(BuildingConfig, Building)>> = OnceLock::new();
    BAG.get_or_init(|| {
        let mut configs = vec![
            config(1, 2, 1, Style::Flat),
            config(2, 3, 1, Style::Office),
            config(3, 4, 1, Style::Flat),
            config(4, 5, 1, Style::Flat),
            config(5, 6, 1, Style::Office),
            config(6, 8, 2, Style::Flat),
            config(7, 12, 1, Style::Office),
            config(8, 12, 2, Style::Office),
            config(9, 30, 1, Style::Flat),
        ];
        configs[3].min_door_m = 1.2;
        configs[3].passage_m = 1.1;
        configs.into_iter().map(|c| (c.clone(), generate(&c).expect("a valid configuration"))).collect()
    })
}

#[test]
fn rooms_doors_and_ways_are_as_configured() {
    bag().iter().for_each(|(c, b)| check_rooms(c, b));
}

fn check_rooms(c: &BuildingConfig, b: &Building) {
    assert_eq!(b.rooms.len(), c.rooms as usize, "{c:?}");
    let names: BTreeSet<&str> = b.rooms.iter().map(|r| r.name.as_str()).collect();
    assert_eq!(names.len(), b.rooms.len(), "room names are unique");
    assert_eq!(b.rooms.iter().map(|r| r.storey).max(), Some(c.storeys - 1));
    for (i, room) in b.rooms.iter().enumerate() {
        assert_eq!(room.id as usize, i);
        assert!(room.area_m2() > 3.5 && room.rects.iter().all(|r| r.area_m2() > 0.0), "{c:?} {room:?}");
        for (k, r) in room.rects.iter().enumerate() {
            assert!(room.rects[k + 1..].iter().all(|s| !r.overlaps(s, 1e-9)));
            let others = b.rooms.iter().filter(|o| o.id != room.id && o.storey == room.storey);
            // A wall of at least 10 cm stands between any two rooms.
            assert!(others.flat_map(|o| &o.rects).all(|s| !r.grown(0.0999).overlaps(s, 1e-9)), "{c:?} {}", room.name);
        }
    }
    for d in &b.doors {
        assert!(d.rooms.0 < d.rooms.1);
        if d.axis == DoorAxis::Z {
            assert!(d.width_m > 2.0);
            continue;
        }
        assert!(
            d.width_m >= c.min_door_m - 1e-9 && d.width_m <= c.min_door_m.max(1.4) + 0.05 && d.height_m == 2.05,
            "{c:?} {d:?}"
        );
        // One step to either side leads into the two rooms.
        let step = if d.axis == DoorAxis::X { Vector3::x() } else { Vector3::y() } * 0.1;
        let up = Vector3::z() * 0.5;
        let beside: BTreeSet<Option<u32>> =
            [step, -step].iter().map(|s| b.room_at(&(d.center + s + up)).map(|r| r.id)).collect();
        assert_eq!(beside, [Some(d.rooms.0), Some(d.rooms.1)].into_iter().collect(), "{c:?} {d:?}");
    }
    let mut known = BTreeSet::from([0]);
    while let Some(d) = b.doors.iter().find(|d| known.contains(&d.rooms.0) != known.contains(&d.rooms.1)) {
        known.extend([d.rooms.0, d.rooms.1]);
    }
    assert_eq!(known.len(), b.rooms.len(), "every room is reachable: {c:?}");
}

#[test]
fn nobody_walks_through_a_bathroom() {
    for (c, b) in bag() {
        for hidden in b.rooms.iter().filter(|r| matches!(r.kind, RoomKind::Bathroom | RoomKind::Restroom)) {
            let mut known = BTreeSet::from([u32::from(hidden.id == 0)]);
            let doors: Vec<_> = b.doors.iter().filter(|d| d.rooms.0 != hidden.id && d.rooms.1 != hidden.id).collect();
            while let Some(d) = doors.iter().find(|d| known.contains(&d.rooms.0) != known.contains(&d.rooms.1)) {
                known.extend([d.rooms.0, d.rooms.1]);
            }
            assert_eq!(known.len() + 1, b.rooms.len(), "{c:?}: {} is a passage", hidden.name);
        }
    }
}

#[test]
fn things_stand_apart_and_rest_on_something() {
    bag().iter().for_each(|(c, b)| check_objects(c, b));
}

fn check_objects(c: &BuildingConfig, b: &Building) {
    assert!(b.objects.windows(2).all(|w| w[0].id < w[1].id) && b.objects[0].id == 1);
    for (i, o) in b.objects.iter().enumerate() {
        let room = &b.rooms[o.room as usize];
        let foot = o.bounds.footprint();
        let inside: f64 = room.rects.iter().map(|r| overlap_m2(r, &foot)).sum();
        assert!((inside - foot.area_m2()).abs() < 1e-6, "{c:?}: {} {} leaves {}", o.class, o.id, room.name);
        let known = class(&o.class).expect("classes come from the catalogue");
        assert!(color_name(o.rgb) == o.color && known.colors.contains(&o.color.as_str()));
        for p in &b.objects[i + 1..] {
            let carries = o.supported_by == Some(p.id) || p.supported_by == Some(o.id);
            assert!(
                carries || !o.bounds.overlaps(&p.bounds, 1e-6),
                "{c:?}: {} {} runs into {} {}",
                o.class,
                o.id,
                p.class,
                p.id
            );
        }
        match o.supported_by {
            Some(id) => {
                let support = b.object(id).expect("supports exist");
                assert_eq!(support.room, o.room);
                let s = support.bounds.footprint().grown(1e-6);
                assert!(s.contains(&foot.min) && s.contains(&foot.max), "{} hangs over {}", o.class, support.class);
                let tops = vertices(b, id);
                assert!(
                    tops.iter().any(|v| (v.z - o.bounds.min.z).abs() < F32_TOL_M),
                    "{c:?}: {} {} floats over {}",
                    o.class,
                    o.id,
                    support.class
                );
            }
            None => {
                let height = o.bounds.min.z - room.floor_z_m;
                assert!((0.0..1.6).contains(&height), "{} at {height}", o.class);
            }
        }
    }
}

fn overlap_m2(a: &Rect, b: &Rect) -> f64 {
    (a.max.x.min(b.max.x) - a.min.x.max(b.min.x)).max(0.0) * (a.max.y.min(b.max.y) - a.min.y.max(b.min.y)).max(0.0)
}

fn vertices(b: &Building, id: u32) -> Vec<Point3<f64>> {
    let faces = b.mesh.faces.iter().zip(&b.mesh.instances).filter(|(_, i)| **i == id).map(|(f, _)| f);
    faces.flatten().map(|v| b.mesh.vertices[*v as usize].cast::<f64>()).collect()
}

#[test]
fn bounds_are_the_boxes_of_the_triangles() {
    for (_, b) in bag() {
        let mut boxes: BTreeMap<u32, Bounds> = BTreeMap::new();
        let mut add = |id: u32, p: Point3<f64>| {
            let e = boxes.entry(id).or_insert(Bounds { min: p, max: p });
            *e = Bounds { min: e.min.inf(&p), max: e.max.sup(&p) };
        };
        for (face, id) in b.mesh.faces.iter().zip(&b.mesh.instances) {
            face.iter().for_each(|v| add(*id, b.mesh.vertices[*v as usize].cast()));
        }
        for m in &b.movers {
            assert_eq!(b.object(m.instance).map(|o| o.class.as_str()), Some("door"));
            m.mesh.vertices.iter().for_each(|v| add(m.instance, m.path[0].1 * v.cast::<f64>()));
        }
        for o in &b.objects {
            let seen = boxes[&o.id];
            assert!(
                (seen.min - o.bounds.min).norm() < F32_TOL_M && (seen.max - o.bounds.max).norm() < F32_TOL_M,
                "{o:?}"
            );
        }
    }
}

#[test]
fn captions_are_short_true_and_silent_about_rooms() {
    bag().iter().for_each(|(c, b)| check_captions(c, b));
}

fn check_captions(c: &BuildingConfig, b: &Building) {
    let rooms =
        ["kitchen ", "bathroom", "bedroom", "meeting room", "office ", "corridor", "hallway", "living room", "lab "];
    for o in &b.objects {
        let words = o.caption.split_whitespace().count();
        assert!((20..=40).contains(&words), "{c:?}: {words} words: {}", o.caption);
        let lower = o.caption.to_lowercase();
        assert!(lower.contains(&o.class) && lower.contains(&o.color), "{}", o.caption);
        assert!(o.caption.starts_with(|l: char| l.is_uppercase()) && o.caption.ends_with('.'));
        let cleaned = lower.replace("office chair", "").replace("kitchen table", "");
        assert!(rooms.iter().all(|r| !cleaned.contains(r)), "{}", o.caption);
        for vowel in [" a orange", " a oak", " a armchair", " a office", " an blue", " an red", " an white"] {
            assert!(!lower.contains(vowel), "{}", o.caption);
        }
    }
    // Few captions are the same sentence twice.
    let different: BTreeSet<&str> = b.objects.iter().map(|o| o.caption.as_str()).collect();
    assert!(different.len() * 10 >= b.objects.len() * 9, "{} of {}", different.len(), b.objects.len());
}

/// Nearest triangle along a ray, by looking at all of them: (distance, instance, front side).
fn cast(b: &Building, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<(f64, u32, bool)> {
    let mut best: Option<(f64, u32, bool)> = None;
    for (face, instance) in b.mesh.faces.iter().zip(&b.mesh.instances) {
        let [p, q, r] = face.map(|v| b.mesh.vertices[v as usize].cast::<f64>());
        let (e1, e2) = (q - p, r - p);
        let h = direction.cross(&e2);
        let det = e1.dot(&h);
        if det.abs() < 1e-14 {
            continue;
        }
        let s = origin - p;
        let u = s.dot(&h) / det;
        let k = s.cross(&e1);
        let v = direction.dot(&k) / det;
        let t = e2.dot(&k) / det;
        if u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && t > 1e-6 && best.is_none_or(|x| t < x.0) {
            best = Some((t, *instance, det > 0.0));
        }
    }
    best
}

#[test]
fn no_ray_escapes_and_all_surfaces_face_the_room() {
    for (c, b) in bag() {
        let mut rng = ChaCha8Rng::seed_from_u64(c.seed);
        for room in &b.rooms {
            for _ in 0..(240 / b.rooms.len()).max(12) {
                let rect = &room.rects[rng.random_range(0..room.rects.len())];
                let mut from = |low: f64, high: f64| rng.random_range(low + 0.01..high - 0.01);
                let origin = Point3::new(
                    from(rect.min.x, rect.max.x),
                    from(rect.min.y, rect.max.y),
                    room.floor_z_m + from(0.0, room.height_m),
                );
                if b.objects.iter().any(|o| o.bounds.distance_m(&origin) < 0.01) {
                    continue; // inside a thing one may look at its back faces
                }
                let d = Vector3::new(from(-1.0, 1.0), from(-1.0, 1.0), from(-1.0, 1.0));
                let Some(direction) = d.try_normalize(1e-3) else {
                    continue;
                };
                let hit = cast(b, &origin, &direction);
                let (distance, instance, is_front) =
                    hit.unwrap_or_else(|| panic!("{c:?}: a ray escapes from {origin}"));
                assert!(
                    is_front,
                    "{c:?}: back side of {instance} seen from {origin} at {distance} along {direction:?}"
                );
                let end = origin + direction * (distance - 1e-4);
                let doors = b.doors.iter().any(|d| (d.center - end).xy().norm() < 3.0);
                assert!(b.room_at(&end).is_some() || doors, "{c:?}: a ray leaves the rooms at {end}");
            }
        }
    }
}

#[test]
fn meshes_are_complete_and_light() {
    for (c, b) in bag() {
        let m = &b.mesh;
        assert!(m.faces.len() == m.instances.len() && m.faces.len() == m.colors.len());
        assert!(m.faces.iter().flatten().all(|v| (*v as usize) < m.vertices.len()));
        assert!(m.vertices.iter().all(|v| v.coords.iter().all(|x| x.is_finite())));
        assert!(m.faces.len() <= 5000 * c.rooms as usize, "{} triangles for {} rooms", m.faces.len(), c.rooms);
    }
}

/// A flood over the whole storey, written without the generator's own passage code: cells whose disc (shrunk by one cell for
/// the raster) touches neither a wall nor a thing.
struct Walkable {
    origin: Point2<f64>,
    width: usize,
    reached: Vec<bool>,
}

const CELL_M: f64 = 0.05;

fn walk(b: &Building, storey: u32, passage_m: f64) -> Walkable {
    let rooms: Vec<_> = b.rooms.iter().filter(|r| r.storey == storey).collect();
    let floors: Vec<Rect> = rooms.iter().flat_map(|r| r.rects.clone()).collect();
    let floor_z = rooms[0].floor_z_m;
    let doors: Vec<Rect> = b
        .doors
        .iter()
        .filter(|d| d.axis != DoorAxis::Z && d.center.z == floor_z)
        .map(|d| {
            let (dx, dy) = if d.axis == DoorAxis::X { (0.07, d.width_m / 2.0) } else { (d.width_m / 2.0, 0.07) };
            Rect::new(d.center.x - dx, d.center.y - dy, d.center.x + dx, d.center.y + dy)
        })
        .collect();
    let obstacles: Vec<Rect> = b
        .objects
        .iter()
        .filter(|o| b.rooms[o.room as usize].storey == storey)
        .map(|o| o.bounds.footprint())
        .filter(|f| f.width_m() > 0.066 && f.height_m() > 0.066)
        .collect();
    let origin = floors.iter().fold(Point2::new(f64::MAX, f64::MAX), |m, r| m.inf(&r.min));
    let end = floors.iter().fold(Point2::new(f64::MIN, f64::MIN), |m, r| m.sup(&r.max));
    let (width, height) = (((end.x - origin.x) / CELL_M) as usize + 1, ((end.y - origin.y) / CELL_M) as usize + 1);
    let center = |i: usize| {
        Point2::new(origin.x + ((i % width) as f64 + 0.5) * CELL_M, origin.y + ((i / width) as f64 + 0.5) * CELL_M)
    };
    let open: Vec<bool> = (0..width * height)
        .map(|i| {
            let p = center(i);
            floors.iter().chain(&doors).any(|r| r.contains(&p)) && !obstacles.iter().any(|o| o.contains(&p))
        })
        .collect();
    let radius = passage_m / 2.0 - CELL_M;
    let reach = (radius / CELL_M) as isize;
    let disc: Vec<(isize, isize)> = (-reach..=reach)
        .flat_map(|y| (-reach..=reach).map(move |x| (x, y)))
        .filter(|(x, y)| ((x * x + y * y) as f64).sqrt() * CELL_M <= radius)
        .collect();
    let free = |i: usize| {
        let (x, y) = ((i % width) as isize, (i / width) as isize);
        disc.iter().all(|(dx, dy)| {
            let (u, v) = (x + dx, y + dy);
            u >= 0 && v >= 0 && (u as usize) < width && (v as usize) < height && open[v as usize * width + u as usize]
        })
    };
    let start_door = doors[0].center();
    let start = (0..width * height)
        .min_by(|a, b| (center(*a) - start_door).norm().total_cmp(&(center(*b) - start_door).norm()));
    let mut reached = vec![false; width * height];
    let mut stack = vec![start.expect("a storey has cells")];
    while let Some(i) = stack.pop() {
        if reached[i] || !free(i) {
            continue;
        }
        reached[i] = true;
        let (x, y) = (i % width, i / width);
        let around = [
            (x > 0).then(|| i - 1),
            (x + 1 < width).then(|| i + 1),
            (y > 0).then(|| i - width),
            (y + 1 < height).then(|| i + width),
        ];
        stack.extend(around.into_iter().flatten());
    }
    Walkable { origin, width, reached }
}

impl Walkable {
    fn near(&self, rect: &Rect, distance_m: f64) -> impl Iterator<Item = Point2<f64>> + '_ {
        let rect = *rect;
        let cells = self.reached.iter().enumerate().filter(|(_, r)| **r);
        cells
            .map(|(i, _)| {
                let (x, y) = (i % self.width, i / self.width);
                Point2::new(self.origin.x + (x as f64 + 0.5) * CELL_M, self.origin.y + (y as f64 + 0.5) * CELL_M)
            })
            .filter(move |p| rect.distance_m(p) <= distance_m)
    }
}

#[test]
fn a_disc_gets_from_any_door_to_every_door_and_every_thing() {
    for (c, b) in bag().iter().filter(|(c, _)| c.rooms <= 12) {
        for storey in 0..c.storeys {
            let walkable = walk(b, storey, c.passage_m);
            for d in b.doors.iter().filter(|d| d.axis != DoorAxis::Z && b.rooms[d.rooms.0 as usize].storey == storey) {
                let here = Rect { min: d.center.xy(), max: d.center.xy() };
                assert!(walkable.near(&here, 0.1).next().is_some(), "{c:?}: door {d:?} is cut off");
            }
            for o in b.objects.iter().filter(|o| b.rooms[o.room as usize].storey == storey) {
                let foot = o.bounds.footprint();
                assert!(walkable.near(&foot, 0.95).next().is_some(), "{c:?}: {} {} is out of reach", o.class, o.id);
            }
        }
    }
}

#[test]
fn every_thing_of_the_named_buildings_is_seen_from_within_a_metre() {
    for name in ["flat", "office"] {
        let b = named_scene(name).expect("a named scene");
        let walkable = walk(&b, 0, 0.95);
        for o in b.objects.iter().filter(|o| b.movers.iter().all(|m| m.instance != o.id)) {
            let targets: Vec<Point3<f64>> = vertices(&b, o.id)
                .chunks(3)
                .map(|t| nalgebra::center(&t[0], &nalgebra::center(&t[1], &t[2])))
                .collect();
            let seen = walkable.near(&o.bounds.footprint(), 0.95).step_by(11).any(|p| {
                let eye = Point3::new(p.x, p.y, 0.73);
                targets.iter().any(|t| cast(&b, &eye, &(t - eye)).is_some_and(|(_, i, _)| i == o.id))
            });
            assert!(seen, "{name}: {} {} is hidden", o.class, o.id);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_building_and_another_seed_another() {
    let (c, b) = &bag()[4];
    let again = generate(c).expect("a valid configuration");
    assert_eq!(b.mesh, again.mesh);
    assert_eq!(b.objects, again.objects);
    assert_eq!(b.rooms, again.rooms);
    assert_eq!(b.doors, again.doors);
    let other = generate(&BuildingConfig { seed: c.seed + 1000, ..c.clone() }).expect("a valid configuration");
    assert_ne!(b.rooms, other.rooms);
    assert_ne!(b.objects, other.objects);
}

#[test]
fn classes_repeat_with_other_looks() {
    let (_, b) = &bag()[6];
    let mut looks: BTreeMap<&str, BTreeSet<(&str, &str, u32)>> = BTreeMap::new();
    for o in &b.objects {
        looks.entry(&o.class).or_default().insert((&o.color, &o.material, o.room));
    }
    let repeated = looks.values().filter(|l| l.len() > 1).count();
    assert!(repeated >= 10, "{repeated} classes come with two looks or rooms");
    let across: BTreeSet<&str> = bag().iter().flat_map(|(_, b)| &b.objects).map(|o| o.class.as_str()).collect();
    assert!(across.len() >= 60, "{} classes in use", across.len());
}

#[test]
fn named_scenes_keep_their_promises() {
    assert!(named_scene("castle").is_none());
    for name in scene_names() {
        assert!(named_scene(name).is_some(), "{name}");
    }
    let get = |name: &str| named_scene(name).expect("checked above");
    let of = |b: &Building, class: &str| -> Vec<ObjectTruth> {
        b.objects.iter().filter(|o| o.class == class).cloned().collect()
    };
    let kind = |b: &Building, id: u32| b.rooms[id as usize].kind;

    let flat = get("flat");
    assert!((4..=5).contains(&flat.rooms.len()));
    let sinks = of(&flat, "sink");
    let (near, far): (Vec<_>, Vec<_>) = of(&flat, "mug").into_iter().partition(|m| {
        sinks
            .iter()
            .any(|s| kind(&flat, s.room) == RoomKind::Kitchen && s.room == m.room && s.bounds.gap_m(&m.bounds) <= 0.6)
    });
    assert!(!near.is_empty() && !far.is_empty());

    let office = get("office");
    assert!((4..=5).contains(&office.rooms.len()));
    let (meeting, rest): (Vec<_>, Vec<_>) =
        of(&office, "plant").into_iter().partition(|p| kind(&office, p.room) == RoomKind::MeetingRoom);
    assert!(!meeting.is_empty() && !rest.is_empty());

    let corridor = get("corridor");
    assert!(corridor.objects.is_empty() && corridor.rooms.len() == 1 && corridor.rooms[0].rects[0].width_m() > 25.0);
    let narrow = get("narrow-door");
    assert!(narrow.doors.len() == 1 && (narrow.doors[0].width_m - 0.7).abs() < 1e-9 && narrow.rooms.len() == 2);
    let spin = get("spin");
    assert!(spin.rooms.len() == 1 && spin.objects.len() >= 10);
}

/// A robot with a large footprint gets buildings it fits into, with the same promise; others get the usual ones.
#[test]
fn named_scenes_suit_the_robot() {
    for name in ["flat", "office"] {
        let usual = named_scene(name).expect("it exists");
        let same = named_scene_for(name, 1.0, 0.9).expect("it exists");
        assert!(usual.mesh == same.mesh);
        let wide = named_scene_for(name, 1.54, 1.44).expect("there is a wide one");
        assert!(!wide.doors.is_empty() && wide.doors.iter().all(|d| d.width_m >= 1.54 - 1e-9), "{name}");
    }
    assert_eq!(named_scene_for("narrow-door", 1.54, 1.44).map(|b| b.doors[0].width_m), Some(14.0 * 0.05));
}

#[test]
fn bad_configurations_are_refused() {
    let check = |c: BuildingConfig, error: SceneError| assert_eq!(generate(&c).err(), Some(error));
    let good = BuildingConfig::default();
    check(BuildingConfig { rooms: 1, ..good.clone() }, SceneError::Rooms(1));
    check(BuildingConfig { rooms: 31, ..good.clone() }, SceneError::Rooms(31));
    check(BuildingConfig { storeys: 3, ..good.clone() }, SceneError::Storeys(3));
    check(BuildingConfig { storeys: 2, rooms: 7, ..good.clone() }, SceneError::RoomsForStoreys(7));
    check(BuildingConfig { min_door_m: 2.1, ..good.clone() }, SceneError::Door(2.1));
    check(BuildingConfig { passage_m: 1.2, ..good.clone() }, SceneError::Passage(1.2));
    assert!(matches!(generate(&BuildingConfig { min_door_m: f64::NAN, ..good.clone() }), Err(SceneError::Door(_))));
    assert!(matches!(generate(&BuildingConfig { passage_m: f64::NAN, ..good }), Err(SceneError::Passage(_))));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 14, failure_persistence: None, ..Default::default() })]

    #[test]
    fn any_configuration_gives_a_sound_building(
        seed in any::<u64>(),
        rooms in prop_oneof![4 => 2u32..=12, 1 => 13u32..=30],
        two in any::<bool>(),
        office in any::<bool>(),
        door in 0u32..=4,
    ) {
        let c = BuildingConfig {
            seed,
            rooms,
            storeys: if two && rooms >= 8 { 2 } else { 1 },
            style: if office { Style::Office } else { Style::Flat },
            min_door_m: 1.0 + 0.1 * f64::from(door),
            passage_m: 0.95,
            ..BuildingConfig::default()
        };
        let b = generate(&c).expect("any seed gives a building");
        check_rooms(&c, &b);
        check_objects(&c, &b);
        check_captions(&c, &b);
    }
}
