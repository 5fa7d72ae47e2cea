//! The exact count of a model's own tokenizer: byte-level byte-pair encoding from a `tokenizer.json` (Hugging Face) that the user has.
//!
//! ```text
//! text -> added tokens as they stand -> form C, if the file asks for it -> pieces by the Qwen2 split -> bytes -> merges by rank -> ids
//! split: (?i:'s|'t|'re|'ve|'m|'ll|'d) | [^\r\n\p{L}\p{N}]?\p{L}+ | \p{N} | ?[^\s\p{L}\p{N}]+[\r\n]* | \s*[\r\n]+ | \s+(?!\S) | \s+
//! ```
//! Files with another split are refused rather than miscounted. The split is scanned by hand: it needs a look-ahead. A normalizer other than NFC is refused too.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::io::Read;

use rustc_hash::FxHashMap;
use serde::Deserialize;
use unicode_normalization::char::is_combining_mark;
use unicode_normalization::{IsNormalized, UnicodeNormalization, is_nfc_quick};

use crate::tokens::TokenCounter;

/// Largest file that is read: the biggest vocabularies in use take 20 MB.
const MAX_FILE_BYTES: u64 = 64 << 20;
/// The split of Qwen2, 2.5 and 3, as their files hold it.
const QWEN_SPLIT: &str =
    r"(?i:'s|'t|'re|'ve|'m|'ll|'d)|[^\r\n\p{L}\p{N}]?\p{L}+|\p{N}| ?[^\s\p{L}\p{N}]+[\r\n]*|\s*[\r\n]+|\s+(?!\S)|\s+";

/// A byte-level BPE vocabulary.
#[derive(Debug, Clone)]
pub struct BytePairs {
    /// Bytes of a token -> id.
    ids: FxHashMap<Box<[u8]>, u32>,
    /// (left, right) -> (rank, merged).
    merges: FxHashMap<(u32, u32), (u32, u32)>,
    /// Id of each single byte.
    bytes: [u32; 256],
    /// Tokens that are found in the text before it is split, longest first.
    added: Vec<(String, u32)>,
    /// Whether text is brought into form C.
    is_normalised: bool,
}

/// Why a `tokenizer.json` cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TokenizerError {
    /// The file cannot be read.
    #[error("cannot read the tokenizer: {0}")]
    Io(#[from] std::io::Error),
    /// More than 64 MB.
    #[error("the tokenizer is larger than 64 MB")]
    TooLarge,
    /// Not JSON, or a part is missing or of another type.
    #[error("not a tokenizer.json: {0}")]
    Json(String),
    /// Not byte-level BPE.
    #[error("model.type must be \"BPE\"")]
    NotBpe,
    /// The pre-tokenizer splits in another way than Qwen's.
    #[error("pre_tokenizer must split like Qwen2 and then work on bytes; another split would be counted wrongly")]
    Split,
    /// The file asks for a normalisation that is not known here.
    #[error("normalizer must be null or {{\"type\": \"NFC\"}}")]
    Normalizer,
    /// A token holds a character outside the alphabet of bytes.
    #[error("the token \"{0}\" of model.vocab is not written in byte-level characters")]
    Token(String),
    /// One of the 256 bytes has no token.
    #[error("model.vocab has no token for byte {0}")]
    Byte(u8),
    /// A merge joins something that is no token.
    #[error("merge {0} of model.merges joins or makes something that model.vocab does not hold")]
    Merge(usize),
}

#[derive(Deserialize)]
struct File {
    #[serde(default)]
    added_tokens: Vec<Added>,
    #[serde(default)]
    normalizer: serde_json::Value,
    pre_tokenizer: serde_json::Value,
    model: Model,
}

#[derive(Deserialize)]
struct Added {
    id: u32,
    content: String,
}

#[derive(Deserialize)]
struct Model {
    #[serde(rename = "type")]
    kind: String,
    vocab: BTreeMap<String, u32>,
    merges: Vec<Merge>,
}

/// `"a b"` in older files, `["a", "b"]` in newer ones.
#[derive(Deserialize)]
#[serde(untagged)]
enum Merge {
    Text(String),
    Pair([String; 2]),
}

