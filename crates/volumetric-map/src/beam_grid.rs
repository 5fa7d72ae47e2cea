//! The directions of a spinning LiDAR's beams: rings at fixed elevations, columns at equal steps of azimuth. Says which beam passes
//! nearest to a point.
//!
//! Both angles are looked up by a stand-in that grows with the angle and costs one division: the sine `z / r` for the elevation, and for
//! the azimuth the way along a square's border, `x / (|x| + |y|)`. A table over the stand-in names the ring or column. The tables are fine enough that
//! a beam's own points never fall to a neighbour; between two beams the border is off by at most an eighth of their distance.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt;

use thiserror::Error;

/// Most rings, and most columns.
const MOST_RINGS: usize = 1024;
const MOST_COLUMNS: usize = 65_536;
/// Entries of a table between two beams, and most entries of the table of rings.
const FINENESS: usize = 8;
const MOST_ENTRIES: usize = 1 << 15;

/// Rings by columns of beams, all from the sensor's origin: x forward, y left, z along the spin axis.
#[derive(Clone, PartialEq)]
pub struct BeamGrid {
    elevations_rad: Vec<f64>,
    columns: usize,
    first_azimuth_rad: f64,
    /// The nearest ring, at equal steps of the sine of the elevation from -1 to 1.
    ring_by_sine: Vec<u16>,
    /// The nearest column, at equal steps of the way round the square.
    column_by_way: Vec<u16>,
}

/// Beams that make no grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum BeamGridError {
    /// Not between one and 1024 rings.
    #[error("a grid of beams needs 1 to {MOST_RINGS} rings, not {0}")]
    Rings(usize),
    /// Not between 4 and 65 536 columns.
    #[error("a grid of beams needs 4 to {MOST_COLUMNS} columns, not {0}")]
    Columns(usize),
    /// An elevation is not finite, not in (-90, 90) degrees, or not above the one before it.
    #[error("the elevation of ring {0} is not between -90 and 90 degrees and above that of the ring before")]
    Elevation(usize),
    /// The azimuth of the first column is not finite.
    #[error("the azimuth of the first column is not finite")]
    Azimuth,
}

impl BeamGrid {
    /// Beams at these elevations (rad above the xy plane, ascending) and at `columns` azimuths (rad from x towards y), equally far
    /// from each other, one of them `first_azimuth_rad`.
    ///
    /// # Errors
    /// [`BeamGridError`] names what makes no grid.
    pub fn new(elevations_rad: Vec<f64>, columns: usize, first_azimuth_rad: f64) -> Result<Self, BeamGridError> {
        if !(1..=MOST_RINGS).contains(&elevations_rad.len()) {
            return Err(BeamGridError::Rings(elevations_rad.len()));
        }
        if !(4..=MOST_COLUMNS).contains(&columns) {
            return Err(BeamGridError::Columns(columns));
        }
        let mut last = -FRAC_PI_2;
        for (ring, elevation) in elevations_rad.iter().enumerate() {
            if !(*elevation > last && *elevation < FRAC_PI_2) {
                return Err(BeamGridError::Elevation(ring));
            }
            last = *elevation;
        }
        if !first_azimuth_rad.is_finite() {
            return Err(BeamGridError::Azimuth);
        }
        let narrowest = elevations_rad.windows(2).map(|pair| pair[1].sin() - pair[0].sin()).fold(2.0, f64::min);
        let ring_entries = ((FINENESS as f64 * 2.0 / narrowest).ceil() as usize).min(MOST_ENTRIES);
        let ring_by_sine = (0..=ring_entries).map(|entry| {
            let elevation = (2.0 * entry as f64 / ring_entries as f64 - 1.0).asin();
            let above = elevations_rad.partition_point(|e| *e < elevation).min(elevations_rad.len() - 1);
            let below = above.saturating_sub(1);
            let is_below = elevation - elevations_rad[below] < elevations_rad[above] - elevation;
            (if is_below { below } else { above }) as u16
        });
        let entries = FINENESS * columns;
        let column_by_way = (0..=entries).map(|entry| {
            let azimuth = azimuth_at(4.0 * entry as f64 / entries as f64);
            let column = (azimuth - first_azimuth_rad) / TAU * columns as f64;
            column.round().rem_euclid(columns as f64) as u16
        });
        Ok(Self {
            ring_by_sine: ring_by_sine.collect(),
            column_by_way: column_by_way.collect(),
            elevations_rad,
            columns,
            first_azimuth_rad,
        })
    }

