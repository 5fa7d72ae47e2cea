//! One name for one kind of thing: an open-vocabulary segmenter says "couch" in one frame and "sofa" in the next, and
//! votes for both would be votes against each other.
//!
//! [`LabelNames::canonical`] brings a label into plain form (lower case, single spaces, no article, no stops: Grounding
//! DINO writes "a sofa .") and looks it up. [`SYNONYMS`] is the built-in table; a user's own table comes on top. It holds
//! only words for the *same* thing: a cup is no mug and a stool no chair, since a merged name cannot be told apart again.

use std::borrow::Cow;
use std::collections::BTreeMap;

use thiserror::Error;

use crate::MaskedPanorama;

/// The label of what has no name: votes like any other.
pub const UNKNOWN: &str = "unknown";

/// The built-in table: the name, then other words for the same thing.
#[rustfmt::skip]
pub const SYNONYMS: &[&[&str]] = &[
    &["sofa", "couch", "settee", "loveseat"],
    &["television", "tv", "tv set", "television set", "telly", "tv screen", "flat screen tv"],
    &["monitor", "computer monitor", "computer screen"],
    &["trash bin", "trash can", "garbage can", "garbage bin", "waste bin", "wastebasket", "rubbish bin", "trashcan", "dustbin"],
    &["fridge", "refrigerator", "icebox"],
    &["stove", "cooker", "hob", "cooktop", "stovetop"],
    &["microwave", "microwave oven"],
    &["dishwasher", "dish washer"],
    &["sink", "washbasin", "wash basin", "basin", "kitchen sink", "bathroom sink"],
    &["toilet", "toilet bowl", "commode"],
    &["bathtub", "bath tub", "tub"],
    &["washing machine", "washer", "clothes washer"],
    &["dryer", "tumble dryer", "clothes dryer"],
    &["mug", "coffee mug", "tea mug"],
    &["cup", "teacup", "tea cup", "coffee cup"],
    &["glass", "drinking glass", "water glass"],
    &["bottle", "water bottle"],
    &["pan", "frying pan", "skillet"],
    &["kettle", "electric kettle", "tea kettle", "teakettle"],
    &["coffee machine", "coffee maker", "espresso machine", "coffeemaker"],
    &["office chair", "desk chair", "swivel chair", "task chair", "computer chair"],
    &["armchair", "arm chair", "easy chair", "recliner"],
    &["stool", "bar stool", "barstool"],
    &["ottoman", "footstool", "pouf"],
    &["dining table", "dinner table", "dining room table"],
    &["coffee table", "cocktail table"],
    &["nightstand", "night stand", "bedside table", "night table"],
    &["side table", "end table"],
    &["desk", "writing desk", "office desk", "computer desk"],
    &["conference table", "meeting table", "boardroom table"],
    &["bookshelf", "bookcase", "book shelf", "book case"],
    &["wardrobe", "armoire", "closet"],
    &["dresser", "chest of drawers", "bureau"],
    &["cabinet", "cupboard"],
    &["filing cabinet", "file cabinet"],
    &["counter", "countertop", "kitchen counter", "worktop"],
    &["pillow", "cushion", "throw pillow"],
    &["blanket", "duvet", "quilt", "comforter"],
    &["curtain", "drape", "window curtain"],
    &["rug", "carpet", "area rug"],
    &["floor lamp", "standing lamp"],
    &["plant", "potted plant", "houseplant", "house plant", "pot plant", "indoor plant"],
    &["picture", "painting", "poster", "picture frame", "framed picture"],
    &["clock", "wall clock"],
    &["whiteboard", "white board", "dry erase board"],
    &["laptop", "laptop computer", "notebook computer"],
    &["keyboard", "computer keyboard"],
    &["copier", "photocopier", "copy machine"],
    &["phone", "telephone", "smartphone", "cell phone", "mobile phone", "cellphone"],
    &["backpack", "rucksack", "knapsack"],
    &["suitcase", "luggage"],
    &["box", "cardboard box", "carton"],
    &["laundry basket", "hamper", "laundry hamper"],
    &["coat rack", "coat stand"],
    &["vase", "flower vase"],
    &["radiator", "heater"],
    &["fire extinguisher", "extinguisher"],
    &["water dispenser", "water cooler"],
    &["vending machine", "snack machine"],
    &["toolbox", "tool box", "tool chest"],
    &["vacuum cleaner", "vacuum", "hoover"],
    &["teddy bear", "stuffed animal", "plush toy", "soft toy"],
    &["person", "human", "man", "woman", "people"],
    &["staircase", "stairs", "stair", "stairway"],
    &["workbench", "work bench"],
    &["tv stand", "tv table", "media console"],
];

