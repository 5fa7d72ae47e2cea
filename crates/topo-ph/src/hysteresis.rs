//! [`pinch`](crate::pinch()) with the partition before: borders do not flicker when the numbers do.
//!
//! A border that existed stays until the way is clearly wider than the rule asks for; a border that did not exist needs the rule itself.
//! So a ratio of saddle to peak that wanders about rho changes the partition at most once:
//!
//! ```text
//! saddle / lower peak     0 ........ rho ........ rho + band ........ 1
//!                         border      as it was               no border
//! ```
//! 1. Inside each old part, edges from wide to narrow, by the plain rule. What splits off is a new region; if it is too small to be a part
//!    it forgets where it came from.
//! 2. All other edges, from wide to narrow. Regions of different old parts keep their border while the saddle, less `band` times the lower
//!    peak, satisfies the rule. Everything else (new vertices, pieces) goes by the plain rule.
//! 3. A border that fails even so was overtaken by events: both its parts are forgotten, and 1 and 2 are done again without them, so that
//!    the plain rule judges the place as if nothing had been known about it.
//! 4. Small regions are absorbed; an old part that is still in one piece may be a little smaller.
//!
//! Old parts come first (step 1) because the order in which basins merge decides to which room a bay belongs: noise would hand it to and
//! fro. That gives two laws, tested in `tests/hysteresis.rs`. A partition whose borders were judged with half the band does not change at all while
//! every value stays within a factor of 1 +- band/8; and in a row of such noisy graphs no border vanishes again (values not
//! negative, rho + band < 1, no `min_area`).

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use crate::Graph;
use crate::identity::NO_PART;
use crate::order::edges_wide_first;
use crate::partition::{Partition, partition_from_labels};
use crate::pinch::{PinchConfig, PinchError, absorb_small, check, is_border};
use crate::union_find::UnionFind;

/// How much an old partition weighs in [`pinch_from`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HysteresisConfig {
    /// An old border is judged as if its saddle were lower by this share of the lower peak. In [0, 1]. Default 0.03: the values of a map
    /// that is measured again move by one or two hundredths.
    pub band: f64,
    /// An old part in one piece may be smaller than `min_area` by this share. In [0, 1]. Default 0.1: a cell more or less along the walls of a small room.
    pub area_band: f64,
}

impl Default for HysteresisConfig {
    fn default() -> Self {
        HysteresisConfig { band: 0.03, area_band: 0.1 }
    }
}

/// Why [`pinch_from`] refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HysteresisError {
    /// The plain rule refused.
    #[error(transparent)]
    Pinch(#[from] PinchError),
    /// `band` is outside [0, 1].
    #[error("band {value} is outside [0, 1]")]
    Band {
        /// The value given.
        value: f64,
    },
    /// `area_band` is outside [0, 1].
    #[error("area_band {value} is outside [0, 1]")]
    AreaBand {
        /// The value given.
        value: f64,
    },
    /// There is not exactly one previous part for each vertex.
    #[error("{previous} previous parts for {vertices} vertices; NO_PART marks vertices that are new")]
    PreviousCount {
        /// Number of previous parts.
        previous: usize,
        /// Number of vertices.
        vertices: usize,
    },
}

