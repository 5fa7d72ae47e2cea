//! What the page is made of: sections, claims, tables, commands; HTML text without anything to fetch.

use arena::intervals::Estimate;
use arena::map_picture::escape;

use super::experiment::command_line;
pub use crate::bench_page::text_table as table;

/// A part of the page.
#[derive(Debug, Default)]
pub struct Section {
    /// Word by which it is asked for and linked.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// HTML.
    pub body: String,
    /// What it says about the claims of the paper.
    pub claims: Vec<Claim>,
}

/// A claim, and what came of it here.
#[derive(Debug)]
pub struct Claim {
    /// What is claimed, as a sentence that can be true or false.
    pub claim: String,
    /// The paper's figure.
    pub paper: String,
    /// Ours, with its interval.
    pub ours: String,
    /// Number of cases behind ours.
    pub n: usize,
    /// What came of it.
    pub finding: Finding,
    /// What can be compared with the paper's figure, and what not.
    pub comparable: &'static str,
}

/// What an experiment says about a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Finding {
    /// The whole interval lies on the side that is claimed.
    Shown,
    /// The interval holds both.
    Open,
    /// The whole interval lies on the other side.
    Refuted,
}

impl Finding {
    /// Of a difference that is claimed to be positive.
    pub fn positive(estimate: &Estimate) -> Finding {
        let [low, high] = estimate.interval_95;
        if low > 0.0 {
            Finding::Shown
        } else if high < 0.0 {
            Finding::Refuted
        } else {
            Finding::Open
        }
    }

    /// Of something that must be at least as much: the estimate against a bar.
    pub fn at_least(bar: f64, estimate: &Estimate) -> Finding {
        let [low, high] = estimate.interval_95;
        if low >= bar {
            Finding::Shown
        } else if high < bar {
            Finding::Refuted
        } else {
            Finding::Open
        }
    }

    fn html(self) -> &'static str {
        match self {
            Finding::Shown => "<b class=\"yes\">shown</b>",
            Finding::Open => "<b class=\"open\">not shown</b>",
            Finding::Refuted => "<b class=\"no\">it is not so</b>",
        }
    }
}

/// A figure with its interval, times a factor, with decimals and a unit.
pub fn with_interval(estimate: &Estimate, factor: f64, decimals: usize, unit: &str) -> String {
    let [low, high] = estimate.interval_95.map(|end| factor * end);
    let value = factor * estimate.value;
    if low.is_finite() && high.is_finite() {
        format!("{value:.decimals$}{unit} ({low:.decimals$} to {high:.decimals$})")
    } else {
        format!("{value:.decimals$}{unit} (too few for an interval)")
    }
}

/// The same of a difference: signs are always said.
pub fn difference(estimate: &Estimate, factor: f64, decimals: usize, unit: &str) -> String {
    // Nothing is never negative.
    let signed = |value: f64| {
        let text = format!("{value:+.decimals$}");
        if text.trim_start_matches(['-', '+', '0', '.']).is_empty() { text.replace('-', "+") } else { text }
    };
    let [low, high] = estimate.interval_95.map(|end| factor * end);
    let value = signed(factor * estimate.value);
    if low.is_finite() && high.is_finite() {
        format!("{value}{unit} ({} to {})", signed(low), signed(high))
    } else {
        format!("{value}{unit} (too few for an interval)")
    }
}

/// A paragraph.
pub fn paragraph(text: &str) -> String {
    format!("<p>{}</p>", escape(text))
}

/// The command that makes a figure, as it is printed under it.
pub fn command(args: &[String]) -> String {
    format!("<p class=\"command\"><code>{}</code></p>", escape(&command_line(args)))
}

