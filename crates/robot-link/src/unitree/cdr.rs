//! Plain CDR (XCDR1), little endian: the payload of a DDS sample.
//!
//! A header of four bytes (00 01, two option bytes), then the fields in order, each aligned to its own size counted from behind the
//! header. A string is its length with the closing NUL (u32), its bytes, NUL; a sequence of bytes its length (u32) and its bytes.

/// Encapsulation header of plain CDR, little endian.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Why a payload was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// The encapsulation header is not that of plain little-endian CDR.
    #[error("the payload is not plain little-endian CDR (it must begin with 00 01)")]
    Encapsulation,
    /// The payload ends inside a field, or a length says so.
    #[error("the payload ends inside a field at byte {at}")]
    CutOff {
        /// Offset behind the header.
        at: usize,
    },
    /// A string without closing NUL or not UTF-8.
    #[error("the string at byte {at} is not NUL-terminated UTF-8")]
    BadString {
        /// Offset behind the header.
        at: usize,
    },
    /// A truth value that is neither 0 nor 1.
    #[error("the truth value at byte {at} is neither 0 nor 1")]
    BadBool {
        /// Offset behind the header.
        at: usize,
    },
}

/// Writes fields one after the other.
#[derive(Debug, Clone, Default)]
pub struct CdrWriter {
    body: Vec<u8>,
}

impl CdrWriter {
    /// A payload without fields.
    pub fn new() -> Self {
        Self::default()
    }

    /// A number as its little-endian bytes, aligned to their count.
    pub fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.body.resize(self.body.len().next_multiple_of(N), 0);
        self.body.extend(bytes);
    }

    /// A truth value.
    pub fn bool(&mut self, value: bool) {
        self.number([u8::from(value)]);
    }

    /// A string.
    pub fn string(&mut self, text: &str) {
        self.number((text.len() as u32 + 1).to_le_bytes());
        self.body.extend(text.as_bytes());
        self.body.push(0);
    }

    /// A sequence of bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.number((bytes.len() as u32).to_le_bytes());
        self.body.extend(bytes);
    }

    /// The payload with its header.
    pub fn finish(self) -> Vec<u8> {
        let mut payload = HEADER.to_vec();
        payload.extend(self.body);
        payload
    }
}

/// Reads fields one after the other.
#[derive(Debug, Clone)]
pub struct CdrReader<'a> {
    body: &'a [u8],
    at: usize,
}

impl<'a> CdrReader<'a> {
    /// Begins behind the header; the option bytes are not looked at.
    ///
    /// # Errors
    /// [`CdrError::Encapsulation`].
    pub fn new(payload: &'a [u8]) -> Result<Self, CdrError> {
        match payload {
            [0, 1, _, _, body @ ..] => Ok(Self { body, at: 0 }),
            _ => Err(CdrError::Encapsulation),
        }
    }

    /// The little-endian bytes of a number.
    ///
    /// # Errors
    /// [`CdrError::CutOff`].
    pub fn number<const N: usize>(&mut self) -> Result<[u8; N], CdrError> {
        let start = self.at.next_multiple_of(N);
        let bytes = self.body.get(start..start + N).and_then(|slice| slice.try_into().ok());
        self.at = start + N;
        bytes.ok_or(CdrError::CutOff { at: start })
    }

    /// Floats.
    ///
    /// # Errors
    /// [`CdrError::CutOff`].
    pub fn floats<const N: usize>(&mut self) -> Result<[f32; N], CdrError> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f32::from_le_bytes(self.number()?);
        }
        Ok(out)
    }

    /// A truth value.
    ///
    /// # Errors
    /// [`CdrError::CutOff`], [`CdrError::BadBool`].
    pub fn bool(&mut self) -> Result<bool, CdrError> {
        match self.number::<1>()? {
            [0] => Ok(false),
            [1] => Ok(true),
            _ => Err(CdrError::BadBool { at: self.at - 1 }),
        }
    }

    /// A string. An empty one may also come as length 0, without NUL.
    ///
    /// # Errors
    /// [`CdrError::CutOff`], [`CdrError::BadString`].
    pub fn string(&mut self) -> Result<String, CdrError> {
        let bytes = self.bytes()?;
        let bad = CdrError::BadString { at: self.at - bytes.len() };
        let text = match bytes {
            [] => bytes,
            [text @ .., 0] => text,
            _ => return Err(bad),
        };
        std::str::from_utf8(text).map(str::to_owned).map_err(|_| bad)
    }

    /// A sequence of bytes. The length is checked against what is there before anything is copied.
    ///
    /// # Errors
    /// [`CdrError::CutOff`].
    pub fn bytes(&mut self) -> Result<&'a [u8], CdrError> {
        let length = u32::from_le_bytes(self.number()?) as usize;
        let cut_off = CdrError::CutOff { at: self.at };
        let end = self.at.checked_add(length).ok_or(cut_off)?;
        let bytes = self.body.get(self.at..end).ok_or(cut_off)?;
        self.at = end;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_aligned_behind_the_header() {
        let mut writer = CdrWriter::new();
        writer.number([1u8]);
        writer.number(2u64.to_le_bytes());
        writer.bool(true);
        writer.number(3u16.to_le_bytes());
        let payload = writer.finish();
        assert_eq!(payload[4..].len(), 8 + 8 + 4);
        let mut reader = CdrReader::new(&payload).expect("our header");
        assert_eq!(reader.number(), Ok([1u8]));
        assert_eq!(reader.number(), Ok(2u64.to_le_bytes()));
        assert_eq!(reader.bool(), Ok(true));
        assert_eq!(reader.number(), Ok(3u16.to_le_bytes()));
        assert_eq!(reader.number::<1>(), Err(CdrError::CutOff { at: 20 }));
    }

    #[test]
    fn lying_lengths_are_refused() {
        let lie = [0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, b'a'];
        assert_eq!(CdrReader::new(&lie).and_then(|mut reader| reader.string()), Err(CdrError::CutOff { at: 4 }));
        let open = [0, 1, 0, 0, 1, 0, 0, 0, b'a'];
        assert_eq!(CdrReader::new(&open).and_then(|mut reader| reader.string()), Err(CdrError::BadString { at: 4 }));
        assert!(matches!(CdrReader::new(&[0, 0, 0, 0]), Err(CdrError::Encapsulation)));
        assert!(matches!(CdrReader::new(&[0]), Err(CdrError::Encapsulation)));
    }
}
