//! What words mean to the symbolic side: synonyms and look-alikes of classes, functional groups, room kinds with their usual contents,
//! colours and materials. Nothing here is required: a class that no table knows is still a class, equal to itself only.
//!
//! The tables are prior knowledge of ordinary flats and offices, written by hand; they steer the order of a search (OmniVLN,
//! "Functional Group Inference exploits object co-occurrence"), never the truth of a relation.

use std::collections::{HashMap, HashSet};
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::vocabulary_tables as tables;

/// A class as somebody wrote it, normalised: lower case, single spaces, singular.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub struct Class {
    /// The words as normalised, for example `coffee mug`.
    pub text: String,
    /// The first word of the synonym group, for example `mug`; equal to `text` when no table knows it.
    pub canonical: String,
    /// Whether it was written as a plural.
    #[serde(default)]
    pub is_plural: bool,
    /// What was written, where that is no word anybody knows and this one is taken to be meant (`chiar`).
    #[serde(default)]
    pub said: Option<String>,
    /// Other classes that are meant as much ("something to sit on": chair, and sofa, and stool), in their canonical words.
    #[serde(default)]
    pub also: Vec<String>,
}

impl Class {
    /// Normalises `text`; empty text gives the empty class, which matches nothing.
    pub fn new(text: &str) -> Class {
        let said = normalise(text);
        let text = singular_phrase(&said);
        let canonical = canonical(&text).unwrap_or(&text).to_string();
        Class { is_plural: said != text, text, canonical, said: None, also: Vec::new() }
    }

    /// True for words that stand for any object ("thing", "object", "one", "item").
    pub fn is_wildcard(&self) -> bool {
        matches!(self.text.as_str(), "thing" | "object" | "one" | "item" | "something" | "anything")
    }

    /// The last word: `chair` of `office chair`.
    pub fn head(&self) -> &str {
        self.canonical.rsplit(' ').next().unwrap_or(&self.canonical)
    }
}

/// How well the class `label` answers to the asked class, in [0, 1].
///
/// 1 same words, 0.95 synonym, 0.8 a kind of it (`office chair` for `chair`), 0.55 the general word for a special one, 0.5 look-alike
/// (`cup` for `mug`), else 0. A word that was respelled counts 0.9 of that, and 1 for what bears the word as it was written: there may
/// be such things. Another class that is meant as much counts 0.95. The last two of the list stay below [`crate::grounding::GroundingConfig::accept`] on purpose: they are worth a closer look after the
/// search, not a stop.
pub fn class_similarity(asked: &Class, label: &Class) -> f64 {
    /// Trust in a word that was written otherwise: below the very word, and enough to stop at a kind of it.
    const RESPELLED: f64 = 0.9;
    let Some(said) = &asked.said else { return similarity_of_words(asked, label) };
    if *said == label.text { 1.0 } else { RESPELLED * similarity_of_words(asked, label) }
}

fn similarity_of_words(asked: &Class, label: &Class) -> f64 {
    if asked.is_wildcard() {
        return 0.6;
    }
    if asked.text.is_empty() || label.text.is_empty() {
        return 0.0;
    }
    if asked.text == label.text {
        return 1.0;
    }
    if asked.canonical == label.canonical || asked.also.contains(&label.canonical) {
        return 0.95;
    }
    let ends_with_word = |long: &str, short: &str| {
        long.len() > short.len() && long.ends_with(short) && long.as_bytes()[long.len() - short.len() - 1] == b' '
    };
    let is_kind = |special: &Class, general: &Class| {
        ends_with_word(&special.text, &general.text) || ends_with_word(&special.canonical, &general.canonical)
    };
    if is_kind(label, asked) {
        return 0.8;
    }
    if is_kind(asked, label) {
        return 0.55;
    }
    if are_look_alikes(&asked.canonical, &label.canonical) {
        return 0.5;
    }
    0.0
}

/// Most that a thing counts which only stands in for a word.
pub const STAND_IN: f64 = 0.3;

