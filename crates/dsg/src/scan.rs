//! Splits a JSON document into its fields, and their lists into records, without building a tree.
//!
//! A graph of 100,000 nodes is a hundred megabytes of JSON: as a tree it would be a gigabyte. Here it stays text; each record
//! is parsed by itself, and of a file that ends early the records before the end can still be read. The scan looks at quotes
//! and brackets only: what is inside a record is judged by the parser that reads it.

use std::ops::Range;

use serde_json::Value;

use crate::load::{JsonPath, LoadError, MAX_BYTES};

/// A document: what is at its top level.
#[derive(Debug)]
pub(crate) struct Document<'b> {
    pub bytes: &'b [u8],
    fields: Vec<Field>,
}

/// A field of the document.
#[derive(Debug)]
struct Field {
    name: String,
    text: Span,
    /// If it is a list: its items.
    items: Option<Vec<Span>>,
}

/// A stretch of the text. Files end before 4 GiB ([`MAX_BYTES`]).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Span {
    start: u32,
    end: u32,
}

impl Span {
    fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

impl<'b> Document<'b> {
    /// The fields of a text that is one JSON object, and the fault at which the scan had to stop, if there is one: what came
    /// before the fault is there.
    pub fn scan(bytes: &'b [u8]) -> (Document<'b>, Option<LoadError>) {
        let mut document = Document { bytes, fields: Vec::new() };
        if bytes.len() > MAX_BYTES {
            return (document, Some(LoadError::TooLarge { bytes: bytes.len() }));
        }
        let mut scanner = Scanner { bytes, at: 0 };
        let fault = scanner.document(&mut document.fields).err();
        (document, fault.map(|fault| fault_at(bytes, scanner.at, fault)))
    }

    /// The items of a field that is a list; `None` if there is no such field, or no list.
    pub fn items(&self, name: &str) -> Option<&[Span]> {
        self.fields.iter().find(|field| field.name == name)?.items.as_deref()
    }

    /// The text of an item.
    pub fn text(&self, span: Span) -> &'b [u8] {
        &self.bytes[span.range()]
    }

    /// The text of a field.
    pub fn field(&self, name: &str) -> Option<&'b [u8]> {
        self.fields.iter().find(|field| field.name == name).map(|field| self.text(field.text))
    }

    /// The names of all fields, in the order of the text.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.fields.iter().map(|field| field.name.as_str())
    }

    /// A part of the document as a tree.
    pub fn parse(&self, part: &'b [u8]) -> Result<Value, LoadError> {
        serde_json::from_slice(part).map_err(|error| {
            let (line, column) = self.position(part, &error);
            LoadError::Syntax { line, column }
        })
    }

    /// Line and column in the document of a parser's error in a part of it.
    pub fn position(&self, part: &[u8], error: &serde_json::Error) -> (usize, usize) {
        let start = part.as_ptr() as usize - self.bytes.as_ptr() as usize;
        let (line, column) = position(self.bytes, start);
        // The parser counts from the start of the part.
        let column = if error.line() <= 1 { column + error.column().max(1) - 1 } else { error.column() };
        (line + error.line().max(1) - 1, column)
    }
}

/// Why a scan stops.
#[derive(Debug)]
enum Stop {
    /// The text ends.
    End,
    /// Another byte than JSON allows here.
    Byte,
    /// A field of the document comes again: which one is meant?
    Twice(String),
}

fn fault_at(bytes: &[u8], at: usize, stop: Stop) -> LoadError {
    let (line, column) = position(bytes, at);
    match stop {
        Stop::End => LoadError::Truncated { line, column },
        Stop::Byte => LoadError::Syntax { line, column },
        Stop::Twice(name) => LoadError::Duplicate { path: JsonPath(format!("$.{name}")) },
    }
}

/// Line and column from 1 of a byte.
fn position(bytes: &[u8], at: usize) -> (usize, usize) {
    let before = &bytes[..at.min(bytes.len())];
    let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
    let column = before.iter().rev().take_while(|byte| **byte != b'\n').count() + 1;
    (line, column)
}

/// Quotes and brackets.
const IS_MARK: [bool; 256] = {
    let mut marks = [false; 256];
    let mut k = 0;
    while k < 5 {
        marks[b"\"{}[]"[k] as usize] = true;
        k += 1;
    }
    marks
};

