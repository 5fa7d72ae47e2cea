//! Words that nobody knows, and the words they were meant to be: a noisy channel over the vocabulary.
//!
//! Writing a word wrong costs less for the slips that hands and ears make (two letters swapped, one letter doubled or not, a vowel for
//! another, a key beside the right one) than for others; a word is taken for the cheapest word of the vocabulary if that costs no more
//! than a share of its length and no other word costs about as much. What is respelled keeps what was written ([`Class::said`]): a thing
//! that bears that very name wins over the reading.
//!
//! [`Class::said`]: crate::vocabulary::Class::said

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use crate::instruction::Reading;
use crate::lexicon::phrases;
use crate::vocabulary::{class_phrases, plural, room_names, singular_phrase, word_lists};
use crate::vocabulary_tables::ORDINARY;

/// Costs of slips; any other letter that is wrong, missing or too much costs 1.
const SWAPPED: f64 = 0.7;
const DOUBLED: f64 = 0.5;
const VOWEL: f64 = 0.8;
const BESIDE: f64 = 0.8;
const MISSING: f64 = 0.9;
/// Hardly anybody writes the first letter wrong: on top of what the slip costs.
const FIRST: f64 = 0.7;
/// Most that may be wrong, of the length of the shorter word: a swap in three letters, a letter in four, two in nine.
const LIMIT: f64 = 0.24;
/// Another word that costs so little more leaves it open which is meant.
const APART: f64 = 0.15;
/// Longer words are not looked at.
const LONGEST: usize = 24;

/// Respells `words` (lower case) and says what was read for what. Words of the vocabulary and ordinary words stay as they are.
pub(crate) fn respelled(words: Vec<String>) -> (Vec<String>, Vec<Reading>) {
    let mut readings: Vec<Reading> = Vec::new();
    let mut out: Vec<String> = Vec::new();
    let mut at = 0;
    while at < words.len() {
        if let Some(joined) = words.get(at + 1).and_then(|next| joined(&words[at], next)) {
            out.push(joined);
            at += 2;
            continue;
        }
        let word = &words[at];
        at += 1;
        let Some((meant, confidence)) = meant_by(word) else {
            out.push(word.clone());
            continue;
        };
        out.extend(meant.split(' ').map(str::to_owned));
        if readings.iter().all(|reading| reading.said != *word) {
            readings.push(Reading { said: word.clone(), meant, confidence });
        }
    }
    (out, readings)
}

/// "lap top", "key board": two words that are one, if not both are words by themselves.
fn joined(first: &str, second: &str) -> Option<String> {
    let is_word = |word: &str| word.len() >= 2 && word.bytes().all(|byte| byte.is_ascii_lowercase());
    if !is_word(first) || !is_word(second) || (is_spelled(first) && is_spelled(second)) {
        return None;
    }
    let joined = format!("{first}{second}");
    WORDS.targets.get(joined.as_str()).filter(|meant| **meant == joined).cloned()
}

/// The word of the vocabulary that an unknown word was meant to be, and how sure that is; None if it is spelled right, or means nothing.
fn meant_by(word: &str) -> Option<(String, f64)> {
    let is_word = (3..=LONGEST).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_lowercase());
    if !is_word || is_spelled(word) {
        return None;
    }
    // "diningtable"
    if let Some(meant) = WORDS.targets.get(word) {
        return Some((meant.clone(), 0.99));
    }
    let stem = word.strip_suffix('s').filter(|stem| stem.len() >= 3 && !stem.ends_with('s'));
    let several = || closest(stem?).map(|(meant, confidence)| (plural(&meant), confidence));
    several().or_else(|| closest(word))
}

fn closest(word: &str) -> Option<(String, f64)> {
    let mut best: Option<(f64, &str)> = None;
    let mut second = f64::INFINITY;
    for (target, meant) in &WORDS.targets {
        if target.len().abs_diff(word.len()) > 3 {
            continue;
        }
        let limit = LIMIT * word.len().min(target.len()) as f64;
        let cost = cost(word.as_bytes(), target.as_bytes());
        if cost > limit {
            continue;
        }
        match best {
            Some((least, known)) if cost >= least => {
                if known != meant {
                    second = second.min(cost);
                }
            }
            _ => {
                second = best.filter(|(_, known)| known != meant).map_or(second, |(least, _)| second.min(least));
                best = Some((cost, meant));
            }
        }
    }
    let (cost, meant) = best?;
    (second - cost >= APART).then(|| (meant.to_owned(), 1.0 - cost / word.len() as f64))
}