/// How well `label` can stand in for `asked` where no thing answers to the word itself: 0.3 for what is found at the same spot
/// (curtains for a window), up to 0.3 for shared words (`paper towel dispenser` for `paper dispenser`), else 0. Enough to look at as an
/// anchor, never enough to stop at.
pub fn stand_in(asked: &Class, label: &Class) -> f64 {
    let of = |name: &str| TABLES.stand_ins.get(name);
    let known = of(&asked.text).or_else(|| of(&asked.canonical)).or_else(|| of(asked.head()));
    if known.is_some_and(|names| names.contains(label.text.as_str()) || names.contains(label.canonical.as_str())) {
        return STAND_IN;
    }
    // A shared word counts by how much of the name it is, the last one most.
    let asked_words = asked.text.split(' ').count() as f64;
    let shared =
        asked.text.split(' ').filter(|word| word.len() > 2 && label.text.split(' ').any(|other| other == *word));
    let head = label.text.split(' ').next_back() == asked.text.split(' ').next_back();
    let share = shared.count() as f64 / asked_words;
    if share > 0.0 { 0.1 + 0.1 * share + if head { 0.1 } else { 0.0 } } else { 0.0 }
}

/// Whether a thing of class `label` answers to the noun of an instruction: the same word, a synonym, or a kind of it.
pub fn is_kind_of(label: &str, noun: &str) -> bool {
    class_similarity(&Class::new(noun), &Class::new(label)) >= 0.6
}

/// The usual functional group of a class, used to order prompt lines: `seating`, `work`, ... or `other`.
pub fn functional_group(class: &Class) -> &'static str {
    let of = |name: &str| TABLES.group.get(name).copied();
    of(&class.canonical).or_else(|| of(class.head())).unwrap_or("other")
}

/// Whether any table knows the class.
pub fn is_known(class: &Class) -> bool {
    canonical(&class.text).is_some() || canonical(class.head()).is_some()
}

/// True when an object of this class is small enough to be seen only from within a few metres.
pub fn is_small(class: &Class) -> bool {
    !TABLES.large.contains(class.canonical.as_str()) && !TABLES.large.contains(class.head())
}

/// True when things are kept inside an object of this class, so that "on the shelf" may mean inside its box.
pub fn is_container(class: &Class) -> bool {
    let names = [
        "shelf",
        "bookshelf",
        "cabinet",
        "rack",
        "wardrobe",
        "sink",
        "box",
        "basket",
        "shoe rack",
        "bathtub",
        "cart",
        "kitchen cabinet",
        "trash can",
    ];
    names.contains(&class.canonical.as_str()) || names.contains(&class.head())
}

/// The room kind named by a phrase such as `conference room`, or None.
pub fn room_kind(phrase: &str) -> Option<&'static str> {
    TABLES.kind_of_name.get(singular_phrase(&normalise(phrase)).as_str()).copied()
}

/// How usual an object of `class` is in a room of `kind`, in [0.08, 1].
pub fn affinity(kind: &str, class: &Class) -> f64 {
    let index = TABLES.kinds.iter().position(|known| *known == kind);
    index.zip(affinities(class)).map_or(UNUSUAL, |(index, row)| row[index])
}

/// What a room's list of contents does not mention; never zero: a mug may stand anywhere.
const UNUSUAL: f64 = 0.08;

/// Affinity of a class to every kind; None for a class that no list mentions.
fn affinities(class: &Class) -> Option<&'static [f64]> {
    let row = TABLES.affinities.get(class.canonical.as_str()).or_else(|| TABLES.affinities.get(class.head()));
    row.map(Vec::as_slice)
}

/// Probability of each room kind given the distinct classes seen in a room, by naive Bayes with a flat prior; in the order of the
/// table. Empty contents give the flat prior; a class that no list mentions says nothing.
pub fn kind_probabilities(contents: &[Class]) -> Vec<(&'static str, f64)> {
    let mut logs = vec![0.0; TABLES.kinds.len()];
    for row in contents.iter().filter_map(affinities) {
        for (log, affinity) in logs.iter_mut().zip(row) {
            *log += affinity.ln();
        }
    }
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = logs.iter().map(|log| (log - top).exp()).sum();
    TABLES.kinds.iter().zip(logs).map(|(kind, log)| (*kind, (log - top).exp() / total)).collect()
}

