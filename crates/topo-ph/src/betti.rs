//! The Betti curve: how many components the superlevel set K(t) has, for every t at once.

use crate::Bar;

/// A step function of t. Between two levels the count is constant.
#[derive(Debug, Clone, PartialEq)]
pub struct BettiCurve {
    /// (level, count for t in (next lower level, level]), levels falling.
    steps: Vec<(f64, u32)>,
    /// Count below the lowest level.
    below: u32,
}

/// A half-open interval (low, high] of constant count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end, not included (minus infinity for the last interval).
    pub low: f64,
    /// Upper end, included.
    pub high: f64,
    /// Number of components.
    pub count: u32,
}

/// Counts the bars with death < t <= birth, for all t. O(n log n).
///
/// Bars of zero length count nowhere. Give a filtered list to count only what persists.
pub fn betti_curve(bars: &[Bar]) -> BettiCurve {
    // Walking down, a birth counts from its level on (included); a death from its level on as well.
    let mut events: Vec<(f64, i64)> = Vec::with_capacity(2 * bars.len());
    for bar in bars.iter().filter(|bar| bar.persistence() > 0.0) {
        events.push((bar.birth, 1));
        events.extend(bar.death.map(|death| (death, -1)));
    }
    events.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut steps = Vec::new();
    let mut count = 0_i64;
    let mut next = 0;
    while next < events.len() {
        // At t = level both the births and the deaths of this level have happened: death < t fails there.
        let level = events[next].0;
        while next < events.len() && events[next].0 == level {
            count += events[next].1;
            next += 1;
        }
        steps.push((level, count as u32));
    }
    BettiCurve { below: count as u32, steps }
}

impl BettiCurve {
    /// Number of components at threshold `t`. O(log n).
    pub fn at(&self, t: f64) -> u32 {
        match self.steps.partition_point(|&(level, _)| level >= t) {
            0 => 0,
            passed => self.steps[passed - 1].1,
        }
    }

    /// All intervals of constant count from the highest birth down, neighbours of equal count merged. The last one
    /// has no lower end.
    pub fn intervals(&self) -> Vec<Interval> {
        let mut intervals: Vec<Interval> = Vec::with_capacity(self.steps.len());
        for (index, &(high, count)) in self.steps.iter().enumerate() {
            let low = self.steps.get(index + 1).map_or(f64::NEG_INFINITY, |&(level, _)| level);
            match intervals.last_mut() {
                Some(last) if last.count == count => last.low = low,
                _ => intervals.push(Interval { low, high, count }),
            }
        }
        intervals
    }

    /// Number of components of the whole graph.
    pub fn below_all(&self) -> u32 {
        self.below
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Graph, barcode};

    #[test]
    fn two_rooms_are_two_between_the_door_and_the_smaller_room() {
        let graph = Graph::new(vec![2.0, 0.4, 1.8], vec![(0, 1), (1, 2)], None).expect("valid");
        let curve = betti_curve(&barcode(&graph));
        let counts = [2.1, 2.0, 1.9, 1.8, 0.41, 0.4, -5.0].map(|t| curve.at(t));
        assert_eq!(counts, [0, 1, 1, 2, 2, 1, 1]);
        let expected = [(1.8, 2.0, 1), (0.4, 1.8, 2), (f64::NEG_INFINITY, 0.4, 1)];
        let intervals: Vec<_> = curve.intervals().iter().map(|i| (i.low, i.high, i.count)).collect();
        assert_eq!(intervals, expected);
        assert_eq!(curve.below_all(), 1);
        assert_eq!(betti_curve(&[]).at(0.0), 0);
    }
}