impl HysteresisConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`HysteresisError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), HysteresisError> {
        if !(0.0..=1.0).contains(&self.band) {
            return Err(HysteresisError::Band { value: self.band });
        }
        if !(0.0..=1.0).contains(&self.area_band) {
            return Err(HysteresisError::AreaBand { value: self.area_band });
        }
        Ok(())
    }
}

/// [`pinch`](crate::pinch()) of a graph of which an earlier partition is known: `previous` has for each vertex any number that tells the
/// old parts apart (an id of a room, an index), [`NO_PART`] where the vertex is new.
///
/// Without a previous part anywhere it equals `pinch`, and a partition that `pinch` made of the same graph comes back as it was. Whose name a
/// part inherits is [`match_parts`](crate::match_parts). Costs what `pinch` does, and a pass over the edges more for each round of step 3,
/// at most [`MOST_ROUNDS`].
///
/// # Errors
/// [`HysteresisError`] if a configuration, the areas or the number of previous parts is not sound.
pub fn pinch_from(
    graph: &Graph,
    areas: &[f64],
    config: &PinchConfig,
    previous: &[u32],
    hysteresis: &HysteresisConfig,
) -> Result<Partition, HysteresisError> {
    check(graph, areas, config)?;
    hysteresis.validate()?;
    if previous.len() != graph.len() {
        return Err(HysteresisError::PreviousCount { previous: previous.len(), vertices: graph.len() });
    }
    let order = edges_wide_first(graph);
    let mut known = previous.to_vec();
    for round in 1..=MOST_ROUNDS {
        let mut regions = merge_inside_old_parts(graph, &order, &known, config);
        let (mut part_of_root, whole) = old_part_of_roots(areas, &known, config, &mut regions);
        let overtaken =
            merge_between_old_parts(graph, &order, &known, config, hysteresis.band, &mut regions, &mut part_of_root);
        if overtaken.is_empty() {
            let least = (1.0 - hysteresis.area_band) * config.min_area;
            let least_of = whole_roots(&whole, &part_of_root, &mut regions).map(|root| (root, least)).collect();
            absorb_small(graph, areas, config.min_area, least_of, &mut regions);
            let labels: Vec<u32> = (0..graph.len() as u32).map(|v| regions.find(v)).collect();
            return Ok(partition_from_labels(graph, &labels, areas));
        }
        for part in &mut known {
            if overtaken.contains(part) || round + 1 == MOST_ROUNDS {
                *part = NO_PART;
            }
        }
    }
    unreachable!("the last round knows no old part, so none is overtaken")
}

/// After so many rounds of step 3 the whole graph is judged anew.
pub const MOST_ROUNDS: usize = 8;

/// Step 1.
fn merge_inside_old_parts(graph: &Graph, order: &[u32], known: &[u32], config: &PinchConfig) -> UnionFind {
    let mut regions = UnionFind::new(graph.len());
    for &edge in order {
        let (u, v) = graph.edges()[edge as usize];
        if known[u as usize] == NO_PART || known[u as usize] != known[v as usize] {
            continue;
        }
        let (a, b) = (regions.find(u), regions.find(v));
        if a == b {
            continue;
        }
        let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
        if !is_border(config, graph.edge_weight(edge as usize), graph.value(younger), graph.value(older)) {
            regions.attach(younger, older);
        }
    }
    regions
}

/// Step 2. Answers the old parts of step 3.
fn merge_between_old_parts(
    graph: &Graph,
    order: &[u32],
    known: &[u32],
    config: &PinchConfig,
    band: f64,
    regions: &mut UnionFind,
    part_of_root: &mut [u32],
) -> BTreeSet<u32> {
    let mut overtaken = BTreeSet::new();
    for &edge in order {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (regions.find(u), regions.find(v));
        let is_inside = known[u as usize] != NO_PART && known[u as usize] == known[v as usize];
        if a == b || is_inside {
            continue;
        }
        let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
        let (saddle, peak, higher_peak) = (graph.edge_weight(edge as usize), graph.value(younger), graph.value(older));
        let (old_a, old_b) = (part_of_root[older as usize], part_of_root[younger as usize]);
        let was_border = old_a != old_b && old_a != NO_PART && old_b != NO_PART;
        let leniency = if was_border { band * peak } else { 0.0 };
        if saddle < peak && is_border(config, saddle - leniency, peak, higher_peak) {
            continue;
        }
        if was_border {
            overtaken.extend([old_a, old_b]);
            continue;
        }
        regions.attach(younger, older);
        if old_a == NO_PART {
            part_of_root[older as usize] = old_b;
        }
    }
    overtaken
}

/// The roots of regions that go on with an old part in one piece.
fn whole_roots<'a>(
    whole: &'a BTreeSet<u32>,
    part_of_root: &'a [u32],
    regions: &'a mut UnionFind,
) -> impl Iterator<Item = u32> + 'a {
    let roots = (0..part_of_root.len() as u32).filter(|&v| whole.contains(&part_of_root[v as usize]));
    roots.filter(|&v| regions.find(v) == v)
}

/// By root of a region, the old part it goes on with: each part's largest region does, and what else is large enough to be a part. And the
/// old parts that are still in one piece.
fn old_part_of_roots(
    areas: &[f64],
    known: &[u32],
    config: &PinchConfig,
    regions: &mut UnionFind,
) -> (Vec<u32>, BTreeSet<u32>) {
    let mut area = vec![0.0; known.len()];
    for v in 0..known.len() as u32 {
        area[regions.find(v) as usize] += areas[v as usize];
    }
    let mut part_of_root = vec![NO_PART; known.len()];
    let mut largest: BTreeMap<u32, u32> = BTreeMap::new();
    let mut broken = BTreeSet::new();
    for root in 0..known.len() as u32 {
        let part = known[root as usize];
        if part == NO_PART || regions.find(root) != root {
            continue;
        }
        if area[root as usize] >= config.min_area {
            part_of_root[root as usize] = part;
        }
        match largest.entry(part) {
            Entry::Vacant(entry) => {
                entry.insert(root);
            }
            Entry::Occupied(mut first) => {
                broken.insert(part);
                if area[root as usize] > area[*first.get() as usize] {
                    first.insert(root);
                }
            }
        }
    }
    for (&part, &root) in &largest {
        part_of_root[root as usize] = part;
    }
    let whole = largest.into_keys().filter(|part| !broken.contains(part)).collect();
    (part_of_root, whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pinch;

    fn path(values: &[f64]) -> Graph {
        let edges = (1..values.len() as u32).map(|v| (v - 1, v)).collect();
        Graph::new(values.to_vec(), edges, None).expect("valid")
    }

    fn check(values: &[f64], previous: &[u32], min_area: f64, expected: &[u32]) {
        let config = PinchConfig { min_area, ..PinchConfig::default() };
        let areas = vec![1.0; values.len()];
        let found = pinch_from(&path(values), &areas, &config, previous, &HysteresisConfig::default());
        assert_eq!(found.expect("valid").part_of, expected);
    }

    const NEW: u32 = NO_PART;

    #[test]
    fn between_rho_and_rho_plus_band_a_border_is_what_it_was() {
        // The rule asks for 0.88; rooms of 2.0 and 1.0, so 0.90 lies in the band, 0.87 below and 0.92 above.
        check(&[2.0, 0.90, 1.0], &[7, 7, 3], 0.0, &[0, 0, 1]);
        check(&[2.0, 0.90, 1.0], &[7, 7, 7], 0.0, &[0, 0, 0]);
        check(&[2.0, 0.90, 1.0], &[NEW; 3], 0.0, &[0, 0, 0]);
        check(&[2.0, 0.87, 1.0], &[7, 7, 7], 0.0, &[0, 0, 1]);
        check(&[2.0, 0.92, 1.0], &[7, 7, 3], 0.0, &[0, 0, 0]);
    }

    #[test]
    fn a_new_vertex_goes_by_the_plain_rule() {
        // What was not known before needs the rule itself, beside a known border in the band.
        check(&[2.0, 0.90, 1.0, 0.90, 1.01], &[7, 7, 3, NEW, NEW], 0.0, &[0, 0, 1, 1, 1]);
    }

    #[test]
    fn a_bay_stays_with_its_room_while_the_wider_way_changes_sides() {
        // The bay (1.0) opens to both rooms by 0.95 and 0.96: the plain rule gives it to the wider way.
        let values = [2.0, 0.95, 1.0, 0.96, 1.9];
        assert_eq!(pinch(&path(&values), &[1.0; 5], &PinchConfig::default()).expect("valid").part_of, [0, 0, 1, 1, 1]);
        check(&values, &[0, 0, 0, 1, 1], 0.0, &[0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_border_in_the_wrong_place_moves_to_the_door() {
        // Seen from afar the border lay at vertex 3; the door of 0.4 is at vertex 1.
        check(&[2.0, 0.4, 0.9, 1.2, 1.6, 1.9], &[0, 0, 0, 1, 1, 1], 1.5, &[0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn an_old_part_may_be_a_little_too_small() {
        check(&[2.0, 2.0, 0.4, 0.9], &[0, 0, 0, 1], 1.1, &[0, 0, 0, 1]);
        check(&[2.0, 2.0, 0.4, 0.9], &[0; 4], 1.1, &[0, 0, 0, 0]);
        check(&[2.0, 2.0, 0.4, 0.9], &[0, 0, 0, 1], 1.2, &[0, 0, 0, 0]);
    }

    #[test]
    fn bad_input_is_named() {
        let graph = path(&[1.0, 2.0]);
        let (config, good) = (PinchConfig::default(), HysteresisConfig::default());
        let refused = |previous: &[u32], hysteresis| {
            pinch_from(&graph, &[1.0; 2], &config, previous, &hysteresis).expect_err("refused")
        };
        assert_eq!(refused(&[0], good), HysteresisError::PreviousCount { previous: 1, vertices: 2 });
        assert!(matches!(refused(&[0, 0], HysteresisConfig { band: f64::NAN, ..good }), HysteresisError::Band { .. }));
        let wide = HysteresisConfig { area_band: 1.5, ..good };
        assert_eq!(refused(&[0, 0], wide), HysteresisError::AreaBand { value: 1.5 });
    }
}
