//! "Come back to where you started": clauses that send the robot back to its start and name nothing else.

use crate::lexicon::Token;

/// Words of going.
const GOING: &[&str] = &[
    "return", "come", "go", "back", "get", "fly", "walk", "drive", "move", "head", "travel", "navigate", "run",
    "proceed", "bring", "yourself",
];
/// Words that say nothing about where.
const LINKS: &[&str] = &[
    "to", "the", "a", "your", "its", "at", "from", "where", "you", "it", "that", "which", "place", "point", "position",
    "spot", "location", "all", "way", "now", "were", "was", "here", "and", "for", "towards", "toward",
];
/// Words for the start.
const STARTS: &[&str] = &[
    "start",
    "started",
    "starting",
    "startpoint",
    "begin",
    "began",
    "begun",
    "beginning",
    "origin",
    "original",
    "initial",
    "base",
    "home",
    "came",
    "launch",
    "takeoff",
    "departed",
    "departure",
    "initially",
    "originally",
];

/// All of them.
pub(crate) fn way_home_words() -> impl Iterator<Item = &'static str> {
    GOING.iter().chain(LINKS).chain(STARTS).copied()
}

/// Whether a clause is about the way back to the start and about nothing else: "go back to the kitchen" is not, "come back" is.
pub(crate) fn is_way_home(clause: &[Token]) -> bool {
    let words = || clause.iter().flat_map(|token| token.text.split(' ')).filter(|word| *word != ",");
    let is_known = |word: &str| GOING.contains(&word) || LINKS.contains(&word) || STARTS.contains(&word);
    let goes = words().any(|word| GOING.contains(&word));
    let to_start = words().any(|word| STARTS.contains(&word) || matches!(word, "back" | "return"));
    goes && to_start && words().all(is_known)
}

#[cfg(test)]
mod tests {
    use crate::{StepKind, parse_instruction};

    fn kinds(text: &str) -> Vec<StepKind> {
        parse_instruction(text).steps.iter().map(|step| step.kind).collect()
    }

    #[test]
    fn the_way_home_has_many_names() {
        for text in [
            "come back to where you started",
            "Return to start.",
            "return to the starting point",
            "please fly back to your starting position",
            "go back to where you came from",
            "come back",
            "go home",
            "Go back to the beginning!",
            "return to base now",
            "head back to the place where you started",
        ] {
            assert_eq!(kinds(text), [StepKind::ReturnToStart], "{text}");
        }
        for text in [
            "find the mug, then come back to where you started",
            "find the mug and return to the start",
            "find the mug and come back",
        ] {
            assert_eq!(kinds(text), [StepKind::FindObject, StepKind::ReturnToStart], "{text}");
        }
    }

    #[test]
    fn a_thing_or_a_room_is_no_start() {
        assert_eq!(kinds("go back to the kitchen"), [StepKind::GoToRoom]);
        assert_eq!(kinds("return to the chair near the window"), [StepKind::FindObject]);
        assert_eq!(kinds("go to the back of the sofa").last(), Some(&StepKind::FindObject));
        assert_eq!(kinds("find the base of the lamp").last(), Some(&StepKind::FindObject));
        assert!(parse_instruction("come back to where you started").nouns().is_empty());
    }
}
