//! From the text of a language model to an action: JSON or call syntax, hostile until parsed.
//!
//! Accepted: `{"target": "chair1", "stop": false}` (also inside prose or a code fence, with optional `room`, `direction`, `group`, `object`
//! texts for the four reasoning steps), where the target's kind is the verb; `{"action": "go_near", "target": "chair1"}`;
//! `{"action": "go_near(chair1)"}`; and a line `go_near(chair1)` with or without quotes.
//! Bounded in size and depth; names must be those of the prompt; nothing panics.

use serde_json::Value;

use crate::action::{Action, Target};
use crate::names::{NameTable, Named};
use crate::octant::Octant;
use crate::reasoner::{ReasoningStep, Reply, TraceStep};

/// Longest reply that is read, bytes.
pub const MAX_REPLY_BYTES: usize = 16 * 1024;
/// Deepest nesting of a JSON object in a reply.
pub const MAX_REPLY_DEPTH: usize = 8;

/// Why a reply is not an action.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReplyError {
    /// The text is longer than [`MAX_REPLY_BYTES`].
    #[error("the reply is too long ({bytes} bytes)")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// No JSON object with a `target` or an `action` and no call of a known verb was found.
    #[error("no action found; reply with one of go_to_room(id), turn_to(octant), go_near(id), explore(id), stop(id)")]
    NoAction,
    /// The verb is none of the grammar.
    #[error("unknown action \"{verb}\"")]
    UnknownVerb {
        /// The verb, shortened.
        verb: String,
    },
    /// The target is missing.
    #[error("{verb} needs a target")]
    NoTarget {
        /// The verb.
        verb: &'static str,
    },
    /// The target is no name of this prompt.
    #[error("\"{name}\" is not a name in this prompt")]
    UnknownName {
        /// The name, shortened.
        name: String,
    },
    /// The target is of the wrong kind, such as a room for `go_near`.
    #[error("{verb} cannot take \"{name}\"")]
    WrongKind {
        /// The verb.
        verb: &'static str,
        /// The name, shortened.
        name: String,
    },
}

/// Parses the reply of a model to a prompt with these names.
///
/// # Errors
/// See [`ReplyError`]; the message is fit to be sent back to the model.
pub fn parse_reply(text: &str, names: &NameTable) -> Result<Reply, ReplyError> {
    if text.len() > MAX_REPLY_BYTES {
        return Err(ReplyError::TooLong { bytes: text.len() });
    }
    let (verb, target, trace, confidence) = match json_object(text) {
        Some(object) => {
            let field = |key: &str| object.get(key).and_then(Value::as_str);
            let stops = object.get("stop").and_then(Value::as_bool);
            let implied = || implied_verb(field("target")?, stops?, names);
            let verb = field("action").or_else(implied).ok_or(ReplyError::NoAction)?;
            let (verb, inner) = call(verb).unwrap_or((verb.trim(), None));
            let target =
                field("target").or(inner).or_else(|| ["id", "reason", "room_id", "octant"].into_iter().find_map(field));
            let steps = [
                ("room", ReasoningStep::RoomFiltering),
                ("direction", ReasoningStep::Orientation),
                ("group", ReasoningStep::FunctionalGroup),
                ("object", ReasoningStep::Localisation),
            ];
            let trace = steps
                .into_iter()
                .filter_map(|(key, step)| {
                    field(key).map(|output| TraceStep { step, input: key.to_string(), output: shortened(output, 200) })
                })
                .collect();
            let confidence = object
                .get("confidence")
                .and_then(Value::as_f64)
                .filter(|value| (0.0..=1.0).contains(value))
                .unwrap_or(0.5);
            (verb.to_string(), target.map(str::to_string), trace, confidence)
        }
        None => {
            let (verb, target) = last_call(text).ok_or(ReplyError::NoAction)?;
            (verb.to_string(), target.map(str::to_string), Vec::new(), 0.5)
        }
    };
    let action = action(&verb, target.as_deref(), names)?;
    Ok(Reply { action, trace, confidence, text: text.to_string(), answer_tokens: None })
}

