//! Cleans the text of a URDF before it is parsed.
//!
//! Files found in the wild carry several `<material>` per `<visual>`, empty `<geometry/>`, simulator and transmission sections,
//! namespaces and document types. A model of the robot's body needs none of these, and XML readers trip over them. So only the
//! elements of a kinematic tree pass:
//!
//! ```text
//! robot > link  > inertial > origin mass inertia
//!                 collision > origin geometry > box cylinder capsule sphere mesh
//!         joint > origin parent child axis limit mimic
//! ```
//!
//! Text between tags, comments, document types (and with them entity bombs) are dropped, a repeated part keeps its first copy, and a
//! collision with an empty geometry is left out. The depth is bounded by the table above, whatever the input nests.

use crate::error::ModelError;

/// Larger texts are refused: the largest official file has 40 kB.
pub const MAX_URDF_BYTES: usize = 16 << 20;

/// One kept element with its line in the original text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Element {
    pub name: String,
    /// Attributes as written, quotes included: ` xyz="0 0 0" rpy='0 0 0'`.
    pub attributes: String,
    pub line: usize,
    pub children: Vec<Element>,
}

/// Keeps what a kinematic tree is made of.
pub(crate) fn sanitise(text: &str) -> Result<Element, ModelError> {
    if text.len() > MAX_URDF_BYTES {
        return Err(ModelError::TooLarge { bytes: text.len(), limit: MAX_URDF_BYTES });
    }
    let mut root = None;
    // Open elements: the kept ones, and the names of dropped ones inside them.
    let mut kept: Vec<Element> = Vec::new();
    let mut dropped: Vec<&str> = Vec::new();
    let mut scanner = Scanner { text, at: 0, line: 1 };
    while let Some(tag) = scanner.next_tag()? {
        match tag {
            Tag::Open { name, attributes, is_empty, line } => {
                let parent = kept.last().map(|element| element.name.as_str());
                if dropped.is_empty() && name.starts_with("xacro:") {
                    return Err(ModelError::UnexpandedXacro { line, element: name.to_owned() });
                }
                if kept.is_empty() && root.is_some() {
                    return Err(ModelError::Markup { line });
                }
                if dropped.is_empty() && is_kept(parent, name) {
                    kept.push(Element {
                        name: name.to_owned(),
                        attributes: attributes.to_owned(),
                        line,
                        children: Vec::new(),
                    });
                    if is_empty {
                        close_kept(&mut kept, &mut root);
                    }
                } else if kept.is_empty() && dropped.is_empty() {
                    return Err(ModelError::NoRobotElement);
                } else if !is_empty {
                    dropped.push(name);
                }
            }
            Tag::Close { name, line } => match dropped.pop() {
                Some(open) if open == name => {}
                Some(_) => return Err(ModelError::Markup { line }),
                None if kept.last().is_some_and(|element| element.name == name) => close_kept(&mut kept, &mut root),
                None => return Err(ModelError::Markup { line }),
            },
        }
    }
    match root {
        _ if !kept.is_empty() || !dropped.is_empty() => Err(ModelError::Markup { line: scanner.line }),
        Some(root) => Ok(root),
        None => Err(ModelError::NoRobotElement),
    }
}

impl Element {
    /// The value of an attribute as written, without entity decoding.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        attributes_of(&self.attributes).find(|(key, _, _)| *key == name).map(|(_, value, _)| value)
    }

    /// The element as XML text.
    pub fn write(&self, out: &mut String) {
        out.push('<');
        out.push_str(&self.name);
        for (key, value, quote) in attributes_of(&self.attributes) {
            // Prefixed attributes (xmlns:..., xsi:...) carry nothing here.
            if !key.contains(':') && key != "xmlns" {
                out.push(' ');
                out.push_str(key);
                out.push('=');
                out.push(quote);
                out.push_str(value);
                out.push(quote);
            }
        }
        out.push('>');
        for child in &self.children {
            child.write(out);
        }
        out.push_str("</");
        out.push_str(&self.name);
        out.push('>');
    }
}

