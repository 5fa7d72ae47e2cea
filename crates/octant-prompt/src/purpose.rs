//! "The thing you boil water with": things and rooms that are named by what they are for.
//!
//! Works on words, before the grammar: a vague noun with a clause about its use ("something to sit on", "the machine that dries clothes"),
//! or a wish ("I want to print something", "where can I wash my hands"), is replaced by the class of that use. The tables of uses are prior
//! knowledge, like the synonyms; of several uses that are said the one with the most words wins.

use std::sync::LazyLock;

use crate::instruction::Reading;
use crate::vocabulary::{canonical, room_kind};
use crate::vocabulary_tables::{ROOM_USES, USES};

/// Nouns that name nothing.
const VAGUE: [&str; 19] = [
    "thing",
    "things",
    "something",
    "somewhere",
    "place",
    "spot",
    "device",
    "machine",
    "appliance",
    "object",
    "item",
    "furniture",
    "gadget",
    "tool",
    "instrument",
    "stuff",
    "equipment",
    "apparatus",
    "anything",
];
/// Words with which a clause about a use goes on.
const OPENINGS: [&str; 24] = [
    "that", "which", "you", "i", "we", "one", "people", "someone", "somebody", "to", "where", "for", "with", "on",
    "in", "at", "from", "can", "used", "whose", "they", "it", "used", "meant",
];
/// Wishes, before their verb.
const WISHES: [&str; 28] = [
    "i want to",
    "i need to",
    "i have to",
    "i would like to",
    "id like to",
    "i must",
    "i wanna",
    "i want a",
    "we want to",
    "we need to",
    "we have to",
    "where can i",
    "where could i",
    "where do i",
    "where do you",
    "where does one",
    "where can one",
    "where can you",
    "let me",
    "i gotta",
    "i am going to",
    "i like to",
    "what can i",
    "what could i",
    "what do i",
    "with what can i",
    "where do we",
    "where can we",
];
/// Where a clause ends.
fn is_end(word: &str) -> bool {
    matches!(word, "," | "." | "then")
}

/// Other classes that are meant as much as the first.
pub(crate) type Also = Vec<(String, Vec<String>)>;

/// Words with what is named by its use named by its class; and what was read for what.
pub(crate) fn named(words: Vec<String>) -> (Vec<String>, Vec<Reading>, Also) {
    let (mut readings, mut also) = (Vec::new(), Also::new());
    let mut out: Vec<String> = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let found = vague(&words, at).or_else(|| wish(&words, at));
        let Some(Named { class, others, said, rest, is_wish }) = found else {
            out.push(words[at].clone());
            at += 1;
            continue;
        };
        if is_wish {
            out.extend(["find", "the"].map(str::to_owned));
        }
        let confidence = said.1;
        readings.push(Reading { said: said.0, meant: class.clone(), confidence });
        out.extend(class.split(' ').map(str::to_owned));
        out.extend(rest.0);
        if !others.is_empty() {
            also.push((class, others));
        }
        at = rest.1;
    }
    (out, readings, also)
}

struct Named {
    class: String,
    others: Vec<String>,
    said: (String, f64),
    /// Words of the clause that are kept, and where the next clause begins.
    rest: (Vec<String>, usize),
    is_wish: bool,
}

