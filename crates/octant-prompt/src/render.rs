//! The text of a prompt at a chosen level of detail.

use std::fmt::Write;

use crate::names::{NameTable, Named};
use crate::octant::Octant;
use crate::tiers::{Item, RoomItem, Tiers};

/// How much is shown of each part. Everything not shown is counted, not forgotten.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Detail {
    /// Captions of asked focal objects.
    pub captions: usize,
    /// Indices of the focal objects that are listed (sorted).
    pub focal: Vec<usize>,
    /// Indices of the peripheral objects that are listed (sorted).
    pub peripheral: Vec<usize>,
    /// Per room: 2 groups, counts and distances; 1 counts; 0 folded into one line.
    pub rooms: Vec<u8>,
    /// Places listed.
    pub places: usize,
    /// Bytes of the instruction.
    pub instruction_bytes: usize,
}

/// Writes the text; with `names`, also the meaning of every name that stands in it.
pub fn render(tiers: &Tiers, instruction: &str, detail: &Detail, mut names: Option<&mut NameTable>) -> String {
    let mut out = String::with_capacity(1024);
    header(&mut out, tiers, names.as_deref_mut());
    focal(&mut out, tiers, detail, names.as_deref_mut());
    peripheral(&mut out, tiers, detail, names.as_deref_mut());
    rooms(&mut out, tiers, detail, names.as_deref_mut());
    places(&mut out, tiers, detail, names);
    out.push_str("Instruction: ");
    one_line(&mut out, cut(instruction, detail.instruction_bytes), usize::MAX);
    out
}

fn header(out: &mut String, tiers: &Tiers, names: Option<&mut NameTable>) {
    match &tiers.here {
        Some((id, name, label)) => {
            put(out, format_args!("You are in {name}"));
            if let Some(label) = label {
                put(out, format_args!(" ({label})"));
            }
            out.push('.');
            if let Some(names) = names {
                names.insert(name.clone(), Named::Room(*id));
                if let Some(label) = label {
                    names.insert_alias(label.replace(' ', "_"), Named::Room(*id));
                }
            }
        }
        None => out.push_str("You are in no known room."),
    }
    out.push_str(" Think: room, direction, group, object. Reply with one action: go_to_room(id) | turn_to(octant) | go_near(id) | explore(id) | stop(id).\n");
}

fn focal(out: &mut String, tiers: &Tiers, detail: &Detail, mut names: Option<&mut NameTable>) {
    if tiers.focal.is_empty() {
        return;
    }
    out.push_str("Near (m):\n");
    let captioned: Vec<usize> = detail
        .focal
        .iter()
        .copied()
        .filter(|index| tiers.focal[*index].is_asked && !tiers.focal[*index].caption.is_empty())
        .take(detail.captions)
        .collect();
    for octant in Octant::ALL {
        let mut is_first = true;
        for index in &detail.focal {
            let item = &tiers.focal[*index];
            if item.octant != octant {
                continue;
            }
            if is_first {
                put(out, format_args!("{octant}: "));
            } else {
                out.push_str("; ");
            }
            is_first = false;
            put(out, format_args!("{} {:.1}", item.name, item.distance_m));
            if captioned.contains(index) {
                out.push(' ');
                one_line(out, &item.caption, tiers.max_caption_words);
            }
            insert(&mut names, item);
        }
        if !is_first {
            out.push('\n');
        }
    }
    more(out, "more near", tiers.focal.len() - detail.focal.len());
}

fn peripheral(out: &mut String, tiers: &Tiers, detail: &Detail, mut names: Option<&mut NameTable>) {
    if tiers.peripheral.is_empty() {
        return;
    }
    if tiers.focal.is_empty() {
        put(out, format_args!("Nothing within {}m. This room (m):\n", tiers.focal_radius_m));
    } else {
        put(out, format_args!("This room, beyond {}m:\n", tiers.focal_radius_m));
    }
    for octant in Octant::ALL {
        let mut items: Vec<&Item> = detail
            .peripheral
            .iter()
            .map(|index| &tiers.peripheral[*index])
            .filter(|item| item.octant == octant)
            .collect();
        if items.is_empty() {
            continue;
        }
        items.sort_by_key(|item| item.group); // stable: within a group by distance
        put(out, format_args!("{octant}: "));
        let mut group = "";
        for item in items {
            if item.group != group {
                out.push_str(if group.is_empty() { "" } else { ", " });
                out.push_str(item.group);
                group = item.group;
            }
            put(out, format_args!(" {} {:.1}", item.name, item.distance_m));
            insert(&mut names, item);
        }
        out.push('\n');
    }
    more(out, "more here", tiers.peripheral.len() - detail.peripheral.len());
}