impl BytePairs {
    /// Reads a `tokenizer.json`.
    ///
    /// # Errors
    /// Whatever is missing or of another kind; nothing is guessed.
    pub fn read(input: impl Read) -> Result<BytePairs, TokenizerError> {
        let mut text = Vec::new();
        input.take(MAX_FILE_BYTES + 1).read_to_end(&mut text)?;
        if text.len() as u64 > MAX_FILE_BYTES {
            return Err(TokenizerError::TooLarge);
        }
        let file: File = serde_json::from_slice(&text).map_err(|error| TokenizerError::Json(error.to_string()))?;
        if file.model.kind != "BPE" {
            return Err(TokenizerError::NotBpe);
        }
        if !splits_like_qwen(&file.pre_tokenizer) {
            return Err(TokenizerError::Split);
        }
        let is_normalised = match &file.normalizer {
            serde_json::Value::Null => false,
            normalizer if normalizer["type"] == "NFC" => true,
            _ => return Err(TokenizerError::Normalizer),
        };
        let alphabet = byte_of_char();
        let to_bytes =
            |token: &str| -> Option<Box<[u8]>> { token.chars().map(|c| alphabet.get(&c).copied()).collect() };
        let mut ids = FxHashMap::default();
        for (token, id) in &file.model.vocab {
            let bytes = to_bytes(token).ok_or_else(|| TokenizerError::Token(token.chars().take(40).collect()))?;
            ids.insert(bytes, *id);
        }
        let mut bytes = [0; 256];
        for byte in 0..=255_u8 {
            bytes[usize::from(byte)] = *ids.get([byte].as_slice()).ok_or(TokenizerError::Byte(byte))?;
        }
        let mut merges = FxHashMap::default();
        for (rank, merge) in file.model.merges.iter().enumerate() {
            let (left, right) = match merge {
                Merge::Text(text) => text.split_once(' ').ok_or(TokenizerError::Merge(rank))?,
                Merge::Pair([left, right]) => (left.as_str(), right.as_str()),
            };
            let id = |token: &str| file.model.vocab.get(token).copied();
            let joined = format!("{left}{right}");
            let (Some(left), Some(right), Some(merged)) = (id(left), id(right), id(&joined)) else {
                return Err(TokenizerError::Merge(rank));
            };
            merges.entry((left, right)).or_insert((rank as u32, merged));
        }
        let mut added: Vec<(String, u32)> = file
            .added_tokens
            .into_iter()
            .filter(|token| !token.content.is_empty())
            .map(|token| (token.content, token.id))
            .collect();
        added.sort_by(|a, b| b.0.len().cmp(&a.0.len()).then(a.cmp(b)));
        Ok(BytePairs { ids, merges, bytes, added, is_normalised })
    }

    /// The ids of a text, without any that a chat template would add.
    pub fn ids(&self, text: &str) -> Vec<u32> {
        let mut out = Vec::new();
        self.each(text, &mut |ids| out.extend_from_slice(ids));
        out
    }

    /// Calls `take` with the ids of one piece after the other.
    fn each(&self, text: &str, take: &mut dyn FnMut(&[u32])) {
        let mut symbols = Symbols::default();
        // Where each added token comes next: looked up again only once the text has passed it, so that a text full of them costs no more.
        let mut ahead: Vec<Option<usize>> = self.added.iter().map(|(token, _)| text.find(token.as_str())).collect();
        let mut done = 0;
        loop {
            for ((token, _), at) in self.added.iter().zip(&mut ahead) {
                if at.is_some_and(|at| at < done) {
                    *at = text[done..].find(token.as_str()).map(|at| done + at);
                }
            }
            // The first; of several at one place the longest, which stands first.
            let next =
                ahead.iter().zip(&self.added).filter_map(|(at, added)| Some(((*at)?, added))).min_by_key(|(at, _)| *at);
            let between = &text[done..next.map_or(text.len(), |(at, _)| at)];
            let normalised = if self.is_normalised { in_form_c(between) } else { between.into() };
            let mut plain: &str = &normalised;
            while !plain.is_empty() {
                let (piece, remaining) = plain.split_at(piece_bytes(plain));
                match self.ids.get(piece.as_bytes()) {
                    Some(id) => take(&[*id]), // nearly every piece of ordinary text is one token
                    None => take(symbols.merged(self, piece.as_bytes())),
                }
                plain = remaining;
            }
            let Some((at, (token, id))) = next else { return };
            take(&[*id]);
            done = at + token.len();
        }
    }
}

impl TokenCounter for BytePairs {
    fn count(&self, text: &str) -> usize {
        let mut count = 0;
        self.each(text, &mut |ids| count += ids.len());
        count
    }
}

/// The merging of one piece: a linked list of tokens and a heap of the pairs that can be joined. O(n log n), so that a text without any
/// space costs no more than others.
#[derive(Default)]
struct Symbols {
    id: Vec<u32>,
    /// Neighbours in the list; `usize::MAX` is none.
    before: Vec<usize>,
    after: Vec<usize>,
    /// (rank, left position, id of left, id of right): stale once one of the two has changed.
    pairs: BinaryHeap<Reverse<(u32, usize, u32, u32)>>,
    out: Vec<u32>,
}

