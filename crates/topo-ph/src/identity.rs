//! Which part of a new partition is which part of the old one: parts keep their names while the graph changes.
//!
//! Overlaps are counted over the vertices that both partitions know. One-to-one matches of the greatest total IoU
//! come first; what is left over split off, was merged, was born or is gone.

use thiserror::Error;

use crate::assignment::assign;

/// Marks a vertex that one of the partitions does not have.
pub const NO_PART: u32 = u32::MAX;

/// Parameters of [`match_parts`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentityConfig {
    /// A match needs at least this intersection over union. Default 0.3.
    pub min_iou: f64,
    /// A part belongs to another if at least this share of its weight lies in it. Default 0.5.
    pub min_share: f64,
}

impl Default for IdentityConfig {
    fn default() -> Self {
        IdentityConfig { min_iou: 0.3, min_share: 0.5 }
    }
}

/// Where a new part comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// It is the old part.
    Survived {
        /// Index of the old part.
        old: u32,
        /// Intersection over union.
        iou: f64,
    },
    /// It is the union of old parts of which none is alike; it takes the name of the first.
    Merged {
        /// The old parts, the oldest (smallest index) first.
        from: Vec<u32>,
    },
    /// It split off an old part that lives on elsewhere (or, if `keeps_identity`, is its largest piece).
    Split {
        /// Index of the old part.
        from: u32,
        /// Whether it takes the old part's name.
        keeps_identity: bool,
    },
    /// It overlaps no old part enough.
    Born,
}

/// What became of an old part whose name no new part carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lost {
    /// At least half of it lies in this new part.
    MergedInto(u32),
    /// It is nowhere.
    Gone,
}

/// Result of [`match_parts`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartMatching {
    /// For each new part, where it comes from.
    pub origins: Vec<Origin>,
    /// Old parts without an heir, ascending.
    pub lost: Vec<(u32, Lost)>,
}

impl PartMatching {
    /// The old part whose name the new part carries on. One-to-one.
    pub fn heir_of(&self, new: u32) -> Option<u32> {
        match self.origins.get(new as usize)? {
            Origin::Survived { old, .. } => Some(*old),
            Origin::Merged { from } => from.first().copied(),
            Origin::Split { from, keeps_identity: true } => Some(*from),
            Origin::Split { .. } | Origin::Born => None,
        }
    }
}

/// Why [`match_parts`] refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum IdentityError {
    /// The three slices are not equally long.
    #[error("{old} old parts, {new} new parts and {weights} weights of vertices")]
    Length {
        /// Length of `old_part_of`.
        old: usize,
        /// Length of `new_part_of`.
        new: usize,
        /// Length of `weights`.
        weights: usize,
    },
    /// A weight is negative or not finite.
    #[error("the weight of vertex {vertex} is negative or not finite")]
    Weight {
        /// Index of the vertex.
        vertex: usize,
    },
}

/// Matches the parts of two partitions of the same vertices ([`NO_PART`] where a vertex is missing in one).
///
/// Parts are numbered from zero; a smaller old index is an older name. O(n + k^3) for k parts.
///
/// # Errors
/// [`IdentityError`] if the lengths differ or a weight is not sound.
pub fn match_parts(
    old_part_of: &[u32],
    new_part_of: &[u32],
    weights: &[f64],
    config: &IdentityConfig,
) -> Result<PartMatching, IdentityError> {
    let (old, new, count) = (old_part_of.len(), new_part_of.len(), weights.len());
    if old != new || new != count {
        return Err(IdentityError::Length { old, new, weights: count });
    }
    if let Some(vertex) = weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
        return Err(IdentityError::Weight { vertex });
    }
    let overlap = Overlap::new(old_part_of, new_part_of, weights);
    let mut heir: Vec<Option<u32>> = vec![None; overlap.old_weight.len()];
    let mut origins = survivors(&overlap, config, &mut heir);
    let is_inside = |shared: f64, whole: f64| shared > 0.0 && shared >= config.min_share * whole;
    // Merges before splits: a new part that swallowed several old ones is not a piece of one of them.
    for (new, origin) in origins.iter_mut().enumerate().filter(|(_, origin)| **origin == Origin::Born) {
        let lies_inside = |old: usize| is_inside(overlap.at(old, new), overlap.old_weight[old]);
        let from: Vec<u32> =
            (0..heir.len()).filter(|&old| heir[old].is_none() && lies_inside(old)).map(|old| old as u32).collect();
        if from.len() >= 2 {
            heir[from[0] as usize] = Some(new as u32);
            *origin = Origin::Merged { from };
        }
    }
    // Largest pieces first, so that the largest keeps the name.
    let mut pieces: Vec<(f64, usize, usize)> = Vec::new();
    for new in (0..origins.len()).filter(|&new| origins[new] == Origin::Born) {
        let best = (0..heir.len()).max_by(|&a, &b| overlap.at(a, new).total_cmp(&overlap.at(b, new)).then(b.cmp(&a)));
        if let Some(old) = best.filter(|&old| is_inside(overlap.at(old, new), overlap.new_weight[new])) {
            pieces.push((overlap.at(old, new), old, new));
        }
    }
    pieces.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.2.cmp(&y.2)));
    for (_, old, new) in pieces {
        let keeps_identity = heir[old].is_none();
        heir[old].get_or_insert(new as u32);
        origins[new] = Origin::Split { from: old as u32, keeps_identity };
    }
    let fate = |old: usize| {
        let into = (0..origins.len()).find(|&new| is_inside(overlap.at(old, new), overlap.old_weight[old]));
        into.map_or(Lost::Gone, |new| Lost::MergedInto(new as u32))
    };
    let is_lost = |old: &usize| heir[*old].is_none() && overlap.is_used[*old];
    let lost = (0..heir.len()).filter(is_lost).map(|old| (old as u32, fate(old))).collect();
    Ok(PartMatching { origins, lost })
}

