//! What the name of a mesh in somebody else's scene says: a room's volume, a part of the building, or a thing of a class.

use crate::building::RoomKind;
use crate::catalog::class;
use crate::colors::COLORS;

/// What a name means.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Meaning {
    /// The volume of a room of this kind, if the name is one's.
    Room(Option<RoomKind>),
    /// Part of the building.
    Structure,
    /// A thing of this class.
    Thing(String),
}

/// Reads a name: case, `_`, `-`, numbers at the end and a colour before the class do not matter.
pub fn meaning_of(name: &str) -> Meaning {
    const STRUCTURE: [&str; 30] = [
        "wall",
        "floor",
        "ceiling",
        "roof",
        "doorframe",
        "door frame",
        "frame",
        "lintel",
        "beam",
        "column",
        "pillar",
        "slab",
        "stairs",
        "structure",
        "building",
        "skirting",
        "skirting board",
        "shell",
        "ground",
        "cube",
        "plane",
        "mesh",
        "object",
        "node",
        "group",
        "default",
        "geometry",
        "cylinder",
        "scene",
        "root",
    ];
    let lower = name.to_lowercase();
    let words: Vec<&str> = lower
        .split(|c: char| !c.is_alphanumeric())
        .map(|word| word.trim_end_matches(|c: char| c.is_ascii_digit()))
        .filter(|word| !word.is_empty())
        .collect();
    if words.first() == Some(&"room") {
        let kind = words[1..].join(" ");
        let spoken = |k: &&RoomKind| k.name() == kind || k.name().strip_suffix(" room") == Some(&kind);
        return Meaning::Room(RoomKind::ALL.iter().find(spoken).copied());
    }
    let is_structure =
        |word: &str| STRUCTURE.contains(&word) || word.strip_suffix('s').is_some_and(|one| STRUCTURE.contains(&one));
    let is_color = |word: &&&str| COLORS.iter().any(|(color, _)| color == *word);
    let words: Vec<&str> = if words.len() > 1 { words.iter().skip_while(is_color).copied().collect() } else { words };
    let noun = words.join(" ");
    let last = words.last().copied().unwrap_or_default();
    match noun.as_str() {
        _ if class(&noun).is_some() => Meaning::Thing(noun),
        "" => Meaning::Structure,
        _ if [noun.as_str(), words[0], last].into_iter().any(is_structure) => Meaning::Structure,
        _ if words.iter().all(|word| word.chars().count() < 2) => Meaning::Structure,
        _ => Meaning::Thing(noun),
    }
}

/// The colour that a name begins with, as in `red_mug_2`: its author knows.
pub(crate) fn color_in(name: &str) -> Option<&'static str> {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphanumeric());
    let first = words.next()?;
    let color = COLORS.iter().find(|(color, _)| *color == first).map(|(color, _)| *color);
    color.filter(|_| words.next().is_some_and(|next| next.starts_with(char::is_alphabetic)))
}