struct Scanner<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl Scanner<'_> {
    fn document(&mut self, fields: &mut Vec<Field>) -> Result<(), Stop> {
        self.expect(b'{')?;
        if self.peek()? == b'}' {
            self.at += 1;
            return self.end();
        }
        loop {
            if self.peek()? != b'"' {
                return Err(Stop::Byte);
            }
            let key = self.value()?;
            let name: String = serde_json::from_slice(&self.bytes[key.range()]).map_err(|_| Stop::Byte)?;
            if fields.iter().any(|field| field.name == name) {
                return Err(Stop::Twice(name));
            }
            self.expect(b':')?;
            let start = (self.peek().map(|_| self.at))?;
            fields.push(Field { name, text: Span { start: start as u32, end: start as u32 }, items: None });
            let field = fields.last_mut().expect("it was just put there");
            if self.bytes[start] == b'[' {
                self.list(field.items.insert(Vec::new()))?;
            } else {
                self.value()?;
            }
            field.text.end = self.at as u32;
            match self.next()? {
                b',' => {}
                b'}' => return self.end(),
                _ => return self.back(),
            }
        }
    }

    fn list(&mut self, items: &mut Vec<Span>) -> Result<(), Stop> {
        self.expect(b'[')?;
        if self.peek()? == b']' {
            self.at += 1;
            return Ok(());
        }
        loop {
            items.push(self.value()?);
            match self.next()? {
                b',' => {}
                b']' => return Ok(()),
                _ => return self.back(),
            }
        }
    }

    /// Any value. What is between matching brackets is not looked at.
    fn value(&mut self) -> Result<Span, Stop> {
        let first = self.peek()?;
        let start = self.at;
        match first {
            b'"' => self.string()?,
            b'{' | b'[' => self.nested()?,
            _ => {
                let rest = &self.bytes[start..];
                let is_end = |byte: &u8| matches!(byte, b',' | b']' | b'}' | b':' | b' ' | b'\n' | b'\r' | b'\t');
                self.at += rest.iter().position(is_end).ok_or(Stop::End)?;
                if self.at == start {
                    return Err(Stop::Byte);
                }
            }
        }
        Ok(Span { start: start as u32, end: self.at as u32 })
    }

    /// From a quote to behind its partner.
    fn string(&mut self) -> Result<(), Stop> {
        self.at += 1;
        loop {
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            let Some(length) = rest.iter().position(|byte| matches!(byte, b'"' | b'\\')) else {
                self.at = self.bytes.len();
                return Err(Stop::End);
            };
            self.at += length + 1;
            if rest[length] == b'"' {
                return Ok(());
            }
            // What follows a backslash is not a quote that ends.
            self.at += 1;
        }
    }

    /// From a bracket to behind its partner.
    fn nested(&mut self) -> Result<(), Stop> {
        let mut depth = 0_usize;
        loop {
            let rest = &self.bytes[self.at..];
            let Some(length) = rest.iter().position(|byte| IS_MARK[usize::from(*byte)]) else {
                self.at = self.bytes.len();
                return Err(Stop::End);
            };
            self.at += length;
            match rest[length] {
                b'"' => {
                    self.string()?;
                    continue;
                }
                b'{' | b'[' => depth += 1,
                _ => depth -= 1,
            }
            self.at += 1;
            if depth == 0 {
                return Ok(());
            }
        }
    }

    /// The next byte that is not space, which stays.
    fn peek(&mut self) -> Result<u8, Stop> {
        while let Some(byte) = self.bytes.get(self.at) {
            if !matches!(byte, b' ' | b'\n' | b'\r' | b'\t') {
                return Ok(*byte);
            }
            self.at += 1;
        }
        Err(Stop::End)
    }

    /// The next byte that is not space.
    fn next(&mut self) -> Result<u8, Stop> {
        let byte = self.peek()?;
        self.at += 1;
        Ok(byte)
    }

    fn expect(&mut self, byte: u8) -> Result<(), Stop> {
        if self.next()? == byte { Ok(()) } else { self.back() }
    }

    /// The byte just read is wrong.
    fn back(&mut self) -> Result<(), Stop> {
        self.at -= 1;
        Err(Stop::Byte)
    }

    /// Nothing but space follows.
    fn end(&mut self) -> Result<(), Stop> {
        match self.peek() {
            Ok(_) => Err(Stop::Byte),
            Err(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn items(text: &str, name: &str) -> Vec<String> {
        let (document, fault) = Document::scan(text.as_bytes());
        assert!(fault.is_none(), "{fault:?}");
        let spans = document.items(name).expect("a list");
        spans.iter().map(|span| String::from_utf8(document.text(*span).to_vec()).unwrap()).collect()
    }

    #[test]
    fn records_are_found_whatever_their_strings_hold() {
        let text = r#" {"a": [ {"x": "]}\"["} , [1,[2]], "s,]", -1.5e3,true ] , "b\"": 7, "c": []}"#;
        assert_eq!(items(text, "a"), [r#"{"x": "]}\"["}"#, "[1,[2]]", r#""s,]""#, "-1.5e3", "true"]);
        assert!(items(text, "c").is_empty());
        let (document, _) = Document::scan(text.as_bytes());
        assert_eq!(document.names().collect::<Vec<_>>(), ["a", "b\"", "c"]);
        assert_eq!(document.field("b\""), Some(&b"7"[..]));
        assert!(document.items("b\"").is_none());
    }

    #[test]
    fn a_fault_says_where_and_leaves_what_came_before() {
        let fault = |text: &str| {
            let (document, fault) = Document::scan(text.as_bytes());
            (document.items("a").map_or(0, <[Span]>::len), fault.map(|fault| fault.to_string()))
        };
        assert_eq!(fault("{\"a\": [1,\n2,{\"b\""), (2, Some("the file ends early, at line 2 column 7".to_owned())));
        assert_eq!(fault("{\"a\":[1 2]}").1.unwrap(), "not JSON (or nested too deep) at line 1 column 9");
        assert_eq!(fault("{\"a\":[1],\"a\":[]}"), (1, Some("$.a occurs twice".to_owned())));
        assert!(fault("[1]").1.is_some() && fault("").1.is_some() && fault("{}x").1.is_some());
        assert!(fault("{\"a\":[1,]}").1.is_some() && fault("{\"a\":[,1]}").1.is_some());
        let deep = format!("{{\"a\": {}", "[".repeat(100_000));
        assert!(matches!(Document::scan(deep.as_bytes()).1, Some(LoadError::Truncated { .. })));
    }

    #[test]
    fn the_place_of_a_fault_in_a_record_is_that_in_the_file() {
        let text = "{\"a\": [\n 1,\n  {\"x\": nan}]}";
        let (document, _) = Document::scan(text.as_bytes());
        let second = document.items("a").unwrap()[1];
        let error = document.parse(document.text(second)).unwrap_err();
        // serde_json counts the byte it stumbled over.
        assert!(matches!(error, LoadError::Syntax { line: 3, column: 10 | 11 }), "{error}");
    }

    proptest! {
        #[test]
        fn every_document_is_split_as_the_parser_splits_it(lists in prop::collection::vec(any_json(), 0..5), pretty: bool) {
            let names = ["a", "b c", "\"", "\\", "ä"];
            let map: serde_json::Map<String, Value> =
                names.iter().map(|name| (*name).to_owned()).zip(lists.into_iter().map(Value::Array)).collect();
            let value = Value::Object(map.clone());
            let text = if pretty { serde_json::to_string_pretty(&value) } else { serde_json::to_string(&value) }.unwrap();
            let (document, fault) = Document::scan(text.as_bytes());
            prop_assert!(fault.is_none());
            for (name, list) in &map {
                let found: Vec<Value> = document.items(name).unwrap().iter()
                    .map(|span| document.parse(document.text(*span)).unwrap()).collect();
                prop_assert_eq!(&Value::Array(found), list);
            }
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in prop::collection::vec(prop::sample::select(b"{}[]\":,\\ \n1a".to_vec()), 0..60)) {
            let (document, _) = Document::scan(&bytes);
            for name in document.names() {
                for span in document.items(name).unwrap_or_default() {
                    let _ = document.parse(document.text(*span));
                }
            }
        }
    }

    fn any_json() -> impl Strategy<Value = Vec<Value>> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            "[\"\\\\{}\\[\\],: aé\n]{0,6}".prop_map(Value::from),
        ];
        let value = leaf.prop_recursive(3, 16, 4, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
                prop::collection::btree_map("[\"\\\\{}a]{0,3}", inner, 0..4)
                    .prop_map(|map| Value::Object(map.into_iter().collect())),
            ]
        });
        prop::collection::vec(value, 0..5)
    }
}
