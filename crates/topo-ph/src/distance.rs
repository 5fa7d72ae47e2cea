//! How far two barcodes are apart: bottleneck and Wasserstein distance.
//!
//! Bars are points (birth, death); each is matched to a bar of the other side or to the diagonal. Essential bars match
//! only among themselves, in the order of their births; unequal counts are infinitely far. Stability
//! (Cohen-Steiner et al. 2007): the bottleneck distance of two value functions is at most their largest difference.

use crate::Bar;
use crate::assignment::assign;

/// The bottleneck distance (L-infinity ground metric). O(n^2.5 log n), meant for a few hundred bars.
pub fn bottleneck(a: &[Bar], b: &[Bar]) -> f64 {
    let Some(essential) = essential_differences(a, b) else {
        return f64::INFINITY;
    };
    let essential = essential.into_iter().fold(0.0, f64::max);
    let (a, b) = (finite_points(a), finite_points(b));
    let mut candidates = vec![essential];
    candidates.extend(a.iter().flat_map(|&p| b.iter().map(move |&q| distance_max(p, q))));
    candidates.extend(a.iter().chain(&b).map(|&p| half_length(p)));
    candidates.retain(|&candidate| candidate >= essential);
    candidates.sort_unstable_by(f64::total_cmp);
    candidates.dedup();
    let smallest = candidates.partition_point(|&limit| !is_matchable(&a, &b, limit));
    candidates[smallest] // all points within their half lengths: the largest candidate always works
}

/// The Wasserstein distance of order 1 with the L-infinity ground metric, between the finite bars. O(n^3).
pub fn wasserstein1(a: &[Bar], b: &[Bar]) -> f64 {
    transport(a, b, distance_max, half_length)
}

/// The Wasserstein distance of order 2 with the L2 ground metric, between the finite bars. O(n^3).
pub fn wasserstein2(a: &[Bar], b: &[Bar]) -> f64 {
    let squared = |p: Point, q: Point| (p.0 - q.0).powi(2) + (p.1 - q.1).powi(2);
    transport(a, b, squared, |p| 0.5 * (p.0 - p.1).powi(2)).sqrt()
}

type Point = (f64, f64);

fn distance_max(p: Point, q: Point) -> f64 {
    (p.0 - q.0).abs().max((p.1 - q.1).abs())
}

fn half_length(p: Point) -> f64 {
    0.5 * (p.0 - p.1)
}

fn finite_points(bars: &[Bar]) -> Vec<Point> {
    let finite = bars.iter().filter(|bar| bar.persistence() > 0.0);
    finite.filter_map(|bar| bar.death.map(|death| (bar.birth, death))).collect()
}

fn essential_differences(a: &[Bar], b: &[Bar]) -> Option<Vec<f64>> {
    let births = |bars: &[Bar]| {
        let essential = bars.iter().filter(|bar| bar.death.is_none());
        let mut births: Vec<f64> = essential.map(|bar| bar.birth).collect();
        births.sort_unstable_by(f64::total_cmp);
        births
    };
    let (a, b) = (births(a), births(b));
    (a.len() == b.len()).then(|| a.iter().zip(&b).map(|(x, y)| (x - y).abs()).collect())
}

/// Cost of the best matching on the points of both sides plus a diagonal partner for each.
fn transport(a: &[Bar], b: &[Bar], pair: impl Fn(Point, Point) -> f64, alone: impl Fn(Point) -> f64) -> f64 {
    let (a, b) = (finite_points(a), finite_points(b));
    let n = a.len() + b.len();
    let mut cost = vec![0.0; n * n];
    for row in 0..n {
        for column in 0..n {
            cost[row * n + column] = match (a.get(row), b.get(column)) {
                (Some(&p), Some(&q)) => pair(p, q),
                (Some(&p), None) => alone(p),
                (None, Some(&q)) => alone(q),
                (None, None) => 0.0,
            };
        }
    }
    assign(&cost, n).iter().enumerate().map(|(row, &column)| cost[row * n + column]).sum()
}

/// Whether all points longer than 2 `limit` can be matched one to one at cost <= `limit`.
///
/// By the theorem of Mendelsohn and Dulmage it is enough that the long points of each side can be matched into the
/// other side separately.
fn is_matchable(a: &[Point], b: &[Point], limit: f64) -> bool {
    covers(a, b, limit) && covers(b, a, limit)
}

/// Whether every long point of `from` finds its own partner in `to` (augmenting paths).
fn covers(from: &[Point], to: &[Point], limit: f64) -> bool {
    let mut partner: Vec<Option<usize>> = vec![None; to.len()];
    let long = (0..from.len()).filter(|&point| half_length(from[point]) > limit);
    long.into_iter().all(|point| {
        let mut is_visited = vec![false; to.len()];
        augment(point, from, to, limit, &mut partner, &mut is_visited)
    })
}

fn augment(
    start: usize,
    from: &[Point],
    to: &[Point],
    limit: f64,
    partner: &mut [Option<usize>],
    is_visited: &mut [bool],
) -> bool {
    // Depth-first with an explicit stack of (point, next candidate, candidate taken to get there).
    let mut stack = vec![(start, 0)];
    let mut taken: Vec<usize> = Vec::new();
    while let Some((point, next)) = stack.last_mut() {
        let candidate = (*next..to.len()).find(|&q| !is_visited[q] && distance_max(from[*point], to[q]) <= limit);
        let Some(q) = candidate else {
            stack.pop();
            taken.pop();
            continue;
        };
        is_visited[q] = true;
        *next = q + 1;
        taken.push(q);
        match partner[q] {
            Some(other) => stack.push((other, 0)),
            None => {
                for (&(point, _), &q) in stack.iter().zip(&taken) {
                    partner[q] = Some(point);
                }
                return true;
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bar(birth: f64, death: f64) -> Bar {
        Bar { birth, death: Some(death), birth_vertex: 0, death_edge: None }
    }

    #[test]
    fn a_bar_goes_to_its_like_and_noise_to_the_diagonal() {
        let a = [bar(2.0, 0.5), bar(1.0, 0.8)];
        let b = [bar(1.9, 0.2)];
        assert!((bottleneck(&a, &b) - 0.3).abs() < 1e-15);
        assert!((wasserstein1(&a, &b) - 0.4).abs() < 1e-15);
        assert!((wasserstein2(&a, &b) - (0.01 + 0.09 + 0.02_f64).sqrt()).abs() < 1e-15);
        let essential = Bar { death: None, ..bar(1.0, 0.0) };
        assert_eq!(bottleneck(&[essential], &[]), f64::INFINITY);
        assert_eq!(bottleneck(&[], &[]), 0.0);
    }
}
