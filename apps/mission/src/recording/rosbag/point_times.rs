//! When each point of a cloud was measured, whatever the driver calls it.
//!
//! Drivers disagree about the name of the field, its unit, its type, and what its zero is (the header's stamp or 1970), and
//! the message says none of it. But a sweep lasts between [`SHORTEST_S`] and [`LONGEST_S`], and these are a factor of a
//! thousand apart, as the units are: at most one unit makes a sweep of a span. The decision is taken once, from the first
//! scans together (one that is cut short or holds a wild value would mislead), and holds for the whole recording.

use super::error::BagError;
use super::ros_messages::Time;

/// Names of the field, best first.
pub const TIME_FIELDS: [&str; 8] =
    ["time", "t", "timestamp", "timestamps", "offset_time", "time_offset", "point_time_offset", "time_stamp"];
/// Shortest sweep, inclusive.
pub const SHORTEST_S: f64 = 0.002;
/// Longest sweep, exclusive.
pub const LONGEST_S: f64 = 2.0;
/// A sweep is at least this part of the time between scans, where that is known ...
const SMALLEST_PART: f64 = 0.02;
/// ... and at most this.
const LARGEST_PART: f64 = 1.5;

/// Unit of the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeUnit {
    /// 1 s.
    Seconds,
    /// 10^-3 s.
    Milliseconds,
    /// 10^-6 s.
    Microseconds,
    /// 10^-9 s.
    Nanoseconds,
}

impl TimeUnit {
    const ALL: [TimeUnit; 4] =
        [TimeUnit::Seconds, TimeUnit::Milliseconds, TimeUnit::Microseconds, TimeUnit::Nanoseconds];

    /// Nanoseconds in one.
    pub fn nanoseconds(self) -> f64 {
        match self {
            TimeUnit::Seconds => 1e9,
            TimeUnit::Milliseconds => 1e6,
            TimeUnit::Microseconds => 1e3,
            TimeUnit::Nanoseconds => 1.0,
        }
    }
}

/// What the field counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeZero {
    /// The header's stamp; values may be negative where the stamp is that of the scan's end.
    Header,
    /// The zero of the clock in which the header is given.
    Clock,
}

/// How to read the field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PointTimes {
    /// Its name.
    pub field: String,
    /// Its unit.
    pub unit: TimeUnit,
    /// Its zero.
    pub zero: TimeZero,
}

/// The times of one scan, as they stand in the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanTimes {
    /// Stamp of the header.
    pub header: Time,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
}

impl PointTimes {
    /// Decides from some scans of a topic. `scans` must not be empty.
    ///
    /// # Errors
    /// [`BagError::TimeSpan`] if no unit makes sweeps of the spans, [`BagError::TimeReference`] if the zero is unclear.
    pub fn decide(topic: &str, field: &str, scans: &[ScanTimes]) -> Result<PointTimes, BagError> {
        let span = median(scans.iter().map(|scan| scan.max - scan.min).collect()).unwrap_or(0.0);
        let period_s = median_period_s(scans);
        let is_sweep = |unit: &TimeUnit| {
            let sweep_s = span * unit.nanoseconds() * 1e-9;
            let fits = |period_s: f64| (SMALLEST_PART..=LARGEST_PART).contains(&(sweep_s / period_s));
            (SHORTEST_S..LONGEST_S).contains(&sweep_s) && period_s.is_none_or(fits)
        };
        let Some(unit) = TimeUnit::ALL.into_iter().find(is_sweep) else {
            return Err(BagError::TimeSpan { topic: topic.to_owned(), field: field.to_owned(), span, period_s });
        };
        for zero in [TimeZero::Header, TimeZero::Clock] {
            let times = PointTimes { field: field.to_owned(), unit, zero };
            let is_near = |scan: &ScanTimes| {
                [scan.min, scan.max].iter().all(|value| times.after_header_ns(*value, scan.header).is_some())
            };
            if 2 * scans.iter().filter(|scan| is_near(scan)).count() > scans.len() {
                return Ok(times);
            }
        }
        let to_s = unit.nanoseconds() * 1e-9;
        Err(BagError::TimeReference {
            topic: topic.to_owned(),
            field: field.to_owned(),
            min_s: scans[0].min * to_s,
            max_s: scans[0].max * to_s,
            header_s: scans[0].header.stamp().0 as f64 * 1e-9,
        })
    }

    /// Nanoseconds after the header's stamp; `None` if the value is not finite or farther than [`LONGEST_S`] from it.
    pub fn after_header_ns(&self, value: f64, header: Time) -> Option<i64> {
        let ns = match (self.zero, self.unit) {
            (TimeZero::Header, unit) => value * unit.nanoseconds(),
            // Seconds since 1970 fill a double: subtract before multiplying.
            (TimeZero::Clock, TimeUnit::Seconds) => (value - f64::from(header.sec)) * 1e9 - f64::from(header.nanosec),
            (TimeZero::Clock, unit) => {
                // Whole numbers, so that nothing is lost beside the stamp; a float out of range is held at the border.
                let per_unit = unit.nanoseconds() as i128;
                let whole = i128::from(value as i64) * per_unit;
                let part = value.fract() * unit.nanoseconds();
                (whole - i128::from(header.stamp().0)) as f64 + part
            }
        };
        (ns.abs() < LONGEST_S * 1e9).then(|| ns.round() as i64)
    }
}