fn is_kept(parent: Option<&str>, name: &str) -> bool {
    match parent {
        None => name == "robot",
        Some("robot") => matches!(name, "link" | "joint"),
        Some("link") => matches!(name, "inertial" | "collision"),
        Some("inertial") => matches!(name, "origin" | "mass" | "inertia"),
        Some("collision") => matches!(name, "origin" | "geometry"),
        Some("geometry") => matches!(name, "box" | "cylinder" | "capsule" | "sphere" | "mesh"),
        Some("joint") => matches!(name, "origin" | "parent" | "child" | "axis" | "limit" | "mimic"),
        Some(_) => false,
    }
}

/// Moves the innermost open element into its parent, unless it is a second copy or an empty collision.
fn close_kept(kept: &mut Vec<Element>, root: &mut Option<Element>) {
    let Some(element) = kept.pop() else { return };
    let Some(parent) = kept.last_mut() else {
        *root = Some(element);
        return;
    };
    let may_repeat = matches!(element.name.as_str(), "link" | "joint" | "collision");
    let is_repeated = !may_repeat && parent.children.iter().any(|sibling| sibling.name == element.name);
    let second_shape = parent.name == "geometry" && !parent.children.is_empty();
    let is_empty_collision = element.name == "collision"
        && !element.children.iter().any(|child| child.name == "geometry" && !child.children.is_empty());
    if !(is_repeated || second_shape || is_empty_collision) {
        parent.children.push(element);
    }
}

enum Tag<'a> {
    Open { name: &'a str, attributes: &'a str, is_empty: bool, line: usize },
    Close { name: &'a str, line: usize },
}

struct Scanner<'a> {
    text: &'a str,
    at: usize,
    line: usize,
}

impl<'a> Scanner<'a> {
    /// The next opening or closing tag; everything else is passed over.
    fn next_tag(&mut self) -> Result<Option<Tag<'a>>, ModelError> {
        loop {
            let Some(start) = self.text[self.at..].find('<') else {
                return Ok(None);
            };
            self.advance(start);
            let line = self.line;
            let rest = &self.text[self.at..];
            let broken = ModelError::Markup { line };
            if rest.starts_with("<!--") {
                self.advance(rest.find("-->").ok_or(broken)? + 3);
            } else if rest.starts_with("<![CDATA[") {
                self.advance(rest.find("]]>").ok_or(broken)? + 3);
            } else if rest.starts_with("<?") {
                self.advance(rest.find("?>").ok_or(broken)? + 2);
            } else if rest.starts_with("<!") {
                self.advance(end_of_doctype(rest).ok_or(broken)?);
            } else {
                let end = end_of_tag(rest).ok_or(broken)?;
                self.advance(end);
                return parse_tag(&rest[1..end - 1], line).map(Some);
            }
        }
    }

    fn advance(&mut self, bytes: usize) {
        self.line += self.text[self.at..self.at + bytes].bytes().filter(|b| *b == b'\n').count();
        self.at += bytes;
    }
}

/// Bytes up to and with the `>` that closes the tag; a `>` inside quotes does not.
fn end_of_tag(rest: &str) -> Option<usize> {
    let mut quote = None;
    for (at, byte) in rest.bytes().enumerate().skip(1) {
        match (quote, byte) {
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'>') => return Some(at + 1),
            (None, b'<') => return None,
            (Some(open), _) if open == byte => quote = None,
            _ => {}
        }
    }
    None
}

/// A document type may hold an internal subset in brackets with tags of its own.
fn end_of_doctype(rest: &str) -> Option<usize> {
    let mut depth = 0i32;
    for (at, byte) in rest.bytes().enumerate() {
        match byte {
            b'[' => depth += 1,
            b']' => depth -= 1,
            b'>' if depth <= 0 => return Some(at + 1),
            _ => {}
        }
    }
    None
}

