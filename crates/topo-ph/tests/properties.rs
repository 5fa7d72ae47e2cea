//! Laws of barcodes, merge trees and partitions on small random graphs.

mod support;

use proptest::prelude::*;
use support::{components_by_search, count, graph, parts, thresholds, value};
use topo_ph::*;

/// Sums of a few numbers below 4 in different orders.
const SUM_TOL: f64 = 1e-9;

fn lives(bars: &[Bar]) -> Vec<(f64, Option<f64>)> {
    let mut lives: Vec<_> = nonzero(bars).iter().map(|bar| (bar.birth, bar.death)).collect();
    lives.sort_by(|a, b| a.partial_cmp(b).expect("no NaN"));
    lives
}

/// The same graph with vertex v renamed to `order[v]`, edges reversed and in reverse order.
fn renamed(graph: &Graph, order: &[u32]) -> Graph {
    let mut values = vec![0.0; graph.len()];
    for v in 0..graph.len() {
        values[order[v] as usize] = graph.values()[v];
    }
    let edges = graph.edges().iter().rev();
    let edges = edges.map(|&(u, v)| (order[v as usize], order[u as usize])).collect();
    let weights = graph.edge_weights().rev().collect();
    Graph::new(values, edges, Some(weights)).expect("valid")
}

fn graph_and_order() -> impl Strategy<Value = (Graph, Vec<u32>)> {
    graph().prop_flat_map(|graph| {
        let order: Vec<u32> = (0..graph.len() as u32).collect();
        (Just(graph), Just(order).prop_shuffle())
    })
}

mod barcodes {
    use super::*;

