//! Where a robot stands in a known building, without any guess.
//!
//! ```text
//! scan = columns of cells with a bit per slice of height        gravity gives roll and pitch, the floor gives the height
//! pose* = argmax over (yaw, x, y) of |scan(pose) and map|       branch and bound: exact on the lattice
//! refined by registration, judged both ways:
//! score = share of the scan on surfaces of the map * share of the map's surfaces in the seen space that were seen as such
//! margin = score of the best - score of the best other place
//! ```
//! What is not decided by the data is not decided here: of two rooms that look alike both are returned, with a margin near zero, and
//! [`judge`] says so. A scan of another building scores low everywhere.

pub mod columns;
pub mod pyramid;
pub mod search;
pub mod seen_space;

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use crate::localisation::columns::{SLICES, columns};
use crate::localisation::pyramid::{MOST_CELLS, Pyramid};
use crate::localisation::search::{Wanted, best_places};
pub use crate::localisation::seen_space::Look;
use crate::localisation::seen_space::{Seen, SeenSpace};
use crate::registration::{Cloud, Freedom, RegistrationConfig, RegistrationError, Surface, align};

/// Settings of a localisation.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalisationConfig {
    /// Heights above the floor that are compared, metres, default 0.25 to 1.95: floor and ceiling look alike everywhere.
    pub band_m: (f64, f64),
    /// Edge of the cells of the search, metres, default 0.10.
    pub cell_m: f64,
    /// Points farther from the scan's origin do not take part in the search, metres, default 10.
    pub max_range_m: f64,
    /// Columns of the scan used in the search, default 600.
    pub max_columns: usize,
    /// Fewer columns are too little to go by, default 40.
    pub min_columns: usize,
    /// Places looked at closely, default 6.
    pub places: usize,
    /// Two poses nearer than this are the same place, metres, default 1.0,
    pub apart_m: f64,
    /// if they are also turned by less than this, radians, default 0.5.
    pub apart_rad: f64,
    /// Places that score less than this share of the best in the search are not looked at, default 0.7.
    pub least_share: f64,
    /// Windows that the search looks into at most, default 2 million.
    pub max_windows: usize,
    /// A scan point on a surface is at most this far off its plane, metres, default 0.06.
    pub tolerance_m: f64,
    /// A best score below this is another place, default 0.75.
    pub min_score: f64,
    /// A margin below this is no decision, default 0.12.
    pub min_margin: f64,
}

impl Default for LocalisationConfig {
    fn default() -> Self {
        Self {
            band_m: (0.25, 1.95),
            cell_m: 0.10,
            max_range_m: 10.0,
            max_columns: 600,
            min_columns: 40,
            places: 6,
            apart_m: 1.0,
            apart_rad: 0.5,
            least_share: 0.7,
            max_windows: 2_000_000,
            tolerance_m: 0.06,
            min_score: 0.75,
            min_margin: 0.12,
        }
    }
}

impl LocalisationConfig {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`LocalisationError::Config`] names the field and what it must be.
    pub fn validate(&self) -> Result<(), LocalisationError> {
        let wrong = |field, value, wanted| Err(LocalisationError::Config { field, value, wanted });
        for (field, value) in [
            ("cell_m", self.cell_m),
            ("max_range_m", self.max_range_m),
            ("apart_m", self.apart_m),
            ("apart_rad", self.apart_rad),
            ("tolerance_m", self.tolerance_m),
            ("band_m", self.band_m.1 - self.band_m.0),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return wrong(field, value, "a positive number");
            }
        }
        for (field, value) in
            [("least_share", self.least_share), ("min_score", self.min_score), ("min_margin", self.min_margin)]
        {
            if !(0.0..=1.0).contains(&value) {
                return wrong(field, value, "from 0 to 1");
            }
        }
        for (field, value) in [
            ("max_columns", self.max_columns),
            ("min_columns", self.min_columns),
            ("places", self.places),
            ("max_windows", self.max_windows),
        ] {
            if value == 0 {
                return wrong(field, 0.0, "at least 1");
            }
        }
        const MOST_RANGE_CELLS: f64 = 2000.0;
        if self.max_range_m > MOST_RANGE_CELLS * self.cell_m {
            return wrong("max_range_m", self.max_range_m, "at most 2000 cells");
        }
        Ok(())
    }
}

/// Why there are no candidates.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LocalisationError {
    /// A setting makes no sense.
    #[error("{field} is {value}, it must be {wanted}")]
    Config {
        /// Which.
        field: &'static str,
        /// What it is.
        value: f64,
        /// What would do.
        wanted: &'static str,
    },
    /// The map shows nothing at the heights that are compared.
    #[error("the map shows nothing between {0} and {1} m above the floor")]
    EmptyMap(f64, f64),
    /// The map is larger than can be searched.
    #[error("the map spans {cells} cells, at most {most} can be searched: take larger cells or a part of it")]
    LargeMap {
        /// Cells of all levels.
        cells: usize,
        /// Limit.
        most: usize,
    },
    /// The scan shows too little at these heights.
    #[error("the scan shows {found} columns of things, at least {needed} are needed")]
    EmptyScan {
        /// Columns.
        found: usize,
        /// Needed.
        needed: usize,
    },
    /// A cloud is too small for the refinement.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
}

