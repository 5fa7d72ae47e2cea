//! Zones that a person draws on the floor: where the robot may not be, and where it may only be slow.
//!
//! They come from a JSON file (`--zones FILE` of both robots):
//!
//! ```json
//! {
//!   "frame": "start",
//!   "keep_out": [{"name": "wet floor", "corners_m": [[1.5, -0.5], [3.0, -0.5], [3.0, 0.8], [1.5, 0.8]]}],
//!   "speed": [{"name": "ward", "corners_m": [[3.0, -4.0], [9.0, -4.0], [9.0, 4.0], [3.0, 4.0]], "max_mps": 0.3}]
//! }
//! ```
//!
//! - `frame`: `start` (also when it is missing): metres from where the robot starts, x ahead of it, y to its left. `map`: the frame of
//!   the map given with `--known`; a robot that has to find itself in that map first does not leave its place before it has.
//! - `keep_out`: no part of the robot enters, at any height, whatever its map says.
//! - `speed`: while any part of the robot is inside it is at most so fast; it brakes before the border.
//! - `corners_m`: a simple polygon, 3 to 256 corners in either order. `name` is what the robot calls the zone; without it the number counts.
//!
//! Zones are kept off by [`MARGIN_M`] more than their size: so much the robot may be wrong about where it is.

use nalgebra::{Isometry2, Isometry3, Point2};
use planner::{SpeedZone, Zone, ZoneError};
use serde::Deserialize;
use serde_json::json;
use thiserror::Error;

/// What is kept from zones besides: the odometry's error, and that of the body's place between two looks.
pub const MARGIN_M: f64 = 0.10;
/// Most zones of a file.
const MOST_ZONES: usize = 64;

/// Where the coordinates of a file begin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ZoneFrame {
    /// On the floor under the robot's start, x ahead.
    #[default]
    Start,
    /// The known map's own.
    Map,
}

/// What a person drew.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Zones {
    /// Where their coordinates begin.
    pub frame: ZoneFrame,
    /// No part of the robot may be there.
    pub keep_out: Vec<KeepOut>,
    /// It may only be slow there.
    pub speed: Vec<Slow>,
}

/// Nobody enters.
#[derive(Debug, Clone, PartialEq)]
pub struct KeepOut {
    /// For people.
    pub name: String,
    /// Where.
    pub zone: Zone,
}

/// Nobody is fast.
#[derive(Debug, Clone, PartialEq)]
pub struct Slow {
    /// For people.
    pub name: String,
    /// Where, and how fast at most.
    pub zone: SpeedZone,
}

/// What is wrong with zones.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ZonesError {
    /// The text is no JSON of this form.
    #[error(
        "line {line}, column {column}: {what}; accepted is {{\"frame\": \"start\" or \"map\", \"keep_out\": [{{\"name\", \"corners_m\": [[x, y], ...]}}], \"speed\": [{{..., \"max_mps\"}}]}}"
    )]
    Syntax {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What the reader met.
        what: SyntaxProblem,
    },
    /// A zone is refused.
    #[error("{list}[{index}] \"{name}\": {error}")]
    Zone {
        /// `keep_out` or `speed`.
        list: &'static str,
        /// From 0.
        index: usize,
        /// Its name.
        name: String,
        /// Why.
        error: ZoneError,
    },
    /// More than 64 zones.
    #[error("there are {0} zones; at most {MOST_ZONES} are read")]
    TooMany(usize),
    /// The robot would start where it may not be.
    #[error("the robot stands in the keep-out zone \"{name}\"; it has to start outside")]
    StandsIn {
        /// The zone's name.
        name: String,
    },
    /// `map` without a known map.
    #[error("\"frame\": \"map\" names the frame of a known map, and none was given (--known); \"start\" needs none")]
    NoMap,
}

/// The JSON reader's own words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SyntaxProblem(String);