    proptest! {
        #[test]
        fn betti_curve_equals_breadth_first_counts(graph in graph()) {
            let curve = betti_curve(&barcode(&graph));
            for t in thresholds(&graph) {
                prop_assert_eq!(curve.at(t), count(&components_by_search(&graph, t)));
                prop_assert_eq!(components_at(&graph, t), components_by_search(&graph, t));
            }
        }

        #[test]
        fn intervals_say_what_the_curve_says(graph in graph()) {
            let curve = betti_curve(&barcode(&graph));
            for interval in curve.intervals() {
                prop_assert!(interval.low < interval.high);
                prop_assert_eq!(curve.at(interval.high), interval.count);
                let is_last = interval.low == f64::NEG_INFINITY;
                prop_assert!(is_last || curve.at(interval.low) != interval.count);
            }
        }

        #[test]
        fn renaming_vertices_and_edges_keeps_the_lives((graph, order) in graph_and_order()) {
            prop_assert_eq!(lives(&barcode(&graph)), lives(&barcode(&renamed(&graph, &order))));
        }

        #[test]
        fn one_number_a_vertex_says_what_the_bars_say(graph in graph(), grid in prop::collection::vec(0u8..5, 1..400)) {
            // Random graphs, with and without edge values; and an image with many equal values, large enough for the radix sort and for three blocks.
            let image: Vec<f32> = grid.iter().cycle().take(2800).map(|v| f32::from(*v)).collect();
            let plain = Graph::new(graph.values().to_vec(), graph.edges().to_vec(), None).expect("valid");
            for graph in [graph, plain, grid_graph(&image, 40).0] {
                let deaths = deaths(&graph);
                for bar in barcode(&graph) {
                    let death = deaths[bar.birth_vertex as usize];
                    prop_assert_eq!(bar.death, (!death.is_nan()).then_some(death));
                }
            }
        }

        #[test]
        fn a_simplified_graph_has_the_long_bars_and_moved_by_less_than_tau(graph in graph(), tau in prop_oneof![0.0..2.0_f64, Just(0.25), Just(0.5)]) {
            let simple = simplify(&graph, tau);
            let mut long = lives(&barcode(&graph));
            long.retain(|(birth, death)| death.is_none_or(|death| birth - death >= tau));
            prop_assert_eq!(lives(&barcode(&simple)), long);
            for (old, new) in graph.values().iter().zip(simple.values()) {
                prop_assert!(new <= old && (new == old || old - new < tau));
            }
            prop_assert_eq!(simplify(&simple, tau), simple);
        }

        #[test]
        fn after_any_edits_the_bars_are_those_of_a_new_start(edits in prop::collection::vec((0..6_u8, 0..9_u32, 0..9_u32, value()), 0..60)) {
            let mut graph = EditableGraph::new();
            for (kind, u, v, value) in edits {
                // Refused edits are part of the game: edges to vertices that are not there, or to themselves.
                match kind {
                    0 | 1 => prop_assert_eq!(graph.set_vertex(7 * u, value), Ok(())),
                    2 | 3 => _ = graph.set_edge(7 * u, 7 * v, value),
                    4 => _ = graph.remove_edge(7 * u, 7 * v),
                    _ => _ = graph.remove_vertex(7 * u),
                }
                if kind % 2 == 0 {
                    continue; // several edits between two readings
                }
                let (batch, names) = graph.graph().expect("small");
                let fresh: Vec<_> =
                    barcode(&batch).iter().map(|bar| (bar.birth, bar.death, names[bar.birth_vertex as usize])).collect();
                let (bars, computed) = graph.bars().expect("small");
                prop_assert!(computed <= batch.len());
                prop_assert_eq!(bars.iter().map(|bar| (bar.birth, bar.death, bar.birth_vertex)).collect::<Vec<_>>(), fresh);
            }
        }

        #[test]
        fn one_bar_a_vertex_one_essential_a_component_and_the_rest_are_cycles(graph in graph()) {
            let bars = barcode(&graph);
            let components = count(&components_by_search(&graph, f64::NEG_INFINITY)) as usize;
            prop_assert_eq!(bars.len(), graph.len());
            prop_assert_eq!(bars.iter().filter(|bar| bar.death.is_none()).count(), components);
            let cycles = cycle_births(&graph);
            prop_assert_eq!(cycles.len() + graph.len(), graph.edges().len() + components);
            prop_assert!(cycles.is_sorted_by(|a, b| a >= b));
            prop_assert!(bars.iter().all(|bar| bar.persistence() >= 0.0));
        }

        #[test]
        fn deaths_and_cycles_share_out_the_edges(graph in graph()) {
            let deaths = barcode(&graph).iter().filter_map(|bar| bar.death).sum::<f64>();
            let cycles = cycle_births(&graph).iter().sum::<f64>();
            let all = graph.edge_weights().sum::<f64>();
            prop_assert!((deaths + cycles - all).abs() < SUM_TOL);
        }

        #[test]
        fn a_constant_shifts_the_bars((values, edges, limits) in parts(), steps in -8..8_i32) {
            let shift = f64::from(steps) * 0.5;
            let plain = Graph::new(values.clone(), edges.clone(), limits.clone()).expect("valid");
            let up = |numbers: Vec<f64>| numbers.iter().map(|x| x + shift).collect::<Vec<_>>();
            let shifted = Graph::new(up(values), edges, limits.map(up)).expect("valid");
            let (a, b) = (lives(&barcode(&plain)), lives(&barcode(&shifted)));
            prop_assert_eq!(a.len(), b.len());
            for (x, y) in a.iter().zip(&b) {
                prop_assert!((x.0 + shift - y.0).abs() < SUM_TOL);
                prop_assert!(x.1.zip(y.1).is_none_or(|(p, q)| (p + shift - q).abs() < SUM_TOL));
            }
        }
    }
}

mod distances {
    use super::*;

    /// All matchings, one bar of `a` after the other: to the diagonal or to any bar of `b` still there.
    fn best_matching(a: &[Bar], b: &[Bar]) -> f64 {
        let Some((first, rest)) = a.split_first() else {
            return b.iter().map(|bar| 0.5 * bar.persistence()).fold(0.0, f64::max);
        };
        let mut best = (0.5 * first.persistence()).max(best_matching(rest, b));
        for index in 0..b.len() {
            let (mut others, partner) = (b.to_vec(), b[index]);
            others.remove(index);
            let births = (first.birth - partner.birth).abs();
            let deaths = first.death.zip(partner.death).map_or(f64::INFINITY, |(x, y)| (x - y).abs());
            best = best.min(births.max(deaths).max(best_matching(rest, &others)));
        }
        best
    }