/// A place where the robot may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Takes the scan into the map; a turn about the vertical.
    pub map_from_scan: Isometry3<f64>,
    /// `on_map * confirmed`, from 0 to 1.
    pub score: f64,
    /// Share of the scan, within the heights that are compared, that lies on a surface of the map.
    pub on_map: f64,
    /// Of the map's surfaces where the scan has looked, the share that it saw; through the rest it looked as through air.
    pub confirmed: f64,
    /// Score less that of the best other place; negative for all but the best.
    pub margin: f64,
    /// Root mean square distance of the scan to the planes of the map, metres.
    pub plane_rmse_m: f64,
    /// Covariance of (translation, rotation) in the scan's frame.
    pub covariance: Matrix6<f64>,
}

/// What the candidates allow to say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict<'a> {
    /// Here.
    Here(&'a Candidate),
    /// Here or at another place that looks alike.
    Ambiguous(&'a Candidate, &'a Candidate),
    /// Nowhere in this map; the score of the best place.
    Nowhere(f64),
}

/// Judges candidates as [`localise`] returns them, best first.
pub fn judge<'a>(candidates: &'a [Candidate], config: &LocalisationConfig) -> Verdict<'a> {
    match candidates {
        [] => Verdict::Nowhere(0.0),
        [best, ..] if best.score < config.min_score => Verdict::Nowhere(best.score),
        [best, second, ..] if best.margin < config.min_margin => Verdict::Ambiguous(best, second),
        [best, ..] => Verdict::Here(best),
    }
}

/// Finds what was seen in the map. All is level, and the looks are joined in one frame; its heights are above the floor that the robot stands on, those in `map` above
/// the same floor of the building, with a few centimetres of error. The frame's origin lies within the bounds of the map.
///
/// Candidates are at least `apart_m` or `apart_rad` from each other, best first; empty where nothing fits. Points that are not
/// finite are left out.
///
/// # Errors
/// [`LocalisationError`]: an empty or huge map, or a scan with too little in it.
pub fn localise(
    looks: &[Look],
    map: &[Point3<f32>],
    config: &LocalisationConfig,
) -> Result<Vec<Candidate>, LocalisationError> {
    KnownPlace::new(map, config)?.localise(looks)
}

/// A map made ready for [`KnownPlace::localise`], for more than one scan.
#[derive(Debug, Clone)]
pub struct KnownPlace {
    config: LocalisationConfig,
    pyramid: Pyramid,
    surface: Surface,
}

impl KnownPlace {
    /// Prepares the map.
    ///
    /// # Errors
    /// See [`localise`].
    pub fn new(map: &[Point3<f32>], config: &LocalisationConfig) -> Result<KnownPlace, LocalisationError> {
        config.validate()?;
        let pyramid = Pyramid::new(map, config.band_m, config.cell_m)
            .map_err(|cells| LocalisationError::LargeMap { cells, most: MOST_CELLS })?
            .ok_or(LocalisationError::EmptyMap(config.band_m.0, config.band_m.1))?;
        let surface = Surface::new(map, &RegistrationConfig { leaf_m: MAP_LEAF_M, ..refinement() }, Cloud::Target)?;
        Ok(KnownPlace { config: config.clone(), pyramid, surface })
    }

