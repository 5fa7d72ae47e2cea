//! A `PointCloud2` as a scan: any order of fields, any type of number, either byte order.
//!
//! Positions are passed on as they are, NaN included: whoever straightens the scan leaves such points out and counts them.
//! Only points whose time is unusable are left out here. Drivers write rays without return as points at zero or NaN, often
//! with a time of zero: that is no time of the scan and no loss.

use nalgebra::Point3;
use omni_perception::{RawPoint, RawScan};

use super::error::CloudFault;
use super::point_times::{PointTimes, TIME_FIELDS};
use super::ros_messages::PointCloud2;

/// Names of the field that holds the beam, best first.
const RING_FIELDS: [&str; 4] = ["ring", "line", "channel", "laser_id"];

/// Where a number lies in a point and how it is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Field {
    offset: usize,
    number: Number,
}

/// Types of numbers, by their codes in `sensor_msgs/PointField`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn from_code(code: u8) -> Option<Number> {
        use Number::*;
        [I8, U8, I16, U16, I32, U32, F32, F64].get(usize::from(code).checked_sub(1)?).copied()
    }

    fn size(self) -> usize {
        match self {
            Number::I8 | Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }
}

impl Field {
    /// The number in a point; the field was checked to lie inside it.
    fn read(self, point: &[u8], is_bigendian: bool) -> f64 {
        macro_rules! number {
            ($type:ty) => {{
                let mut bytes = [0; size_of::<$type>()];
                bytes.copy_from_slice(&point[self.offset..self.offset + size_of::<$type>()]);
                f64::from(if is_bigendian { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
            }};
        }
        match self.number {
            Number::I8 => number!(i8),
            Number::U8 => number!(u8),
            Number::I16 => number!(i16),
            Number::U16 => number!(u16),
            Number::I32 => number!(i32),
            Number::U32 => number!(u32),
            Number::F32 => number!(f32),
            Number::F64 => number!(f64),
        }
    }
}

/// The points of a cloud, checked to be there.
struct Points<'a> {
    data: &'a [u8],
    step: usize,
    is_bigendian: bool,
    position: [Field; 3],
}

impl Points<'_> {
    fn position(&self, point: &[u8]) -> Point3<f32> {
        Point3::from(self.position.map(|axis| axis.read(point, self.is_bigendian) as f32))
    }
}

/// Whether a ray came back: its position is finite and not the sensor's own.
fn is_return(position: &Point3<f32>) -> bool {
    position.iter().all(|value| value.is_finite()) && position.coords != nalgebra::Vector3::zeros()
}

/// The time field of a cloud: the first name of [`TIME_FIELDS`] that it has.
pub fn time_field(cloud: &PointCloud2<'_>) -> Option<String> {
    TIME_FIELDS.iter().find(|name| cloud.fields.iter().any(|field| field.name == **name)).map(|name| (*name).to_owned())
}

/// Smallest and largest value of a field over the rays that came back. `None` if there is none.
///
/// # Errors
/// [`CloudFault`] if the cloud is unsound.
pub fn range_of(cloud: &PointCloud2<'_>, name: &str) -> Result<Option<(f64, f64)>, CloudFault> {
    let points = points_of(cloud)?;
    let field = find(cloud, name)?.ok_or(CloudFault::NoTime)?;
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    for point in points.data.chunks_exact(points.step) {
        let value = field.read(point, points.is_bigendian);
        if value.is_finite() && is_return(&points.position(point)) {
            (min, max) = (min.min(value), max.max(value));
        }
    }
    Ok((min <= max).then_some((min, max)))
}

