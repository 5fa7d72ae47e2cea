//! `report.html`: one self-contained file in which a person sees what happened and why.

use std::fmt::Write;

use mission::dsg::SceneGraph;
use mission::journal::{DecisionEntry, Journal};

use crate::chart::curves;
use crate::map_picture::{MapDrawing, escape, map_svg};
use crate::summary::Summary;
use crate::zone_watch::ZoneFigures;

/// Writes the page.
pub fn report_html(
    summary: &Summary,
    graph: &SceneGraph,
    drawing: &MapDrawing,
    navigation: &str,
    journal: &Journal,
) -> String {
    let mut page = String::with_capacity(256 * 1024);
    let verdict = match (summary.success, summary.interrupted) {
        (true, _) => ("success", "#1a7f37"),
        (false, true) => ("interrupted", "#9a6700"),
        (false, false) => ("failed", "#b3261e"),
    };
    let _ = write!(
        page,
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{title}</title><style>{STYLE}</style></head><body>\n<header><span class=\"badge\" style=\"background:{color}\">{word}</span>\
         <h1>&ldquo;{title}&rdquo;</h1><p>{reason}</p></header>\n",
        title = escape(&summary.instruction),
        color = verdict.1,
        word = verdict.0,
        reason = escape(&summary.reason),
    );
    figures(&mut page, summary);
    page.push_str("<section><h2>What the robot knows, from above</h2>");
    page.push_str(&map_svg(graph, drawing));
    page.push_str(
        "<p class=\"legend\"><b style=\"color:#1f5fbf\">blue</b> path as the robot believes, <b>dashed</b> as it truly was; \
         <b style=\"color:#e07b00\">orange</b> frontiers left; zones to keep out of red, slow ones ochre; faint boxes were seen too rarely to be believed. Point at a thing for its caption.</p></section>\n",
    );
    page.push_str("<section><details><summary>Where this robot can go (green), at the end</summary>");
    page.push_str(navigation);
    page.push_str("</details></section>\n");
    page.push_str("<section class=\"charts\"><h2>Over time</h2>");
    let series = |value: fn(&mission::journal::CurveSample) -> f64| -> Vec<(f64, f64)> {
        journal.curves.iter().map(|sample| (sample.t_s, value(sample))).collect()
    };
    page.push_str(&curves("Speed", "m/s", &[("speed", series(|s| s.speed_mps))]));
    page.push_str(&curves("Distance to the nearest obstacle", "m", &[("clearance", series(|s| s.clearance_m))]));
    page.push_str(&curves("Tokens sent", "tokens", &[("tokens", series(|s| s.prompt_tokens as f64))]));
    page.push_str(&curves(
        "Known so far",
        "count",
        &[("objects", series(|s| s.objects as f64)), ("rooms", series(|s| s.rooms as f64))],
    ));
    page.push_str("</section>\n<section><h2>Decisions</h2>");
    if journal.decisions.is_empty() {
        page.push_str("<p>None was taken.</p>");
    }
    for decision in &journal.decisions {
        one_decision(&mut page, decision);
    }
    page.push_str("</section>\n");
    rooms_and_objects(&mut page, graph);
    time_table(&mut page, summary);
    if !journal.notes.is_empty() {
        page.push_str("<section><h2>Notes</h2><ul>");
        for (t_s, note) in &journal.notes {
            let _ = write!(page, "<li>{t_s:.1} s: {}</li>", escape(note));
        }
        page.push_str("</ul></section>\n");
    }
    page.push_str("</body></html>\n");
    page
}

fn figures(page: &mut String, summary: &Summary) {
    let shortest = summary.shortest_m.map_or("none".into(), |m| format!("{m:.1} m"));
    let clearance = summary.min_clearance_m.map_or("-".into(), |m| format!("{m:.2} m"));
    let rows: [(&str, String); 12] = [
        ("robot", format!("{} ({})", summary.robot, summary.model)),
        ("building, seed", format!("{}, {}", summary.scene, summary.seed)),
        ("decided for", if summary.target.is_empty() { "-".into() } else { summary.target.clone() }),
        ("path driven", format!("{:.1} m", summary.path_m)),
        ("shortest way", shortest),
        ("SPL", format!("{:.2}", summary.spl)),
        ("simulated", format!("{:.1} s", summary.sim_s)),
        (
            "computed in",
            format!("{:.1} s ({:.1}x real time)", summary.wall_s, summary.sim_s / summary.wall_s.max(1e-9)),
        ),
        (
            "decisions",
            format!(
                "{} ({} prompt tokens, {} answer tokens)",
                summary.decisions, summary.prompt_tokens, summary.answer_tokens
            ),
        ),
        ("collisions", collisions(summary)),
        ("least clearance", clearance),
        ("known at the end", format!("{} rooms, {} objects", summary.rooms_found, summary.objects_found)),
    ];
    let zones = summary.zones.iter().map(|zone| (format!("zone \u{201c}{}\u{201d}", zone.name), zone_line(zone)));
    let rows = rows.map(|(name, value)| (name.to_owned(), value)).into_iter().chain(zones);
    page.push_str("<section class=\"figures\">");
    for (name, value) in rows {
        let _ = write!(page, "<div><span>{}</span><b>{}</b></div>", escape(&name), escape(&value));
    }
    page.push_str("</section>\n");
}

/// What truly happened at a zone.
fn zone_line(zone: &ZoneFigures) -> String {
    match zone.max_mps {
        None => format!("{} entries", zone.entries),
        Some(max_mps) if zone.entries == 0 => format!("at most {max_mps} m/s; not entered"),
        Some(max_mps) => format!("at most {max_mps} m/s; {:.2} m/s inside", zone.fastest_mps),
    }
}