impl std::fmt::Display for SyntaxProblem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    frame: ZoneFrame,
    #[serde(default)]
    keep_out: Vec<KeepOutEntry>,
    #[serde(default)]
    speed: Vec<SpeedEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeepOutEntry {
    name: Option<String>,
    corners_m: Vec<[f64; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SpeedEntry {
    name: Option<String>,
    corners_m: Vec<[f64; 2]>,
    max_mps: f64,
}

impl Zones {
    /// Reads the file format of the module's head.
    ///
    /// # Errors
    /// [`ZonesError`] names the line, or the zone.
    pub fn parse(text: &str) -> Result<Zones, ZonesError> {
        let file: File = serde_json::from_str(text).map_err(|error| {
            let (line, column, told) = (error.line(), error.column(), error.to_string());
            let what = told.split(" at line ").next().unwrap_or(&told).to_owned();
            ZonesError::Syntax { line, column, what: SyntaxProblem(what) }
        })?;
        let count = file.keep_out.len() + file.speed.len();
        if count > MOST_ZONES {
            return Err(ZonesError::TooMany(count));
        }
        let name_of = |name: Option<String>, index: usize| name.unwrap_or_else(|| (index + 1).to_string());
        let points = |corners: &[[f64; 2]]| corners.iter().map(|p| Point2::from(*p)).collect::<Vec<_>>();
        let mut zones = Zones { frame: file.frame, ..Zones::default() };
        for (index, entry) in file.keep_out.into_iter().enumerate() {
            let name = name_of(entry.name, index);
            let zone = Zone::new(&points(&entry.corners_m)).map_err(|error| ZonesError::Zone {
                list: "keep_out",
                index,
                name: name.clone(),
                error,
            })?;
            zones.keep_out.push(KeepOut { name, zone });
        }
        for (index, entry) in file.speed.into_iter().enumerate() {
            let name = name_of(entry.name, index);
            let zone = SpeedZone::new(&points(&entry.corners_m), entry.max_mps).map_err(|error| ZonesError::Zone {
                list: "speed",
                index,
                name: name.clone(),
                error,
            })?;
            zones.speed.push(Slow { name, zone });
        }
        Ok(zones)
    }

    /// The file that [`Zones::parse`] reads as these zones.
    pub fn to_json(&self) -> String {
        let corners = |zone: &Zone| zone.corners().iter().map(|corner| [corner.x, corner.y]).collect::<Vec<_>>();
        let keep_out = self.keep_out.iter().map(|k| json!({"name": k.name, "corners_m": corners(&k.zone)}));
        let speed = self.speed.iter().map(
            |slow| json!({"name": slow.name, "corners_m": corners(&slow.zone.zone), "max_mps": slow.zone.max_mps}),
        );
        let frame = match self.frame {
            ZoneFrame::Start => "start",
            ZoneFrame::Map => "map",
        };
        json!({
            "frame": frame,
            "keep_out": keep_out.collect::<Vec<_>>(),
            "speed": speed.collect::<Vec<_>>(),
        })
        .to_string()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.keep_out.is_empty() && self.speed.is_empty()
    }

    /// The same zones in another frame: turned about the vertical and shifted on the floor.
    pub fn moved(&self, new_from_old: &Isometry3<f64>) -> Zones {
        let flat = on_the_floor(new_from_old);
        Zones {
            frame: self.frame,
            keep_out: self
                .keep_out
                .iter()
                .map(|k| KeepOut { name: k.name.clone(), zone: k.zone.moved(&flat) })
                .collect(),
            speed: self
                .speed
                .iter()
                .map(|slow| Slow {
                    name: slow.name.clone(),
                    zone: SpeedZone { zone: slow.zone.zone.moved(&flat), max_mps: slow.zone.max_mps },
                })
                .collect(),
        }
    }

    /// Refuses a start with any part of the robot in a keep-out zone. `footprint` is in the body frame; zones and body are in one frame.
    ///
    /// # Errors
    /// [`ZonesError::StandsIn`].
    pub fn check_start(&self, footprint: &[Point2<f64>], zones_from_body: &Isometry3<f64>) -> Result<(), ZonesError> {
        let flat = on_the_floor(zones_from_body);
        let outline: Vec<Point2<f64>> = footprint.iter().map(|corner| flat * corner).collect();
        match self.keep_out.iter().find(|keep_out| keep_out.zone.overlaps(&outline)) {
            Some(keep_out) => Err(ZonesError::StandsIn { name: keep_out.name.clone() }),
            None => Ok(()),
        }
    }

    /// The keep-out zone that holds a point.
    pub fn keep_out_at(&self, point: &Point2<f64>) -> Option<&KeepOut> {
        self.keep_out.iter().find(|keep_out| !keep_out.zone.is_farther(point, 0.0) && keep_out.zone.contains(point))
    }

    /// Distance to the nearest keep-out zone with its margin, negative inside; infinite beyond `far_m`.
    pub fn kept_m(&self, point: &Point2<f64>, far_m: f64) -> f64 {
        let near = self.keep_out.iter().filter(|keep_out| !keep_out.zone.is_farther(point, far_m + MARGIN_M));
        near.map(|keep_out| keep_out.zone.distance_m(point) - MARGIN_M).fold(f64::INFINITY, f64::min)
    }

    /// Posts all round every keep-out zone, at its margin, at most `spacing_m` apart: obstacles like any other, whatever the map shows.
    pub fn posts(&self, spacing_m: f64) -> Vec<Point2<f64>> {
        self.keep_out.iter().flat_map(|keep_out| keep_out.zone.fence(MARGIN_M, spacing_m)).collect()
    }

    /// The speed zones alone.
    pub fn speed_zones(&self) -> Vec<SpeedZone> {
        self.speed.iter().map(|slow| slow.zone.clone()).collect()
    }
}

fn on_the_floor(pose: &Isometry3<f64>) -> Isometry2<f64> {
    Isometry2::new(pose.translation.vector.xy(), pose.rotation.euler_angles().2)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the head comment.
    fn example() -> &'static str {
        let text = include_str!("zones.rs");
        let start = text.find("//! {").expect("an example");
        let end = start + text[start..].find("//! ```").expect("its end");
        Box::leak(text[start..end].replace("//! ", "").into_boxed_str())
    }

    #[test]
    fn the_documented_example_is_read() {
        let zones = Zones::parse(example()).unwrap();
        assert_eq!((zones.frame, zones.keep_out.len(), zones.speed.len()), (ZoneFrame::Start, 1, 1));
        assert_eq!(zones.keep_out_at(&Point2::new(2.0, 0.0)).map(|zone| zone.name.as_str()), Some("wet floor"));
        assert_eq!(zones.speed[0].zone.max_mps, 0.3);
        assert!((zones.kept_m(&Point2::new(1.0, 0.0), 1.0) - 0.4).abs() < 1e-12);
        assert_eq!(zones.kept_m(&Point2::new(-3.0, 0.0), 1.0), f64::INFINITY);
        assert!(Zones::parse("{}").unwrap().is_empty());
    }

    #[test]
    fn what_is_wrong_is_said_with_its_place() {
        let says = |text: &str| Zones::parse(text).unwrap_err().to_string();
        let zone = |corners: &str| format!("{{\"keep_out\": [{{\"name\": \"a\", \"corners_m\": {corners}}}]}}");
        for (text, words) in [
            (String::new(), vec!["line 1", "keep_out"]),
            ("{\"frame\": \"moon\"}".into(), vec!["moon", "start"]),
            ("{\"keepout\": []}".into(), vec!["keepout"]),
            (zone("[[0,0],[1,0],[NaN,1]]"), vec!["line 1", "column"]),
            (zone("[[0,0],[1,0],[1e999,1]]"), vec!["line 1", "range"]),
            (zone("[[0,0],[1,0],[1e7,1]]"), vec!["keep_out[0] \"a\"", "corner 2"]),
            (zone("[[0,0],[1,0]]"), vec!["keep_out[0] \"a\"", "2 corners"]),
            (zone("[[0,0],[1,1],[1,0],[0,1]]"), vec!["keep_out[0] \"a\"", "sides 0 and 2"]),
            (zone("[[0,0],[1,\"x\"],[1,0]]"), vec!["line 1", "string"]),
            (
                "{\"speed\": [{\"corners_m\": [[0,0],[1,0],[0,1]], \"max_mps\": -0.5}]}".into(),
                vec!["speed[0] \"1\"", "-0.5"],
            ),
            ("{\"speed\": [{\"corners_m\": [[0,0],[1,0],[0,1]]}]}".into(), vec!["max_mps"]),
        ] {
            let said = says(&text);
            assert!(words.iter().all(|word| said.contains(word)), "{text}: {said}");
        }
    }

    #[test]
    fn nobody_starts_inside() {
        let zones = Zones::parse(example()).unwrap();
        let footprint = [[0.35, 0.16], [-0.35, 0.16], [-0.35, -0.16], [0.35, -0.16]].map(Point2::from);
        let at = |x: f64, yaw_rad: f64| Isometry3::new([x, 0.0, 0.3].into(), nalgebra::Vector3::z() * yaw_rad);
        assert_eq!(zones.check_start(&footprint, &at(1.2, std::f64::consts::FRAC_PI_2)), Ok(()));
        assert_eq!(
            zones.check_start(&footprint, &at(1.2, 0.0)),
            Err(ZonesError::StandsIn { name: "wet floor".into() }),
            "its nose is inside"
        );
    }
}
