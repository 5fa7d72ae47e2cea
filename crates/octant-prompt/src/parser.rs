//! From text to [`Instruction`]: a recursive-descent parser over the marks of [`crate::lexicon`].
//!
//! ```text
//! instruction := step ((then | "and" before a verb | ".") step)*
//! step        := view? verb? noun-phrase ("," view)? | "return to start" and its like ([`crate::home_phrase`])
//! noun-phrase := (the | superlative | ordinal | adjective)* noun modifier*
//! modifier    := relation noun-phrase ("and" noun-phrase)? | in room | on the 2nd floor | with noun-phrase (on top | on it)?
//!              | not modifier | that is (modifier | adjective) | view
//! ```
//! A modifier belongs to the nearest noun ("the mug on the table near the window": the table is near the window) except after a comma
//! or "and", where it belongs to the head. Any text is accepted: what no rule knows is skipped, unknown words are nouns ("unicorn").

use crate::fronted_group::fronted_group;
use crate::home_phrase::is_way_home;
use crate::instruction::{
    Among, Floor, Instruction, Referring, RelationClause, RoomReference, SpatialRelation, Step, StepKind, Superlative,
    View, ViewKind,
};
use crate::lexicon::{MAX_TEXT_BYTES, Mark, Token, tokens, tokens_of, words};
use crate::plain_speech::{keep_what_was_said, leave_out_talk, plain, visit_mut};
use crate::purpose::{named, said_anywhere};
use crate::spelling::respelled;
use crate::steps::{resolve_pronouns, split_steps};
use crate::vocabulary::{Class, canonical, is_known};

/// Deepest nesting of noun phrases that is followed.
pub(crate) const MAX_DEPTH: usize = 6;
/// Most steps that are kept.
const MAX_STEPS: usize = 16;

/// Parses an instruction for a robot. Deterministic, total; text without a noun gives no steps.
///
/// ```
/// use octant_prompt::{StepKind, parse_instruction};
/// let instruction = parse_instruction("go to the kitchen, then find the mug on the table");
/// assert_eq!(instruction.steps.len(), 2);
/// assert_eq!(instruction.steps[0].kind, StepKind::GoToRoom);
/// assert_eq!(instruction.nouns(), ["mug", "table"]);
/// ```
pub fn parse_instruction(text: &str) -> Instruction {
    let (words, mut readings) = respelled(plain(words(text)));
    let (words, uses, also) = named(words);
    let all = tokens_of(&words, &|phrase| canonical(phrase).is_some());
    let mut steps = Vec::new();
    let mut are_said = Vec::new();
    for clause in split_steps(&all) {
        if is_way_home(clause) {
            steps.push(Step { kind: StepKind::ReturnToStart, goal: Referring::default() });
        } else if let Some(step) = Parser::new(clause, &[]).step() {
            steps.push(step);
        } else {
            continue;
        }
        are_said.push(!clause.iter().any(|token| matches!(token.mark, Mark::Verb | Mark::Enter)));
        if steps.len() == MAX_STEPS {
            break;
        }
    }
    leave_out_talk(&mut steps, &are_said);
    let is_lost = |step: &Step| {
        step.kind == StepKind::FindObject && !is_known(&step.goal.class) && step.goal.relations.is_empty()
    };
    if steps.iter().all(is_lost)
        && let Some(reading) = said_anywhere(&words)
    {
        // "I want coffee"
        let goal = Referring { class: Class::new(&reading.meant), ..Referring::default() };
        steps = vec![Step { kind: StepKind::FindObject, goal }];
        readings.push(reading);
    }
    resolve_pronouns(&mut steps);
    for step in &mut steps {
        visit_mut(&mut step.goal, &mut |goal| keep_what_was_said(&mut goal.class, &readings, &also));
    }
    readings.extend(uses);
    Instruction { text: bounded(text), steps, readings }
}

