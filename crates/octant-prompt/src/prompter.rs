//! Prompts from one pose after the other: for a robot that moves while the graph stays as it is.

use dsg::{PlaceId, SceneGraph};
use nalgebra::{Isometry3, Point3};

use crate::budget::fit;
use crate::instruction::{Instruction, RoomReference};
use crate::parser::parse_instruction;
use crate::prompt::{Prompt, PromptConfig};
use crate::tier_index::TierIndex;
use crate::tiers::View;
use crate::tokens::TokenCounter;

/// One graph and one instruction, seen from anywhere. Whatever depends on these two alone is done once.
///
/// ```
/// use nalgebra::Isometry3;
/// use octant_prompt::{Estimate, PromptConfig, Prompter, build_prompt};
///
/// let graph = dsg::SceneGraph::new();
/// let prompter = Prompter::new(&graph, "find the mug");
/// for x in [0.0, 1.0] {
///     let (pose, config) = (Isometry3::translation(x, 0.0, 0.3), PromptConfig::default());
///     assert_eq!(prompter.prompt(&pose, &config, &Estimate), build_prompt(&graph, &pose, "find the mug", &config, &Estimate));
/// }
/// ```
pub struct Prompter<'a> {
    graph: &'a SceneGraph,
    instruction: Instruction,
    nouns: Vec<String>,
    rooms: Vec<RoomReference>,
    frontiers: Vec<PlaceId>,
    index: TierIndex<'a>,
}

impl<'a> Prompter<'a> {
    /// Reads the instruction and sorts the graph by rooms. Linear in objects and places.
    pub fn new(graph: &'a SceneGraph, instruction: &str) -> Prompter<'a> {
        let instruction = parse_instruction(instruction);
        let nouns = instruction.nouns();
        Prompter {
            graph,
            index: TierIndex::new(graph, &nouns),
            rooms: instruction.rooms(),
            frontiers: graph.frontiers().map(|place| place.id).collect(),
            nouns,
            instruction,
        }
    }

    /// What [`crate::build_prompt`] writes for this pose.
    pub fn prompt(
        &self,
        world_from_body: &Isometry3<f64>,
        config: &PromptConfig,
        counter: &dyn TokenCounter,
    ) -> Prompt {
        let position = Point3::from(world_from_body.translation.vector);
        let crow = |point: &Point3<f64>| Some((point - position).norm());
        let tiers = self.index.tiers(&View {
            graph: self.graph,
            world_from_body,
            frontiers: &self.frontiers,
            unseen: &[],
            path_length: &crow,
            nouns: &self.nouns,
            rooms: &self.rooms,
            config,
        });
        let revision = self.graph.revision();
        let (text, tokens, names) = fit(&tiers, &self.instruction.text, revision, config, counter);
        Prompt { text, tokens, revision, names }
    }
}
