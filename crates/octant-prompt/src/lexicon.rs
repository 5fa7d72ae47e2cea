//! Words of the instruction language: from text to a short list of tokens with a grammatical mark each.
//!
//! Longest phrase first, so "on top of" is one relation and "on the left side of" is another. Words that no table knows stay words: they
//! are the nouns and adjectives.

use std::collections::HashMap;
use std::sync::LazyLock;

use crate::home_phrase::way_home_words;
use crate::instruction::{Floor, SpatialRelation as R, Superlative as S, ViewKind};
use crate::vocabulary::singular_phrase;

/// Longest text that is read; the rest is ignored.
pub const MAX_TEXT_BYTES: usize = 2_000;
/// Most tokens that are read.
const MAX_TOKENS: usize = 256;
/// Longest class name in words.
const MAX_CLASS_WORDS: usize = 4;

/// The part a token plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A relation phrase.
    Relation(R),
    /// `in`, `inside`: room or container.
    In,
    /// `with`, `has`.
    With,
    /// `without`.
    Without,
    /// `used for`: a purpose follows.
    For,
    /// `not`, `except`.
    Not,
    /// `and`.
    And,
    /// Ends a step.
    Then,
    /// `the`, `a`, `some`, `this`.
    Determiner,
    /// `that`, `which`, `it`, `there`.
    Pronoun,
    /// `is`, `located`, `standing`.
    Copula,
    /// `of`.
    Of,
    /// `from` (of an order: "second from the left").
    From,
    /// `one` as a noun.
    One,
    /// `find`, `go to`.
    Verb,
    /// `enter`: a verb whose object is a room.
    Enter,
    /// `when`, `if`: a view clause follows.
    When,
    /// A view phrase.
    View(ViewKind),
    /// A superlative or its adverbial form ("on the left").
    Superlative(S),
    /// A soft size adjective.
    Size(S),
    /// `first` is 1, `last` is `u32::MAX`.
    Ordinal(u32),
    /// A storey.
    Floor(Floor),
    /// Comma.
    Comma,
    /// Sentence end or semicolon.
    Stop,
    /// Anything else: part of a noun phrase.
    Word,
}

/// A token: its mark and its text (normalised).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Token {
    /// What it does.
    pub mark: Mark,
    /// Its words.
    pub text: String,
}

/// Reads a text. Bounded; never fails. `is_class` tells whether a (singular) phrase is the name of a class: such a phrase of several words
/// is one word here, even if it holds a word of the grammar (`trash can`, `chest of drawers`).
pub fn tokens(text: &str, is_class: &dyn Fn(&str) -> bool) -> Vec<Token> {
    tokens_of(&words(text), is_class)
}

/// The same for words that were read before.
pub(crate) fn tokens_of(words: &[String], is_class: &dyn Fn(&str) -> bool) -> Vec<Token> {
    let mut out = Vec::new();
    let mut at = 0;
    while at < words.len() && out.len() < MAX_TOKENS {
        let phrase = |count: usize| words[at..at + count].join(" ");
        let most = PHRASE_WORDS.get(words[at].as_str()).copied().unwrap_or(0).max(MAX_CLASS_WORDS);
        let longest = (1..=most.min(words.len() - at)).rev().find_map(|count| {
            let text = phrase(count);
            if (2..=MAX_CLASS_WORDS).contains(&count) && is_class(&singular_phrase(&text)) {
                return Some((count, Some(Mark::Word), text));
            }
            PHRASES.get(text.as_str()).map(|mark| (count, *mark, text))
        });
        let (count, mark, text) =
            longest.unwrap_or_else(|| (1, mark_of_punctuation_or_word(&words[at]), words[at].clone()));
        at += count;
        match mark {
            None => {} // a filler such as "please"
            Some(mark) => out.push(Token { mark, text }),
        }
    }
    out
}

fn mark_of_punctuation_or_word(word: &str) -> Option<Mark> {
    Some(match word {
        "," => Mark::Comma,
        "." => Mark::Stop,
        _ => numeral_ordinal(word).map_or(Mark::Word, Mark::Ordinal),
    })
}

/// `21st` is 21.
fn numeral_ordinal(word: &str) -> Option<u32> {
    let digits = ["st", "nd", "rd", "th"].iter().find_map(|ending| word.strip_suffix(ending))?;
    let is_number = (1..=4).contains(&digits.len()) && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten().filter(|n| *n > 0)
}