impl Symbols {
    fn merged(&mut self, vocabulary: &BytePairs, piece: &[u8]) -> &[u32] {
        const NONE: usize = usize::MAX;
        let n = piece.len();
        self.id.clear();
        self.id.extend(piece.iter().map(|byte| vocabulary.bytes[usize::from(*byte)]));
        self.before.clear();
        self.before.extend((0..n).map(|at| at.checked_sub(1).unwrap_or(NONE)));
        self.after.clear();
        self.after.extend((0..n).map(|at| if at + 1 < n { at + 1 } else { NONE }));
        self.pairs.clear();
        for at in 1..n {
            self.offer(vocabulary, at - 1, at);
        }
        const GONE: u32 = u32::MAX;
        while let Some(Reverse((_, left, left_id, right_id))) = self.pairs.pop() {
            let right = self.after[left];
            if right == NONE || self.id[left] != left_id || self.id[right] != right_id {
                continue;
            }
            let (_, merged) = vocabulary.merges[&(left_id, right_id)];
            self.id[left] = merged;
            self.id[right] = GONE;
            let next = self.after[right];
            self.after[left] = next;
            if next != NONE {
                self.before[next] = left;
                self.offer(vocabulary, left, next);
            }
            if self.before[left] != NONE {
                self.offer(vocabulary, self.before[left], left);
            }
        }
        self.out.clear();
        self.out.extend(self.id.iter().copied().filter(|id| *id != GONE));
        &self.out
    }

    fn offer(&mut self, vocabulary: &BytePairs, left: usize, right: usize) {
        let pair = (self.id[left], self.id[right]);
        if let Some((rank, _)) = vocabulary.merges.get(&pair) {
            self.pairs.push(Reverse((*rank, left, pair.0, pair.1)));
        }
    }
}

/// Bytes of the first piece of a text that is not empty.
fn piece_bytes(text: &str) -> usize {
    let mut chars = text.chars();
    let first = chars.next().expect("not empty");
    let second = chars.next();
    // (?i:'s|'t|'re|'ve|'m|'ll|'d)
    if first == '\'' {
        let third = chars.next();
        let lower = |c: Option<char>| c.map(|c| if c == '\u{17f}' { 's' } else { c.to_ascii_lowercase() });
        match (lower(second), lower(third)) {
            (Some('s' | 't' | 'm' | 'd'), _) => return 1 + second.map_or(0, char::len_utf8),
            (Some('r' | 'v'), Some('e')) | (Some('l'), Some('l')) => return 3,
            _ => {}
        }
    }
    // [^\r\n\p{L}\p{N}]?\p{L}+
    let is_break = |c: char| matches!(c, '\r' | '\n');
    if is_letter(first) {
        return run(text, 0, is_letter);
    }
    if !is_break(first) && !first.is_numeric() && second.is_some_and(is_letter) {
        return run(text, first.len_utf8(), is_letter);
    }
    // \p{N}
    if first.is_numeric() {
        return first.len_utf8();
    }
    // ?[^\s\p{L}\p{N}]+[\r\n]*
    let is_mark = |c: char| !c.is_whitespace() && !c.is_numeric() && !is_letter(c);
    let start = if first == ' ' && second.is_some_and(is_mark) { Some(1) } else { is_mark(first).then_some(0) };
    if let Some(start) = start {
        return run(text, run(text, start, is_mark), is_break);
    }
    // \s*[\r\n]+ | \s+(?!\S) | \s+
    let blank = run(text, 0, char::is_whitespace);
    if let Some(last_break) = text[..blank].rfind(is_break) {
        return last_break + 1;
    }
    let last = text[..blank].chars().next_back().map_or(0, char::len_utf8);
    if blank == text.len() || blank == last { blank } else { blank - last }
}

/// Where the run of characters that begins at `start` ends.
fn run(text: &str, start: usize, is_part: impl Fn(char) -> bool) -> usize {
    text[start..].find(|c| !is_part(c)).map_or(text.len(), |length| start + length)
}

/// `\p{L}`. Alphabetic takes in number letters, marks and circled letters, which are not.
fn is_letter(c: char) -> bool {
    if c.is_ascii() {
        return c.is_ascii_alphabetic();
    }
    c.is_alphabetic() && !c.is_numeric() && !is_mark_or_symbol(c)
}

fn is_mark_or_symbol(c: char) -> bool {
    // Letters in circles and squares are symbols.
    let is_symbol = matches!(c, '\u{24b6}'..='\u{24e9}' | '\u{1f130}'..='\u{1f149}' | '\u{1f150}'..='\u{1f169}' | '\u{1f170}'..='\u{1f189}');
    is_symbol || is_combining_mark(c)
}

