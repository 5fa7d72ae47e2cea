//! The prompt: a scene graph from the agent's point of view, within a token budget (OmniVLN section III-C.1).
//!
//! Three tiers. Focal (own room, within 3 m): each object with its octant and distance, the few of the asked class with caption.
//! Peripheral (own room, beyond): each object with octant, group and distance. Global: a line per room with class counts, the names
//! being implied ([`crate::names`]); in large buildings, a line per direction and tripling distance with class counts and the
//! nearest room that holds the asked class, so that the text grows with the logarithm of the building. Then frontiers and the
//! instruction. [`crate::budget`] drops detail, the farthest first.

use dsg::{PlaceId, SceneGraph};
use nalgebra::{Isometry3, Point3};

use crate::budget::fit;
use crate::forms;
use crate::instruction::Instruction;
use crate::names::NameTable;
use crate::parser::parse_instruction;
use crate::situation::Situation;
use crate::tiers::{View, tiers};
use crate::tokens::TokenCounter;

/// What a prompt may cost and show.
#[derive(Debug, Clone, PartialEq)]
pub struct PromptConfig {
    /// Most tokens. From [`MIN_BUDGET_TOKENS`] on never exceeded. Default 600.
    pub budget_tokens: usize,
    /// Radius of the focal tier, metres. Default 3 (the paper's).
    pub focal_radius_m: f64,
    /// Height of the camera above the body origin, metres: h_cam of Eq. 9. Default 0.42.
    pub camera_height_m: f64,
    /// Most focal objects of an asked class that are shown with their caption. Default 3.
    pub max_captions: usize,
    /// Most words of a caption. Default 40.
    pub max_caption_words: usize,
    /// How ordinals are given. Default [`Naming::Rank`].
    pub naming: Naming,
    /// Which text. Default [`PromptForm::Octant`].
    pub form: PromptForm,
}

/// The text of a prompt: ours, or one that experiments measure it against ([`crate::forms`]).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum PromptForm {
    /// Octants and tiers, within the budget.
    #[default]
    Octant,
    /// Every room, object and place with its coordinates, objects with captions; no budget.
    Flat,
    /// Every object with octant, distance and caption, however far; no budget.
    WithoutTiers,
    /// Tiers, but coordinates in place of octants; no budget.
    WithoutOctants,
}

/// The smallest budget that is guaranteed for any graph and any instruction.
pub const MIN_BUDGET_TOKENS: usize = 150;

/// How the ordinals of names are given within a room and class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Naming {
    /// By distance: `chair1` is the nearest. Changes as the agent moves.
    Rank,
    /// By object id: names stay while the room's things stay.
    Stable,
}

impl Default for PromptConfig {
    fn default() -> Self {
        PromptConfig {
            budget_tokens: 600,
            focal_radius_m: 3.0,
            camera_height_m: 0.42,
            max_captions: 3,
            max_caption_words: 40,
            naming: Naming::Rank,
            form: PromptForm::Octant,
        }
    }
}

/// A number of the configuration makes no sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PromptConfigError {
    /// The budget is below [`MIN_BUDGET_TOKENS`].
    #[error("budget_tokens must be at least 150")]
    Budget,
    /// A length is not finite or not positive.
    #[error("focal_radius_m must be positive and camera_height_m finite")]
    Length,
}

impl PromptConfig {
    /// Checks the configuration.
    ///
    /// # Errors
    /// The first field that is wrong.
    pub fn validate(&self) -> Result<(), PromptConfigError> {
        if self.budget_tokens < MIN_BUDGET_TOKENS {
            return Err(PromptConfigError::Budget);
        }
        if !(self.focal_radius_m > 0.0 && self.focal_radius_m.is_finite() && self.camera_height_m.is_finite()) {
            return Err(PromptConfigError::Length);
        }
        Ok(())
    }
}

/// A prompt and how to read the answer to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Prompt {
    /// The text.
    pub text: String,
    /// What the counter says it costs.
    pub tokens: usize,
    /// The graph's revision.
    pub revision: u64,
    /// Names in the text.
    pub names: NameTable,
}

/// The prompt for a graph, a pose and an instruction; frontiers are the graph's own, distances to them as the crow flies.
/// With a budget below [`MIN_BUDGET_TOKENS`] the shortest possible prompt results, which may exceed it: see `tokens`.
pub fn build_prompt(
    graph: &SceneGraph,
    world_from_body: &Isometry3<f64>,
    instruction: &str,
    config: &PromptConfig,
    counter: &dyn TokenCounter,
) -> Prompt {
    let frontiers: Vec<PlaceId> = graph.frontiers().map(|place| place.id).collect();
    let position = Point3::from(world_from_body.translation.vector);
    let crow = |point: &Point3<f64>| Some((point - position).norm());
    build(graph, world_from_body, &parse_instruction(instruction), &frontiers, &[], &crow, config, counter)
}

/// The prompt for a situation: its frontiers and places to look from, its path lengths, its instruction with the present step marked.
pub fn build_prompt_for(situation: &Situation, config: &PromptConfig, counter: &dyn TokenCounter) -> Prompt {
    let config = PromptConfig { camera_height_m: situation.camera_height_m, ..config.clone() };
    let mut instruction = situation.instruction.clone();
    if instruction.steps.len() > 1 && situation.step_index > 0 {
        instruction.text =
            format!("{} (step {} of {})", instruction.text, situation.step_index + 1, instruction.steps.len());
    }
    if config.form != PromptForm::Octant {
        return forms::prompt(situation, &instruction, &config, counter);
    }
    build(
        situation.graph,
        &situation.world_from_body,
        &instruction,
        situation.frontiers,
        situation.unseen,
        situation.path_length,
        &config,
        counter,
    )
}

#[allow(clippy::too_many_arguments)] // the two public forms name them
fn build(
    graph: &SceneGraph,
    world_from_body: &Isometry3<f64>,
    instruction: &Instruction,
    frontiers: &[PlaceId],
    unseen: &[PlaceId],
    path_length: &dyn Fn(&Point3<f64>) -> Option<f64>,
    config: &PromptConfig,
    counter: &dyn TokenCounter,
) -> Prompt {
    let view = View {
        graph,
        world_from_body,
        frontiers,
        unseen,
        path_length,
        nouns: &instruction.nouns(),
        rooms: &instruction.rooms(),
        config,
    };
    let tiers = tiers(&view); // Eq. 8-9 and the three tiers
    let revision = graph.revision();
    let (text, tokens, names) = fit(&tiers, &instruction.text, revision, config, counter); // the budget
    Prompt { text, tokens, revision, names }
}
