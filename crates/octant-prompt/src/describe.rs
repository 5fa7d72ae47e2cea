//! Referring-expression generation (paper Table I): the shortest description of one thing that a listener resolves to exactly that thing.
//!
//! A speaker tries descriptions from few words to many and takes the first one that (1) is true of this thing and of no other with its
//! label, and (2) the grounder, reading the text alone, resolves to the thing by a margin. Truth is looked up in the boxes by
//! [`crate::clause_truth`], which shares no operator with the grounder: what only a mistake of the listener makes unique does not pass.
//!
//! ```text
//! the mug                                                         the only one
//! the red chair closest to the door                               one claim or two: colours, sides, orders, supports
//! of the 7 chairs closest to the door, the third chair from the left     a crowd: some are set apart first
//! in the kitchen, the chair left of the table                     several rooms: everything else is said within one
//! ```

use dsg::ObjectId;
use rustc_hash::FxHashMap;

use crate::claim::{Claim, Group, Order, noun_phrase};
use crate::clause_truth::{EYE_ERROR_M, Surroundings, is_sure, is_true, singles_out};
use crate::color_truth::COLORS;
use crate::grounding::{Scene, ground, room_score};
use crate::parser::parse_referring;
use crate::refer_set::{middle, middle_of};
use crate::vocabulary::{Class, is_small, plural, room_kind};

/// A description that passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// The sentence.
    pub text: String,
    /// The room that is named first, as it is called.
    pub room: Option<String>,
    /// The things of the class that are set apart.
    pub group: Option<Group>,
    /// What it claims beyond the class.
    pub claims: Vec<Claim>,
    /// The other things it names, by index, each with the claim that tells it from others of its class, if there are any.
    pub anchors: Vec<(usize, Option<Claim>)>,
    /// Whether a claim depends on where the viewer stands.
    pub is_view_dependent: bool,
    /// How far from the middle of the room he may stand, metres.
    pub eye_error_m: f64,
}

impl Description {
    /// Number of words.
    pub fn words(&self) -> usize {
        self.text.split(' ').count()
    }

    /// Everything it claims, that of the group included.
    pub fn all_claims(&self) -> impl Iterator<Item = &Claim> {
        self.group.iter().map(|group| &group.by).chain(&self.claims)
    }
}

/// Which descriptions are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    Any,
    WithoutView,
    FromView,
}

/// Most things that are tried as anchors, nearest first.
const MAX_ANCHORS: usize = 20;
/// Largest number that is counted to.
const MAX_COUNT: u32 = 60;
/// The listener's best must be this many times better than its second.
const MARGIN: f64 = 1.05;
/// Most sentences that are tried on the listener for one thing: what he misunderstands so often, he will not understand.
const MAX_TRIALS: usize = 300;

/// The shortest description of `id`; None if nothing that is tried singles it out, or if it is no thing of the scene.
pub fn describe(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, Wanted::Any)
}

/// The shortest without a claim that depends on the viewer.
pub fn describe_without_a_view(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, Wanted::WithoutView)
}

/// The shortest with at least one claim that depends on the viewer.
pub fn describe_from_a_view(scene: &Scene, id: ObjectId) -> Option<Description> {
    first(scene, id, Wanted::FromView)
}

/// Who finds nothing that holds from wherever the viewer may stand says what holds from nearer to where he is taken to stand.
fn first(scene: &Scene, id: ObjectId, wanted: Wanted) -> Option<Description> {
    let is_exact = scene.box_error_m == 0.0;
    let eye_errors_m: &[f64] =
        if is_exact || wanted == Wanted::WithoutView { &[0.0] } else { &[EYE_ERROR_M, 0.2, 0.0] };
    eye_errors_m.iter().find_map(|eye_error_m| first_within(scene, id, wanted, *eye_error_m))
}