/// Median time between the headers of consecutive scans; `None` for one scan or headers that do not advance.
fn median_period_s(scans: &[ScanTimes]) -> Option<f64> {
    let period_s = |pair: &[ScanTimes]| pair[1].header.stamp().seconds_since(pair[0].header.stamp());
    median(scans.windows(2).map(period_s).collect()).filter(|period_s| *period_s > 0.0)
}

/// The middle one, of an even number the lower; `None` of none.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len().checked_sub(1)? / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use omni_perception::Stamp;

    const START_NS: i64 = 1_700_000_000_250_000_000;

    /// Ten scans a second of 99.9 ms, with values made from nanoseconds after the header.
    fn scans(value: impl Fn(i64, f64) -> f64) -> Vec<ScanTimes> {
        (0..4)
            .map(|k| {
                let header_ns = START_NS + k * 100_000_000;
                let header = Time::from_stamp(Stamp(header_ns)).unwrap();
                ScanTimes { header, min: value(header_ns, 0.0), max: value(header_ns, 99.9e6) }
            })
            .collect()
    }

    fn check(expected_unit: TimeUnit, expected_zero: TimeZero, tolerance_ns: i64, value: impl Fn(i64, f64) -> f64) {
        let scans = scans(value);
        let times = PointTimes::decide("/points", "t", &scans).unwrap();
        assert_eq!((times.unit, times.zero), (expected_unit, expected_zero));
        let last = times.after_header_ns(scans[1].max, scans[1].header).unwrap();
        let first = times.after_header_ns(scans[1].min, scans[1].header).unwrap();
        assert!((last - first - 99_900_000).abs() <= tolerance_ns, "{first} to {last}");
    }

    #[test]
    fn every_unit_since_the_header_and_since_1970() {
        use TimeUnit::*;
        check(Seconds, TimeZero::Header, 0, |_, ns| ns * 1e-9);
        check(Milliseconds, TimeZero::Header, 0, |_, ns| ns * 1e-6);
        check(Microseconds, TimeZero::Header, 0, |_, ns| ns * 1e-3);
        check(Nanoseconds, TimeZero::Header, 0, |_, ns| ns);
        // A header that is stamped at the end: Velodyne's drivers.
        check(Seconds, TimeZero::Header, 0, |_, ns| ns * 1e-9 - 0.0999);
        // A double holds 1.7e9 s to a quarter of a microsecond, 1.7e18 ns likewise.
        check(Seconds, TimeZero::Clock, 500, |header, ns| header as f64 * 1e-9 + ns * 1e-9);
        check(Microseconds, TimeZero::Clock, 1000, |header, ns| (header as f64 * 1e-3) + ns * 1e-3);
        check(Nanoseconds, TimeZero::Clock, 500, |header, ns| header as f64 + ns);
    }

    #[test]
    fn what_fits_nothing_is_refused_with_what_was_found() {
        let decide = |value: &dyn Fn(i64, f64) -> f64| PointTimes::decide("/points", "t", &scans(value)).unwrap_err();
        let zeros = decide(&|_, _| 0.0);
        assert!(matches!(zeros, BagError::TimeSpan { span: 0.0, .. }), "{zeros}");
        // Sensor time since it was switched on.
        let uptime = decide(&|header, ns| (header - START_NS) as f64 * 1e-9 + ns * 1e-9 + 777.0);
        let text = uptime.to_string();
        assert!(matches!(uptime, BagError::TimeReference { .. }) && text.contains("777"), "{text}");
        // Normalised to one: a sweep of a second, but scans come every tenth.
        let normalised = decide(&|_, ns| ns / 99.9e6);
        assert!(normalised.to_string().contains("every 0.100 s"), "{normalised}");
    }

    #[test]
    fn at_most_one_unit_makes_a_sweep_of_a_span() {
        for exponent in -90..=90 {
            let span = 10_f64.powf(f64::from(exponent) / 10.0);
            let fitting = TimeUnit::ALL
                .iter()
                .filter(|unit| (SHORTEST_S..LONGEST_S).contains(&(span * unit.nanoseconds() * 1e-9)))
                .count();
            assert!(fitting <= 1, "{span}");
        }
    }

    #[test]
    fn values_that_are_no_times() {
        for zero in [TimeZero::Header, TimeZero::Clock] {
            for unit in TimeUnit::ALL {
                let times = PointTimes { field: "t".into(), unit, zero };
                let header = Time { sec: 1_700_000_000, nanosec: 5 };
                for value in [f64::NAN, f64::INFINITY, f64::MIN, f64::MAX] {
                    assert_eq!(times.after_header_ns(value, header), None);
                }
            }
        }
    }
}
