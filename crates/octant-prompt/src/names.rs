//! Names in a prompt and what they stand for.
//!
//! An object is named by its class and an ordinal within its room: `chair1` in the agent's room, `room2.chair1` elsewhere. So a count in
//! a far room's line (`chairx7`) lists seven ids in one word, and `go_near(room2.chair3)` resolves here. Ordinals follow the distance or
//! the object id ([`crate::Naming`]); the table belongs to one revision of the graph and one pose.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use dsg::{ObjectId, PlaceId, RoomId};

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Named {
    /// An object.
    Object(ObjectId),
    /// A room.
    Room(RoomId),
    /// A frontier place, or a place to look from.
    Place(PlaceId),
}

/// The names of one prompt.
///
/// A prompt is built far more often than a reply is read, so building only lists what was named; the first look-up sorts it.
#[derive(Debug, Clone, Default)]
pub struct NameTable {
    /// Revision of the graph the names were made for.
    pub revision: u64,
    entries: Vec<(String, Named)>,
    runs: Vec<Run>,
    aliases: Vec<(String, Named)>,
    index: OnceLock<Index>,
}

/// `prefix1`, `prefix2`, ...: what a count in a line stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Run {
    prefix: String,
    /// Ordinal of the first.
    first: usize,
    ids: Vec<ObjectId>,
}

#[derive(Debug, Clone, Default)]
struct Index {
    by_name: BTreeMap<String, Named>,
    aliases: BTreeMap<String, Option<Named>>,
    by_target: BTreeMap<Named, String>,
}

impl PartialEq for NameTable {
    fn eq(&self, other: &NameTable) -> bool {
        // The index follows from the rest.
        (self.revision, &self.entries, &self.runs, &self.aliases)
            == (other.revision, &other.entries, &other.runs, &other.aliases)
    }
}

impl Eq for NameTable {}

impl NameTable {
    /// An empty table.
    pub fn new(revision: u64) -> NameTable {
        NameTable { revision, ..NameTable::default() }
    }

    /// Adds a name; of two equal names the first stays.
    pub fn insert(&mut self, name: String, named: Named) {
        self.index = OnceLock::new();
        self.entries.push((name, named));
    }

    /// Adds `prefix` with the ordinals from `first` on for these objects.
    pub fn insert_run(&mut self, prefix: String, first: usize, ids: Vec<ObjectId>) {
        self.index = OnceLock::new();
        self.runs.push(Run { prefix, first, ids });
    }

    /// Adds another name that a reply may use; one that stands for two different things stands for none.
    pub fn insert_alias(&mut self, alias: String, named: Named) {
        self.index = OnceLock::new();
        self.aliases.push((alias, named));
    }

    fn index(&self) -> &Index {
        self.index.get_or_init(|| {
            let mut index = Index::default();
            let mut insert = |name: String, named: Named| {
                index.by_target.entry(named).or_insert_with(|| name.clone());
                index.by_name.entry(name).or_insert(named);
            };
            for (name, named) in &self.entries {
                insert(name.clone(), *named);
            }
            for run in &self.runs {
                for (position, id) in run.ids.iter().enumerate() {
                    insert(format!("{}{}", run.prefix, run.first + position), Named::Object(*id));
                }
            }
            for (alias, named) in &self.aliases {
                let entry = index.aliases.entry(alias.clone()).or_insert(Some(*named));
                if *entry != Some(*named) {
                    *entry = None;
                }
            }
            index
        })
    }

    /// Looks a name up: as printed, else ignoring case and with spaces or `-` for `_`, else as an alias.
    pub fn get(&self, name: &str) -> Option<Named> {
        if name.len() > 96 {
            return None;
        }
        let index = self.index();
        if let Some(named) = index.by_name.get(name) {
            return Some(*named);
        }
        let folded: String =
            name.trim().chars().map(|c| if c == ' ' || c == '-' { '_' } else { c.to_ascii_lowercase() }).collect();
        index.by_name.get(&folded).copied().or_else(|| index.aliases.get(&folded).copied().flatten())
    }

    /// The name of a target in this prompt.
    pub fn name_of(&self, named: Named) -> Option<&str> {
        self.index().by_target.get(&named).map(String::as_str)
    }

    /// All names with their meaning, sorted by name: what an `enum` in a reply schema may hold.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Named)> {
        self.index().by_name.iter().map(|(name, named)| (name.as_str(), *named))
    }

    /// Number of names.
    pub fn len(&self) -> usize {
        self.index().by_name.len()
    }

    /// True without names.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.runs.iter().all(|run| run.ids.is_empty())
    }
}

/// The class part of a name: lower case, words joined by `_`, at most 32 bytes; never ends in a digit and never in `x` + digits, so that
/// `chair12` and `chairx12` can be read back. An empty label is `thing`.
pub fn class_token(label: &str) -> String {
    let mut token = String::with_capacity(label.len().min(32));
    for c in label.chars() {
        if token.len() >= 32 {
            break;
        }
        if c.is_ascii_alphanumeric() {
            token.push(c.to_ascii_lowercase());
        } else if !c.is_ascii() && c.is_alphanumeric() && token.len() + c.len_utf8() <= 32 {
            token.push(c);
        } else if !token.is_empty() && !token.ends_with('_') {
            token.push('_');
        }
    }
    while token.ends_with('_') {
        token.pop();
    }
    if token.is_empty() {
        return "thing".to_string();
    }
    // Also "x" alone as the last letter after a digit-free stem is fine: "box" + "x7" reads back as ("box", 7).
    if token.ends_with(|c: char| c.is_numeric()) {
        token.push('_');
    }
    token
}

/// Reads `chair12` as (`chair`, 12); None without digits at the end.
pub fn split_ordinal(name: &str) -> Option<(&str, usize)> {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let ordinal = name[stem.len()..].parse().ok()?;
    (!stem.is_empty()).then_some((stem, ordinal))
}

/// Reads `chairx7` as (`chair`, 7) and `chair` as (`chair`, 1).
pub fn split_count(word: &str) -> (&str, usize) {
    match split_ordinal(word) {
        Some((stem, count)) => stem.strip_suffix('x').map_or((word, 1), |class| (class, count)),
        None => (word, 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_read_back() {
        for label in ["chair", "trash can", "box", "label 11", "x", "TV", "x7", "caf\u{e9} table", "", "--"] {
            let token = class_token(label);
            assert_eq!(split_ordinal(&format!("{token}12")), Some((token.as_str(), 12)), "{label:?}");
            assert_eq!(split_count(&format!("{token}x12")), (token.as_str(), 12), "{label:?}");
            assert_eq!(split_count(&token), (token.as_str(), 1), "{label:?}");
        }
        assert_eq!(class_token("label 11"), "label_11_");
    }

    #[test]
    fn lookup_is_forgiving_about_case_but_not_about_doubt() {
        let mut names = NameTable::new(1);
        names.insert("room2.trash_can1".into(), Named::Object(ObjectId(4)));
        names.insert_alias("office".into(), Named::Room(RoomId(1)));
        assert_eq!(names.get("Room2.Trash Can1"), Some(Named::Object(ObjectId(4))));
        assert_eq!(names.get("OFFICE"), Some(Named::Room(RoomId(1))));
        names.insert_alias("office".into(), Named::Room(RoomId(2)));
        assert_eq!(names.get("office"), None);
        assert_eq!(names.get(&"a".repeat(1_000_000)), None);
        assert_eq!(names.name_of(Named::Object(ObjectId(4))), Some("room2.trash_can1"));
    }
}
