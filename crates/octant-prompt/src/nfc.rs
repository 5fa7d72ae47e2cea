//! Normalisation form C of Unicode: marks joined with their letters where there is one character for both. Tokenizers ask for it before
//! they split.
//!
//! ```text
//! decompose each character -> sort marks by combining class -> join each with the last starter, unless something blocks it
//! ```
//! Unicode Standard Annex 15, with the tables of [`crate::nfc_tables`]; Hangul by arithmetic.

use std::borrow::Cow;
use std::sync::LazyLock;

use rustc_hash::FxHashMap;

use crate::nfc_tables::{COMBINING, DECOMPOSITIONS, NEVER_COMPOSED};

/// Below this nothing changes: there are no marks, and what is composed stays so.
const FIRST_MARK: char = '\u{300}';

/// The text in form C.
pub(crate) fn nfc(text: &str) -> Cow<'_, str> {
    if text.is_ascii() || text.chars().all(|c| c < FIRST_MARK) {
        return Cow::Borrowed(text);
    }
    let mut parts: Vec<(char, u8)> = Vec::with_capacity(text.len());
    text.chars().for_each(|c| decompose(c, &mut parts));
    for run in parts.chunk_by_mut(|_, next| next.1 != 0) {
        // The first of a run may be a starter; it stays first, for its class is 0.
        run.sort_by_key(|(_, class)| *class);
    }
    Cow::Owned(compose(&parts))
}

fn decompose(c: char, out: &mut Vec<(char, u8)>) {
    let code = u32::from(c);
    let of = |code: u32| char::from_u32(code).expect("the tables hold characters");
    if let Some(index) = code.checked_sub(S_BASE).filter(|index| *index < S_COUNT) {
        out.push((of(L_BASE + index / (V_COUNT * T_COUNT)), 0));
        out.push((of(V_BASE + index % (V_COUNT * T_COUNT) / T_COUNT), 0));
        if index % T_COUNT > 0 {
            out.push((of(T_BASE + index % T_COUNT), 0));
        }
        return;
    }
    match DECOMPOSITIONS.binary_search_by_key(&code, |(whole, ..)| *whole) {
        Ok(at) => {
            let (_, first, second) = DECOMPOSITIONS[at];
            decompose(of(first), out); // at most four deep
            if second != 0 {
                decompose(of(second), out);
            }
        }
        Err(_) => out.push((c, class(code))),
    }
}

fn class(code: u32) -> u8 {
    let at = COMBINING.partition_point(|(_, last, _)| *last < code);
    COMBINING.get(at).filter(|(first, ..)| *first <= code).map_or(0, |(.., class)| *class)
}

fn compose(parts: &[(char, u8)]) -> String {
    let mut out: Vec<char> = Vec::with_capacity(parts.len());
    let mut starter: Option<usize> = None;
    let mut last_class = 0;
    for (c, class) in parts {
        // A mark is blocked by one of its class or a higher one between it and the starter; a starter by anything between.
        let joined =
            starter.filter(|at| *at + 1 == out.len() || (last_class != 0 && last_class < *class)).and_then(|at| {
                let whole = pair(out[at], *c)?;
                Some((at, whole))
            });
        match joined {
            Some((at, whole)) => out[at] = whole,
            None => {
                if *class == 0 {
                    starter = Some(out.len());
                }
                last_class = *class;
                out.push(*c);
            }
        }
    }
    out.into_iter().collect()
}

/// The character of two.
fn pair(first: char, second: char) -> Option<char> {
    static WHOLES: LazyLock<FxHashMap<(u32, u32), u32>> = LazyLock::new(|| {
        let pairs = DECOMPOSITIONS
            .iter()
            .filter(|(whole, _, second)| *second != 0 && NEVER_COMPOSED.binary_search(whole).is_err());
        pairs.map(|(whole, first, second)| ((*first, *second), *whole)).collect()
    });
    let (a, b) = (u32::from(first), u32::from(second));
    let hangul = match (a.checked_sub(L_BASE), b.checked_sub(V_BASE)) {
        (Some(l), Some(v)) if l < L_COUNT && v < V_COUNT => Some(S_BASE + (l * V_COUNT + v) * T_COUNT),
        _ => match (a.checked_sub(S_BASE), b.checked_sub(T_BASE)) {
            (Some(s), Some(t)) if s < S_COUNT && s % T_COUNT == 0 && (1..T_COUNT).contains(&t) => Some(a + t),
            _ => None,
        },
    };
    hangul.or_else(|| WHOLES.get(&(a, b)).copied()).and_then(char::from_u32)
}

/// Hangul syllables: leading consonants, vowels, trailing consonants (Unicode, section 3.12).
const S_BASE: u32 = 0xac00;
const L_BASE: u32 = 0x1100;
const V_BASE: u32 = 0x1161;
const T_BASE: u32 = 0x11a7;
const L_COUNT: u32 = 19;
const V_COUNT: u32 = 21;
const T_COUNT: u32 = 28;
const S_COUNT: u32 = L_COUNT * V_COUNT * T_COUNT;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn by_hand() {
        assert_eq!(nfc("cafe\u{301} au lait"), "caf\u{e9} au lait");
        assert_eq!(nfc("q\u{307}\u{323}"), "q\u{323}\u{307}", "marks by class, below before above");
        assert_eq!(nfc("\u{1112}\u{1161}\u{11ab}"), "\u{d55c}");
        assert_eq!(nfc("\u{212b}"), "\u{c5}");
        assert_eq!(nfc("\u{958}"), "\u{915}\u{93c}", "excluded from composition");
        assert!(matches!(nfc("plain, na\u{ef}ve"), Cow::Borrowed(_)));
    }

    #[test]
    fn three_hundred_strings_as_another_implementation_has_them() {
        let cases: Vec<(String, String)> = serde_json::from_str(include_str!("../tests/data/nfc.json")).expect("pairs");
        for (text, expected) in cases {
            assert_eq!(nfc(&text), expected, "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn twice_is_once(text in "[\\PCa\u{301}\u{323}\u{1100}-\u{11ff}]{0,40}") {
            let once = nfc(&text).into_owned();
            prop_assert_eq!(nfc(&once).into_owned(), once);
        }
    }
}
