//! How full the vehicle's batteries are, by the autopilot's own gauges.
//!
//! BATTERY_STATUS speaks of one battery, SYS_STATUS of the vehicle. The least of what was said lately counts: a vehicle with two
//! batteries is in need when one of them is.

use std::collections::BTreeMap;

use crate::mavlink::message::{BatteryStatus, SysStatus};

/// What was said longer ago does not count. PX4 speaks of its batteries every two seconds, and twice a second where bandwidth allows.
const FRESH_NS: i64 = 10_000_000_000;

/// Whose gauge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Gauge {
    Vehicle,
    Battery(u8),
}

/// The newest word of each gauge; at most 257 of them.
#[derive(Debug, Clone, Default)]
pub struct BatteryGauges {
    /// When it was heard, and percent left.
    heard: BTreeMap<Gauge, (i64, u8)>,
}

impl BatteryGauges {
    /// Takes the word about the vehicle.
    pub fn hear_vehicle(&mut self, status: &SysStatus, now_ns: i64) {
        self.hear(Gauge::Vehicle, status.battery_remaining, now_ns);
    }

    /// Takes the word about one battery.
    pub fn hear_battery(&mut self, status: &BatteryStatus, now_ns: i64) {
        self.hear(Gauge::Battery(status.id), status.battery_remaining, now_ns);
    }

    /// Least charge of all gauges heard in the last ten seconds: 1 is full, 0 empty; `None` where none says so.
    pub fn charge(&self, now_ns: i64) -> Option<f64> {
        let fresh = self.heard.values().filter(|(heard_ns, _)| now_ns.saturating_sub(*heard_ns) <= FRESH_NS);
        fresh.map(|(_, percent)| f64::from(*percent) / 100.0).reduce(f64::min)
    }

    fn hear(&mut self, gauge: Gauge, percent: i8, now_ns: i64) {
        // -1 is "unknown", and more than full is nonsense: neither says anything.
        if let Some(percent) = u8::try_from(percent).ok().filter(|percent| *percent <= 100) {
            self.heard.insert(gauge, (now_ns, percent));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    #[test]
    fn the_least_of_what_was_said_lately_counts() {
        let mut gauges = BatteryGauges::default();
        let vehicle = |battery_remaining| SysStatus { battery_remaining, ..SysStatus::default() };
        let battery = |id, battery_remaining| BatteryStatus { id, battery_remaining, ..BatteryStatus::default() };
        assert_eq!(gauges.charge(0), None);
        gauges.hear_vehicle(&vehicle(-1), 0);
        gauges.hear_battery(&battery(0, 101), 0);
        assert_eq!(gauges.charge(0), None, "unknown, and nonsense");
        gauges.hear_vehicle(&vehicle(90), S);
        gauges.hear_battery(&battery(0, 88), S);
        gauges.hear_battery(&battery(1, 40), S);
        assert_eq!(gauges.charge(2 * S), Some(0.40));
        gauges.hear_battery(&battery(0, 87), 9 * S);
        assert_eq!(gauges.charge(12 * S), Some(0.87), "the second battery fell silent");
        gauges.hear_battery(&battery(0, -1), 13 * S);
        assert_eq!(gauges.charge(13 * S), Some(0.87), "not known any more is no charge");
        assert_eq!(gauges.charge(20 * S), None);
    }
}
