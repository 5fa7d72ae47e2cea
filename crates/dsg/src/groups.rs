//! Functional groups: objects of a room that are near each other and used together.
//!
//! Affinity of two objects: `c exp(-gap / 0.8 m)`, c in [0, 1] being how well their classes go together (1 also if one stands on
//! the other): what merely stands close by is not used together. Pairs above 0.35 are joined, best first, while the group stays
//! within 5 m across and has one centre: two desks side by side are two places to work, each with what is nearer to it; only
//! kitchen units that touch make one row. A pair that is in one group already gets 0.1 more, so that groups do not flicker.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use crate::bounds::Aabb;
use crate::co_occurrence::{Shares, is_center, is_row_unit, rank, shares, together};
use crate::graph::SceneGraph;
use crate::group::Group;
use crate::ids::{GroupId, ObjectId};
use crate::object::Object;
use crate::op::{ConfigError, Op, OpError};
use crate::relation::RelationKind;

/// What makes a group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupConfig {
    /// Largest gap between the boxes of a joined pair. Default 1.5 m.
    pub reach_m: f64,
    /// Length over which affinity falls to 1/e. Default 0.8 m.
    pub decay_m: f64,
    /// Affinity above which a pair is joined. Default 0.35.
    pub min_affinity: f64,
    /// What a pair of one group gets on top. Default 0.1.
    pub hysteresis: f64,
    /// Largest horizontal extent of a group: a conference table with its chairs has it. Default 5.0 m.
    pub max_extent_m: f64,
}

impl Default for GroupConfig {
    fn default() -> GroupConfig {
        GroupConfig { reach_m: 1.5, decay_m: 0.8, min_affinity: 0.35, hysteresis: 0.1, max_extent_m: 5.0 }
    }
}

impl GroupConfig {
    /// Checks the ranges.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for (field, value) in [
            ("reach_m", self.reach_m),
            ("decay_m", self.decay_m),
            ("min_affinity", self.min_affinity),
            ("max_extent_m", self.max_extent_m),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(ConfigError { field, rule: "positive and finite" });
            }
        }
        if !(self.hysteresis >= 0.0 && self.hysteresis.is_finite()) {
            return Err(ConfigError { field: "hysteresis", rule: "finite and not negative" });
        }
        Ok(())
    }
}

/// Recomputes the groups of confirmed, unmoving objects, room by room. A group keeps its id while most of its members stay.
/// One batch; no revision if nothing changed.
///
/// # Errors
/// A bad configuration.
pub fn update_groups(graph: &mut SceneGraph, config: &GroupConfig) -> Result<u64, OpError> {
    config.validate()?;
    let clusters = clusters(graph, config);
    let ids = identify(graph, &clusters);
    let mut ranks: BTreeMap<String, u32> = BTreeMap::new();
    let mut rank_of = |label: &str| match ranks.get(label) {
        Some(rank) => *rank,
        None => *ranks.entry(label.to_owned()).or_insert_with(|| rank(label)),
    };
    let mut groups: Vec<Group> =
        clusters.iter().zip(&ids).map(|(members, id)| describe(graph, members, *id, &mut rank_of)).collect();
    name_groups(graph, &mut groups);
    let gone = graph.groups().map(|group| group.id).filter(|id| !ids.contains(id));
    let mut ops: Vec<Op> = gone.map(Op::RemoveGroup).collect();
    // Members that change group leave first, so that no group is put with a member it loses again.
    for group in &groups {
        if graph.group(group.id).is_some_and(|known| known.members != group.members) {
            ops.push(Op::RemoveGroup(group.id));
        }
    }
    let is_news = |group: &Group| graph.group(group.id) != Some(group);
    ops.extend(groups.into_iter().filter(is_news).map(|group| Op::PutGroup(Box::new(group))));
    Ok(graph.apply(Op::Batch(ops))?.revision)
}

