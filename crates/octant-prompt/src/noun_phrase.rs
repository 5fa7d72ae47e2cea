//! Noun phrases: determiners, superlatives, adjectives, the class itself, and rooms named in its place.

use crate::instruction::{Attribute, AttributeKind, Referring, RoomReference, SpatialRelation, Superlative};
use crate::lexicon::{Mark, Token};
use crate::parser::{MAX_DEPTH, Parser};
use crate::vocabulary::{Class, canonical, color_rgb, material, room_kind, singular_phrase};

impl Parser<'_> {
    pub(crate) fn noun_phrase(&mut self, depth: usize) -> Option<Referring> {
        if depth > MAX_DEPTH {
            return None;
        }
        let mut out = Referring::default();
        let mut has_noun = false;
        loop {
            match self.mark() {
                Some(Mark::Determiner | Mark::Pronoun | Mark::Copula) => {
                    out.is_any |= leaves_it_open(&self.tokens[self.at].text);
                    self.at += 1;
                }
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
                        out.class.is_plural &= is_part;
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
                        // "one of the chairs" is any, "the black one of the chairs" is not.
                        let before = self.at.checked_sub(2).map(|before| self.tokens[before].mark);
                        out.is_any = !matches!(before, Some(Mark::Determiner | Mark::Word));
                        self.at += 1;
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
                    if self.mark_at(count) == Some(Mark::One) && !self.is_known(&singular_phrase(&words.join(" "))) {
                        out.attributes.extend(words.iter().map(|word| any_adjective(word)));
                        self.at += count;
                        continue; // "the round one"
                    }
                    if self.adjectives(&words, &mut out) {
                        continue; // "the white small door"
                    }
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

    /// Colours and materials before a further adjective: takes them and what joins them, if a noun can still follow.
    fn adjectives(&mut self, words: &[&str], out: &mut Referring) -> bool {
        let Some(found) = words.iter().map(|word| adjective(word)).collect::<Option<Vec<_>>>() else { return false };
        let mut next = words.len();
        while matches!(self.mark_at(next), Some(Mark::And | Mark::Comma)) {
            next += 1;
        }
        let joined = next > words.len();
        let goes_on = match self.mark_at(next) {
            Some(Mark::Size(_) | Mark::One) => true,
            Some(Mark::Superlative(_) | Mark::Ordinal(_)) => !joined,
            Some(Mark::Word) => joined && adjective(&self.tokens[self.at + next].text).is_some(),
            _ => false,
        };
        if goes_on {
            out.attributes.extend(found);
            self.at += next;
        }
        goes_on
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
            out.class = Class::new(&words.join(" "));
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
                        out.attributes.push(any_adjective(word));
                    }
                }
                out.class = Class::new(&words[from..].join(" "));
            }
            None => out.class = self.class_within(words),
        }
    }

    /// The class in words of which no ending is known. Where all classes of the scene are known, the last of them that occurs; the
    /// words after it are no part of its name ("the monitor skewed").
    fn class_within(&self, words: &[&str]) -> Class {
        if !self.known.is_empty() {
            for end in (1..words.len()).rev() {
                for start in 0..end {
                    let phrase = singular_phrase(&words[start..end].join(" "));
                    if self.is_known(&phrase) {
                        return Class::new(&words[start..end].join(" "));
                    }
                }
            }
        }
        Class::new(&words.join(" "))
    }
}

/// Articles that leave it open which one is meant.
fn leaves_it_open(article: &str) -> bool {
    matches!(article, "a" | "an" | "any" | "some" | "another" | "either")
}

/// Colour or material word as an attribute.
pub(crate) fn adjective(word: &str) -> Option<Attribute> {
    let kind_and_word = if color_rgb(word).is_some() {
        (AttributeKind::Color, word.to_string())
    } else if let Some(canonical) = material(word) {
        (AttributeKind::Material, canonical.to_string())
    } else {
        return None;
    };
    Some(Attribute { kind: kind_and_word.0, word: kind_and_word.1, negated: false })
}

/// The same, any other word as it is.
fn any_adjective(word: &str) -> Attribute {
    let other = || Attribute { kind: AttributeKind::Other, word: word.to_string(), negated: false };
    adjective(word).unwrap_or_else(other)
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

pub(crate) fn room_follows(rest: &[Token]) -> bool {
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
        "roll",
        "portion",
        "section",
        "middle",
        "center",
        "top",
        "bottom",
    ];
    PARTS.contains(&class.head())
}
