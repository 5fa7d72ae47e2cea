//! The longest stable plateau of the Betti curve (OmniVLN Eq. 5) and the partition it induces.
//!
//! The paper maximises the length of an interval of thresholds on which the number of components keeps a value
//! k > 1. Departures, each because the literal text fails on real maps: only a window of thresholds is searched
//! (otherwise the plateau next to zero or the maximum wins), bars shorter than `min_persistence` are not counted
//! (noise), ties are settled, a graph without such a plateau is one part, and each connected component of the
//! graph is looked at on its own.

use thiserror::Error;

use crate::grow::{UNLABELLED, components_at, grow};
use crate::partition::{Partition, partition_from_labels};
use crate::union_find::UnionFind;
use crate::{Bar, Graph, barcode, betti_curve};

/// Which threshold of the plateau to take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Pick {
    /// Just above the low end: the largest seeds.
    Low,
    /// The middle: farthest from both changes.
    #[default]
    Mid,
    /// The high end: the smallest seeds.
    High,
}

/// Parameters of [`plateau`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateauConfig {
    /// Low end of the window, in the unit of the values. Default 0.3 (a clearance of 0.3 m: half a narrow door).
    pub t_min: f64,
    /// High end of the window. Default 1.2.
    pub t_max: f64,
    /// Bars shorter than this are not counted. Default 0.1.
    pub min_persistence: f64,
    /// Which threshold of the plateau to take. Default: the middle.
    pub pick: Pick,
}

impl Default for PlateauConfig {
    fn default() -> Self {
        PlateauConfig { t_min: 0.3, t_max: 1.2, min_persistence: 0.1, pick: Pick::Mid }
    }
}

impl PlateauConfig {
    /// Checks the window and the persistence limit.
    ///
    /// # Errors
    /// [`PlateauError`] names the value that is wrong.
    pub fn validate(&self) -> Result<(), PlateauError> {
        let is_window = self.t_min.is_finite() && self.t_max.is_finite() && self.t_min < self.t_max;
        if !is_window {
            return Err(PlateauError::Window { t_min: self.t_min, t_max: self.t_max });
        }
        if !self.min_persistence.is_finite() || self.min_persistence < 0.0 {
            return Err(PlateauError::MinPersistence { value: self.min_persistence });
        }
        Ok(())
    }
}

/// Why a [`PlateauConfig`] was refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PlateauError {
    /// The window is empty or not finite.
    #[error("the window [{t_min}, {t_max}] is empty or not finite")]
    Window {
        /// Low end.
        t_min: f64,
        /// High end.
        t_max: f64,
    },
    /// The persistence limit is negative or not finite.
    #[error("the persistence limit {value} is negative or not finite")]
    MinPersistence {
        /// The value given.
        value: f64,
    },
}

/// The winning plateau.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plateau {
    /// Lower end of the interval (not included), clipped to the window.
    pub low: f64,
    /// Upper end of the interval (included), clipped to the window.
    pub high: f64,
    /// Number of components on it (at least 2).
    pub count: u32,
    /// The threshold taken from it.
    pub threshold: f64,
    /// How far every value may move before the count at `threshold` can change.
    pub margin: f64,
}

/// What [`plateau`] found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlateauOutcome {
    /// A stable number of components greater than one.
    Found(Plateau),
    /// The count is never above one inside the window: the graph is one part.
    SinglePart,
}

/// The longest interval of the window on which the count of persistent bars stays the same and is above one.
///
/// Ties: longer, then more components, then the lower interval.
///
/// # Errors
/// [`PlateauError`] if the configuration is not sound.
pub fn plateau(bars: &[Bar], config: &PlateauConfig) -> Result<PlateauOutcome, PlateauError> {
    config.validate()?;
    let counted: Vec<Bar> = bars
        .iter()
        .filter(|bar| bar.persistence() >= config.min_persistence && bar.persistence() > 0.0)
        .copied()
        .collect();
    // OmniVLN Eq. 5: argmax over intervals |delta_j - delta_i| with beta_0 = k on the interval, k > 1.
    let best = betti_curve(&counted)
        .intervals()
        .into_iter()
        .filter(|interval| interval.count > 1)
        .map(|i| (i.low.max(config.t_min), i.high.min(config.t_max), i.count))
        .filter(|&(low, high, _)| low < high)
        .max_by(|a, b| {
            let by_length = (a.1 - a.0).total_cmp(&(b.1 - b.0));
            by_length.then(a.2.cmp(&b.2)).then(b.0.total_cmp(&a.0))
        });
    let Some((low, high, count)) = best else {
        return Ok(PlateauOutcome::SinglePart);
    };
    let threshold = match config.pick {
        // The low end itself belongs to the next interval: step inside by a thousandth of the length.
        Pick::Low => low + 1e-3 * (high - low),
        Pick::Mid => 0.5 * (low + high),
        Pick::High => high,
    };
    let margin = counted
        .iter()
        .flat_map(|bar| [Some(bar.birth), bar.death])
        .flatten()
        .map(|level| (level - threshold).abs())
        .fold(f64::INFINITY, f64::min);
    Ok(PlateauOutcome::Found(Plateau { low, high, count, threshold, margin }))
}

