//! Tools a model may call to resolve a relation exactly: JSON arguments in, JSON out, names of the prompt on both sides.
//!
//! `find_above {"id": "table1"}` and its kin answer with the things that stand in the relation to the id, best first. What has no name in
//! the prompt is written by its graph id (`O12`), and such ids are understood as arguments too.

use dsg::{ObjectId, RoomId};
use serde_json::{Map, Value, json};

use crate::grounding::{Scene, Thing};
use crate::instruction::SpatialRelation;
use crate::names::{NameTable, Named};
use crate::octant::octant_of;
use crate::relations::{Shape, Viewer, between_score, nearness_key_m, relation_score};
use crate::situation::Situation;
use crate::vocabulary::{Class, class_similarity, is_container};

/// What tools look at.
pub struct ToolBox<'a> {
    /// The situation.
    pub situation: &'a Situation<'a>,
    /// Names of the prompt.
    pub names: &'a NameTable,
}

/// Why a tool gave no answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ToolError {
    /// No such tool.
    #[error("unknown tool")]
    UnknownTool,
    /// The arguments are not a JSON object, or too long.
    #[error("arguments must be a JSON object of at most 4096 bytes")]
    BadArguments,
    /// An argument is missing or of the wrong type.
    #[error("argument \"{0}\" is missing or of the wrong type")]
    Argument(&'static str),
    /// An id is neither a name of the prompt nor in the graph.
    #[error("argument \"{0}\" is no id of this scene")]
    UnknownId(&'static str),
}

/// Longest argument text that is read.
const MAX_ARGUMENT_BYTES: usize = 4096;
/// Most results of a tool.
const MAX_RESULTS: usize = 20;
/// Least score of a result.
const MIN_SCORE: f64 = 0.3;

/// Tools of the form `find_X {id, class?, k?, view?}`.
const RELATION_TOOLS: [(&str, SpatialRelation, &str); 11] = [
    ("find_above", SpatialRelation::Above, "things above the id"),
    ("find_below", SpatialRelation::Under, "things below the id"),
    ("find_on", SpatialRelation::On, "things resting on the id"),
    ("find_supporting", SpatialRelation::Supporting, "things the id rests on"),
    ("find_in", SpatialRelation::Inside, "things inside the id"),
    ("find_near", SpatialRelation::Near, "things near the id, nearest first"),
    ("find_farthest", SpatialRelation::Farthest, "things far from the id, farthest first"),
    ("find_left_of", SpatialRelation::LeftOf, "things left of the id"),
    ("find_right_of", SpatialRelation::RightOf, "things right of the id"),
    ("find_in_front_of", SpatialRelation::InFrontOf, "things in front of the id"),
    ("find_behind", SpatialRelation::Behind, "things behind the id"),
];

/// Calls a tool with the argument text of a model.
///
/// # Errors
/// See [`ToolError`]; hostile text gives an error, never a panic.
pub fn call_text(name: &str, arguments: &str, tools: &ToolBox) -> Result<Value, ToolError> {
    if arguments.len() > MAX_ARGUMENT_BYTES {
        return Err(ToolError::BadArguments);
    }
    let arguments: Value = serde_json::from_str(arguments).map_err(|_| ToolError::BadArguments)?;
    call(name, &arguments, tools)
}

/// Calls a tool.
///
/// # Errors
/// See [`ToolError`].
pub fn call(name: &str, arguments: &Value, tools: &ToolBox) -> Result<Value, ToolError> {
    let arguments = arguments.as_object().ok_or(ToolError::BadArguments)?;
    let scene = Scene::from_graph(tools.situation.graph, tools.situation.floor());
    let call = Call { tools, arguments, scene: &scene };
    if let Some((_, relation, _)) = RELATION_TOOLS.iter().find(|(tool, _, _)| *tool == name) {
        return call.find(*relation);
    }
    match name {
        "find_between" => call.find_between(),
        "order_by" => call.order_by(),
        "objects_in" => call.objects_in(),
        "rooms_with" => call.rooms_with(),
        "path_length" => call.path_length(),
        "describe" => call.describe(),
        _ => Err(ToolError::UnknownTool),
    }
}

/// The definitions in the form of OpenAI-compatible servers (`tools` of a chat request).
pub fn definitions() -> Value {
    let text = json!({"type": "string"});
    let tool = |name: &str, description: &str, properties: Value, required: &[&str]| json!({"type": "function", "function": {"name": name, "description": description, "parameters": {"type": "object", "properties": properties, "required": required}}});
    let mut all: Vec<Value> = RELATION_TOOLS
        .iter()
        .map(|(name, _, description)| tool(name, description, json!({"id": text, "class": text, "k": {"type": "integer"}, "view": {"type": "string", "description": "robot, or: facing ID"}}), &["id"]))
        .collect();
    all.push(tool(
        "find_between",
        "things between two ids",
        json!({"a": text, "b": text, "class": text, "k": {"type": "integer"}}),
        &["a", "b"],
    ));
    all.push(tool(
        "order_by",
        "things of a class in order",
        json!({"class": text, "key": {"type": "string", "enum": ["distance", "size", "height", "left_to_right"]}}),
        &["class", "key"],
    ));
    all.push(tool("objects_in", "things in a room", json!({"room": text, "class": text}), &["room"]));
    all.push(tool("rooms_with", "rooms that hold a class", json!({"class": text}), &["class"]));
    all.push(tool("path_length", "metres of way to an id", json!({"id": text}), &["id"]));
    all.push(tool("describe", "all facts about an object", json!({"id": text}), &["id"]));
    Value::Array(all)
}

struct Call<'a> {
    tools: &'a ToolBox<'a>,
    arguments: &'a Map<String, Value>,
    scene: &'a Scene,
}

