//! NumPy's `.npz`: a zip archive of `.npy` arrays. Little-endian numbers, C order, one or two dimensions.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use thiserror::Error;
use zip::ZipArchive;

/// Why an array cannot be read.
#[derive(Debug, Error)]
pub enum NpzError {
    /// The archive is truncated or no archive.
    #[error("not a whole zip archive: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// There is no such array.
    #[error("it holds no array {name}")]
    Missing {
        /// Name of the array.
        name: &'static str,
    },
    /// Reading failed midway.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The array does not begin like an `.npy` file, or says nothing that is understood.
    #[error("array {name} has no readable .npy header")]
    Header {
        /// Name of the array.
        name: &'static str,
    },
    /// The array holds other numbers than expected.
    #[error("array {name} is {found}; accepted is {expected}")]
    Type {
        /// Name of the array.
        name: &'static str,
        /// Type and shape found.
        found: String,
        /// What would be accepted.
        expected: &'static str,
    },
    /// The arrays of a scan have different lengths.
    #[error("array {name} has {found} entries for {expected} points")]
    Count {
        /// Name of the array.
        name: &'static str,
        /// Entries there.
        found: usize,
        /// Points of the scan.
        expected: usize,
    },
    /// The array is shorter or longer than its header says, or unreasonably large.
    #[error("array {name} holds {found} bytes where its header says {expected}")]
    Length {
        /// Name of the array.
        name: &'static str,
        /// Bytes there.
        found: u64,
        /// Bytes expected.
        expected: u64,
    },
}

/// Larger arrays are refused: no scan has ten million points.
const MAX_BYTES: u64 = 256 << 20;

/// An open archive.
pub struct Npz<R> {
    archive: ZipArchive<R>,
}

/// One array: its element type as NumPy writes it, its shape, its bytes.
struct Array {
    kind: String,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

impl Array {
    fn mismatch(&self, name: &'static str, expected: &'static str) -> NpzError {
        NpzError::Type { name, found: format!("{} of shape {:?}", self.kind, self.shape), expected }
    }
}

impl Npz<BufReader<File>> {
    /// Opens an archive.
    ///
    /// # Errors
    /// [`NpzError`] if there is none.
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        Npz::new(BufReader::new(File::open(path)?))
    }
}

impl<R: Read + Seek> Npz<R> {
    /// Reads the directory of an archive.
    ///
    /// # Errors
    /// [`NpzError::Archive`] if it is none.
    pub fn new(reader: R) -> Result<Self, NpzError> {
        Ok(Npz { archive: ZipArchive::new(reader)? })
    }

    /// An (N, 3) array of `<f4`.
    ///
    /// # Errors
    /// [`NpzError`].
    pub fn rows_of_three(&mut self, name: &'static str) -> Result<Vec<[f32; 3]>, NpzError> {
        let array = self.array(name)?;
        if array.kind != "<f4" || !matches!(array.shape[..], [_, 3]) {
            return Err(array.mismatch(name, "<f4 of shape (N, 3)"));
        }
        let number = |row: &[u8; 12], k: usize| f32::from_le_bytes([row[k], row[k + 1], row[k + 2], row[k + 3]]);
        let (rows, _) = array.bytes.as_chunks::<12>();
        Ok(rows.iter().map(|row| [number(row, 0), number(row, 4), number(row, 8)]).collect())
    }