/// Why a user's table was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LabelTableError {
    /// A line is not of the form `word, word = name`.
    #[error("line {line} has no '='; a line looks like \"couch, settee = sofa\"")]
    NoEquals {
        /// Counted from 1.
        line: usize,
    },
    /// Nothing stands on one side of the '='.
    #[error("line {line} has nothing on one side of the '='; a line looks like \"couch, settee = sofa\"")]
    Empty {
        /// Counted from 1.
        line: usize,
    },
}

/// The names of things, and which words stand for them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelNames {
    /// From other words to names. No name is a key, so that a canonical label is its own canonical label.
    name_of: BTreeMap<String, String>,
}

impl Default for LabelNames {
    /// The built-in table.
    fn default() -> LabelNames {
        let pairs = SYNONYMS.iter().flat_map(|words| words[1..].iter().map(|word| (word.to_string(), words[0].into())));
        LabelNames { name_of: pairs.collect() }
    }
}

impl LabelNames {
    /// No synonyms at all: labels are only brought into plain form.
    pub fn none() -> LabelNames {
        LabelNames { name_of: BTreeMap::new() }
    }

    /// Adds a user's table: a line `couch, settee = sofa` makes both words mean the last one. `#` begins a comment. What
    /// the table says counts more than what was said before.
    ///
    /// # Errors
    /// [`LabelTableError`] names the first line that cannot be read; nothing is added then.
    pub fn add_table(&mut self, text: &str) -> Result<(), LabelTableError> {
        let mut pairs = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() {
                continue;
            }
            let (words, name) = line.split_once('=').ok_or(LabelTableError::NoEquals { line: index + 1 })?;
            let name = plain(name).into_owned();
            let words: Vec<String> = words.split(',').map(|word| plain(word).into_owned()).collect();
            if name.is_empty() || words.iter().any(String::is_empty) {
                return Err(LabelTableError::Empty { line: index + 1 });
            }
            pairs.extend(words.into_iter().map(|word| (word, name.clone())));
        }
        pairs.into_iter().for_each(|(word, name)| self.add(word, name));
        Ok(())
    }

    /// From now on `word` means `name`, and so does everything that meant `word`.
    fn add(&mut self, word: String, name: String) {
        let known = self.name_of.get(&name).cloned();
        let name = match known {
            // The user turns a pair of the table round: "sofa = couch".
            Some(known) if known == word => {
                self.name_of.remove(&name);
                name
            }
            Some(known) => known,
            None => name,
        };
        if word == name {
            return;
        }
        self.name_of.values_mut().filter(|meaning| **meaning == word).for_each(|meaning| meaning.clone_from(&name));
        self.name_of.insert(word, name);
    }

    /// The name that stands for a label; [`UNKNOWN`] for an empty one. A word that no table knows stands for itself.
    pub fn canonical<'a>(&'a self, label: &'a str) -> Cow<'a, str> {
        let plain = plain(label);
        if plain.is_empty() {
            return Cow::Borrowed(UNKNOWN);
        }
        if let Some(name) = self.name_of.get(&*plain) {
            return Cow::Borrowed(name);
        }
        // "sofas" and "boxes" are known by their singular; words that are not known keep their form.
        if !plain.ends_with('s') || self.name_of.values().any(|name| **name == *plain) {
            return plain;
        }
        let singulars = ["s", "es"].into_iter().filter_map(|end| plain.strip_suffix(end));
        for singular in singulars.filter(|word| word.len() >= 3) {
            if let Some(name) = self.name_of.get(singular).or_else(|| self.name_of.values().find(|n| **n == singular)) {
                return Cow::Borrowed(name);
            }
        }
        plain
    }

    /// Gives all masks their canonical labels.
    pub fn apply(&self, panorama: &mut MaskedPanorama) {
        for mask in &mut panorama.masks {
            let name = self.canonical(&mask.label);
            if name != mask.label {
                mask.label = name.into_owned();
            }
        }
    }
}