/// The cloud as a scan, and the number of points left out because they have no usable time. Without `times` all points are
/// taken to be measured at the header's stamp.
///
/// The scan starts at the header's stamp, or at its first point if that is earlier.
///
/// # Errors
/// [`CloudFault`] if the cloud is unsound.
pub fn scan_of(cloud: &PointCloud2<'_>, times: Option<&PointTimes>) -> Result<(RawScan, usize), CloudFault> {
    let points = points_of(cloud)?;
    let time = match times {
        Some(times) => Some((find(cloud, &times.field)?.ok_or(CloudFault::NoTime)?, times)),
        None => None,
    };
    let ring = RING_FIELDS.iter().find_map(|name| find(cloud, name).transpose()).transpose()?;

    let header = cloud.header.stamp;
    let mut found: Vec<(i64, RawPoint)> = Vec::with_capacity(points.data.len() / points.step);
    let (mut first_ns, mut without_time) = (0, 0);
    for point in points.data.chunks_exact(points.step) {
        let after_header_ns = match time {
            None => Some(0),
            Some((field, times)) => times.after_header_ns(field.read(point, points.is_bigendian), header),
        };
        let position = points.position(point);
        let Some(after_header_ns) = after_header_ns else {
            without_time += usize::from(is_return(&position));
            continue;
        };
        first_ns = first_ns.min(after_header_ns);
        let ring = ring.map_or(0, |field| field.read(point, points.is_bigendian) as u16);
        found.push((after_header_ns, RawPoint { position, offset_ns: 0, ring }));
    }
    let with_offset = |(after_header_ns, point): (i64, RawPoint)| RawPoint {
        // Both lie within two seconds of the header: the difference fits.
        offset_ns: (after_header_ns - first_ns) as u32,
        ..point
    };
    let scan =
        RawScan { start: header.stamp().plus_ns(first_ns), points: found.into_iter().map(with_offset).collect() };
    Ok((scan, without_time))
}

fn points_of<'a>(cloud: &PointCloud2<'a>) -> Result<Points<'a>, CloudFault> {
    let axis = |name| match find(cloud, name)? {
        Some(field) if matches!(field.number, Number::F32 | Number::F64) => Ok(field),
        _ => Err(CloudFault::NoPosition),
    };
    let position = [axis("x")?, axis("y")?, axis("z")?];
    let step = cloud.point_step as usize;
    let points = u64::from(cloud.width) * u64::from(cloud.height);
    let bytes = points.checked_mul(step as u64).and_then(|bytes| usize::try_from(bytes).ok());
    match bytes {
        Some(bytes) if bytes <= cloud.data.len() => {
            Ok(Points { data: &cloud.data[..bytes], step, is_bigendian: cloud.is_bigendian, position })
        }
        _ => Err(CloudFault::Cut { points, bytes: cloud.data.len() }),
    }
}

/// A field by name, `None` if there is none of the name or its type is unknown.
fn find(cloud: &PointCloud2<'_>, name: &str) -> Result<Option<Field>, CloudFault> {
    let Some(field) = cloud.fields.iter().find(|field| field.name == name) else { return Ok(None) };
    let Some(number) = Number::from_code(field.datatype) else { return Ok(None) };
    let end = u64::from(field.offset) + number.size() as u64;
    if end > u64::from(cloud.point_step) {
        return Err(CloudFault::Layout);
    }
    Ok(Some(Field { offset: field.offset as usize, number }))
}

#[cfg(test)]
mod tests {
    use super::super::point_times::{TimeUnit, TimeZero};
    use super::super::ros_messages::{Header, PointField, Time};
    use super::*;
    use omni_perception::Stamp;

    fn field(name: &str, offset: u32, datatype: u8) -> PointField {
        PointField { name: name.into(), offset, datatype, count: 1 }
    }

