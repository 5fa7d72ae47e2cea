//! A building as it was some time ago: some of its things stood elsewhere, and some stood there that are gone since.
//!
//! The building of today is the truth of a run and stays what it is, byte for byte; what a robot remembers of it comes from
//! the building of then. So two runs, with and without changes, differ in nothing but the memory.

use nalgebra::{Point2, Point3, Translation3, Vector2, Vector3};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::building::{Bounds, Building, ObjectTruth, Rect};
use crate::caption::write_captions;
use crate::catalog::{Mount, class};
use crate::mesh::TriangleMesh;

/// Floor kept free round a thing on its way-side, and before every door, metres: the narrowest passage of the generator's buildings.
const PASSAGE_M: f64 = 1.0;
/// Gap to a wall behind a thing, metres.
const WALL_GAP_M: f64 = 0.03;
/// What stands on the floor is moved up to this footprint, square metres: chairs, bins and side tables, not beds.
const MOVABLE_M2: f64 = 0.5;
/// What was moved less than this has not moved, metres.
const LEAST_MOVE_M: f64 = 1.0;
/// Places tried for one thing.
const TRIES: usize = 300;

/// What has changed since then.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Since {
    /// Things that stood elsewhere, with what stood on them; by their ids, which are the same then and now.
    pub moved: Vec<u32>,
    /// Things of then that are not there any more; their ids are above those of today's things.
    pub gone: Vec<u32>,
}

impl Building {
    /// The building as it was when `share` (0 to 1) of today's number of things were elsewhere or are gone since: about half and
    /// half. Things stood where such things stand: on furniture that carries things, or on the floor with room to pass. Where
    /// nothing fits, less has changed. The same arguments give the same building.
    pub fn earlier(&self, share: f64, seed: u64) -> (Building, Since) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6561_726c_6965_7200);
        let mut then = self.clone();
        let mut since = Since::default();
        let wanted = (share.clamp(0.0, 1.0) * self.objects.len() as f64).round() as usize;
        let mut things: Vec<u32> = self.objects.iter().filter(|o| is_movable(self, o)).map(|o| o.id).collect();
        things.shuffle(&mut rng);
        let mut changes = 0;
        for id in things {
            if changes >= wanted {
                break;
            }
            let is_gone = rng.random_bool(0.5);
            // What was moved along with its support is done.
            if since.moved.contains(&id) {
                continue;
            }
            let Some(shift) = another_place(&then, id, is_gone, &mut rng) else { continue };
            if is_gone {
                since.gone.push(then.put_copy(id, shift));
                changes += 1;
            } else {
                let along = carried_by(&then, id);
                then.shift(&along, &shift);
                // What is gone today and stood on it went along, too.
                let of_today = |k: &u32| self.object(*k).is_some() && !since.moved.contains(k);
                let moved: Vec<u32> = along.into_iter().filter(of_today).collect();
                changes += moved.len();
                since.moved.extend(moved);
            }
        }
        since.moved.sort_unstable();
        let mut captioned = then.objects.clone();
        write_captions(&mut rng, &mut captioned);
        for (object, new) in then.objects.iter_mut().zip(captioned) {
            if since.moved.contains(&object.id) || since.gone.contains(&object.id) {
                object.caption = new.caption;
            }
        }
        (then, since)
    }

    /// Moves these things.
    fn shift(&mut self, ids: &[u32], by: &Vector3<f64>) {
        for id in ids {
            let triangles = triangles_of(&self.mesh, *id);
            let mut vertices: Vec<u32> = triangles.iter().flat_map(|k| self.mesh.faces[*k]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            for vertex in vertices {
                let vertex = &mut self.mesh.vertices[vertex as usize];
                *vertex += by.cast::<f32>();
            }
        }
        let rooms = self.rooms.clone();
        for object in self.objects.iter_mut().filter(|object| ids.contains(&object.id)) {
            object.bounds = shifted(&object.bounds, by);
            let at = object.bounds.center().xy();
            object.room = rooms.iter().find(|r| r.contains(&at)).map_or(object.room, |r| r.id);
            object.placed_with = None;
        }
        if let Some(first) = ids.first() {
            self.rest(*first);
        }
        // Who was placed with it is alone now.
        for object in &mut self.objects {
            object.placed_with = object.placed_with.filter(|with| !ids.contains(with));
        }
    }

    /// Adds a copy of a thing, without what stands on it; its id.
    fn put_copy(&mut self, id: u32, by: Vector3<f64>) -> u32 {
        let new_id = self.objects.iter().map(|o| o.id).max().unwrap_or(0) + 1;
        for k in triangles_of(&self.mesh, id) {
            let first = self.mesh.vertices.len() as u32;
            for corner in self.mesh.faces[k] {
                let at = self.mesh.vertices[corner as usize] + by.cast::<f32>();
                self.mesh.vertices.push(at);
            }
            self.mesh.faces.push([first, first + 1, first + 2]);
            self.mesh.instances.push(new_id);
            self.mesh.colors.push(self.mesh.colors[k]);
        }
        if let Some(mut copy) = self.object(id).cloned() {
            copy.id = new_id;
            copy.bounds = shifted(&copy.bounds, &by);
            let at = copy.bounds.center().xy();
            copy.room = self.rooms.iter().find(|r| r.contains(&at)).map_or(copy.room, |r| r.id);
            copy.placed_with = None;
            self.objects.push(copy);
            self.rest(new_id);
        }
        new_id
    }

    /// A thing in its place: on what is under it.
    fn rest(&mut self, id: u32) {
        let Some(thing) = self.object(id) else { return };
        let under = self.objects.iter().find(|o| o.id != id && is_flat_under(self, o, &thing.bounds)).map(|o| o.id);
        if let Some(thing) = self.objects.iter_mut().find(|o| o.id == id) {
            thing.supported_by = under;
        }
    }
}

