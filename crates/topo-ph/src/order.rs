//! The total order in which edges enter the filtration: wide first, then the edge that climbs highest.
//!
//! Edges of equal weight (all edges of a vertex, whole rings of a distance transform) are ordered by their higher end,
//! as in ToMATo a vertex joins its highest neighbour first, then by the names of their ends. Radix passes on the
//! order-preserving integers of the keys cost a few nanoseconds an edge. So the result does not depend on the
//! order in which edges were given, nor, if no two vertices have the same value, on their names.

use crate::Graph;

/// Edge indices by (weight descending, value of the higher end descending, smaller end, larger end, index).
pub(crate) fn edges_wide_first(graph: &Graph) -> Vec<u32> {
    let edges = graph.edges();
    let ends = |edge: u32| {
        let (u, v) = edges[edge as usize];
        (u.min(v), u.max(v))
    };
    let mut order: Vec<u32> = (0..edges.len() as u32).collect();
    if !order.is_sorted_by_key(|&edge| ends(edge)) {
        order.sort_by_key(|&edge| ends(edge));
    }
    let (rank, ranks) = dense_ranks(graph.values());
    let end_ranks = |edge: u32| {
        let (u, v) = edges[edge as usize];
        (rank[u as usize], rank[v as usize])
    };
    if graph.has_edge_values() {
        // Least significant key first; each pass is stable.
        sort_rising(&mut order, |edge| u64::from(end_ranks(edge).0.min(end_ranks(edge).1)));
        sort_rising(&mut order, |edge| falling_bits(graph.edge_weight(edge as usize)));
    } else {
        // The weight is the value of the lower end: both keys fit into one small number.
        sort_rising(&mut order, |edge| {
            let (a, b) = end_ranks(edge);
            u64::from(a.max(b)) * u64::from(ranks) + u64::from(a.min(b))
        });
    }
    order
}

/// Vertex indices by (value descending, index).
pub(crate) fn vertices_high_first(values: &[f64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    sort_rising(&mut order, |vertex| falling_bits(values[vertex as usize]));
    order
}

/// The rank of each value, largest first, equal values sharing one; and the number of ranks.
fn dense_ranks(values: &[f64]) -> (Vec<u32>, u32) {
    let mut rank = vec![0; values.len()];
    let mut ranks = 0;
    let mut last = f64::NAN;
    for vertex in vertices_high_first(values) {
        if values[vertex as usize] != last {
            ranks += 1;
            last = values[vertex as usize];
        }
        rank[vertex as usize] = ranks - 1;
    }
    (rank, ranks)
}

/// Sorts indices by rising key, stable.
fn sort_rising(order: &mut [u32], key: impl Fn(u32) -> u64) {
    const DIGIT_BITS: u32 = 11;
    const BUCKETS: usize = 1 << DIGIT_BITS;
    if order.len() < 512 {
        order.sort_by_key(|&index| key(index));
        return;
    }
    let mut items: Vec<(u64, u32)> = order.iter().map(|&index| (key(index), index)).collect();
    let bucket = |bits: u64, digit: usize| (bits >> (digit as u32 * DIGIT_BITS)) as usize & (BUCKETS - 1);
    let all_bits = items.iter().fold(0, |all, item| all | item.0);
    let digits = (u64::BITS - all_bits.leading_zeros()).div_ceil(DIGIT_BITS) as usize;
    let mut counts = vec![[0_u32; BUCKETS]; digits];
    for &(bits, _) in &items {
        for (digit, counts) in counts.iter_mut().enumerate() {
            counts[bucket(bits, digit)] += 1;
        }
    }
    let mut other = vec![(0, 0); items.len()];
    for (digit, place) in counts.iter_mut().enumerate() {
        if place.contains(&(items.len() as u32)) {
            continue; // all keys share this digit (values that were f32, small ranges)
        }
        let mut start = 0;
        for count in place.iter_mut() {
            start += std::mem::replace(count, start);
        }
        for &item in &items {
            let slot = &mut place[bucket(item.0, digit)];
            other[*slot as usize] = item;
            *slot += 1;
        }
        std::mem::swap(&mut items, &mut other);
    }
    for (slot, (_, index)) in order.iter_mut().zip(items) {
        *slot = index;
    }
}

/// An integer that falls as `key` rises ([`Graph::new`] left no -0.0).
fn falling_bits(key: f64) -> u64 {
    let bits = key.to_bits();
    let rising = if bits >> 63 == 1 { !bits } else { bits | 1 << 63 };
    !rising
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radix_equals_a_stable_comparison_sort() {
        // A small linear congruential sequence with many ties, both signs, infinity.
        let mut state = 1_u64;
        let mut keys: Vec<f64> = (0..3000)
            .map(|_| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                ((state >> 40) % 97) as f64 / 7.0 - 5.0
            })
            .collect();
        keys.extend([0.0, f64::INFINITY, -1e300, 1e-300]);
        let mut expected: Vec<u32> = (0..keys.len() as u32).collect();
        expected.sort_by(|&a, &b| keys[b as usize].partial_cmp(&keys[a as usize]).expect("no NaN"));
        let mut order: Vec<u32> = (0..keys.len() as u32).collect();
        sort_rising(&mut order, |index| falling_bits(keys[index as usize]));
        assert_eq!(order, expected);
    }
}
