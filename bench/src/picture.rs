//! The picture of a measurement: a histogram of latency on a logarithmic axis, one curve per chain.
//!
//! Each curve counts the samples of a bin over all samples of its chain; bins are equally wide on the logarithmic axis, so
//! that a tail of milliseconds and a body of microseconds both show.

use crate::BenchError;
use crate::figures::ChainRounds;
use plotters::prelude::*;

/// Bins per factor of ten.
const BINS_PER_DECADE: f64 = 24.0;
/// The axis, microseconds.
const AXIS_US: core::ops::Range<f64> = 1.0..100_000.0;
/// Smallest part of the samples that shows.
const LEAST: f64 = 1e-4;
const SIZE: (u32, u32) = (960, 560);
/// Okabe and Ito's colours, which all eyes can tell apart.
const COLORS: [RGBColor; 8] = [
    RGBColor(30, 30, 30),
    RGBColor(230, 159, 0),
    RGBColor(213, 94, 0),
    RGBColor(204, 121, 167),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(86, 180, 233),
    RGBColor(150, 140, 20),
];

/// The histogram as the text of an SVG file.
///
/// # Errors
/// [`BenchError::Picture`].
pub fn histogram_svg(title: &str, chains: &[ChainRounds]) -> Result<String, BenchError> {
    let mut text = String::new();
    draw(&mut text, title, chains).map_err(BenchError::Picture)?;
    Ok(text)
}

fn draw(text: &mut String, title: &str, chains: &[ChainRounds]) -> Result<(), String> {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE).map_err(said)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(14)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(AXIS_US.log_scale(), (LEAST..1.0).log_scale())
        .map_err(said)?;
    chart
        .configure_mesh()
        .x_desc("latency of three hops, microseconds")
        .y_desc("part of the samples per bin")
        .x_label_formatter(&|us| format!("{us}"))
        .y_label_formatter(&|part| format!("{part}"))
        .light_line_style(RGBColor(240, 240, 240))
        .bold_line_style(RGBColor(220, 220, 220))
        .draw()
        .map_err(said)?;
    for (idx, chain) in chains.iter().enumerate() {
        let style = COLORS[idx % COLORS.len()].stroke_width(2);
        chart
            .draw_series(LineSeries::new(curve(chain), style))
            .map_err(said)?
            .label(chain.name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], style));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 14))
        .draw()
        .map_err(said)?;
    root.present().map_err(said)
}

/// Middle of each bin, microseconds, and its part of the samples; bins without a sample lie on the lower edge.
fn curve(chain: &ChainRounds) -> Vec<(f64, f64)> {
    let decades = (AXIS_US.end / AXIS_US.start).log10();
    let mut bins = vec![0u32; (decades * BINS_PER_DECADE).ceil() as usize];
    let mut n_samples = 0u32;
    for sample in chain.samples() {
        let us = (sample.latency_ns() as f64 * 1e-3).clamp(AXIS_US.start, AXIS_US.end * 0.999);
        let bin = ((us / AXIS_US.start).log10() * BINS_PER_DECADE) as usize;
        if let Some(count) = bins.get_mut(bin) {
            *count += 1;
            n_samples += 1;
        }
    }
    let middle = |bin: usize| AXIS_US.start * 10f64.powf((bin as f64 + 0.5) / BINS_PER_DECADE);
    let part = |count: u32| (f64::from(count) / f64::from(n_samples.max(1))).max(LEAST);
    bins.iter().enumerate().map(|(bin, count)| (middle(bin), part(*count))).collect()
}

/// The drawing library's errors borrow the text that is drawn into.
pub(crate) fn said<E: core::fmt::Display>(error: E) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RelaySample, Round};

    #[test]
    fn every_chain_has_its_curve_and_its_name_in_the_picture() {
        let chain = |name, us: i64| ChainRounds {
            name,
            rounds: vec![Round {
                samples: vec![RelaySample { sequence: 1, source_ns: 0, arrived_ns: [0, 0, us * 1000] }; 3],
                ..Round::default()
            }],
        };
        let chains = [chain("floor-futex", 10), chain("krait", 20)];
        let svg = histogram_svg("Latency", &chains).expect("drawn");
        assert!(svg.starts_with("<svg") && svg.contains("floor-futex") && svg.contains("krait"), "{svg}");
        let (peak_us, part) = curve(&chains[1]).into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("bins");
        assert!((19.0..21.0).contains(&peak_us) && part == 1.0, "{peak_us} {part}");
    }
}
