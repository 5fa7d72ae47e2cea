//! From text to [`Instruction`]: a recursive-descent parser over the marks of [`crate::lexicon`].
//!
//! ```text
//! instruction := step ((then | "and" before a verb | ".") step)*
//! step        := view? verb? noun-phrase ("," view)?
//! noun-phrase := (the | superlative | ordinal | adjective)* noun modifier*
//! modifier    := relation noun-phrase ("and" noun-phrase)? | in room | on the 2nd floor | with noun-phrase (on top | on it)?
//!              | not modifier | that is (modifier | adjective) | view
//! ```
//! A modifier belongs to the nearest noun ("the mug on the table near the window": the table is near the window) except after a comma
//! or "and", where it belongs to the head. Any text is accepted: what no rule knows is skipped, unknown words are nouns ("unicorn").

use crate::instruction::{
    Attribute, AttributeKind, Floor, Instruction, Referring, RelationClause, RoomReference, SpatialRelation, Step,
    StepKind, Superlative, View, ViewKind,
};
use crate::lexicon::{MAX_TEXT_BYTES, Mark, Token, tokens};
use crate::vocabulary::{Class, canonical, color_rgb, material, room_kind, singular_phrase};

/// Deepest nesting of noun phrases that is followed.
const MAX_DEPTH: usize = 6;
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
    let all = tokens(text, &|phrase| canonical(phrase).is_some());
    let mut steps = Vec::new();
    for clause in split_steps(&all) {
        let mut parser = Parser::new(clause, &[]);
        if let Some(step) = parser.step() {
            steps.push(step);
        }
        if steps.len() == MAX_STEPS {
            break;
        }
    }
    resolve_pronouns(&mut steps);
    Instruction { text: bounded(text), steps }
}

/// Parses one referring expression ("the chair left of the desk, facing the window"), never splitting it into steps. `known_classes` are
/// further class names (the labels of a scene) that count as known phrases.
pub fn parse_referring(text: &str, known_classes: &[&str]) -> Option<Referring> {
    let known: Vec<String> = known_classes.iter().map(|name| Class::new(name).text).collect();
    let is_class = |phrase: &str| canonical(phrase).is_some() || known.iter().any(|name| name == phrase);
    let all = tokens(text, &is_class);
    Parser::new(&all, &known).expression()
}

fn bounded(text: &str) -> String {
    let mut end = text.len().min(MAX_TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].to_string()
}

/// Cuts at "then", at sentence ends, and at "and" or a comma before a verb.
fn split_steps(all: &[Token]) -> Vec<&[Token]> {
    let starts_step = |at: usize| {
        let rest = &all[at..];
        let verb = rest.iter().position(|token| !matches!(token.mark, Mark::And | Mark::Comma | Mark::Then));
        verb.is_some_and(|index| matches!(rest[index].mark, Mark::Verb | Mark::Enter))
    };
    let mut clauses = Vec::new();
    let mut start = 0;
    for at in 0..all.len() {
        let cuts = match all[at].mark {
            // "next" and "finally" open a step only where a sentence could begin.
            Mark::Then => true,
            Mark::Stop => true,
            Mark::And | Mark::Comma => starts_step(at + 1),
            _ => false,
        };
        if cuts {
            clauses.push(&all[start..at]);
            start = at + 1;
        }
    }
    clauses.push(&all[start..]);
    clauses.retain(|clause| clause.iter().any(|token| !matches!(token.mark, Mark::And | Mark::Comma)));
    clauses
}

/// "go to the table and find the one near it": a wildcard target takes the class of the step before.
fn resolve_pronouns(steps: &mut [Step]) {
    for index in 1..steps.len() {
        if steps[index].goal.class.text == "one" {
            let class = steps[index - 1].goal.class.clone();
            if !class.text.is_empty() {
                steps[index].goal.class = class;
            }
        }
    }
}

struct Parser<'a> {
    tokens: &'a [Token],
    known: &'a [String],
    at: usize,
    view: Option<View>,
    last_class: Option<Class>,
}