/// Lower-case words and the marks `,` and `.`.
pub(crate) fn words(text: &str) -> Vec<String> {
    let mut end = text.len().min(MAX_TEXT_BYTES);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let mut words: Vec<String> = Vec::new();
    let mut word = String::new();
    for c in text[..end].chars().chain(std::iter::once(' ')) {
        match c {
            c if c.is_alphanumeric() => word.extend(c.to_lowercase()),
            '\'' | '\u{2019}' => {} // it's -> its, don't -> dont
            _ => {
                if !word.is_empty() && !ADVERBS.contains(&word.as_str()) {
                    words.push(std::mem::take(&mut word));
                }
                word.clear();
                match c {
                    ',' | '(' | ')' | ':' => words.push(",".into()),
                    '.' | ';' | '!' | '?' | '\n' => words.push(".".into()),
                    _ => {}
                }
            }
        }
    }
    words
}

/// Phrase -> mark; `None` marks fillers that are dropped.
static PHRASES: LazyLock<HashMap<&'static str, Option<Mark>>> = LazyLock::new(|| {
    let words = |line: &'static str| line.split(',').map(str::trim);
    let mut map: HashMap<&'static str, Option<Mark>> = words(FILLERS).map(|filler| (filler, None)).collect();
    for (mark, phrases) in ROWS {
        map.extend(words(phrases).map(|phrase| (phrase, Some(*mark))));
    }
    map
});

/// All phrases of the grammar.
pub(crate) fn phrases() -> impl Iterator<Item = &'static str> {
    let lines = ROWS.iter().map(|(_, phrases)| *phrases).chain([FILLERS]);
    lines.flat_map(|line| line.split(',')).map(str::trim).chain(ADVERBS.iter().copied()).chain(way_home_words())
}

/// Words of the longest phrase that begins with a word.
static PHRASE_WORDS: LazyLock<HashMap<&'static str, usize>> = LazyLock::new(|| {
    let mut map: HashMap<&'static str, usize> = HashMap::new();
    for phrase in ROWS.iter().map(|(_, phrases)| phrases).chain([&FILLERS]).flat_map(|line| line.split(',')) {
        let count = phrase.trim().split(' ').count();
        let first = phrase.trim().split(' ').next().unwrap_or_default();
        let longest = map.entry(first).or_default();
        *longest = count.max(*longest);
    }
    map
});

/// Adverbs that stand inside phrases ("directly across from") and change none of them.
const ADVERBS: &[&str] = &[
    "very",
    "really",
    "also",
    "actually",
    "exactly",
    "slightly",
    "almost",
    "partially",
    "partly",
    "completely",
    "fully",
    "nearly",
    "directly",
    "immediately",
    "just",
    "basically",
    "somewhat",
    "clearly",
    "simply",
    "probably",
    "mostly",
    "diagonally",
];

/// Words that say nothing about what is meant.
const FILLERS: &str = "pls, plz, be possible, be possible to, would it be possible to, is it possible to, it possible to, be so kind as to, be so kind and, be so kind to, so kind as to, be kind enough to, kind enough to, be so good as to, \
    would you mind, do you mind, if you please, if you would, if you could, if possible, right away, thanks, thank you, in advance, ok, okay, well, oh, um, uh, excuse me, sorry, dear, buddy, mate, for me, with me, for us, today, quick, asap, real quick, good morning, good evening, \
    i think, i guess, i believe, i suppose, maybe, perhaps, somewhere around here, around here, over there, that would be nice, would be nice, correct, much, specific, particular, particularly, please, hey, robot, kindly, now, quickly, slowly, me, \
    carefully, hello, hi, so, but, currently, kind of, sort of, would, could, can, will, should, must, do, does, for, only, two, three, four, five, six, seven, eight, nine, ten, several, few, many, multiple, more, most, \
    from the side you sit on it, from the side you sit on, tucked, tucked away, pushed, lined up, pushed in, set up, turned, \
    pair of, set of, row of, stack of, pile of, group of, couple of";