fn first_within(scene: &Scene, id: ObjectId, wanted: Wanted, eye_error_m: f64) -> Option<Description> {
    let index = scene.things.iter().position(|thing| thing.id == id)?;
    let whole = Surroundings { eye_error_m, ..Surroundings::whole(scene) };
    if scene.rooms.len() < 2 {
        return shortest(&whole, None, index, wanted);
    }
    // In a building nobody knows from where left and right are meant, until a room is named; nor does anybody count through all rooms.
    if wanted != Wanted::FromView && whole.twins(index).is_empty() {
        let only = Speaker::new(&whole, None, index, Wanted::WithoutView).says(None, Vec::new());
        if is_understood(&only.text, scene, id) {
            return Some(only);
        }
    }
    let in_room = names_of_room(scene, index).into_iter().find_map(|name| {
        let things = things_in(scene, &name);
        let is_one_room = things.iter().all(|other| scene.things[*other].room == scene.things[index].room);
        let wanted = match wanted {
            Wanted::Any if !is_one_room => Wanted::WithoutView,
            Wanted::FromView if !is_one_room => return None,
            wanted => wanted,
        };
        shortest(&Surroundings { eye_error_m, ..Surroundings::of(scene, things) }, Some(&name), index, wanted)
    });
    // A thing in a room without a name is found by what the whole building says about it, if at all.
    let without_room = || (wanted != Wanted::FromView).then(|| shortest(&whole, None, index, Wanted::WithoutView));
    in_room.or_else(|| without_room().flatten())
}

/// What the room of a thing may be called: by its kind if it is the only one, else by its kind and a thing that only it holds
/// ("office with the printer"), else by such a thing alone.
fn names_of_room(scene: &Scene, index: usize) -> Vec<String> {
    /// Most things that are tried as a mark of the room.
    const MAX_MARKS: usize = 3;
    let Some(room) = scene.things[index].room else { return Vec::new() };
    let facts = &scene.rooms[room];
    /// Below this the kind of a room is a guess that may send people elsewhere: a lab that was taken for an office had 0.52.
    const LEAST_CONFIDENCE: f64 = 0.6;
    let name = match &facts.kind {
        Some((kind, confidence)) if *confidence >= LEAST_CONFIDENCE => kind.as_str(),
        Some(_) => "",
        None => facts.name.as_str(),
    };
    let is_a_number = name.is_empty() || name.starts_with("room ");
    let holds = |room: usize, label: &str| {
        (0..scene.things.len()).any(|other| scene.things[other].room == Some(room) && scene.label(other) == label)
    };
    let mut names = Vec::new();
    let mut bases = vec!["room"];
    if !is_a_number {
        bases.insert(0, name);
    }
    for base in bases {
        let rooms: Vec<usize> = (0..scene.rooms.len()).filter(|other| is_called(scene, *other, base)).collect();
        if rooms.len() == 1 {
            names.push(base.to_string());
        }
        let mut marks: Vec<&str> = (0..scene.things.len())
            .filter(|other| scene.things[*other].room == Some(room) && scene.label(*other) != scene.label(index))
            .filter(|other| is_sure(scene, *other))
            .map(|other| scene.label(other))
            .filter(|label| !is_hull(label) && rooms.iter().all(|other| *other == room || !holds(*other, label)))
            .collect();
        // Large things are seen by everybody.
        marks.sort_unstable_by_key(|label| (is_small(&Class::new(label)), *label));
        marks.dedup();
        names.extend(marks.into_iter().take(MAX_MARKS).map(|mark| format!("{base} with the {mark}")));
        if rooms.len() > 1 && base != "room" {
            names.push(base.to_string());
        }
    }
    names
}

/// Whether a room is called so, by its own name or by its kind ("study" is "office"); every one is a room.
fn is_called(scene: &Scene, room: usize, name: &str) -> bool {
    let facts = &scene.rooms[room];
    let kind = |name: &str| room_kind(name).map(str::to_owned).unwrap_or_else(|| name.to_owned());
    name == "room" || facts.name == name || facts.kind.as_ref().is_some_and(|(own, _)| kind(own) == kind(name))
}