/// The verb of a target for which none is said. What is no name at all is refused by whoever reads the target.
fn implied_verb(target: &str, stops: bool, names: &NameTable) -> Option<&'static str> {
    let target = unquoted(target);
    Some(match names.get(target) {
        _ if stops => "stop",
        Some(Named::Room(_)) => "go_to_room",
        Some(Named::Place(_)) => "explore",
        None if target.parse::<Octant>().is_ok() => "turn_to",
        Some(Named::Object(_)) | None => "go_near",
    })
}

fn action(verb: &str, target: Option<&str>, names: &NameTable) -> Result<Action, ReplyError> {
    const VERBS: [&str; 6] = ["go_to_room", "turn_to", "go_near", "explore", "stop", "give_up"];
    let folded: String =
        verb.trim().chars().take(32).map(|c| if c == ' ' || c == '-' { '_' } else { c.to_ascii_lowercase() }).collect();
    let verb = *VERBS
        .iter()
        .find(|known| **known == folded)
        .ok_or_else(|| ReplyError::UnknownVerb { verb: shortened(verb, 32) })?;
    let target = target.map(unquoted).filter(|target| !target.is_empty());
    if verb == "give_up" {
        return Ok(Action::GiveUp { reason: shortened(target.unwrap_or("the model gave no reason"), 200) });
    }
    let target = target.ok_or(ReplyError::NoTarget { verb })?;
    let wrong = || ReplyError::WrongKind { verb, name: shortened(target, 40) };
    if verb == "turn_to" {
        return target.parse().map(Action::TurnTo).map_err(|_| wrong());
    }
    let named = names.get(target).ok_or_else(|| ReplyError::UnknownName { name: shortened(target, 40) })?;
    match (verb, named) {
        ("go_to_room", Named::Room(id)) => Ok(Action::GoToRoom(id)),
        ("go_near", Named::Object(id)) => Ok(Action::GoNear(id)),
        ("explore", Named::Place(id)) => Ok(Action::Explore(id)),
        ("stop", Named::Object(id)) => Ok(Action::Stop(Target::Object(id))),
        ("stop", Named::Room(id)) => Ok(Action::Stop(Target::Room(id))),
        _ => Err(wrong()),
    }
}

/// The first balanced JSON object of the text that parses and has a `target` or an `action`.
fn json_object(text: &str) -> Option<serde_json::Map<String, Value>> {
    /// Attempts at different opening braces.
    const MAX_STARTS: usize = 16;
    for (start, _) in text.match_indices('{').take(MAX_STARTS) {
        let Some(end) = balanced_end(&text[start..]) else {
            continue;
        };
        if let Ok(Value::Object(object)) = serde_json::from_str(&text[start..start + end])
            && (object.contains_key("action") || object.contains_key("target"))
        {
            return Some(object);
        }
    }
    None
}

/// Length of the object that begins the text; None if it does not end or is too deep.
fn balanced_end(text: &str) -> Option<usize> {
    let (mut depth, mut in_string, mut escaped) = (0usize, false, false);
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            _ if in_string => {}
            b'{' | b'[' => {
                depth += 1;
                if depth > MAX_REPLY_DEPTH {
                    return None;
                }
            }
            b'}' | b']' => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(at + 1);
                }
            }
            _ => {}
        }
    }
    None
}

/// `go_near("chair1")` -> (`go_near`, `chair1`).
fn call(text: &str) -> Option<(&str, Option<&str>)> {
    let open = text.find('(')?;
    let close = open + text[open..].find(')')?;
    Some((text[..open].trim(), Some(unquoted(&text[open + 1..close]))))
}

/// The last call of a known verb in prose: models end with their answer.
fn last_call(text: &str) -> Option<(&'static str, Option<&str>)> {
    const VERBS: [&str; 6] = ["go_to_room", "turn_to", "go_near", "explore", "stop", "give_up"];
    let found = VERBS.iter().filter_map(|verb| {
        let at = text
            .rmatch_indices(*verb)
            .map(|(at, _)| at)
            .find(|at| text[at + verb.len()..].trim_start().starts_with('('))?;
        Some((at, *verb))
    });
    let (at, verb) = found.max()?;
    let (_, target) = call(&text[at..])?;
    Some((verb, target))
}