/// Cuts each connected component of the graph at its own plateau and grows the pieces over all its vertices.
///
/// Seeds are the components of K(threshold) that persist. Growth takes the widest edge first, so a narrow place goes to the
/// side it is more open to. A component without a plateau is one part.
///
/// # Errors
/// [`PlateauError`] if the configuration is not sound.
pub fn plateau_partition(graph: &Graph, config: &PlateauConfig) -> Result<Partition, PlateauError> {
    config.validate()?;
    let bars = barcode(graph);
    let seeds = seed_labels(graph, &bars, config)?;
    let labels = grow(graph, seeds);
    Ok(partition_from_labels(graph, &labels, &vec![1.0; graph.len()]))
}

/// Label of each vertex that lies in a seed: the index of the seed's peak.
fn seed_labels(graph: &Graph, bars: &[Bar], config: &PlateauConfig) -> Result<Vec<u32>, PlateauError> {
    let component_of = components_at(graph, f64::NEG_INFINITY);
    let mut bars_of: Vec<Vec<Bar>> = vec![Vec::new(); graph.len()];
    for bar in bars {
        bars_of[component_of[bar.birth_vertex as usize] as usize].push(*bar);
    }
    // The threshold of each connected component; minus infinity keeps the component whole.
    let mut threshold_of = vec![f64::NEG_INFINITY; graph.len()];
    for (component, bars) in bars_of.iter().enumerate() {
        if let PlateauOutcome::Found(found) = plateau(bars, config)? {
            threshold_of[component] = found.threshold;
        }
    }
    let threshold = |v: u32| threshold_of[component_of[v as usize] as usize];
    let mut pieces = UnionFind::new(graph.len());
    for (edge, &(u, v)) in graph.edges().iter().enumerate() {
        if graph.edge_weight(edge) >= threshold(u) {
            let (a, b) = (pieces.find(u), pieces.find(v));
            if a != b {
                let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
                pieces.attach(younger, older);
            }
        }
    }
    let mut is_seed = vec![false; graph.len()];
    for bar in bars {
        let t = threshold(bar.birth_vertex);
        let is_essential = bar.death.is_none();
        let is_counted = bar.persistence() >= config.min_persistence && bar.is_alive(t);
        is_seed[bar.birth_vertex as usize] = is_essential || is_counted;
    }
    let label = |v: u32| {
        let peak = pieces.find(v);
        let is_in_seed = graph.value(v) >= threshold(v) && is_seed[peak as usize];
        if is_in_seed { peak } else { UNLABELLED }
    };
    Ok((0..graph.len() as u32).map(label).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(values: &[f64]) -> Graph {
        let edges = (1..values.len() as u32).map(|v| (v - 1, v)).collect();
        Graph::new(values.to_vec(), edges, None).expect("valid")
    }

    #[test]
    fn eq_5_longest_plateau_with_more_than_one_component() {
        // Doors 0.4 and 0.7; rooms 2.0, 1.8, 0.9: three components on (0.7, 0.9], two on (0.4, 0.7] and (0.9, 1.8].
        let graph = path(&[2.0, 0.4, 1.8, 0.7, 0.9]);
        let config = PlateauConfig::default();
        let PlateauOutcome::Found(found) = plateau(&barcode(&graph), &config).expect("valid") else {
            panic!("there is a plateau");
        };
        // The window ends at 1.2, so (0.9, 1.2] and (0.4, 0.7] are both 0.3 long: the lower one wins up to rounding.
        assert_eq!(found.count, 2);
        assert!((found.high - found.low - 0.3).abs() < 1e-12);
        assert!((found.margin - 0.15).abs() < 1e-12);
    }

    #[test]
    fn growth_labels_the_doors_too() {
        let graph = path(&[2.0, 0.4, 0.5, 1.8]);
        let partition = plateau_partition(&graph, &PlateauConfig::default()).expect("valid");
        assert_eq!(partition.part_of, [0, 0, 1, 1]);
        assert_eq!((partition.borders.len(), partition.borders[0].saddle), (1, 0.4));
    }

    #[test]
    fn no_plateau_is_one_part_for_each_component() {
        let graph = Graph::new(vec![1.0, 1.1, 1.0], vec![(0, 1)], None).expect("valid");
        assert_eq!(plateau_partition(&graph, &PlateauConfig::default()).expect("valid").parts.len(), 2);
        let bad = PlateauConfig { t_min: 2.0, ..PlateauConfig::default() };
        assert!(matches!(plateau(&[], &bad), Err(PlateauError::Window { .. })));
        assert_eq!(plateau(&[], &PlateauConfig::default()), Ok(PlateauOutcome::SinglePart));
    }
}