/// Parses what stands between `<` and `>`.
fn parse_tag(inside: &str, line: usize) -> Result<Tag<'_>, ModelError> {
    if let Some(name) = inside.strip_prefix('/') {
        return Ok(Tag::Close { name: name.trim_end(), line });
    }
    let (inside, is_empty) = inside.strip_suffix('/').map_or((inside, false), |inside| (inside, true));
    let name_end = inside.find(|c: char| c.is_whitespace()).unwrap_or(inside.len());
    let (name, attributes) = inside.split_at(name_end);
    // A sound list of attributes is consumed to its end.
    let is_sound = attributes[attributes_end(attributes)..].trim().is_empty();
    if name.is_empty() || !is_sound {
        return Err(ModelError::Markup { line });
    }
    Ok(Tag::Open { name, attributes, is_empty, line })
}

/// `(key, value, quote)` of every attribute up to the first broken one.
fn attributes_of(text: &str) -> impl Iterator<Item = (&str, &str, char)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let (key, value, quote, end) = next_attribute(text, at)?;
        at = end;
        Some((key, value, quote))
    })
}

fn attributes_end(text: &str) -> usize {
    let mut at = 0;
    while let Some((_, _, _, end)) = next_attribute(text, at) {
        at = end;
    }
    at
}

fn next_attribute(text: &str, at: usize) -> Option<(&str, &str, char, usize)> {
    let rest = &text[at..];
    let equals = rest.find('=')?;
    let key = rest[..equals].trim();
    if key.is_empty() || key.contains(|c: char| c.is_whitespace() || matches!(c, '"' | '\'' | '&')) {
        return None;
    }
    let value = rest[equals + 1..].trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    let length = value[1..].find(quote)?;
    let value_at = text.len() - value.len() + 1;
    Some((key, &value[1..1 + length], quote, value_at + length + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &str) {
        let mut out = String::new();
        sanitise(text).expect("well formed").write(&mut out);
        assert_eq!(out, expected);
    }

    #[test]
    fn only_the_kinematic_tree_passes() {
        check(
            r#"<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a "b">]><!-- <link name="no"/> -->
            <robot name="r" xmlns:xacro="http://x"><material name="m"><color rgba="1 1 1 1"/></material>
              <link name="a"><visual><geometry/><material name="x"/><material name="y"/></visual>
                <collision><geometry></geometry></collision>
                <collision><geometry><box size="1 1 1"/></geometry></collision></link>
              <gazebo><link name="no"/></gazebo>
            </robot>"#,
            r#"<robot name="r"><link name="a"><collision><geometry><box size="1 1 1"></box></geometry></collision></link></robot>"#,
        );
    }

    #[test]
    fn a_repeated_part_keeps_its_first_copy() {
        check(
            r#"<robot><link name='a'><inertial><mass value="1"/><mass value="2"/></inertial></link></robot>"#,
            r#"<robot><link name='a'><inertial><mass value="1"></mass></inertial></link></robot>"#,
        );
    }

    #[test]
    fn broken_markup_names_its_line() {
        for (text, line) in [
            ("<robot>\n<link name='a'>\n</robot>", 3),
            ("<robot>\n<link name=a/></robot>", 2),
            ("<robot>\n\n<link", 3),
            ("<robot>", 1),
            ("<robot></robot><robot></robot>", 1),
        ] {
            assert_eq!(sanitise(text), Err(ModelError::Markup { line }), "{text}");
        }
        assert_eq!(sanitise("hello"), Err(ModelError::NoRobotElement));
        assert_eq!(sanitise("<html></html>"), Err(ModelError::NoRobotElement));
        assert!(matches!(sanitise("<robot><xacro:macro/></robot>"), Err(ModelError::UnexpandedXacro { line: 1, .. })));
    }
}
