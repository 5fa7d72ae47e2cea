//! Parts of the aerial planner.
pub mod certificate;
pub mod minco;
pub mod polytope;
pub mod trajectory;
