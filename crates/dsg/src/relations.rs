//! Relations from boxes, pruned by the map (OmniVLN Eq. 6) and checked by a verifier (Eq. 7).

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::contact::{contact, is_above};
use crate::graph::SceneGraph;
use crate::ids::ObjectId;
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::relation::{Evidence, EvidenceSource, Relation, RelationKey, RelationKind, Verdict};
use crate::sight::{blocking_point, parting_wall};
use crate::support::supports;

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
    /// Ends of a line of sight are this far outside the boxes, so that a thing does not hide itself. Default 0.15 m.
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
    let mut found: Vec<(RelationKey, Relation)> = Vec::new();
    let carrier_of = supports(graph, config);
    for (a, b) in neighbours(graph, config) {
        for candidate in candidates(graph, a, b, &carrier_of, config) {
            let ends = if candidate.subject == a.id { (a, b) } else { (b, a) };
            let relation = judge(graph, candidate, ends, line_of_sight, verify, config, &mut report);
            found.push((relation.key(), relation));
        }
    }
    let mut relations: BTreeMap<RelationKey, Relation> = found.into_iter().collect();
    keep_nearest(&mut relations, config.max_near);
    for relation in between(graph, &relations, config) {
        if let (Some(a), Some(b)) = (graph.object(relation.subject), graph.object(relation.object)) {
            let relation = ask(graph, relation, (a, b), verify, config, &mut report);
            relations.insert(relation.key(), relation);
        }
    }
    for relation in relations.values() {
        match relation.evidence.verdict {
            Verdict::Holds => report.holding += 1,
            Verdict::Blocked(_) => report.blocked += 1,
            Verdict::Rejected => report.rejected += 1,
        }
    }

    let ops = news(&graph.relations, &relations);
    report.revision = graph.apply(Op::Batch(ops))?.revision;
    Ok(report)
}

/// The difference to what is known; what was stated stays. Both are in order, so one walk along both does it.
fn news(known: &BTreeMap<RelationKey, Relation>, now: &BTreeMap<RelationKey, Relation>) -> Vec<Op> {
    let is_stated = |relation: &Relation| relation.evidence.source == EvidenceSource::Stated;
    let gone = |(key, old): (&RelationKey, &Relation)| (!is_stated(old)).then_some(Op::RemoveRelation(*key));
    let mut ops = Vec::new();
    let mut known = known.iter().peekable();
    for (key, relation) in now {
        while let Some(old) = known.next_if(|(old, _)| *old < key) {
            ops.extend(gone(old));
        }
        let same = known.next_if(|(old, _)| *old == key);
        if same.is_none_or(|(_, old)| !is_stated(old) && old != relation) {
            ops.push(Op::PutRelation(*relation));
        }
    }
    ops.extend(known.filter_map(gone));
    ops
}

/// Pairs of confirmed objects close enough for any relation, smaller id first, by a sweep along x.
fn neighbours<'a>(graph: &'a SceneGraph, config: &RelationConfig) -> Vec<(&'a Object, &'a Object)> {
    let reach_m = config.near_m + NEAR_HYSTERESIS_M;
    // Who walks about is near everything once.
    let mut sorted: Vec<&Object> = graph.confirmed_objects().filter(|object| !object.is_dynamic()).collect();
    sorted.sort_by(|a, b| a.bounds.min.x.total_cmp(&b.bounds.min.x).then(a.id.cmp(&b.id)));
    let mut pairs = Vec::new();
    for (at, a) in sorted.iter().enumerate() {
        for b in sorted[at + 1..].iter().take_while(|b| b.bounds.min.x <= a.bounds.max.x + reach_m) {
            if a.bounds.horizontal_gap_m(&b.bounds) <= reach_m {
                pairs.push(if a.id < b.id { (*a, *b) } else { (*b, *a) });
            }
        }
    }
    pairs
}

/// A near relation that is known may stretch this much before it goes.
const NEAR_HYSTERESIS_M: f64 = 0.1;