/// Parses one referring expression ("the chair left of the desk, facing the window"), never splitting it into steps. `known_classes` are
/// further class names (the labels of a scene) that count as known phrases.
pub fn parse_referring(text: &str, known_classes: &[&str]) -> Option<Referring> {
    let known: Vec<String> = known_classes.iter().map(|name| Class::new(name).text).collect();
    let is_class = |phrase: &str| canonical(phrase).is_some() || known.iter().any(|name| name == phrase);
    let Some(fronted) = fronted_group(text) else {
        return Parser::new(&tokens(text, &is_class), &known).expression();
    };
    let mut goal = Parser::new(&tokens(&fronted.rest, &is_class), &known).expression()?;
    let mut group = Parser::new(&tokens(fronted.group, &is_class), &known).expression()?;
    group.class.is_plural = goal.class.is_plural;
    if goal.class.is_wildcard() {
        goal.class = group.class.clone();
    }
    group.room = group.room.take().or_else(|| goal.room.clone());
    goal.among = Some(Box::new(Among { count: fronted.count, goal: group }));
    Some(goal)
}

fn bounded(text: &str) -> String {
    let mut end = text.len().min(MAX_TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].to_string()
}

/// The state of one clause. Its methods for nouns and for what follows them stand in [`crate::noun_phrase`] and [`crate::modifiers`].
pub(crate) struct Parser<'a> {
    pub(crate) tokens: &'a [Token],
    pub(crate) known: &'a [String],
    pub(crate) at: usize,
    pub(crate) view: Option<View>,
    pub(crate) last_class: Option<Class>,
}

impl<'a> Parser<'a> {
    pub(crate) fn new(tokens: &'a [Token], known: &'a [String]) -> Self {
        Parser { tokens, known, at: 0, view: None, last_class: None }
    }

    fn step(&mut self) -> Option<Step> {
        let enters = self.tokens.iter().any(|token| token.mark == Mark::Enter);
        let goal = self.expression()?;
        let names_room = goal.class.text.is_empty() && goal.room.is_some();
        let kind = if names_room || (enters && goal.room.is_some() && goal.class.is_wildcard()) {
            StepKind::GoToRoom
        } else {
            StepKind::FindObject
        };
        Some(Step { kind, goal })
    }

    /// The head noun phrase with everything the clause says about it.
    fn expression(&mut self) -> Option<Referring> {
        let mut head: Option<Referring> = None;
        // "On the desk with a lamp, choose the book on the right": what stands before the head.
        let mut fronted = Referring::default();
        self.existential(&mut head);
        while self.at < self.tokens.len() {
            let before = self.at;
            match self.tokens[self.at].mark {
                Mark::View(kind) => self.view_clause(kind, 0),
                Mark::When => {
                    self.at += 1;
                    self.skip(|mark| matches!(mark, Mark::Pronoun | Mark::Copula));
                    match self.mark() {
                        Some(Mark::View(kind)) => self.view_clause(kind, 0),
                        Some(Mark::Verb) if self.tokens[self.at].text == "look at" => {
                            self.view_clause(ViewKind::Facing, 0)
                        }
                        Some(Mark::Enter) => self.view_clause(ViewKind::From, 0),
                        // "if the plant is at the bottom, it is the left one": the condition is no part of the answer.
                        Some(Mark::Determiner) if head.is_none() && self.comma_follows() => {
                            self.skip(|mark| mark != Mark::Comma)
                        }
                        _ => {}
                    }
                }
                Mark::Verb if head.is_some() => {
                    self.at += 1;
                    self.selection(&mut head);
                }
                Mark::Relation(relation) if head.is_none() && relation != SpatialRelation::Closest => {
                    self.modifier(&mut fronted, 1);
                }
                Mark::In if head.is_none() => {
                    self.modifier(&mut fronted, 1);
                }
                Mark::Verb | Mark::Enter | Mark::Comma | Mark::Stop | Mark::Then | Mark::Pronoun | Mark::Copula => {
                    self.at += 1
                }
                _ => match &mut head {
                    None => {
                        let before = self.last_class.clone();
                        head = self.noun_phrase(0);
                        if let (Some(head), Some(before)) = (&mut head, before)
                            && head.class.text == "one"
                        {
                            head.class = before; // "facing the sinks, it's the one on the right"
                            head.class.is_plural = false;
                        }
                    }
                    Some(head) => {
                        if !self.modifier(head, 0) {
                            self.continuation(head);
                        }
                    }
                },
            }
            if self.at == before {
                self.at += 1; // nothing knows this token
            }
        }
        let mut head = match head {
            Some(head) => head,
            // "farthest from the sofa": of whatever was spoken of, or of all things.
            None if fronted.relations.is_empty() && self.view.is_none() => return None,
            None => Referring {
                class: self.last_class.clone().unwrap_or_else(|| Class::new("one")),
                ..Referring::default()
            },
        };
        head.relations.extend(fronted.relations);
        head.superlatives.extend(fronted.superlatives);
        if let Some(room) = fronted.room {
            // "in the kitchen, the mug near the sink": all of that is in the kitchen.
            head.relations.iter_mut().flat_map(|clause| &mut clause.anchors).for_each(|anchor| place_in(anchor, &room));
            head.room.get_or_insert(room);
        }
        if let Some(view) = self.view.take() {
            head.view = Some(Box::new(view));
        }
        hoist_room(&mut head);
        Some(head)
    }

