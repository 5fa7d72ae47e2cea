//! Relations from boxes, pruned by the map (OmniVLN Eq. 6) and checked by a verifier (Eq. 7).

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector2};

use crate::contact::{contact, is_above};
use crate::graph::SceneGraph;
use crate::ids::{ObjectId, RoomId};
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::relation::{Evidence, EvidenceSource, Relation, RelationKey, RelationKind, Verdict};
use crate::sight::{blocking_point, parting_wall};
use crate::support::{Standing, standing};

/// Distances at which relations hold.
#[derive(Debug, Clone, PartialEq)]
pub struct RelationConfig {
    /// Largest gap between the boxes of near things. Default 1.0 m.
    pub near_m: f64,
    /// At most so many near relations per object, nearest first. Default 8.
    pub max_near: usize,
    /// Largest gap between the bottom of a thing and the top it stands on. Default 0.10 m.
    pub contact_m: f64,
    /// Largest vertical gap of above and under. Default 1.5 m.
    pub above_m: f64,
    /// Longest distance of the two things that another is between. Default 4.0 m.
    pub between_m: f64,
    /// Ends of a line of sight are this far outside the boxes, so that a thing does not hide itself; at most 0.05 m for what is
    /// inside something that the other end is not in. Default 0.15 m.
    pub sight_margin_m: f64,
    /// Relations shorter than this are shown to the verifier. Default 1.0 m.
    pub verify_within_m: f64,
    /// Score above which the verifier's word counts as yes, tau_vlm of Eq. 7. Default 0.5.
    pub verify_threshold: f64,
}

impl Default for RelationConfig {
    fn default() -> RelationConfig {
        RelationConfig {
            near_m: 1.0,
            max_near: 8,
            contact_m: 0.10,
            above_m: 1.5,
            between_m: 4.0,
            sight_margin_m: 0.15,
            verify_within_m: 1.0,
            verify_threshold: 0.5,
        }
    }
}

impl RelationConfig {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (field, value) in [
            ("near_m", self.near_m),
            ("contact_m", self.contact_m),
            ("above_m", self.above_m),
            ("between_m", self.between_m),
            ("sight_margin_m", self.sight_margin_m),
            ("verify_within_m", self.verify_within_m),
            ("verify_threshold", self.verify_threshold),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(ConfigError { field, rule: "finite and not negative" });
            }
        }
        Ok(())
    }
}

/// The map's word on the line between two points: the point that blocks it, or `None` if it is clear.
pub type SightLine<'a> = &'a dyn Fn(&Point3<f64>, &Point3<f64>) -> Option<Point3<f64>>;

/// What an update found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RelationReport {
    /// Relations that hold.
    pub holding: usize,
    /// Candidates that the map blocks (Eq. 6).
    pub blocked: usize,
    /// Candidates that the verifier rejects (Eq. 7).
    pub rejected: usize,
    /// Questions to the verifier. A relation is asked about once, as long as it stays a candidate.
    pub asked: usize,
    /// The revision afterwards.
    pub revision: u64,
}

