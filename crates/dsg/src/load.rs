//! What can be wrong with a file, and a cursor over parsed JSON that knows where it is.

use std::fmt;
use std::io;
use std::path::PathBuf;

use nalgebra::{Isometry3, Point3, Quaternion, UnitQuaternion, Vector3};
use serde_json::{Map, Value};

use crate::graph::SceneGraph;
use crate::op::OpError;

/// Larger files are refused before they are parsed.
pub const MAX_BYTES: usize = 512 << 20;

/// A place in a JSON file: `$.objects[3].centroid[0]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonPath(pub String);

impl fmt::Display for JsonPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Why a file was refused.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file is larger than [`MAX_BYTES`].
    #[error("the file has {bytes} bytes, more than {MAX_BYTES}")]
    TooLarge {
        /// Its size.
        bytes: usize,
    },
    /// The text ends within a value: the file is cut short.
    #[error("the file ends early, at line {line} column {column}")]
    Truncated {
        /// Line of the end.
        line: usize,
        /// Column of the end.
        column: usize,
    },
    /// The text is not JSON (this includes NaN and numbers beyond f64), or nested deeper than 128 levels.
    #[error("not JSON (or nested too deep) at line {line} column {column}")]
    Syntax {
        /// Line of the fault.
        line: usize,
        /// Column of the fault.
        column: usize,
    },
    /// A field that must be there is not.
    #[error("{path} is missing")]
    Missing {
        /// Where.
        path: JsonPath,
    },
    /// A value of another type or out of range.
    #[error("{path} is not {expected}")]
    Type {
        /// Where.
        path: JsonPath,
        /// What it must be.
        expected: &'static str,
    },
    /// A number that stands for NaN (null in a list of numbers).
    #[error("{path} is not a finite number")]
    NotFinite {
        /// Where.
        path: JsonPath,
    },
    /// A node or edge that occurred before.
    #[error("{path} occurs twice")]
    Duplicate {
        /// Where the second one is.
        path: JsonPath,
    },
    /// A reference to a node that is not in the file.
    #[error("{path} refers to a node that does not exist: {id}")]
    Dangling {
        /// Where.
        path: JsonPath,
        /// The id that does not exist.
        id: u64,
    },
    /// A node type or word that this version does not know.
    #[error("{path} is of an unknown type")]
    UnknownType {
        /// Where.
        path: JsonPath,
    },
    /// Another kind of file.
    #[error("{path} does not name a format that is read here")]
    Schema {
        /// Where.
        path: JsonPath,
    },
    /// A file of a newer major version.
    #[error("the file has version {major}, this program reads up to {supported}")]
    NewerVersion {
        /// Version of the file.
        major: u64,
        /// Newest version read here.
        supported: u64,
    },
    /// A record that no graph may hold.
    #[error("{path}: {source}")]
    Refused {
        /// Where.
        path: JsonPath,
        /// Why.
        source: OpError,
    },
    /// A line of ops.log that is not a record, out of order, or has the wrong checksum.
    #[error("ops.log line {line} is damaged")]
    Log {
        /// Line number from 1.
        line: usize,
    },
    /// The mesh in a JSON file is not one.
    #[error(
        "the mesh is broken at line {line} column {column}: points of three numbers, colours, labels, stamps and faces of three vertices are accepted"
    )]
    Mesh {
        /// Line of the fault.
        line: usize,
        /// Column of the fault.
        column: usize,
    },
    /// The mesh beside a graph is no PLY file that is read here.
    #[error("{path:?}: {source}")]
    MeshFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: crate::mesh::MeshError,
    },
    /// The mesh that graph.json names is not there.
    #[error("{path:?} is missing")]
    MeshMissing {
        /// The file.
        path: PathBuf,
    },
    /// The mesh is not the one that graph.json was saved with.
    #[error("{path:?} has another sha256 than graph.json says")]
    MeshHash {
        /// The file.
        path: PathBuf,
    },
    /// The file could not be read or written.
    #[error("{path:?}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Parses a whole file.
pub(crate) fn parse(bytes: &[u8]) -> Result<Value, LoadError> {
    if bytes.len() > MAX_BYTES {
        return Err(LoadError::TooLarge { bytes: bytes.len() });
    }
    serde_json::from_slice(bytes).map_err(|error| {
        let (line, column) = (error.line(), error.column());
        if error.is_eof() { LoadError::Truncated { line, column } } else { LoadError::Syntax { line, column } }
    })
}

