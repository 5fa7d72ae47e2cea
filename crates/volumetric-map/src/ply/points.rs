//! The points of a PLY file, whoever wrote it: ascii or binary little-endian, coordinates as float or double.

use std::io::{BufRead, BufReader, Read};

use nalgebra::Point3;

use super::{Element, Format, Header, Kind, PlyError, Scalar};

/// Room is made for so many points before any is read: what a header declares is not to be trusted.
const FIRST_ROOM: usize = 1 << 16;
/// Longest line of an ascii file.
const LONGEST_LINE: u64 = 1 << 16;

/// Reads the vertices of a PLY file; other properties and elements are skipped. Coordinates that are not finite are kept, for their
/// number is the caller's to report.
///
/// # Errors
/// [`PlyError`] names the header line, the line or the vertex that cannot be read.
pub fn read_ply_points(input: impl Read) -> Result<Vec<Point3<f64>>, PlyError> {
    let mut input = BufReader::new(input);
    let header = Header::read(&mut input)?;
    let mut line = header.lines;
    for element in &header.elements {
        match (element.name == "vertex", header.format) {
            (true, Format::Binary) => return binary_points(&mut input, element),
            (true, Format::Ascii) => return ascii_points(&mut input, element, &mut line),
            (false, Format::Binary) => skip_binary(&mut input, element)?,
            (false, Format::Ascii) => {
                for _ in 0..element.count {
                    next_line(&mut input, &mut line)?;
                }
            }
        }
    }
    Err(PlyError::NoPosition)
}

/// Which properties are x, y and z.
fn positions(element: &Element) -> Result<[usize; 3], PlyError> {
    if let Some(list) = element.properties.iter().find(|property| matches!(property.kind, Kind::List(..))) {
        return Err(PlyError::Unsupported { line: list.line });
    }
    let find = |name: &str| {
        element.properties.iter().position(|property| {
            property.name == name && matches!(property.kind, Kind::Scalar(Scalar::F32 | Scalar::F64))
        })
    };
    match [find("x"), find("y"), find("z")] {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err(PlyError::NoPosition),
    }
}

fn binary_points(input: &mut impl Read, element: &Element) -> Result<Vec<Point3<f64>>, PlyError> {
    let wanted = positions(element)?;
    let mut offsets = vec![0];
    for property in &element.properties {
        let Kind::Scalar(scalar) = property.kind else { unreachable!("positions() refuses lists") };
        offsets.push(offsets[offsets.len() - 1] + scalar.size());
    }
    let mut row = vec![0u8; offsets[offsets.len() - 1]];
    let mut points = Vec::with_capacity(element.count.min(FIRST_ROOM));
    for vertex in 0..element.count {
        input.read_exact(&mut row).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => PlyError::Vertex { vertex, of: element.count },
            _ => PlyError::Io(error),
        })?;
        points.push(Point3::from(wanted.map(|rank| real(&row[offsets[rank]..offsets[rank + 1]]))));
    }
    Ok(points)
}

/// A float or a double; the length says which.
fn real(bytes: &[u8]) -> f64 {
    match *bytes {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    }
}

fn ascii_points(input: &mut impl BufRead, element: &Element, line: &mut usize) -> Result<Vec<Point3<f64>>, PlyError> {
    let wanted = positions(element)?;
    let mut points = Vec::with_capacity(element.count.min(FIRST_ROOM));
    for vertex in 0..element.count {
        let text = match next_line(input, line) {
            Err(PlyError::Io(error)) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
                return Err(PlyError::Vertex { vertex, of: element.count });
            }
            other => other?,
        };
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.len() != element.properties.len() {
            return Err(PlyError::Row { line: *line });
        }
        let mut point = Point3::origin();
        for (axis, rank) in wanted.into_iter().enumerate() {
            point[axis] = words[rank].parse().map_err(|_| PlyError::Row { line: *line })?;
        }
        points.push(point);
    }
    Ok(points)
}

/// The next line that is not empty.
fn next_line(input: &mut impl BufRead, line: &mut usize) -> Result<String, PlyError> {
    loop {
        let mut bytes = Vec::new();
        *line += 1;
        if input.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut bytes)? == 0 {
            return Err(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into());
        }
        let text = String::from_utf8(bytes).map_err(|_| PlyError::Row { line: *line })?;
        if !text.trim().is_empty() {
            return Ok(text);
        }
    }
}