/// Recomputes all relations of confirmed objects: candidates from boxes, pruned by `line_of_sight` (the blocking point, or
/// `None` if clear), then put to `verify` (score that the relation holds). What is dropped is kept with the reason, see
/// [`SceneGraph::dropped_relations`]. Stated relations are left alone. One batch; no revision if nothing changed.
///
/// # Errors
/// A bad configuration. A verifier's score or a blocking point that is not finite counts as a rejection or as clear.
pub fn update_relations(
    graph: &mut SceneGraph,
    line_of_sight: SightLine,
    verify: &dyn Fn(&Object, &Object, RelationKind) -> f64,
    config: &RelationConfig,
) -> Result<RelationReport, OpError> {
    config.validate()?;
    let mut report = RelationReport::default();
    let mut found = Vec::new();
    let pairs = neighbours(graph, config);
    let standing = standing(graph, &pairs, config);
    for (a, b) in pairs {
        candidates(graph, a, b, &standing, config, &mut found);
    }
    found.sort_unstable_by_key(|candidate| candidate.relation.key());
    let within = found.iter().map(|candidate| &candidate.relation).filter(|r| r.kind == RelationKind::Inside);
    let container_of: BTreeMap<ObjectId, ObjectId> = within.map(|r| (r.subject, r.object)).collect();
    let mut known = graph.relations.iter().peekable();
    for candidate in &mut found {
        let key = candidate.relation.key();
        while known.next_if(|(old, _)| **old < key).is_some() {}
        let known = known.peek().filter(|(old, _)| **old == key).map(|(_, relation)| relation.evidence);
        if let Some(at) = blocked(graph, candidate, &container_of, line_of_sight, config) {
            candidate.relation.evidence.verdict = Verdict::Blocked(at);
        } else {
            ask(candidate, known, verify, config, &mut report);
        }
    }
    keep_nearest(&mut found, config.max_near);
    for mut candidate in between(&found, &standing, config) {
        let known = graph.relations.get(&candidate.relation.key()).map(|known| known.evidence);
        ask(&mut candidate, known, verify, config, &mut report);
        found.push(candidate);
    }
    found.sort_unstable_by_key(|candidate| candidate.relation.key());
    for candidate in &found {
        match candidate.relation.evidence.verdict {
            Verdict::Holds => report.holding += 1,
            Verdict::Blocked(_) => report.blocked += 1,
            Verdict::Rejected => report.rejected += 1,
        }
    }

    let ops = news(&graph.relations, found.iter().map(|candidate| &candidate.relation));
    report.revision = graph.apply(Op::Batch(ops))?.revision;
    Ok(report)
}

/// A relation that may hold, with its two ends at hand.
struct Candidate<'a> {
    relation: Relation,
    subject: &'a Object,
    object: &'a Object,
}

impl Candidate<'_> {
    fn is_near(&self) -> bool {
        self.relation.kind == RelationKind::Near && self.relation.evidence.verdict == Verdict::Holds
    }
}

/// The difference to what is known; what was stated stays. Both are in order, so one walk along both does it.
fn news<'a>(known: &BTreeMap<RelationKey, Relation>, now: impl Iterator<Item = &'a Relation>) -> Vec<Op> {
    let is_stated = |relation: &Relation| relation.evidence.source == EvidenceSource::Stated;
    let gone = |(key, old): (&RelationKey, &Relation)| (!is_stated(old)).then_some(Op::RemoveRelation(*key));
    let mut ops = Vec::new();
    let mut known = known.iter().peekable();
    for relation in now {
        let key = relation.key();
        while let Some(old) = known.next_if(|(old, _)| **old < key) {
            ops.extend(gone(old));
        }
        let same = known.next_if(|(old, _)| **old == key);
        if same.is_none_or(|(_, old)| !is_stated(old) && old != relation) {
            ops.push(Op::PutRelation(*relation));
        }
    }
    ops.extend(known.filter_map(gone));
    ops
}

/// Pairs of confirmed objects of one storey close enough for any relation, smaller id first, by a sweep along x.
fn neighbours<'a>(graph: &'a SceneGraph, config: &RelationConfig) -> Vec<(&'a Object, &'a Object)> {
    let reach_m = config.near_m + NEAR_HYSTERESIS_M;
    let storey_of: BTreeMap<RoomId, i32> = graph.rooms().map(|room| (room.id, room.floor)).collect();
    let storey = |object: &Object| object.room.and_then(|room| storey_of.get(&room).copied());
    // Who walks about is near everything once.
    let unmoving = graph.confirmed_objects().filter(|object| !object.is_dynamic());
    let mut sorted: Vec<(Option<i32>, &Object)> = unmoving.map(|object| (storey(object), object)).collect();
    sorted.sort_by(|(_, a), (_, b)| a.bounds.min.x.total_cmp(&b.bounds.min.x).then(a.id.cmp(&b.id)));
    let mut pairs = Vec::new();
    for (at, (storey_a, a)) in sorted.iter().enumerate() {
        for (storey_b, b) in sorted[at + 1..].iter().take_while(|(_, b)| b.bounds.min.x <= a.bounds.max.x + reach_m) {
            // A lamp hangs under a ceiling, not under the rug above it.
            let are_apart = matches!((storey_a, storey_b), (Some(a), Some(b)) if a != b);
            if !are_apart && a.bounds.horizontal_gap_m(&b.bounds) <= reach_m {
                pairs.push(if a.id < b.id { (*a, *b) } else { (*b, *a) });
            }
        }
    }
    pairs
}

