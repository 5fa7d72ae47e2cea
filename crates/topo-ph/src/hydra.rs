//! A partition after the rule of Hydra (Hughes et al.): one threshold, from the plateau with the most components that is long enough.
//!
//! Like the plateau of Eq. 5 it cuts the whole graph at one threshold, but it counts only components of some size, and prefers many
//! components to a long plateau:
//!
//! ```text
//! k(t) = number of components of K(t) of at least min_area,       t in [t_min, t_max]
//! delta* = low end of argmax { k : the interval of constant k is at least min_ratio times as long as the longest }
//! ```
//! Here for comparison with [`pinch`](crate::pinch()), which is better (docs/measured.md). Departures from Hydra's program: vertices enter with
//! their values too and not all at once; the intervals are exact and not counted in events; growth takes the widest edge first.

use thiserror::Error;

use crate::areas::{AreaError, check_areas, check_least};
use crate::grow::{UNLABELLED, components_at, grow};
use crate::order::edges_wide_first;
use crate::partition::{Partition, partition_from_labels};
use crate::union_find::UnionFind;
use crate::{Bar, Graph, betti_curve};

/// Parameters of [`hydra_partition`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HydraConfig {
    /// Low end of the window, in the unit of the values. Default 0.5, as in Hydra's shipped configurations.
    pub t_min: f64,
    /// High end of the window. Default 1.2.
    pub t_max: f64,
    /// A plateau counts if it is at least this share of the longest one. In [0, 1]. Default 0.25.
    pub min_ratio: f64,
    /// Components smaller than this are not counted, in the unit of `areas`. Default 1 (square metre).
    pub min_area: f64,
}

impl Default for HydraConfig {
    fn default() -> Self {
        HydraConfig { t_min: 0.5, t_max: 1.2, min_ratio: 0.25, min_area: 1.0 }
    }
}

/// Why [`hydra_partition`] refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum HydraError {
    /// The window is empty or not finite.
    #[error("the window [{t_min}, {t_max}] is empty or not finite")]
    Window {
        /// Low end.
        t_min: f64,
        /// High end.
        t_max: f64,
    },
    /// `min_ratio` is outside [0, 1].
    #[error("min_ratio {value} is outside [0, 1]")]
    MinRatio {
        /// The value given.
        value: f64,
    },
    /// The areas, or the smallest one asked for.
    #[error(transparent)]
    Areas(#[from] AreaError),
}

