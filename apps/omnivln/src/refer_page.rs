//! The page of `omnivln refer`.

use serde_json::Value;

use crate::bench_page::Page;

/// Table and chart of the accuracies, beside published figures for the same task (true boxes).
pub fn page(sets: &Value) -> String {
    const PARTS: [&str; 5] = ["accuracy", "easy", "hard", "view_dependent", "view_independent"];
    let percent = |value: &Value| value.as_f64().map(|share| 100.0 * share);
    let mut rows: Vec<(String, Vec<Option<f64>>)> = sets
        .as_object()
        .into_iter()
        .flatten()
        .map(|(name, set)| (name.clone(), PARTS.iter().map(|part| percent(&set[*part])).collect()))
        .collect();
    let drawn = (0..rows.len()).collect();
    let published =
        [("Nr3D, CoT3DRef (supervised)", 64.36), ("Nr3D, LaSP (models)", 52.9), ("Sr3D, CoT3DRef (supervised)", 73.23)];
    rows.extend(published.map(|(name, value)| (name.to_string(), vec![Some(value), None, None, None, None])));
    let columns = ["set", "all", "easy", "hard", "view-dependent", "view-independent"];
    Page {
        title: "Referring expressions",
        note: "Share of sentences whose object was found among all objects of the scene, in per cent; true boxes and labels, no \
               model. The published figures are on the whole test sets, these on the given files.",
        columns: columns.map(str::to_string).to_vec(),
        rows,
        decimals: 2,
        unit: "%",
        drawn,
        rest: String::new(),
    }
    .html()
}