    /// An (N,) array of `<f8` or `<f4`.
    ///
    /// # Errors
    /// [`NpzError`].
    pub fn doubles(&mut self, name: &'static str) -> Result<Vec<f64>, NpzError> {
        let array = self.array(name)?;
        match (array.kind.as_str(), array.shape.len()) {
            ("<f8", 1) => Ok(array.bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()),
            ("<f4", 1) => Ok(array.bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes).into()).collect()),
            _ => Err(array.mismatch(name, "<f8 or <f4 of shape (N,)")),
        }
    }

    /// An (N,) array of `|u1`.
    ///
    /// # Errors
    /// [`NpzError`].
    pub fn bytes(&mut self, name: &'static str) -> Result<Vec<u8>, NpzError> {
        let array = self.array(name)?;
        if array.kind != "|u1" || array.shape.len() != 1 {
            return Err(array.mismatch(name, "|u1 of shape (N,)"));
        }
        Ok(array.bytes)
    }

    fn array(&mut self, name: &'static str) -> Result<Array, NpzError> {
        let mut entry = match self.archive.by_name(&format!("{name}.npy")) {
            Err(zip::result::ZipError::FileNotFound) => return Err(NpzError::Missing { name }),
            entry => entry?,
        };
        let (kind, shape, size) = header(&mut entry).ok_or(NpzError::Header { name })?;
        let count = shape.iter().try_fold(1_u64, |product, &n| product.checked_mul(n as u64));
        let expected = count.and_then(|count| count.checked_mul(size)).unwrap_or(u64::MAX);
        if expected > MAX_BYTES {
            return Err(NpzError::Length { name, found: entry.size(), expected });
        }
        let mut bytes = Vec::new();
        // One byte more than expected, so that too long is seen as well.
        entry.take(expected + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 != expected {
            return Err(NpzError::Length { name, found: bytes.len() as u64, expected });
        }
        Ok(Array { kind, shape, bytes })
    }
}

/// Reads `\x93NUMPY`, version, length and the dictionary: element type, shape, bytes of an element.
fn header(reader: &mut impl Read) -> Option<(String, Vec<usize>, u64)> {
    let mut start = [0; 10];
    reader.read_exact(&mut start).ok()?;
    // Version 1 has a length of 16 bits; versions 2 and 3 only exist for headers longer than that.
    if &start[..7] != b"\x93NUMPY\x01" {
        return None;
    }
    let mut text = vec![0; usize::from(u16::from_le_bytes([start[8], start[9]]))];
    reader.read_exact(&mut text).ok()?;
    let text = String::from_utf8(text).ok()?;
    if !value_of(&text, "fortran_order")?.starts_with("False") {
        return None;
    }
    let kind = value_of(&text, "descr")?.strip_prefix('\'')?.split('\'').next()?.to_owned();
    let numbers = value_of(&text, "shape")?.strip_prefix('(')?.split(')').next()?;
    let numbers = numbers.split(',').map(str::trim).filter(|number| !number.is_empty());
    let shape = numbers.map(|number| number.parse().ok()).collect::<Option<Vec<usize>>>()?;
    let size = kind.get(2..)?.parse().ok()?;
    Some((kind, shape, size))
}

fn value_of<'a>(dictionary: &'a str, key: &str) -> Option<&'a str> {
    Some(dictionary.split_once(&format!("'{key}':"))?.1.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Cursor, Write};

    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend(data);
        bytes
    }

    fn npz(name: &str, array: &[u8]) -> Vec<u8> {
        let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        writer.start_file(name, options).unwrap();
        writer.write_all(array).unwrap();
        writer.finish().unwrap().into_inner()
    }

    #[test]
    fn an_array_as_numpy_writes_it() {
        let data: Vec<u8> = [1.5_f64, -2.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }    \n";
        let archive = npz("t.npy", &npy(header, &data));
        assert_eq!(Npz::new(Cursor::new(&archive)).unwrap().doubles("t").unwrap(), [1.5, -2.0]);
        assert!(matches!(Npz::new(Cursor::new(&archive)).unwrap().bytes("t"), Err(NpzError::Type { .. })));
        assert!(matches!(Npz::new(Cursor::new(&archive)).unwrap().bytes("x"), Err(NpzError::Missing { name: "x" })));
        assert!(Npz::new(Cursor::new(&archive[..archive.len() / 2])).is_err());
    }

    #[test]
    fn a_header_that_lies_is_refused() {
        let check = |header: &str| Npz::new(Cursor::new(npz("t.npy", &npy(header, &[0; 16])))).unwrap().doubles("t");
        let shape = |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}");
        assert_eq!(check(&shape("2,")).unwrap(), [0.0, 0.0]);
        assert!(matches!(check(&shape("3,")), Err(NpzError::Length { found: 16, expected: 24, .. })));
        assert!(matches!(check(&shape("1,")), Err(NpzError::Length { .. })));
        assert!(matches!(check(&shape("99999999999999999999,")), Err(NpzError::Header { .. })));
        assert!(matches!(check(&shape("4000000000,4000000000")), Err(NpzError::Length { .. })));
        assert!(matches!(check("no dictionary"), Err(NpzError::Header { .. })));
    }
}
