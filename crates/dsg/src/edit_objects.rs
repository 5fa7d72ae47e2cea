//! Ops on objects, groups and relations, with their consequences.

use std::sync::Arc;

use crate::apply::Edit;
use crate::check::{check_object, check_point, check_range};
use crate::group::Group;
use crate::ids::{GroupId, ObjectId};
use crate::object::Object;
use crate::op::OpError;
use crate::presence;
use crate::relation::{Relation, RelationKey, Verdict};

impl Edit<'_> {
    pub(crate) fn put_object(&mut self, mut object: Object) -> Result<(), OpError> {
        check_object(&object)?;
        if let Some(room) = object.room {
            self.graph.room(room).ok_or(OpError::NoRoom(room))?;
        }
        if let Some(place) = object.place {
            self.graph.place(place).ok_or(OpError::NoPlace(place))?;
        }
        object.group = self.graph.object(object.id).and_then(|known| known.group);
        self.set_object(object.id, Some(Arc::new(object)));
        Ok(())
    }

    pub(crate) fn remove_object(&mut self, id: ObjectId) -> Result<(), OpError> {
        let object = self.graph.objects.get(&id).cloned().ok_or(OpError::NoObject(id))?;
        self.remove_relations_of(id);
        if let Some(group) = object.group {
            self.leave_group(id, group);
        }
        self.set_object(id, None);
        Ok(())
    }

    pub(crate) fn remove_relations_of(&mut self, id: ObjectId) {
        let as_subject = self.graph.relations_from(id).map(Relation::key);
        let as_object = self.graph.relations_to.get(&id).into_iter().flatten().copied();
        let keys: Vec<RelationKey> = as_subject.chain(as_object).collect();
        for key in keys {
            self.set_relation(key, None);
        }
    }

    pub(crate) fn merge_objects(&mut self, from: ObjectId, into: ObjectId) -> Result<(), OpError> {
        if from == into {
            return Err(OpError::SelfJoin);
        }
        let gone = self.graph.objects.get(&from).cloned().ok_or(OpError::NoObject(from))?;
        let mut merged = self.graph.object(into).ok_or(OpError::NoObject(into))?.clone();
        for (label, votes) in &gone.votes {
            *merged.votes.entry(label.clone()).or_insert(0.0) += votes;
        }
        let old_label = std::mem::take(&mut merged.label);
        (merged.label, merged.label_margin) = crate::vote::winner(&merged.votes);
        let is_caption_open = merged.label != old_label || merged.caption.is_empty();
        if is_caption_open && merged.label == gone.label && !gone.caption.is_empty() {
            merged.caption = gone.caption.clone();
        }
        for (key, value) in &gone.attributes {
            merged.attributes.entry(key.clone()).or_insert_with(|| value.clone());
        }
        merged.color = merged.color.or(gone.color);
        merged.bounds = merged.bounds.union(&gone.bounds);
        merged.centroid = merged.bounds.center();
        if !(merged.presence.is_empty() && gone.presence.is_empty()) {
            merged.presence = presence::union(&merged.presence(), &gone.presence());
        }
        merged.trajectory = presence::merged(&merged.trajectory, &gone.trajectory);
        merged.first_seen_ns = merged.first_seen_ns.min(gone.first_seen_ns);
        merged.last_seen_ns = merged.last_seen_ns.max(gone.last_seen_ns);
        merged.observations = merged.observations.saturating_add(gone.observations);
        merged.confirmed |= gone.confirmed;
        merged.room = merged.room.or(gone.room);
        merged.place = merged.place.or(gone.place);
        self.remove_object(from)?;
        // Leaving its group may have dissolved it: membership is what the graph says now.
        merged.group = self.graph.object(into).and_then(|object| object.group);
        self.set_object(into, Some(Arc::new(merged)));
        Ok(())
    }

    pub(crate) fn put_group(&mut self, mut group: Group) -> Result<(), OpError> {
        check_point("group", "center", &group.center)?;
        if group.name.trim().is_empty() {
            return Err(OpError::BadName { node: "group", field: "name" });
        }
        group.members.sort_unstable();
        group.members.dedup();
        for member in group.members.iter().chain(&group.support) {
            self.graph.object(*member).ok_or(OpError::NoObject(*member))?;
        }
        if group.members.len() < 2 {
            return Err(OpError::SmallGroup(group.id));
        }
        if let Some(room) = group.room {
            self.graph.room(room).ok_or(OpError::NoRoom(room))?;
        }
        group.support = group.support.filter(|support| group.members.binary_search(support).is_ok());
        let old = self.graph.group(group.id).map(|known| known.members.clone()).unwrap_or_default();
        for member in old.iter().filter(|member| group.members.binary_search(member).is_err()) {
            self.set_group_of_object(*member, None);
        }
        for member in group.members.clone() {
            match self.graph.objects[&member].group {
                Some(other) if other != group.id => self.leave_group(member, other),
                _ => {}
            }
            self.set_group_of_object(member, Some(group.id));
        }
        self.set_group(group.id, Some(Arc::new(group)));
        Ok(())
    }

    pub(crate) fn remove_group(&mut self, id: GroupId) -> Result<(), OpError> {
        let group = self.graph.groups.get(&id).cloned().ok_or(OpError::NoGroup(id))?;
        for member in &group.members {
            self.set_group_of_object(*member, None);
        }
        self.set_group(id, None);
        Ok(())
    }

    /// Takes an object out of a group; a group of one dissolves.
    pub(crate) fn leave_group(&mut self, object: ObjectId, group: GroupId) {
        self.set_group_of_object(object, None);
        let Some(mut changed) = self.graph.group(group).cloned() else {
            return;
        };
        changed.members.retain(|member| *member != object);
        changed.support = changed.support.filter(|support| *support != object);
        if changed.members.len() < 2 {
            for member in &changed.members {
                self.set_group_of_object(*member, None);
            }
            self.set_group(group, None);
        } else {
            self.set_group(group, Some(Arc::new(changed)));
        }
    }

    pub(crate) fn set_group_of_object(&mut self, id: ObjectId, group: Option<GroupId>) {
        if let Some(object) = self.graph.objects.get(&id).filter(|object| object.group != group) {
            let changed = Object { group, ..(**object).clone() };
            self.set_object(id, Some(Arc::new(changed)));
        }
    }

    pub(crate) fn put_relation(&mut self, relation: Relation) -> Result<(), OpError> {
        check_range("relation", "distance_m", relation.evidence.distance_m, 0.0)?;
        check_range("relation", "score", relation.evidence.score, 0.0)?;
        if let Verdict::Blocked(point) = &relation.evidence.verdict {
            check_point("relation", "blocked", point)?;
        }
        let ends = [Some(relation.subject), Some(relation.object), relation.other];
        for id in ends.into_iter().flatten() {
            self.graph.object(id).ok_or(OpError::NoObject(id))?;
        }
        if relation.subject == relation.object
            || relation.other == Some(relation.subject)
            || relation.other == Some(relation.object)
        {
            return Err(OpError::SelfJoin);
        }
        self.set_relation(relation.key(), Some(relation));
        Ok(())
    }
}
