//! Which relations truly hold among things: from the exact boxes, from what carries what, and from rays through the true world.
//!
//! The definitions are those that `dsg` documents, computed anew:
//! - *on*, *inside*: the object carries the subject; inside if the object's own surface is right above the subject as well (a
//!   book between two boards of a shelf), otherwise on.
//! - *above*, *under*: one room, a vertical gap of 0.10 to 1.5 m, and at least half of the smaller footprint over the other
//!   one's, which is grown by 0.25 m (a picture hangs on the wall behind the sofa); under is above, seen from below.
//! - *near*: boxes at most 1.0 m apart, neither carrying the other, and a free line of sight from box to box, between the
//!   middles or 0.15 m over both tops; of more than eight the nearest eight of either one.
//! - *between*: near to both others, carried by the same thing as they or standing as they do, the two on opposite sides (150
//!   degrees seen from above), middles at most 0.6 m higher or lower, at most 4.0 m in all; of more than two pairs the shortest two.
//!
//! A robot's boxes are a voxel (5 cm) off. Where that much decides, the truth is [`Holds::Unsure`]: every length and every
//! line of sight is tried that much to either side. Nearness once known may stretch by 0.1 m before it goes (documented
//! there), so its band is that much wider on the far side.

use std::collections::BTreeMap;

use mission::dsg::RelationKind;
use nalgebra::{Point3, Vector3};
use omni_sim::building::{Bounds, Building, ObjectTruth};
use omni_sim::world::World;

/// Error of measurement within which a relation is neither true nor false.
pub const TOLERANCE_M: f64 = 0.05;

const NEAR_M: f64 = 1.0;
const STRETCH_M: f64 = 0.1;
const MOST_NEAR: usize = 8;
const TOUCHING_M: f64 = 0.10;
const ABOVE_M: f64 = 1.5;
const BEHIND_M: f64 = 0.25;
const OVER_TOPS_M: f64 = 0.15;
/// Rays begin so far outside of the boxes. A robot needs more, for its map is coarse; a wall is not skipped by a centimetre.
const BESIDE_M: f64 = 0.01;
const BETWEEN_M: f64 = 4.0;
const LEVEL_M: f64 = 0.6;
const COS_OPPOSITE: f64 = -0.866;
const MOST_BETWEEN: usize = 2;

/// Whether a relation is true.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Holds {
    /// It is not.
    No,
    /// It hangs on less than the error of measurement.
    Unsure,
    /// It is.
    Yes,
}

/// A relation among things: subject, kind, object and for `Between` the other one. Of near and between, which are symmetric,
/// the smaller id stands first.
pub type Key = (u32, RelationKind, u32, Option<u32>);

/// The truth about `things`, a selection of the building's; what is not listed does not hold. Quadratic.
pub fn relation_truth(building: &Building, world: &World, things: &[&ObjectTruth]) -> BTreeMap<Key, Holds> {
    let mut truth = BTreeMap::new();
    let mut near: BTreeMap<(u32, u32), (Holds, f64)> = BTreeMap::new();
    for (at, a) in things.iter().enumerate() {
        for b in &things[at + 1..] {
            if is_on_another_storey(building, a, b) {
                continue;
            }
            let carried = [(*a, *b), (*b, *a)].into_iter().find(|(s, o)| s.supported_by == Some(o.id));
            if let Some((subject, object)) = carried {
                let kind = if is_covered(world, subject, object) { RelationKind::Inside } else { RelationKind::On };
                truth.insert((subject.id, kind, object.id, None), Holds::Yes);
                continue;
            }
            for (upper, lower) in [(a, b), (b, a)] {
                let holds = above(upper, lower);
                truth.insert((upper.id, RelationKind::Above, lower.id, None), holds);
                truth.insert((lower.id, RelationKind::Under, upper.id, None), holds);
            }
            let gap_m = a.bounds.gap_m(&b.bounds);
            let by_gap = within(gap_m, NEAR_M, TOLERANCE_M, STRETCH_M + TOLERANCE_M);
            if by_gap != Holds::No {
                near.insert((a.id.min(b.id), a.id.max(b.id)), (by_gap.min(in_sight(world, a, b)), gap_m));
            }
        }
    }
    keep_nearest(&mut near);
    truth.extend(between(things, &near));
    truth.extend(near.into_iter().map(|((a, b), (holds, _))| ((a, RelationKind::Near, b, None), holds)));
    truth.retain(|_, holds| *holds != Holds::No);
    truth
}