/// A near relation that is known may stretch this much before it goes.
const NEAR_HYSTERESIS_M: f64 = 0.1;

/// What the boxes of a pair suggest: one contact or vertical relation in either direction, otherwise near.
fn candidates<'a>(
    graph: &SceneGraph,
    a: &'a Object,
    b: &'a Object,
    standing: &Standing,
    config: &RelationConfig,
    found: &mut Vec<Candidate<'a>>,
) {
    let gap_m = a.bounds.gap_m(&b.bounds);
    let evidence =
        Evidence { verdict: Verdict::Holds, source: EvidenceSource::Geometry, distance_m: rounded(gap_m), score: 1.0 };
    let candidate = |subject: &'a Object, kind, object: &'a Object| Candidate {
        relation: Relation { subject: subject.id, kind, object: object.id, other: None, evidence },
        subject,
        object,
    };
    let are_in_two_rooms = matches!((a.room, b.room), (Some(a), Some(b)) if a != b);
    let directions = if are_in_two_rooms { &[][..] } else { &[(a, b), (b, a)] };
    for &(subject, object) in directions {
        match standing.carrier_of.get(&subject.id) {
            Some((kind, carrier)) if *carrier == object.id => return found.push(candidate(subject, *kind, object)),
            _ => {}
        }
        if contact(subject, object, config) == Some(RelationKind::Under) {
            return found.push(candidate(subject, RelationKind::Under, object));
        }
    }
    for &(subject, object) in directions {
        // What is carried begins at the top that carries it.
        let carrier = standing.carrier_of.get(&subject.id).and_then(|(_, carrier)| graph.object(*carrier));
        let bottom_m = carrier.map_or(subject.bounds.min.z, |o| o.bounds.max.z.min(subject.bounds.min.z));
        if is_above(subject, bottom_m, object, config) {
            found.push(candidate(subject, RelationKind::Above, object));
            found.push(candidate(object, RelationKind::Under, subject));
        }
    }
    let near = candidate(a, RelationKind::Near, b);
    let known = || graph.relations.get(&near.relation.key());
    let is_known = || known().is_some_and(|known| known.evidence.verdict == Verdict::Holds);
    if gap_m <= config.near_m || (gap_m <= config.near_m + NEAR_HYSTERESIS_M && is_known()) {
        found.push(near);
    }
}

/// Gaps are stored to the decimetre: boxes breathe by centimetres with every frame, and that is no news.
fn rounded(gap_m: f64) -> f64 {
    (gap_m * 10.0).round() / 10.0
}

/// OmniVLN Eq. 6 for what is only near: the point that blocks it.
///
/// A thing does not hide itself, so the line begins a margin beside it; but the side of the shelf that it stands in may be nearer
/// than that, and hides it from all that is not in the shelf as well.
fn blocked(
    graph: &SceneGraph,
    candidate: &Candidate,
    container_of: &BTreeMap<ObjectId, ObjectId>,
    line_of_sight: SightLine,
    config: &RelationConfig,
) -> Option<Point3<f64>> {
    const IN_A_SHELF_M: f64 = 0.05;
    if candidate.relation.kind != RelationKind::Near {
        return None;
    }
    let (a, b) = (candidate.subject, candidate.object);
    let (within_a, within_b) = (container_of.get(&a.id), container_of.get(&b.id));
    let margin_m = |within: Option<&ObjectId>| match within {
        Some(_) if within_a != within_b => IN_A_SHELF_M.min(config.sight_margin_m),
        _ => config.sight_margin_m,
    };
    let margins = (margin_m(within_a), margin_m(within_b));
    parting_wall(graph, a, b).or_else(|| blocking_point(a, b, line_of_sight, margins, config))
}

