//! The referee at the zones: where the robot truly was, and how fast, against what a person drew.
//!
//! Zones are put into the building once, from the true pose of the start; where the robot believes them to be is its own affair.

use mission::zones::Zones;
use nalgebra::{Isometry2, Isometry3, Point2};
use serde::Serialize;

/// The true speed may exceed a limit by so much: a twentieth, and what a step of a leg adds.
const SPEED_SHARE: f64 = 0.05;
const SPEED_STEP_MPS: f64 = 0.02;
/// True speed is that over so many control periods: a body that is shaken is not fast.
const WINDOW: usize = 10;

/// What happened at one zone, in truth.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ZoneFigures {
    /// The zone's name.
    pub name: String,
    /// `keep_out` or `speed`.
    pub kind: &'static str,
    /// How fast at most; `null` where nobody may be.
    pub max_mps: Option<f64>,
    /// How often any part of the robot came in.
    pub entries: usize,
    /// How long it was in (s).
    pub inside_s: f64,
    /// The largest true speed inside, over the ground (m/s).
    pub fastest_mps: f64,
    /// How often it became faster than the limit (with a twentieth and 0.02 m/s of tolerance).
    pub excesses: usize,
}

/// Watches a run.
pub struct ZoneWatch {
    zones: Zones,
    footprint: Vec<Point2<f64>>,
    recent: std::collections::VecDeque<Point2<f64>>,
    was: Vec<(bool, bool)>,
    figures: Vec<ZoneFigures>,
}

impl ZoneWatch {
    /// Zones in the frame of the building, and the outline of the robot in its own.
    pub fn new(zones: Zones, footprint: &[Point2<f64>]) -> ZoneWatch {
        let keep_out = zones.keep_out.iter().map(|zone| ZoneFigures {
            name: zone.name.clone(),
            kind: "keep_out",
            ..ZoneFigures::default()
        });
        let speed = zones.speed.iter().map(|slow| ZoneFigures {
            name: slow.name.clone(),
            kind: "speed",
            max_mps: Some(slow.zone.max_mps),
            ..ZoneFigures::default()
        });
        let figures: Vec<ZoneFigures> = keep_out.chain(speed).collect();
        let was = vec![(false, false); figures.len()];
        ZoneWatch { zones, footprint: footprint.to_vec(), recent: std::collections::VecDeque::new(), was, figures }
    }

    /// The zones in the frame of the building.
    pub fn zones(&self) -> &Zones {
        &self.zones
    }

    /// One control period later the body is here.
    pub fn see(&mut self, truth_from_body: &Isometry3<f64>, period_s: f64) {
        if self.figures.is_empty() {
            return;
        }
        let flat = Isometry2::new(truth_from_body.translation.vector.xy(), truth_from_body.rotation.euler_angles().2);
        let outline: Vec<Point2<f64>> = self.footprint.iter().map(|corner| flat * corner).collect();
        self.recent.push_back(Point2::from(truth_from_body.translation.vector.xy()));
        if self.recent.len() > WINDOW + 1 {
            self.recent.pop_front();
        }
        let moved_m = (self.recent[self.recent.len() - 1] - self.recent[0]).norm();
        let speed_mps = moved_m / ((self.recent.len() - 1).max(1) as f64 * period_s);
        let keep_out = self.zones.keep_out.iter().map(|keep_out| &keep_out.zone);
        let all = keep_out.chain(self.zones.speed.iter().map(|slow| &slow.zone.zone));
        for ((zone, figures), was) in all.zip(&mut self.figures).zip(&mut self.was) {
            let is_inside = zone.overlaps(&outline);
            // Behind the border the mean still holds what was driven before it.
            let most_mps = figures.max_mps.map_or(f64::INFINITY, |max| max * (1.0 + SPEED_SHARE) + SPEED_STEP_MPS);
            figures.entries += usize::from(is_inside && !was.0);
            if is_inside {
                figures.inside_s += period_s;
                figures.fastest_mps = figures.fastest_mps.max(speed_mps);
            }
            let is_fast = is_inside && speed_mps > most_mps;
            figures.excesses += usize::from(is_fast && !was.1);
            *was = (is_inside, is_fast);
        }
    }

    /// What happened, keep-out zones first.
    pub fn figures(&self) -> &[ZoneFigures] {
        &self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_and_excesses_are_counted_once_each() {
        let zones = Zones::parse(
            "{\"keep_out\": [{\"corners_m\": [[2,-1],[3,-1],[3,1],[2,1]]}], \
              \"speed\": [{\"name\": \"hall\", \"corners_m\": [[-9,-9],[1,-9],[1,9],[-9,9]], \"max_mps\": 0.5}]}",
        )
        .unwrap();
        let corners = [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]].map(Point2::from);
        let mut watch = ZoneWatch::new(zones, &corners);
        // At 1 m/s from x = 0 to 2.5 and back: in the hall up to its border, then in the other zone with its nose, once.
        let at = |x: f64| Isometry3::translation(x, 0.0, 0.3);
        (0..=125).for_each(|k| watch.see(&at(0.02 * f64::from(k)), 0.02));
        let [keep_out, hall] = watch.figures() else { panic!("two zones") };
        assert_eq!((keep_out.entries, hall.entries, hall.excesses), (1, 1, 1));
        assert!(
            (keep_out.inside_s - 0.8).abs() < 0.05 && (hall.fastest_mps - 1.0).abs() < 1e-9,
            "{keep_out:?} {hall:?}"
        );
        (0..=125).for_each(|k| watch.see(&at(2.5 - 0.005 * f64::from(k)), 0.02));
        assert_eq!(watch.figures()[0].entries, 1, "it is still the same visit");
    }
}