/// Whether `value <= limit`, unsure from `below` under the limit to `beyond` over it.
fn within(value: f64, limit: f64, below: f64, beyond: f64) -> Holds {
    match value {
        value if value <= limit - below => Holds::Yes,
        value if value <= limit + beyond => Holds::Unsure,
        _ => Holds::No,
    }
}

/// The same for both sides alike, tolerance for each of the two faces that make a gap.
fn at_most(value: f64, limit: f64) -> Holds {
    within(value, limit, TOLERANCE_M, TOLERANCE_M)
}

fn is_on_another_storey(building: &Building, a: &ObjectTruth, b: &ObjectTruth) -> bool {
    let storey = |thing: &ObjectTruth| building.rooms.get(thing.room as usize).map(|room| room.storey);
    storey(a) != storey(b)
}

/// Whether a part of the object lies right above the middle of the subject, within the object's box.
fn is_covered(world: &World, subject: &ObjectTruth, object: &ObjectTruth) -> bool {
    let top = Point3::new(subject.bounds.center().x, subject.bounds.center().y, subject.bounds.max.z + 1e-3);
    let height_m = object.bounds.max.z - top.z + 1e-3;
    height_m > 0.0 && !is_free(world, &top, &(top + Vector3::z() * height_m), |instance| instance == object.id)
}

fn above(upper: &ObjectTruth, lower: &ObjectTruth) -> Holds {
    if upper.room != lower.room {
        return Holds::No;
    }
    let gap_m = upper.bounds.min.z - lower.bounds.max.z;
    let over = |grown_m: f64| footprint_share(&upper.bounds, &lower.bounds, grown_m) >= 0.5;
    let by_footprint = match (over(BEHIND_M - TOLERANCE_M), over(BEHIND_M + TOLERANCE_M)) {
        (true, _) => Holds::Yes,
        (false, true) => Holds::Unsure,
        (false, false) => Holds::No,
    };
    at_most(TOUCHING_M, gap_m).min(at_most(gap_m, ABOVE_M)).min(by_footprint)
}

/// Share of the smaller of two footprints that lies over the other, the second grown; a thin one counts as 1 cm deep.
fn footprint_share(a: &Bounds, b: &Bounds, grown_m: f64) -> f64 {
    const THIN_M: f64 = 0.01;
    let share = |k: usize| {
        let (low, high) = (b.min[k] - grown_m, b.max[k] + grown_m);
        let common = a.max[k].min(high) - a.min[k].max(low);
        let smaller = (a.max[k] - a.min[k]).min(high - low).max(THIN_M);
        if common < 0.0 { 0.0 } else { (common.max(THIN_M) / smaller).min(1.0) }
    };
    share(0) * share(1)
}

/// Whether a ray from `from` reaches `to` without meeting an instance that `stops` it.
fn is_free(world: &World, from: &Point3<f64>, to: &Point3<f64>, stops: impl Fn(u32) -> bool) -> bool {
    const PAST_M: f64 = 1e-4;
    let way = to - from;
    let length_m = way.norm();
    let mut done_m = 0.0;
    while done_m < length_m {
        let start = from + way * (done_m / length_m);
        match world.ray(&start, &way, length_m - done_m, 0) {
            Some(hit) if stops(hit.instance) => return false,
            Some(hit) => done_m += hit.distance_m + PAST_M,
            None => return true,
        }
    }
    true
}

/// OmniVLN Eq. 6 in the true world: unsure if a line a little beside says otherwise.
fn in_sight(world: &World, a: &ObjectTruth, b: &ObjectTruth) -> Holds {
    let along = (b.bounds.center() - a.bounds.center()).xy();
    let across = Vector3::new(-along.y, along.x, 0.0).try_normalize(1e-9).unwrap_or_else(Vector3::y) * TOLERANCE_M;
    let up = Vector3::z() * TOLERANCE_M;
    let seen = [Vector3::zeros(), across, -across, up, -up].map(|shift| is_seen(world, a, b, &shift));
    match (seen.contains(&true), seen.contains(&false)) {
        (true, false) => Holds::Yes,
        (false, true) => Holds::No,
        _ => Holds::Unsure,
    }
}