/// Small things and light furniture; nothing that hangs on a wall, is built in, or has a mesh of its own.
fn is_movable(building: &Building, thing: &ObjectTruth) -> bool {
    let Some(class) = class(&thing.class) else { return false };
    let is_light = match class.mount {
        Mount::Top => true,
        Mount::Floor => thing.bounds.footprint().area_m2() <= MOVABLE_M2 && !is_built_in(class.name),
        Mount::Wall(_) => false,
    };
    is_light && building.movers.iter().all(|mover| mover.instance != thing.id)
}

/// Needs pipes or stairs.
fn is_built_in(name: &str) -> bool {
    const BUILT_IN: [&str; 11] = [
        "toilet",
        "washbasin",
        "sink",
        "stove",
        "dishwasher",
        "washing machine",
        "dryer",
        "radiator",
        "shower",
        "urinal",
        "staircase",
    ];
    BUILT_IN.contains(&name)
}

/// A thing and all that stands on it, in order of their ids after it.
fn carried_by(building: &Building, id: u32) -> Vec<u32> {
    let mut along = vec![id];
    let mut next = 0;
    while let Some(&carrier) = along.get(next) {
        along.extend(building.objects.iter().filter(|o| o.supported_by == Some(carrier)).map(|o| o.id));
        next += 1;
    }
    along
}

