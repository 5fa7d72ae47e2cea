//! Referring-expression generation (paper Table I): the shortest description of one thing that a listener resolves to exactly that thing.
//!
//! A speaker tries descriptions from short to long and takes the first one that (1) is true of this thing and of no other with its label,
//! and (2) the grounder, reading the text alone, resolves to the thing by a margin. Truth is looked up in the boxes by
//! [`crate::clause_truth`], which shares no operator with the grounder: what only a mistake of the listener makes unique does not pass.

use dsg::ObjectId;
use rustc_hash::FxHashMap;

use crate::clause_truth::{Claim, is_true, singles_out};
use crate::grounding::{Scene, ground};
use crate::parser::parse_referring;
use crate::refer_set::middle;

/// A description that passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// The sentence.
    pub text: String,
    /// What it claims beyond the class.
    pub claims: Vec<Claim>,
    /// Whether a claim depends on where the viewer stands.
    pub is_view_dependent: bool,
}

impl Description {
    /// Number of words.
    pub fn words(&self) -> usize {
        self.text.split(' ').count()
    }
}

/// Most things that are tried as anchors, nearest first.
const MAX_ANCHORS: usize = 20;
/// Largest ordinal that is said.
const MAX_ORDINAL: u32 = 6;
/// The listener's best must be this many times better than its second.
const MARGIN: f64 = 1.05;

/// The shortest description of `id`; None if nothing that is tried singles it out, or if it is no thing of the scene.
pub fn describe(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, |_| true)
}

/// The shortest without a claim that depends on the viewer.
pub fn describe_without_a_view(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, |description| !description.is_view_dependent)
}

/// The shortest with at least one claim that depends on the viewer.
pub fn describe_from_a_view(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, |description| description.is_view_dependent)
}

fn first(scene: &Scene, id: ObjectId, is_wanted: impl Fn(&Description) -> bool) -> Option<Description> {
    let index = scene.things.iter().position(|thing| thing.id == id)?;
    descriptions(scene, index).filter(is_wanted).find(|description| {
        singles_out(&description.claims, scene, index) && is_understood(&description.text, scene, id)
    })
}

/// Whether a listener who gets the text and the scene finds exactly this thing.
pub fn is_understood(text: &str, scene: &Scene, id: ObjectId) -> bool {
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    let Some(goal) = parse_referring(text, &labels) else { return false };
    match ground(&goal, scene, &middle(scene)).as_slice() {
        [only] => only.id == id,
        [best, second, ..] => best.id == id && best.rank > MARGIN * second.rank,
        [] => false,
    }
}

/// True descriptions, the shortest first: the class alone, one claim, two claims.
fn descriptions(scene: &Scene, index: usize) -> impl Iterator<Item = Description> {
    let label = scene.label(index);
    let anchors = anchors(scene, index);
    let indices: Vec<usize> = anchors.iter().map(|(anchor, _)| *anchor).collect();
    let claims = true_claims(scene, index, &indices);
    // Ordinals count among all of the class: with a second claim nobody knows among which.
    let plain: Vec<&Claim> = claims.iter().filter(|claim| !claim.is_ordinal()).collect();
    let pairs: Vec<Vec<Claim>> = plain
        .iter()
        .enumerate()
        .flat_map(|(at, first)| plain[at + 1..].iter().map(move |second| vec![(*first).clone(), (*second).clone()]))
        .collect();
    let names: FxHashMap<usize, String> = anchors.into_iter().collect();
    let singles = claims.into_iter().map(|claim| vec![claim]);
    std::iter::once(Vec::new()).chain(singles).chain(pairs).map(move |claims| {
        let text = claims.iter().fold(format!("the {label}"), |text, claim| {
            let joined = if text.contains(" that is ") { "and" } else { "that is" };
            format!("{text} {joined} {}", claim.words(&|anchor| names.get(&anchor).cloned().unwrap_or_default()))
        });
        let is_view_dependent = claims.iter().any(Claim::is_view_dependent);
        Description { text, claims, is_view_dependent }
    })
}

/// Things that may say where this one is, the nearest first, with what they are called: by their class if they are the only ones of it
/// (these first), else by one claim about such a one ("table that is closest to the door").
fn anchors(scene: &Scene, index: usize) -> Vec<(usize, String)> {
    let own = &scene.things[index].bounds;
    let mut others: Vec<(f64, usize)> = (0..scene.things.len())
        .filter(|other| {
            let name = scene.label(*other);
            *other != index && name != scene.label(index) && !is_hull(name)
        })
        .map(|other| (scene.things[other].bounds.gap_m(own), other))
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let is_only = |at: usize| singles_out(&[], scene, at);
    let (only, many): (Vec<usize>, Vec<usize>) =
        others.into_iter().map(|(_, other)| other).partition(|other| is_only(*other));
    let only: Vec<usize> = only.into_iter().take(MAX_ANCHORS).collect();
    let described = many.into_iter().take(MAX_ANCHORS / 2).filter_map(|other| {
        let first = true_claims(scene, other, &only)
            .into_iter()
            .find(|claim| !claim.is_view_dependent() && singles_out(std::slice::from_ref(claim), scene, other))?;
        let words = first.words(&|anchor| scene.label(anchor).to_string());
        Some((other, format!("{} that is {words}", scene.label(other))))
    });
    let described: Vec<(usize, String)> = described.collect();
    only.into_iter().map(|other| (other, scene.label(other).to_string())).chain(described).collect()
}

/// Claims that hold for the thing, in the order in which people prefer them.
fn true_claims(scene: &Scene, index: usize, anchors: &[usize]) -> Vec<Claim> {
    let each = |make: fn(usize) -> Claim| anchors.iter().map(move |anchor| make(*anchor));
    let betweens =
        anchors.iter().enumerate().flat_map(|(at, a)| anchors[at + 1..].iter().map(move |b| Claim::Between(*a, *b)));
    let all = each(Claim::On)
        .chain(each(Claim::Under))
        .chain(each(Claim::Closest))
        .chain(each(Claim::Farthest))
        .chain([Claim::Largest, Claim::Smallest, Claim::Highest, Claim::Lowest])
        .chain(each(Claim::LeftOf))
        .chain(each(Claim::RightOf))
        .chain(betweens)
        .chain((2..=MAX_ORDINAL).flat_map(|n| {
            anchors.iter().flat_map(move |anchor| [Claim::NthClosest(n, *anchor), Claim::NthFarthest(n, *anchor)])
        }))
        .chain((2..=MAX_ORDINAL).map(Claim::NthHighest))
        .chain((1..=MAX_ORDINAL).map(Claim::NthFromLeft));
    all.filter(|claim| is_true(claim, scene, index)).collect()
}

/// Parts of the building, and things that nobody has named: neither described nor fit to say where something is.
pub fn is_hull(label: &str) -> bool {
    matches!(label, "wall" | "floor" | "ceiling" | "object" | "room")
}