/// Whether the line between the middles or the one over both tops is free, moved by `shift`.
fn is_seen(world: &World, a: &ObjectTruth, b: &ObjectTruth, shift: &Vector3<f64>) -> bool {
    let over_m = a.bounds.max.z.max(b.bounds.max.z) + OVER_TOPS_M;
    let (p, q) = (a.bounds.center(), b.bounds.center());
    let lifted = |point: &Point3<f64>| Point3::new(point.x, point.y, over_m);
    [(p, q), (lifted(&p), lifted(&q))].into_iter().any(|(from, to)| {
        let (start, end) = (leave(&from, &to, &a.bounds), leave(&to, &from, &b.bounds));
        // Nothing of the line is left: they touch.
        (end - start).dot(&(to - from)) <= 0.0
            || is_free(world, &(start + shift), &(end + shift), |instance| instance != a.id && instance != b.id)
    })
}

/// Where the way from `from` to `to` has left the box by the margin, seen from above.
fn leave(from: &Point3<f64>, to: &Point3<f64>, bounds: &Bounds) -> Point3<f64> {
    let way = to - from;
    let share = |k: usize| match way[k] {
        step if step > 0.0 => (bounds.max[k] + BESIDE_M - from[k]) / step,
        step if step < 0.0 => (bounds.min[k] - BESIDE_M - from[k]) / step,
        _ => f64::INFINITY,
    };
    let share = share(0).min(share(1));
    if share.is_finite() { from + way * share } else { *from }
}

/// Nearness holds if it is among the nearest eight of either end; unsure where the order hangs on the error.
fn keep_nearest(near: &mut BTreeMap<(u32, u32), (Holds, f64)>) {
    let all = near.clone();
    let mut of: BTreeMap<u32, Vec<(Holds, f64)>> = BTreeMap::new();
    for ((a, b), entry) in all.iter().filter(|(_, (holds, _))| *holds != Holds::No) {
        of.entry(*a).or_default().push(*entry);
        of.entry(*b).or_default().push(*entry);
    }
    for ((a, b), (holds, gap_m)) in near.iter_mut() {
        let rank = [a, b].map(|id| of.get(id).map_or(Holds::No, |rivals| among(*gap_m, rivals, MOST_NEAR)));
        *holds = (*holds).min(rank[0].max(rank[1]));
    }
}

/// Whether a length is among the `most` shortest of a list that it is on itself.
fn among(length_m: f64, rivals: &[(Holds, f64)], most: usize) -> Holds {
    // Two lengths, each off by the tolerance; the graph also rounds them to the decimetre.
    const ORDER_M: f64 = 2.0 * TOLERANCE_M + 0.05;
    let surely_before =
        rivals.iter().filter(|(holds, rival_m)| *holds == Holds::Yes && *rival_m < length_m - ORDER_M).count();
    let maybe_before = rivals.iter().filter(|(_, rival_m)| *rival_m < length_m + ORDER_M).count().saturating_sub(1);
    match (surely_before < most, maybe_before < most) {
        (_, true) => Holds::Yes,
        (true, false) => Holds::Unsure,
        (false, false) => Holds::No,
    }
}

fn between(things: &[&ObjectTruth], near: &BTreeMap<(u32, u32), (Holds, f64)>) -> Vec<(Key, Holds)> {
    let mut found = Vec::new();
    for subject in things {
        let nearness = |other: &ObjectTruth| {
            let pair = (subject.id.min(other.id), subject.id.max(other.id));
            near.get(&pair).map_or(Holds::No, |(holds, _)| *holds)
        };
        let ends: Vec<(&ObjectTruth, Holds)> = things
            .iter()
            .map(|other| (*other, nearness(other).min(is_level(subject, other))))
            .filter(|(_, holds)| *holds != Holds::No)
            .collect();
        let mut of_subject: Vec<(Key, (Holds, f64))> = Vec::new();
        for (at, (a, holds_a)) in ends.iter().enumerate() {
            for (b, holds_b) in &ends[at + 1..] {
                let (opposite, span_m) = are_opposite(subject, a, b);
                let holds = (*holds_a).min(*holds_b).min(opposite).min(at_most(span_m, BETWEEN_M));
                if holds != Holds::No {
                    let key = (subject.id, RelationKind::Between, a.id.min(b.id), Some(a.id.max(b.id)));
                    of_subject.push((key, (holds, span_m)));
                }
            }
        }
        let rivals: Vec<(Holds, f64)> = of_subject.iter().map(|(_, rival)| *rival).collect();
        let ranked =
            |(key, (holds, span_m)): (Key, (Holds, f64))| (key, holds.min(among(span_m, &rivals, MOST_BETWEEN)));
        found.extend(of_subject.into_iter().map(ranked));
    }
    found
}