/// How far to another place where the thing, and what stands on it unless it goes `alone`, fits.
fn another_place(building: &Building, id: u32, alone: bool, rng: &mut ChaCha8Rng) -> Option<Vector3<f64>> {
    let thing = building.object(id)?;
    let along = if alone { vec![id] } else { carried_by(building, id) };
    let whole = along
        .iter()
        .filter_map(|k| building.object(*k))
        .fold(thing.bounds, |all, o| Bounds { min: all.min.inf(&o.bounds.min), max: all.max.sup(&o.bounds.max) });
    // A copy must not stand in the thing itself either.
    let others: Vec<&ObjectTruth> = building.objects.iter().filter(|o| alone || !along.contains(&o.id)).collect();
    let carriers: Vec<(&ObjectTruth, f64)> = building
        .objects
        .iter()
        .filter_map(|o| Some((building.object(o.supported_by?)?, o.bounds.min.z)))
        .filter(|(carrier, _)| !along.contains(&carrier.id))
        .collect();
    for _ in 0..TRIES {
        let shift = if thing.supported_by.is_some() {
            let (carrier, top_z) = *carriers.choose(rng)?;
            let foot = carrier.bounds.footprint();
            let at = point_in(&foot, rng);
            let shift = to(&thing.bounds, &at, top_z);
            let bounds = shifted(&whole, &shift);
            let is_free = others.iter().all(|o| o.id == carrier.id || !o.bounds.overlaps(&bounds, -0.01))
                && is_flat_under(building, carrier, &shifted(&thing.bounds, &shift))
                && is_free_of(building, carrier.id, &bounds);
            is_free.then_some(shift)
        } else {
            let room = building.rooms.choose(rng)?;
            let rect = room.rects.choose(rng)?;
            let at = beside_a_wall(rect, &thing.bounds.footprint(), rng);
            let shift = to(&thing.bounds, &at, room.floor_z_m);
            let bounds = shifted(&whole, &shift);
            leaves_a_passage(building, room.id, &others, &bounds).then_some(shift)
        };
        if let Some(shift) = shift.filter(|shift| shift.norm() >= LEAST_MOVE_M) {
            return Some(shift);
        }
    }
    None
}

/// Round it, nothing is nearer than a passage, except walls at its back; no door is nearer than that.
fn leaves_a_passage(building: &Building, room: u32, others: &[&ObjectTruth], bounds: &Bounds) -> bool {
    let Some(room) = building.rooms.iter().find(|r| r.id == room) else { return false };
    let foot = bounds.footprint();
    let covered_m2 = |zone: &Rect| -> f64 {
        let overlap = |r: &Rect| {
            let w = r.max.x.min(zone.max.x) - r.min.x.max(zone.min.x);
            let h = r.max.y.min(zone.max.y) - r.min.y.max(zone.min.y);
            w.max(0.0) * h.max(0.0)
        };
        room.rects.iter().map(overlap).sum()
    };
    let is_floor = |zone: &Rect| covered_m2(zone) >= zone.area_m2() - 1e-6;
    if !is_floor(&foot) || bounds.max.z > room.floor_z_m + room.height_m {
        return false;
    }
    let strip = |side: usize, deep_m: f64| match side {
        0 => Rect::new(foot.min.x - deep_m, foot.min.y, foot.min.x, foot.max.y),
        1 => Rect::new(foot.max.x, foot.min.y, foot.max.x + deep_m, foot.max.y),
        2 => Rect::new(foot.min.x, foot.min.y - deep_m, foot.max.x, foot.min.y),
        _ => Rect::new(foot.min.x, foot.max.y, foot.max.x, foot.max.y + deep_m),
    };
    let is_open = |side: usize| is_floor(&strip(side, PASSAGE_M));
    let is_at_wall =
        |side: usize| covered_m2(&strip(side, 2.0 * WALL_GAP_M)) < strip(side, 2.0 * WALL_GAP_M).area_m2() - 1e-6;
    let zone = foot.grown(PASSAGE_M);
    let is_high = |o: &ObjectTruth| o.bounds.min.z > bounds.max.z || o.bounds.max.z < bounds.min.z + 1e-6;
    (0..4).all(|side| is_open(side) || is_at_wall(side))
        && !(is_at_wall(0) && is_at_wall(1) || is_at_wall(2) && is_at_wall(3))
        && building.doors.iter().all(|door| foot.distance_m(&door.center.xy()) > PASSAGE_M + 0.5 * door.width_m)
        && others.iter().all(|o| is_high(o) || !o.bounds.footprint().overlaps(&zone, 0.0))
}

