//! Where seeds lie: whether there is one near a cell.

use rustc_hash::FxHashMap;

/// Seeds by cubes as wide as they must stay apart.
#[derive(Default)]
pub(super) struct SeedIndex {
    cubes: FxHashMap<[i32; 3], Vec<[i32; 3]>>,
    edge: i32,
}

impl SeedIndex {
    pub(super) fn insert(&mut self, at: [i32; 3], spacing_squared: i32) {
        self.edge = spacing_squared.isqrt().max(1) + 1;
        self.cubes.entry(at.map(|v| v.div_euclid(self.edge))).or_default().push(at);
    }

    /// No seed at this squared distance or nearer; it must be below the squared spacing.
    pub(super) fn none_within(&self, here: [i32; 3], squared: i32) -> bool {
        let edge = self.edge.max(1);
        let cube = here.map(|v| v.div_euclid(edge));
        (0..27).all(|k| {
            let other = [cube[0] + k % 3 - 1, cube[1] + k / 3 % 3 - 1, cube[2] + k / 9 - 1];
            self.cubes.get(&other).is_none_or(|seeds| seeds.iter().all(|at| gap(*at, here) > squared))
        })
    }
}

/// Squared distance of two cells.
pub(super) fn gap(a: [i32; 3], b: [i32; 3]) -> i32 {
    (0..3).map(|k| (a[k] - b[k]).pow(2)).sum()
}