/// A vague noun at `at`, and the clause about its use.
fn vague(words: &[String], at: usize) -> Option<Named> {
    let word = words[at].as_str();
    let is_asked = at > 0 && matches!(words[at - 1].as_str(), "which" | "what");
    // "go where one cooks", "bring me to what you print with"
    let is_free = match word {
        "where" => at > 0 && matches!(words[at - 1].as_str(), "go" | "to" | "me" | "drive" | "fly" | "walk"),
        "what" => words.get(at + 1).is_some_and(|next| matches!(next.as_str(), "you" | "i" | "we" | "one" | "people")),
        _ => false,
    };
    let is_room = matches!(word, "room" | "where");
    if !is_free && word != "room" && !VAGUE.contains(&words[at].as_str()) {
        return None;
    }
    let is_name = |from: usize| {
        canonical(&words[from..=at].join(" ")).is_some() || room_kind(&words[from..=at].join(" ")).is_some()
    };
    if (at.saturating_sub(3)..at).any(is_name) {
        return None; // "the coffee machine"
    }
    let next = words.get(at + 1)?;
    if !(is_free || is_asked || OPENINGS.contains(&next.as_str()))
        || (is_room && matches!(next.as_str(), "with" | "on" | "in" | "at"))
    {
        return None;
    }
    let end = (at..words.len()).find(|index| is_end(&words[*index])).unwrap_or(words.len());
    let clause = &words[at + 1..end];
    let table = if is_room { &*ROOM_TABLE } else { &*TABLE };
    // What it is for may be said in another sentence: "there is a fire! get the thing that puts it out".
    let (row, hits) = best(table, &words[at..end]).or_else(|| best(table, words))?;
    let rest = place_in(clause);
    let said = (words[at..end].join(" "), confidence(hits));
    // "what I need is a towel" names it.
    if word == "what" && clause.iter().any(|word| matches!(word.as_str(), "is" | "need" | "want")) {
        return None;
    }
    Some(Named { class: row.class.clone(), others: row.others.clone(), said, rest: (rest, end), is_wish: false })
}

/// A wish at `at`, up to the end of its clause.
fn wish(words: &[String], at: usize) -> Option<Named> {
    let opening = WISHES.iter().find(|wish| {
        let parts: Vec<&str> = wish.split(' ').collect();
        words[at..].iter().map(String::as_str).take(parts.len()).eq(parts.iter().copied())
    })?;
    let begin = at + opening.split(' ').count();
    let end = (begin..words.len()).find(|index| is_end(&words[*index])).unwrap_or(words.len());
    let clause = &words[begin..end];
    // "I want to go to the kitchen" says where.
    let names_a_thing = clause.windows(2).any(|pair| pair[0] == "the" && is_name(&pair[1]))
        || clause.first().is_some_and(|word| {
            matches!(word.as_str(), "go" | "find" | "see" | "get" | "visit" | "reach")
                && clause.len() > 1
                && best(&TABLE, clause).is_none()
        });
    if names_a_thing {
        return None;
    }
    let (row, hits) = best(&TABLE, clause)?;
    let rest = place_in(clause);
    let said = (words[at..end].join(" "), confidence(hits));
    Some(Named { class: row.class.clone(), others: row.others.clone(), said, rest: (rest, end), is_wish: true })
}

fn is_name(word: &str) -> bool {
    canonical(word).is_some() || room_kind(word).is_some()
}

/// One word may be said by chance; several hardly.
fn confidence(hits: usize) -> f64 {
    1.0 - 0.5_f64.powi(hits as i32)
}

/// "in the lab": what a clause says about the room, which is kept.
fn place_in(clause: &[String]) -> Vec<String> {
    for at in 0..clause.len() {
        if !matches!(clause[at].as_str(), "in" | "from") {
            continue;
        }
        let article =
            usize::from(clause.get(at + 1).is_some_and(|word| matches!(word.as_str(), "the" | "my" | "our" | "a")));
        let from = at + 1 + article;
        let is_room = |until: usize| room_kind(&clause[from..until].join(" ")).is_some();
        if let Some(until) = (from + 1..=(from + 3).min(clause.len())).rev().find(|until| is_room(*until)) {
            return clause[at..until].to_vec();
        }
    }
    Vec::new()
}

struct Row {
    class: String,
    others: Vec<String>,
    uses: Vec<Vec<String>>,
}

static TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| rows(USES));
static ROOM_TABLE: LazyLock<Vec<Row>> = LazyLock::new(|| rows(ROOM_USES));

fn rows(table: &str) -> Vec<Row> {
    let list = |line: &str| -> Vec<String> { line.split(',').map(|part| part.trim().to_owned()).collect() };
    let row = |line: &str| {
        let (classes, uses) = line.split_once(':')?;
        let mut classes = list(classes).into_iter();
        let uses = list(uses).iter().map(|phrase| phrase.split(' ').map(stem).collect()).collect();
        Some(Row { class: classes.next()?, others: classes.collect(), uses })
    };
    table.lines().filter_map(row).collect()
}