/// OmniVLN Eq. 7: short relations are shown to the verifier, once.
fn ask(
    candidate: &mut Candidate,
    known: Option<Evidence>,
    verify: &dyn Fn(&Object, &Object, RelationKind) -> f64,
    config: &RelationConfig,
    report: &mut RelationReport,
) {
    let Candidate { relation, subject, object } = candidate;
    let evidence = &mut relation.evidence;
    if evidence.distance_m >= config.verify_within_m {
        return;
    }
    evidence.source = EvidenceSource::Verifier;
    evidence.score = match known {
        Some(known) if known.source == EvidenceSource::Verifier => known.score,
        _ => {
            report.asked += 1;
            let score = verify(subject, object, relation.kind);
            if score.is_finite() { score.clamp(0.0, 1.0) } else { 0.0 }
        }
    };
    if evidence.score <= config.verify_threshold {
        evidence.verdict = Verdict::Rejected;
    }
}

/// Keeps a near relation if it is among the nearest of either end; what was dropped takes nobody's place.
fn keep_nearest(candidates: &mut Vec<Candidate>, max_near: usize) {
    let near = candidates.iter().enumerate().filter(|(_, candidate)| candidate.is_near());
    let mut ends: Vec<(ObjectId, f64, usize)> = near
        .flat_map(|(at, Candidate { relation, .. })| {
            [relation.subject, relation.object].map(|id| (id, relation.evidence.distance_m, at))
        })
        .collect();
    ends.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut is_kept: Vec<bool> = candidates.iter().map(|candidate| !candidate.is_near()).collect();
    for of_one in ends.chunk_by(|a, b| a.0 == b.0) {
        of_one.iter().take(max_near).for_each(|(_, _, at)| is_kept[*at] = true);
    }
    let mut kept = is_kept.into_iter();
    candidates.retain(|_| kept.next() == Some(true));
}

