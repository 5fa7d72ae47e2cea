//! Laws of the partition that remembers: noise within the band changes nothing.

#[allow(dead_code)] // its searches serve the laws of the barcode
mod support;

use proptest::prelude::*;
use support::{graph, parts};
use topo_ph::*;

/// A rule whose band ends below the saddle of 1 that every slope has.
fn rule() -> impl Strategy<Value = (PinchConfig, HysteresisConfig)> {
    let tau = prop_oneof![Just(0.0), Just(0.07), 0.0..0.5_f64];
    let sigma = prop_oneof![Just(1.0), Just(0.75), 0.0..1.0_f64];
    let rho = prop_oneof![Just(0.88), 0.0..0.94_f64];
    (rho, sigma, tau, 0.0..0.99_f64).prop_map(|(rho, sigma, tau, share)| {
        let config = PinchConfig { rho, sigma, tau, min_area: 0.0 };
        (config, HysteresisConfig { band: share * (1.0 - rho).min(0.5), area_band: 0.0 })
    })
}

/// The plain rule in a loop that can be read at a glance, with every saddle lower by `band` of the lower peak. No `min_area`.
fn judged_with(graph: &Graph, config: &PinchConfig, band: f64) -> Vec<u32> {
    let mut edges: Vec<usize> = (0..graph.edges().len()).collect();
    edges.sort_by(|&a, &b| {
        let key = |e: usize| {
            let (u, v) = graph.edges()[e];
            (graph.edge_weight(e), graph.value(u).max(graph.value(v)), u.min(v), u.max(v))
        };
        let (x, y) = (key(a), key(b));
        y.0.total_cmp(&x.0).then(y.1.total_cmp(&x.1)).then((x.2, x.3, a).cmp(&(y.2, y.3, b)))
    });
    // Each vertex names the peak of its region.
    let mut peak_of: Vec<u32> = (0..graph.len() as u32).collect();
    for edge in edges {
        let (u, v) = graph.edges()[edge];
        let (a, b) = (peak_of[u as usize], peak_of[v as usize]);
        let is_older = (graph.value(a), std::cmp::Reverse(a)) > (graph.value(b), std::cmp::Reverse(b));
        let (older, younger) = if is_older { (a, b) } else { (b, a) };
        let (s, p, higher) = (graph.edge_weight(edge), graph.value(younger), graph.value(older));
        let judged = s - band * p;
        let is_border =
            s < p && judged <= config.rho * p && judged <= config.sigma * higher && p - judged >= config.tau;
        if a != b && !is_border {
            peak_of.iter_mut().filter(|peak| **peak == younger).for_each(|peak| *peak = older);
        }
    }
    peak_of
}

/// The same division of the vertices, whatever the numbers of the parts.
fn is_same_division(a: &[u32], b: &[u32]) -> bool {
    refines(a, b) && refines(b, a)
}

/// Whether vertices in one part of `fine` are in one part of `coarse`.
fn refines(fine: &[u32], coarse: &[u32]) -> bool {
    (0..fine.len()).all(|u| (0..u).all(|v| fine[u] != fine[v] || coarse[u] == coarse[v]))
}