/// A drawn place in a rectangle for a footprint with its back to one of the rectangle's sides.
fn beside_a_wall(rect: &Rect, foot: &Rect, rng: &mut ChaCha8Rng) -> Point2<f64> {
    let half = Vector2::new(0.5 * foot.width_m() + WALL_GAP_M, 0.5 * foot.height_m() + WALL_GAP_M);
    let (low, high) = (rect.min + half, rect.max - half);
    let along = |low: f64, high: f64, rng: &mut ChaCha8Rng| if low < high { rng.random_range(low..high) } else { low };
    let (x, y) = (along(low.x, high.x, rng), along(low.y, high.y, rng));
    match rng.random_range(0..4) {
        0 => Point2::new(low.x, y),
        1 => Point2::new(high.x, y),
        2 => Point2::new(x, low.y),
        _ => Point2::new(x, high.y),
    }
}

fn point_in(rect: &Rect, rng: &mut ChaCha8Rng) -> Point2<f64> {
    let along = |low: f64, high: f64, rng: &mut ChaCha8Rng| if low < high { rng.random_range(low..high) } else { low };
    Point2::new(along(rect.min.x, rect.max.x, rng), along(rect.min.y, rect.max.y, rng))
}

/// The way from where a box is to where its foot's middle is `at` and its underside at `z`.
fn to(bounds: &Bounds, at: &Point2<f64>, z: f64) -> Vector3<f64> {
    Point3::new(at.x, at.y, z) - Point3::new(bounds.center().x, bounds.center().y, bounds.min.z)
}

fn shifted(bounds: &Bounds, by: &Vector3<f64>) -> Bounds {
    let shift = Translation3::from(*by);
    Bounds { min: shift * bounds.min, max: shift * bounds.max }
}

fn triangles_of(mesh: &TriangleMesh, id: u32) -> Vec<usize> {
    (0..mesh.faces.len()).filter(|k| mesh.instances[*k] == id).collect()
}

/// Whether level surface of a thing lies under the middle and the four corners of a box.
fn is_flat_under(building: &Building, carrier: &ObjectTruth, bounds: &Bounds) -> bool {
    const TOUCH_M: f64 = 0.006;
    let (foot, z) = (bounds.footprint(), bounds.min.z);
    if z > carrier.bounds.max.z + TOUCH_M || z < carrier.bounds.min.z + TOUCH_M {
        return false;
    }
    if !carrier.bounds.footprint().grown(1e-6).contains(&foot.center()) {
        return false;
    }
    let mesh = &building.mesh;
    let level: Vec<[Point2<f64>; 3]> = triangles_of(mesh, carrier.id)
        .into_iter()
        .map(|k| mesh.faces[k].map(|v| mesh.vertices[v as usize].cast::<f64>()))
        .filter(|corners| corners.iter().all(|c| (c.z - z).abs() < TOUCH_M))
        .map(|corners| corners.map(|c| c.xy()))
        .collect();
    let inner = foot.grown(-0.1 * foot.width_m().min(foot.height_m()));
    let (a, b) = (inner.min, inner.max);
    let probes = [inner.center(), a, b, Point2::new(a.x, b.y), Point2::new(b.x, a.y)];
    probes.iter().all(|probe| level.iter().any(|triangle| is_inside(probe, triangle)))
}

/// Whether nothing of a thing reaches into a box, but for what it stands on.
fn is_free_of(building: &Building, id: u32, bounds: &Bounds) -> bool {
    const TOUCH_M: f64 = 0.006;
    let mesh = &building.mesh;
    let above = Bounds { min: bounds.min + Vector3::new(0.0, 0.0, TOUCH_M), max: bounds.max };
    triangles_of(mesh, id).into_iter().all(|k| {
        let corners = mesh.faces[k].map(|v| mesh.vertices[v as usize].cast::<f64>());
        let min = corners[0].inf(&corners[1]).inf(&corners[2]);
        let max = corners[0].sup(&corners[1]).sup(&corners[2]);
        !Bounds { min, max }.overlaps(&above, -1e-6)
    })
}

