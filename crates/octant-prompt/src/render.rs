//! The text of a prompt at a chosen level of detail.

use std::fmt::Write;

use dsg::RoomId;

use crate::names::{NameTable, Named};
use crate::octant::Octant;
use crate::tier_items::{AreaItem, Item, RoomItem, Run, Tiers};
use crate::tiers::room_name;

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
    /// Per area: 2 counts and the nearest room of each asked class; 1 only the latter; 0 folded into one line.
    pub areas: Vec<u8>,
    /// Whether the rest of a full room is counted by class.
    pub crowd: bool,
    /// Whether, of the rooms that are folded away, the nearest is named that holds what the instruction asks for.
    pub asked: bool,
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
    crowd(&mut out, tiers, detail.crowd, names.as_deref_mut());
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
    out.push_str(" Think: room, direction, group, object. Reply with one action: go_to_room(id), turn_to(octant), go_near(id), explore(id), stop(id).\n");
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
                out.push_str(" \"");
                one_line(out, &item.caption, tiers.max_caption_words);
                out.push('"');
            }
            insert(&mut names, item);
        }
        if !is_first {
            out.push('\n');
        }
    }
    more(out, "more near", tiers.focal.len() - detail.focal.len());
}

/// The rest of a full room, by class.
fn crowd(out: &mut String, tiers: &Tiers, is_counted: bool, names: Option<&mut NameTable>) {
    if tiers.crowd.is_empty() {
        return;
    }
    if !is_counted {
        return more(out, "more here", tiers.crowd.iter().map(|run| run.ids.len()).sum());
    }
    out.push_str("Also in this room:");
    for run in &tiers.crowd {
        counted(out, &run.token, run.ids.len());
    }
    out.push('\n');
    if let Some(names) = names {
        name_runs(names, "", &tiers.crowd);
    }
}

/// ` chair` or ` chairx7`.
fn counted(out: &mut String, token: &str, count: usize) {
    if count == 1 { put(out, format_args!(" {token}")) } else { put(out, format_args!(" {token}x{count}")) }
}

fn name_runs(names: &mut NameTable, prefix: &str, runs: &[Run]) {
    for run in runs {
        // Ordinals that follow one another are one entry; with stable names there may be gaps.
        let follow = run.ids.chunk_by(|a, b| b.0 == a.0 + 1);
        for chunk in follow {
            let ids = chunk.iter().map(|(_, id)| *id).collect();
            names.insert_run(format!("{prefix}{}", run.token), chunk[0].0, ids);
        }
    }
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
    let is_bare = |room: &RoomItem| room.objects == 0 && room.label.is_none() && !room.is_asked;
    let shown = tiers.rooms.iter().zip(&detail.rooms).any(|(room, level)| *level > 0 && !is_bare(room));
    if shown {
        out.push_str("Other rooms (ids: class1 is the nearest):\n");
    }
    let (mut folded_rooms, mut folded_objects, mut bare) = (0, 0, Vec::new());
    let mut folded_asked: Vec<(&str, f64, RoomId)> = Vec::new();
    for (room, level) in tiers.rooms.iter().zip(&detail.rooms) {
        if *level == 0 {
            folded_rooms += usize::from(room.id.is_some());
            folded_objects += room.objects;
            // A room that is named itself answers by its name.
            let name = room.label.as_deref().filter(|_| room.is_asked && room.asked.is_empty());
            let words = room.asked.iter().map(String::as_str).chain(name);
            folded_asked
                .extend(room.id.into_iter().flat_map(|id| words.clone().map(move |word| (word, room.distance_m, id))));
            continue;
        }
        if is_bare(room) {
            bare.extend(room.id);
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
            for group in &room.groups {
                name_runs(names, &format!("{}.", room.name), &group.classes);
            }
        }
    }
    bare_rooms(out, bare, names.as_deref_mut());
    if detail.areas.iter().any(|level| *level > 0) {
        out.push_str("Farther rooms, by direction:\n");
    }
    for (area, level) in tiers.areas.iter().zip(&detail.areas) {
        if *level == 0 {
            folded_rooms += area.rooms;
            folded_objects += area.objects;
            folded_asked
                .extend(area.asked.iter().map(|(token, room, distance_m)| (token.as_str(), *distance_m, *room)));
        } else {
            area_line(out, area, *level > 1, names.as_deref_mut());
        }
    }
    if folded_rooms + folded_objects > 0 {
        put(out, format_args!("Not shown: {folded_rooms} rooms, {folded_objects} objects"));
        if detail.asked {
            nearest_folded(out, folded_asked, names);
        }
        out.push('\n');
    }
}

