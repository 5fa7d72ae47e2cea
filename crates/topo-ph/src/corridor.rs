//! Corridors that were cut at their junctions become whole again.
//!
//! Where a corridor meets another it is wider than along its way (1.25 times at a T, 1.4 times at a crossing), so the junction is a peak,
//! the corridor a saddle, and a rule that asks for a narrowing cuts there. But no door is as wide as the corridor behind it. So a border goes
//! if on some side of it lies a part that is hardly wider than the border anywhere, and the other side is not much wider either: the corridor goes on.
//!
//! How wide a part usually is follows from the mean of its values: over a strip with walls on both sides the mean clearance is half that of its middle line.
//! So this is for images, where every point of the floor is a vertex, and not for graphs of places, which lie on the middle lines.

use thiserror::Error;

use crate::Graph;
use crate::partition::{Partition, partition_from_labels};

/// Parameters of [`join_corridors`], found on ten floor plans.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorridorConfig {
    /// The border must be at least this wide, as a part of the higher of both peaks. In [0, 1]. Default 0.75.
    pub goes_on: f64,
    /// ... and as a part of what one of the sides usually is. Positive. Default 0.85.
    pub as_wide: f64,
}

impl Default for CorridorConfig {
    fn default() -> Self {
        CorridorConfig { goes_on: 0.75, as_wide: 0.85 }
    }
}

/// Why [`join_corridors`] refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CorridorError {
    /// `goes_on` is outside [0, 1].
    #[error("goes_on {0} is outside [0, 1]")]
    GoesOn(f64),
    /// `as_wide` is not positive and finite.
    #[error("as_wide {0} is not positive and finite")]
    AsWide(f64),
    /// The partition or the areas are not those of this graph.
    #[error("{parts} part numbers and {areas} areas for {vertices} vertices")]
    Count {
        /// Entries of `part_of`.
        parts: usize,
        /// Number of areas.
        areas: usize,
        /// Number of vertices.
        vertices: usize,
    },
}

