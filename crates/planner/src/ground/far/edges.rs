//! Edges between nodes: exact tests, votes, and what has to be tested again when cells change.
//!
//! An edge is a pair of nodes that is taut at both ends (FAR's rule b) and whose segment keeps the clearance from every
//! occupied square ever seen. Votes decide whether a pair that comes and goes is trusted; the cells have a veto: a pair that is not
//! clear *now* is never used, whatever the votes say. Pairs are listed by the tiles they pass, so a change asks only those.

use nalgebra::{Point2, Vector2};
use rustc_hash::FxHashMap;

use super::memory::{CellBox, Memory};
use super::node::{Link, Node};
use super::tile::{SIDE, Through};

/// A pair of nodes and what is known of the segment between them.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    pub a: u32,
    pub b: u32,
    /// Newest vote in the lowest bit.
    pub votes: u16,
    /// Votes so far, at most `connect_votes_size`.
    pub count: u8,
    /// Nothing occupied within the clearance.
    pub is_clear: bool,
    /// Everything within the clearance known to be free.
    pub is_known: bool,
    pub length: f64,
    is_voting: bool,
}

impl Pair {
    /// Whether a way may use it: clear now, and the majority of the votes.
    pub fn is_usable(&self, through: Through) -> bool {
        let is_clear = match through {
            Through::Known => self.is_known,
            Through::Unknown => self.is_clear,
        };
        is_clear && 2 * self.votes.count_ones() > u32::from(self.count)
    }
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Edges {
    pub pairs: Vec<Pair>,
    spare: Vec<u32>,
    /// Per tile address (of all storeys) the pairs that pass within the clearance.
    crossing: FxHashMap<(i32, i32), Vec<u32>>,
    voting: Vec<u32>,
    /// Pairs that were tested since the counter was last set to zero.
    pub tested: u32,
}

impl Edges {
    /// Connects two nodes if they are taut and clear. Their present edge, if there is one, must have been cut.
    pub fn join(&mut self, memory: &Memory, nodes: &mut [Option<Node>], a: u32, b: u32, slack: f64, range: f64) {
        let (Some(from), Some(to)) = (&nodes[a as usize], &nodes[b as usize]) else { return };
        let across = to.vertex.at - from.vertex.at;
        let length = across.norm();
        if length > range || !is_taut(from, to, &across, length, slack) {
            return;
        }
        self.tested += 1;
        let (here, there) = (from.spot(), to.spot());
        if !memory.is_clear(&here, &there, Through::Unknown) {
            return;
        }
        let is_known = memory.is_clear(&here, &there, Through::Known);
        let pair = Pair { a, b, votes: 0, count: 0, is_clear: true, is_known, length, is_voting: true };
        self.insert(memory, nodes, pair);
    }

    /// A pair as a file has it, measured anew; whether it is within range.
    pub fn restore(
        &mut self,
        memory: &Memory,
        nodes: &mut [Option<Node>],
        (a, b): (u32, u32),
        votes: u16,
        count: u8,
        range: f64,
    ) -> bool {
        let (Some(from), Some(to)) = (&nodes[a as usize], &nodes[b as usize]) else { return false };
        let (here, there) = (from.spot(), to.spot());
        let length = (there.at - here.at).norm();
        if length > range + 1e-6 {
            return false;
        }
        let is_clear = memory.is_clear(&here, &there, Through::Unknown);
        let is_known = is_clear && memory.is_clear(&here, &there, Through::Known);
        self.insert(memory, nodes, Pair { a, b, votes, count, is_clear, is_known, length, is_voting: true });
        true
    }