/// `; mug in room12 17m` for each thing asked for: so that it is found in two prompts, however little fits into one.
fn nearest_folded(out: &mut String, mut asked: Vec<(&str, f64, RoomId)>, mut names: Option<&mut NameTable>) {
    /// Words that are told about.
    const MOST: usize = 3;
    asked.sort_by(|a, b| a.0.cmp(b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    asked.dedup_by_key(|(word, ..)| *word);
    asked.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(b.0)));
    for (word, distance_m, room) in asked.into_iter().take(MOST) {
        let name = room_name(Some(room));
        put(out, format_args!("; {word} in {name} {distance_m:.0}m"));
        if let Some(names) = names.as_deref_mut() {
            names.insert(name, Named::Room(room));
        }
    }
}

/// `Empty: room1-3, room7`: rooms of which nothing more is known.
fn bare_rooms(out: &mut String, mut rooms: Vec<RoomId>, names: Option<&mut NameTable>) {
    if rooms.is_empty() {
        return;
    }
    rooms.sort_unstable();
    out.push_str("Empty:");
    for (position, chunk) in rooms.chunk_by(|a, b| b.0 == a.0 + 1).enumerate() {
        let (first, last) = (chunk[0].0, chunk[chunk.len() - 1].0);
        out.push_str(if position > 0 { ", " } else { " " });
        put(out, format_args!("{}", room_name(Some(chunk[0]))));
        if last > first {
            put(out, format_args!("-{last}"));
        }
    }
    out.push('\n');
    if let Some(names) = names {
        rooms.into_iter().for_each(|id| names.insert(room_name(Some(id)), Named::Room(id)));
    }
}

fn area_line(out: &mut String, area: &AreaItem, in_full: bool, mut names: Option<&mut NameTable>) {
    put(out, format_args!("{} ", area.side));
    span(out, area.nearest_m, area.farthest_m);
    put(out, format_args!(", {} rooms:", area.rooms));
    if area.objects == 0 {
        out.push_str(" empty");
    } else if in_full {
        for (token, count) in &area.counts {
            counted(out, token, *count);
        }
    } else {
        put(out, format_args!(" {} objects", area.objects));
    }
    for (token, room, distance_m) in &area.asked {
        let name = room_name(Some(*room));
        put(out, format_args!("; {token} in {name} {distance_m:.0}m"));
        if let Some(names) = names.as_deref_mut() {
            names.insert(name, Named::Room(*room));
        }
    }
    out.push('\n');
}

/// `5m` or `5-7m`.
fn span(out: &mut String, low_m: f64, high_m: f64) {
    let (low, high) = (low_m.round(), high_m.round());
    if low == high { put(out, format_args!("{low}m")) } else { put(out, format_args!("{low}-{high}m")) }
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
        for run in &group.classes {
            counted(out, &run.token, run.ids.len());
        }
        if in_full {
            out.push(' ');
            span(out, group.nearest_m, group.farthest_m);
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
        // A caption is data between quotes: what would end it or its entry is replaced.
        let harmless = |c: char| match c {
            ';' => ',',
            '"' => '\'',
            c => c,
        };
        out.extend(word.chars().map(|c| if is_instruction { c } else { harmless(c) }));
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