fn is_inside(p: &Point2<f64>, [a, b, c]: &[Point2<f64>; 3]) -> bool {
    let side = |a: &Point2<f64>, b: &Point2<f64>| (b - a).perp(&(p - a));
    let (u, v, w) = (side(a, b), side(b, c), side(c, a));
    (u >= -1e-9 && v >= -1e-9 && w >= -1e-9) || (u <= 1e-9 && v <= 1e-9 && w <= 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::building::{BuildingConfig, generate};

    fn building(seed: u64) -> Building {
        generate(&BuildingConfig { seed, rooms: 5, ..BuildingConfig::default() }).expect("a building")
    }

    #[test]
    fn about_as_many_things_changed_as_were_asked_for_and_the_rest_did_not() {
        for seed in 0..6 {
            let today = building(seed);
            let (then, since) = today.earlier(0.1, seed);
            let changed = since.moved.len() + since.gone.len();
            let wanted = 0.1 * today.objects.len() as f64;
            assert!((changed as f64 - wanted).abs() <= 4.0, "seed {seed}: {changed} of {wanted:.1} wanted");
            assert!(!since.moved.is_empty() || !since.gone.is_empty());
            assert_eq!(then.objects.len(), today.objects.len() + since.gone.len());
            for object in &today.objects {
                let was = then.object(object.id).expect("everything of today was there then");
                let has_moved = (was.bounds.center() - object.bounds.center()).norm() > 0.5;
                assert_eq!(has_moved, since.moved.contains(&object.id), "{}", object.class);
                assert_eq!(was.class, object.class);
            }
        }
    }

    #[test]
    fn what_stood_elsewhere_stood_on_something_and_in_nothing() {
        for seed in 0..6 {
            let today = building(seed);
            let (then, since) = today.earlier(0.2, seed);
            for id in since.moved.iter().chain(&since.gone) {
                let thing = then.object(*id).expect("it was there");
                let room = then.rooms.iter().find(|r| r.id == thing.room).expect("in a room");
                let floats_m = match thing.supported_by {
                    Some(carrier) => {
                        let carrier = then.object(carrier).expect("what carries it was there");
                        assert_eq!(carrier.room, thing.room);
                        (thing.bounds.min.z - carrier.bounds.max.z).max(0.0)
                    }
                    None => (thing.bounds.min.z - room.floor_z_m).abs(),
                };
                assert!(floats_m < 0.01, "seed {seed}: the {} floats by {floats_m} m", thing.class);
                let inside = |o: &&ObjectTruth| {
                    o.id != *id
                        && Some(o.id) != thing.supported_by
                        && o.supported_by != Some(*id)
                        && o.bounds.overlaps(&thing.bounds, 0.01)
                };
                // A thing on a shelf of a cupboard may lie within the box of the cupboard's other things' carrier.
                assert!(
                    then.objects.iter().find(inside).is_none_or(|o| o.supported_by.is_none()),
                    "seed {seed}: {}",
                    thing.class
                );
            }
            let triangles = |b: &Building, id: u32| triangles_of(&b.mesh, id).len();
            assert!(since.gone.iter().all(|id| triangles(&then, *id) > 0 && triangles(&today, *id) == 0));
            assert!(since.moved.iter().all(|id| triangles(&then, *id) == triangles(&today, *id)));
        }
    }

    #[test]
    fn nothing_changed_is_the_same_building_and_the_same_seed_the_same_change() {
        let today = building(3);
        let (then, since) = today.earlier(0.0, 1);
        assert_eq!((since, then.mesh == today.mesh), (Since::default(), true));
        assert_eq!(then.objects, today.objects);
        let (a, b) = (today.earlier(0.3, 9), today.earlier(0.3, 9));
        assert_eq!((a.1, a.0.objects), (b.1, b.0.objects));
    }
}