    fn two_value_functions() -> impl Strategy<Value = (Graph, Graph, f64)> {
        parts().prop_flat_map(|(values, edges, limits)| {
            let n = values.len();
            (Just((values, edges, limits)), prop::collection::vec(-0.4..0.4_f64, n)).prop_map(
                |((values, edges, limits), noise)| {
                    let moved = values.iter().zip(&noise).map(|(x, d)| x + d).collect();
                    let largest = noise.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
                    let a = Graph::new(values, edges.clone(), limits.clone()).expect("valid");
                    (a, Graph::new(moved, edges, limits).expect("valid"), largest)
                },
            )
        })
    }

    proptest! {
        #[test]
        fn stability_bottleneck_is_at_most_the_sup_norm((f, g, sup) in two_value_functions()) {
            let distance = bottleneck(&barcode(&f), &barcode(&g));
            prop_assert!(distance <= sup + SUM_TOL, "{} > {}", distance, sup);
        }

        #[test]
        fn bottleneck_is_the_best_of_all_matchings(a in graph(), b in graph()) {
            let short = |g: &Graph| {
                let bars = nonzero(&barcode(g));
                bars.into_iter().filter(|bar| bar.death.is_some()).take(5).collect::<Vec<_>>()
            };
            let (a, b) = (short(&a), short(&b));
            prop_assert!((bottleneck(&a, &b) - best_matching(&a, &b)).abs() < SUM_TOL);
        }

        #[test]
        fn bottleneck_is_a_metric(a in graph(), b in graph(), c in graph()) {
            let finite = |g: &Graph| {
                let bars = barcode(g);
                bars.into_iter().filter(|bar| bar.death.is_some()).collect::<Vec<_>>()
            };
            let (a, b, c) = (finite(&a), finite(&b), finite(&c));
            prop_assert_eq!(bottleneck(&a, &a), 0.0);
            prop_assert_eq!(bottleneck(&a, &b), bottleneck(&b, &a));
            prop_assert!(bottleneck(&a, &c) <= bottleneck(&a, &b) + bottleneck(&b, &c) + SUM_TOL);
            prop_assert!(bottleneck(&a, &b) <= wasserstein1(&a, &b) + SUM_TOL);
        }
    }
}

mod trees {
    use super::*;

    proptest! {
        #[test]
        fn a_cut_of_the_merge_tree_is_the_level_set(graph in graph()) {
            let tree = MergeTree::new(&graph);
            for t in thresholds(&graph) {
                let (cut, truth) = (tree.cut(t), components_by_search(&graph, t));
                for u in 0..graph.len() {
                    prop_assert_eq!(cut[u], tree.component_at(u as u32, t));
                    prop_assert_eq!(cut[u].is_some(), truth[u] != u32::MAX);
                    for v in 0..u {
                        prop_assert_eq!(cut[u] == cut[v], truth[u] == truth[v]);
                    }
                }
            }
        }
    }
}

mod partitions {
    use super::*;

    fn pinch_config() -> impl Strategy<Value = PinchConfig> {
        let ratio = || prop_oneof![Just(1.0), 0.0..1.0_f64];
        let tau = prop_oneof![Just(0.0), 0.0..1.0_f64];
        (ratio(), ratio(), tau, 0..5_u8).prop_map(|(rho, sigma, tau, area)| PinchConfig {
            rho,
            sigma,
            tau,
            min_area: f64::from(area),
        })
    }