    /// Finds what was seen in this map; see [`localise`].
    ///
    /// # Errors
    /// See [`localise`].
    pub fn localise(&self, looks: &[Look]) -> Result<Vec<Candidate>, LocalisationError> {
        let config = &self.config;
        let scan: Vec<Point3<f32>> = looks.iter().flat_map(|look| look.points.iter().copied()).collect();
        let scan = scan.as_slice();
        // 1. The scan as columns.
        let columns = columns(scan, config.band_m, config.cell_m, config.max_range_m, config.max_columns);
        if columns.len() < config.min_columns {
            return Err(LocalisationError::EmptyScan { found: columns.len(), needed: config.min_columns });
        }
        // 2. The best places of the lattice. A yaw step moves the farthest column by one cell.
        let range_m = columns.iter().map(|column| column.at.coords.norm()).fold(config.cell_m, f64::max);
        let yaws = (std::f64::consts::TAU * range_m / config.cell_m).ceil() as usize;
        let yaw_step_rad = std::f64::consts::TAU / yaws as f64;
        let slices: u32 = columns.iter().map(|column| column.slices.count_ones()).sum();
        let wanted = Wanted {
            yaws,
            hits: config.places,
            apart_cells: (config.apart_m / config.cell_m).ceil() as i32,
            apart_yaws: (config.apart_rad / yaw_step_rad).ceil() as usize,
            least_score: (slices / 4).max(1),
            least_share: config.least_share,
            max_windows: config.max_windows,
        };
        let found = best_places(&self.pyramid, &columns, &wanted);
        // 3. Each refined and judged.
        let source = Surface::new(scan, &refinement(), Cloud::Source)?;
        let seen = SeenSpace::new(looks, config.cell_m, config.max_range_m);
        let mut candidates: Vec<Candidate> = Vec::new();
        for hit in &found.hits {
            let at = self.pyramid.center_of(hit.cell);
            let guess = Isometry3::from_parts(
                Translation3::new(at.x, at.y, 0.0),
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), hit.yaw as f64 * yaw_step_rad),
            );
            // Where too little overlaps or a direction is open, that is no place to be sure of.
            let Ok(refined) = align(&source, &self.surface, &guess, &refinement()) else { continue };
            let on_map = self.on_map(&source, &refined.target_from_source);
            let confirmed = self.confirmed(&seen, &refined.target_from_source);
            let candidate = Candidate {
                map_from_scan: refined.target_from_source,
                score: on_map * confirmed,
                on_map,
                confirmed,
                margin: 0.0,
                plane_rmse_m: refined.plane_rmse_m,
                covariance: refined.covariance,
            };
            candidates.push(candidate);
        }
        candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
        // Two places may have been refined into one.
        let mut kept: Vec<Candidate> = Vec::new();
        for candidate in candidates {
            if !kept.iter().any(|other| self.is_same_place(&candidate.map_from_scan, &other.map_from_scan)) {
                kept.push(candidate);
            }
        }
        // What was not looked at closely scores at most this much in the search.
        let rest = f64::from(found.rest) / f64::from(slices);
        for rank in 0..kept.len() {
            let other = if rank > 0 { kept[0].score } else { kept.get(1).map_or(rest, |second| second.score) };
            kept[rank].margin = kept[rank].score - other;
        }
        Ok(kept)
    }

    /// Share of the scan within the band that lies on a surface of the map.
    fn on_map(&self, scan: &Surface, map_from_scan: &Isometry3<f64>) -> f64 {
        /// Nearest map point of a point on a surface: a diagonal of the thinned map.
        const REACH_M: f32 = 0.2;
        let (low, high) = (self.config.band_m.0 as f32, self.config.band_m.1 as f32);
        let (mut on, mut all) = (0, 0);
        for point in scan.points().iter().filter(|point| point.z >= low && point.z <= high) {
            all += 1;
            let moved = (map_from_scan * point.cast::<f64>()).cast::<f32>();
            if let Some((index, squared_m2)) = self.surface.tree.nearest(&moved, REACH_M * REACH_M) {
                let normal = self.surface.normals[index];
                let off_m = if normal == Vector3::zeros() {
                    squared_m2.sqrt()
                } else {
                    (moved - self.surface.points()[index]).dot(&normal).abs()
                };
                on += usize::from(f64::from(off_m) <= self.config.tolerance_m);
            }
        }
        if all == 0 { 0.0 } else { f64::from(on as u32) / f64::from(all) }
    }

    /// Of the map's surface points where the scan has looked, the share that it saw.
    fn confirmed(&self, seen: &SeenSpace, map_from_scan: &Isometry3<f64>) -> f64 {
        let scan_from_map = map_from_scan.inverse().cast::<f32>();
        let (low, high) = (self.config.band_m.0 as f32, self.config.band_m.1 as f32);
        let (mut surface, mut through) = (0_u32, 0_u32);
        for point in self.surface.points() {
            let moved = scan_from_map * point;
            if moved.z < low || moved.z > high {
                continue;
            }
            match seen.at(&moved) {
                Some(Seen::Surface) => surface += 1,
                Some(Seen::Through) => through += 1,
                None => {}
            }
        }
        if surface == 0 { 0.0 } else { f64::from(surface) / f64::from(surface + through) }
    }

    fn is_same_place(&self, a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
        let shift_m = (a.translation.vector - b.translation.vector).xy().amax();
        shift_m < self.config.apart_m && a.rotation.angle_to(&b.rotation) < self.config.apart_rad
    }
}

/// Thinning of the map: twice the voxels of a room's map.
const MAP_LEAF_M: f64 = 0.10;

/// How a place is refined: from half a cell and a degree away.
fn refinement() -> RegistrationConfig {
    RegistrationConfig {
        leaf_m: 0.15,
        max_distance_m: 0.4,
        freedom: Freedom::Level,
        robust_m: 0.10,
        ..RegistrationConfig::default()
    }
}

const _: () = assert!(SLICES == u16::BITS, "a slice is a bit of a column");