/// The things of all rooms that are called `name`: "office", "office with the printer", "room with the sofa".
pub fn things_in(scene: &Scene, name: &str) -> Vec<usize> {
    let (base, mark) = name.split_once(" with the ").map_or((name, None), |(base, mark)| (base, Some(mark)));
    let holds = |room: usize, label: &str| {
        (0..scene.things.len()).any(|other| scene.things[other].room == Some(room) && scene.label(other) == label)
    };
    let is_meant = |room: usize| is_called(scene, room, base) && mark.is_none_or(|mark| holds(room, mark));
    let rooms: Vec<bool> = (0..scene.rooms.len()).map(is_meant).collect();
    (0..scene.things.len()).filter(|index| scene.things[*index].room.is_some_and(|room| rooms[room])).collect()
}

fn shortest(around: &Surroundings, room: Option<&str>, index: usize, wanted: Wanted) -> Option<Description> {
    let speaker = Speaker::new(around, room, index, wanted);
    let id = around.scene.things[index].id;
    let mut trials = 0;
    let mut is_understood = |text: &str| {
        trials += 1;
        trials <= MAX_TRIALS && is_understood(text, around.scene, id)
    };
    let plain = speaker.plain().into_iter().filter(|claims| singles_out(None, claims, around, index));
    let plain = plain.map(|claims| speaker.says(None, claims));
    plain.into_iter().find(|description| is_understood(&description.text)).or_else(|| {
        let set_apart = speaker.set_apart().into_iter();
        let set_apart =
            set_apart.filter(|(group, claim)| singles_out(Some(group), std::slice::from_ref(claim), around, index));
        let said = set_apart.map(|(group, claim)| speaker.says(Some(group), vec![claim]));
        said.into_iter().find(|description| is_understood(&description.text))
    })
}

/// Whether a listener who gets the text and the scene finds exactly this thing. He stands in the middle of the room that is named, or of everything.
pub fn is_understood(text: &str, scene: &Scene, id: ObjectId) -> bool {
    understood(text, scene) == Some(id)
}

/// What a listener takes the text for; None if he is in doubt.
pub fn understood(text: &str, scene: &Scene) -> Option<ObjectId> {
    let labels: Vec<&str> = scene.classes.iter().map(|class| class.text.as_str()).collect();
    let goal = parse_referring(text, &labels)?;
    let everywhere = middle(scene);
    let named = goal.room.as_ref().and_then(|named| {
        let scores = (0..scene.rooms.len()).map(|room| (room_score(named, room, scene, &everywhere), room));
        scores.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|(_, room)| room)
    });
    let viewer = named.map_or(everywhere, |room| {
        middle_of(scene, (0..scene.things.len()).filter(|index| scene.things[*index].room == Some(room)))
    });
    match ground(&goal, scene, &viewer).as_slice() {
        [only] => Some(only.id),
        [best, second, ..] => (best.rank > MARGIN * second.rank).then_some(best.id),
        [] => None,
    }
}

/// Somebody who is about to describe a thing.
struct Speaker<'a> {
    around: &'a Surroundings<'a>,
    room: Option<&'a str>,
    index: usize,
    wanted: Wanted,
    /// Things that may say where this one is, and what they are called.
    anchors: Vec<usize>,
    /// The name of each, and the claim in it.
    names: FxHashMap<usize, (String, Option<Claim>)>,
    /// Claims that hold of it among all of its class, in the order in which people prefer them.
    claims: Vec<Claim>,
}