/// With the contacts with people, where there were any.
fn collisions(summary: &Summary) -> String {
    match summary.contacts_with_people {
        0 => summary.collisions.to_string(),
        contacts => format!("{}, and {contacts} with people", summary.collisions),
    }
}

fn one_decision(page: &mut String, decision: &DecisionEntry) {
    let _ = write!(
        page,
        "<details><summary><b>{:.1} s</b> &nbsp; {} <span class=\"dim\">step {}, {}, {} tokens, confidence {:.2}{}</span></summary>",
        decision.decided_s,
        escape(
            &decision.question.as_ref().map_or(decision.action.clone(), |question| format!("asks: {}", question.text))
        ),
        decision.step + 1,
        escape(&decision.reasoner),
        decision.prompt_tokens,
        decision.confidence,
        if decision.is_fallback { ", fallback" } else { "" },
    );
    if let Some(question) = &decision.question {
        let answer = question.answer.as_ref().map_or("no answer".into(), |answer| format!("\u{201c}{answer}\u{201d}"));
        let _ = write!(
            page,
            "<p class=\"question\"><b>Asked instead:</b> {}<br><b>Answer:</b> {} ({})</p>",
            escape(&question.text),
            escape(&answer),
            escape(&question.meaning),
        );
    }
    page.push_str("<table>");
    for entry in &decision.trace {
        let _ = write!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&entry.step),
            escape(&entry.input),
            escape(&entry.output)
        );
    }
    page.push_str("</table><h4>Critic</h4><ul>");
    for verdict in &decision.verdicts {
        let _ = write!(page, "<li>{}</li>", escape(verdict));
    }
    let _ = write!(page, "</ul><h4>Prompt</h4><pre>{}</pre><h4>Answer</h4>", escape(&decision.prompt));
    for reply in &decision.replies {
        let _ = write!(page, "<pre>{}</pre>", escape(reply));
    }
    page.push_str("</details>\n");
}

fn rooms_and_objects(page: &mut String, graph: &SceneGraph) {
    page.push_str("<section><h2>Rooms and what is in them</h2><table><tr><th>room</th><th>things</th></tr>");
    for room in graph.rooms() {
        let mut labels: Vec<&str> =
            graph.objects().filter(|o| o.room == Some(room.id) && o.confirmed).map(|o| o.label.as_str()).collect();
        labels.sort_unstable();
        let mut counted: Vec<(&str, usize)> = Vec::new();
        for label in labels {
            match counted.last_mut() {
                Some((last, count)) if *last == label => *count += 1,
                _ => counted.push((label, 1)),
            }
        }
        let things: Vec<String> = counted
            .into_iter()
            .map(|(label, count)| if count == 1 { label.to_owned() } else { format!("{count} x {label}") })
            .collect();
        let _ = write!(
            page,
            "<tr><td>{} <span class=\"dim\">{}</span></td><td>{}</td></tr>",
            escape(&room.name),
            room.id,
            escape(&things.join(", "))
        );
    }
    page.push_str("</table></section>\n");
}

fn time_table(page: &mut String, summary: &Summary) {
    page.push_str(
        "<section><h2>Where the time went</h2><table><tr><th>stage</th><th>calls</th><th>total ms</th><th>p95 ms</th></tr>",
    );
    let mut stages: Vec<_> = summary.stages.iter().collect();
    stages.sort_by(|a, b| b.1.cpu_ms_total.total_cmp(&a.1.cpu_ms_total).then(a.0.cmp(b.0)));
    for (name, stage) in stages {
        let _ = write!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{:.0}</td><td>{:.2}</td></tr>",
            escape(name),
            stage.calls,
            stage.cpu_ms_total,
            stage.cpu_ms_p95
        );
    }
    page.push_str("</table></section>\n");
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:1180px;margin:0 auto;padding:1.2rem}\
h1{font-size:1.5rem;margin:.4rem 0}h2{font-size:1.1rem;margin:1.4rem 0 .5rem}h4{margin:.6rem 0 .2rem}\
.badge{color:#fff;border-radius:4px;padding:.15rem .6rem;font-weight:600}.dim{color:#777;font-size:.85em}\
.figures{display:grid;grid-template-columns:repeat(auto-fill,minmax(230px,1fr));gap:.5rem}\
.figures div{overflow-wrap:anywhere;background:#f4f4f2;border-radius:6px;padding:.45rem .7rem}.figures span{display:block;color:#666;font-size:.8rem}\
.charts svg{max-width:100%;margin-right:.6rem}.legend{color:#555;font-size:.88rem}\
details{border:1px solid #ddd;border-radius:6px;padding:.35rem .7rem;margin:.3rem 0}summary{cursor:pointer}\
pre{background:#f7f7f5;padding:.6rem;white-space:pre-wrap;overflow-wrap:anywhere;font-size:.82rem}\
table{border-collapse:collapse;width:100%}td,th{border-bottom:1px solid #e5e5e5;padding:.25rem .5rem;text-align:left;vertical-align:top}";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_self_contained_and_escapes_what_a_model_wrote() {
        let summary = Summary { instruction: "find <b>".into(), ..Summary::default() };
        let mut journal = Journal::default();
        journal
            .decisions
            .push(DecisionEntry { replies: vec!["<script>alert(1)</script>".into()], ..Default::default() });
        let page = report_html(&summary, &SceneGraph::new(), &MapDrawing::default(), "", &journal);
        assert!(!page.contains("<script"), "no script, ours or anybody's");
        assert!(!page.contains("http://") || page.matches("http://").all(|_| page.contains("www.w3.org")));
        assert!(page.contains("find &lt;b&gt;"));
    }
}