impl CorridorConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`CorridorError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), CorridorError> {
        if !(0.0..=1.0).contains(&self.goes_on) {
            return Err(CorridorError::GoesOn(self.goes_on));
        }
        if !(self.as_wide.is_finite() && self.as_wide > 0.0) {
            return Err(CorridorError::AsWide(self.as_wide));
        }
        Ok(())
    }
}

/// Joins parts of an image across borders at which a corridor goes on; the widest border, as a part of the higher peak, first.
///
/// `areas` are those given to [`pinch`](crate::pinch()), in the square of the unit of the values. O(k b) for k parts and b borders.
///
/// # Errors
/// [`CorridorError`] if the configuration is not sound, or the partition is one of another graph.
pub fn join_corridors(
    graph: &Graph,
    areas: &[f64],
    partition: &Partition,
    config: &CorridorConfig,
) -> Result<Partition, CorridorError> {
    config.validate()?;
    if partition.part_of.len() != graph.len() || areas.len() != graph.len() {
        let (parts, areas, vertices) = (partition.part_of.len(), areas.len(), graph.len());
        return Err(CorridorError::Count { parts, areas, vertices });
    }
    let mut shapes: Vec<Shape> =
        partition.parts.iter().map(|part| Shape { peak: part.peak_value, area: 0.0, volume: 0.0 }).collect();
    for (v, &part) in partition.part_of.iter().enumerate() {
        shapes[part as usize].area += areas[v];
        shapes[part as usize].volume += areas[v] * graph.value(v as u32);
    }
    // Parts are numbered by falling peaks, so the smaller number takes the larger in.
    let mut now: Vec<u32> = (0..shapes.len() as u32).collect();
    let mut borders: Vec<(u32, u32, f64)> = partition.borders.iter().map(|b| (b.a, b.b, b.saddle)).collect();
    loop {
        let width = |border: &(u32, u32, f64)| {
            let (a, b) = (&shapes[border.0 as usize], &shapes[border.1 as usize]);
            let share = border.2 / a.peak.max(b.peak);
            let goes_on = share >= config.goes_on && (a.leads_to(border.2, config) || b.leads_to(border.2, config));
            goes_on.then_some(share)
        };
        let widest = borders
            .iter()
            .filter_map(|border| Some((width(border)?, border)))
            .max_by(|(x, p), (y, q)| x.total_cmp(y).then((q.0, q.1).cmp(&(p.0, p.1))));
        let Some((_, &(a, b, _))) = widest else { break };
        let joined = shapes[b as usize];
        shapes[a as usize].area += joined.area;
        shapes[a as usize].volume += joined.volume;
        for part in now.iter_mut().filter(|part| **part == b) {
            *part = a;
        }
        for border in &mut borders {
            let renamed = |part: u32| if part == b { a } else { part };
            let (x, y) = (renamed(border.0), renamed(border.1));
            (border.0, border.1) = (x.min(y), x.max(y));
        }
        borders.retain(|border| border.0 != border.1);
        // Two parts may touch in two places now; the wider one counts.
        borders.sort_unstable_by(|x, y| (x.0, x.1).cmp(&(y.0, y.1)).then(y.2.total_cmp(&x.2)));
        borders.dedup_by_key(|border| (border.0, border.1));
    }
    let labels: Vec<u32> =
        partition.part_of.iter().map(|&part| partition.parts[now[part as usize] as usize].peak).collect();
    Ok(partition_from_labels(graph, &labels, areas))
}

/// What a part looks like from far: its peak, its floor, and the sum of the clearances over it.
#[derive(Debug, Clone, Copy)]
struct Shape {
    peak: f64,
    area: f64,
    volume: f64,
}

impl Shape {
    /// Whether this part is hardly wider than the border anywhere.
    fn leads_to(&self, saddle: f64, config: &CorridorConfig) -> bool {
        let usual = 2.0 * self.volume / self.area;
        saddle >= config.as_wide * usual
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PinchConfig, grid_graph, pinch};

    const CELL_M: f64 = 0.1;

    /// A corridor of 2 m by 16 m; two others of 2 m by 8 m go off; at its right end a room, 5 m by 6 m, behind an opening of `door_m`.
    fn plan(door_m: f64) -> (Graph, Vec<f64>, Vec<u32>) {
        let (width, height) = (242, 122);
        let is_free = |x: usize, y: usize| {
            let (x, y) = (x as f64 * CELL_M, y as f64 * CELL_M);
            let corridor = (0.5..16.5).contains(&x) && (1.0..3.0).contains(&y);
            let branch = ((2.5..4.5).contains(&x) || (9.5..11.5).contains(&x)) && (3.0..11.0).contains(&y);
            let door = (16.5..16.8).contains(&x) && (y - 2.0).abs() < 0.5 * door_m;
            let room = (16.8..21.8).contains(&x) && (0.5..6.5).contains(&y);
            corridor || branch || door || room
        };
        let walls: Vec<(usize, usize)> =
            (0..width * height).map(|i| (i % width, i / width)).filter(|&(x, y)| !is_free(x, y)).collect();
        let clearance: Vec<f32> = (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                if !is_free(x, y) {
                    return 0.0;
                }
                let near = walls.iter().filter(|w| w.0.abs_diff(x) < 32 && w.1.abs_diff(y) < 32);
                let squared = near.map(|w| w.0.abs_diff(x).pow(2) + w.1.abs_diff(y).pow(2)).min().unwrap_or(1024);
                (CELL_M * (squared as f64).sqrt()) as f32
            })
            .collect();
        let (graph, cell_of) = grid_graph(&clearance, width);
        let areas = vec![CELL_M * CELL_M; graph.len()];
        (graph, areas, cell_of)
    }

    fn rooms(door_m: f64) -> (Partition, Partition) {
        let (graph, areas, _) = plan(door_m);
        let cut =
            pinch(&graph, &areas, &PinchConfig { rho: 0.88, tau: 0.07, ..PinchConfig::default() }).expect("valid");
        let joined = join_corridors(&graph, &areas, &cut, &CorridorConfig::default()).expect("valid");
        (cut, joined)
    }

    #[test]
    fn a_corridor_is_whole_past_its_junction_and_ends_at_a_door() {
        let (cut, joined) = rooms(1.0);
        assert!(cut.parts.len() > 2, "it is cut between its junctions at first: {:?}", cut.parts);
        let areas: Vec<f64> = joined.parts.iter().map(|part| part.area.round()).collect();
        assert_eq!(areas, [30.0, 64.0], "the room, and the corridors with their junctions");
        assert_eq!(joined.borders.len(), 1);
        assert!((joined.borders[0].saddle - 0.5).abs() < 0.11, "{:?}", joined.borders);
    }

    #[test]
    fn a_hall_at_the_end_of_a_corridor_stays_a_hall_though_its_opening_is_as_wide() {
        let (_, joined) = rooms(2.0);
        assert_eq!(joined.parts.len(), 2, "{:?}", joined.parts);
    }

    #[test]
    fn bad_input_is_named() {
        let (graph, areas, _) = plan(1.0);
        let cut = pinch(&graph, &areas, &PinchConfig::default()).expect("valid");
        let refuse = |config: CorridorConfig| join_corridors(&graph, &areas, &cut, &config).expect_err("refused");
        let fine = CorridorConfig::default();
        assert_eq!(refuse(CorridorConfig { goes_on: 1.5, ..fine }), CorridorError::GoesOn(1.5));
        assert_eq!(refuse(CorridorConfig { as_wide: 0.0, ..fine }), CorridorError::AsWide(0.0));
        let error = join_corridors(&graph, &areas[1..], &cut, &fine).expect_err("refused");
        assert!(matches!(error, CorridorError::Count { .. }));
        let empty = Graph::new(vec![], vec![], None).expect("valid");
        assert!(join_corridors(&empty, &[], &Partition::default(), &fine).expect("valid").parts.is_empty());
    }
}
