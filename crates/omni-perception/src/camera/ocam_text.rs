//! The text file of the OCamCalib toolbox (`ocam_calib_results.txt`).
//!
//! Lines that start with `#` and empty lines are skipped; five lines of numbers remain:
//! ```text
//! N a0 a1 ... a(N-1)      polynomial from radius to ray
//! M b0 b1 ... b(M-1)      its inverse, from angle to radius
//! row column              centre
//! c d e                   affine map
//! height width            size of the image
//! ```

use thiserror::Error;

use super::OcamCalibration;

/// Why a text is no calibration. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum OcamTextError {
    /// The text is longer than any calibration.
    #[error("the text has {bytes} bytes; a calibration has at most {MOST_BYTES}")]
    TooLong {
        /// Length of the text.
        bytes: usize,
    },
    /// A word is not a finite number.
    #[error("line {line}, word {word}: not a finite number")]
    NotANumber {
        /// Line of the text.
        line: usize,
        /// Word of the line, from 1.
        word: usize,
    },
    /// A line has more or fewer numbers than it must have.
    #[error("line {line}: {what} takes {expected} numbers, here are {found}")]
    Count {
        /// Line of the text.
        line: usize,
        /// What the line is.
        what: &'static str,
        /// How many numbers it must have.
        expected: usize,
        /// How many it has.
        found: usize,
    },
    /// The count in front of a polynomial is not a whole number from 1 to 64.
    #[error("line {line}: the number of coefficients of {what} must be a whole number from 1 to {MOST_COEFFICIENTS}")]
    Coefficients {
        /// Line of the text.
        line: usize,
        /// What the line is.
        what: &'static str,
    },
    /// The size is not made of whole numbers from 1 to 32768.
    #[error("line {line}: height and width must be whole numbers from 1 to 32768")]
    Size {
        /// Line of the text.
        line: usize,
    },
    /// The text ends too early.
    #[error("the text ends before {what}")]
    Missing {
        /// The first line that is missing.
        what: &'static str,
    },
    /// There is more than five lines of numbers.
    #[error("line {line}: nothing is expected after height and width")]
    TooMuch {
        /// Line of the text.
        line: usize,
    },
}

const MOST_BYTES: usize = 65_536;
const MOST_COEFFICIENTS: usize = 64;
const LINES: [&str; 5] =
    ["the polynomial", "the inverse polynomial", "the centre", "the affine parameters", "the image size"];

/// Reads a calibration. Whether its numbers make a camera is for [`super::Ocam::new`] to say.
///
/// # Errors
/// [`OcamTextError`] names the line and what would be accepted.
pub fn parse_ocam_text(text: &str) -> Result<OcamCalibration, OcamTextError> {
    if text.len() > MOST_BYTES {
        return Err(OcamTextError::TooLong { bytes: text.len() });
    }
    let mut lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let mut lines = lines.by_ref().filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let mut next = |what: &'static str| -> Result<(usize, Vec<f64>), OcamTextError> {
        let (line, words) = lines.next().ok_or(OcamTextError::Missing { what })?;
        let number = |(word, text): (usize, &str)| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(OcamTextError::NotANumber { line, word: word + 1 }),
        };
        Ok((line, words.split_whitespace().enumerate().map(number).collect::<Result<_, _>>()?))
    };
    let polynomial = counted(next(LINES[0])?, LINES[0])?;
    let inverse_polynomial = counted(next(LINES[1])?, LINES[1])?;
    let centre_row_column_px = exactly::<2>(next(LINES[2])?, LINES[2])?;
    let affine = exactly::<3>(next(LINES[3])?, LINES[3])?;
    let (line, numbers) = next(LINES[4])?;
    let [height_px, width_px] = exactly::<2>((line, numbers), LINES[4])?.map(|size| {
        let is_size = size.fract() == 0.0 && (1.0..=32768.0).contains(&size);
        is_size.then_some(size as u32).ok_or(OcamTextError::Size { line })
    });
    let (height_px, width_px) = (height_px?, width_px?);
    if let Some((line, _)) = lines.next() {
        return Err(OcamTextError::TooMuch { line });
    }
    Ok(OcamCalibration { width_px, height_px, polynomial, inverse_polynomial, centre_row_column_px, affine })
}

/// Numbers behind their count.
fn counted((line, numbers): (usize, Vec<f64>), what: &'static str) -> Result<Vec<f64>, OcamTextError> {
    let count = numbers.first().copied().unwrap_or(0.0);
    if count.fract() != 0.0 || !(1.0..=MOST_COEFFICIENTS as f64).contains(&count) {
        return Err(OcamTextError::Coefficients { line, what });
    }
    let (expected, found) = (count as usize, numbers.len() - 1);
    if expected != found {
        return Err(OcamTextError::Count { line, what, expected, found });
    }
    Ok(numbers[1..].to_vec())
}

fn exactly<const N: usize>((line, numbers): (usize, Vec<f64>), what: &'static str) -> Result<[f64; N], OcamTextError> {
    let found = numbers.len();
    numbers.try_into().map_err(|_| OcamTextError::Count { line, what, expected: N, found })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# direct\n\n3 -1.0e+002 0 2.5e-003\n\n#inverse\n2 10.5 -3\n#centre\n199.5 249.5\n\
        # affine\n1.0 0.0 0.0\n#size\n400 500\n";

    #[test]
    fn five_lines_of_numbers() {
        let read = parse_ocam_text(TEXT).expect("sound");
        assert_eq!((read.height_px, read.width_px), (400, 500));
        assert_eq!(read.polynomial, [-100.0, 0.0, 0.0025]);
        assert_eq!(read.inverse_polynomial, [10.5, -3.0]);
        assert_eq!((read.centre_row_column_px, read.affine), ([199.5, 249.5], [1.0, 0.0, 0.0]));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let check = |from: &str, to: &str, expected: OcamTextError| {
            assert!(TEXT.contains(from));
            assert_eq!(parse_ocam_text(&TEXT.replace(from, to)), Err(expected));
        };
        check("10.5 -3", "10.5 minus", OcamTextError::NotANumber { line: 6, word: 3 });
        check("10.5 -3", "10.5 NaN", OcamTextError::NotANumber { line: 6, word: 3 });
        let count = |line, what, expected, found| OcamTextError::Count { line, what, expected, found };
        check("10.5 -3", "10.5", count(6, "the inverse polynomial", 2, 1));
        check("199.5 249.5", "199.5", count(8, "the centre", 2, 1));
        check("2 10.5", "2.5 10.5", OcamTextError::Coefficients { line: 6, what: "the inverse polynomial" });
        check("2 10.5", "1e18 10.5", OcamTextError::Coefficients { line: 6, what: "the inverse polynomial" });
        check("400 500", "400 -500", OcamTextError::Size { line: 12 });
        check("400 500\n", "", OcamTextError::Missing { what: "the image size" });
        check("400 500\n", "400 500\n7\n", OcamTextError::TooMuch { line: 13 });
        assert_eq!(parse_ocam_text(""), Err(OcamTextError::Missing { what: "the polynomial" }));
        let long = "#".repeat(MOST_BYTES + 1);
        assert_eq!(parse_ocam_text(&long), Err(OcamTextError::TooLong { bytes: MOST_BYTES + 1 }));
    }
}