    /// What every partition promises, whoever made it.
    fn check_invariants(graph: &Graph, partition: &Partition) -> Result<(), TestCaseError> {
        prop_assert_eq!(partition.part_of.len(), graph.len());
        for (index, part) in partition.parts.iter().enumerate() {
            let members = (0..graph.len()).filter(|&v| partition.part_of[v] as usize == index);
            prop_assert_eq!(members.clone().count(), part.members as usize);
            prop_assert_eq!(graph.value(part.peak), part.peak_value);
            prop_assert_eq!(partition.part_of[part.peak as usize] as usize, index);
            prop_assert!(members.clone().all(|v| graph.values()[v] <= part.peak_value));
            // Each part is connected.
            let inside: Vec<u32> = members.map(|v| v as u32).collect();
            let mut reached = vec![inside[0]];
            let mut next = 0;
            while next < reached.len() {
                for &(u, v) in graph.edges() {
                    for (a, b) in [(u, v), (v, u)] {
                        if a == reached[next] && inside.contains(&b) && !reached.contains(&b) {
                            reached.push(b);
                        }
                    }
                }
                next += 1;
            }
            prop_assert_eq!(reached.len(), inside.len());
        }
        let mut crossing = 0;
        for (edge, &(u, v)) in graph.edges().iter().enumerate() {
            let (a, b) = (partition.part_of[u as usize], partition.part_of[v as usize]);
            if a != b {
                crossing += 1;
                let border = partition.borders.iter().find(|x| (x.a, x.b) == (a.min(b), a.max(b)));
                prop_assert!(border.is_some_and(|border| border.saddle >= graph.edge_weight(edge)));
            }
        }
        prop_assert_eq!(partition.borders.iter().map(|border| border.length).sum::<u32>(), crossing);
        prop_assert!(partition.borders.iter().all(|x| graph.edge_weight(x.edge as usize) == x.saddle));
        Ok(())
    }