fn unquoted(text: &str) -> &str {
    text.trim().trim_matches(|c| matches!(c, '"' | '\'' | '`')).trim()
}

/// At most `bytes` bytes, cut at a character, control characters as spaces.
fn shortened(text: &str, bytes: usize) -> String {
    let mut out = String::new();
    for c in text.chars() {
        if out.len() + c.len_utf8() > bytes {
            break;
        }
        out.push(if c.is_control() { ' ' } else { c });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use dsg::{ObjectId, PlaceId, RoomId};

    fn names() -> NameTable {
        let mut names = NameTable::new(3);
        names.insert("chair1".into(), Named::Object(ObjectId(7)));
        names.insert("room2".into(), Named::Room(RoomId(2)));
        names.insert("frontier1".into(), Named::Place(PlaceId(9)));
        names
    }

    fn check(text: &str, expected: Result<Action, ReplyError>) {
        assert_eq!(parse_reply(text, &names()).map(|reply| reply.action), expected, "{text:?}");
    }

    #[test]
    fn the_grammar_in_its_spellings() {
        let near = Ok(Action::GoNear(ObjectId(7)));
        check("go_near(chair1)", near.clone());
        check("I think go_near is right: go_near(\"chair1\").", near.clone());
        check(r#"{"action":"go_near","target":"chair1"}"#, near.clone());
        check("```json\n{\n  \"action\": \"go_near('Chair1')\"\n}\n```", near.clone());
        check(r#"{} {"room":"room2","action":"go near","target":"chair1"}"#, near);
        check(r#"{"object":"the chair","target":"chair1","stop":false}"#, Ok(Action::GoNear(ObjectId(7))));
        check(r#"{"target":"chair1","stop":true}"#, Ok(Action::Stop(Target::Object(ObjectId(7)))));
        check(r#"{"target":"room2","stop":false}"#, Ok(Action::GoToRoom(RoomId(2))));
        check(r#"{"target":"frontier1","stop":false}"#, Ok(Action::Explore(PlaceId(9))));
        check(r#"{"target":"back-left-top","stop":false}"#, Ok(Action::TurnTo(Octant::BackLeftTop)));
        check("go_to_room(room2)", Ok(Action::GoToRoom(RoomId(2))));
        check("explore( frontier1 )", Ok(Action::Explore(PlaceId(9))));
        check("turn_to(Back-Left-Top)", Ok(Action::TurnTo(Octant::BackLeftTop)));
        check("stop(room2)", Ok(Action::Stop(Target::Room(RoomId(2)))));
    }

    #[test]
    fn what_is_wrong_is_named() {
        check("", Err(ReplyError::NoAction));
        check("chair1", Err(ReplyError::NoAction));
        check("go_near(chair2)", Err(ReplyError::UnknownName { name: "chair2".into() }));
        check("go_near()", Err(ReplyError::NoTarget { verb: "go_near" }));
        check("go_near(room2)", Err(ReplyError::WrongKind { verb: "go_near", name: "room2".into() }));
        check(r#"{"action":"fly","target":"chair1"}"#, Err(ReplyError::UnknownVerb { verb: "fly".into() }));
        check(r#"{"action":7}"#, Err(ReplyError::NoAction));
        check(r#"{"target":"chair1"}"#, Err(ReplyError::NoAction)); // stop there, or go there?
        check(r#"{"target":"chair1","stop":"yes"}"#, Err(ReplyError::NoAction));
        check(
            r#"{"target":"frontier1","stop":true}"#,
            Err(ReplyError::WrongKind { verb: "stop", name: "frontier1".into() }),
        );
        check(r#"{"target":"chair2","stop":false}"#, Err(ReplyError::UnknownName { name: "chair2".into() }));
        assert!(matches!(parse_reply(&"x".repeat(MAX_REPLY_BYTES + 1), &names()), Err(ReplyError::TooLong { .. })));
        check(&"{".repeat(10_000), Err(ReplyError::NoAction));
        check(&format!("{}\"action\":\"stop\"{}", "{\"a\":".repeat(50), "}".repeat(50)), Err(ReplyError::NoAction));
    }
}
