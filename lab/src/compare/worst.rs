//! The sentence that says where the error is worst.

use super::Bin;

/// Bins whose error is less than this many times that of the other rows do not stand out.
const STANDS_OUT: f64 = 1.15;

/// Means that differ by less than this share of the error do not tell anything.
const MUCH: f64 = 0.8;

/// Where the error is worst, of the ways to sort rows that tell most about it.
pub(super) fn sentence(bins: &[Bin], rms: f64, unit: &str) -> String {
    let Some((worst, others)) = telling(bins, rms) else {
        return match turning(bins, rms) {
            Some([(low_mean, low), (high_mean, high)]) => format!(
                "The error is about as large everywhere, but its mean changes with {}: {high_mean:+.2} {unit} {}, {low_mean:+.2} {unit} {}.",
                high.by,
                place(high),
                place(low)
            ),
            None => "The error is about the same everywhere.".to_owned(),
        };
    };
    let mut text = format!("Worst {}: {:.2} {unit} rms", place(worst), worst.rms);
    if others > 0.0 {
        text += &format!(", {:.1} times the other rows' {others:.2} {unit}", worst.rms / others);
    }
    match (worst.mean, worst.plane_mean) {
        (Some(mean), Some(plane)) if mean.abs() >= 0.5 * worst.rms && mean.abs() >= plane.abs() => {
            let how = if mean > 0.0 { "further" } else { "less" };
            text += &format!("; there the snake bends {:.2} {unit} {how} than predicted in the mean", mean.abs());
        }
        (_, Some(plane)) if plane.abs() >= 0.5 * worst.rms => {
            let how = if plane > 0.0 { "towards larger" } else { "towards smaller" };
            text += &format!("; there the snake lies {:.2} {unit} out of the predicted plane {how} delta", plane.abs());
        }
        (Some(mean), None) if mean.abs() >= 0.5 * worst.rms => {
            let how = if mean > 0.0 { "above" } else { "below" };
            text += &format!("; there it is {:.2} {unit} {how} the prediction in the mean", mean.abs());
        }
        _ => {}
    }
    text + "."
}

/// The worst bin of the way to sort that separates large from small errors best, and the error of its other rows.
fn telling(bins: &[Bin], rms: f64) -> Option<(&Bin, f64)> {
    let mut ways: Vec<&str> = bins.iter().map(|bin| bin.by.as_str()).collect();
    ways.sort_unstable();
    ways.dedup();
    let mut best: Option<(f64, &Bin, f64)> = None;
    for by in ways {
        let own: Vec<&Bin> = bins.iter().filter(|bin| bin.by == by).collect();
        let n: usize = own.iter().map(|bin| bin.n_rows).sum();
        // Bins are in order, the worst of those with rows enough first.
        let Some(worst) = own.iter().find(|bin| bin.is_large(n)) else { continue };
        let rest = own.iter().filter(|bin| bin.bin != worst.bin);
        let (n_rest, sum) =
            rest.fold((0, 0.0), |(n, sum), bin| (n + bin.n_rows, sum + bin.n_rows as f64 * bin.rms.powi(2)));
        let others = (sum / f64::from(u32::try_from(n_rest.max(1)).unwrap_or(u32::MAX))).sqrt();
        if n_rest == 0 || worst.rms <= STANDS_OUT * others {
            continue;
        }
        // Rows that this way leaves out, resting ones have no speed, count as if they were average.
        let spread = |bin: &&Bin| bin.n_rows as f64 * (bin.rms.powi(2) - rms.powi(2)).powi(2);
        let between = own.iter().map(spread).sum::<f64>();
        if best.is_none_or(|(most, ..)| between > most) {
            best = Some((between, worst, others));
        }
    }
    best.map(|(_, bin, others)| (bin, others))
}

/// The bins with the least and the largest mean of the way to sort whose means differ most, each with its mean, where that is
/// much of the error.
fn turning(bins: &[Bin], rms: f64) -> Option<[(f64, &Bin); 2]> {
    let n = bins.iter().filter(|bin| bin.by == "time").map(|bin| bin.n_rows).sum();
    let large = || bins.iter().filter(move |bin| bin.is_large(n)).filter_map(|bin| Some((bin.mean?, bin)));
    let mut best: Option<(f64, [(f64, &Bin); 2])> = None;
    for low in large() {
        for high in large().filter(|high| high.1.by == low.1.by) {
            let gap = high.0 - low.0;
            if gap > MUCH * rms && best.is_none_or(|(most, _)| gap > most) {
                best = Some((gap, [low, high]));
            }
        }
    }
    best.map(|(_, pair)| pair)
}

fn place(bin: &Bin) -> String {
    let label = &bin.bin;
    match bin.by.as_str() {
        "bend" => format!("at bends of {label}"),
        "plane" => format!("in the plane around delta {label}"),
        "direction" if label == "at rest" => label.clone(),
        "direction" => format!("while {label}"),
        "speed" => format!("at speeds of {label}"),
        "time" => format!("in the time {label}"),
        "load" => format!("under loads of {label}"),
        "rest" if label == "moving" => "while moving".to_owned(),
        "rest" => format!("after {label}"),
        "trial" => format!("in {label}"),
        by => match by.strip_prefix("direction of ") {
            Some(input) => format!("while {input} is {label}"),
            None => format!("at {by} {label}"),
        },
    }
}