/// Room kinds whose names are used for one another ("kitchen" and "break room"), in [0, 1]; 1 for equal kinds.
pub fn kind_similarity(asked: &str, actual: &str) -> f64 {
    const ALIKE: [(&str, &str); 11] = [
        ("kitchen", "break room"),
        ("living room", "lobby"),
        ("dining room", "kitchen"),
        ("dining room", "living room"),
        ("office", "library"),
        ("storage", "laundry room"),
        ("corridor", "lobby"),
        ("bedroom", "nursery"),
        ("office", "lab"),
        ("storage", "print room"),
        ("bathroom", "laundry room"),
    ];
    if asked == actual {
        return 1.0;
    }
    let are_alike = ALIKE.iter().any(|&(a, b)| (a, b) == (asked, actual) || (b, a) == (asked, actual));
    if are_alike { 0.4 } else { 0.05 }
}

/// Reference colour (sRGB, 0-255) of a colour word.
pub fn color_rgb(word: &str) -> Option<[f64; 3]> {
    TABLES.colors.get(word).copied()
}

/// The canonical name of a material word ("wooden" is wood).
pub fn material(word: &str) -> Option<&'static str> {
    TABLES.materials.get(word).copied()
}

/// The canonical name of a class phrase that the tables know (already normalised and singular).
pub fn canonical(phrase: &str) -> Option<&'static str> {
    TABLES.canonical.get(phrase).copied()
}

/// All names of classes that a table knows.
pub(crate) fn class_phrases() -> impl Iterator<Item = &'static str> {
    TABLES.canonical.keys().copied()
}

/// All names of room kinds.
pub(crate) fn room_names() -> impl Iterator<Item = &'static str> {
    TABLES.kind_of_name.keys().copied()
}

/// Colours, materials, and classes that have no synonyms.
pub(crate) fn word_lists() -> impl Iterator<Item = &'static str> {
    let classes = TABLES.stand_ins.iter().flat_map(|(class, names)| names.iter().chain([class])).copied();
    let usual = TABLES.affinities.keys().chain(TABLES.group.keys()).chain(TABLES.large.iter()).copied();
    TABLES.colors.keys().chain(TABLES.materials.keys()).copied().chain(classes).chain(usual)
}

/// Lower case, letters, digits and single spaces only (`-`, `_` and other marks become spaces; apostrophes vanish).
pub fn normalise(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_alphanumeric() {
            out.extend(c.to_lowercase());
        } else if !matches!(c, '\'' | '\u{2019}') && !out.is_empty() && !out.ends_with(' ') {
            out.push(' ');
        }
    }
    out.truncate(out.trim_end().len());
    out
}

/// Singular of the last word of a normalised phrase; irregular plurals by table, words such as `glass` and `stairs` untouched.
pub fn singular_phrase(phrase: &str) -> String {
    let (front, last) = phrase.rsplit_once(' ').map_or(("", phrase), |(front, last)| (front, last));
    // A phrase the tables know as it stands ("chest of drawers", "stairs") is not touched.
    if TABLES.canonical.contains_key(phrase) {
        return phrase.to_string();
    }
    let last = singular(last);
    if front.is_empty() { last } else { format!("{front} {last}") }
}

/// The plural of a singular phrase, such that [`singular_phrase`] leads back; where none is known, the phrase itself.
pub fn plural(phrase: &str) -> String {
    let with = |cut: usize, end: &str| format!("{}{end}", &phrase[..phrase.len() - cut]);
    let is_vowel = |c: char| matches!(c, 'a' | 'e' | 'i' | 'o' | 'u');
    let before_y = phrase.strip_suffix('y').and_then(|stem| stem.chars().next_back());
    let made = if phrase.ends_with("shelf") {
        with(1, "ves")
    } else if before_y.is_some_and(|c| !is_vowel(c)) {
        with(1, "ies")
    } else if ["s", "sh", "ch", "x", "z"].iter().any(|end| phrase.ends_with(end)) {
        with(0, "es")
    } else {
        with(0, "s")
    };
    if singular_phrase(&made) == phrase { made } else { phrase.to_string() }
}