/// One-to-one matches by the greatest total IoU.
fn survivors(overlap: &Overlap, config: &IdentityConfig, heir: &mut [Option<u32>]) -> Vec<Origin> {
    let (olds, news) = (overlap.old_weight.len(), overlap.new_weight.len());
    let n = olds.max(news);
    let mut cost = vec![0.0; n * n];
    for old in 0..olds {
        for new in 0..news {
            let iou = overlap.iou(old, new);
            // Below the limit a pair is worth nothing, or it would take partners from good pairs.
            cost[old * n + new] = if iou >= config.min_iou { -iou } else { 0.0 };
        }
    }
    let mut origins = vec![Origin::Born; news];
    for (old, &new) in assign(&cost, n).iter().enumerate().take(olds) {
        if new < news && cost[old * n + new] < 0.0 {
            heir[old] = Some(new as u32);
            origins[new] = Origin::Survived { old: old as u32, iou: overlap.iou(old, new) };
        }
    }
    origins
}

/// Shared weights of all pairs of parts.
struct Overlap {
    shared: Vec<f64>,
    old_weight: Vec<f64>,
    new_weight: Vec<f64>,
    is_used: Vec<bool>,
}

impl Overlap {
    fn new(old_part_of: &[u32], new_part_of: &[u32], weights: &[f64]) -> Overlap {
        let count =
            |parts: &[u32]| parts.iter().filter(|&&part| part != NO_PART).max().map_or(0, |&part| part as usize + 1);
        let (olds, news) = (count(old_part_of), count(new_part_of));
        let mut overlap = Overlap {
            shared: vec![0.0; olds * news],
            old_weight: vec![0.0; olds],
            new_weight: vec![0.0; news],
            is_used: vec![false; olds],
        };
        for ((&old, &new), &weight) in old_part_of.iter().zip(new_part_of).zip(weights) {
            if old != NO_PART {
                overlap.is_used[old as usize] = true;
            }
            // Vertices that only one side knows say nothing about identity: new space, or space forgotten.
            if old != NO_PART && new != NO_PART {
                overlap.shared[old as usize * news + new as usize] += weight;
                overlap.old_weight[old as usize] += weight;
                overlap.new_weight[new as usize] += weight;
            }
        }
        overlap
    }

    fn at(&self, old: usize, new: usize) -> f64 {
        self.shared[old * self.new_weight.len() + new]
    }

    fn iou(&self, old: usize, new: usize) -> f64 {
        let shared = self.at(old, new);
        if shared > 0.0 { shared / (self.old_weight[old] + self.new_weight[new] - shared) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(old: &[u32], new: &[u32]) -> PartMatching {
        match_parts(old, new, &vec![1.0; old.len()], &IdentityConfig::default()).expect("valid")
    }

    #[test]
    fn renumbered_parts_are_found_again() {
        let matching = check(&[0, 0, 0, 1, 1], &[1, 1, 0, 0, 0]);
        assert_eq!((matching.heir_of(0), matching.heir_of(1)), (Some(1), Some(0)));
        assert!(matching.lost.is_empty());
    }

    #[test]
    fn a_wall_drawn_through_a_room_splits_it() {
        let matching = check(&[0, 0, 0, 0, 0], &[0, 0, 0, 1, 1]);
        assert!(matches!(matching.origins[0], Origin::Survived { old: 0, .. }));
        assert_eq!(matching.origins[1], Origin::Split { from: 0, keeps_identity: false });
    }

    #[test]
    fn a_merge_of_many_takes_the_oldest_name() {
        let matching = check(&[3, 3, 0, 0, 1, 1, 2, 2], &[0; 8]);
        assert_eq!(matching.origins, [Origin::Merged { from: vec![0, 1, 2, 3] }]);
        assert_eq!(matching.lost, [1, 2, 3].map(|old| (old, Lost::MergedInto(0))));
    }

    #[test]
    fn new_space_is_born_and_forgotten_space_is_gone() {
        let matching = check(&[0, 0, NO_PART, NO_PART], &[NO_PART, NO_PART, 0, 0]);
        assert_eq!(matching.origins, [Origin::Born]);
        assert_eq!(matching.lost, [(0, Lost::Gone)]);
        let error = match_parts(&[0], &[], &[1.0], &IdentityConfig::default());
        assert_eq!(error, Err(IdentityError::Length { old: 1, new: 0, weights: 1 }));
    }
}