/// The characters that stand for bytes in the file: printable Latin-1 for itself, the others from U+0100 on.
fn byte_of_char() -> FxHashMap<char, u8> {
    let is_itself = |byte: u8| matches!(byte, b'!'..=b'~' | 0xa1..=0xac | 0xae..=0xff);
    let mut next = 0x100..;
    let code = |byte: u8, next: &mut std::ops::RangeFrom<u32>| {
        if is_itself(byte) { Some(u32::from(byte)) } else { next.next() }
    };
    (0..=255).filter_map(|byte| Some((char::from_u32(code(byte, &mut next)?)?, byte))).collect()
}

/// One Split with the expression above, then ByteLevel without an expression of its own.
fn splits_like_qwen(pre_tokenizer: &serde_json::Value) -> bool {
    let steps: &[serde_json::Value] = pre_tokenizer["pretokenizers"].as_array().map_or(&[], Vec::as_slice);
    let [split, bytes] = steps else { return false };
    split["type"] == "Split"
        && split["pattern"]["Regex"] == QWEN_SPLIT
        && split["behavior"] == "Isolated"
        && bytes["type"] == "ByteLevel"
        && bytes["add_prefix_space"] == false
        && bytes["use_regex"] == false
}

/// Normalisation form C of Unicode: marks joined with their letters where there is one character for both.
fn in_form_c(text: &str) -> Cow<'_, str> {
    match is_nfc_quick(text.chars()) {
        IsNormalized::Yes => Cow::Borrowed(text),
        IsNormalized::No | IsNormalized::Maybe => Cow::Owned(text.nfc().collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(text: &str) -> Vec<&str> {
        let mut rest = text;
        let mut out = Vec::new();
        while !rest.is_empty() {
            let (piece, remaining) = rest.split_at(piece_bytes(rest));
            out.push(piece);
            rest = remaining;
        }
        out
    }

    #[test]
    fn the_split_by_hand() {
        assert_eq!(pieces("chair12 at 1.5m"), ["chair", "1", "2", " at", " ", "1", ".", "5", "m"]);
        assert_eq!(pieces("it's THEY'LL 'tis"), ["it", "'s", " THEY", "'LL", " '", "tis"]);
        assert_eq!(pieces("a  b   \n\n c  "), ["a", " ", " b", "   \n\n", " c", "  "]);
        assert_eq!(pieces("x;\r\ny"), ["x", ";\r\n", "y"]);
        assert_eq!(pieces("\u{e9}t\u{e9} \u{2460} \u{5b89}"), ["\u{e9}t\u{e9}", " ", "\u{2460}", " \u{5b89}"]);
        assert_eq!(pieces(" -x"), [" -", "x"]);
    }

    #[test]
    fn a_small_vocabulary_by_hand() {
        // Bytes are tokens 0..=255; "ab" is 256 and merges before "bc" (257); "abc" has no merge.
        let alphabet = byte_of_char();
        let mut vocab: serde_json::Map<String, serde_json::Value> =
            alphabet.iter().map(|(c, byte)| (c.to_string(), (*byte).into())).collect();
        vocab.insert("ab".into(), 256.into());
        vocab.insert("bc".into(), 257.into());
        let file = serde_json::json!({
            "added_tokens": [{"id": 258, "content": "<|x|>"}],
            "pre_tokenizer": {"type": "Sequence", "pretokenizers": [
                {"type": "Split", "pattern": {"Regex": QWEN_SPLIT}, "behavior": "Isolated"},
                {"type": "ByteLevel", "add_prefix_space": false, "use_regex": false}]},
            "model": {"type": "BPE", "vocab": vocab, "merges": ["a b", ["b", "c"]]},
        });
        let pairs = BytePairs::read(file.to_string().as_bytes()).expect("sound");
        assert_eq!(pairs.ids("abc bc<|x|>b"), [256, 99, 32, 257, 258, 98]);
        assert_eq!(pairs.count("abc bc<|x|>b"), 6);
        let mut other = file.clone();
        other["pre_tokenizer"]["pretokenizers"][0]["pattern"]["Regex"] = r"\w+".into();
        assert!(matches!(BytePairs::read(other.to_string().as_bytes()), Err(TokenizerError::Split)));
        let mut other = file.clone();
        other["normalizer"] = serde_json::json!({"type": "Lowercase"});
        assert!(matches!(BytePairs::read(other.to_string().as_bytes()), Err(TokenizerError::Normalizer)));
        let mut other = file.clone();
        other["model"]["merges"] = serde_json::json!(["a zz"]);
        assert!(matches!(BytePairs::read(other.to_string().as_bytes()), Err(TokenizerError::Merge(0))));
        assert!(matches!(BytePairs::read(b"{}".as_slice()), Err(TokenizerError::Json(_))));
    }
}