/// Cost of writing `word` for `target`: Damerau and Levenshtein's distance (adjacent swaps), with weights.
fn cost(word: &[u8], target: &[u8]) -> f64 {
    let (n, m) = (word.len(), target.len());
    let mut rows = vec![vec![0.0_f64; m + 1]; n + 1];
    let first = |i: usize, j: usize| if i == 0 || j == 0 { FIRST } else { 0.0 };
    for i in 1..=n {
        rows[i][0] = rows[i - 1][0] + 1.0 + FIRST;
    }
    for j in 1..=m {
        rows[0][j] = rows[0][j - 1] + MISSING + FIRST;
    }
    for i in 1..=n {
        for j in 1..=m {
            let (a, b) = (word[i - 1], target[j - 1]);
            let replaced = if a == b { 0.0 } else { slip(a, b) + first(i - 1, j - 1) };
            let too_much = if i > 1 && word[i - 2] == a { DOUBLED } else { if is_vowel(a) { VOWEL } else { 1.0 } };
            let missing = if j > 1 && target[j - 2] == b { DOUBLED } else { if is_vowel(b) { VOWEL } else { MISSING } };
            let mut least = (rows[i - 1][j - 1] + replaced)
                .min(rows[i - 1][j] + too_much + first(i - 1, j))
                .min(rows[i][j - 1] + missing + first(i, j - 1));
            if i > 1 && j > 1 && a == target[j - 2] && word[i - 2] == b && a != b {
                least = least.min(rows[i - 2][j - 2] + SWAPPED + if i == 2 { FIRST - 0.5 } else { 0.0 });
            }
            rows[i][j] = least;
        }
    }
    rows[n][m]
}

/// Cost of one letter for another.
fn slip(a: u8, b: u8) -> f64 {
    const ROWS: [&[u8]; 3] = [b"qwertyuiop", b"asdfghjkl", b"zxcvbnm"];
    const ALIKE: [&[u8]; 5] = [b"ckqs", b"sz", b"fv", b"dt", b"gj"];
    if is_vowel(a) && is_vowel(b) {
        return VOWEL;
    }
    let is_beside = ROWS.iter().any(|row| row.windows(2).any(|pair| pair == [a, b] || pair == [b, a]));
    if is_beside || ALIKE.iter().any(|group| group.contains(&a) && group.contains(&b)) { BESIDE } else { 1.0 }
}

fn is_vowel(letter: u8) -> bool {
    b"aeiouy".contains(&letter)
}

/// Whether a word needs no other reading.
fn is_spelled(word: &str) -> bool {
    WORDS.known.contains(word) || WORDS.known.contains(singular_phrase(word).as_str())
}

struct Words {
    /// Words that are spelled right.
    known: BTreeSet<String>,
    /// What a word can be respelled to, and what that is: names of classes that are written apart stand here in one, too.
    targets: BTreeMap<String, String>,
}

static WORDS: LazyLock<Words> = LazyLock::new(|| {
    let mut known: BTreeSet<String> = BTreeSet::new();
    let mut targets: BTreeMap<String, String> = BTreeMap::new();
    let mut add = |word: &str| {
        known.insert(word.to_owned());
        if word.len() >= 3 && word.bytes().all(|byte| byte.is_ascii_lowercase()) {
            targets.insert(word.to_owned(), word.to_owned());
        }
    };
    let names = || class_phrases().chain(room_names());
    phrases().chain(names()).chain(word_lists()).flat_map(|phrase| phrase.split(' ')).for_each(&mut add);
    for name in names().filter(|name| name.contains(' ')) {
        let compact = name.replace(' ', "");
        targets.entry(compact).or_insert_with(|| name.to_owned());
    }
    known.extend(ORDINARY.split_whitespace().map(str::to_owned));
    Words { known, targets }
});

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> String {
        respelled(text.split(' ').map(str::to_owned).collect()).0.join(" ")
    }

    #[test]
    fn slips_of_hand_and_ear() {
        for (said, meant) in [
            ("chiar", "chair"),
            ("chiars", "chairs"),
            ("cofee", "coffee"),
            ("frigde", "fridge"),
            ("refridgerator", "refrigerator"),
            ("kithcen", "kitchen"),
            ("bokshelf", "bookshelf"),
            ("televison", "television"),
            ("vaccum", "vacuum"),
            ("teh", "the"),
            ("mgu", "mug"),
            ("lmap", "lamp"),
            ("matress", "mattress"),
            ("cofeemachine", "coffee machine"),
            ("diningtable", "dining table"),
            ("lap top", "laptop"),
            ("wadrobe", "wardrobe"),
            ("umbrela", "umbrella"),
        ] {
            assert_eq!(read(said), meant, "{said}");
        }
    }

    #[test]
    fn words_that_are_other_words_stay() {
        for text in [
            "unicorn",
            "piano",
            "goat",
            "boat",
            "chain",
            "tower",
            "coach",
            "beach",
            "zorblax",
            "flux capacitor",
            "lamb",
        ] {
            assert_eq!(read(text), text);
        }
    }

    #[test]
    fn every_word_of_the_vocabulary_is_spelled_right() {
        for phrase in class_phrases().chain(room_names()) {
            assert_eq!(read(phrase), phrase);
        }
    }

    #[test]
    fn the_surer_the_less_was_wrong() {
        let confidence = |word: &str| respelled(vec![word.to_owned()]).1[0].confidence;
        assert!(confidence("cofffee") > confidence("coofee") && confidence("refridgerator") > confidence("frigde"));
        let (_, readings) = respelled(vec!["chiar".into(), "chiar".into()]);
        assert_eq!(readings.len(), 1);
        assert_eq!((readings[0].said.as_str(), readings[0].meant.as_str()), ("chiar", "chair"));
    }
}