/// What the boxes of a pair suggest: one contact or vertical relation in either direction, otherwise near.
fn candidates(
    graph: &SceneGraph,
    a: &Object,
    b: &Object,
    carrier_of: &BTreeMap<ObjectId, ObjectId>,
    config: &RelationConfig,
) -> Vec<Relation> {
    let gap_m = a.bounds.gap_m(&b.bounds);
    if are_on_two_floors(graph, a, b) {
        return Vec::new();
    }
    let relation = |subject: &Object, kind, object: &Object| Relation {
        subject: subject.id,
        kind,
        object: object.id,
        other: None,
        evidence: Evidence {
            verdict: Verdict::Holds,
            source: EvidenceSource::Geometry,
            distance_m: rounded(gap_m),
            score: 1.0,
        },
    };
    let are_in_two_rooms = matches!((a.room, b.room), (Some(a), Some(b)) if a != b);
    for (subject, object) in [(a, b), (b, a)].into_iter().filter(|_| !are_in_two_rooms) {
        if let Some(kind) = contact(subject, object, config) {
            return vec![relation(subject, kind, object)];
        }
        if carrier_of.get(&subject.id) == Some(&object.id) {
            return vec![relation(subject, RelationKind::On, object)];
        }
    }
    let mut found = Vec::new();
    for (subject, object) in [(a, b), (b, a)].into_iter().filter(|_| !are_in_two_rooms) {
        // What is carried begins at the top that carries it.
        let carrier = carrier_of.get(&subject.id).and_then(|carrier| graph.object(*carrier));
        let bottom_m = carrier.map_or(subject.bounds.min.z, |o| o.bounds.max.z.min(subject.bounds.min.z));
        if is_above(subject, bottom_m, object, config) {
            found.push(relation(subject, RelationKind::Above, object));
            found.push(relation(object, RelationKind::Under, subject));
        }
    }
    let near = relation(a, RelationKind::Near, b);
    let is_known = || graph.relations.get(&near.key()).is_some_and(|known| known.evidence.verdict == Verdict::Holds);
    if gap_m <= config.near_m || (gap_m <= config.near_m + NEAR_HYSTERESIS_M && is_known()) {
        found.push(near);
    }
    found
}

/// A lamp hangs under a ceiling, not under the rug above it.
fn are_on_two_floors(graph: &SceneGraph, a: &Object, b: &Object) -> bool {
    let floor = |object: &Object| object.room.and_then(|room| graph.room(room)).map(|room| room.floor);
    matches!((floor(a), floor(b)), (Some(a), Some(b)) if a != b)
}

/// Gaps are stored to the decimetre: boxes breathe by centimetres with every frame, and that is no news.
fn rounded(gap_m: f64) -> f64 {
    (gap_m * 10.0).round() / 10.0
}

/// Eq. 6, then Eq. 7.
fn judge(
    graph: &SceneGraph,
    mut relation: Relation,
    (a, b): (&Object, &Object),
    line_of_sight: SightLine,
    verify: &dyn Fn(&Object, &Object, RelationKind) -> f64,
    config: &RelationConfig,
    report: &mut RelationReport,
) -> Relation {
    if relation.kind == RelationKind::Near
        && let Some(at) = parting_wall(graph, a, b).or_else(|| blocking_point(a, b, line_of_sight, config))
    {
        relation.evidence.verdict = Verdict::Blocked(at);
        return relation;
    }
    ask(graph, relation, (a, b), verify, config, report)
}

/// OmniVLN Eq. 7: short relations are shown to the verifier, once.
fn ask(
    graph: &SceneGraph,
    mut relation: Relation,
    (a, b): (&Object, &Object),
    verify: &dyn Fn(&Object, &Object, RelationKind) -> f64,
    config: &RelationConfig,
    report: &mut RelationReport,
) -> Relation {
    if relation.evidence.distance_m >= config.verify_within_m {
        return relation;
    }
    let known = graph.relations.get(&relation.key()).map(|known| known.evidence);
    relation.evidence.source = EvidenceSource::Verifier;
    relation.evidence.score = match known {
        Some(known) if known.source == EvidenceSource::Verifier => known.score,
        _ => {
            report.asked += 1;
            let score = verify(a, b, relation.kind);
            if score.is_finite() { score.clamp(0.0, 1.0) } else { 0.0 }
        }
    };
    if relation.evidence.score <= config.verify_threshold {
        relation.evidence.verdict = Verdict::Rejected;
    }
    relation
}

