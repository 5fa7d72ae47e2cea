//! Colours, materials, purposes and other words of one thing against those of an expression.

use crate::instruction::AttributeKind;
use crate::scene::Thing;
use crate::vocabulary::{color_rgb, material};

/// In [0, 1]; 0.5 for what is not known. Sizes are judged among the candidates, see [`crate::extremes`].
pub(crate) fn attribute_score(kind: AttributeKind, word: &str, negated: bool, thing: &Thing) -> f64 {
    /// What is not known about a thing.
    const UNKNOWN: f64 = 0.5;
    let score = match kind {
        AttributeKind::Color => color_score(word, thing).unwrap_or(UNKNOWN),
        AttributeKind::Material => {
            let mut said = thing.words.split(' ').filter_map(material).peekable();
            match said.peek() {
                None => UNKNOWN,
                Some(_) => {
                    if said.any(|name| name == word) {
                        0.97
                    } else {
                        0.2
                    }
                }
            }
        }
        AttributeKind::Function => function_score(word, thing),
        AttributeKind::Size(_) => return 1.0, // among the candidates, see `extremes`
        AttributeKind::Other => {
            let said =
                thing.words.split(' ').any(|other| other == word) || thing.words.contains(word) && word.contains(' ');
            if said { 0.97 } else { 0.6 }
        }
    };
    if negated { 1.02 - score.max(0.02) } else { score }
}

/// The share of the said words that are in the known purpose; where none is known, in what else is said about the thing.
fn function_score(said: &str, thing: &Thing) -> f64 {
    const UNKNOWN: f64 = 0.5;
    const EMPTY_WORDS: [&str; 12] = ["a", "an", "the", "of", "at", "in", "on", "and", "for", "to", "with", "from"];
    let words = said.split(' ').filter(|word| !EMPTY_WORDS.contains(word));
    let known = thing.function.as_deref().unwrap_or(&thing.words);
    let (mut all, mut found) = (0.0_f64, 0.0);
    for word in words {
        all += 1.0;
        found += f64::from(u8::from(known.split(' ').any(|other| other == word)));
    }
    let share = if all > 0.0 { found / all } else { 0.0 };
    match thing.function {
        Some(_) => 0.2 + 0.77 * share,
        None if all > 0.0 && share == 1.0 => 0.9,
        None => UNKNOWN,
    }
}

/// Colour by name where a name is known, else by the mean colour; both where both are known.
fn color_score(word: &str, thing: &Thing) -> Option<f64> {
    let wanted = color_rgb(word)?;
    // Captions open with the thing itself; later words are about its surroundings.
    let in_caption = || thing.words.split(' ').take(8).find(|said| color_rgb(said).is_some());
    let named = thing.color_name.as_deref().filter(|name| color_rgb(name).is_some()).or_else(in_caption).map(|name| {
        let is_grey = |word: &str| matches!(word, "gray" | "grey");
        if name == word || (is_grey(name) && is_grey(word)) {
            1.0
        } else {
            let rgb = color_rgb(name).expect("filtered above");
            0.4 * color_closeness(&wanted, &rgb)
        }
    });
    let measured = thing.color.map(|rgb| color_closeness(&wanted, &rgb));
    match (named, measured) {
        // A word about the thing says more than the mean of its pixels: the dark door of a grey microwave makes no black one.
        (Some(named), Some(measured)) => Some(0.8 * named + 0.2 * measured),
        (named, measured) => named.or(measured),
    }
}

/// 1 for equal colours, 0.5 at a distance of about 60 in a space of lightness (counted half, it follows the lamp) and two opponent axes.
fn color_closeness(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    let opponent = |c: &[f64; 3]| [0.5 * (c[0] + c[1] + c[2]) / 3.0, c[0] - c[1], 0.5 * (c[0] + c[1]) - c[2]];
    let (a, b) = (opponent(a), opponent(b));
    let distance = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt();
    1.0 / (1.0 + (distance / 60.0).powi(2))
}