impl HydraConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`HydraError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), HydraError> {
        if !(self.t_min.is_finite() && self.t_max.is_finite() && self.t_min < self.t_max) {
            return Err(HydraError::Window { t_min: self.t_min, t_max: self.t_max });
        }
        if !(0.0..=1.0).contains(&self.min_ratio) {
            return Err(HydraError::MinRatio { value: self.min_ratio });
        }
        Ok(check_least(self.min_area)?)
    }
}

/// Cuts the graph at the threshold of the module text and grows the pieces over all its vertices. A connected component without a piece is
/// one part.
///
/// # Errors
/// [`HydraError`] if the configuration or the areas are not sound.
pub fn hydra_partition(graph: &Graph, areas: &[f64], config: &HydraConfig) -> Result<Partition, HydraError> {
    config.validate()?;
    check_areas(areas, graph.len())?;
    let bars = bars_of_large_components(graph, areas, config.min_area);
    let mut labels = vec![UNLABELLED; graph.len()];
    if let Some(threshold) = crowded_threshold(&bars, config) {
        labels = components_at(graph, threshold);
        let mut area = vec![0.0; graph.len()];
        for (&label, area_of_vertex) in labels.iter().zip(areas) {
            if label == UNLABELLED {
                continue;
            }
            area[label as usize] += area_of_vertex;
        }
        for label in labels.iter_mut().filter(|label| **label != UNLABELLED) {
            if area[*label as usize] < config.min_area {
                *label = UNLABELLED;
            }
        }
    }
    let mut labels = grow(graph, labels);
    let component_of = components_at(graph, f64::NEG_INFINITY);
    for (label, component) in labels.iter_mut().zip(component_of) {
        if *label == UNLABELLED {
            *label = component;
        }
    }
    Ok(partition_from_labels(graph, &labels, areas))
}

/// Bars of the components that have grown to `min_area`: born when they reach it, dead when they join one that reached it before.
pub fn bars_of_large_components(graph: &Graph, areas: &[f64], min_area: f64) -> Vec<Bar> {
    let mut components = UnionFind::new(graph.len());
    let mut area = areas.to_vec();
    // By root; the vertices that are large alone exist from their value on.
    let mut births: Vec<Option<f64>> =
        (0..graph.len()).map(|v| (area[v] >= min_area).then(|| graph.values()[v])).collect();
    let bar = |birth, death, vertex, edge| Bar { birth, death, birth_vertex: vertex, death_edge: edge };
    let mut bars = Vec::new();
    for edge in edges_wide_first(graph) {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (components.find(u), components.find(v));
        if a == b {
            continue;
        }
        let weight = graph.edge_weight(edge as usize);
        let is_a_first = match (births[a as usize], births[b as usize]) {
            (Some(x), Some(y)) => x > y || (x == y && a < b),
            (first, _) => first.is_some(),
        };
        let (survivor, absorbed) = if is_a_first { (a, b) } else { (b, a) };
        components.attach(absorbed, survivor);
        area[survivor as usize] += area[absorbed as usize];
        if let Some(birth) = births[absorbed as usize] {
            bars.push(bar(birth, Some(weight), absorbed, Some(edge)));
        } else if births[survivor as usize].is_none() && area[survivor as usize] >= min_area {
            births[survivor as usize] = Some(weight);
        }
    }
    for v in 0..graph.len() as u32 {
        if let Some(birth) = births[v as usize].filter(|_| components.find(v) == v) {
            bars.push(bar(birth, None, v, None));
        }
    }
    bars.sort_by(|a, b| b.birth.total_cmp(&a.birth).then(a.birth_vertex.cmp(&b.birth_vertex)));
    bars
}

/// Ties: the longer plateau, then the lower.
fn crowded_threshold(bars: &[Bar], config: &HydraConfig) -> Option<f64> {
    let plateaus: Vec<(f64, f64, u32)> = betti_curve(bars)
        .intervals()
        .into_iter()
        .map(|i| (i.low.max(config.t_min), i.high.min(config.t_max), i.count))
        .filter(|(low, high, count)| low < high && *count > 0)
        .collect();
    let longest = plateaus.iter().map(|(low, high, _)| high - low).fold(0.0, f64::max);
    let is_long = |(low, high, _): &(f64, f64, u32)| high - low >= config.min_ratio * longest;
    let (low, high, _) = plateaus.into_iter().filter(is_long).max_by(|a, b| {
        let by_length = (a.1 - a.0).total_cmp(&(b.1 - b.0));
        a.2.cmp(&b.2).then(by_length).then(b.0.total_cmp(&a.0))
    })?;
    // The low end itself belongs to the next interval: step inside by a thousandth of the length.
    Some(low + 1e-3 * (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(values: &[f64]) -> Graph {
        let edges = (1..values.len() as u32).map(|v| (v - 1, v)).collect();
        Graph::new(values.to_vec(), edges, None).expect("valid")
    }

    /// Rooms 2.0, 1.8, 0.9 (two vertices each, the second 0.1 lower); doors 0.4 and 0.7.
    fn three_rooms() -> Graph {
        path(&[2.0, 1.9, 0.4, 1.8, 1.7, 0.7, 0.8, 0.9])
    }

    #[test]
    fn components_count_when_they_have_grown() {
        let bars = bars_of_large_components(&three_rooms(), &[1.0; 8], 2.0);
        let lives: Vec<_> = bars.iter().map(|bar| (bar.birth, bar.death)).collect();
        assert_eq!(lives, [(1.9, None), (1.7, Some(0.4)), (0.8, Some(0.7))]);
    }

    #[test]
    fn many_components_win_over_a_long_plateau_and_the_rest_is_grown() {
        // Two components on (0.8, 1.2] and (0.5, 0.7]; three on (0.7, 0.8], a quarter as long as the longest.
        let check = |min_ratio: f64, expected: &[u32]| {
            let config = HydraConfig { min_ratio, min_area: 2.0, ..HydraConfig::default() };
            let partition = hydra_partition(&three_rooms(), &[1.0; 8], &config).expect("valid");
            assert_eq!(partition.part_of, expected);
        };
        check(0.24, &[0, 0, 0, 1, 1, 1, 2, 2]);
        check(0.26, &[0, 0, 0, 1, 1, 1, 1, 1]);
    }

    #[test]
    fn nothing_large_is_one_part_for_each_component_and_bad_input_is_refused() {
        let graph = Graph::new(vec![1.0, 1.0, 1.0], vec![(0, 1)], None).expect("valid");
        let config = HydraConfig { min_area: 9.0, ..HydraConfig::default() };
        assert_eq!(hydra_partition(&graph, &[1.0; 3], &config).expect("valid").part_of, [0, 0, 1]);
        let refused =
            |config: HydraConfig, areas: &[f64]| hydra_partition(&graph, areas, &config).expect_err("refused");
        assert_eq!(refused(config, &[1.0]), HydraError::from(AreaError::Count { areas: 1, vertices: 3 }));
        assert_eq!(refused(config, &[1.0, -1.0, 1.0]), HydraError::Areas(AreaError::Value { vertex: 1 }));
        assert!(matches!(refused(HydraConfig { t_min: 2.0, ..config }, &[1.0; 3]), HydraError::Window { .. }));
        assert!(matches!(
            refused(HydraConfig { min_ratio: f64::NAN, ..config }, &[1.0; 3]),
            HydraError::MinRatio { .. }
        ));
        assert!(matches!(
            refused(HydraConfig { min_area: -1.0, ..config }, &[1.0; 3]),
            HydraError::Areas(AreaError::Least { .. })
        ));
    }
}
