//! Curves over time and bars in groups, as SVG text.

use plotters::prelude::*;

use crate::map_picture::escape;

/// Draws one or more curves over a common time axis. `unit` is that of the values; those that are not finite
/// are left out.
pub fn curves(title: &str, unit: &str, series: &[(&str, Vec<(f64, f64)>)]) -> String {
    lines(title, unit, "s", series)
}

/// The same over any axis that begins at zero; `axis` is its name with its unit.
pub fn lines(title: &str, unit: &str, axis: &str, series: &[(&str, Vec<(f64, f64)>)]) -> String {
    const SIZE: (u32, u32) = (560, 190);
    const COLORS: [RGBColor; 3] = [RGBColor(31, 119, 180), RGBColor(214, 39, 40), RGBColor(44, 160, 44)];
    let finite = |points: &[(f64, f64)]| -> Vec<(f64, f64)> {
        points.iter().copied().filter(|(t, y)| t.is_finite() && y.is_finite()).collect()
    };
    let series: Vec<(&str, Vec<(f64, f64)>)> = series.iter().map(|(name, points)| (*name, finite(points))).collect();
    let all = || series.iter().flat_map(|(_, points)| points.iter());
    let end = all().map(|(x, _)| *x).fold(1.0, f64::max);
    let low = all().map(|(_, y)| *y).fold(0.0, f64::min);
    let high = all().map(|(_, y)| *y).fold(low + 1e-3, f64::max);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let drawn = (|| -> Result<(), Box<dyn std::error::Error>> {
            let mut chart = ChartBuilder::on(&root)
                .caption(format!("{title}, {unit}"), ("sans-serif", 14))
                .margin(6)
                .x_label_area_size(34)
                .y_label_area_size(46)
                .build_cartesian_2d(0.0..end, low..high * 1.05)?;
            chart.configure_mesh().x_desc(axis).light_line_style(WHITE).x_labels(8).y_labels(5).draw()?;
            for (index, (name, points)) in series.iter().enumerate() {
                let color = COLORS[index % COLORS.len()];
                let drawn = chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(1)))?;
                if series.len() > 1 {
                    drawn.label(*name).legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
                }
            }
            if series.len() > 1 {
                chart
                    .configure_series_labels()
                    .position(SeriesLabelPosition::LowerRight)
                    .background_style(WHITE.mix(0.8))
                    .border_style(BLACK.mix(0.2))
                    .draw()?;
            }
            root.present()?;
            Ok(())
        })();
        if drawn.is_err() {
            return format!("<p>{title}: nothing to draw</p>");
        }
    }
    svg
}

/// Draws bars below a line of text that names their colours: one group for each name, one bar in it for each series; what is not finite is
/// left out. The axis begins at zero; that of percentages ends at a hundred.
pub fn bars(title: &str, unit: &str, groups: &[&str], series: &[(&str, Vec<f64>)]) -> String {
    const SIZE: (u32, u32) = (900, 300);
    /// Free height above the highest bar.
    const HEADROOM: f64 = 1.05;
    if groups.is_empty() || series.is_empty() {
        return format!("<p>{}: nothing to draw</p>", escape(title));
    }
    let values = || series.iter().flat_map(|(_, values)| values).copied().filter(|value| value.is_finite());
    let high = if unit == "%" { 100.0 } else { HEADROOM * values().fold(1e-3, f64::max) };
    let mut svg = String::new();
    let drawn = (|| -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .caption(format!("{title}, {unit}"), ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(30)
            .y_label_area_size(56)
            .build_cartesian_2d(-0.5..groups.len() as f64 - 0.5, 0.0..high)?;
        let label = |at: &f64| {
            let index = at.round();
            let is_middle = (at - index).abs() < 1e-6 && index >= 0.0;
            if is_middle { groups.get(index as usize).copied().unwrap_or("").to_string() } else { String::new() }
        };
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(WHITE)
            .x_labels(groups.len() * 2 + 1)
            .x_label_formatter(&label)
            .y_labels(6)
            .draw()?;
        let width = 0.8 / series.len() as f64;
        for (index, (_, values)) in series.iter().enumerate() {
            let color = Palette99::pick(index).to_rgba();
            let left = |group: usize| group as f64 - 0.4 + width * index as f64;
            let finite = values.iter().copied().enumerate().filter(|(_, value)| value.is_finite());
            chart.draw_series(finite.map(|(group, value)| {
                Rectangle::new([(left(group), 0.0), (left(group) + 0.92 * width, value)], color.filled())
            }))?;
        }
        root.present()?;
        Ok(())
    })();
    if drawn.is_err() {
        return format!("<p>{}: nothing to draw</p>", escape(title));
    }
    let legend: Vec<String> = series.iter().enumerate().map(|(index, (name, _))| legend_entry(index, name)).collect();
    format!("<p>{}</p>{svg}", legend.join(" &ensp; "))
}

/// A square in the colour of a series, and its name.
fn legend_entry(index: usize, name: &str) -> String {
    let (r, g, b) = Palette99::pick(index).to_rgba().rgb();
    format!("<span style=\"color:rgb({r},{g},{b})\">&#9632;</span> {}", escape(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_drawn_and_nothing_or_nan_does_no_harm() {
        let svg = bars("tokens", "1", &["D1", "D2"], &[("ours", vec![1.0, 2.0]), ("flat", vec![3.0, f64::NAN])]);
        assert!(svg.contains("<svg") && svg.contains("D2") && svg.contains("flat"), "{svg}");
        assert!(bars("empty", "1", &[], &[]).contains("nothing"));
    }

    #[test]
    fn percentages_end_at_a_hundred_and_names_are_escaped() {
        let svg = bars("right", "%", &["D1"], &[("a<b", vec![100.0]), ("c", vec![80.0]), ("d", vec![16.0])]);
        let marks: Vec<&str> =
            svg.split('>').filter_map(|part| part.trim().strip_suffix("</text")).map(str::trim).collect();
        assert!(marks.contains(&"100.0") && !marks.contains(&"120.0"), "{marks:?}");
        assert!(svg.contains("a&lt;b") && !svg.contains("a<b"), "{svg}");
    }

    #[test]
    fn curves_are_drawn_and_nothing_or_nan_does_no_harm() {
        let svg = curves("speed", "m/s", &[("speed", vec![(0.0, 0.0), (1.0, 0.5), (2.0, f64::NAN)])]);
        assert!(svg.starts_with("<svg") && svg.contains("polyline"), "{svg}");
        assert!(curves("empty", "m", &[("none", Vec::new())]).contains("svg"));
    }
}