/// Lower case, single spaces, no article at the front, nothing but letters, digits and inner marks.
fn plain(label: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_lowercase() || c.is_ascii_digit() || c == ' ' || c == '-';
    let is_clean = label.chars().all(is_plain) && !label.contains("  ") && label.trim() == label;
    let has_article = |text: &str| ["a ", "an ", "the "].into_iter().any(|article| text.starts_with(article));
    if is_clean && !has_article(label) {
        return Cow::Borrowed(label);
    }
    let lower = label.to_lowercase();
    let is_edge = |c: char| !c.is_alphanumeric();
    let mut words: Vec<&str> = lower.split_whitespace().map(|word| word.trim_matches(is_edge)).collect();
    words.retain(|word| !word.is_empty());
    while words.len() > 1 && ["a", "an", "the"].contains(&words[0]) {
        words.remove(0);
    }
    Cow::Owned(words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(names: &LabelNames, label: &str, expected: &str) {
        assert_eq!(names.canonical(label), expected, "{label:?}");
    }

    #[test]
    fn labels_as_segmenters_write_them() {
        let names = LabelNames::default();
        for (label, expected) in [
            ("couch", "sofa"),
            ("A Couch .", "sofa"),
            ("the  TV", "television"),
            ("Sofas", "sofa"),
            ("couches", "sofa"),
            ("boxes", "box"),
            ("glass", "glass"),
            ("bus", "bus"),
            ("mug", "mug"),
            ("cup", "cup"), // a look-alike, no synonym
            ("chest of drawers", "dresser"),
            ("chaise-longue", "chaise-longue"),
            ("Fauteuil d'oreilles", "fauteuil d'oreilles"),
            ("  ", UNKNOWN),
            ("...", UNKNOWN),
            ("a", "a"),
        ] {
            check(&names, label, expected);
        }
        check(&LabelNames::none(), "Couch.", "couch");
    }

    #[test]
    fn a_users_table_counts_more() {
        let mut names = LabelNames::default();
        names.add_table("# ours\nchesterfield, daybed = couch\n\nsofa = divan # as we say").expect("sound");
        for word in ["chesterfield", "daybed", "couch", "sofa", "settee"] {
            check(&names, word, "divan");
        }
        let mut turned = LabelNames::default();
        turned.add_table("sofa = couch").expect("sound");
        for word in ["sofa", "couch", "settee"] {
            check(&turned, word, "couch");
        }
        let before = names.clone();
        assert_eq!(names.add_table("a couch = x\nmug"), Err(LabelTableError::NoEquals { line: 2 }));
        assert_eq!(names.add_table("mug, = cup"), Err(LabelTableError::Empty { line: 1 }));
        assert_eq!(names.add_table("mug = ."), Err(LabelTableError::Empty { line: 1 }));
        assert_eq!(names, before);
    }

    #[test]
    fn no_word_of_the_table_stands_for_two_things() {
        let words: Vec<&str> = SYNONYMS.iter().flat_map(|words| words.iter().copied()).collect();
        let mut sorted = words.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), words.len());
        let names = LabelNames::default();
        for group in SYNONYMS {
            for word in *group {
                check(&names, word, group[0]);
                assert_eq!(plain(word), *word);
            }
        }
    }
}