    /// Puts a pair in, as it stands in a file or was just tested.
    fn insert(&mut self, memory: &Memory, nodes: &mut [Option<Node>], pair: Pair) {
        let (a, b) = (pair.a, pair.b);
        let id = match self.spare.pop() {
            Some(id) => {
                self.pairs[id as usize] = pair;
                id
            }
            None => {
                self.pairs.push(pair);
                self.pairs.len() as u32 - 1
            }
        };
        self.voting.push(id);
        let (Some(from), Some(to)) = (&nodes[a as usize], &nodes[b as usize]) else { return };
        each_tile(&from.vertex.at, &to.vertex.at, memory.radius, |key| self.crossing.entry(key).or_default().push(id));
        for (here, there) in [(a, b), (b, a)] {
            if let Some(node) = &mut nodes[here as usize] {
                node.links.push(Link { to: there, pair: id });
            }
        }
    }

    /// Takes a pair out. Its nodes must be where they were when it came in.
    pub fn cut(&mut self, memory: &Memory, nodes: &mut [Option<Node>], id: u32) {
        let Pair { a, b, is_voting, .. } = self.pairs[id as usize];
        if let (Some(from), Some(to)) = (&nodes[a as usize], &nodes[b as usize]) {
            each_tile(&from.vertex.at, &to.vertex.at, memory.radius, |key| {
                if let Some(list) = self.crossing.get_mut(&key) {
                    list.retain(|other| *other != id);
                }
            });
        }
        for end in [a, b] {
            if let Some(node) = &mut nodes[end as usize] {
                node.links.retain(|link| link.pair != id);
            }
        }
        if is_voting {
            self.voting.retain(|other| *other != id);
        }
        let pair = &mut self.pairs[id as usize];
        (pair.is_clear, pair.is_known, pair.votes) = (false, false, 0);
        self.spare.push(id);
    }

    /// Tests again the pairs that pass within the clearance of changed cells.
    pub fn revise(&mut self, memory: &Memory, nodes: &[Option<Node>], changed: &CellBox) {
        let side = SIDE as i64;
        let key = (changed.low[0].div_euclid(side) as i32, changed.low[1].div_euclid(side) as i32);
        let crossing = self.crossing.get(&key).map_or(&[][..], Vec::as_slice);
        for id in crossing {
            let pair = &mut self.pairs[*id as usize];
            let (Some(a), Some(b)) = (&nodes[pair.a as usize], &nodes[pair.b as usize]) else { continue };
            let (here, there) = (a.spot(), b.spot());
            if !passes(&here.at, &there.at, changed, memory.radius) {
                continue;
            }
            self.tested += 1;
            let was_clear = pair.is_clear;
            pair.is_clear = memory.is_clear(&here, &there, Through::Unknown);
            pair.is_known = pair.is_clear && memory.is_clear(&here, &there, Through::Known);
            if pair.is_clear != was_clear && !pair.is_voting {
                pair.is_voting = true;
                self.voting.push(*id);
            }
        }
    }

    /// One vote for every pair whose votes do not all agree yet. A pair with votes against it only is forgotten.
    pub fn vote(&mut self, memory: &Memory, nodes: &mut [Option<Node>], size: u8) {
        let all = ((1u32 << size) - 1) as u16;
        let mut voting = std::mem::take(&mut self.voting);
        let mut lost = Vec::new();
        voting.retain(|id| {
            let pair = &mut self.pairs[*id as usize];
            pair.votes = (pair.votes << 1 | u16::from(pair.is_clear)) & all;
            pair.count = (pair.count + 1).min(size);
            let is_settled = pair.count == size && pair.votes == all;
            let is_lost = pair.votes == 0;
            pair.is_voting = !(is_settled || is_lost);
            if is_lost {
                lost.push(*id);
            }
            pair.is_voting
        });
        self.voting = voting;
        for id in lost {
            self.cut(memory, nodes, id);
        }
    }