    /// "There are some plants next to this cabinet.": the cabinet is meant, and the plants are near it.
    fn existential(&mut self, head: &mut Option<Referring>) {
        if self.tokens.first().is_none_or(|token| token.text != "there") {
            return;
        }
        let this = |token: &Token| matches!(token.text.as_str(), "this" | "these");
        let Some(at) = self.tokens.iter().position(this).filter(|at| *at > 1) else { return };
        let mut before = Parser::new(&self.tokens[..at], self.known);
        let there = before.noun_phrase(0).filter(|there| !there.class.text.is_empty() && !there.class.is_wildcard());
        self.at = at;
        *head = self.noun_phrase(0).filter(|head| !head.class.text.is_empty());
        if let (Some(head), Some(mut there)) = (head, there) {
            there.relations.clear();
            let negated = self.tokens[..at].iter().any(|token| matches!(token.mark, Mark::Without | Mark::Not));
            head.relations.push(RelationClause { relation: SpatialRelation::Near, anchors: vec![there], negated });
        }
    }

    fn comma_follows(&self) -> bool {
        let rest = &self.tokens[self.at..];
        rest.iter().position(|token| token.mark == Mark::Comma).is_some_and(|comma| comma + 1 < rest.len())
    }

    /// "There are two lamps on the desk. Choose the left one.": what is to be chosen is the head, what was said before is about it.
    fn selection(&mut self, head: &mut Option<Referring>) {
        self.skip(|mark| matches!(mark, Mark::Pronoun | Mark::Copula));
        let before = self.at;
        let Some(mut chosen) = self.noun_phrase(0).filter(|chosen| !chosen.class.text.is_empty()) else {
            self.at = before;
            return;
        };
        let Some(mut earlier) = head.take() else { return };
        chosen.room = chosen.room.take().or(earlier.room.take());
        chosen.floor = chosen.floor.or(earlier.floor);
        if earlier.class.text.is_empty() {
            // Only a room was named before.
        } else if chosen.class.is_wildcard() || chosen.class.canonical == earlier.class.canonical {
            if chosen.class.is_wildcard() {
                chosen.class = earlier.class;
            }
            chosen.attributes.extend(earlier.attributes);
            chosen.relations.extend(earlier.relations);
            chosen.superlatives.extend(earlier.superlatives);
        } else if !earlier.class.is_wildcard() {
            chosen.relations.push(RelationClause {
                relation: SpatialRelation::Near,
                anchors: vec![earlier],
                negated: false,
            });
        }
        *head = Some(chosen);
    }

    /// After the head: "... is the one at the desk", "... the chair near it": a repeated noun phrase whose modifiers are about the head.
    fn continuation(&mut self, head: &mut Referring) {
        let Some(again) = self.noun_phrase(1) else {
            return;
        };
        let same =
            again.class.is_wildcard() || again.class.text.is_empty() || again.class.canonical == head.class.canonical;
        if same || head.class.is_wildcard() {
            if head.class.is_wildcard() && !again.class.text.is_empty() {
                head.class = again.class;
            }
            head.attributes.extend(again.attributes);
            head.relations.extend(again.relations);
            head.superlatives.extend(again.superlatives);
            head.room = head.room.take().or(again.room);
            head.ordinal = head.ordinal.or(again.ordinal);
        }
    }