/// Reads over the rows of an element that comes before the vertices.
fn skip_binary(input: &mut impl Read, element: &Element) -> Result<(), PlyError> {
    let mut buffer = [0u8; 8];
    for _ in 0..element.count {
        for property in &element.properties {
            match property.kind {
                Kind::Scalar(scalar) => input.read_exact(&mut buffer[..scalar.size()])?,
                Kind::List(count, item) => {
                    input.read_exact(&mut buffer[..count.size()])?;
                    for _ in 0..count.whole(&buffer[..count.size()]) {
                        input.read_exact(&mut buffer[..item.size()])?;
                    }
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const HEAD: &str = "ply\nformat ascii 1.0\ncomment c\nelement vertex 2\nproperty uchar intensity\nproperty float x\nproperty double y\nproperty float z\n";

    fn ascii(rows: &str) -> Result<Vec<Point3<f64>>, PlyError> {
        read_ply_points(format!("{HEAD}end_header\n{rows}").as_bytes())
    }

    #[test]
    fn ascii_rows_are_read_in_the_order_of_the_properties() {
        let points = ascii("7 1.5 -2 3e1\n\n8 0 0.25 -0\n").unwrap();
        assert_eq!(points, [Point3::new(1.5, -2.0, 30.0), Point3::new(0.0, 0.25, 0.0)]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        assert!(matches!(ascii("7 1 2 3\n"), Err(PlyError::Vertex { vertex: 1, of: 2 })));
        assert!(matches!(ascii("7 1 2 3\n7 1 2\n"), Err(PlyError::Row { line: 11 })));
        assert!(matches!(ascii("7 1 2 3\n7 1 two 3\n"), Err(PlyError::Row { line: 11 })));
        let ints = HEAD.replace("float x", "int x");
        assert!(matches!(read_ply_points(format!("{ints}end_header\n").as_bytes()), Err(PlyError::NoPosition)));
        let big = HEAD.replace("ascii", "binary_big_endian");
        assert!(matches!(read_ply_points(format!("{big}end_header\n").as_bytes()), Err(PlyError::Format)));
        let list = HEAD.replace("double y", "list uchar float y");
        assert!(matches!(
            read_ply_points(format!("{list}end_header\n").as_bytes()),
            Err(PlyError::Unsupported { line: 7 })
        ));
        let many = HEAD.replace("vertex 2", "vertex 4000000000").replace("ascii", "binary_little_endian");
        assert!(matches!(
            read_ply_points(format!("{many}end_header\n").as_bytes()),
            Err(PlyError::Vertex { vertex: 0, of: 4_000_000_000 })
        ));
        assert!(matches!(read_ply_points(&b"solid"[..]), Err(PlyError::NotPly)));
    }

    proptest! {
        /// Floats and doubles, with other things before and between, come back bit for bit.
        #[test]
        fn binary_points_come_back(cloud in proptest::collection::vec((any::<f32>(), any::<f64>(), any::<f32>(), any::<u16>()), 0..20)) {
            let mut bytes = format!(
                "ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty list uchar short k\nelement vertex {}\nproperty float x\nproperty ushort ring\nproperty double y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n",
                cloud.len()
            ).into_bytes();
            bytes.extend([2, 1, 0, 2, 0]);
            for (x, y, z, ring) in &cloud {
                bytes.extend(x.to_le_bytes());
                bytes.extend(ring.to_le_bytes());
                bytes.extend(y.to_le_bytes());
                bytes.extend(z.to_le_bytes());
            }
            let points = read_ply_points(&bytes[..]).unwrap();
            prop_assert_eq!(points.len(), cloud.len());
            for (point, (x, y, z, _)) in points.iter().zip(&cloud) {
                let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
                prop_assert!(same(point.x, f64::from(*x)) && same(point.y, *y) && same(point.z, f64::from(*z)));
            }
            let cut = bytes.len().saturating_sub(1);
            if !cloud.is_empty() {
                prop_assert!(read_ply_points(&bytes[..cut]).is_err());
            }
        }

        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400), is_ascii in any::<bool>()) {
            let format = if is_ascii { "ascii" } else { "binary_little_endian" };
            let mut file = format!("ply\nformat {format} 1.0\nelement vertex 9\nproperty float x\nproperty float y\nproperty float z\nend_header\n").into_bytes();
            file.extend(&bytes);
            let _ = read_ply_points(&file[..]);
            let _ = read_ply_points(&bytes[..]);
        }
    }
}