    proptest! {
        #[test]
        fn pinch_keeps_the_promises_of_a_partition(graph in graph(), config in pinch_config()) {
            let partition = pinch(&graph, &vec![1.0; graph.len()], &config).expect("valid");
            check_invariants(&graph, &partition)?;
            for part in partition.parts.iter().enumerate() {
                let has_neighbour = partition.borders.iter().any(|x| x.a as usize == part.0 || x.b as usize == part.0);
                prop_assert!(part.1.area >= config.min_area || !has_neighbour);
            }
        }

        #[test]
        fn every_border_of_pinch_is_pinched_and_prominent_before_absorption(graph in graph(), config in pinch_config()) {
            let config = PinchConfig { min_area: 0.0, ..config };
            let partition = pinch(&graph, &vec![1.0; graph.len()], &config).expect("valid");
            for border in &partition.borders {
                // Peaks only rise after a border was refused, so the final peaks satisfy the rule too.
                let [a, b] = [border.a, border.b].map(|part| partition.parts[part as usize].peak_value);
                prop_assert!(border.saddle <= config.rho * a.min(b) && a.min(b) - border.saddle >= config.tau);
                prop_assert!(border.saddle <= config.sigma * a.max(b));
            }
        }

        #[test]
        fn pinch_of_distinct_values_does_not_depend_on_names(
            (graph, order) in graph_and_order(), config in pinch_config()
        ) {
            // A different small amount for each vertex settles the ties.
            let values = (0..graph.len()).map(|v| graph.values()[v] + 1e-6 * v as f64).collect();
            let graph = Graph::new(values, graph.edges().to_vec(), None).expect("valid");
            let areas = vec![1.0; graph.len()];
            let config = PinchConfig { min_area: 0.0, ..config };
            let lower_star = |g: &Graph| Graph::new(g.values().to_vec(), g.edges().to_vec(), None).expect("valid");
            let a = pinch(&lower_star(&graph), &areas, &config).expect("valid");
            let b = pinch(&lower_star(&renamed(&graph, &order)), &areas, &config).expect("valid");
            for (v, &name) in order.iter().enumerate() {
                prop_assert_eq!(a.part_of[v], b.part_of[name as usize]);
            }
        }

        #[test]
        fn the_order_of_the_edges_does_not_matter(graph in graph(), config in pinch_config()) {
            let identity: Vec<u32> = (0..graph.len() as u32).collect();
            let areas = vec![1.0; graph.len()];
            let (a, b) = (pinch(&graph, &areas, &config), pinch(&renamed(&graph, &identity), &areas, &config));
            prop_assert_eq!(a.expect("valid").part_of, b.expect("valid").part_of);
        }

        #[test]
        fn plateau_partition_keeps_the_promises_of_a_partition(
            graph in graph(), t_min in 0.0..1.0_f64, length in 0.01..2.0_f64, min_persistence in value()
        ) {
            let config = PlateauConfig { t_min, t_max: t_min + length, min_persistence, pick: Pick::Mid };
            check_invariants(&graph, &plateau_partition(&graph, &config).expect("valid"))?;
        }

        #[test]
        fn eq_5_no_interval_of_the_window_is_longer(
            graph in graph(), t_min in 0.0..1.0_f64, length in 0.01..2.0_f64
        ) {
            let config = PlateauConfig { t_min, t_max: t_min + length, min_persistence: 0.0, pick: Pick::Mid };
            let bars = barcode(&graph);
            let outcome = plateau(&bars, &config).expect("valid");
            let (found, longest) = match outcome {
                PlateauOutcome::Found(found) => (Some(found), found.high - found.low),
                PlateauOutcome::SinglePart => (None, 0.0),
            };
            // Brute force: between two neighbouring levels inside the window the count is constant.
            let mut levels: Vec<f64> = thresholds(&graph).into_iter().filter(|t| (t_min..t_min + length).contains(t)).collect();
            levels.extend([t_min, t_min + length]);
            levels.sort_unstable_by(f64::total_cmp);
            let count_at = |t| count(&components_by_search(&graph, t));
            for from in 0..levels.len() {
                let middles = |to: usize| (from..to).map(|i| 0.5 * (levels[i] + levels[i + 1])).collect::<Vec<_>>();
                for to in from + 1..levels.len() {
                    let counts: Vec<u32> = middles(to).iter().map(|&t| count_at(t)).collect();
                    if counts.iter().all(|&k| k > 1 && k == counts[0]) {
                        prop_assert!(levels[to] - levels[from] <= longest + SUM_TOL);
                    }
                }
            }
            if let Some(found) = found {
                prop_assert_eq!(count_at(found.threshold), found.count);
                prop_assert!(found.low < found.threshold && found.threshold <= found.high);
            }
        }
    }
}

mod identities {
    use super::*;

    fn partitions() -> impl Strategy<Value = (Vec<u32>, Vec<u32>, Vec<f64>)> {
        let part = || prop_oneof![4 => 0..5_u32, 1 => Just(NO_PART)];
        prop::collection::vec((part(), part(), value()), 0..20).prop_map(|rows| {
            let old = rows.iter().map(|row| row.0).collect();
            (old, rows.iter().map(|row| row.1).collect(), rows.iter().map(|row| row.2).collect())
        })
    }

    proptest! {
        #[test]
        fn names_are_given_once_and_lost_once((old, new, weights) in partitions()) {
            let matching = match_parts(&old, &new, &weights, &IdentityConfig::default()).expect("valid");
            let mut names: Vec<u32> =
                (0..matching.origins.len() as u32).filter_map(|part| matching.heir_of(part)).collect();
            names.extend(matching.lost.iter().map(|lost| lost.0));
            names.sort_unstable();
            let mut used: Vec<u32> = old.iter().copied().filter(|&part| part != NO_PART).collect();
            used.sort_unstable();
            used.dedup();
            prop_assert_eq!(names, used);
        }

        #[test]
        fn a_partition_matches_itself(old in prop::collection::vec(0..5_u32, 0..20)) {
            let matching = match_parts(&old, &old, &vec![1.0; old.len()], &IdentityConfig::default()).expect("valid");
            for &part in &old {
                prop_assert_eq!(matching.heir_of(part), Some(part));
            }
        }
    }
}
