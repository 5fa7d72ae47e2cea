//! Round the grammar: before it, words are made plain; after it, talk that is no step is left out, and what was written for a word is kept.

use crate::instruction::{Reading, Referring, Step, StepKind};
use crate::purpose::Also;
use crate::vocabulary::{Class, is_known, singular_phrase};

/// "bedroom number 2" is bedroom 2, and "a mug or a cup" is a mug first of all.
pub(crate) fn plain(words: Vec<String>) -> Vec<String> {
    let is_number = |word: Option<&String>| word.is_some_and(|word| word.bytes().all(|byte| byte.is_ascii_digit()));
    let is_kept = |at: &usize| !(matches!(words[*at].as_str(), "number" | "nr" | "no") && is_number(words.get(at + 1)));
    let word = |at: usize| match words[at].as_str() {
        "or" => ",".to_owned(),
        // "take me 2 the kitchen"
        "2" if matches!(words.get(at + 1).map(String::as_str), Some("the" | "my" | "a")) && at > 0 => "to".to_owned(),
        word => word.to_owned(),
    };
    (0..words.len()).filter(is_kept).map(word).collect()
}

/// "I am tired, find the bed": a clause without a verb of going or finding, about what nobody has a word for, is no step beside one that
/// is. So is one about nothing but "a place".
pub(crate) fn leave_out_talk(steps: &mut Vec<Step>, are_said: &[bool]) {
    let is_vague = |goal: &Referring| {
        goal.relations.is_empty()
            && goal.room.is_none()
            && matches!(goal.class.text.as_str(), "place" | "somewhere" | "spot" | "thing")
    };
    let names = |step: &Step| step.kind != StepKind::FindObject || is_known(&step.goal.class);
    let is_talk = |step: &Step, is_said: bool| !names(step) && (is_said || is_vague(&step.goal));
    if steps.iter().zip(are_said).all(|(step, is_said)| is_talk(step, *is_said)) {
        return;
    }
    let mut index = 0;
    steps.retain(|step| {
        index += 1;
        !is_talk(step, are_said[index - 1])
    });
}

/// What was written for the words of a class, and the classes that are meant as much.
pub(crate) fn keep_what_was_said(class: &mut Class, readings: &[Reading], also: &Also) {
    for reading in readings {
        let (said, meant) = (singular_phrase(&reading.said), singular_phrase(&reading.meant));
        let is_in_it = format!(" {} ", class.text).contains(&format!(" {meant} "));
        if is_in_it {
            let text = class.said.take().unwrap_or_else(|| class.text.clone());
            class.said = Some(text.replace(&meant, &said));
        }
    }
    if let Some((_, others)) = also.iter().find(|(first, _)| *first == class.canonical) {
        class.also.clone_from(others);
    }
}

/// Calls `visit` for the expression and every nested one.
pub(crate) fn visit_mut(goal: &mut Referring, visit: &mut dyn FnMut(&mut Referring)) {
    visit(goal);
    for anchor in goal.relations.iter_mut().flat_map(|clause| &mut clause.anchors) {
        visit_mut(anchor, visit);
    }
    for room in goal.room.iter_mut().chain(&mut goal.excluded_rooms) {
        room.contains.iter_mut().for_each(|content| visit_mut(content, visit));
    }
}
