//! Persistence-based simplification: the same graph without its short bars.
//!
//! A peak that rises less than tau above the pass to a higher one is cut down to that pass, with all that stands on it. What is left has exactly the
//! bars of length tau and more, and no value moved by tau or more.

use crate::Graph;
use crate::merge_tree::MergeTree;

/// The graph whose barcode is that of `graph` without the bars shorter than `tau` (they have length zero then). No value rises, and none falls by `tau`
/// or more. With a `tau` that is not positive nothing changes. O(m) for the sort plus O(m alpha(n)).
pub fn simplify(graph: &Graph, tau: f64) -> Graph {
    let tree = MergeTree::new(graph);
    let mut cap = vec![f64::INFINITY; tree.nodes.len()];
    // Parents come after their children, so one pass from the end takes every cap down to the leaves; the lowest one holds.
    for node in (graph.len()..tree.nodes.len()).rev() {
        let pass = tree.nodes[node].value;
        let Some((older, younger)) = tree.nodes[node].children else { continue };
        let rise = graph.value(tree.nodes[younger as usize].peak) - pass;
        cap[older as usize] = cap[node];
        cap[younger as usize] = if rise < tau { cap[node].min(pass) } else { cap[node] };
    }
    graph.lowered(&cap[..graph.len()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{barcode, nonzero};

    #[test]
    fn a_bump_goes_and_a_room_stays() {
        // A room of 2.0 with a bump of 1.9 beyond a pass of 1.8 that carries a bump of its own, a door of 0.4, a room of 1.5.
        let values = vec![2.0, 1.8, 1.9, 1.85, 1.88, 0.4, 1.5];
        let graph = Graph::new(values, (1..7).map(|v| (v - 1, v)).collect(), None).expect("valid");
        let simple = simplify(&graph, 0.2);
        assert_eq!(simple.values(), [2.0, 1.8, 1.8, 1.8, 1.8, 0.4, 1.5]);
        let bars: Vec<_> = nonzero(&barcode(&simple)).iter().map(|bar| (bar.birth, bar.death)).collect();
        assert_eq!(bars, [(2.0, None), (1.5, Some(0.4))]);
        assert_eq!(simplify(&graph, 0.0), graph);
    }
}
