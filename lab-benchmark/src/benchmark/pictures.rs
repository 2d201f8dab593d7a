//! Pictures of a benchmark: the rate of right first names by size and motion, and the lab beside simpler rules.

use super::{Rate, Summary};
use krait_lab::report::picture::{COLOURS, Picture, layout, plain, short};
use plotly::common::{ErrorData, ErrorType, Marker, Mode};
use plotly::{Bar, Scatter, Trace};
use std::collections::BTreeMap;

/// By size of the hidden effect, and by motion.
pub(super) fn first_names(summary: &Summary) -> Vec<Picture> {
    let size = "A curve that rises from left to right: what is larger beside the camera's noise is named more surely \
                (whiskers: 95 % intervals after Wilson).";
    let motion = "Motions without reversals and rests tell less.";
    vec![
        of_rates("By size", size, "size of the effect, in lengths of the noise", &summary.top_1_by_size),
        of_rates("By motion", motion, "motion", &summary.top_1_by_motion),
    ]
}

fn of_rates(title: &str, sentence: &str, x: &str, rates: &BTreeMap<String, Rate>) -> Picture {
    let own: Vec<(String, Rate)> = rates
        .iter()
        .filter(|(key, rate)| *key != "all" && rate.of > 0)
        .map(|(key, rate)| (format!("{}<br>{} cells", plain(key), rate.of), *rate))
        .collect();
    if own.is_empty() {
        return Picture::none(title, "No cell of the grid belongs here.");
    }
    let of = |pick: fn(&Rate) -> f64| own.iter().map(|(_, rate)| short(100.0 * pick(rate))).collect::<Vec<f64>>();
    let whiskers = ErrorData::new(ErrorType::Data).symmetric(false);
    let whiskers = whiskers.array(of(|r| r.high - r.rate)).array_minus(of(|r| r.rate - r.low));
    let names: Vec<String> = own.iter().map(|(name, _)| name.clone()).collect();
    let trace = Scatter::new(names, of(|r| r.rate))
        .mode(Mode::Markers)
        .name("first name right")
        .marker(Marker::new().color(COLOURS[2]).size(9))
        .error_y(whiskers);
    Picture::new(title, sentence, x, "share of cells (%)", vec![trace])
}

/// The lab and simpler rules on the same data.
pub(super) fn baselines(summary: &Summary) -> Picture {
    let alarms = summary.false_alarms.get("all").copied().unwrap_or_else(|| Rate::new(0, 0));
    let lab = ("the lab".to_owned(), [alarms, summary.top_1, summary.pairs_exact]);
    let others = summary.baselines.iter().map(|(name, rates)| (plain(name), *rates));
    let rules: Vec<(String, [Rate; 3])> = core::iter::once(lab).chain(others).collect();
    let bars = |k: usize, name: &str, colour: usize| -> Box<dyn Trace> {
        let names: Vec<String> = rules.iter().map(|(name, _)| name.clone()).collect();
        let values: Vec<f64> = rules.iter().map(|(_, rates)| short(100.0 * rates[k].rate)).collect();
        Bar::new(names, values).name(name).marker(Marker::new().color(COLOURS[colour]))
    };
    let traces = vec![bars(0, "false alarms", 1), bars(1, "first name right", 2), bars(2, "pairs exact", 3)];
    let sentence = "A good rule has no orange bar and high others: a rule that always names something is right often, and \
                    wrong whenever nothing is hidden.";
    Picture::with_layout("Rules", sentence, layout("", "share of cells (%)"), traces)
}