fn singular(word: &str) -> String {
    const IRREGULAR: &[(&str, &str)] = &[
        ("shelves", "shelf"),
        ("bookshelves", "bookshelf"),
        ("knives", "knife"),
        ("loaves", "loaf"),
        ("leaves", "leaf"),
        ("people", "person"),
        ("men", "man"),
        ("women", "woman"),
        ("children", "child"),
        ("mice", "mouse"),
        ("couches", "couch"),
        ("watches", "watch"),
        ("brushes", "brush"),
        ("shoes", "shoe"),
    ];
    if let Some((_, one)) = IRREGULAR.iter().find(|(many, _)| *many == word) {
        return (*one).to_string();
    }
    let untouched =
        word.len() <= 3 || ["ss", "us", "is", "series"].iter().any(|end| word.ends_with(end)) || !word.ends_with('s');
    if untouched {
        return word.to_string();
    }
    if let Some(stem) = word.strip_suffix("ies") {
        return format!("{stem}y");
    }
    for end in ["sses", "shes", "ches", "xes", "zes"] {
        if word.ends_with(end) {
            return word[..word.len() - 2].to_string();
        }
    }
    word[..word.len() - 1].to_string()
}

fn are_look_alikes(a: &str, b: &str) -> bool {
    match (TABLES.look_alikes.get(a), TABLES.look_alikes.get(b)) {
        (Some(a), Some(b)) => a.iter().any(|group| b.contains(group)),
        _ => false,
    }
}

/// The tables of [`crate::vocabulary_tables`], indexed.
struct Tables {
    canonical: HashMap<&'static str, &'static str>,
    /// Numbers of the look-alike groups a class is in.
    look_alikes: HashMap<&'static str, Vec<usize>>,
    /// Labels that stand in for a class.
    stand_ins: HashMap<&'static str, HashSet<&'static str>>,
    group: HashMap<&'static str, &'static str>,
    large: HashSet<&'static str>,
    kinds: Vec<&'static str>,
    kind_of_name: HashMap<&'static str, &'static str>,
    affinities: HashMap<&'static str, Vec<f64>>,
    colors: HashMap<&'static str, [f64; 3]>,
    materials: HashMap<&'static str, &'static str>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let words = |line: &'static str| line.split(',').map(str::trim).filter(|word| !word.is_empty());
    let first_of = |text: &'static str| {
        let mut map = HashMap::new();
        for line in text.lines() {
            let first = words(line).next().unwrap_or_default();
            for word in words(line) {
                map.entry(word).or_insert(first);
            }
        }
        map
    };
    let mut look_alikes: HashMap<&str, Vec<usize>> = HashMap::new();
    for (number, line) in tables::LOOK_ALIKES.lines().enumerate() {
        for word in words(line) {
            look_alikes.entry(word).or_default().push(number);
        }
    }
    let stand_ins = tables::STAND_INS
        .lines()
        .filter_map(|line| words(line).next().map(|first| (first, words(line).skip(1).collect())))
        .collect();
    let mut group = HashMap::new();
    for (name, list) in tables::GROUPS.lines().filter_map(|line| line.split_once(':')) {
        for word in words(list) {
            group.entry(word).or_insert(name);
        }
    }
    let rooms: Vec<Vec<&str>> = tables::ROOMS.lines().map(|line| line.split('|').map(str::trim).collect()).collect();
    let kinds: Vec<&str> = rooms.iter().map(|row| row[0]).collect();
    let mut kind_of_name = HashMap::new();
    let mut affinities: HashMap<&str, Vec<f64>> = HashMap::new();
    for (number, row) in rooms.iter().enumerate() {
        for name in words(row[1]) {
            kind_of_name.entry(name).or_insert(row[0]);
        }
        let contents: Vec<&str> = words(row[2]).collect();
        for (position, word) in contents.iter().enumerate() {
            // The lists are written with the most telling things first.
            let value = 1.0 - 0.6 * position as f64 / contents.len() as f64;
            affinities.entry(word).or_insert_with(|| vec![UNUSUAL; kinds.len()])[number] = value;
        }
    }
    let colors = tables::COLORS.lines().filter_map(|line| {
        let mut parts = line.split(' ');
        let name = parts.next()?;
        let mut value = || parts.next().and_then(|number| number.parse().ok());
        Some((name, [value()?, value()?, value()?]))
    });
    Tables {
        canonical: first_of(tables::SYNONYMS),
        look_alikes,
        stand_ins,
        group,
        large: words(tables::LARGE_OR_FIXED).collect(),
        kinds,
        kind_of_name,
        affinities,
        colors: colors.collect(),
        materials: first_of(tables::MATERIALS),
    }
});

