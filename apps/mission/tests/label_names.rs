//! Labels that were merged under one name still answer to their other words: the table of the perception crate and the
//! vocabulary of the prompt crate must agree, though neither knows the other.

use mission::octant_prompt::vocabulary::{Class, class_similarity};
use mission::omni_perception::LabelNames;
use mission::omni_perception::label_names::SYNONYMS;
use mission::segmenter::STANDING;

#[test]
fn a_merged_label_is_still_found_by_its_other_words() {
    let wrong: Vec<String> = SYNONYMS
        .iter()
        .flat_map(|words| words[1..].iter().map(|word| (words[0], *word)))
        .map(|(name, word)| (name, word, class_similarity(&Class::new(word), &Class::new(name))))
        .filter(|(_, _, similarity)| *similarity < 0.8)
        .map(|(name, word, similarity)| format!("{word} -> {name}: {similarity}"))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn the_standing_list_is_in_canonical_words() {
    let names = LabelNames::default();
    for phrase in STANDING {
        assert_eq!(names.canonical(phrase), *phrase);
    }
}
