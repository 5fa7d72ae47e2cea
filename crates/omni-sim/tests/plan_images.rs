//! Laws of buildings made of floor plans: pixels of a room are in it, solid pixels stop rays, doors join rooms.

use nalgebra::{Point2, Point3, Vector3};
use omni_sim::building::{Building, Style};
use omni_sim::cooccurrence::Cooccurrence;
use omni_sim::furniture::essentials;
use omni_sim::plan_image::{PlanConfig, PlanError, PlanImage, raise_plan};
use omni_sim::world::World;
use proptest::prelude::*;

const PIXEL_M: f64 = 0.05;

/// A plan drawn by a few numbers: rooms left and right of a corridor, uneven walls, a column in the first room.
#[derive(Debug, Clone)]
struct Drawn {
    grey: Vec<u8>,
    labels: Vec<u32>,
    width: usize,
    height: usize,
}

fn drawn(rooms: usize, room: usize, wall: usize, door: usize, jag: usize) -> Drawn {
    let (width, height) = (2 * room + 40 + 4 * wall, rooms * (room + wall) + wall);
    let (mut grey, mut labels) = (vec![0_u8; width * height], vec![0_u32; width * height]);
    let corridor = (2 * wall + room, 2 * wall + room + 40);
    for y in 0..height {
        for x in 0..width {
            let at = y * width + x;
            let (row, dy) = (y / (room + wall), y % (room + wall));
            let in_row = dy >= wall && row < rooms;
            let left = (wall..wall + room).contains(&x);
            let right = (corridor.1 + wall..corridor.1 + wall + room).contains(&x);
            let in_corridor = (corridor.0..corridor.1).contains(&x) && (wall..height - wall).contains(&y);
            let in_door = in_row
                && (wall + 15..wall + 15 + door).contains(&dy)
                && ((wall + room..corridor.0).contains(&x) || (corridor.1..corridor.1 + wall).contains(&x));
            let is_column =
                left && row == 0 && (wall + 60..wall + 64).contains(&dy) && (wall + 40..wall + 44).contains(&x);
            let is_jag = jag > 0 && left && x == wall && (y / jag).is_multiple_of(2);
            let is_room = in_row && (left || right);
            if (is_room || in_corridor || in_door) && !is_column && !is_jag {
                grey[at] = 255;
            }
            labels[at] = match (is_room, in_corridor) {
                (true, _) => 1 + 2 * row as u32 + u32::from(right),
                (_, true) => 99,
                _ => 0,
            };
        }
    }
    Drawn { grey, labels, width, height }
}

impl Drawn {
    fn raise(&self, config: &PlanConfig) -> Result<Building, PlanError> {
        let Drawn { grey, labels, width, height } = self;
        raise_plan(&PlanImage { grey, labels, width: *width, height: *height, resolution_m: PIXEL_M }, config)
    }
}

fn bare(building: &Building) -> World {
    let mut mesh = building.mesh.clone();
    let keep: Vec<bool> = mesh.instances.iter().map(|i| *i == 0).collect();
    let kept = |k: &usize| keep[*k];
    mesh.faces = (0..keep.len()).filter(kept).map(|k| mesh.faces[k]).collect();
    mesh.colors = (0..keep.len()).filter(kept).map(|k| mesh.colors[k]).collect();
    mesh.instances.retain(|i| *i == 0);
    World::new(mesh, vec![], vec![]).expect("a sound mesh")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn rooms_are_free_walls_are_solid_and_doors_join(
        rooms in 1..4_usize, room in 80..110_usize, wall in 2..8_usize, door in 20..30_usize, jag in 0..7_usize,
        seed in 0..1000_u64, count in 2..8_u32,
    ) {
        let plan = drawn(rooms, room, wall, door, jag);
        let config = PlanConfig { seed, rooms: count, ..PlanConfig::default() };
        let building = plan.raise(&config).unwrap();
        prop_assert!(building.rooms.len() >= 2 && building.rooms.len() <= count as usize);
        prop_assert_eq!(building.rooms.len(), (count as usize).min(2 * rooms + 1), "all rooms are joined");
        // Rectangles of rooms are disjoint.
        let rects: Vec<_> = building.rooms.iter().flat_map(|r| &r.rects).collect();
        for (k, a) in rects.iter().enumerate() {
            prop_assert!(rects[..k].iter().all(|b| !a.overlaps(b, 1e-9)));
        }
        // From the middle of a pixel of a room rays go on to the next pixel if that is free, and are stopped where it is solid.
        let world = bare(&building);
        let high = rects.iter().fold(Point2::new(0.0_f64, 0.0_f64), |m, r| m.sup(&r.max));
        let (nx, ny) = ((high.x / PIXEL_M).round() as i64 + 2, (high.y / PIXEL_M).round() as i64 + 2);
        let middle = |x: i64, y: i64| Point2::new((x as f64 + 0.5) * PIXEL_M, (y as f64 + 0.5) * PIXEL_M);
        let room_of = |x: i64, y: i64| building.rooms.iter().position(|r| r.contains(&middle(x, y)));
        for y in (0..ny).step_by(3) {
            for x in (0..nx).step_by(2) {
                if room_of(x, y).is_none() { continue; }
                for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                    let from = middle(x, y);
                    let is_free = room_of(x + dx, y + dy).is_some();
                    for z in [0.2, 1.0, 1.9] {
                        let hit = world.ray(&Point3::new(from.x, from.y, z), &Vector3::new(dx as f64, dy as f64, 0.0), 0.05, 0);
                        prop_assert_eq!(hit.is_none(), is_free, "pixel {} {} towards {} {} at {}", x, y, dx, dy, z);
                    }
                }
                let up = world.ray(&Point3::new(middle(x, y).x, middle(x, y).y, 1.0), &Vector3::z(), 3.0, 0);
                prop_assert!(up.is_some(), "a ceiling or a lintel over every pixel");
            }
        }
        // Doors join two rooms, as wide as drawn, and enough of them to reach all.
        for d in &building.doors {
            prop_assert!(d.rooms.0 < d.rooms.1 && (d.rooms.1 as usize) < building.rooms.len());
            prop_assert!((d.width_m - door as f64 * PIXEL_M).abs() <= 2.0 * PIXEL_M + 1e-9, "{} of {}", d.width_m, door);
        }
        let mut joined = vec![0_u32];
        for _ in &building.rooms {
            for d in &building.doors {
                for (a, b) in [(d.rooms.0, d.rooms.1), (d.rooms.1, d.rooms.0)] {
                    if joined.contains(&a) && !joined.contains(&b) { joined.push(b); }
                }
            }
        }
        prop_assert_eq!(joined.len(), building.rooms.len());
        // Things stand in their room and out of the walls.
        for object in &building.objects {
            let center = object.bounds.footprint().center();
            prop_assert!(building.rooms[object.room as usize].contains(&center), "{} {:?}", object.class, center);
        }
        prop_assert_eq!(plan.raise(&config).unwrap().objects, building.objects);
    }
}

