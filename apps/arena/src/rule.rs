//! When an errand counts as done: mostly where the right thing is reached; where there is no such thing, when the robot says so; where
//! the words fit several, when it asked before it went.

use serde::{Deserialize, Serialize};

/// How a sentence is judged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The robot stops at one of the targets.
    #[default]
    Reach,
    /// There is no such thing: the robot stops at nothing and says what is not there.
    SayWhatIsMissing,
    /// The words fit several things: the robot asks which, and stops at one of the targets.
    AskAndReach,
}

impl Rule {
    /// The verdict, from that on a plain errand, from the sentence with which the robot gave up, if it did, and from how often it asked.
    pub fn judge(self, text: &str, plain: (bool, String), gave_up: Option<&str>, questions: usize) -> (bool, String) {
        match self {
            Rule::Reach => plain,
            Rule::SayWhatIsMissing => match gave_up {
                Some(reason) if names_what_is_missing(reason, text) => (true, format!("The robot said so: {reason}")),
                // Without targets no place is the right one.
                _ => (false, plain.1),
            },
            Rule::AskAndReach if plain.0 && questions == 0 => {
                (false, "The robot stopped at one of several things that fit the words, and did not ask which.".into())
            }
            Rule::AskAndReach if plain.0 => (true, format!("The robot asked which one. {}", plain.1)),
            Rule::AskAndReach => plain,
        }
    }
}

/// Whether a sentence says "there is no ..." of something that the instruction speaks of.
fn names_what_is_missing(reason: &str, text: &str) -> bool {
    let Some((_, rest)) = reason.split_once("There is no ") else { return false };
    let missing = rest.split(" here").next().unwrap_or(rest).to_lowercase();
    let said: Vec<String> = text.to_lowercase().split(|c: char| !c.is_alphanumeric()).map(str::to_owned).collect();
    let mut words = missing.split(|c: char| !c.is_alphanumeric()).filter(|word| word.len() > 2 && *word != "the");
    words.any(|word| said.iter().any(|other| other == word || other.strip_suffix('s') == Some(word)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_has_to_be_said() {
        let judge = |plain: bool, gave_up: Option<&str>| {
            Rule::SayWhatIsMissing.judge("Find the red sofas!", (plain, "plain".into()), gave_up, 0).0
        };
        assert!(judge(false, Some("There is no red sofa here: I searched everywhere I can reach.")));
        assert!(!judge(false, Some("There is no unicorn here: I saw a red sofa.")));
        assert!(!judge(false, Some("The battery is low.")));
        assert!(!judge(true, None) && !judge(false, None));
    }

    #[test]
    fn who_does_not_ask_is_lucky_and_not_right() {
        let judge =
            |plain: bool, questions| Rule::AskAndReach.judge("the mug", (plain, "plain".into()), None, questions).0;
        assert!(judge(true, 1) && !judge(true, 0) && !judge(false, 1));
        assert!(Rule::Reach.judge("the mug", (true, "plain".into()), None, 0).0);
    }
}