impl<'a> Parser<'a> {
    fn new(tokens: &'a [Token], known: &'a [String]) -> Self {
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
                        _ => {}
                    }
                }
                Mark::Verb | Mark::Enter | Mark::Comma | Mark::Stop | Mark::Then | Mark::Pronoun | Mark::Copula => {
                    self.at += 1
                }
                _ => match &mut head {
                    None => head = self.noun_phrase(0),
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
        let mut head = head?;
        if head.class.text == "one" {
            // "facing the sinks, it's the one on the right"
            if let Some(class) = &self.last_class {
                head.class = class.clone();
            }
        }
        if let Some(view) = self.view.take() {
            head.view = Some(Box::new(view));
        }
        hoist_room(&mut head);
        Some(head)
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

    fn view_clause(&mut self, kind: ViewKind, depth: usize) {
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
        if let Some(anchor) = self.noun_phrase(depth + 1) {
            self.view.get_or_insert(View { kind, anchor });
        } else if kind == ViewKind::From {
            self.view
                .get_or_insert(View { kind, anchor: Referring { class: Class::new("door"), ..Referring::default() } });
        }
    }

    fn noun_phrase(&mut self, depth: usize) -> Option<Referring> {
        if depth > MAX_DEPTH {
            return None;
        }
        let mut out = Referring::default();
        let mut has_noun = false;
        loop {
            match self.mark() {
                Some(Mark::Determiner | Mark::Pronoun | Mark::Copula) => self.at += 1,
                Some(Mark::Not) if depth == 0 && self.mark_at(1) == Some(Mark::Word) => self.at += 1,
                Some(Mark::Superlative(superlative)) => {
                    self.at += 1;
                    out.superlatives.push(superlative);
                    if let Some(anchor) = self.part_of(depth) {
                        // "the top of the shelf" is the shelf; "the larger of the shelves" is the larger one.
                        let is_part = matches!(
                            superlative,
                            Superlative::Middle | Superlative::Corner | Superlative::Highest | Superlative::Lowest
                        );
                        let superlatives = if is_part { Vec::new() } else { std::mem::take(&mut out.superlatives) };
                        out = anchor;
                        out.superlatives.extend(superlatives);
                        has_noun = true;
                        break;
                    }
                }
                Some(Mark::Relation(SpatialRelation::Closest)) => {
                    self.at += 1;
                    out.superlatives.push(Superlative::Nearest);
                }
                Some(Mark::Size(size)) => {
                    let word = self.tokens[self.at].text.clone();
                    self.at += 1;
                    out.attributes.push(Attribute { kind: AttributeKind::Size(size), word, negated: false });
                }
                Some(Mark::Ordinal(n)) => {
                    self.at += 1;
                    out.ordinal = Some(n);
                }
                Some(Mark::One) => {
                    self.at += 1;
                    if self.mark() == Some(Mark::Of) {
                        self.at += 1; // "one of the chairs"
                    } else {
                        out.class = Class::new("one");
                        has_noun = true;
                        break;
                    }
                }
                Some(Mark::Of) if out.ordinal.is_some() || !out.superlatives.is_empty() => self.at += 1,
                Some(Mark::Floor(floor)) if self.noun_words() == 0 => {
                    self.at += 1;
                    out.floor = Some(floor);
                    has_noun = true;
                    out.room = Some(RoomReference::default());
                    break;
                }
                Some(Mark::Word) => {
                    let count = self.noun_words();
                    let words: Vec<&str> =
                        self.tokens[self.at..self.at + count].iter().map(|token| token.text.as_str()).collect();
                    self.noun(&words, &mut out);
                    self.at += count;
                    if let Some(anchor) = is_part(&out.class).then(|| self.part_of(depth)).flatten() {
                        out = anchor; // "the foot of the bed"
                    }
                    has_noun = true;
                    break;
                }
                _ => break,
            }
        }
        if !has_noun && out.superlatives.is_empty() && out.attributes.is_empty() && out.ordinal.is_none() {
            return None;
        }
        if !has_noun {
            out.class = Class::new("one"); // "the largest", "the red one"
        }
        if !out.class.text.is_empty() && !out.class.is_wildcard() {
            self.last_class = Some(out.class.clone());
        }
        while self.modifier(&mut out, depth) {}
        Some(out)
    }

    /// How many tokens from here form the words of a noun: marked words count when they continue a known phrase.
    fn noun_words(&self) -> usize {
        let rest = &self.tokens[self.at..];
        let mut count = rest.iter().take_while(|token| token.mark == Mark::Word).count();
        // "arm chair", "chest of drawers": a phrase of the tables may hold a marked word.
        for longer in (count + 1..=(count + 3).min(rest.len())).rev() {
            let phrase = rest[..longer].iter().map(|token| token.text.as_str()).collect::<Vec<_>>().join(" ");
            if self.is_known(&singular_phrase(&phrase)) {
                count = longer;
                break;
            }
        }
        count
    }

    fn is_known(&self, phrase: &str) -> bool {
        canonical(phrase).is_some() || self.known.iter().any(|name| name == phrase)
    }

    /// "of the bed" after a part word; the anchor it is part of.
    fn part_of(&mut self, depth: usize) -> Option<Referring> {
        if self.mark() != Some(Mark::Of) {
            return None;
        }
        let before = self.at;
        self.at += 1;
        let anchor = self.noun_phrase(depth + 1).filter(|anchor| !anchor.class.is_wildcard());
        if anchor.is_none() {
            self.at = before;
        }
        anchor
    }

    /// Splits noun words into adjectives and class, or recognises a room.
    fn noun(&self, words: &[&str], out: &mut Referring) {
        let mut words = words;
        if let Some(room) = room_reference(words) {
            out.room = Some(room);
            return;
        }
        while words.len() > 1 {
            let whole = singular_phrase(&words.join(" "));
            if self.is_known(&whole) {
                break;
            }
            let begins_known =
                (2..=words.len()).rev().any(|count| self.is_known(&singular_phrase(&words[..count].join(" "))));
            if begins_known {
                break;
            }
            if matches!(words[0], "dark" | "light" | "bright" | "pale") && color_rgb(words[1]).is_some() {
                words = &words[1..];
            } else if let Some(attribute) = adjective(words[0]) {
                out.attributes.push(attribute);
                words = &words[1..];
            } else if words[0].bytes().all(|byte| byte.is_ascii_digit()) {
                words = &words[1..];
            } else {
                break;
            }
        }
        let whole = singular_phrase(&words.join(" "));
        if self.is_known(&whole) {
            out.class = Class::new(&whole);
            return;
        }
        // The longest known ending is the class ("dirty coffee mug"); the words before it describe it.
        let known_from = (1..words.len()).find(|&from| self.is_known(&singular_phrase(&words[from..].join(" "))));
        match known_from {
            Some(from) => {
                if let Some(room) = room_reference(&words[..from]) {
                    out.room = Some(room); // "the kitchen table"
                } else {
                    for word in &words[..from] {
                        out.attributes.push(adjective(word).unwrap_or_else(|| Attribute {
                            kind: AttributeKind::Other,
                            word: (*word).to_string(),
                            negated: false,
                        }));
                    }
                }
                out.class = Class::new(&words[from..].join(" "));
            }
            None => out.class = Class::new(&words.join(" ")),
        }
    }

    /// Reads one modifier of `head`; false if the next tokens are none.
    fn modifier(&mut self, head: &mut Referring, depth: usize) -> bool {
        let start = self.at;
        // Relative clauses: "that is", "which is", "it is".
        self.skip(|mark| matches!(mark, Mark::Pronoun | Mark::Copula));
        let linked = self.at > start;
        if depth == 0 {
            // Only the head is continued after a comma or an "and".
            if matches!(self.mark(), Some(Mark::Comma | Mark::And)) {
                let next = self.tokens[self.at + 1..]
                    .iter()
                    .find(|token| !matches!(token.mark, Mark::Pronoun | Mark::Copula | Mark::And))
                    .map(|token| token.mark);
                if matches!(
                    next,
                    Some(Mark::Relation(_) | Mark::In | Mark::With | Mark::Without | Mark::Not | Mark::Floor(_))
                ) {
                    self.skip(|mark| matches!(mark, Mark::Comma | Mark::And | Mark::Pronoun | Mark::Copula));
                }
            }
        }
        let negated = self.mark() == Some(Mark::Not);
        if negated {
            self.at += 1;
            self.skip(|mark| matches!(mark, Mark::Copula | Mark::Pronoun | Mark::One));
        }
        let done = match self.mark() {
            Some(Mark::Floor(floor)) => {
                self.at += 1;
                head.floor = Some(floor);
                true
            }
            Some(Mark::In) => {
                self.at += 1;
                self.inside(head, negated, depth)
            }
            Some(Mark::Relation(relation)) => {
                self.at += 1;
                self.relation(head, relation, negated, depth)
            }
            Some(Mark::With) => {
                self.at += 1;
                self.with(head, negated, depth)
            }
            Some(Mark::Without) => {
                self.at += 1;
                self.with(head, true, depth)
            }
            Some(Mark::Superlative(Superlative::Nearest))
                if matches!(self.mark_at(1), Some(Mark::Determiner | Mark::From | Mark::Word)) =>
            {
                self.at += 1;
                self.skip(|mark| mark == Mark::From);
                self.relation(head, SpatialRelation::Closest, negated, depth)
            }
            Some(Mark::Superlative(superlative)) => {
                self.at += 1;
                if self.mark() == Some(Mark::Of) {
                    self.at += 1; // "in the corner of the room"
                    let _ = self.noun_phrase(depth + 1);
                }
                head.superlatives.push(superlative);
                true
            }
            Some(Mark::From)
                if head.superlatives.contains(&Superlative::Nearest)
                    || head.superlatives.contains(&Superlative::Farthest) =>
            {
                // "the closest chair to the door"
                self.at += 1;
                let relation = if head.superlatives.contains(&Superlative::Nearest) {
                    SpatialRelation::Closest
                } else {
                    SpatialRelation::Farthest
                };
                let done = self.relation(head, relation, negated, depth);
                if done {
                    head.superlatives
                        .retain(|superlative| !matches!(superlative, Superlative::Nearest | Superlative::Farthest));
                }
                done
            }
            Some(Mark::From) if head.ordinal.is_some() => {
                // "second from the left"
                self.at += 1;
                self.skip(|mark| mark == Mark::Determiner);
                match self.mark() {
                    Some(Mark::Superlative(superlative)) => {
                        self.at += 1;
                        head.superlatives.insert(0, superlative);
                        true
                    }
                    _ => self.relation(head, SpatialRelation::Closest, negated, depth),
                }
            }
            Some(Mark::Ordinal(n)) if linked => {
                self.at += 1;
                head.ordinal = Some(n);
                true
            }
            Some(Mark::Size(size)) if linked => {
                let word = self.tokens[self.at].text.clone();
                self.at += 1;
                head.attributes.push(Attribute { kind: AttributeKind::Size(size), word, negated });
                true
            }
            Some(Mark::View(ViewKind::Facing)) if depth == 0 && self.at > 0 && self.view.is_none() => {
                self.at += 1;
                self.relation(head, SpatialRelation::Opposite, negated, depth)
            }
            Some(Mark::Of) if depth > 0 || room_follows(&self.tokens[self.at + 1..]) => {
                self.at += 1;
                self.inside(head, negated, depth)
            }
            Some(Mark::Word) if linked || negated => match adjective(&self.tokens[self.at].text) {
                Some(attribute) => {
                    self.at += 1;
                    head.attributes.push(Attribute { negated, ..attribute });
                    true
                }
                None if negated => self.repeat_last_relation(head, depth),
                None => false,
            },
            Some(Mark::Determiner) if negated => self.repeat_last_relation(head, depth),
            _ => false,
        };
        if !done {
            self.at = start;
        }
        done
    }

    /// "on the windowsill, not the table": the relation before holds for the negated thing too.
    fn repeat_last_relation(&mut self, head: &mut Referring, depth: usize) -> bool {
        match head.relations.last().map(|clause| clause.relation) {
            Some(relation) => self.relation(head, relation, true, depth),
            None => false,
        }
    }

    /// "in the kitchen", "in room 3", "in the box".
    fn inside(&mut self, head: &mut Referring, negated: bool, depth: usize) -> bool {
        let Some(anchor) = self.noun_phrase(depth + 1) else {
            return false;
        };
        if anchor.class.text.is_empty() {
            if let Some(floor) = anchor.floor {
                head.floor = Some(floor);
            }
            if let Some(room) = anchor.room.clone() {
                let room = RoomReference {
                    contains: anchor
                        .relations
                        .iter()
                        .filter(|clause| !clause.negated)
                        .flat_map(|clause| clause.anchors.clone())
                        .chain(room.contains)
                        .collect(),
                    ..room
                };
                if room.name.is_empty() && room.contains.is_empty() {
                } else if negated {
                    head.excluded_rooms.push(room);
                } else {
                    head.room.get_or_insert(room);
                }
            }
            return true;
        }
        if anchor.class.is_wildcard() {
            return true;
        }
        head.relations.push(RelationClause { relation: SpatialRelation::Inside, anchors: vec![anchor], negated });
        true
    }

    fn relation(&mut self, head: &mut Referring, relation: SpatialRelation, negated: bool, depth: usize) -> bool {
        // "not near" is a phrase of its own in the lexicon; "not far from" too.
        let in_the_middle_of =
            relation == SpatialRelation::Between && self.at > 0 && self.tokens[self.at - 1].text.ends_with(" of");
        let refers_back =
            depth == 0 && self.tokens.get(self.at).is_some_and(|token| matches!(token.text.as_str(), "it" | "them"));
        let pronoun = || {
            let class = self.last_class.clone()?;
            Some(self.view.as_ref().map_or(Referring { class, ..Referring::default() }, |view| view.anchor.clone()))
        };
        let meant = if refers_back { pronoun() } else { None };
        if meant.is_some() {
            self.at += 1;
        }
        let Some(first) = meant.or_else(|| self.noun_phrase(depth + 1)) else {
            // "closest", "nearest" at the end of the text: to the robot.
            if matches!(relation, SpatialRelation::Closest | SpatialRelation::Farthest) {
                head.superlatives.push(if relation == SpatialRelation::Closest {
                    Superlative::Nearest
                } else {
                    Superlative::Farthest
                });
                return true;
            }
            return false;
        };
        if first.class.text.is_empty() {
            // "at the kitchen", "on the second floor", "by the kitchen"
            if let Some(floor) = first.floor {
                head.floor = Some(floor);
            } else if let Some(room) = first.room {
                if negated {
                    head.excluded_rooms.push(room);
                } else {
                    head.room.get_or_insert(room);
                }
            }
            return true;
        }
        if first.class.is_wildcard() && first.relations.is_empty() {
            return true;
        }
        let mut anchors = vec![first];
        while self.mark() == Some(Mark::And) && matches!(self.mark_at(1), Some(Mark::Determiner | Mark::Word)) {
            let before = self.at;
            self.at += 1;
            match self.noun_phrase(depth + 1).filter(|anchor| !anchor.class.text.is_empty()) {
                Some(anchor) => anchors.push(anchor),
                None => {
                    self.at = before;
                    break;
                }
            }
        }
        if in_the_middle_of && anchors.len() == 1 {
            head.superlatives.push(Superlative::Middle); // "in the middle of the table"
        } else if relation == SpatialRelation::Between {
            anchors.truncate(2);
            head.relations.push(RelationClause { relation, anchors, negated });
        } else {
            head.relations.extend(anchors.into_iter().map(|anchor| RelationClause {
                relation,
                anchors: vec![anchor],
                negated,
            }));
        }
        true
    }

    /// "with a mug on top", "with two monitors on it", "with a plant next to it".
    fn with(&mut self, head: &mut Referring, negated: bool, depth: usize) -> bool {
        let Some(mut anchor) = self.noun_phrase(depth + 1) else {
            return false;
        };
        let mut relation = SpatialRelation::With;
        // "on top" was read as a superlative of the anchor.
        if let Some(index) = anchor.superlatives.iter().position(|superlative| *superlative == Superlative::Highest) {
            anchor.superlatives.remove(index);
            relation = SpatialRelation::Supporting;
        }
        let refers_back = |parser: &Self, ahead: usize| {
            parser.tokens.get(parser.at + ahead).is_none_or(|token| {
                matches!(token.text.as_str(), "it" | "them" | "top") || matches!(token.mark, Mark::Comma | Mark::Stop)
            })
        };
        match self.mark() {
            Some(Mark::Relation(inverse)) if refers_back(self, 1) => {
                relation = match inverse {
                    SpatialRelation::On => SpatialRelation::Supporting,
                    SpatialRelation::Under => SpatialRelation::Above,
                    SpatialRelation::Above => SpatialRelation::Under,
                    SpatialRelation::Near => SpatialRelation::Near,
                    other => other,
                };
                self.at = (self.at + 2).min(self.tokens.len());
            }
            Some(Mark::In) if refers_back(self, 1) => {
                relation = SpatialRelation::Containing;
                self.at = (self.at + 2).min(self.tokens.len());
            }
            _ => {}
        }
        if anchor.class.text.is_empty() || anchor.class.is_wildcard() {
            return true;
        }
        if let (Some(room), true) = (&mut head.room, head.class.text.is_empty()) {
            room.contains.push(anchor); // "the room with the piano"
            return true;
        }
        head.relations.push(RelationClause { relation, anchors: vec![anchor], negated });
        true
    }

    fn mark(&self) -> Option<Mark> {
        self.mark_at(0)
    }

    fn mark_at(&self, ahead: usize) -> Option<Mark> {
        self.tokens.get(self.at + ahead).map(|token| token.mark)
    }

    fn skip(&mut self, unwanted: impl Fn(Mark) -> bool) {
        while self.mark().is_some_and(&unwanted) {
            self.at += 1;
        }
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

/// Colour or material word as an attribute.
fn adjective(word: &str) -> Option<Attribute> {
    let kind_and_word = if color_rgb(word).is_some() {
        (AttributeKind::Color, word.to_string())
    } else if let Some(canonical) = material(word) {
        (AttributeKind::Material, canonical.to_string())
    } else {
        return None;
    };
    Some(Attribute { kind: kind_and_word.0, word: kind_and_word.1, negated: false })
}

/// `kitchen`, `room 3`, `conference room`, or just `room`.
fn room_reference(words: &[&str]) -> Option<RoomReference> {
    let phrase = singular_phrase(&words.join(" "));
    if let Some(kind) = room_kind(&phrase) {
        return Some(RoomReference { name: phrase, kind: Some(kind.to_string()), contains: Vec::new() });
    }
    match words {
        ["room"] => Some(RoomReference::default()),
        // "bedroom 2", "room 3"
        [front @ .., number] if !front.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) => {
            let kind = room_kind(&front.join(" "));
            (kind.is_some() || front == ["room"]).then(|| RoomReference {
                name: phrase,
                kind: kind.map(str::to_string),
                contains: Vec::new(),
            })
        }
        // "storage area", "server room" beyond the table: any words before "room"
        [_, .., "room"] => Some(RoomReference { name: phrase, kind: None, contains: Vec::new() }),
        _ => None,
    }
}

fn room_follows(rest: &[Token]) -> bool {
    let words: Vec<&str> = rest
        .iter()
        .skip_while(|token| token.mark == Mark::Determiner)
        .take_while(|token| token.mark == Mark::Word)
        .map(|token| token.text.as_str())
        .collect();
    room_reference(&words).is_some()
}

/// Words for parts and amounts of a thing: "the foot of the bed", "a pile of books".
fn is_part(class: &Class) -> bool {
    const PARTS: &[&str] = &[
        "foot",
        "head",
        "end",
        "side",
        "edge",
        "corner",
        "part",
        "front",
        "rear",
        "base",
        "leg",
        "arm",
        "row",
        "pair",
        "set",
        "stack",
        "pile",
        "group",
        "bunch",
        "number",
        "couple",
        "cluster",
        "line",
        "piece",
        "kind",
        "type",
        "direction",
        "length",
    ];
    PARTS.contains(&class.head())
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
