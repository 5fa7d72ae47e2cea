//! Other texts for the same decision, for experiments: a flat list of everything, ours without tiers, ours without octants.
//!
//! Each says the same of rooms, things and places to explore that ours does, in its own words, and is answered in the same grammar: an id
//! such as `O12`, `room3` or `frontier1` stands for what it names. None has a budget: that is part of what is measured.

use std::collections::BTreeMap;
use std::fmt::Write;

use dsg::{Object, RoomId};
use nalgebra::Point3;

use crate::instruction::Instruction;
use crate::names::{NameTable, Named, class_token};
use crate::octant::octant_of;
use crate::prompt::{Prompt, PromptConfig, PromptForm};
use crate::situation::Situation;
use crate::tokens::TokenCounter;

/// The prompt of a form that is not [`PromptForm::Octant`].
pub(crate) fn prompt(
    situation: &Situation,
    instruction: &Instruction,
    config: &PromptConfig,
    counter: &dyn TokenCounter,
) -> Prompt {
    let mut names = NameTable::new(situation.graph.revision());
    let mut text = String::new();
    let mut writer = Writer { situation, config, names: &mut names, out: &mut text };
    writer.header();
    match config.form {
        PromptForm::WithoutOctants => writer.tiers(),
        _ => writer.list(),
    }
    writer.places();
    text.push_str("Instruction: ");
    text.push_str(&instruction.text);
    Prompt { tokens: counter.count(&text), text, revision: situation.graph.revision(), names }
}

struct Writer<'a> {
    situation: &'a Situation<'a>,
    config: &'a PromptConfig,
    names: &'a mut NameTable,
    out: &'a mut String,
}

impl Writer<'_> {
    fn header(&mut self) {
        let (at, yaw_deg) =
            (self.situation.position(), self.situation.world_from_body.rotation.euler_angles().2.to_degrees());
        let own = self.situation.room().map_or_else(|| "no known room".to_string(), room_word);
        self.line(format_args!(
            "You are at ({:.2}, {:.2}, {:.2}) in {own}, heading {yaw_deg:.0} degrees.",
            at.x, at.y, at.z
        ));
        self.line(format_args!("Think: room, direction, group, object. Reply with one action: go_to_room(id), turn_to(octant), go_near(id), explore(id), stop(id)."));
        for room in self.situation.graph.rooms() {
            let center = self.place_of(&room.center);
            self.line(format_args!("{}: {} {center}", room_word(room.id), room.name));
            self.names.insert(room_word(room.id), Named::Room(room.id));
        }
    }

    /// Every thing, in the order of ids, with its caption.
    fn list(&mut self) {
        for object in self.situation.graph.objects() {
            let caption = one_line(&object.caption);
            self.object(object, &caption);
        }
    }

    /// Things of the own room, the near ones of the asked kinds with captions; of other rooms, how many of what.
    fn tiers(&mut self) {
        let here = self.situation.room();
        let nouns = self.situation.instruction.nouns();
        let mut far: BTreeMap<Option<RoomId>, BTreeMap<String, usize>> = BTreeMap::new();
        for object in self.situation.graph.objects() {
            if object.room != here {
                *far.entry(object.room).or_default().entry(class_token(&object.label)).or_default() += 1;
                // A count stands for things that have ids all the same.
                self.names.insert(object.id.to_string(), Named::Object(object.id));
                continue;
            }
            let is_near = (object.centroid - self.situation.position()).norm() <= self.config.focal_radius_m;
            let is_asked = nouns.iter().any(|noun| object.label.contains(noun.as_str()));
            let caption = if is_near && is_asked { one_line(&object.caption) } else { String::new() };
            self.object(object, &caption);
        }
        for (room, counts) in far {
            let word = room.map_or_else(|| "outside".to_string(), room_word);
            let counts: Vec<String> = counts.iter().map(|(token, count)| format!("{token}x{count}")).collect();
            self.line(format_args!("in {word}: {}", counts.join(" ")));
        }
    }

    fn object(&mut self, object: &Object, caption: &str) {
        let place = self.place_of(&object.centroid);
        let room = object.room.map_or_else(|| "no room".to_string(), room_word);
        self.line(format_args!("{}: {} {place}, {room}. {caption}", object.id, object.label));
        self.names.insert(object.id.to_string(), Named::Object(object.id));
    }

    fn places(&mut self) {
        for (list, word) in [(self.situation.frontiers, "frontier"), (self.situation.unseen, "view")] {
            for (index, place) in list.iter().filter_map(|id| self.situation.graph.place(*id)).enumerate() {
                let (name, at) = (format!("{word}{}", index + 1), self.place_of(&place.position));
                self.line(format_args!("{name}: to explore, {at}"));
                self.names.insert(name, Named::Place(place.id));
            }
        }
    }

    /// Where something is, in the words of the form.
    fn place_of(&self, point: &Point3<f64>) -> String {
        if self.config.form == PromptForm::WithoutTiers {
            let in_body = self.situation.in_body(point);
            return format!("{} {:.1} m", octant_of(&in_body, self.config.camera_height_m), in_body.coords.norm());
        }
        format!("at ({:.2}, {:.2}, {:.2})", point.x, point.y, point.z)
    }

    fn line(&mut self, text: std::fmt::Arguments) {
        self.out.write_fmt(text).expect("writing to a String cannot fail");
        self.out.push('\n');
    }
}

fn room_word(id: RoomId) -> String {
    format!("room{}", id.0)
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