#[test]
fn a_room_behind_a_door_too_narrow_is_left_out_and_none_is_made() {
    let plan = drawn(2, 90, 4, 14, 0);
    let narrow = PlanConfig { rooms: 5, ..PlanConfig::default() };
    assert!(matches!(plan.raise(&narrow), Err(PlanError::NothingJoined { rooms: 5, .. })));
    let slim = PlanConfig { min_door_m: 0.6, passage_m: 0.6, ..narrow };
    assert_eq!(plan.raise(&slim).unwrap().rooms.len(), 5);
}

#[test]
fn what_gives_a_room_its_name_stays_and_the_rest_is_exchanged() {
    let plan = drawn(3, 110, 4, 22, 0);
    let (mut differ, mut named, mut rooms) = (0, 0, 0);
    for seed in 0..6 {
        for cooccurrence in [Cooccurrence::Usual, Cooccurrence::Shuffled, Cooccurrence::Uniform] {
            let style = if seed % 2 == 0 { Style::Flat } else { Style::Office };
            let config = PlanConfig { seed, rooms: 7, style, cooccurrence, ..PlanConfig::default() };
            let building = plan.raise(&config).unwrap();
            for room in &building.rooms {
                let wanted = essentials(room.kind);
                let has = |name: &&&str| building.objects.iter().any(|o| o.room == room.id && o.class == **name);
                rooms += wanted.len();
                named += wanted.iter().filter(has).count();
            }
            let classes = |b: &Building| b.objects.iter().map(|o| (o.room, o.class.clone())).collect::<Vec<_>>();
            let usual = plan.raise(&PlanConfig { cooccurrence: Cooccurrence::Usual, ..config.clone() }).unwrap();
            differ += usize::from(classes(&building) != classes(&usual));
            for object in building.objects.iter().filter(|o| o.supported_by.is_some()) {
                let support = building.object(object.supported_by.unwrap()).unwrap();
                let foot = support.bounds.footprint();
                assert!(foot.contains(&object.bounds.footprint().center()), "{} on {}", object.class, support.class);
                assert!(object.bounds.min.z <= support.bounds.max.z + 1e-6);
            }
        }
    }
    assert_eq!(differ, 12, "two of three ways differ from the usual one");
    assert!(named * 10 >= rooms * 9, "{named} of {rooms} things that name a room are there");
}

#[test]
fn what_is_no_plan_is_refused() {
    let plan = drawn(1, 80, 3, 22, 0);
    let image = PlanImage {
        grey: &plan.grey,
        labels: &plan.labels,
        width: plan.width,
        height: plan.height,
        resolution_m: PIXEL_M,
    };
    let config = PlanConfig::default();
    let pixels = |image: PlanImage| matches!(raise_plan(&image, &config), Err(PlanError::Pixels { .. }));
    assert!(pixels(PlanImage { width: plan.width + 1, ..image }));
    assert!(pixels(PlanImage { width: usize::MAX, height: 2, ..image }));
    assert!(pixels(PlanImage { labels: &[], ..image }));
    assert!(pixels(PlanImage { width: 0, height: 0, grey: &[], labels: &[], ..image }));
    for resolution_m in [f64::NAN, 0.0, 5.0] {
        assert!(matches!(raise_plan(&PlanImage { resolution_m, ..image }, &config), Err(PlanError::Resolution(_))));
    }
    assert_eq!(raise_plan(&image, &PlanConfig { rooms: 1, ..config.clone() }).err(), Some(PlanError::Rooms(1)));
    let no_width = PlanConfig { min_door_m: f64::NAN, ..config.clone() };
    assert!(matches!(raise_plan(&image, &no_width), Err(PlanError::Width(_))));
    let empty = vec![0; plan.grey.len()];
    let solid = raise_plan(&PlanImage { grey: &empty, ..image }, &config);
    assert!(matches!(solid, Err(PlanError::NothingJoined { rooms: 0, .. })));
}
