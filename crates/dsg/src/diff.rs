//! What is different between two graphs: node by node and field by field, for people and for tests.

use std::collections::BTreeMap;
use std::fmt;

use serde_json::{Map, Value};

use crate::graph::SceneGraph;
use crate::records;
use crate::spark::{KEPT, is_same};

/// One difference.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// What is different: "object O5", "place edge P3-P4", "metadata".
    pub node: String,
    /// The field; empty where the node as a whole is only in one of the graphs.
    pub field: String,
    /// What the first graph says.
    pub before: Option<Value>,
    /// What the second graph says.
    pub after: Option<Value>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let short = |value: &Option<Value>| {
            let text = value.as_ref().map_or_else(|| "nothing".to_owned(), Value::to_string);
            if text.chars().count() > 120 { text.chars().take(117).chain("...".chars()).collect() } else { text }
        };
        match (self.field.as_str(), &self.before, &self.after) {
            ("", Some(_), None) => write!(f, "{} is only in the first", self.node),
            ("", None, Some(_)) => write!(f, "{} is only in the second", self.node),
            (field, before, after) => write!(f, "{} {field}: {} -> {}", self.node, short(before), short(after)),
        }
    }
}

/// The differences between two graphs, layer by layer, by id. Revisions, histories and the builder's memory are not compared.
pub fn diff(before: &SceneGraph, after: &SceneGraph) -> Vec<Difference> {
    let mut found = Vec::new();
    let maps = [&before.metadata, &after.metadata].map(|map| BTreeMap::from([("metadata".to_owned(), map.clone())]));
    compare("", &maps[0], &maps[1], &mut found);
    let all = [before, after].map(records_of);
    for (kind, records) in &all[0] {
        compare(kind, records, &all[1][kind], &mut found);
    }
    found
}

type Records = BTreeMap<String, Map<String, Value>>;

/// All records, by kind and name.
fn records_of(graph: &SceneGraph) -> BTreeMap<&'static str, Records> {
    let with_unknown = |list: &str, id: String, mut record: Map<String, Value>| {
        if let Some(unknown) = graph.unknown_fields.get(&format!("{list}/{id}")) {
            let own = unknown.iter().filter(|(field, _)| *field != KEPT);
            record.extend(own.map(|(field, value)| (field.clone(), value.clone())));
            // What we keep of another format: field by field, too.
            if let Some(Value::Object(kept)) = unknown.get(KEPT).and_then(|kept| kept.get("attributes")) {
                record.extend(kept.iter().map(|(field, value)| (format!("{KEPT}.{field}"), value.clone())));
            }
        }
        (id, record)
    };
    let edge = |a: &dyn fmt::Display, b: &dyn fmt::Display| format!("{a}-{b}");
    let mut all: BTreeMap<&'static str, Records> = BTreeMap::new();
    all.insert(
        "object ",
        graph.objects().map(|o| with_unknown("objects", o.id.to_string(), records::from_object(o))).collect(),
    );
    all.insert(
        "place ",
        graph.places().map(|p| with_unknown("places", p.id.to_string(), records::from_place(p))).collect(),
    );
    let edges = graph.place_edges().map(|e| with_unknown("place_edges", edge(&e.a, &e.b), records::from_place_edge(e)));
    all.insert("place edge ", edges.collect());
    all.insert(
        "room ",
        graph.rooms().map(|r| with_unknown("rooms", r.id.to_string(), records::from_room(r))).collect(),
    );
    let edges = graph.room_edges().map(|e| with_unknown("room_edges", edge(&e.a, &e.b), records::from_room_edge(e)));
    all.insert("room edge ", edges.collect());
    let buildings = graph.buildings().map(|b| with_unknown("buildings", b.id.to_string(), records::from_building(b)));
    all.insert("building ", buildings.collect());
    all.insert(
        "group ",
        graph.groups().map(|g| with_unknown("groups", g.id.to_string(), records::from_group(g))).collect(),
    );
    let name = |r: &crate::relation::Relation| match r.other {
        Some(other) => format!("{} {} {} and {other}", r.subject, r.kind, r.object),
        None => format!("{} {} {}", r.subject, r.kind, r.object),
    };
    all.insert("relation ", graph.relations.values().map(|r| (name(r), records::from_relation(r))).collect());
    all.insert(
        "agent ",
        graph.agents().map(|a| with_unknown("agents", a.id.to_string(), records::from_agent(a))).collect(),
    );
    all
}

fn compare(kind: &str, before: &Records, after: &Records, found: &mut Vec<Difference>) {
    let names: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    for name in names {
        let node = format!("{kind}{name}");
        match (before.get(name), after.get(name)) {
            (Some(a), Some(b)) => {
                let fields: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
                for field in fields {
                    let (before, after) = (a.get(field), b.get(field));
                    let is_equal = before.zip(after).is_some_and(|(a, b)| is_same(a, b));
                    if !is_equal {
                        let (before, after) = (before.cloned(), after.cloned());
                        found.push(Difference { node: node.clone(), field: field.clone(), before, after });
                    }
                }
            }
            (a, b) => {
                let whole = |record: Option<&Map<String, Value>>| record.cloned().map(Value::Object);
                found.push(Difference { node, field: String::new(), before: whole(a), after: whole(b) });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::{Aabb, Object, ObjectId, Op};

    #[test]
    fn differences_name_the_node_and_the_field() {
        let mut a = SceneGraph::new();
        let mug = Object::new(ObjectId(1), "mug", Aabb::at(Point3::origin()));
        a.apply(Op::PutObject(Box::new(mug.clone()))).unwrap();
        let mut b = a.clone();
        assert!(diff(&a, &b).is_empty());
        b.apply(Op::PutObject(Box::new(Object { caption: "a red mug".into(), ..mug.clone() }))).unwrap();
        b.apply(Op::PutObject(Box::new(Object { id: ObjectId(2), ..mug }))).unwrap();
        b.metadata_mut().insert("map".into(), 7.into());
        let lines: Vec<String> = diff(&a, &b).iter().map(ToString::to_string).collect();
        let expected = [
            "metadata map: nothing -> 7",
            "object O1 caption: \"\" -> \"a red mug\"",
            "object O2 is only in the second",
        ];
        assert_eq!(lines, expected);
    }
}
