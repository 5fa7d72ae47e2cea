//! What limits an aircraft's flights, on the command line: a fence, and what is left in its battery.

use anyhow::{Result, bail};
use clap::Args;
use mission::planner::{Battery, Geofence};
use mission::robot_model::RobotKind;
use nalgebra::Point2;

use crate::options::parse_positive;

/// Floor and ceiling of a fence that names none, above the floor under the robot's start: the odometry's height may drift.
const FENCE_HEIGHTS_M: (f64, f64) = (-1.0, 3.0);
/// Share of the battery that is kept.
const RESERVE: f64 = 1.0 / 6.0;
/// Speed of the way back, and time for a landing.
const CRUISE_MPS: f64 = 0.6;
const LANDING_S: f64 = 8.0;

/// Limits of flights.
#[derive(Debug, Clone, Default, Args)]
pub struct FlightOptions {
    /// The aircraft's battery lasts for so many seconds of hovering: it flies nowhere from where it could not come back, and returns
    /// or lands in time. How full it is says the autopilot of --px4, if it does, else a model. Without it: for ever
    #[arg(long, value_name = "SECONDS", value_parser = parse_positive, allow_negative_numbers = true)]
    pub battery: Option<f64>,

    /// So much of the battery no plan may use; a sixth without it
    #[arg(long, value_name = "PERCENT", requires = "battery", value_parser = parse_percent, allow_negative_numbers = true)]
    pub battery_reserve: Option<f64>,

    /// The aircraft's centre stays inside this fence: corners of a convex polygon counter-clockwise, in metres from where it starts
    /// (x ahead, y left; with --start in the map's frame), and heights above the floor there, -1..3 without them: "-2,-3 9,-3 9,3 -2,3 0..2"
    #[arg(long, value_name = "CORNERS", value_parser = parse_fence, allow_hyphen_values = true)]
    pub fence: Option<Geofence>,
}

impl FlightOptions {
    /// What the robot is told of its battery.
    pub fn battery(&self) -> Option<Battery> {
        self.battery.map(|endurance_s| battery(endurance_s, self.battery_reserve.unwrap_or(RESERVE)))
    }

    /// Only who flies has a fence and a battery.
    ///
    /// # Errors
    /// A sentence that names the option.
    pub fn check(&self, kind: RobotKind) -> Result<()> {
        let named = [("--fence", self.fence.is_some()), ("--battery", self.battery.is_some())];
        if let Some((name, _)) = named.iter().find(|(_, is_there)| *is_there && kind != RobotKind::Aerial) {
            bail!("{name} limits flights, and this robot walks: use it with omnivln-aerial");
        }
        Ok(())
    }
}

/// A battery that lasts so long, of which `reserve` is kept; the way back is flown slowly.
pub fn battery(endurance_s: f64, reserve: f64) -> Battery {
    Battery { endurance_s, reserve, cruise_mps: CRUISE_MPS, landing_s: LANDING_S }
}

fn parse_percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(percent) if (0.0..100.0).contains(&percent) => Ok(percent / 100.0),
        _ => Err(format!("'{text}' is not a number of percent from 0 to less than 100")),
    }
}

/// Reads `X,Y X,Y X,Y ... [FLOOR..CEILING]`.
fn parse_fence(text: &str) -> Result<Geofence, String> {
    let mut corners = Vec::new();
    let mut heights_m = None;
    let pair = |word: &str, between: &str| -> Option<(f64, f64)> {
        let (a, b) = word.split_once(between)?;
        Some((a.parse().ok()?, b.parse().ok()?))
    };
    for word in text.split_whitespace() {
        if heights_m.is_some() {
            return Err(format!("'{word}' stands behind the heights of the fence, which come last"));
        } else if let Some((x, y)) = pair(word, ",") {
            corners.push(Point2::new(x, y));
        } else if let Some(heights) = pair(word, "..") {
            heights_m = Some(heights);
        } else {
            return Err(format!(
                "'{word}' is neither a corner X,Y nor heights FLOOR..CEILING (metres), for example \"-2,-3 9,-3 9,3 -2,3 0..2\""
            ));
        }
    }
    let (floor_m, ceiling_m) = heights_m.unwrap_or(FENCE_HEIGHTS_M);
    Geofence::new(&corners, floor_m, ceiling_m).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn fences_are_read_or_refused_with_a_sentence() {
        let fence = parse_fence("-2,-3  9,-3 9,3 -2,3 0..2").unwrap();
        assert_eq!(fence.slack_m(&Point3::new(8.5, 0.0, 1.0)), 0.5);
        assert_eq!(fence.slack_m(&Point3::new(0.0, 0.0, 2.5)), -0.5);
        assert_eq!(parse_fence("0,0 4,0 0,4").unwrap().slack_m(&Point3::new(1.0, 1.0, 2.75)), 0.25);
        for (text, says) in [
            ("0,0 4,0", "at least three corners, not 2"),
            ("", "at least three corners, not 0"),
            ("0,0 0,4 4,0", "counter-clockwise"),
            ("0,0 4,0 4;4", "neither a corner X,Y nor heights"),
            ("0,0 4,0 0,nan", "finite"),
            ("0,0 4,0 0,4 2..1", "must be above its floor"),
            ("0,0 4,0 0..2 0,4", "come last"),
        ] {
            let error = parse_fence(text).unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    #[test]
    fn a_battery_keeps_what_it_is_told_to() {
        let options = FlightOptions { battery: Some(300.0), ..FlightOptions::default() };
        assert!((options.battery().unwrap().left_s(1.0) - 250.0).abs() < 1e-9);
        let kept = FlightOptions { battery_reserve: Some(parse_percent("40").unwrap()), ..options };
        assert!((kept.battery().unwrap().left_s(1.0) - 180.0).abs() < 1e-9);
        kept.battery().unwrap().validate().unwrap();
        assert!(parse_percent("100").is_err() && parse_percent("-1").is_err() && parse_percent("NaN").is_err());
        assert!(kept.check(RobotKind::Aerial).is_ok());
        assert!(kept.check(RobotKind::Ground).unwrap_err().to_string().contains("--battery limits flights"));
    }
}