/// Keeps a near relation if it is among the nearest of either end; what was dropped takes nobody's place.
fn keep_nearest(relations: &mut BTreeMap<RelationKey, Relation>, max_near: usize) {
    let mut of: BTreeMap<ObjectId, Vec<(f64, RelationKey)>> = BTreeMap::new();
    let is_near = |key: &RelationKey, relation: &Relation| {
        key.1 == RelationKind::Near && relation.evidence.verdict == Verdict::Holds
    };
    for (key, relation) in relations.iter().filter(|(key, relation)| is_near(key, relation)) {
        for id in [key.0, key.2] {
            of.entry(id).or_default().push((relation.evidence.distance_m, *key));
        }
    }
    let mut kept = std::collections::BTreeSet::new();
    for list in of.values_mut() {
        list.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        kept.extend(list.iter().take(max_near).map(|(_, key)| *key));
    }
    relations.retain(|key, relation| !is_near(key, relation) || kept.contains(key));
}

/// Things that stand between two others they are near to: the angle between the two is at least 150 degrees. At most two per
/// subject, the closest.
fn between(graph: &SceneGraph, relations: &BTreeMap<RelationKey, Relation>, config: &RelationConfig) -> Vec<Relation> {
    const COS_150_DEG: f64 = -0.866;
    const HEIGHT_M: f64 = 0.6;
    let mut near: BTreeMap<ObjectId, Vec<ObjectId>> = BTreeMap::new();
    for (key, relation) in relations {
        if key.1 == RelationKind::Near && relation.evidence.verdict == Verdict::Holds {
            near.entry(key.0).or_default().push(key.2);
            near.entry(key.2).or_default().push(key.0);
        }
    }
    let mut found = Vec::new();
    for (id, others) in &mut near {
        others.sort_unstable();
        let Some(subject) = graph.object(*id) else {
            continue;
        };
        let flat = |to: &Object| {
            let v = to.centroid - subject.centroid;
            Vector3::new(v.x, v.y, 0.0)
        };
        let ends: Vec<&Object> = others
            .iter()
            .filter_map(|other| graph.object(*other))
            .filter(|other| (other.centroid.z - subject.centroid.z).abs() <= HEIGHT_M)
            .collect();
        let mut of_subject = Vec::new();
        for (at, a) in ends.iter().enumerate() {
            for b in &ends[at + 1..] {
                let (to_a, to_b) = (flat(a), flat(b));
                let span_m = to_a.norm() + to_b.norm();
                let is_opposite = to_a.dot(&to_b) <= COS_150_DEG * to_a.norm() * to_b.norm();
                if is_opposite && to_a.norm() > 0.05 && to_b.norm() > 0.05 && span_m <= config.between_m {
                    let evidence = Evidence {
                        verdict: Verdict::Holds,
                        source: EvidenceSource::Geometry,
                        distance_m: rounded(a.bounds.gap_m(&subject.bounds).max(b.bounds.gap_m(&subject.bounds))),
                        score: 1.0,
                    };
                    let kind = RelationKind::Between;
                    let relation = Relation { subject: *id, kind, object: a.id, other: Some(b.id), evidence };
                    of_subject.push((span_m, relation));
                }
            }
        }
        of_subject.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.key().cmp(&b.1.key())));
        found.extend(of_subject.into_iter().take(2).map(|(_, relation)| relation));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::Aabb;

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
        use crate::ids::RoomId;
        use crate::room::{Room, RoomEdge};
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
        use crate::ids::RoomId;
        use crate::room::Room;
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
