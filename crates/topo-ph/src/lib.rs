//! Numbers on a graph go in; barcode, Betti curve, merge tree and a partition into parts come out.
//!
//! # The problem
//! ```text
//! K(t) = { v : R(v) >= t },  edges with w(e) = min(R(u), R(v), c(e)) >= t        grows as t falls
//! beta_0(t) = number of components of K(t) = number of bars with death < t <= birth
//! delta* = argmax { |d_j - d_i| : beta_0 = k on (d_i, d_j], k > 1 }               OmniVLN Eq. 5
//! ```
//! | paper | here | unit |
//! | --- | --- | --- |
//! | R(v) | [`Graph::value`] | of the caller (clearance: metres) |
//! | beta_0 | [`BettiCurve::at`] | components |
//! | delta | `t`, a threshold | as R |
//! | delta* | [`Plateau::threshold`] | as R |
//!
//! If R is the clearance of places in a building, peaks are the middles of rooms and saddles are doors.
//!
//! # Example
//! ```
//! use topo_ph::{Graph, PinchConfig, barcode, nonzero, pinch};
//! // Two rooms (clearance 2.0 and 1.8) with a door of clearance 0.4 between them.
//! let graph = Graph::new(vec![2.0, 1.5, 0.4, 1.2, 1.8], vec![(0, 1), (1, 2), (2, 3), (3, 4)], None)?;
//! let bars = nonzero(&barcode(&graph));
//! assert_eq!((bars[1].birth, bars[1].death), (1.8, Some(0.4)));
//! let rooms = pinch(&graph, &[1.0; 5], &PinchConfig::default())?;
//! assert_eq!(rooms.part_of, [0, 0, 0, 1, 1]);
//! assert_eq!(rooms.borders[0].saddle, 0.4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How it works
//! 1. [`Graph::new`] checks the numbers once ([`graph`]).
//! 2. Edges are sorted from wide to narrow; a union-find with the elder rule gives the [`barcode()`];
//!    [`deaths()`] is the same as one number a vertex, without sorting edges, for graphs of millions.
//! 3. [`betti_curve`] sweeps over births and deaths; [`plateau()`] picks the longest stable count (Eq. 5) and
//!    [`plateau_partition`] grows its components over the whole graph; [`hydra_partition`] picks as Hydra does, for comparison.
//! 4. [`pinch()`] is the default partition: a border stays where the way is clearly narrower than both sides;
//!    [`pinch_from`] knows the partition before, and noise does not move it ([`hysteresis`]).
//! 5. [`MergeTree`] keeps all thresholds at once; [`simplify()`] cuts the peaks down that are no peaks; [`match_parts`] carries names from one partition to the next.
//!    [`EditableGraph`] keeps the barcode of a graph that changes.
//! 6. [`bottleneck`], [`wasserstein1`], [`wasserstein2`] say how far two barcodes are apart.
//!
//! # Conventions
//! Larger is older; ties go to the smaller vertex index, then edges by their end points, so nothing depends on the
//! order of the edges. Empty and disconnected graphs are fine. NaN is refused by [`Graph::new`]. Same input, same
//! output, to the byte.
//!
//! # What it does not do
//! It knows no rooms, metres or robots; dimension 0 (and the births of cycles) only.
//!
//! # References
//! - Hughes et al., "Foundations of Spatial Perception for Robotics", IJRR 2024 (room finding by persistent homology).
//! - Chazal, Guibas, Oudot, Skraba, "Persistence-Based Clustering in Riemannian Manifolds", JACM 2013 (ToMATo).
//! - Cohen-Steiner, Edelsbrunner, Harer, "Stability of Persistence Diagrams", DCG 2007.

mod areas;
pub mod assignment;
pub mod barcode;
pub mod betti;
pub mod deaths;
pub mod distance;
pub mod graph;
pub mod grow;
pub mod hydra;
pub mod hysteresis;
pub mod identity;
pub mod incremental;
pub mod merge_tree;
mod order;
pub mod partition;
pub mod pinch;
pub mod plateau;
pub mod simplify;
mod union_find;

pub use areas::AreaError;
pub use assignment::assign;
pub use barcode::{Bar, barcode, cycle_births, nonzero};
pub use betti::{BettiCurve, Interval, betti_curve};
pub use deaths::deaths;
pub use distance::{bottleneck, wasserstein1, wasserstein2};
pub use graph::{Graph, GraphError, grid_graph};
pub use grow::components_at;
pub use hydra::{HydraConfig, HydraError, bars_of_large_components, hydra_partition};
pub use hysteresis::{HysteresisConfig, HysteresisError, pinch_from};
pub use identity::{IdentityConfig, IdentityError, Lost, NO_PART, Origin, PartMatching, match_parts};
pub use incremental::{EditError, EditableGraph};
pub use merge_tree::{MergeNode, MergeTree};
pub use partition::{Border, Part, Partition};
pub use pinch::{PinchConfig, PinchError, pinch};
pub use plateau::{Pick, Plateau, PlateauConfig, PlateauError, PlateauOutcome, plateau, plateau_partition};
pub use simplify::simplify;
