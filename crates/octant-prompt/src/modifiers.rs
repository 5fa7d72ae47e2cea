//! What follows a noun: relations, rooms, "with" and "without", order, negation.

use crate::instruction::{
    Attribute, AttributeKind, Referring, RelationClause, RoomReference, SpatialRelation, Superlative, ViewKind,
};
use crate::lexicon::Mark;
use crate::noun_phrase::{adjective, room_follows};
use crate::parser::Parser;
use crate::vocabulary::Class;

impl Parser<'_> {
    /// Reads one modifier of `head`; false if the next tokens are none.
    pub(crate) fn modifier(&mut self, head: &mut Referring, depth: usize) -> bool {
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
                    Some(
                        Mark::Relation(_)
                            | Mark::In
                            | Mark::With
                            | Mark::Without
                            | Mark::For
                            | Mark::Not
                            | Mark::Floor(_)
                    )
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
            Some(Mark::For) => {
                self.at += 1;
                self.purpose(head, negated)
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
                None if negated => self.contrast(head, depth),
                None => false,
            },
            Some(Mark::Determiner | Mark::One) if negated => self.contrast(head, depth),
            _ => false,
        };
        if !done {
            self.at = start;
        }
        done
    }

    /// "the brown door, not the white one": what is said of the other one does not hold for this one.
    fn contrast(&mut self, head: &mut Referring, depth: usize) -> bool {
        let before = self.at;
        if let Some(other) = self.noun_phrase(depth + 1)
            && (other.class.is_wildcard() || other.class.canonical == head.class.canonical)
        {
            let flipped = |negated: bool| !negated;
            head.attributes
                .extend(other.attributes.into_iter().map(|each| Attribute { negated: flipped(each.negated), ..each }));
            head.relations.extend(
                other.relations.into_iter().map(|each| RelationClause { negated: flipped(each.negated), ..each }),
            );
            return true;
        }
        self.at = before;
        self.repeat_last_relation(head, depth)
    }

    /// "on the windowsill, not the table": the relation before holds for the negated thing too.
    fn repeat_last_relation(&mut self, head: &mut Referring, depth: usize) -> bool {
        match head.relations.last().map(|clause| clause.relation) {
            Some(relation) => self.relation(head, relation, true, depth),
            None => false,
        }
    }

    /// "used for keeping books": the words up to the end of the clause, or to an "and" before another modifier.
    fn purpose(&mut self, head: &mut Referring, negated: bool) -> bool {
        let ends = |at: usize| match self.mark_at(at) {
            None | Some(Mark::Comma | Mark::Stop | Mark::Then) => true,
            Some(Mark::And) => {
                let next = self.mark_at(at + 1);
                matches!(next, Some(Mark::Relation(_) | Mark::In | Mark::With | Mark::Without | Mark::For | Mark::Not))
            }
            Some(_) => false,
        };
        let count = (0..).find(|at| ends(*at)).unwrap_or(0);
        let words: Vec<&str> = self.tokens[self.at..self.at + count].iter().map(|token| token.text.as_str()).collect();
        self.at += count;
        if !words.is_empty() {
            head.attributes.push(Attribute { kind: AttributeKind::Function, word: words.join(" "), negated });
        }
        !words.is_empty()
    }

    /// "the dining table group" after "in": its noun, without the last word.
    fn group(&mut self, depth: usize) -> Option<Referring> {
        let rest = &self.tokens[self.at..];
        let opening = rest.iter().take_while(|token| token.mark == Mark::Determiner).count();
        let words = rest[opening..].iter().take_while(|token| token.mark == Mark::Word).count();
        let end = opening + words;
        if words < 2 || rest[end - 1].text != "group" {
            return None;
        }
        let mut inner = Parser::new(&rest[..end - 1], self.known);
        let support = inner.noun_phrase(depth + 1).filter(|support| !support.class.text.is_empty())?;
        self.at += end;
        Some(support)
    }

    /// "in the kitchen", "in room 3", "in the box", "in the dining table group".
    fn inside(&mut self, head: &mut Referring, negated: bool, depth: usize) -> bool {
        if let Some(support) = self.group(depth) {
            let relation = SpatialRelation::InGroup;
            head.relations.push(RelationClause { relation, anchors: vec![support], negated });
            return true;
        }
        let Some(anchor) = self.noun_phrase(depth + 1) else {
            return false;
        };
        if anchor.class.text.is_empty() {
            head.superlatives.extend(anchor.superlatives.iter().copied()); // "in the far corner of the room"
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
            } else if let Some(side) = side_of_room(relation).filter(|_| !negated && names_no_room(&first)) {
                head.superlatives.push(side);
            } else if let Some(room) = first.room {
                if negated {
                    head.excluded_rooms.push(room);
                } else {
                    head.room.get_or_insert(room);
                }
            }
            return true;
        }
        let mut first = first;
        if first.class.text == "one" && !(first.attributes.is_empty() && first.superlatives.is_empty()) {
            first.class = head.class.clone(); // "the black chair next to the red one"
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
                    // Which side of the other thing the head is on, nobody says: it is near.
                    SpatialRelation::InFrontOf | SpatialRelation::Behind => SpatialRelation::Near,
                    SpatialRelation::LeftOf => SpatialRelation::RightOf,
                    SpatialRelation::RightOf => SpatialRelation::LeftOf,
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
        // "with nothing on it", "without anything on top"
        let is_nothing = matches!(anchor.class.text.as_str(), "nothing" | "none");
        let is_anything =
            negated && matches!(anchor.class.text.as_str(), "anything" | "thing" | "something" | "object" | "item");
        if is_nothing || is_anything {
            let on_it = matches!(relation, SpatialRelation::Supporting | SpatialRelation::Containing);
            let relation = if on_it { relation } else { SpatialRelation::Supporting };
            anchor.class = Class::new("thing");
            head.relations.push(RelationClause { relation, anchors: vec![anchor], negated: true });
            return true;
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
}

/// "on the left side of the room" is on the left.
fn side_of_room(relation: SpatialRelation) -> Option<Superlative> {
    Some(match relation {
        SpatialRelation::LeftOf => Superlative::Leftmost,
        SpatialRelation::RightOf => Superlative::Rightmost,
        SpatialRelation::Between => Superlative::Middle,
        SpatialRelation::Behind => Superlative::Backmost,
        SpatialRelation::InFrontOf => Superlative::Frontmost,
        _ => return None,
    })
}

/// "the room", neither by name nor by kind nor by what is in it.
fn names_no_room(reference: &Referring) -> bool {
    reference.room.as_ref().is_some_and(|room| room.name.is_empty() && room.kind.is_none() && room.contains.is_empty())
}