impl SceneGraph {
    /// A file may not use up the numbers: whoever goes on with the graph counts from there.
    pub(crate) fn check_room_to_grow(&self) -> Result<(), LoadError> {
        const MOST: u64 = u64::MAX - (1 << 32);
        let next = self.next;
        let is_full = [self.revision, next.object, next.room, next.group].into_iter().any(|number| number > MOST);
        let path = JsonPath("$".into());
        if is_full {
            Err(LoadError::Type { path, expected: "a graph whose ids and revision are below 2^64 - 2^32" })
        } else {
            Ok(())
        }
    }
}

/// A value and the way to it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cursor<'v, 'p> {
    pub value: &'v Value,
    parent: Option<&'p Cursor<'v, 'p>>,
    step: Step<'v>,
}

#[derive(Debug, Clone, Copy)]
enum Step<'v> {
    Root,
    /// The item of a list of the document.
    Record(&'v str, usize),
    /// A field of the document.
    Field(&'v str),
    Key(&'v str),
    Index(usize),
}

impl<'v, 'p> Cursor<'v, 'p> {
    pub fn root(value: &'v Value) -> Cursor<'v, 'v> {
        Cursor { value, parent: None, step: Step::Root }
    }

    /// A record of a list of the document, parsed by itself.
    pub fn record(value: &'v Value, list: &'v str, index: usize) -> Cursor<'v, 'v> {
        Cursor { value, parent: None, step: Step::Record(list, index) }
    }

    /// A field of the document, parsed by itself.
    pub fn field(value: &'v Value, name: &'v str) -> Cursor<'v, 'v> {
        Cursor { value, parent: None, step: Step::Field(name) }
    }

    /// The path from the root.
    pub fn path(&self) -> JsonPath {
        let mut steps = Vec::new();
        let mut at = Some(self);
        while let Some(cursor) = at {
            steps.push(cursor.step);
            at = cursor.parent;
        }
        let mut path = String::new();
        for step in steps.iter().rev() {
            match step {
                Step::Root => path.push('$'),
                Step::Record(list, index) => path.push_str(&format!("$.{list}[{index}]")),
                Step::Field(name) => path.push_str(&format!("$.{name}")),
                Step::Key(key) => {
                    path.push('.');
                    // A hostile key may be long.
                    path.extend(key.chars().take(64));
                }
                Step::Index(index) => path.push_str(&format!("[{index}]")),
            }
        }
        JsonPath(path)
    }

    pub fn wrong(&self, expected: &'static str) -> LoadError {
        LoadError::Type { path: self.path(), expected }
    }

    pub fn refused(&self, source: OpError) -> LoadError {
        LoadError::Refused { path: self.path(), source }
    }

    pub fn duplicate(&self) -> LoadError {
        LoadError::Duplicate { path: self.path() }
    }

    pub fn dangling(&self, id: u64) -> LoadError {
        LoadError::Dangling { path: self.path(), id }
    }

    /// A field; null counts as absent.
    pub fn find<'q>(&'q self, key: &'static str) -> Option<Cursor<'v, 'q>>
    where
        'p: 'q,
    {
        let value = self.value.get(key).filter(|value| !value.is_null())?;
        Some(Cursor { value, parent: Some(self), step: Step::Key(key) })
    }

    /// A field that must be there.
    pub fn get<'q>(&'q self, key: &'static str) -> Result<Cursor<'v, 'q>, LoadError>
    where
        'p: 'q,
    {
        if !self.value.is_object() {
            return Err(self.wrong("an object"));
        }
        self.find(key).ok_or_else(|| LoadError::Missing { path: JsonPath(format!("{}.{key}", self.path())) })
    }

    /// The items of a list.
    pub fn items<'q>(&'q self) -> Result<impl Iterator<Item = Cursor<'v, 'q>>, LoadError>
    where
        'p: 'q,
    {
        let list = self.value.as_array().ok_or_else(|| self.wrong("a list"))?;
        let item = |(index, value)| Cursor { value, parent: Some(self), step: Step::Index(index) };
        Ok(list.iter().enumerate().map(item))
    }

    pub fn map(&self) -> Result<&'v Map<String, Value>, LoadError> {
        self.value.as_object().ok_or_else(|| self.wrong("an object"))
    }

    pub fn f64(&self) -> Result<f64, LoadError> {
        if self.value.is_null() {
            return Err(LoadError::NotFinite { path: self.path() });
        }
        self.value.as_f64().ok_or_else(|| self.wrong("a number"))
    }

    /// An unsigned integer, exact; a float is refused because it may have lost digits.
    pub fn u64(&self) -> Result<u64, LoadError> {
        self.value.as_u64().ok_or_else(|| self.wrong("an unsigned 64-bit integer"))
    }

    pub fn u32(&self) -> Result<u32, LoadError> {
        u32::try_from(self.u64()?).map_err(|_| self.wrong("an unsigned 32-bit integer"))
    }

    pub fn i64(&self) -> Result<i64, LoadError> {
        self.value.as_i64().ok_or_else(|| self.wrong("a 64-bit integer"))
    }

    pub fn i32(&self) -> Result<i32, LoadError> {
        i32::try_from(self.i64()?).map_err(|_| self.wrong("a 32-bit integer"))
    }

    pub fn u8(&self) -> Result<u8, LoadError> {
        u8::try_from(self.u64()?).map_err(|_| self.wrong("an integer up to 255"))
    }

    pub fn bool(&self) -> Result<bool, LoadError> {
        self.value.as_bool().ok_or_else(|| self.wrong("true or false"))
    }

    pub fn str(&self) -> Result<&'v str, LoadError> {
        self.value.as_str().ok_or_else(|| self.wrong("a string"))
    }

    /// Three numbers.
    pub fn point(&self) -> Result<Point3<f64>, LoadError> {
        let numbers = self.numbers::<3>()?;
        Ok(Point3::from(numbers))
    }

    /// A list of exactly `N` numbers.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], LoadError> {
        let mut numbers = [0.0; N];
        let mut count = 0;
        for item in self.items()? {
            if let Some(slot) = numbers.get_mut(count) {
                *slot = item.f64()?;
            }
            count += 1;
        }
        if count == N { Ok(numbers) } else { Err(self.wrong("a list of that many numbers")) }
    }

    /// `{"w","x","y","z"}`, normalised.
    pub fn quaternion(&self) -> Result<UnitQuaternion<f64>, LoadError> {
        let [w, x, y, z] = [self.get("w")?, self.get("x")?, self.get("y")?, self.get("z")?];
        let q = Quaternion::new(w.f64()?, x.f64()?, y.f64()?, z.f64()?);
        let norm = q.norm();
        // Already of unit length to rounding: keep the very numbers, so that load and save give the same file.
        if (norm - 1.0).abs() < 1e-12 {
            return Ok(UnitQuaternion::new_unchecked(q));
        }
        if norm.is_finite() && norm > 1e-6 {
            Ok(UnitQuaternion::new_normalize(q))
        } else {
            Err(self.wrong("a rotation"))
        }
    }

    /// `{"position": [x, y, z], "rotation": {w, x, y, z}}`.
    pub fn pose(&self) -> Result<Isometry3<f64>, LoadError> {
        let translation: Vector3<f64> = self.get("position")?.point()?.coords;
        Ok(Isometry3::from_parts(translation.into(), self.get("rotation")?.quaternion()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cursor_knows_its_path() {
        let value = parse(br#"{"a": [1, {"b": null, "c": [1, null, 3]}], "id": 18446744073709551615}"#).unwrap();
        let root = Cursor::root(&value);
        let a = root.get("a").unwrap();
        let second = a.items().unwrap().nth(1).unwrap();
        assert_eq!(second.get("b").unwrap_err().to_string(), "$.a[1].b is missing");
        assert_eq!(second.get("c").unwrap().point().unwrap_err().to_string(), "$.a[1].c[1] is not a finite number");
        assert_eq!(root.get("id").unwrap().u64().unwrap(), u64::MAX);
        assert!(root.get("a").unwrap().u64().is_err());
    }

    #[test]
    fn hostile_text_is_a_typed_error() {
        assert!(matches!(parse(b"{\"a\": [1,"), Err(LoadError::Truncated { .. })));
        assert!(matches!(parse(b"{\"a\": NaN}"), Err(LoadError::Syntax { .. })));
        assert!(matches!(parse("[".repeat(100_000).as_bytes()), Err(LoadError::Syntax { .. })));
        assert!(matches!(parse(b"{\"a\": 1e999}"), Err(LoadError::Syntax { .. })));
    }
}