    /// Number of rings.
    pub fn rings(&self) -> usize {
        self.elevations_rad.len()
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Unit vector along a beam, in the sensor's frame.
    ///
    /// # Panics
    /// If there is no such ring.
    pub fn direction(&self, ring: usize, column: usize) -> [f64; 3] {
        let (up, flat) = self.elevations_rad[ring].sin_cos();
        let (y, x) = (self.first_azimuth_rad + TAU * column as f64 / self.columns as f64).sin_cos();
        [flat * x, flat * y, up]
    }

    /// Number (ring times columns plus column) of the beam that passes nearest to a point in the sensor's frame. A point at the
    /// origin, or not finite, gets some beam.
    #[inline(always)]
    pub(crate) fn nearest(&self, [x, y, z]: [f32; 3]) -> usize {
        let (sines, ways) = (self.ring_by_sine.len() - 1, self.column_by_way.len() - 1);
        let sine = z / (x * x + y * y + z * z).sqrt();
        let along = x / (x.abs() + y.abs());
        let way = if y >= 0.0 { 1.0 - along } else { 3.0 + along };
        let ring = self.ring_by_sine[rounded((sine + 1.0) * (0.5 * sines as f32)).min(sines)];
        let column = self.column_by_way[rounded(way * (0.25 * ways as f32)).min(ways)];
        usize::from(ring) * self.columns + usize::from(column)
    }
}

impl fmt::Debug for BeamGrid {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without the tables, which say it again in thousands of numbers.
        out.debug_struct("BeamGrid")
            .field("elevations_rad", &self.elevations_rad)
            .field("columns", &self.columns)
            .field("first_azimuth_rad", &self.first_azimuth_rad)
            .finish_non_exhaustive()
    }
}

/// The nearest whole number to one between 0 and 2^22; anything else gives anything. No branch, no checked cast.
#[inline(always)]
fn rounded(value: f32) -> usize {
    const SHIFT: f32 = 12_582_912.0; // 1.5 * 2^23: the sum's last bit is worth one
    (value + SHIFT).to_bits().wrapping_sub(SHIFT.to_bits()) as usize
}

/// The azimuth, from 0 to 2 pi, at a way from 0 to 4 along the border of the square |x| + |y| = 1.
fn azimuth_at(way: f64) -> f64 {
    let x = if way <= 2.0 { 1.0 - way } else { way - 3.0 };
    let y = if way <= 2.0 { 1.0 - x.abs() } else { x.abs() - 1.0 };
    if way >= 4.0 { TAU } else { y.atan2(x).rem_euclid(TAU) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(rings: usize, columns: usize, first_azimuth_rad: f64) -> BeamGrid {
        let elevations = (0..rings).map(|k| (k as f64 / (rings - 1) as f64 - 0.5) * FRAC_PI_2).collect();
        BeamGrid::new(elevations, columns, first_azimuth_rad).unwrap()
    }

    fn nearest(grid: &BeamGrid, p: [f64; 3]) -> (usize, usize) {
        let beam = grid.nearest(p.map(|v| v as f32));
        (beam / grid.columns, beam % grid.columns)
    }

    #[test]
    fn every_beam_finds_itself() {
        for (rings, columns, first) in [(64, 1024, -3.1), (2, 4, 0.3), (128, 2048, 0.0015), (7, 361, 40.0)] {
            let grid = even(rings, columns, first);
            for ring in 0..rings {
                for column in 0..columns {
                    let direction = grid.direction(ring, column);
                    assert_eq!(nearest(&grid, direction.map(|v| 7.3 * v)), (ring, column), "{rings} x {columns}");
                }
            }
        }
    }

    #[test]
    fn points_between_beams_go_to_the_nearer_one() {
        let grid = even(31, 720, 0.1);
        let step = FRAC_PI_2 / 30.0;
        for k in 0..20_000 {
            let (turn, lift) = (f64::from(k) * 0.618_034, f64::from(k) * 0.000_07 - 0.7);
            let (ring, column) = ((lift + FRAC_PI_2 / 2.0) / step, (turn - 0.1) / TAU * 720.0);
            let is_at_a_border = |v: f64| (v - v.floor() - 0.5).abs() < 0.13;
            let found = nearest(&grid, [lift.cos() * turn.cos(), lift.cos() * turn.sin(), lift.sin()]);
            assert!(is_at_a_border(ring) || found.0 == ring.round().clamp(0.0, 30.0) as usize, "{k}");
            assert!(is_at_a_border(column) || found.1 == column.round().rem_euclid(720.0) as usize, "{k}");
        }
        for p in [[0.0; 3], [f64::NAN, 1.0, 0.0], [f64::INFINITY, 0.0, 0.0], [0.0, 0.0, -1.0], [1e-40, 0.0, 1.0]] {
            let (ring, column) = nearest(&grid, p);
            assert!(ring < 31 && column < 720);
        }
    }

    #[test]
    fn what_is_no_grid_is_named() {
        let rings = |elevations: &[f64]| BeamGrid::new(elevations.to_vec(), 8, 0.0).map(|_| ());
        assert_eq!(rings(&[]), Err(BeamGridError::Rings(0)));
        assert_eq!(rings(&[0.0, 0.0]), Err(BeamGridError::Elevation(1)));
        assert_eq!(rings(&[f64::NAN]), Err(BeamGridError::Elevation(0)));
        assert_eq!(rings(&[2.0]), Err(BeamGridError::Elevation(0)));
        assert_eq!(BeamGrid::new(vec![0.0], 3, 0.0).unwrap_err(), BeamGridError::Columns(3));
        assert_eq!(BeamGrid::new(vec![0.0], 4, f64::NAN).unwrap_err(), BeamGridError::Azimuth);
        assert!(rings(&[-0.2]).is_ok());
    }
}