    /// Pairs whose votes do not agree yet.
    pub fn unsettled(&self) -> usize {
        self.voting.len()
    }
}

/// The tangent rule at both ends.
pub(crate) fn is_taut(from: &Node, to: &Node, across: &Vector2<f64>, length: f64, slack: f64) -> bool {
    from.vertex.is_taut(across, length, slack) && to.vertex.is_taut(across, length, slack)
}

/// Whether a segment comes within `radius` of a box of cells; may say yes a little too often.
pub(crate) fn passes(a: &Point2<f64>, b: &Point2<f64>, cells: &CellBox, radius: f64) -> bool {
    let low = cells.low.map(|c| c as f64 - radius);
    let high = cells.high.map(|c| c as f64 + radius);
    if (0..2).any(|k| a[k].min(b[k]) > high[k] || a[k].max(b[k]) < low[k]) {
        return false;
    }
    // The corners of the box are not all on one side of the line.
    let across = b - a;
    let middle = Vector2::new(0.5 * (low[0] + high[0]) - a.x, 0.5 * (low[1] + high[1]) - a.y);
    let half = across.y.abs() * 0.5 * (high[0] - low[0]) + across.x.abs() * 0.5 * (high[1] - low[1]);
    across.perp(&middle).abs() <= half
}

/// Calls `found` for the tiles that a segment passes within `radius`.
fn each_tile(a: &Point2<f64>, b: &Point2<f64>, radius: f64, mut found: impl FnMut((i32, i32))) {
    let side = SIDE as f64;
    let tile = |c: f64| (c / side).floor() as i32;
    let across = b - a;
    for ty in tile(a.y.min(b.y) - radius)..=tile(a.y.max(b.y) + radius) {
        let (mut s0, mut s1) = (0.0, 1.0);
        if across.y.abs() > 1e-12 {
            let low = (f64::from(ty) * side - radius - a.y) / across.y;
            let high = (f64::from(ty + 1) * side + radius - a.y) / across.y;
            (s0, s1) = (low.min(high).max(0.0), low.max(high).min(1.0));
        }
        let (x0, x1) = (a.x + across.x * s0, a.x + across.x * s1);
        for tx in tile(x0.min(x1) - radius)..=tile(x0.max(x1) + radius) {
            found((tx, ty));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_is_listed_in_the_tiles_it_passes() {
        let mut tiles = Vec::new();
        each_tile(&Point2::new(10.0, 10.0), &Point2::new(100.0, 100.0), 3.0, |key| tiles.push(key));
        assert_eq!(tiles, [(0, 0), (1, 0), (0, 1), (1, 1)]);
        tiles.clear();
        each_tile(&Point2::new(10.0, 10.0), &Point2::new(100.0, 40.0), 3.0, |key| tiles.push(key));
        assert_eq!(tiles, [(0, 0), (1, 0)]);
    }

    #[test]
    fn a_box_beside_the_segment_is_not_passed() {
        let (a, b) = (Point2::new(0.0, 0.0), Point2::new(20.0, 20.0));
        let cells = |x: i64, y: i64| CellBox { low: [x, y], high: [x + 1, y + 1] };
        assert!(passes(&a, &b, &cells(10, 8), 2.0));
        assert!(!passes(&a, &b, &cells(15, 5), 2.0));
        assert!(!passes(&a, &b, &cells(30, 30), 2.0));
    }

    #[test]
    fn a_blocked_pair_is_no_way_at_once_and_returns_by_majority() {
        let mut pair = Pair {
            a: 0,
            b: 1,
            votes: 0b11_1111_1111,
            count: 10,
            is_clear: true,
            is_known: true,
            length: 1.0,
            is_voting: false,
        };
        assert!(pair.is_usable(Through::Known));
        pair.is_clear = false;
        pair.is_known = false;
        assert!(!pair.is_usable(Through::Unknown));
        pair.votes = 0b11_1110_0000;
        pair.is_clear = true;
        assert!(!pair.is_usable(Through::Unknown));
        pair.votes = 0b11_1110_0001;
        assert!(pair.is_usable(Through::Unknown) && !pair.is_usable(Through::Known));
    }
}