    pub(crate) fn view_clause(&mut self, kind: ViewKind, depth: usize) {
        self.at += 1;
        if kind == ViewKind::From && self.mark().is_some_and(|mark| matches!(mark, Mark::From | Mark::In)) {
            self.at += 1;
        }
        // "looking at the front of the copier"
        self.skip(|mark| matches!(mark, Mark::Determiner | Mark::Relation(SpatialRelation::InFrontOf)));
        if matches!(self.mark(), Some(Mark::Superlative(Superlative::Middle)))
            && matches!(self.mark_at(1), Some(Mark::View(_)))
        {
            return; // "standing in the middle of the room facing ..."
        }
        let mut anchor = self.noun_phrase(depth + 1);
        if kind == ViewKind::From
            && anchor.as_ref().is_some_and(|anchor| anchor.class.text.is_empty())
            && self.mark() == Some(Mark::From)
        {
            self.at += 1; // "enter the room through the double doors"
            anchor = self.noun_phrase(depth + 1);
        }
        if let Some(anchor) = anchor {
            // "standing in the room facing the cups": whom one faces says more than where one stands.
            let view = View { kind, anchor };
            match &mut self.view {
                Some(known) if known.kind != ViewKind::From || kind == ViewKind::From => {}
                known => *known = Some(view),
            }
            // "facing the window from the door"
            while self.mark() == Some(Mark::From) {
                self.at += 1;
                let _ = self.noun_phrase(depth + 1);
            }
        } else if kind == ViewKind::From {
            self.view
                .get_or_insert(View { kind, anchor: Referring { class: Class::new("door"), ..Referring::default() } });
        }
    }

    pub(crate) fn mark(&self) -> Option<Mark> {
        self.mark_at(0)
    }

    pub(crate) fn mark_at(&self, ahead: usize) -> Option<Mark> {
        self.tokens.get(self.at + ahead).map(|token| token.mark)
    }

    pub(crate) fn skip(&mut self, unwanted: impl Fn(Mark) -> bool) {
        while self.mark().is_some_and(&unwanted) {
            self.at += 1;
        }
    }
}

/// What is named after a room is in that room, unless it is said to be in another.
fn place_in(anchor: &mut Referring, room: &RoomReference) {
    if anchor.room.is_none() && !anchor.class.text.is_empty() {
        anchor.room = Some(room.clone());
        anchor.relations.iter_mut().flat_map(|clause| &mut clause.anchors).for_each(|anchor| place_in(anchor, room));
    }
}

/// "the mug near the sink in the kitchen": what is near something in the kitchen is looked for in the kitchen.
fn hoist_room(head: &mut Referring) {
    if head.room.is_some() || head.class.text.is_empty() {
        return;
    }
    let local = |clause: &&mut RelationClause| {
        !clause.negated && !matches!(clause.relation, SpatialRelation::Far | SpatialRelation::Farthest)
    };
    for clause in head.relations.iter_mut().filter(local) {
        for anchor in &mut clause.anchors {
            hoist_room(anchor);
            if let Some(room) = &anchor.room {
                head.room = Some(room.clone());
                return;
            }
        }
    }
}