#[cfg(test)]
mod tests {
    use super::*;

    fn similarity(asked: &str, label: &str) -> f64 {
        class_similarity(&Class::new(asked), &Class::new(label))
    }

    #[test]
    fn synonyms_plurals_kinds_and_look_alikes() {
        assert_eq!(similarity("sofas", "Sofa"), 1.0);
        assert_eq!(similarity("couch", "sofa"), 0.95);
        assert_eq!(similarity("garbage bin", "trash_can"), 0.95);
        assert_eq!(similarity("chair", "folding chair"), 0.8);
        assert_eq!(similarity("folding chair", "chair"), 0.55);
        assert_eq!(similarity("table", "coffee table"), 0.8); // a kind of it, though they also look alike
        assert_eq!(similarity("mug", "cup"), 0.5);
        assert_eq!(similarity("unicorn", "horse"), 0.0);
        assert_eq!(similarity("unicorn", "unicorns"), 1.0);
        assert_eq!(similarity("", ""), 0.0);
    }

    #[test]
    fn singular_leaves_words_that_only_look_plural() {
        for (many, one) in [
            ("glasses", "glass"),
            ("glass", "glass"),
            ("boxes", "box"),
            ("stairs", "stairs"),
            ("shelves", "shelf"),
            ("trash cans", "trash can"),
            ("batteries", "battery"),
            ("bus", "bus"),
            ("vases", "vase"),
        ] {
            assert_eq!(singular_phrase(many), one);
        }
    }

    #[test]
    fn a_plural_leads_back_or_is_none() {
        for (one, many) in [
            ("chair", "chairs"),
            ("box", "boxes"),
            ("bookshelf", "bookshelves"),
            ("battery", "batteries"),
            ("tray", "trays"),
            ("trash can", "trash cans"),
            ("couch", "couches"),
            ("stairs", "stairs"),
        ] {
            assert_eq!((plural(one).as_str(), singular_phrase(many).as_str()), (many, one));
        }
    }

    #[test]
    fn contents_tell_the_kind_of_a_room() {
        let contents: Vec<Class> = ["toilet", "sink", "towel"].iter().map(|name| Class::new(name)).collect();
        let best =
            kind_probabilities(&contents).into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("table is not empty");
        assert_eq!(best.0, "bathroom");
        assert!(best.1 > 0.8, "{best:?}");
        let flat = kind_probabilities(&[]);
        assert!(flat.iter().all(|(_, p)| (p - 1.0 / flat.len() as f64).abs() < 1e-12));
        assert_eq!(room_kind("the Conference-Room".trim_start_matches("the ")), Some("meeting room"));
    }

    #[test]
    fn every_table_entry_is_normalised_and_canonical() {
        assert!(TABLES.canonical.keys().all(|name| normalise(name) == *name));
        // A room's name must be its own singular, or it is never found.
        assert!(TABLES.kind_of_name.keys().all(|name| singular_phrase(&normalise(name)) == *name));
        for class in TABLES.affinities.keys().chain(TABLES.group.keys()).chain(TABLES.look_alikes.keys()) {
            assert_eq!(canonical(class).unwrap_or(class), *class, "tables other than the synonyms use canonical names");
        }
        assert_eq!((TABLES.kinds.len(), TABLES.colors.len()), (17, 26));
    }
}