impl<'a> Speaker<'a> {
    fn new(around: &'a Surroundings<'a>, room: Option<&'a str>, index: usize, wanted: Wanted) -> Speaker<'a> {
        let named = anchors(around, index);
        let anchors: Vec<usize> = named.iter().map(|(anchor, ..)| *anchor).collect();
        let claims = true_claims(around, index, &anchors);
        let named = named.into_iter().map(|(anchor, name, claim)| (anchor, (name, claim)));
        Speaker { around, room, index, wanted, anchors, names: named.collect(), claims }
    }

    fn is_wanted(&self, claims: &[&Claim]) -> bool {
        match self.wanted {
            Wanted::Any => true,
            Wanted::WithoutView => claims.iter().all(|claim| !claim.is_view_dependent()),
            Wanted::FromView => claims.iter().any(|claim| claim.is_view_dependent()),
        }
    }

    fn name(&self, anchor: usize) -> String {
        self.names.get(&anchor).map_or_else(String::new, |(name, _)| name.clone())
    }

    /// No claim, one, two; the shortest first.
    fn plain(&self) -> Vec<Vec<Claim>> {
        let cost = |claim: &Claim| {
            noun_phrase("x", std::slice::from_ref(claim), &|anchor| self.name(anchor)).split(' ').count()
        };
        let costs: Vec<usize> = self.claims.iter().map(cost).collect();
        let mut all: Vec<(usize, Vec<usize>)> = vec![(0, Vec::new())];
        all.extend((0..costs.len()).map(|at| (costs[at], vec![at])));
        for (at, first) in self.claims.iter().enumerate() {
            for (other, second) in self.claims.iter().enumerate().skip(at + 1) {
                // Counted among which? And two colours are none.
                let is_odd = first.is_ordinal()
                    || second.is_ordinal()
                    || matches!((first, second), (Claim::Color(_), Claim::Color(_)));
                if !is_odd {
                    all.push((costs[at] + costs[other], vec![at, other]));
                }
            }
        }
        all.sort_by_key(|(cost, _)| *cost); // stable: of equal length the preferred one
        let claims =
            all.into_iter().map(|(_, at)| at.into_iter().map(|at| self.claims[at].clone()).collect::<Vec<_>>());
        claims.filter(|claims| self.is_wanted(&claims.iter().collect::<Vec<_>>())).collect()
    }

    /// Some of the class, and the place of the thing among them; few things and small numbers first.
    fn set_apart(&self) -> Vec<(Group, Claim)> {
        let twins = self.around.twins(self.index).len() as u32;
        let orders = orders(&self.anchors);
        let mut groups: Vec<Group> = Vec::new();
        for claim in self.claims.iter().filter(|claim| !matches!(claim, Claim::Nth(..))) {
            // Who belongs to it is looked up where it is judged: only the right number passes.
            let holds = |other: &usize| is_true(claim, self.around, *other, &[]);
            let count = 1 + self.around.twins(self.index).iter().filter(|other| holds(other)).count() as u32;
            groups.extend((count > 1 && count <= twins).then(|| Group { count, by: claim.clone() }));
        }
        for count in 2..=twins.min(MAX_COUNT) {
            groups.extend(orders.iter().map(|order| Group { count, by: Claim::Nth(1, *order) }));
        }
        let mut all = Vec::new();
        for group in groups {
            // Among them it stands somewhere in every order.
            let Some(members) = crate::clause_truth::others_of_group(&group, self.around, self.index) else { continue };
            for order in &orders {
                let place = (1..=group.count.min(MAX_COUNT)).map(|n| Claim::Nth(n, *order));
                let claim = place.into_iter().find(|claim| is_true(claim, self.around, self.index, &members));
                all.extend(
                    claim.filter(|claim| self.is_wanted(&[&group.by, claim])).map(|claim| (group.clone(), claim)),
                );
            }
        }
        let number = |claim: &Claim| if let Claim::Nth(n, _) = claim { *n } else { 0 };
        all.sort_by_key(|(group, claim)| {
            number(claim) + if matches!(group.by, Claim::Nth(..)) { group.count } else { 0 }
        });
        all
    }

    fn says(&self, group: Option<Group>, claims: Vec<Claim>) -> Description {
        let label = self.around.scene.label(self.index);
        let name = |anchor: usize| self.name(anchor);
        let room = self.room.map_or(String::new(), |room| format!("in the {room}, "));
        let apart = group.as_ref().map_or(String::new(), |group| {
            let all = noun_phrase(&plural(label), std::slice::from_ref(&group.by), &name);
            format!("of the {} {all}, ", group.count)
        });
        let text = format!("{room}{apart}the {}", noun_phrase(label, &claims, &name));
        let named = group.iter().map(|group| &group.by).chain(&claims).flat_map(Claim::anchors);
        let anchors =
            named.map(|anchor| (anchor, self.names.get(&anchor).and_then(|(_, claim)| claim.clone()))).collect();
        let is_view_dependent = group.iter().map(|group| &group.by).chain(&claims).any(Claim::is_view_dependent);
        let (room, eye_error_m) = (self.room.map(str::to_owned), self.around.eye_error_m);
        Description { text, room, group, claims, anchors, is_view_dependent, eye_error_m }
    }
}

/// Things that may say where this one is, the nearest first, with what they are called: by their class if they are the only ones of it
/// (these first), else by one claim about such a one ("table closest to the door").
fn anchors(around: &Surroundings, index: usize) -> Vec<(usize, String, Option<Claim>)> {
    let scene = around.scene;
    let own = &scene.things[index].bounds;
    let mut others: Vec<(f64, usize)> = around
        .things
        .iter()
        .copied()
        .filter(|other| *other != index && scene.label(*other) != scene.label(index) && !is_hull(scene.label(*other)))
        .filter(|other| is_sure(scene, *other))
        .map(|other| (scene.things[other].bounds.gap_m(own), other))
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let is_only = |at: usize| around.twins(at).is_empty();
    let (only, many): (Vec<usize>, Vec<usize>) =
        others.into_iter().map(|(_, other)| other).partition(|other| is_only(*other));
    let only: Vec<usize> = only.into_iter().take(MAX_ANCHORS).collect();
    let described = many.into_iter().take(MAX_ANCHORS / 2).filter_map(|other| {
        let claim = true_claims(around, other, &only).into_iter().find(|claim| {
            !claim.is_view_dependent() && singles_out(None, std::slice::from_ref(claim), around, other)
        })?;
        let words =
            noun_phrase(scene.label(other), std::slice::from_ref(&claim), &|anchor| scene.label(anchor).to_string());
        Some((other, words, Some(claim)))
    });
    let described: Vec<(usize, String, Option<Claim>)> = described.collect();
    only.into_iter().map(|other| (other, scene.label(other).to_string(), None)).chain(described).collect()
}

/// All orders, in the order in which people prefer them.
fn orders(anchors: &[usize]) -> Vec<Order> {
    let plain = [Order::Largest, Order::Smallest, Order::Highest, Order::Lowest, Order::FromLeft, Order::FromRight];
    let near = anchors.iter().map(|anchor| Order::ClosestTo(*anchor));
    let far = anchors.iter().map(|anchor| Order::FarthestFrom(*anchor));
    near.chain(far).chain(plain).collect()
}

/// Claims that hold for the thing among all of its class, in the order in which people prefer them.
fn true_claims(around: &Surroundings, index: usize, anchors: &[usize]) -> Vec<Claim> {
    let rivals = around.twins(index);
    let each = |make: fn(usize) -> Claim| anchors.iter().map(move |anchor| make(*anchor));
    let betweens =
        anchors.iter().enumerate().flat_map(|(at, a)| anchors[at + 1..].iter().map(move |b| Claim::Between(*a, *b)));
    let material = around.scene.things[index].material.clone().map(Claim::Material);
    let function = around.scene.things[index].function.clone().map(Claim::Function);
    let orders = orders(anchors);
    let counted = (2..=(rivals.len() as u32 + 1).min(MAX_COUNT))
        .flat_map(|n| orders.iter().map(move |order| Claim::Nth(n, *order)));
    let all = each(Claim::On)
        .chain(each(Claim::In))
        .chain(each(Claim::Under))
        .chain(COLORS.map(Claim::Color))
        .chain(material)
        .chain(each(Claim::InGroup))
        .chain(orders.iter().map(|order| Claim::Nth(1, *order)))
        .chain(function)
        .chain(each(Claim::LeftOf))
        .chain(each(Claim::RightOf))
        .chain(each(Claim::InFrontOf))
        .chain(each(Claim::Behind))
        .chain(betweens)
        .chain(counted);
    all.filter(|claim| is_true(claim, around, index, &rivals)).collect()
}

/// Parts of the building, and things that nobody has named: neither described nor fit to say where something is.
pub fn is_hull(label: &str) -> bool {
    matches!(label, "wall" | "floor" | "ceiling" | "object" | "room")
}