/// The whole page.
pub fn page(is_quick: bool, sections: &[Section]) -> String {
    let claims: String = sections
        .iter()
        .flat_map(|section| section.claims.iter().map(move |claim| (section, claim)))
        .map(|(section, claim)| {
            format!(
                "<tr><td><a href=\"#{}\">{}</a></td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"dim\">{}</td></tr>",
                section.id,
                escape(&claim.claim),
                escape(&claim.paper),
                escape(&claim.ours),
                claim.n,
                claim.finding.html(),
                escape(claim.comparable)
            )
        })
        .collect();
    let bodies: String = sections
        .iter()
        .map(|section| {
            format!("<section id=\"{}\"><h2>{}</h2>{}</section>\n", section.id, escape(section.title), section.body)
        })
        .collect();
    let quick = if is_quick {
        "<p class=\"quick\"><b>This is the quick version</b>: so few cases that most intervals hold everything. Without --quick the same \
         experiments are run with the numbers that the bars ask for.</p>"
    } else {
        ""
    };
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>The evidence</title><style>{STYLE}</style></head><body><h1>The evidence</h1>\
         <p>The experiments of the OmniVLN paper on this system, version {}, in its own simulator. Under every figure stands the \
         command that prints it; all are deterministic but for times on the clock. Intervals are those of 95 %: Wilson&rsquo;s for shares, \
         Newcombe&rsquo;s for differences of shares, seeded bootstrap for means of pairs. &ldquo;Not shown&rdquo; means that the interval holds both.</p>\
         {quick}<h2>What is claimed, and what came of it</h2><table class=\"claims\"><tr><th>claim</th><th>paper</th><th>here</th><th>n</th><th>finding</th>\
         <th>what is comparable</th></tr>{claims}</table>{bodies}</body></html>\n",
        env!("CARGO_PKG_VERSION")
    )
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;color:#222;max-width:1180px;margin:0 auto;padding:1.2rem}\
h2{margin:2rem 0 .5rem;border-top:1px solid #ccc;padding-top:1rem}table{border-collapse:collapse;margin:.6rem 0;max-width:100%}\
td,th{border-bottom:1px solid #ddd;padding:.25rem .6rem;text-align:right;vertical-align:top}td:first-child,th:first-child{text-align:left}\
.claims td,.claims th{text-align:left}.dim{color:#666;font-size:.88em}svg,img{max-width:100%;height:auto}\
.command code{background:#f4f4f2;border-radius:4px;padding:.2rem .5rem;font-size:.82rem;overflow-wrap:anywhere}.command{margin:.3rem 0}\
.yes{color:#1a7f37}.open{color:#9a6700}.no{color:#b3261e}.quick{background:#fff6dd;padding:.5rem .8rem;border-radius:6px}\
figure{margin:1rem 0}figcaption{color:#555;font-size:.9rem}.missing{color:#b3261e}";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_follows_from_the_interval_alone() {
        let estimate = |low: f64, high: f64| Estimate { value: 0.5 * (low + high), interval_95: [low, high] };
        assert_eq!(Finding::positive(&estimate(0.1, 0.2)), Finding::Shown);
        assert_eq!(Finding::positive(&estimate(-0.1, 0.2)), Finding::Open);
        assert_eq!(Finding::positive(&estimate(-0.2, -0.1)), Finding::Refuted);
        assert_eq!(Finding::at_least(0.9, &estimate(0.9, 0.99)), Finding::Shown);
        assert_eq!(Finding::at_least(0.9, &estimate(0.8, 0.99)), Finding::Open);
        assert_eq!(Finding::at_least(0.9, &estimate(0.5, 0.8)), Finding::Refuted);
    }

    #[test]
    fn differences_have_a_sign_and_no_difference_is_not_negative() {
        let none = Estimate { value: -0.0, interval_95: [-0.04, 0.2] };
        assert_eq!(difference(&none, 1.0, 1, " s"), "+0.0 s (+0.0 to +0.2)");
        let few = Estimate { value: -2.0, interval_95: [f64::NEG_INFINITY, f64::INFINITY] };
        assert_eq!(difference(&few, 1.0, 0, ""), "-2 (too few for an interval)");
    }

    #[test]
    fn a_page_fetches_nothing_and_names_are_harmless() {
        let claim = Claim {
            claim: "a<b".into(),
            paper: "1".into(),
            ours: "2".into(),
            n: 3,
            finding: Finding::Open,
            comparable: "all",
        };
        let body = table(&["<i>", "x"], &[vec!["r".into(), "1".into()]]) + &command(&["a b".to_owned()]);
        let section = Section { id: "one", title: "One", body, claims: vec![claim] };
        let page = page(true, &[section]);
        assert!(page.contains("a&lt;b") && page.contains("&lt;i&gt;") && page.contains("quick version"));
        assert!(!page.contains("http") && !page.contains("<script"));
    }
}