impl Call<'_> {
    fn find(&self, relation: SpatialRelation) -> Result<Value, ToolError> {
        let anchor = self.thing("id")?;
        let viewer = self.viewer()?;
        let (anchor_shape, far) = (self.shape(anchor), relation == SpatialRelation::Farthest);
        let scored = self.others(&[anchor.id])?.into_iter().map(|thing| {
            let shape = self.shape(thing);
            let score = relation_score(relation, &shape, &anchor_shape, &viewer);
            (if far { nearness_key_m(&thing.bounds, &anchor.bounds) } else { score }, thing, score)
        });
        let results =
            scored.filter(|(_, _, score)| *score >= MIN_SCORE).map(|(key, thing, score)| (key, thing.id, score));
        self.listed(results.collect())
    }

    fn find_between(&self) -> Result<Value, ToolError> {
        let (a, b) = (self.thing("a")?, self.thing("b")?);
        let scored = self
            .others(&[a.id, b.id])?
            .into_iter()
            .map(|thing| (between_score(&thing.bounds, &a.bounds, &b.bounds), thing.id));
        self.listed(scored.filter(|(score, _)| *score >= MIN_SCORE).map(|(score, id)| (score, id, score)).collect())
    }

    fn order_by(&self) -> Result<Value, ToolError> {
        let key = self.text("key")?;
        self.text("class")?;
        let value = |thing: &Thing| {
            let in_body = self.tools.situation.in_body(&thing.bounds.center());
            match key {
                "distance" => Some(-thing.bounds.distance_to_point_m(&self.tools.situation.position())),
                "size" => Some(thing.bounds.volume_m3()),
                "height" => Some(thing.bounds.center().z),
                "left_to_right" => Some(in_body.y.atan2(in_body.x)),
                _ => None,
            }
        };
        let rows: Option<Vec<(f64, ObjectId, f64)>> = self
            .others(&[])?
            .into_iter()
            .map(|thing| value(thing).map(|value| (value, thing.id, value.abs())))
            .collect();
        self.listed(rows.ok_or(ToolError::Argument("key"))?)
    }

    fn objects_in(&self) -> Result<Value, ToolError> {
        let room = self.room("room")?;
        let objects = self
            .others(&[])?
            .into_iter()
            .filter(|thing| thing.room.is_some_and(|index| self.scene.rooms[index].id == room));
        Ok(objects.map(|thing| self.name(thing.id)).collect())
    }

    fn rooms_with(&self) -> Result<Value, ToolError> {
        self.text("class")?;
        let mut rooms: Vec<RoomId> = self
            .others(&[])?
            .into_iter()
            .filter_map(|thing| thing.room)
            .map(|index| self.scene.rooms[index].id)
            .collect();
        rooms.sort();
        rooms.dedup();
        Ok(rooms
            .into_iter()
            .map(|id| self.tools.names.name_of(Named::Room(id)).map_or_else(|| id.to_string(), str::to_string))
            .collect())
    }

    fn path_length(&self) -> Result<Value, ToolError> {
        let situation = self.tools.situation;
        let path_m = match self.named("id")? {
            Named::Object(id) => situation.path_to_object(id),
            Named::Room(id) => situation.path_to_room(id),
            Named::Place(id) => situation.graph.place(id).and_then(|place| (situation.path_length)(&place.position)),
        };
        Ok(json!({"path_m": path_m.map(round), "reachable": path_m.is_some()}))
    }

    fn describe(&self) -> Result<Value, ToolError> {
        let thing = self.thing("id")?;
        let situation = self.tools.situation;
        let object = situation.graph.object(thing.id).ok_or(ToolError::UnknownId("id"))?;
        let in_body = situation.in_body(&object.centroid);
        let sides = object.bounds.sides_m();
        Ok(json!({
            "id": self.name(thing.id), "class": object.label, "label_margin": round(object.label_margin), "caption": object.caption,
            "attributes": object.attributes, "size_m": [round(sides.x), round(sides.y), round(sides.z)],
            "octant": octant_of(&in_body, situation.camera_height_m).name(), "distance_m": round(in_body.coords.norm()),
            "room": object.room.map(|id| self.tools.names.name_of(Named::Room(id)).map_or_else(|| id.to_string(), str::to_string)),
        }))
    }

    /// Things of the asked class (any class without that argument), without the excluded ones.
    fn others(&self, excluded: &[ObjectId]) -> Result<Vec<&Thing>, ToolError> {
        let class = match self.arguments.get("class") {
            None | Some(Value::Null) => None,
            Some(Value::String(text)) if text.len() <= 100 => Some(Class::new(text)),
            Some(_) => return Err(ToolError::Argument("class")),
        };
        let fits = |thing: &Thing| {
            class.as_ref().is_none_or(|class| {
                thing
                    .classes
                    .first()
                    .is_some_and(|(index, _)| class_similarity(class, &self.scene.classes[*index as usize]) >= 0.6)
            })
        };
        Ok(self.scene.things.iter().filter(|thing| !excluded.contains(&thing.id) && fits(thing)).collect())
    }

    /// Rows of (order, id, value) as JSON, largest order first, ties by id.
    fn listed(&self, mut rows: Vec<(f64, ObjectId, f64)>) -> Result<Value, ToolError> {
        let count = match self.arguments.get("k") {
            None | Some(Value::Null) => MAX_RESULTS,
            Some(value) => value.as_u64().ok_or(ToolError::Argument("k"))?.min(MAX_RESULTS as u64) as usize,
        };
        rows.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        Ok(rows
            .into_iter()
            .take(count)
            .map(|(_, id, value)| json!({"id": self.name(id), "score": round(value)}))
            .collect())
    }

    fn viewer(&self) -> Result<Viewer, ToolError> {
        let position = self.tools.situation.viewer();
        let plain = Viewer { position, forward: None };
        match self.arguments.get("view") {
            None | Some(Value::Null) => Ok(plain),
            Some(Value::String(text)) if text == "robot" => Ok(plain),
            Some(Value::String(text)) => {
                let name = text.strip_prefix("facing ").ok_or(ToolError::Argument("view"))?;
                let Some(Named::Object(id)) = self.resolve(name) else { return Err(ToolError::UnknownId("view")) };
                let object = self.tools.situation.graph.object(id).ok_or(ToolError::UnknownId("view"))?;
                Ok(Viewer { position, forward: Some((object.centroid - position).xy()) })
            }
            Some(_) => Err(ToolError::Argument("view")),
        }
    }

    fn shape<'b>(&self, thing: &'b Thing) -> Shape<'b> {
        Shape {
            bounds: &thing.bounds,
            front: thing.front,
            oriented: thing.oriented.as_ref(),
            is_container: thing
                .classes
                .first()
                .is_some_and(|(index, _)| is_container(&self.scene.classes[*index as usize])),
        }
    }

    fn thing(&self, key: &'static str) -> Result<&Thing, ToolError> {
        let Named::Object(id) = self.named(key)? else { return Err(ToolError::UnknownId(key)) };
        self.scene.things.iter().find(|thing| thing.id == id).ok_or(ToolError::UnknownId(key))
    }

    fn room(&self, key: &'static str) -> Result<RoomId, ToolError> {
        match self.named(key)? {
            Named::Room(id) => Ok(id),
            _ => Err(ToolError::UnknownId(key)),
        }
    }

    fn named(&self, key: &'static str) -> Result<Named, ToolError> {
        self.resolve(self.text(key)?).ok_or(ToolError::UnknownId(key))
    }

    /// A name of the prompt, or `O12` / `R3` if that is in the graph.
    fn resolve(&self, name: &str) -> Option<Named> {
        let graph = self.tools.situation.graph;
        self.tools.names.get(name).or_else(|| {
            if let Some(number) = name.strip_prefix('O') {
                let id = ObjectId(number.parse().ok()?);
                return graph.object(id).map(|_| Named::Object(id));
            }
            let id = RoomId(name.strip_prefix('R')?.parse().ok()?);
            graph.room(id).map(|_| Named::Room(id))
        })
    }

    fn text(&self, key: &'static str) -> Result<&str, ToolError> {
        self.arguments.get(key).and_then(Value::as_str).ok_or(ToolError::Argument(key))
    }

    fn name(&self, id: ObjectId) -> String {
        self.tools.names.name_of(Named::Object(id)).map_or_else(|| id.to_string(), str::to_string)
    }
}

fn round(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}