fn rooms(out: &mut String, tiers: &Tiers, detail: &Detail, mut names: Option<&mut NameTable>) {
    let shown = detail.rooms.iter().any(|level| *level > 0);
    if shown {
        out.push_str("Other rooms (ids: class1 is the nearest):\n");
    }
    let (mut folded_rooms, mut folded_objects) = (0, 0);
    for (room, level) in tiers.rooms.iter().zip(&detail.rooms) {
        if *level == 0 {
            folded_rooms += 1;
            folded_objects += room.objects.len();
            continue;
        }
        room_line(out, room, *level > 1);
        if let Some(names) = names.as_deref_mut() {
            if let Some(id) = room.id {
                names.insert(room.name.clone(), Named::Room(id));
                if let Some(label) = &room.label {
                    names.insert_alias(label.replace(' ', "_"), Named::Room(id));
                }
            }
            for (name, id) in &room.objects {
                names.insert(name.clone(), Named::Object(*id));
            }
        }
    }
    if folded_rooms > 0 {
        put(out, format_args!("Farther: {folded_rooms} rooms, {folded_objects} objects\n"));
    }
}

fn room_line(out: &mut String, room: &RoomItem, in_full: bool) {
    out.push_str(&room.name);
    if let Some(label) = &room.label {
        put(out, format_args!(" ({label})"));
    }
    put(out, format_args!(" {} {:.0}m:", room.bearing, room.distance_m));
    if room.groups.is_empty() {
        out.push_str(" empty");
    }
    for (index, group) in room.groups.iter().enumerate() {
        if index > 0 && in_full {
            out.push(',');
        }
        if in_full {
            put(out, format_args!(" {}", group.group));
        }
        for (token, count) in &group.counts {
            if *count == 1 {
                put(out, format_args!(" {token}"));
            } else {
                put(out, format_args!(" {token}x{count}"));
            }
        }
        if in_full {
            let (low, high) = (group.nearest_m.round(), group.farthest_m.round());
            if low == high {
                put(out, format_args!(" {low}m"));
            } else {
                put(out, format_args!(" {low}-{high}m"));
            }
        }
    }
    out.push('\n');
}

fn places(out: &mut String, tiers: &Tiers, detail: &Detail, mut names: Option<&mut NameTable>) {
    let shown = &tiers.places[..detail.places.min(tiers.places.len())];
    if shown.is_empty() {
        return;
    }
    out.push_str("To explore: ");
    for (index, place) in shown.iter().enumerate() {
        if index > 0 {
            out.push_str("; ");
        }
        put(out, format_args!("{} {} {:.0}m", place.name, place.bearing, place.distance_m));
        if let Some(names) = names.as_deref_mut() {
            names.insert(place.name.clone(), Named::Place(place.id));
        }
    }
    out.push('\n');
}

fn more(out: &mut String, word: &str, count: usize) {
    if count > 0 {
        put(out, format_args!("{word}: {count} objects\n"));
    }
}

fn insert(names: &mut Option<&mut NameTable>, item: &Item) {
    if let Some(names) = names.as_deref_mut() {
        names.insert(item.name.clone(), Named::Object(item.id));
    }
}

/// Appends text as one line without the marks that separate entries; at most `words` words, 400 bytes.
fn one_line(out: &mut String, text: &str, words: usize) {
    let is_instruction = words == usize::MAX;
    let mut is_first = true;
    let limit = out.len() + if is_instruction { usize::MAX / 2 } else { 400 };
    for word in text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|word| !word.is_empty()).take(words) {
        if out.len() + word.len() + 1 > limit {
            break;
        }
        if !is_first {
            out.push(' ');
        }
        is_first = false;
        out.extend(word.chars().map(|c| if c == ';' && !is_instruction { ',' } else { c }));
    }
}

/// The first `bytes` bytes, cut at a character.
fn cut(text: &str, bytes: usize) -> &str {
    let mut end = bytes.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

fn put(out: &mut String, arguments: std::fmt::Arguments) {
    out.write_fmt(arguments).expect("writing to a String cannot fail");
}
