//! The default room rule: keep a border where the way is pinched and both sides stand out.
//!
//! Edges enter from wide to narrow. When an edge joins two regions of peaks P >= p, they keep their border iff the saddle s satisfies
//! s <= rho p and s <= sigma P (pinched: the way is narrower than the smaller room, and clearly narrower than the larger)
//! and p - s >= tau (prominent: not noise). Otherwise the regions merge. The second half of the first condition keeps corridors together: a corridor is
//! 1.25 times as wide at a T as along its way, so two junctions look like two rooms with a door of 0.8 between them. This is ToMATo
//! (Chazal et al. 2013) with a relative merge predicate, so that a 0.8 m door and a 2 m opening need not share one threshold. Regions
//! below `min_area` are absorbed afterwards across their widest border.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use thiserror::Error;

use crate::Graph;
use crate::areas::{AreaError, check_areas, check_least};
use crate::order::edges_wide_first;
use crate::partition::{Partition, borders, partition_from_labels};
use crate::union_find::UnionFind;

/// Parameters of [`pinch`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinchConfig {
    /// A border needs saddle <= rho * (lower peak). In [0, 1]. Default 0.88; this and the next two were found on ten floor plans.
    pub rho: f64,
    /// A border needs saddle <= sigma * (higher peak). In [0, 1]; 1 asks nothing. Default 0.75.
    pub sigma: f64,
    /// A border needs (lower peak) - saddle >= tau, in the unit of the values. Default 0.07.
    pub tau: f64,
    /// Smaller regions are absorbed, in the unit of `areas`. Default 1.5 (square metres).
    pub min_area: f64,
}

impl Default for PinchConfig {
    fn default() -> Self {
        PinchConfig { rho: 0.88, sigma: 0.75, tau: 0.07, min_area: 1.5 }
    }
}

/// Why [`pinch`] refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PinchError {
    /// `rho` is outside [0, 1].
    #[error("rho {value} is outside [0, 1]")]
    Rho {
        /// The value given.
        value: f64,
    },
    /// `sigma` is outside [0, 1].
    #[error("sigma {value} is outside [0, 1]")]
    Sigma {
        /// The value given.
        value: f64,
    },
    /// `tau` is negative or not finite.
    #[error("tau {value} is negative or not finite")]
    Tau {
        /// The value given.
        value: f64,
    },
    /// The areas, or the smallest one asked for.
    #[error(transparent)]
    Areas(#[from] AreaError),
}