/// A graph, a rule, and graphs with each number multiplied by its own factor within 1 +- band/8.
fn noisy_graphs(count: usize) -> impl Strategy<Value = (Graph, Vec<Graph>, PinchConfig, HysteresisConfig)> {
    (parts(), rule()).prop_flat_map(move |((values, edges, limits), (config, hysteresis))| {
        // The ends are likely: there the law is tight.
        let factor = prop_oneof![Just(-1.0), Just(1.0), -1.0..1.0_f64];
        let factors = prop::collection::vec(factor, values.len() + edges.len());
        prop::collection::vec(factors, count).prop_map(move |frames| {
            let noisy = frames.iter().map(|frame| {
                let (of_vertices, of_edges) = frame.split_at(values.len());
                let moved = |numbers: &[f64], by: &[f64]| {
                    numbers.iter().zip(by).map(|(x, f)| x * (1.0 + 0.125 * hysteresis.band * f)).collect::<Vec<_>>()
                };
                let limits = limits.as_ref().map(|limits| moved(limits, of_edges));
                Graph::new(moved(&values, of_vertices), edges.clone(), limits).expect("valid")
            });
            let noisy = noisy.collect();
            let plain = Graph::new(values.clone(), edges.clone(), limits.clone()).expect("valid");
            (plain, noisy, config, hysteresis)
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn noise_within_the_band_never_changes_the_partition((graph, noisy, config, hysteresis) in noisy_graphs(1)) {
        let before = judged_with(&graph, &config, 0.5 * hysteresis.band);
        let after = pinch_from(&noisy[0], &vec![1.0; graph.len()], &config, &before, &hysteresis).expect("valid");
        prop_assert!(is_same_division(&before, &after.part_of), "{:?} {:?}", before, after.part_of);
    }

    #[test]
    fn in_a_row_of_noisy_graphs_no_border_vanishes((_, noisy, config, hysteresis) in noisy_graphs(5)) {
        let mut before = vec![NO_PART; noisy[0].len()];
        for (frame, graph) in noisy.iter().enumerate() {
            let after = pinch_from(graph, &vec![1.0; graph.len()], &config, &before, &hysteresis).expect("valid").part_of;
            prop_assert!(frame == 0 || refines(&after, &before), "{:?} {:?}", before, after);
            before = after;
        }
    }

    #[test]
    fn without_a_previous_partition_it_is_pinch(graph in graph(), (config, hysteresis) in rule(), area in 0..5_u8, one in any::<u32>()) {
        let config = PinchConfig { min_area: f64::from(area), ..config };
        let areas = vec![1.0; graph.len()];
        let plain = pinch(&graph, &areas, &config).expect("valid");
        let nothing = pinch_from(&graph, &areas, &config, &vec![NO_PART; graph.len()], &hysteresis).expect("valid");
        prop_assert_eq!(&nothing, &plain);
        // One part everywhere says as little about borders as none (with no small regions, whose absorption may differ).
        let config = PinchConfig { min_area: 0.0, ..config };
        let whole = pinch_from(&graph, &areas, &config, &vec![one; graph.len()], &hysteresis).expect("valid");
        prop_assert_eq!(whole, pinch(&graph, &areas, &config).expect("valid"));
        prop_assert!(is_same_division(&judged_with(&graph, &config, 0.0), &pinch(&graph, &areas, &config).expect("valid").part_of));
    }

    #[test]
    fn what_pinch_made_comes_back(
        graph in graph(), (config, hysteresis) in rule(), sizes in prop::collection::vec(0.0..3.0_f64, 12), area_band in 0.0..1.0_f64, area in 0..5_u8
    ) {
        let (config, hysteresis) = (PinchConfig { min_area: f64::from(area), ..config }, HysteresisConfig { area_band, ..hysteresis });
        let areas = &sizes[..graph.len()];
        let before = pinch(&graph, areas, &config).expect("valid");
        prop_assert_eq!(&pinch_from(&graph, areas, &config, &before.part_of, &hysteresis).expect("valid"), &before);
    }

    #[test]
    fn any_previous_partition_is_survived(
        graph in graph(), (config, hysteresis) in rule(), previous in prop::collection::vec(prop_oneof![0..4_u32, Just(NO_PART), any::<u32>()], 12)
    ) {
        // Every remaining border satisfies the rule with the whole band.
        let found = pinch_from(&graph, &vec![1.0; graph.len()], &config, &previous[..graph.len()], &hysteresis).expect("valid");
        for border in &found.borders {
            let [a, b] = [border.a, border.b].map(|part| found.parts[part as usize].peak_value);
            let judged = border.saddle - hysteresis.band * a.min(b);
            prop_assert!(judged <= config.rho * a.min(b) + 1e-12 && judged <= config.sigma * a.max(b) + 1e-12);
            prop_assert!(a.min(b) - judged >= config.tau - 1e-12);
        }
    }
}