/// Things that stand between two others they are near to: the angle between the two is at least 150 degrees. At most two per
/// subject, the closest. All three stand on the same: on the floor, or on one table; a mug is not between chair and wall. Middles are
/// measured to [`HERE_M`], so the angle has to be larger by what that makes.
fn between<'a>(candidates: &[Candidate<'a>], standing: &Standing, config: &RelationConfig) -> Vec<Candidate<'a>> {
    const OPPOSITE_RAD: f64 = 150.0 * std::f64::consts::PI / 180.0;
    const HEIGHT_M: f64 = 0.6;
    const HERE_M: f64 = 0.05;
    let carrier_of = |object: &Object| standing.carrier_of.get(&object.id).map(|(_, carrier)| *carrier);
    let is_floating = |object: &Object| standing.floating.contains(&object.id);
    let near = candidates.iter().filter(|candidate| candidate.is_near());
    let mut ends: Vec<(&Object, &Object)> =
        near.flat_map(|near| [(near.subject, near.object), (near.object, near.subject)]).collect();
    ends.sort_unstable_by_key(|(subject, other)| (subject.id, other.id));
    let mut found = Vec::new();
    let mut around: Vec<(&Object, Vector2<f64>, f64)> = Vec::new();
    let mut of_subject: Vec<(f64, Candidate)> = Vec::new();
    for of_one in ends.chunk_by(|a, b| a.0.id == b.0.id) {
        let subject = of_one[0].0;
        around.clear();
        around.extend(of_one.iter().filter_map(|(_, other)| {
            let to = other.centroid - subject.centroid;
            let distance_m = to.xy().norm();
            let is_level = to.z.abs() <= HEIGHT_M && carrier_of(subject) == carrier_of(other);
            (is_level && !is_floating(subject) && !is_floating(other) && distance_m > HERE_M).then_some((
                *other,
                to.xy(),
                distance_m,
            ))
        }));
        for (at, (a, to_a, distance_a)) in around.iter().enumerate() {
            for (b, to_b, distance_b) in &around[at + 1..] {
                let span_m = distance_a + distance_b;
                let unsure_rad = HERE_M / distance_a + HERE_M / distance_b;
                let is_opposite = to_a.angle(to_b) >= OPPOSITE_RAD + unsure_rad;
                if is_opposite && span_m <= config.between_m {
                    let evidence = Evidence {
                        verdict: Verdict::Holds,
                        source: EvidenceSource::Geometry,
                        distance_m: rounded(a.bounds.gap_m(&subject.bounds).max(b.bounds.gap_m(&subject.bounds))),
                        score: 1.0,
                    };
                    let (kind, other) = (RelationKind::Between, Some(b.id));
                    let relation = Relation { subject: subject.id, kind, object: a.id, other, evidence };
                    of_subject.push((span_m, Candidate { relation, subject, object: a }));
                }
            }
        }
        of_subject.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.relation.key().cmp(&b.1.relation.key())));
        found.extend(of_subject.drain(..).take(2).map(|(_, candidate)| candidate));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Aabb;
    use crate::room::Room;
    use nalgebra::Vector3;

    fn scene(things: &[(&str, [f64; 3], [f64; 3])]) -> SceneGraph {
        let mut graph = SceneGraph::new();
        for (at, (label, center, sides)) in things.iter().enumerate() {
            let bounds = Aabb::from_center(Point3::from(*center), Vector3::from(*sides));
            let object = Object::new(ObjectId(at as u64 + 1), label, bounds);
            graph.apply(Op::PutObject(Box::new(object))).unwrap();
        }
        graph
    }

    fn found(graph: &SceneGraph) -> Vec<String> {
        graph
            .relations()
            .map(|r| {
                let other = r.other.map(|o| format!(" {o}")).unwrap_or_default();
                format!("{} {} {}{other}", r.subject, r.kind, r.object)
            })
            .collect()
    }

    fn clear(_: &Point3<f64>, _: &Point3<f64>) -> Option<Point3<f64>> {
        None
    }

    fn yes(_: &Object, _: &Object, _: RelationKind) -> f64 {
        1.0
    }

    #[test]
    fn on_under_inside_above_of_plain_boxes() {
        let mut graph = scene(&[
            ("table", [0.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
            ("mug", [0.3, 0.0, 0.80], [0.08, 0.08, 0.10]),
            ("trash can", [0.2, 0.1, 0.15], [0.3, 0.3, 0.3]),
            ("bookshelf", [5.0, 0.0, 1.0], [0.4, 1.0, 2.0]),
            ("vase", [5.0, 0.2, 0.9], [0.15, 0.15, 0.2]),
            ("sofa", [10.0, 0.0, 0.4], [0.9, 2.0, 0.8]),
            ("picture", [10.55, 0.0, 1.5], [0.04, 0.6, 0.5]),
            ("pillow", [10.0, 0.5, 0.55], [0.3, 0.4, 0.2]),
        ]);
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        let found = found(&graph);
        for expected in ["O2 on O1", "O3 under O1", "O5 inside O4", "O7 above O6", "O6 under O7", "O8 on O6"] {
            assert!(found.contains(&expected.to_owned()), "{expected} in {found:?}");
        }
        graph.check_invariants().unwrap();
    }

    #[test]
    fn between_two_chairs() {
        let side = [0.5, 0.5, 0.9];
        let mut graph = scene(&[
            ("chair", [0.0, 0.0, 0.45], side),
            ("lamp", [1.0, 0.05, 0.45], [0.2, 0.2, 0.9]),
            ("chair", [2.0, 0.0, 0.45], side),
        ]);
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        assert!(found(&graph).contains(&"O2 between O1 O3".to_owned()), "{:?}", found(&graph));
    }

    #[test]
    fn between_is_said_of_things_that_stand_on_the_same() {
        let mut graph = scene(&[
            ("desk", [0.0, 0.0, 0.35], [1.8, 0.8, 0.7]),
            ("laptop", [-0.6, 0.0, 0.8], [0.3, 0.3, 0.2]),
            ("mug", [0.0, 0.0, 0.75], [0.1, 0.1, 0.1]),
            ("lamp", [0.6, 0.0, 0.9], [0.2, 0.2, 0.4]),
            ("chair", [0.0, -0.7, 0.45], [0.5, 0.5, 0.9]),
            ("radiator", [0.0, 0.7, 0.45], [0.8, 0.1, 0.6]),
        ]);
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).unwrap();
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        let found = found(&graph);
        let between: Vec<&String> = found.iter().filter(|relation| relation.contains("between")).collect();
        assert_eq!(between, ["O1 between O5 O6", "O3 between O2 O4"], "the mug is not between chair and radiator");
    }

    #[test]
    fn eq_6_a_wall_prunes_and_is_kept_as_evidence() {
        let mut graph =
            scene(&[("chair", [-0.5, 0.0, 0.45], [0.5, 0.5, 0.9]), ("plant", [0.5, 0.0, 0.45], [0.3, 0.3, 0.9])]);
        let wall = |a: &Point3<f64>, b: &Point3<f64>| (a.x * b.x < 0.0).then(|| a + (b - a) * (a.x / (a.x - b.x)));
        let report = update_relations(&mut graph, &wall, &yes, &RelationConfig::default()).unwrap();
        assert_eq!((report.holding, report.blocked), (0, 1));
        assert_eq!(graph.relations().count(), 0);
        let dropped = graph.dropped_relations().next().unwrap();
        assert!(matches!(dropped.evidence.verdict, Verdict::Blocked(at) if at.x.abs() < 1e-12));
    }

    #[test]
    fn a_thin_wall_parts_two_rooms_and_a_doorway_joins_them() {
        use crate::room::RoomEdge;
        let mut graph = scene(&[
            ("picture", [-0.08, 0.0, 1.5], [0.04, 0.6, 0.5]),
            ("cabinet", [0.35, 0.0, 0.6], [0.5, 0.5, 1.2]),
            ("plant", [-0.3, 2.0, 0.4], [0.3, 0.3, 0.8]),
            ("box", [0.3, 2.0, 0.2], [0.3, 0.3, 0.4]),
        ]);
        for room in [1, 2] {
            graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(room), Point3::origin())))).unwrap();
        }
        for (id, room) in [(1, 1), (2, 2), (3, 1), (4, 2)] {
            let object = graph.object(ObjectId(id)).unwrap().clone();
            graph.apply(Op::PutObject(Box::new(Object { room: Some(RoomId(room)), ..object }))).unwrap();
        }
        let door = RoomEdge { a: RoomId(1), b: RoomId(2), doorway: Point3::new(0.0, 2.0, 1.0), width_m: 1.0 };
        graph.apply(Op::PutRoomEdge(door)).unwrap();
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        assert_eq!(found(&graph), ["O3 near O4"], "not through the wall, and nothing hangs over what is behind it");
    }

    #[test]
    fn a_monitor_on_a_desk_is_not_over_its_keyboard() {
        let mut graph = scene(&[
            ("desk", [0.0, 0.0, 0.37], [1.4, 0.8, 0.74]),
            ("monitor", [0.0, 0.1, 1.15], [0.5, 0.3, 0.4]),
            ("keyboard", [0.0, -0.1, 0.76], [0.4, 0.15, 0.03]),
        ]);
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).unwrap();
        for id in 1..=3 {
            let object = graph.object(ObjectId(id)).unwrap().clone();
            graph.apply(Op::PutObject(Box::new(Object { room: Some(RoomId(1)), ..object }))).unwrap();
        }
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        assert_eq!(found(&graph), ["O2 near O3", "O2 on O1", "O3 on O1"]);
    }

    #[test]
    fn the_side_of_a_shelf_hides_what_stands_in_it() {
        let mut graph = scene(&[
            ("bookshelf", [0.0, 0.0, 1.0], [1.0, 0.4, 2.0]),
            ("book", [-0.4, 0.0, 1.0], [0.06, 0.2, 0.3]),
            ("book", [0.0, 0.0, 1.0], [0.06, 0.2, 0.3]),
            ("lamp", [-0.9, 0.0, 0.8], [0.3, 0.3, 1.6]),
            ("vase", [-0.2, 0.0, 1.0], [0.06, 0.2, 0.3]),
        ]);
        // Its left side stands 7 cm beside the first book, a partition as far on the other side of it.
        let side = |a: &Point3<f64>, b: &Point3<f64>| {
            let shares = [-0.5, -0.3].map(|x| (x - a.x) / (b.x - a.x));
            shares.into_iter().find(|share| (0.0..=1.0).contains(share)).map(|share| a + (b - a) * share)
        };
        update_relations(&mut graph, &side, &yes, &RelationConfig::default()).unwrap();
        let found = found(&graph);
        assert!(!found.contains(&"O2 near O4".to_owned()), "{found:?}");
        assert!(found.contains(&"O2 near O5".to_owned()), "what is in one shelf is together: {found:?}");
    }

    #[test]
    fn a_table_top_does_not_part_what_stands_on_it() {
        let mut graph =
            scene(&[("mug", [0.0, 0.0, 0.80], [0.08, 0.08, 0.10]), ("sink", [0.8, 0.0, 0.70], [0.5, 0.4, 0.2])]);
        // The counter's surface at 0.75 m, and nothing else.
        let counter =
            |a: &Point3<f64>, b: &Point3<f64>| ((a.z - 0.75) * (b.z - 0.75) <= 0.0).then(|| nalgebra::center(a, b));
        update_relations(&mut graph, &counter, &yes, &RelationConfig::default()).unwrap();
        assert_eq!(found(&graph), ["O1 near O2"]);
    }

    #[test]
    fn eq_7_the_verifier_is_asked_once_and_obeyed() {
        let mut graph =
            scene(&[("chair", [0.0, 0.0, 0.45], [0.5, 0.5, 0.9]), ("plant", [0.8, 0.0, 0.45], [0.3, 0.3, 0.9])]);
        let config = RelationConfig::default();
        let no = |_: &Object, _: &Object, _: RelationKind| 0.5;
        let report = update_relations(&mut graph, &clear, &no, &config).unwrap();
        assert_eq!((report.asked, report.rejected, report.holding), (1, 1, 0));
        let revision = graph.revision();
        let report = update_relations(&mut graph, &clear, &yes, &config).unwrap();
        assert_eq!((report.asked, report.rejected), (0, 1));
        assert_eq!(graph.revision(), revision, "nothing new");
    }

    #[test]
    fn eq_7_each_of_many_is_asked_about_once_and_a_new_one_is_asked_about() {
        let box_at = |x: f64| ("box", [x, 0.0, 0.2], [0.3, 0.3, 0.4]);
        let mut graph = scene(&[box_at(0.0), box_at(0.7), box_at(1.4), box_at(2.1)]);
        let config = RelationConfig::default();
        let first = update_relations(&mut graph, &clear, &yes, &config).unwrap();
        assert!(first.asked >= 5, "three near, two between: {first:?}");
        assert_eq!(update_relations(&mut graph, &clear, &yes, &config).unwrap().asked, 0);
        let bounds = Aabb::from_center(Point3::new(-0.7, 0.0, 0.2), Vector3::new(0.3, 0.3, 0.4));
        graph.apply(Op::PutObject(Box::new(Object::new(ObjectId(9), "box", bounds)))).unwrap();
        let again = update_relations(&mut graph, &clear, &yes, &config).unwrap();
        assert!((1..=3).contains(&again.asked), "{again:?}");
    }

    #[test]
    fn stated_relations_stay() {
        let mut graph = scene(&[("chair", [0.0, 0.0, 0.0], [0.5; 3]), ("plant", [9.0, 0.0, 0.0], [0.5; 3])]);
        let evidence =
            Evidence { verdict: Verdict::Holds, source: EvidenceSource::Stated, distance_m: 8.5, score: 1.0 };
        let relation =
            Relation { subject: ObjectId(1), kind: RelationKind::Near, object: ObjectId(2), other: None, evidence };
        graph.apply(Op::PutRelation(relation)).unwrap();
        update_relations(&mut graph, &clear, &yes, &RelationConfig::default()).unwrap();
        assert_eq!(graph.relations().count(), 1);
    }
}
