//! The page that a bench writes: a table and a chart, beside the figures of the paper, in one file without anything to fetch.

use std::path::PathBuf;

use anyhow::Result;
use arena::chart::bars;
use arena::map_picture::escape;
use arena::whole_file::write_whole;
use clap::Args;

/// How a bench says what it found: the options that all of them share.
#[derive(Debug, Args)]
pub struct ReportOptions {
    /// Write a page with table and chart
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

impl ReportOptions {
    /// Writes the page, if one was asked for.
    pub fn write_page(&self, page: impl FnOnce() -> String) -> Result<()> {
        self.html.as_ref().map_or(Ok(()), |path| write_whole(path, |out| out.write_all(page().as_bytes())))
    }
}

/// What a page shows.
pub struct Page<'a> {
    /// Heading.
    pub title: &'a str,
    /// A sentence or two: what was measured, on what, by which command.
    pub note: &'a str,
    /// Heads of the columns; the first is that of the row names.
    pub columns: Vec<String>,
    /// Name and cells of each row; empty for nothing.
    pub rows: Vec<(String, Vec<Option<f64>>)>,
    /// Decimals of the cells.
    pub decimals: usize,
    /// Unit of the chart's axis.
    pub unit: &'a str,
    /// Rows that are drawn, by position.
    pub drawn: Vec<usize>,
    /// What follows the chart: HTML.
    pub rest: String,
}

/// A table of text: heads of the columns, and rows.
pub fn text_table(head: &[&str], rows: &[Vec<String>]) -> String {
    let line = |tag: &str, cells: &mut dyn Iterator<Item = &str>| -> String {
        let cells: String = cells.map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect();
        format!("<tr>{cells}</tr>")
    };
    let head = line("th", &mut head.iter().copied());
    let rows: String = rows.iter().map(|row| line("td", &mut row.iter().map(String::as_str))).collect();
    format!("<table>{head}{rows}</table>")
}

/// A table: heads of the columns, and name and cells of each row with this many decimals.
pub fn table(columns: &[String], rows: &[(String, Vec<Option<f64>>)], decimals: usize) -> String {
    let cell = |value: &Option<f64>| value.map_or_else(String::new, |value| format!("{value:.decimals$}"));
    let row = |(name, cells): &(String, Vec<Option<f64>>)| -> Vec<String> {
        std::iter::once(name.clone()).chain(cells.iter().map(cell)).collect()
    };
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    text_table(&columns, &rows.iter().map(row).collect::<Vec<_>>())
}

impl Page<'_> {
    /// The HTML text.
    pub fn html(&self) -> String {
        let groups: Vec<&str> = self.columns.iter().skip(1).map(String::as_str).collect();
        let series: Vec<(&str, Vec<f64>)> = self
            .drawn
            .iter()
            .filter_map(|row| self.rows.get(*row))
            .map(|(name, cells)| (name.as_str(), cells.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect()))
            .collect();
        format!(
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
             <title>{title}</title><style>body{{font:15px/1.45 system-ui,sans-serif;max-width:1000px;margin:0 auto;padding:1.2rem}}\
             table{{border-collapse:collapse}}td,th{{border-bottom:1px solid #ddd;padding:.25rem .6rem;text-align:right}}\
             td:first-child,th:first-child{{text-align:left}}svg{{max-width:100%}}</style></head><body><h1>{title}</h1><p>{note}</p>\
             {table}{chart}{rest}</body></html>\n",
            title = escape(self.title),
            note = escape(self.note),
            table = table(&self.columns, &self.rows, self.decimals),
            rest = self.rest,
            chart = bars(self.title, self.unit, &groups, &series),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_its_table_and_its_chart_and_escapes_names() {
        let page = Page {
            title: "t<b>",
            note: "n",
            columns: vec!["".into(), "D1".into(), "D2".into()],
            rows: vec![("a".into(), vec![Some(1.0), None]), ("b".into(), vec![Some(2.0), Some(3.0)])],
            decimals: 1,
            unit: "tokens",
            drawn: vec![0, 1],
            rest: "<p>more</p>".into(),
        };
        let html = page.html();
        assert!(
            html.contains("<td>2.0</td>")
                && html.contains("<svg")
                && html.contains("<p>more</p>")
                && !html.contains("t<b>"),
            "{html}"
        );
    }
}
