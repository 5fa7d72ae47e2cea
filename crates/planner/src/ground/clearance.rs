//! Exact distance from every lattice point to the nearest blocked square (two passes, Meijster et al. 2000).
//!
//! Seen from a lattice point the nearest point of a unit square on the lattice is one of its corners, so the
//! ordinary squared Euclidean transform of "corners of blocked cells" gives the distance to the *squares*,
//! in whole numbers and without rounding.

use super::grid::PaddedGrid;

/// Squared distances in cells at the `(width + 1) x (height + 1)` lattice points of a padded grid.
#[derive(Debug, Clone)]
pub(crate) struct ClearanceField {
    pub nx: usize,
    pub ny: usize,
    squared: Vec<u32>,
}

/// Half the diagonal of a cell: a point is never further than this from its nearest lattice point.
pub(crate) const HALF_DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;

impl ClearanceField {
    pub fn new(grid: &PaddedGrid) -> Self {
        let (nx, ny) = (grid.width + 1, grid.height + 1);
        let squared = squared_distances(nx, ny, |i, j| {
            let on_border = i == 0 || j == 0 || i + 1 == nx || j + 1 == ny;
            let cell = |x: usize, y: usize| grid.blocked[y * grid.width + x];
            on_border || cell(i, j) || cell(i - 1, j) || cell(i, j - 1) || cell(i - 1, j - 1)
        });
        ClearanceField { nx, ny, squared }
    }

    pub fn squared(&self, i: usize, j: usize) -> u32 {
        self.squared[j * self.nx + i]
    }

    pub fn squared_all(&self) -> &[u32] {
        &self.squared
    }

    /// Distance at the lattice point nearest to `(x, y)`; the true distance there differs by at most
    /// [`HALF_DIAGONAL`]. Points outside the lattice have 0.
    pub fn nearest(&self, x: f64, y: f64) -> f64 {
        let (i, j) = ((x + 0.5).floor(), (y + 0.5).floor());
        if !(i >= 0.0 && j >= 0.0 && i < self.nx as f64 && j < self.ny as f64) {
            return 0.0;
        }
        f64::from(self.squared(i as usize, j as usize)).sqrt()
    }
}

/// Squared distance from every point of an `nx` x `ny` lattice to the nearest feature, exact; `(nx + ny)^2` if there is none.
pub(crate) fn squared_distances(nx: usize, ny: usize, is_feature: impl Fn(usize, usize) -> bool) -> Vec<u32> {
    // First pass: distance (not squared) to the nearest feature in the same column.
    let far = (nx + ny) as u32;
    let mut distance = vec![0u32; nx * ny];
    for j in 0..ny {
        for i in 0..nx {
            let above = if j == 0 { far } else { distance[(j - 1) * nx + i] };
            distance[j * nx + i] = if is_feature(i, j) { 0 } else { (above + 1).min(far) };
        }
    }
    for j in (0..ny.saturating_sub(1)).rev() {
        for i in 0..nx {
            let below = distance[(j + 1) * nx + i] + 1;
            let here = &mut distance[j * nx + i];
            *here = (*here).min(below);
        }
    }
    // Second pass: lower envelope of the parabolas (x - i)^2 + height(i) along each row.
    let mut apex: Vec<i64> = Vec::with_capacity(nx);
    let mut from: Vec<i64> = Vec::with_capacity(nx);
    let mut height: Vec<i64> = vec![0; nx];
    for row in distance.chunks_exact_mut(nx) {
        for (h, &g) in height.iter_mut().zip(row.iter()) {
            *h = i64::from(g) * i64::from(g);
        }
        apex.clear();
        from.clear();
        for u in 0..nx as i64 {
            let value = |x: i64, i: i64| (x - i) * (x - i) + height[i as usize];
            while let (Some(&i), Some(&start)) = (apex.last(), from.last()) {
                if value(start, i) <= value(start, u) {
                    break;
                }
                apex.pop();
                from.pop();
            }
            let first = match apex.last() {
                None => 0,
                // The first x where parabola u is below parabola i.
                Some(&i) => (u * u - i * i + height[u as usize] - height[i as usize]).div_euclid(2 * (u - i)) + 1,
            };
            if first < nx as i64 {
                apex.push(u);
                from.push(first);
            }
        }
        let mut segment = apex.len() - 1;
        for x in (0..nx as i64).rev() {
            while from[segment] > x {
                segment -= 1;
            }
            let i = apex[segment];
            row[x as usize] = ((x - i) * (x - i) + height[i as usize]) as u32;
        }
    }
    distance
}

#[cfg(test)]
mod tests {
    use super::super::grid::GridView;
    use super::*;
    use nalgebra::Point2;

    #[test]
    fn equals_brute_force_on_a_scattered_grid() {
        let (width, height) = (17, 13);
        let blocked: Vec<bool> = (0..width * height).map(|k| (k * 7919) % 23 == 0).collect();
        let view = GridView { origin: Point2::origin(), resolution_m: 1.0, width, height, blocked: &blocked };
        let grid = PaddedGrid::new(&view).unwrap();
        let field = ClearanceField::new(&grid);
        for j in 0..field.ny {
            for i in 0..field.nx {
                let exact = grid.distance_to_blocked(&Point2::new(i as f64, j as f64), 30.0);
                assert_eq!(f64::from(field.squared(i, j)).sqrt(), exact, "at {i},{j}");
            }
        }
    }
}