/// The row of which the longest use is said, with the number of its words; the first of those.
fn best<'a>(table: &'a [Row], said: &[String]) -> Option<(&'a Row, usize)> {
    let said: Vec<String> = said.iter().map(|word| stem(word)).collect();
    let mut best: Option<(&Row, usize)> = None;
    for row in table {
        let hits = row.uses.iter().filter(|stems| stems.iter().all(|stem| said.contains(stem))).map(Vec::len).max();
        if let Some(hits) = hits.filter(|hits| best.is_none_or(|(_, most)| *hits > most)) {
            best = Some((row, hits));
        }
    }
    best
}

/// A word without its ending: boils, boiling, boiled and boil are one.
fn stem(word: &str) -> String {
    let irregular = match word {
        "slept" => "sleep",
        "threw" | "thrown" => "throw",
        "hung" => "hang",
        "ate" | "eaten" => "eat",
        "made" => "make",
        "sat" | "seat" => return word.into(),
        "kept" => "keep",
        "dishes" => "dish",
        "clothing" | "clothes" | "cloths" => return "clothes".into(),
        "during" | "thing" | "bring" => return word.into(),
        "things" => return "thing".into(),
        "leaves" => "leaf",
        other => other,
    };
    let mut stem = irregular.to_owned();
    for ending in ["ing", "ed", "es", "s"] {
        if let Some(cut) = stem.strip_suffix(ending).filter(|cut| cut.len() >= 3) {
            stem = cut.to_owned();
            break;
        }
    }
    if stem.ends_with("ie") && word.ends_with('s') || stem.ends_with('i') {
        stem = format!("{}y", stem.trim_end_matches('e').trim_end_matches('i'));
    }
    let doubled = stem.len() > 3 && stem.as_bytes()[stem.len() - 1] == stem.as_bytes()[stem.len() - 2];
    if doubled && !stem.ends_with("ss") && !stem.ends_with("ll") {
        stem.pop(); // sitting, getting
    }
    if stem.len() > 3 && stem.ends_with('e') {
        stem.pop();
    }
    stem
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        named(text.split(' ').map(str::to_owned).collect()).0.join(" ")
    }

    #[test]
    fn things_by_their_use() {
        for (said, meant) in [
            ("take me to the thing you boil water with", "take me to the kettle"),
            ("find the machine that dries the clothes in the laundry room", "find the dryer in the laundry room"),
            ("something to sit on", "chair"),
            ("i want to print something", "find the printer"),
            ("where can i wash my hands", "find the sink"),
            ("go to the room where i sleep", "go to the bedroom"),
            ("a place to throw this away", "a trash can"),
            ("there is a fire . get the thing that puts it out", "there is a fire . get the fire extinguisher"),
            ("the coffee machine that makes coffee", "the coffee machine that makes coffee"),
            ("i want to go to the kitchen", "i want to go to the kitchen"),
            ("the thing on the table", "the thing on the table"),
            ("find the machine", "find the machine"),
        ] {
            assert_eq!(read(said), meant, "{said}");
        }
    }

    #[test]
    fn forms_of_a_word_have_one_stem() {
        for forms in [
            ["boil", "boils", "boiling", "boiled"],
            ["bake", "bakes", "baking", "baked"],
            ["dry", "dries", "drying", "dried"],
        ] {
            assert!(forms.iter().all(|form| stem(form) == stem(forms[0])), "{forms:?}");
        }
        assert_eq!(stem("sitting"), stem("sits"));
        assert_ne!(stem("seat"), stem("sea"));
    }

    #[test]
    fn every_class_of_the_uses_is_canonical() {
        for row in TABLE.iter() {
            for class in row.others.iter().chain([&row.class]) {
                assert_eq!(canonical(class), Some(class.as_str()));
            }
        }
        assert!(ROOM_TABLE.iter().all(|row| room_kind(&row.class) == Some(row.class.as_str())));
    }
}
