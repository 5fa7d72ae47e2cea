//! The protocol of the paper's Table I: a language model describes each object once from the scene graph (rooms, groups, relations) with the
//! list of objects, as an expert who thinks of the group first, and once from the list alone. What it writes is checked like everybody's words.

use arena::lab_survey::SurveyedLab;
use arena::mission::dsg::{ObjectId, scene_graph_text};
use arena::mission::octant_prompt::flat_text;
use arena::mission::openai::{ChatConfig, ChatError, chat};
use nalgebra::Isometry3;
use serde_json::{Value, json};

/// What the model is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Given {
    /// Scene graph and list.
    Hierarchy,
    /// List alone.
    List,
}

/// Longest description that is read.
const MAX_CHARS: usize = 300;

/// The model's description of an object; None if the answer is not what was asked for.
///
/// # Errors
/// What the network or the server says.
pub fn described_by_model(
    chat_config: &ChatConfig,
    surveyed: &SurveyedLab,
    id: ObjectId,
    label: &str,
    given: Given,
) -> Result<Option<String>, ChatError> {
    let list = flat_text(&surveyed.graph, &Isometry3::identity(), "");
    let (role, facts) = match given {
        Given::Hierarchy => (
            "You are an expert in describing things of a building so that others find them. Think of the functional group of the thing first, \
             then of what sets it apart within the group and the room.",
            format!("Scene graph:\n{}\nObjects:\n{list}", scene_graph_text(&surveyed.graph)),
        ),
        Given::List => ("You describe things of a building so that others find them.", format!("Objects:\n{list}")),
    };
    let user = format!(
        "{facts}\nDescribe object {id} ({label}) in one noun phrase that fits no other object, without ids and coordinates, \
         such as \"the red chair left of the desk\". Reply with one JSON object."
    );
    let text = json!({"type": "string", "maxLength": MAX_CHARS});
    let schema = match given {
        Given::Hierarchy => json!({
            "type": "object", "properties": {"group": text, "description": text},
            "required": ["group", "description"], "additionalProperties": false,
        }),
        Given::List => json!({
            "type": "object", "properties": {"description": text},
            "required": ["description"], "additionalProperties": false,
        }),
    };
    let answer = chat(chat_config, role, &user, Some(&schema))?;
    let row: Option<Value> = serde_json::from_str(answer.text.trim()).ok();
    let description =
        row.and_then(|row| Some(row.get("description")?.as_str()?.chars().take(MAX_CHARS).collect::<String>()));
    Ok(description.filter(|text| !text.trim().is_empty()))
}