    /// Fields in an odd order, doubles for positions, microseconds in a u32, a ring of 8 bits.
    fn cloud(data: &[u8], width: u32) -> PointCloud2<'_> {
        PointCloud2 {
            header: Header { stamp: Time { sec: 5, nanosec: 0 }, frame_id: "lidar".into() },
            height: 1,
            width,
            fields: vec![
                field("line", 0, 2),
                field("t", 1, 6),
                field("z", 5, 8),
                field("y", 13, 8),
                field("x", 21, 8),
                field("odd", 0, 77),
            ],
            point_step: 30,
            row_step: 30 * width,
            data,
            ..PointCloud2::default()
        }
    }

    fn point(ring: u8, t: u32, [x, y, z]: [f64; 3]) -> Vec<u8> {
        let mut bytes = vec![ring];
        bytes.extend(t.to_le_bytes());
        [z, y, x].iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes.push(0xee); // padding
        bytes
    }

    #[test]
    fn any_layout_gives_the_same_scan() {
        let data =
            [point(3, 40_000, [1.0, 2.0, 3.0]), point(200, 0, [f64::NAN, 0.0, 0.0]), point(1, 4_000_000_000, [1.0; 3])]
                .concat();
        let cloud = cloud(&data, 3);
        assert_eq!(time_field(&cloud).as_deref(), Some("t"));
        assert_eq!(range_of(&cloud, "t"), Ok(Some((40_000.0, 4e9))), "the NaN point's time does not count");
        let times = PointTimes { field: "t".into(), unit: TimeUnit::Microseconds, zero: TimeZero::Header };
        let (scan, without_time) = scan_of(&cloud, Some(&times)).unwrap();
        assert_eq!((scan.start, scan.points.len(), without_time), (Stamp(5_000_000_000), 2, 1));
        assert_eq!(scan.points[0], RawPoint { position: Point3::new(1.0, 2.0, 3.0), offset_ns: 40_000_000, ring: 3 });
        assert!(scan.points[1].position.x.is_nan());
    }

    #[test]
    fn a_stamp_at_the_end_gives_a_start_before_it() {
        let seconds: Vec<u8> = [[1.0_f32, 0.0, 0.0, -0.1], [2.0, 0.0, 0.0, 0.0]]
            .as_flattened()
            .iter()
            .flat_map(|v| v.to_be_bytes())
            .collect();
        let cloud = PointCloud2 {
            header: Header { stamp: Time { sec: 5, nanosec: 0 }, ..Header::default() },
            height: 2,
            width: 1,
            fields: ["x", "y", "z", "time"].iter().zip(0..).map(|(name, k)| field(name, 4 * k, 7)).collect(),
            is_bigendian: true,
            point_step: 16,
            row_step: 16,
            data: &seconds,
            is_dense: true,
        };
        let times = PointTimes { field: "time".into(), unit: TimeUnit::Seconds, zero: TimeZero::Header };
        let (scan, _) = scan_of(&cloud, Some(&times)).unwrap();
        assert_eq!(scan.start, Stamp(4_899_999_999), "a tenth of a second as a single float, to the nanosecond");
        assert_eq!((scan.points[0].offset_ns, scan.points[1].offset_ns), (0, 100_000_001));
        let (flat, _) = scan_of(&cloud, None).unwrap();
        assert_eq!(flat.start, Stamp(5_000_000_000));
    }

    #[test]
    fn unsound_clouds_are_refused() {
        let data = point(0, 0, [0.0; 3]);
        let times = PointTimes { field: "t".into(), unit: TimeUnit::Microseconds, zero: TimeZero::Header };
        let check = |change: &dyn Fn(&mut PointCloud2<'_>), expected| {
            let mut cloud = cloud(&data, 1);
            change(&mut cloud);
            assert_eq!(scan_of(&cloud, Some(&times)).unwrap_err(), expected);
        };
        check(&|cloud| cloud.width = 2, CloudFault::Cut { points: 2, bytes: 30 });
        check(
            &|cloud| (cloud.width, cloud.height) = (u32::MAX, u32::MAX),
            CloudFault::Cut { points: u64::from(u32::MAX).pow(2), bytes: 30 },
        );
        check(&|cloud| cloud.point_step = 28, CloudFault::Layout);
        check(&|cloud| cloud.point_step = 0, CloudFault::Layout);
        check(&|cloud| cloud.fields[2].offset = u32::MAX, CloudFault::Layout);
        check(&|cloud| cloud.fields[2].name = "w".into(), CloudFault::NoPosition);
        check(&|cloud| cloud.fields[1].name = "w".into(), CloudFault::NoTime);
    }
}