fn clusters(graph: &SceneGraph, config: &GroupConfig) -> Vec<BTreeSet<ObjectId>> {
    let objects: Vec<&Object> =
        graph.confirmed_objects().filter(|object| object.room.is_some() && !object.is_dynamic()).collect();
    // There are far fewer classes than objects, and far fewer objects than pairs.
    let mut of_label: BTreeMap<&str, Shares> = BTreeMap::new();
    for object in &objects {
        of_label.entry(&object.label).or_insert_with(|| shares(&object.label));
    }
    let shares_of: Vec<&Shares> = objects.iter().map(|object| &of_label[&*object.label]).collect();
    let carried = carried(graph);
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    let mut order: Vec<usize> = (0..objects.len()).collect();
    // Room by room, and there along x.
    let key = |i: usize| (objects[i].room, objects[i].bounds.min.x);
    order.sort_by(|a, b| key(*a).0.cmp(&key(*b).0).then(key(*a).1.total_cmp(&key(*b).1)).then(a.cmp(b)));
    for (at, &i) in order.iter().enumerate() {
        let reach = objects[i].bounds.max.x + config.reach_m;
        let is_near = |j: usize| objects[j].room == objects[i].room && objects[j].bounds.min.x <= reach;
        for &j in order[at + 1..].iter().take_while(|&&j| is_near(j)) {
            let (a, b) = (objects[i], objects[j]);
            let is_carried = || carried.contains(&(a.id.min(b.id), a.id.max(b.id)));
            let together = || if is_carried() { 1.0 } else { together(shares_of[i], shares_of[j]) };
            let affinity = affinity(a, b, together, config);
            if affinity > config.min_affinity {
                pairs.push((affinity, i.min(j), i.max(j)));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));

    let mut cluster_of: Vec<usize> = (0..objects.len()).collect();
    let mut clusters: Vec<(Aabb, BTreeSet<ObjectId>)> =
        objects.iter().map(|object| (object.bounds, BTreeSet::from([object.id]))).collect();
    let mut has_center: Vec<bool> = objects.iter().map(|object| is_center(&object.label)).collect();
    for (_, i, j) in pairs {
        let (a, b) = (cluster_of[i].min(cluster_of[j]), cluster_of[i].max(cluster_of[j]));
        if a == b {
            continue;
        }
        let joined = clusters[a].0.union(&clusters[b].0);
        let sides = joined.sides_m();
        let is_one_row = is_row(objects[i], objects[j]);
        let is_one_place = is_one_row || !(has_center[a] && has_center[b]);
        if is_one_place && sides.x.hypot(sides.y) <= config.max_extent_m {
            has_center[a] |= has_center[b];
            let members = std::mem::take(&mut clusters[b].1);
            clusters[a].0 = joined;
            clusters[a].1.extend(members);
            cluster_of.iter_mut().filter(|cluster| **cluster == b).for_each(|cluster| *cluster = a);
        }
    }
    clusters.into_iter().map(|(_, members)| members).filter(|members| members.len() >= 2).collect()
}

/// Kitchen units side by side.
fn is_row(a: &Object, b: &Object) -> bool {
    // They touch; their faces are measured to a voxel or two.
    const TOUCHING_M: f64 = 0.15;
    is_row_unit(&a.label) && is_row_unit(&b.label) && a.bounds.gap_m(&b.bounds) <= TOUCHING_M
}

/// Pairs of which one stands on or in the other, smaller id first.
fn carried(graph: &SceneGraph) -> BTreeSet<(ObjectId, ObjectId)> {
    let carries = |kind| matches!(kind, RelationKind::On | RelationKind::Inside);
    let holding = graph.relations().filter(|relation| carries(relation.kind));
    holding.map(|relation| (relation.subject.min(relation.object), relation.subject.max(relation.object))).collect()
}

/// The affinity of two things of one room, of which `together` says how well they go together.
fn affinity(a: &Object, b: &Object, together: impl Fn() -> f64, config: &GroupConfig) -> f64 {
    let gap_m = a.bounds.gap_m(&b.bounds);
    if gap_m > config.reach_m {
        return 0.0;
    }
    let together = together();
    let stays = if a.group.is_some() && a.group == b.group { config.hysteresis } else { 0.0 };
    if together == 0.0 { 0.0 } else { (-gap_m / config.decay_m).exp() * together + stays }
}

/// The old group with the largest Jaccard overlap above 0.3, otherwise a new id.
fn identify(graph: &SceneGraph, clusters: &[BTreeSet<ObjectId>]) -> Vec<GroupId> {
    let mut overlaps: Vec<(f64, GroupId, usize)> = Vec::new();
    let cluster_of: BTreeMap<ObjectId, usize> =
        clusters.iter().enumerate().flat_map(|(at, members)| members.iter().map(move |member| (*member, at))).collect();
    for group in graph.groups() {
        let mut common_with: BTreeMap<usize, f64> = BTreeMap::new();
        for at in group.members.iter().filter_map(|member| cluster_of.get(member)) {
            *common_with.entry(*at).or_default() += 1.0;
        }
        for (at, common) in common_with {
            let jaccard = common / (group.members.len() as f64 + clusters[at].len() as f64 - common);
            if jaccard > 0.3 {
                overlaps.push((jaccard, group.id, at));
            }
        }
    }
    overlaps.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut ids: Vec<Option<GroupId>> = vec![None; clusters.len()];
    for (_, group, at) in overlaps {
        if ids[at].is_none() && !ids.contains(&Some(group)) {
            ids[at] = Some(group);
        }
    }
    let mut next = graph.next_group_id();
    let fresh = |id: Option<GroupId>| {
        id.unwrap_or_else(|| {
            next.0 += 1;
            GroupId(next.0 - 1)
        })
    };
    ids.into_iter().map(fresh).collect()
}

fn describe(
    graph: &SceneGraph,
    members: &BTreeSet<ObjectId>,
    id: GroupId,
    rank_of: &mut impl FnMut(&str) -> u32,
) -> Group {
    let objects: Vec<&Object> = members.iter().filter_map(|member| graph.object(*member)).collect();
    // The support as it was wins among equals of rank: volumes breathe.
    let known = graph.group(id).and_then(|group| group.support);
    let mut key = |object: &&Object| (rank_of(&object.label), known == Some(object.id), object.bounds.volume_m3());
    let keyed = objects.iter().copied().map(|object| (key(&object), object));
    let best = keyed.max_by(|((rank_a, known_a, volume_a), a), ((rank_b, known_b, volume_b), b)| {
        (rank_a, known_a).cmp(&(rank_b, known_b)).then(volume_a.total_cmp(volume_b)).then(b.id.cmp(&a.id))
    });
    let support = best.map(|(_, object)| object);
    let sum: Vector3<f64> = objects.iter().map(|object| object.centroid.coords).sum();
    let center = sum / objects.len().max(1) as f64;
    Group {
        id,
        name: support.map_or_else(String::new, |support| support.label.clone()) + " group",
        support: support.map(|support| support.id),
        members: members.iter().copied().collect(),
        room: objects.first().and_then(|object| object.room),
        // To the centimetre: boxes breathe, and that is no news.
        center: center.map(|x| (x * 100.0).round() / 100.0).into(),
    }
}

/// Makes names unique: the group that has a name keeps it, others are numbered.
fn name_groups(graph: &SceneGraph, groups: &mut [Group]) {
    let mut taken: BTreeSet<String> = BTreeSet::new();
    let mut by_id: BTreeMap<GroupId, usize> = groups.iter().enumerate().map(|(at, group)| (group.id, at)).collect();
    by_id.retain(|id, at| {
        let base = &groups[*at].name;
        let old = graph.group(*id).map(|known| known.name.clone());
        match old.filter(|old| crate::rooms::is_numbered(old, base) && taken.insert(old.clone())) {
            Some(old) => {
                groups[*at].name = old;
                false
            }
            None => true,
        }
    });
    for at in by_id.into_values() {
        let base = groups[at].name.clone();
        let mut name = base.clone();
        let mut number = 1;
        while !taken.insert(name.clone()) {
            number += 1;
            name = format!("{base} {number}");
        }
        groups[at].name = name;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::ids::RoomId;
    use crate::room::Room;

    fn scene(things: &[(&str, f64, f64)]) -> SceneGraph {
        let mut graph = SceneGraph::new();
        graph.apply(Op::PutRoom(Box::new(Room::new(RoomId(1), Point3::origin())))).unwrap();
        for (at, (label, x, y)) in things.iter().enumerate() {
            put(&mut graph, at as u64 + 1, label, *x, *y);
        }
        graph
    }

    fn put(graph: &mut SceneGraph, id: u64, label: &str, x: f64, y: f64) {
        let bounds = Aabb::from_center(Point3::new(x, y, 0.4), Vector3::new(0.5, 0.5, 0.8));
        let object = Object { room: Some(RoomId(1)), ..Object::new(ObjectId(id), label, bounds) };
        graph.apply(Op::PutObject(Box::new(object))).unwrap();
    }

    #[test]
    fn chairs_join_their_table_and_a_far_shelf_does_not() {
        let mut graph =
            scene(&[("chair", 0.7, 0.0), ("dining table", 0.0, 0.0), ("chair", -0.7, 0.0), ("bookshelf", 3.0, 3.0)]);
        update_groups(&mut graph, &GroupConfig::default()).unwrap();
        let groups: Vec<&Group> = graph.groups().collect();
        assert_eq!(groups.len(), 1);
        assert_eq!(groups[0].name, "dining table group");
        assert_eq!(groups[0].members, [ObjectId(1), ObjectId(2), ObjectId(3)]);
        assert_eq!(graph.object(ObjectId(4)).unwrap().group, None);
        graph.check_invariants().unwrap();
        let revision = graph.revision();
        update_groups(&mut graph, &GroupConfig::default()).unwrap();
        assert_eq!(graph.revision(), revision);
    }

    #[test]
    fn a_member_that_moves_a_little_stays_and_the_id_survives() {
        // Desk and chair, affinity 1: exp(-gap / 0.8) is 0.35 at a gap of 0.84 m, with hysteresis 0.25 at 1.11 m.
        let config = GroupConfig::default();
        let mut graph = scene(&[("desk", 0.0, 0.0), ("office chair", 1.2, 0.0), ("monitor", 0.0, 0.6)]);
        update_groups(&mut graph, &config).unwrap();
        let id = graph.groups().next().unwrap().id;
        assert_eq!(graph.group(id).unwrap().members.len(), 3);
        put(&mut graph, 2, "office chair", 1.4, 0.0);
        update_groups(&mut graph, &config).unwrap();
        assert_eq!(graph.group(id).unwrap().members.len(), 3, "hysteresis");
        put(&mut graph, 2, "office chair", 3.4, 0.0);
        update_groups(&mut graph, &config).unwrap();
        assert_eq!(graph.group(id).unwrap().members, [ObjectId(1), ObjectId(3)]);
        graph.check_invariants().unwrap();
    }

    #[test]
    fn what_merely_stands_close_by_does_not_join_and_two_desks_stay_two() {
        let mut graph = scene(&[
            ("desk", 0.0, 0.0),
            ("monitor", 0.0, 0.5),
            ("desk", 0.6, 0.0),
            ("monitor", 0.6, 0.5),
            ("plant", 0.0, -0.6),
        ]);
        update_groups(&mut graph, &GroupConfig::default()).unwrap();
        let members: Vec<_> = graph.groups().map(|group| group.members.clone()).collect();
        assert_eq!(members, [[ObjectId(1), ObjectId(2)], [ObjectId(3), ObjectId(4)]]);
        // Kitchen units that touch are one row.
        let mut graph =
            scene(&[("counter", 0.0, 0.0), ("sink", 0.55, 0.0), ("stove", 1.1, 0.0), ("counter", 2.0, 0.0)]);
        update_groups(&mut graph, &GroupConfig::default()).unwrap();
        let members: Vec<_> = graph.groups().map(|group| group.members.clone()).collect();
        assert_eq!(members, [[ObjectId(1), ObjectId(2), ObjectId(3)]]);
    }

    #[test]
    fn two_desks_have_two_names() {
        let mut graph = scene(&[("desk", 0.0, 0.0), ("monitor", 0.0, 0.6), ("desk", 6.0, 0.0), ("monitor", 6.0, 0.6)]);
        update_groups(&mut graph, &GroupConfig::default()).unwrap();
        let names: Vec<&str> = graph.groups().map(|group| group.name.as_str()).collect();
        assert_eq!(names, ["desk group", "desk group 2"]);
    }
}
