//! Which cells lie on the generalised Voronoi diagram of the obstacles.

use nalgebra::Vector3;

use crate::distance_field::DistanceField;

/// Number of nearest obstacles of a cell in clearly different directions: obstacles of the 26 cells around that are, from here, within one
/// cell as near as its own, and more than 60 degrees apart from those counted before. A cell with two or more lies on the generalised
/// Voronoi diagram of the obstacles (Lau, Sprunk and Burgard 2013). A cell beyond the largest distance has one.
pub(crate) fn basis_points(field: &DistanceField, cell: usize) -> u8 {
    let at = field.coordinates(cell);
    let vector = |obstacle: [usize; 3]| Vector3::from_fn(|axis, _| obstacle[axis] as f64 - at[axis] as f64);
    let Some(own) = field.obstacle_of(cell) else {
        return 1;
    };
    let limit = vector(own).norm() + 1.0;
    let mut directions = vec![vector(own).normalize()];
    let range = |axis: usize| at[axis].saturating_sub(1)..=(at[axis] + 1).min(field.size[axis] - 1);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let Some(other) = field.obstacle_of(field.number([x, y, z])) else {
                    continue;
                };
                let v = vector(other);
                let length = v.norm();
                if length > 0.0 && length <= limit && directions.iter().all(|d| d.dot(&v) < 0.5 * length) {
                    directions.push(v / length);
                }
            }
        }
    }
    directions.len().min(255) as u8
}
