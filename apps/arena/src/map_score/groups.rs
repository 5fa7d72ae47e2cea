//! Groups of the graph against what the builder of the building put together.
//!
//! True groups: what stands on or hangs in a thing belongs to it (`supported_by`), and so does what the recipe of the room
//! placed with a thing, round it, beside it, before it or in a row with it (`placed_with`): chairs with their table, what
//! lies on a desk, bed and nightstands, a line of kitchen units. What is alone is a group of its own. Only things that are
//! in the graph count: whether they are is another figure.

use std::collections::BTreeMap;

use omni_sim::building::ObjectTruth;
use serde::Serialize;

use super::ratio::Ratio;

/// Figures of the groups.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct GroupFigures {
    /// Adjusted Rand index of the two partitions (Hubert and Arabie 1985); of several buildings the mean of theirs.
    pub adjusted_rand_index: Option<f64>,
    /// The worst of several buildings.
    pub worst: Option<f64>,
    /// Things that were compared.
    pub things: usize,
    /// Of the pairs that the graph puts together, those that are.
    pub pair_precision: Ratio,
    /// Of the pairs that are together, those that the graph puts together.
    pub pair_recall: Ratio,
}

impl GroupFigures {
    /// `pairs`: for each thing its true group and its group in the graph.
    pub fn of(pairs: &[(u32, u64)]) -> GroupFigures {
        let (both, truly, found) = pair_counts(pairs);
        let index = adjusted_rand_index(pairs);
        GroupFigures {
            adjusted_rand_index: index,
            worst: index,
            things: pairs.len(),
            pair_precision: Ratio::new(both, found),
            pair_recall: Ratio::new(both, truly),
        }
    }

    /// Of several buildings: the mean, since pairs across buildings would only flatter.
    pub fn pooled<'a>(all: impl Iterator<Item = &'a GroupFigures> + Clone) -> GroupFigures {
        let indices: Vec<f64> = all.clone().filter_map(|figures| figures.adjusted_rand_index).collect();
        let mean = indices.iter().sum::<f64>() / indices.len().max(1) as f64;
        GroupFigures {
            adjusted_rand_index: (!indices.is_empty()).then_some(mean),
            worst: indices.into_iter().reduce(f64::min),
            things: all.clone().map(|figures| figures.things).sum(),
            pair_precision: Ratio::pooled(all.clone().map(|figures| figures.pair_precision)),
            pair_recall: Ratio::pooled(all.map(|figures| figures.pair_recall)),
        }
    }
}

/// The true group of each thing, named by the smallest id in it.
pub fn true_groups(things: &[ObjectTruth]) -> BTreeMap<u32, u32> {
    let mut group: BTreeMap<u32, u32> = things.iter().map(|thing| (thing.id, thing.id)).collect();
    for thing in things {
        for other in [thing.supported_by, thing.placed_with].into_iter().flatten() {
            let (Some(&a), Some(&b)) = (group.get(&thing.id), group.get(&other)) else { continue };
            group.values_mut().filter(|name| **name == a.max(b)).for_each(|name| *name = a.min(b));
        }
    }
    group
}

/// Agreement of two partitions beyond chance, at most 1; `None` for fewer than two things. Two partitions without any pair,
/// or with all pairs, agree fully if both are so.
pub fn adjusted_rand_index(pairs: &[(u32, u64)]) -> Option<f64> {
    let all = of_two(pairs.len());
    if all == 0 {
        return None;
    }
    let (both, truly, found) = pair_counts(pairs);
    let by_chance = truly as f64 * found as f64 / all as f64;
    let most = (truly + found) as f64 / 2.0;
    Some(if most == by_chance { 1.0 } else { (both as f64 - by_chance) / (most - by_chance) })
}

/// Pairs that are together in both, in the first, in the second.
fn pair_counts(pairs: &[(u32, u64)]) -> (usize, usize, usize) {
    let (mut cells, mut rows, mut columns) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (truly, found) in pairs {
        *cells.entry((*truly, *found)).or_insert(0_usize) += 1;
        *rows.entry(*truly).or_insert(0_usize) += 1;
        *columns.entry(*found).or_insert(0_usize) += 1;
    }
    let sum = |counts: &mut dyn Iterator<Item = usize>| counts.map(of_two).sum::<usize>();
    (sum(&mut cells.into_values()), sum(&mut rows.into_values()), sum(&mut columns.into_values()))
}

/// Pairs among `n`.
fn of_two(n: usize) -> usize {
    n * n.saturating_sub(1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map_score::test_things::thing;

    fn index(truly: &[u32], found: &[u64]) -> Option<f64> {
        adjusted_rand_index(&truly.iter().copied().zip(found.iter().copied()).collect::<Vec<_>>())
    }

    #[test]
    fn the_index_of_known_partitions() {
        assert_eq!(index(&[1, 1, 2, 2], &[7, 7, 9, 9]), Some(1.0));
        // Cells 1,1,1,1: no common pair, 2 and 2 of 6: (0 - 4/6) / (2 - 4/6) = -0.5.
        assert!((index(&[1, 1, 2, 2], &[1, 2, 1, 2]).unwrap() + 0.5).abs() < 1e-12);
        // Common pairs 2, truly 6, found 3 of 15: (2 - 18/15) / (4.5 - 18/15) = 0.8 / 3.3.
        let half = index(&[1, 1, 1, 2, 2, 2], &[1, 1, 2, 2, 3, 3]).unwrap();
        assert!((half - 0.8 / 3.3).abs() < 1e-12, "{half}");
        // The textbook case of Hubert and Arabie's index: all in one against halves is no better than chance.
        assert_eq!(index(&[1, 1, 1, 1], &[1, 1, 2, 2]), Some(0.0));
        assert_eq!(index(&[1, 2, 3], &[1, 2, 3]), Some(1.0), "all alone in both");
        assert_eq!(index(&[1], &[1]), None);
    }

    #[test]
    fn a_table_its_chairs_and_what_lies_on_it_are_one_group() {
        let mut things: Vec<ObjectTruth> =
            (1..=5).map(|id| thing(id, "thing", [f64::from(id), 0.0, 0.0], 0.5)).collect();
        // 3 is the table; 4 a chair at it; 1 a mug on it; 2 lies on the chair; 5 is alone.
        things[3].placed_with = Some(3);
        things[0].supported_by = Some(3);
        things[1].supported_by = Some(4);
        let groups = true_groups(&things);
        assert_eq!(groups.into_values().collect::<Vec<_>>(), [1, 1, 1, 1, 5]);
    }

    #[test]
    fn pairs_by_hand_and_the_mean_of_two_buildings() {
        let one = GroupFigures::of(&[(1, 1), (1, 1), (1, 2), (2, 2)]);
        assert_eq!((one.pair_precision, one.pair_recall), (Ratio::new(1, 2), Ratio::new(1, 3)));
        let two = GroupFigures::of(&[(1, 1), (1, 1), (2, 2)]);
        let both = GroupFigures::pooled([&one, &two].into_iter());
        let mean = (one.adjusted_rand_index.unwrap() + 1.0) / 2.0;
        assert_eq!((both.adjusted_rand_index, both.worst), (Some(mean), one.adjusted_rand_index));
    }
}