/// The phrases of each mark. A phrase that stands twice has the mark of its last row.
#[rustfmt::skip]
const ROWS: &[(Mark, &str)] = &[
    (Mark::Relation(R::Near), "near, near to, next to, right next to, nearby to, beside, besides, by, right by, close to, adjacent to, \
        alongside, along, at, around, touching, at the side, at the foot of, at the base of, at the edge of, on the edge of, on the same side as, along with, against, leaning against, leaning on, up against, attached to, \
        connected to, near by, in the vicinity of, not far from, on the side of, to the side of, at the side of, \
        off of, pushed up to, tucked into, standing by, sitting at, sitting by, standing next to, closer to, \
        nearer to, nearer"),
    (Mark::Relation(R::Far), "far from, far away from, away from, not near, not close to, not next to"),
    (Mark::Relation(R::Closest), "closest to, nearest to, the closest to, the nearest to, most close to, closest"),
    (Mark::Relation(R::Farthest), "farthest from, furthest from, farthest away from, furthest away from, most distant from, the farthest \
        from, the furthest from, farthest to, furthest to, farther from, further from, farther away from, further away from, \
        farthest away, furthest away"),
    (Mark::Relation(R::On), "on, on top of, atop, upon, onto, resting on, lying on, laying on, sitting on, standing on, placed on, \
        hanging on, mounted on, sitting on top of, on the top of, hanging from"),
    (Mark::Relation(R::Under), "under, underneath, beneath, below, right below, right under, lower than, \
        at the bottom of"),
    (Mark::Relation(R::Above), "above, over, right above, hanging over, hanging above, higher than, at \
        the top of"),
    (Mark::Relation(R::LeftOf), "left of, to the left of, on the left of, on the left side of, at the left of, left side of, to the left \
        side of, on left side of, on the left hand side of, to left of, on left of, at the left side of, on its \
        left"),
    (Mark::Relation(R::RightOf), "right of, to the right of, on the right of, on the right side of, at the right of, right side of, to the \
        right side of, on right side of, on the right hand side of, to right of, on right of, at the right side \
        of"),
    (Mark::Relation(R::InFrontOf), "on the front of, on the front side of, in front of, infront of, front of, at the front of, in the front \
        of, right in front of, ahead of, to the front of"),
    (Mark::Relation(R::Behind), "on the back of, on the back side of, behind, in back of, at the back of, right behind, \
        to the rear of, in the back of, back of, at the rear of, in the rear of"),
    (Mark::Relation(R::Between), "in the middle of, in the center of, in the centre of, between, in between, in the middle of the two, \
        sandwiched between, in the middle between, inbetween, located between"),
    (Mark::Relation(R::Opposite), "opposite, opposite of, opposite to, across from, on the opposite side of, on the other side of, across, \
        opposite from"),
    (Mark::Relation(R::AtEnd), "at the end of, on the end of, at the head of, at the far end of, at one end of, at the short end of, on the short \
        side of, at the other end of"),
    (Mark::In, "in, inside, within, inside of, into, in the inside of"),
    (Mark::With, "with, has, have, having, holding, that has, which has, containing, supporting, carrying, featuring"),
    (Mark::Without, "without, with no, that has no, that does not have, that doesnt have, has no, lacking, that dont have, does not have, doesnt have, do not have, without any, not having, no"),
    (Mark::For, "used for, is used for, meant for, intended for, made for, serves for, suitable for, people use for, whose purpose is, that is for"),
    (Mark::Relation(R::InGroup), "in the group of, part of the group of, of the group of, in the same group as, in a group with, belonging to, belongs to, grouped with"),
    (Mark::Not, "not, isnt, arent, is not, are not, but not, except, other than, rather than, never, excluding, thats \
        not, not the one"),
    (Mark::And, "and, as well as, plus"),
    (Mark::Then, "then, and then, after that, afterwards, after this, and after that, next, followed by, before you, \
        finally, and finally, subsequently, once there, from there, when you are there, secondly"),
    (Mark::Determiner, "the, a, an, some, this, these, those, any, its, their, my, your, our, another, other, each, every, both, \
        either, all, his, her"),
    (Mark::Pronoun, "that, which, who, it, there, they, that there, you, we, i, whose, what, where, youre, u, you want, you are \
        looking for, we want, you need"),
    (Mark::Copula, "is, are, was, be, were, thats, its the, located, placed, situated, positioned, standing, sitting, lying, \
        laying, resting, found, hanging, stands, sits, lies, being, can be found, set, mounted, kept, theres, seen, stored, placed right, leaning, am, you see, appears, seems, looks"),
    (Mark::Of, "of, out of"),
    (Mark::From, "from, starting from, counting from, when counted from, through, via, to, toward, towards"),
    (Mark::One, "one, ones"),
    (Mark::Verb, "find, go, go to, go near, go towards, go toward, go over to, go up to, go back to, go and find, \
        approach, locate, look for, search for, search, get to, get, navigate to, navigate, walk to, walk over \
        to, walk towards, drive to, drive, move to, move towards, move near, head to, head for, head towards, \
        head over to, fly to, fly over to, fly towards, bring me to, take me to, lead me to, guide me to, show \
        me, visit, reach, stop at, stop near, stop next to, stop beside, stop by, stop in front of, fetch, bring \
        me, bring, inspect, check, check on, look at, come to, travel to, proceed to, run to, choose, select, \
        pick, pick out, identify, point to, point at, i want, i need, we need, want, where is, where are, \
        wheres, where s, where do i find, where can i find, where could i find, where will i find, where can one find, i left, i forgot, i lost, \
        i dropped, i misplaced, we left, have you seen, did you see, do you see, tell me where, show me where, show us, give me, hand me, \
        get me, get me to, deliver me to, drive me to, walk me to, fly me to, carry me to, escort me to, direct me to, point me to, \
        help me find, i am looking for, im looking for, we are looking for, i would like, id like, i would like to see, id like to see, \
        i want to see, i need to see, i want to go to, i need to go to, i want to get to, i need to get to, i have to go to, i have to get to, \
        i would like to go to, id like to go to, find me, find us, drive up to, walk up to, \
        run over to, make your way to, bring the robot to, bring the robot, bring us to, take us to, lead us to, drive over to, drive yourself to, \
        put yourself, place yourself, position yourself, station yourself, place yourself at, park at, park near, wait at, you are looking for, youre looking for, click, click on, go find, can you find, can you go to, could you find, \
        return to, return, come back, come back to, go back, head back, head back to, fly back, fly back to, walk back, walk \
        back to, drive back, drive back to, get back, get back to, continue to, look, hunt for, seek, discover, spot, stop"),
    (Mark::Enter, "enter, go into, go in, walk into, move into, drive into, fly into, step into, head into, go inside, get \
        into"),
    (Mark::When, "when, if, while, as, once, upon, assuming, when you are, if you are, if youre, when youre, if you were, \
        while you are, as you, if you, when you, while, as if you are, from the perspective of someone, if one \
        is, when one is"),
    (Mark::View(ViewKind::Facing), "look toward, look towards, you look at, you look toward, you look towards, stand facing, standing \
        facing, you face, you are facing, you are looking at, facing, looking at, looking toward, looking \
        towards, face, facing towards, facing toward, looking to, looking in the direction of, looking, staring at, looking straight at, look at, look straight at, view from the \
        front of, looking from the front of"),
    (Mark::View(ViewKind::BackTo), "with your back to, with your back against, with your back towards, with back to, with the back to, back \
        to, your back to, your back is to, your back to the, with your back facing, with its back to, with its back against, having its back to, with the back against"),
    (Mark::View(ViewKind::From), "entering, entering from, entering through, you enter, walking in, walk in, walk in from, walking into, \
        standing at, standing in, standing by, coming in, coming in from, come in, looking from, viewed from, \
        seen from, enter the room, standing in front of, stand at, stand in, stand by, sitting in, you walk in, \
        walking in from, walk through, walking through, coming through, coming from, come from, walk in through, walking in through, coming in through, enter through, enter from, you enter through, you enter from, you walk through, standing near"),
    (Mark::Superlative(S::Nearest), "nearest, closest one, nearest one, closest by"),
    (Mark::Superlative(S::Farthest), "farthest, furthest, most distant, farthest away, furthest away, far"),
    (Mark::Superlative(S::Largest), "largest, biggest, larger, bigger, greatest"),
    (Mark::Superlative(S::Smallest), "smallest, littlest, tiniest, smaller"),
    (Mark::Superlative(S::Tallest), "tallest, taller"),
    (Mark::Superlative(S::Shortest), "shortest, shorter"),
    (Mark::Superlative(S::Longest), "longest, longer"),
    (Mark::Superlative(S::Widest), "widest, wider, broadest"),
    (Mark::Superlative(S::Narrowest), "narrowest, thinnest, thinner, narrower, skinnier"),
    (Mark::Superlative(S::Highest), "highest, topmost, uppermost, upper, higher, top, at the top, on the top, on top, on its top, higher up"),
    (Mark::Superlative(S::Lowest), "lowest, bottommost, lower, bottom, at the bottom, on the bottom"),
    (Mark::Superlative(S::Leftmost), "leftmost, left most, left, on the left, to the left, on the left side, at the left, on your left, to \
        your left, far left, on the far left, on the left hand side, left hand, on left, the left side, on the \
        left most side, left side, left one, furthest left, farthest left, furthest to the left, farthest to the \
        left, all the way to the left, on the left wall, lefthand, on the lefthand side, left handed, to the far left, at the far left, the left most, left hand side"),
    (Mark::Superlative(S::Rightmost), "rightmost, right most, right, on the right, to the right, on the right side, at the right, on your \
        right, to your right, far right, on the far right, on the right hand side, right hand, on right, the \
        right side, right side, right one, furthest right, farthest right, furthest to the right, farthest to \
        the right, all the way to the right, on the right wall, righthand, on the righthand side, right handed, to the far right, at the far right, the right most, right hand side"),
    (Mark::Superlative(S::Frontmost), "frontmost, front most, in front, in the front, at the front, up front"),
    (Mark::Superlative(S::Backmost), "backmost, back most, at the back, in the back, rearmost, in back, back"),
    (Mark::Superlative(S::Middle), "middle, in the middle, in the middle of the room, in the center, in the centre, center, centre, central, \
        in the center of the room, in the centre of the room, middlemost"),
    (Mark::Superlative(S::Corner), "in the corner, in a corner, in the corner of the room, in the corner of, at the corner, corner, in the far corner, in the far corner of the room, far corner, \
        in the back corner"),
    (Mark::Superlative(S::Alone), "alone, by itself, all by itself, on its own, by themselves, all alone, standing alone, off by itself, \
        sitting alone, isolated, separate, separated from the others, standing by itself, sitting by itself, \
        stands alone, sits alone, away from the others"),
    (Mark::Size(S::Alone), "single, lone, lonely, sole, solo, solitary"),
    (Mark::Size(S::Largest), "large, big, huge, great"),
    (Mark::Size(S::Smallest), "small, little, tiny, compact"),
    (Mark::Size(S::Tallest), "tall"),
    (Mark::Size(S::Shortest), "short"),
    (Mark::Size(S::Longest), "long"),
    (Mark::Size(S::Widest), "wide, broad"),
    (Mark::Size(S::Narrowest), "narrow, thin, skinny, slim"),
    (Mark::Size(S::Highest), "high"),
    (Mark::Size(S::Lowest), "low"),
    (Mark::Ordinal(1), "first"),
    (Mark::Ordinal(2), "second"),
    (Mark::Ordinal(3), "third"),
    (Mark::Ordinal(4), "fourth"),
    (Mark::Ordinal(5), "fifth"),
    (Mark::Ordinal(6), "sixth"),
    (Mark::Ordinal(7), "seventh"),
    (Mark::Ordinal(8), "eighth"),
    (Mark::Ordinal(9), "ninth"),
    (Mark::Ordinal(10), "tenth"),
    (Mark::Ordinal(11), "eleventh"),
    (Mark::Ordinal(12), "twelfth"),
    (Mark::Ordinal(u32::MAX), "last"),
    (Mark::Floor(Floor::Number(0)), "on the ground floor, on the first floor, ground floor, first floor"),
    (Mark::Floor(Floor::Number(1)), "on the second floor, second floor"),
    (Mark::Floor(Floor::Number(2)), "on the third floor, third floor"),
    (Mark::Floor(Floor::Relative(1)), "upstairs, on the upper floor, one floor up, the floor above, on the top floor"),
    (Mark::Floor(Floor::Relative(-1)), "downstairs, on the lower floor, one floor down, the floor below"),
];

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(text: &str) -> Vec<Mark> {
        tokens(text, &|phrase| phrase == "trash can").into_iter().map(|token| token.mark).collect()
    }

    #[test]
    fn the_longest_phrase_wins() {
        assert_eq!(marks("on the left side of the bed"), [Mark::Relation(R::LeftOf), Mark::Determiner, Mark::Word]);
        assert_eq!(marks("on the left"), [Mark::Superlative(S::Leftmost)]);
        assert_eq!(marks("on top of it"), [Mark::Relation(R::On), Mark::Pronoun]);
        assert_eq!(marks("the trash cans"), [Mark::Determiner, Mark::Word]);
        assert_eq!(marks("Please, find!"), [Mark::Comma, Mark::Verb, Mark::Stop]);
    }

    #[test]
    fn no_phrase_waits_for_a_word_that_is_dropped() {
        let phrases = ROWS.iter().map(|(_, phrases)| phrases).chain([&FILLERS]).flat_map(|line| line.split(','));
        for phrase in phrases {
            assert!(phrase.split_whitespace().all(|word| !ADVERBS.contains(&word)), "{phrase}");
        }
        assert_eq!(marks("directly across from"), [Mark::Relation(R::Opposite)]);
    }

    #[test]
    fn long_and_odd_text_is_bounded() {
        assert!(tokens(&"chair ".repeat(10_000), &|_| true).len() <= MAX_TOKENS);
        assert!(tokens("", &|_| false).is_empty());
        assert!(tokens(&"\u{1F600}\u{0301}'".repeat(1_000), &|_| false).is_empty());
    }
}
