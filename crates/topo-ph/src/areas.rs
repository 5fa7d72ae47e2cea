//! The areas of vertices: one each, none negative.

use thiserror::Error;

/// Why areas were refused.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum AreaError {
    /// There is not exactly one area for each vertex.
    #[error("{areas} areas for {vertices} vertices")]
    Count {
        /// Number of areas.
        areas: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// An area is negative or not finite.
    #[error("the area of vertex {vertex} is negative or not finite")]
    Value {
        /// Index of the vertex.
        vertex: usize,
    },
    /// The smallest area asked for is negative or not finite.
    #[error("min_area {value} is negative or not finite")]
    Least {
        /// The value given.
        value: f64,
    },
}

/// The areas of a graph of so many vertices.
pub(crate) fn check_areas(areas: &[f64], vertices: usize) -> Result<(), AreaError> {
    if areas.len() != vertices {
        return Err(AreaError::Count { areas: areas.len(), vertices });
    }
    match areas.iter().position(|area| !(area.is_finite() && *area >= 0.0)) {
        Some(vertex) => Err(AreaError::Value { vertex }),
        None => Ok(()),
    }
}

/// The smallest area asked for.
pub(crate) fn check_least(value: f64) -> Result<(), AreaError> {
    if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(AreaError::Least { value }) }
}
