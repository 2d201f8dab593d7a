//! The picture of how latency grows with one setting after the other: a panel each, median and 99th percentile.

use crate::BenchError;
use crate::figures::Quantiles;
use crate::picture::said;
use plotters::prelude::*;

/// What one panel shows.
#[derive(Clone, Debug)]
pub struct Growth {
    /// The setting with its unit.
    pub title: &'static str,
    /// Its values in rising order, more than zero, and the latency with each.
    pub points: Vec<(f64, Quantiles)>,
}

const PANEL: (u32, u32) = (400, 420);
/// The axis of latency, microseconds.
const AXIS_US: core::ops::Range<f64> = 10.0..100_000.0;
const COLORS: [(&str, RGBColor); 2] = [("p50", RGBColor(0, 114, 178)), ("p99", RGBColor(213, 94, 0))];

/// The panels side by side as the text of an SVG file.
///
/// # Errors
/// [`BenchError::Picture`].
pub fn growth_svg(title: &str, panels: &[Growth]) -> Result<String, BenchError> {
    let mut text = String::new();
    draw(&mut text, title, panels).map_err(BenchError::Picture)?;
    Ok(text)
}

fn draw(text: &mut String, title: &str, panels: &[Growth]) -> Result<(), String> {
    let size = (PANEL.0 * u32::try_from(panels.len().max(1)).map_err(said)?, PANEL.1);
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE).map_err(said)?;
    let root = root.titled(title, ("sans-serif", 18)).map_err(said)?;
    for (area, panel) in root.split_evenly((1, panels.len().max(1))).iter().zip(panels) {
        let first = panel.points.first().map_or(1.0, |point| point.0);
        let last = panel.points.last().map_or(1.0, |point| point.0);
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d((first * 0.9..last * 1.1).log_scale(), AXIS_US.log_scale())
            .map_err(said)?;
        chart
            .configure_mesh()
            .x_desc(panel.title)
            .y_desc("latency of three hops, microseconds")
            .x_label_formatter(&|value| format!("{value:.0}"))
            .y_label_formatter(&|us| format!("{us:.0}"))
            .light_line_style(RGBColor(240, 240, 240))
            .draw()
            .map_err(said)?;
        for ((name, color), of) in COLORS.into_iter().zip([|q: &Quantiles| q.p50, |q: &Quantiles| q.p99]) {
            let line: Vec<_> = panel.points.iter().map(|(value, q)| (*value, of(q).max(AXIS_US.start))).collect();
            chart.draw_series(line.iter().map(|at| Circle::new(*at, 3, color.filled()))).map_err(said)?;
            chart
                .draw_series(LineSeries::new(line, color.stroke_width(2)))
                .map_err(said)?
                .label(name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], color.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .draw()
            .map_err(said)?;
    }
    root.present().map_err(said)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_panel_has_its_axis_and_both_curves() {
        let quantiles = Quantiles { p50: 30.0, p99: 90.0, ..Quantiles::default() };
        let panel = |title| Growth { title, points: vec![(1.0, quantiles), (8.0, quantiles)] };
        let svg = growth_svg("Growth", &[panel("chains"), panel("readers")]).expect("drawn");
        assert!(svg.starts_with("<svg") && svg.matches("p99").count() == 2, "{svg}");
        assert!(svg.contains("chains") && svg.contains("readers") && svg.matches("<circle").count() == 8, "{svg}");
    }
}
