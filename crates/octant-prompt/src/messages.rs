//! What a chat model is sent, as plain data: texts and a JSON schema. Sending it is the business of an app.

use serde_json::{Value, json};

use crate::critic::Critique;
use crate::names::NameTable;
use crate::octant::Octant;
use crate::prompt::Prompt;

/// The system message: the task, the four steps, the grammar. The same for every decision, so that servers can cache it.
pub fn system_text() -> &'static str {
    "You steer a robot through a building. Each message describes what it knows, from its own point of view: octants such as front-left-top are relative to the robot, distances in metres. \
     Names such as chair1 are ids; in a line about another room, chairx3 stands for room2.chair1, room2.chair2, room2.chair3 of that room2. \
     Think in four steps: which rooms are reachable and fit; in which direction; which group of things is likely to hold the target; which object it is. \
     Then reply with one JSON object: {\"room\": ..., \"direction\": ..., \"group\": ..., \"object\": ..., \"target\": ..., \"stop\": ...}. \
     The target says what to do: go to a room id, turn to an octant, go near an object id, explore a frontier or view id. \
     \"stop\" is true only when the robot is beside the right object, or in the right room if the step is to go to a room; else false. If the target is not known yet, explore. Use only ids that occur in the message."
}

/// The user message of one decision: the prompt, and the objections to the earlier attempts.
pub fn user_text(prompt: &Prompt, critiques: &[Critique]) -> String {
    /// Objections that are repeated to the model.
    const MAX_CRITIQUES: usize = 4;
    let mut text = prompt.text.clone();
    for critique in critiques.iter().rev().take(MAX_CRITIQUES).rev() {
        let action =
            critique.action.as_ref().map_or_else(|| "your reply".to_string(), |action| action.text(&prompt.names));
        text.push_str(&format!("\nRejected: {action}: {}", critique.message));
    }
    text
}

/// The JSON schema of a reply; its `target` is an enum of the names in this prompt and the octants, so that a server that honours it
/// cannot invent an id. The target alone says the verb: with a field for each, small models named a verb that does not go with the target.
/// The reply is checked all the same.
pub fn reply_schema(names: &NameTable) -> Value {
    let mut targets: Vec<&str> = names.iter().map(|(name, _)| name).collect();
    targets.extend(Octant::ALL.iter().map(|octant| octant.name()));
    let text = json!({"type": "string", "maxLength": 120});
    json!({
        "type": "object",
        "properties": {
            "room": text, "direction": text, "group": text, "object": text,
            "target": {"type": "string", "enum": targets},
            "stop": {"type": "boolean"},
        },
        "required": ["target", "stop"],
        "additionalProperties": false,
    })
}