impl Floor {
    /// The storey meant, for a robot on storey `robot_floor`.
    pub fn resolve(self, robot_floor: i32) -> i32 {
        match self {
            Floor::Number(floor) => floor,
            Floor::Relative(change) => robot_floor + change,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruction::SpatialRelation as R;

    /// A compact print of an expression, so that one line shows the whole parse.
    fn brief(goal: &Referring) -> String {
        let mut out = goal.class.text.clone();
        for a in &goal.attributes {
            out += &format!(" {}{}", if a.negated { "!" } else { "" }, a.word);
        }
        for s in &goal.superlatives {
            out += &format!(" {}", s.word());
        }
        if let Some(n) = goal.ordinal {
            out += &format!(" #{n}");
        }
        for clause in &goal.relations {
            let anchors: Vec<String> = clause.anchors.iter().map(brief).collect();
            out += &format!(
                " [{}{} {}]",
                if clause.negated { "!" } else { "" },
                clause.relation.word(),
                anchors.join(" & ")
            );
        }
        if let Some(room) = &goal.room {
            out += &format!(" @{}", room.name);
            for content in &room.contains {
                out += &format!("({})", brief(content));
            }
        }
        for room in &goal.excluded_rooms {
            out += &format!(" !@{}", room.name);
        }
        if let Some(view) = &goal.view {
            out += &format!(" <{:?} {}>", view.kind, brief(&view.anchor));
        }
        out
    }

    fn check(text: &str, expected: &[&str]) {
        let instruction = parse_instruction(text);
        let found: Vec<String> = instruction
            .steps
            .iter()
            .map(|step| format!("{}{}", if step.kind == StepKind::GoToRoom { "room:" } else { "" }, brief(&step.goal)))
            .collect();
        assert_eq!(found, expected, "{text}");
    }

    #[test]
    fn the_instructions_of_the_two_robots() {
        check("find the mug near the sink", &["mug [near sink]"]);
        check("go to the plant in the meeting room", &["plant @meeting room"]);
        check("go to the kitchen, then find the mug on the table", &["room: @kitchen", "mug [on table]"]);
        check("Go to the kitchen and find the red mug.", &["room: @kitchen", "mug red"]);
        check("find the unicorn", &["unicorn"]);
        check("go to the nearest chair", &["chair nearest"]);
        check("Find a wooden chair next to the large white cabinet", &["chair wood [near cabinet large white]"]);
        check("enter the bathroom", &["room: @bathroom"]);
        check("walk to the office chair", &["office chair"]);
        check("go to the bedroom 2 and then to the lamp", &["room: @bedroom 2", "lamp"]);
    }

    #[test]
    fn nested_relations_belong_to_the_nearest_noun() {
        check("find the mug on the table near the window", &["mug [on table [near window]]"]);
        check("find the mug on the table, near the window", &["mug [on table] [near window]"]);
        check("find the mug near the sink and the fridge", &["mug [near sink] [near fridge]"]);
        check("find the mug that is near the sink and on the counter", &["mug [near sink] [on counter]"]);
        check("find the box between the sofa and the tv", &["box [between sofa & tv]"]);
        check("find the mug near the sink in the kitchen", &["mug [near sink @kitchen] @kitchen"]);
    }

    #[test]
    fn with_without_and_not() {
        check("find the table with a laptop on top", &["table [supporting laptop]"]);
        check("find the table with a laptop on it", &["table [supporting laptop]"]);
        check("find the shelf with books in it", &["shelf [containing book]"]);
        check("find the desk with a monitor", &["desk [with monitor]"]);
        check("find the desk without a monitor", &["desk [!with monitor]"]);
        check("find the chair that is not red", &["chair !red"]);
        check("find the chair not near the desk", &["chair [far from desk]"]);
        check("find the plant not in the kitchen", &["plant !@kitchen"]);
        check("go to the room with the piano", &["room: @(piano)"]);
        check("find the chair in the room with the piano", &["chair @(piano)"]);
    }

    #[test]
    fn superlatives_ordinals_views() {
        check("the largest box", &["box largest"]);
        check("go to the second chair from the left", &["chair leftmost #2"]);
        check("the chair closest to the foot of the bed", &["chair [closest to bed]"]);
        check("find the closest chair to the door", &["chair [closest to door]"]);
        check("facing the sinks, it's the one on the right", &["sink rightmost <Facing sink>"]);
        check("with your back to the door, the lamp on the left", &["lamp leftmost <BackTo door>"]);
        check("the chair left of the desk", &["chair [left of desk]"]);
    }

    #[test]
    fn floors_and_unknown_words() {
        let upstairs = parse_instruction("find the bed upstairs");
        assert_eq!(upstairs.steps[0].goal.floor, Some(Floor::Relative(1)));
        assert_eq!(parse_instruction("find the lamp on the second floor").steps[0].goal.floor, Some(Floor::Number(1)));
        check("find the flux capacitor beside the zorgle", &["flux capacitor [near zorgle]"]);
        check("find the dirty coffee mug", &["coffee mug dirty"]);
        check("", &[]);
        check("?!,. and then", &[]);
        assert_eq!(parse_instruction("find the mug near the sink").nouns(), ["mug", "sink"]);
        assert!(
            parse_instruction("find a mug").steps[0].goal.relations.iter().all(|clause| clause.relation == R::Near)
        );
    }
}