fn is_level(subject: &ObjectTruth, other: &ObjectTruth) -> Holds {
    if subject.supported_by != other.supported_by {
        return Holds::No;
    }
    at_most((subject.bounds.center().z - other.bounds.center().z).abs(), LEVEL_M)
}

/// Whether two others stand on opposite sides of a subject, also if its middle is a little beside; and how far in all.
fn are_opposite(subject: &ObjectTruth, a: &ObjectTruth, b: &ObjectTruth) -> (Holds, f64) {
    let middle = |thing: &ObjectTruth| thing.bounds.center().coords.xy();
    let (s, a, b) = (middle(subject), middle(a), middle(b));
    let tolerance = [(0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)];
    let answers = tolerance.map(|(x, y)| {
        let s = s + nalgebra::Vector2::new(x, y) * TOLERANCE_M;
        let (to_a, to_b) = (a - s, b - s);
        to_a.norm() > 0.05 && to_b.norm() > 0.05 && to_a.dot(&to_b) <= COS_OPPOSITE * to_a.norm() * to_b.norm()
    });
    let holds = match (answers.contains(&true), answers.contains(&false)) {
        (true, false) => Holds::Yes,
        (false, true) => Holds::No,
        _ => Holds::Unsure,
    };
    (holds, (a - s).norm() + (b - s).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map_score::test_things::{boxed, building_of, room, thing};
    use RelationKind::{Above, Between, Inside, Near, On, Under};

    /// What holds among things in one or two rooms.
    fn truth(rooms: &[[f64; 4]], things: Vec<ObjectTruth>) -> BTreeMap<Key, Holds> {
        let rooms = rooms.iter().enumerate().map(|(id, rect)| room(id as u32, *rect)).collect();
        let building = building_of(rooms, things);
        let world = World::of_building(&building).unwrap();
        relation_truth(&building, &world, &building.objects.iter().collect::<Vec<_>>())
    }

    const ROOM: [f64; 4] = [-10.0, -10.0, 10.0, 10.0];

    #[test]
    fn on_near_and_above_by_hand() {
        let mut mug = boxed(2, "mug", [0.0, 0.0, 0.8], [0.1, 0.1, 0.1]);
        mug.supported_by = Some(1);
        let found = truth(
            &[ROOM],
            vec![
                boxed(1, "table", [0.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
                mug,
                boxed(3, "lamp", [0.0, 0.0, 1.5], [0.3, 0.3, 0.3]),
                boxed(4, "chair", [1.2, 0.0, 0.4], [0.4, 0.4, 0.8]),
            ],
        );
        assert_eq!(found.get(&(2, On, 1, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(3, Above, 1, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(1, Under, 3, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(3, Above, 2, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(1, Near, 4, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(1, Near, 2, None)), None, "what carries a thing is not near it");
        assert_eq!(found.get(&(4, On, 1, None)), None);
    }

    #[test]
    fn what_hangs_on_a_centimetre_is_unsure() {
        let pair = |gap_m: f64| {
            let things = vec![thing(1, "chair", [0.0, 0.0, 0.5], 0.5), thing(2, "box", [0.5 + gap_m, 0.0, 0.5], 0.5)];
            truth(&[ROOM], things).get(&(1, Near, 2, None)).copied()
        };
        assert_eq!(pair(0.9), Some(Holds::Yes));
        assert_eq!(pair(0.97), Some(Holds::Unsure));
        assert_eq!(pair(1.13), Some(Holds::Unsure), "a known one may stretch");
        assert_eq!(pair(1.2), None);
    }

    #[test]
    fn a_wall_of_furniture_parts_and_a_low_box_does_not() {
        let beside = |height_m: f64| {
            let screen = boxed(3, "cabinet", [0.0, 0.0, height_m / 2.0], [0.1, 3.0, height_m]);
            let found = truth(
                &[ROOM],
                vec![thing(1, "chair", [-0.6, 0.0, 0.4], 0.4), thing(2, "box", [0.6, 0.0, 0.4], 0.4), screen],
            );
            found.get(&(1, Near, 2, None)).copied()
        };
        assert_eq!(beside(2.0), None);
        assert_eq!(beside(0.5), Some(Holds::Yes), "one sees over it");
    }

    #[test]
    fn the_other_side_of_a_wall_is_not_above() {
        let mut picture = boxed(2, "picture", [0.4, 0.0, 1.5], [0.04, 0.6, 0.5]);
        let sofa = boxed(1, "sofa", [0.0, 0.0, 0.4], [0.7, 2.0, 0.8]);
        let rooms = [[-5.0, -5.0, 0.36, 5.0], [0.37, -5.0, 5.0, 5.0]];
        let here = truth(&rooms, vec![sofa.clone(), picture.clone()]);
        assert_eq!(here.get(&(2, Above, 1, None)), Some(&Holds::Yes));
        picture.room = 1;
        assert_eq!(truth(&rooms, vec![sofa, picture]).get(&(2, Above, 1, None)), None);
    }

    #[test]
    fn between_two_shelf_boards_is_inside_and_on_the_shelf_is_on() {
        // The shelf is one board at half its height; its box is what counts as the shelf.
        let mut shelf = boxed(1, "shelf", [0.0, 0.0, 1.0], [1.0, 0.4, 0.02]);
        let mut low = boxed(2, "book", [0.0, 0.0, 0.6], [0.2, 0.2, 0.2]);
        let mut high = boxed(3, "vase", [0.2, 0.0, 1.11], [0.1, 0.1, 0.2]);
        (low.supported_by, high.supported_by) = (Some(1), Some(1));
        let building = building_of(vec![room(0, ROOM)], vec![shelf.clone(), low.clone(), high.clone()]);
        let world = World::of_building(&building).unwrap();
        shelf.bounds.min.z = 0.0;
        let found = relation_truth(&building, &world, &[&shelf, &low, &high]);
        assert_eq!(found.get(&(2, Inside, 1, None)), Some(&Holds::Yes));
        assert_eq!(found.get(&(3, On, 1, None)), Some(&Holds::Yes));
    }

    #[test]
    fn the_middle_one_of_three_is_between_if_all_stand_on_the_same() {
        let between = |carriers: [Option<u32>; 3]| {
            let mut things = vec![
                thing(1, "chair", [0.0, 0.0, 0.4], 0.5),
                thing(2, "lamp", [1.0, 0.02, 0.4], 0.3),
                thing(3, "chair", [2.0, 0.0, 0.4], 0.5),
            ];
            things.iter_mut().zip(carriers).for_each(|(thing, carrier)| thing.supported_by = carrier);
            let found = truth(&[ROOM], things);
            assert!(!found.contains_key(&(1, Between, 2, Some(3))));
            found.get(&(2, Between, 1, Some(3))).copied()
        };
        assert_eq!(between([None; 3]), Some(Holds::Yes));
        assert_eq!(between([Some(9); 3]), Some(Holds::Yes));
        assert_eq!(between([None, Some(9), None]), None);
        assert_eq!(between([Some(8), Some(9), Some(8)]), None);
    }

    #[test]
    fn of_many_near_ones_the_eight_nearest_count() {
        // One in the middle and ten round it, the last two clearly farther; the round ones see only neighbours.
        let mut things = vec![thing(1, "box", [0.0, 0.0, 0.1], 0.2)];
        for k in 0..10_u32 {
            let reach_m = if k < 8 { 0.5 } else { 0.95 };
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 10.0).sin_cos();
            things.push(thing(2 + k, "box", [reach_m * cos, reach_m * sin, 0.1], 0.05));
        }
        let found = truth(&[ROOM], things);
        let near = |id: u32| found.get(&(1, Near, id, None)).copied();
        assert!((2..10).all(|id| near(id) == Some(Holds::Yes)));
        // The far ones have few neighbours themselves, so the relation is theirs.
        assert!((10..12).all(|id| near(id).is_some()));
    }
}