impl PinchConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`PinchError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), PinchError> {
        if !(0.0..=1.0).contains(&self.rho) {
            return Err(PinchError::Rho { value: self.rho });
        }
        if !(0.0..=1.0).contains(&self.sigma) {
            return Err(PinchError::Sigma { value: self.sigma });
        }
        if !self.tau.is_finite() || self.tau < 0.0 {
            return Err(PinchError::Tau { value: self.tau });
        }
        Ok(check_least(self.min_area)?)
    }
}

/// Parts of the graph separated by pinched ways. `areas` has one number for each vertex (pixel area, or all ones).
///
/// Values are meant to be lengths (clearances, not negative). Works on sparse place graphs and
/// on pixel graphs ([`crate::grid_graph`]). O(m) for the sort plus O(m alpha(n)).
///
/// # Errors
/// [`PinchError`] if the configuration or the areas are not sound.
pub fn pinch(graph: &Graph, areas: &[f64], config: &PinchConfig) -> Result<Partition, PinchError> {
    check(graph, areas, config)?;
    let mut regions = merge_unless_pinched(graph, config);
    absorb_small(graph, areas, config.min_area, BTreeMap::new(), &mut regions);
    let labels: Vec<u32> = (0..graph.len() as u32).map(|v| regions.find(v)).collect();
    Ok(partition_from_labels(graph, &labels, areas))
}

/// The door of [`pinch`] and [`crate::pinch_from`].
pub(crate) fn check(graph: &Graph, areas: &[f64], config: &PinchConfig) -> Result<(), PinchError> {
    config.validate()?;
    Ok(check_areas(areas, graph.len())?)
}

/// One pass over the edges; the root of a region is its peak.
fn merge_unless_pinched(graph: &Graph, config: &PinchConfig) -> UnionFind {
    let mut regions = UnionFind::new(graph.len());
    for edge in edges_wide_first(graph) {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (regions.find(u), regions.find(v));
        if a == b {
            continue;
        }
        let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
        let (peak, higher_peak) = (graph.value(younger), graph.value(older));
        if !is_border(config, graph.edge_weight(edge as usize), peak, higher_peak) {
            regions.attach(younger, older);
        }
    }
    regions
}

/// Whether a way of this width separates regions of these peaks.
pub(crate) fn is_border(config: &PinchConfig, saddle: f64, peak: f64, higher_peak: f64) -> bool {
    let is_pinched = saddle <= config.rho * peak && saddle <= config.sigma * higher_peak;
    is_pinched && peak - saddle >= config.tau && saddle < peak
}

/// Absorbs regions below `min_area`, smallest first, across the widest (then longest) border. Regions whose roots are in
/// `least_of` need the area that it says instead; what they merge into inherits it.
pub(crate) fn absorb_small(
    graph: &Graph,
    areas: &[f64],
    min_area: f64,
    mut least_of: BTreeMap<u32, f64>,
    regions: &mut UnionFind,
) {
    let mut area = vec![0.0; graph.len()];
    for v in 0..graph.len() as u32 {
        area[regions.find(v) as usize] += areas[v as usize];
    }
    // Only regions with a neighbour matter; an isolated small one stays as it is.
    let mut neighbours: BTreeMap<u32, BTreeMap<u32, (f64, u32)>> = BTreeMap::new();
    for border in borders(graph, |v| regions.find(v)) {
        let width = (border.saddle, border.length);
        neighbours.entry(border.a).or_default().insert(border.b, width);
        neighbours.entry(border.b).or_default().insert(border.a, width);
    }
    // Areas are not negative, so their bits order like the numbers.
    let key = |area: f64, region: u32| Reverse(((area + 0.0).to_bits(), region));
    let mut small: BinaryHeap<_> = neighbours
        .keys()
        .filter(|&&region| area[region as usize] < *least_of.get(&region).unwrap_or(&min_area))
        .map(|&region| key(area[region as usize], region))
        .collect();
    while let Some(Reverse((bits, region))) = small.pop() {
        let is_stale = regions.find(region) != region || area[region as usize].to_bits() != bits;
        if is_stale {
            continue;
        }
        let around = neighbours.remove(&region).unwrap_or_default();
        let Some(target) = widest(&around) else {
            continue;
        };
        let (survivor, absorbed) = if graph.is_older(region, target) { (region, target) } else { (target, region) };
        regions.attach(absorbed, survivor);
        let total = area[region as usize] + area[target as usize];
        area[survivor as usize] = total;
        let mut merged = neighbours.remove(&target).unwrap_or_default();
        merged.remove(&region);
        for (other, (saddle, length)) in around {
            if other != target {
                let entry = merged.entry(other).or_insert((saddle, 0));
                *entry = (entry.0.max(saddle), entry.1 + length);
            }
        }
        for (&other, &width) in &merged {
            let back = neighbours.entry(other).or_default();
            back.remove(&region);
            back.remove(&target);
            back.insert(survivor, width);
        }
        neighbours.insert(survivor, merged);
        if let Some(least) = least_of.remove(&absorbed) {
            least_of.insert(survivor, least);
        }
        if total < *least_of.get(&survivor).unwrap_or(&min_area) {
            small.push(key(total, survivor));
        }
    }
}

/// The neighbour across the highest saddle, then the longest border, then the smaller index.
fn widest(around: &BTreeMap<u32, (f64, u32)>) -> Option<u32> {
    around
        .iter()
        .max_by(|(a, x), (b, y)| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)).then(b.cmp(a)))
        .map(|(&region, _)| region)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(values: &[f64]) -> Graph {
        let edges = (1..values.len() as u32).map(|v| (v - 1, v)).collect();
        Graph::new(values.to_vec(), edges, None).expect("valid")
    }

    fn check(values: &[f64], min_area: f64, expected: &[u32]) -> Partition {
        let config = PinchConfig { min_area, ..PinchConfig::default() };
        let areas = vec![1.0; values.len()];
        let partition = pinch(&path(values), &areas, &config).expect("valid");
        assert_eq!(partition.part_of, expected);
        partition
    }

    #[test]
    fn a_door_of_0_8_and_an_opening_of_2_m_both_separate() {
        // Clearances: room 2.0, door 0.4, room 1.5, opening 1.0, room 1.4.
        let partition = check(&[2.0, 0.4, 1.5, 1.0, 1.4], 0.0, &[0, 0, 1, 1, 2]);
        let borders: Vec<_> = partition.borders.iter().map(|b| (b.a, b.b, b.saddle, b.length)).collect();
        assert_eq!(borders, [(0, 1, 0.4, 1), (1, 2, 1.0, 1)]);
        let peaks: Vec<_> = partition.parts.iter().map(|p| (p.peak, p.members)).collect();
        assert_eq!(peaks, [(0, 2), (2, 2), (4, 1)]);
    }

    #[test]
    fn a_shallow_bump_is_not_a_room() {
        check(&[2.0, 1.8, 1.9], 0.0, &[0, 0, 0]); // neither pinched nor prominent
        check(&[0.3, 0.22, 0.28], 0.0, &[0, 0, 0]); // pinched (0.79) but only 0.06 prominent
    }

    #[test]
    fn a_corridor_is_whole_past_its_junctions_and_a_hall_at_its_end_is_another_room() {
        // Junctions of 1.25 with 1.0 between them (0.8 of both); an opening of the corridor's own width into a hall of 2.0.
        check(&[1.0, 1.25, 1.0, 1.26, 1.0, 2.0], 0.0, &[1, 1, 1, 1, 0, 0]);
    }

    #[test]
    fn small_regions_go_to_the_side_they_are_open_to() {
        // The closet (one vertex of 0.9) has doors of 0.3 to the left and 0.5 to the right.
        check(&[2.0, 1.9, 0.3, 0.9, 0.5, 1.8, 1.7], 3.0, &[0, 0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn an_isolated_small_region_stays_and_bad_input_is_refused() {
        let graph = Graph::new(vec![1.0, 2.0], vec![], None).expect("valid");
        let config = PinchConfig::default();
        assert_eq!(pinch(&graph, &[1.0, 1.0], &config).expect("valid").parts.len(), 2);
        assert!(matches!(pinch(&graph, &[1.0], &config), Err(PinchError::Areas(AreaError::Count { .. }))));
        assert!(matches!(
            pinch(&graph, &[1.0, f64::NAN], &config),
            Err(PinchError::Areas(AreaError::Value { vertex: 1 }))
        ));
        let bad = PinchConfig { rho: f64::NAN, ..config };
        assert!(matches!(pinch(&graph, &[1.0, 1.0], &bad), Err(PinchError::Rho { .. })));
        let bad = PinchConfig { sigma: 1.1, ..config };
        assert!(matches!(pinch(&graph, &[1.0, 1.0], &bad), Err(PinchError::Sigma { .. })));
    }
}
