//! The report of a benchmark as one page without anything outside of it: rates, pictures, confusions, every failure.

use super::{Outcome, Rate, Summary, pictures};
use core::fmt::Display;
use krait_lab::report::html::escape;
use krait_lab::report::page::Page;
use std::collections::BTreeSet;

/// The page; `about` says in a sentence what was run.
pub fn page(summary: &Summary, outcomes: &[Outcome], about: &str) -> String {
    let mut page = Page::with_foot("How good is the model lab", &[vec!["run".to_owned(), about.to_owned()]]);
    page.push(rates(summary));
    page.section("First name right", pictures::first_names(summary));
    page.push(baselines(summary));
    page.section("Beside simpler rules", vec![pictures::baselines(summary)]);
    page.push(confusion(summary));
    page.push(failures(outcomes));
    page.finish()
}

fn rates(summary: &Summary) -> String {
    let mut rows = vec![
        ("Nothing hidden: an effect was claimed (false alarm)".to_owned(), all(summary)),
        ("Nothing hidden: the answer was none".to_owned(), summary.right_none),
        ("One effect: the first name is right".to_owned(), summary.top_1),
        ("One effect: a look-alike of the first name is right".to_owned(), summary.in_class),
        ("One effect: one of the three best is right".to_owned(), summary.top_3),
        ("One effect: claimed, and right".to_owned(), summary.claimed_right),
        ("One effect: claimed, and wrong".to_owned(), summary.claimed_wrong),
        ("One effect: a second one was added".to_owned(), summary.extras),
        ("One effect: exactly this one".to_owned(), summary.single_exact),
        ("Two effects: exactly these".to_owned(), summary.pairs_exact),
        ("Three to five effects: exactly these".to_owned(), summary.several_exact),
        ("Three to five effects: recall".to_owned(), summary.several_recall),
        ("Three to five effects: precision".to_owned(), summary.several_precision),
        ("A known beside an unknown one: it is named, and a rest is said to remain".to_owned(), summary.beside_right),
        ("A known beside an unknown one: a wrong one is named".to_owned(), summary.beside_wrong),
        (
            "Outside the library: a known effect was asserted, alone or beside a rest".to_owned(),
            summary.outside_asserted,
        ),
        ("Two effects: the first name is one of them".to_owned(), summary.pairs_first),
        ("Outside the library: a known effect was claimed".to_owned(), summary.outside_claimed),
        ("Outside the library: called unknown".to_owned(), summary.outside_unknown),
        ("Dimensions off by up to 5 %, geometry free: exactly the effect".to_owned(), summary.off_base_exact),
        ("The same: a look-alike of the effect".to_owned(), summary.off_base_in_class),
        ("One-way ramp: the truth among the look-alikes, or nothing claimed".to_owned(), summary.poor_honest),
        ("95 % intervals that hold the true parameter".to_owned(), summary.coverage),
    ];
    let split = |what: &str, rates: &std::collections::BTreeMap<String, Rate>| -> Vec<(String, Rate)> {
        let own = rates.iter().filter(|(key, _)| *key != "all");
        own.map(|(key, rate)| (format!("{what} {key}"), *rate)).collect()
    };
    rows.extend(split("False alarms, noise", &summary.false_alarms));
    rows.extend(split("First name right, size in noise lengths", &summary.top_1_by_size));
    rows.extend(split("First name right, motion", &summary.top_1_by_motion));
    let mut html = "<h2>Rates</h2>\n<p>Each with its 95 % interval after Wilson.</p>\n<table><tr><th>what</th><th>share</th><th>interval</th><th>cells</th></tr>\n".to_owned();
    for (what, rate) in rows {
        html += &row(&[&escape(&what), &percent(rate.rate), &interval(rate), &format!("{} of {}", rate.n, rate.of)]);
    }
    html += "</table>\n<p>Held-out error over the noise that was added: median ";
    html += &format!(
        "{:.3}, 90th percentile {:.3}; with the true effect fitted {:.3}; with a dictionary without names {:.3}.</p>\n",
        summary.over_floor_median,
        summary.over_floor_p90,
        summary.oracle_over_floor_median,
        summary.generic_over_floor_median
    );
    html
}

fn baselines(summary: &Summary) -> String {
    let mut html = "<h2>Baselines on the same data</h2>\n<table><tr><th>rule</th><th>false alarms</th><th>first name right</th><th>pairs exact</th></tr>\n".to_owned();
    let lab = [all(summary), summary.top_1, summary.pairs_exact];
    let named = summary.baselines.iter().map(|(name, rates)| (name.as_str(), rates));
    for (name, rates) in core::iter::once(("the lab", &lab)).chain(named) {
        let [alarms, first, pairs] = rates.map(|rate| percent(rate.rate));
        html += &row(&[&name, &alarms, &first, &pairs]);
    }
    html + "</table>\n"
}

fn confusion(summary: &Summary) -> String {
    let names: BTreeSet<&String> = summary.confusion.values().flat_map(|row| row.keys()).collect();
    let mut html = "<h2>What was taken for what</h2>\n<p>Rows: what was hidden. Columns: the first effect that was claimed, or the verdict where none was.</p>\n<table class=\"turned\"><tr><th>hidden</th>".to_owned();
    names.iter().for_each(|name| html += &format!("<th>{}</th>", escape(name)));
    html += "</tr>\n";
    for (kind, counts) in &summary.confusion {
        let total: usize = counts.values().sum();
        html += &format!("<tr><td>{}</td>", escape(kind));
        for name in &names {
            let n = counts.get(*name).copied().unwrap_or(0);
            let shade = 255 - 150 * n / total.max(1);
            let cell = if n == 0 { String::new() } else { n.to_string() };
            html += &format!("<td style=\"background:rgb({shade},{shade},255)\">{cell}</td>");
        }
        html += "</tr>\n";
    }
    html + "</table>\n"
}

/// Every single or pair of at least three noise lengths that was not named, and every claim where none was due.
fn failures(outcomes: &[Outcome]) -> String {
    let mut html = "<h2>Failures</h2>\n<p>Every cell whose answer is wrong.</p>\n<table><tr><th>hidden</th><th>noise lengths</th><th>motion</th><th>noise</th><th>verdict</th><th>named</th><th>seed</th></tr>\n".to_owned();
    for outcome in outcomes {
        let (Some(truth), Some(said)) = (&outcome.truth, &outcome.said) else { continue };
        let is_wrong = match outcome.group.as_str() {
            "single" => !outcome.is_claimed() || !outcome.is_top_1(),
            "pair" | "several" => !outcome.is_exact(),
            "beside" => said.verdict != "partly" || outcome.asserts_wrongly(),
            "poor" => outcome.is_claimed() && !outcome.is_in_class(),
            "none" => said.verdict != "none",
            _ => said.verdict != "unknown",
        };
        if is_wrong {
            let size = truth.effect_rms / truth.noise_length;
            let cells: [&dyn Display; 7] = [
                &escape(&truth.kind),
                &format!("{size:.2}"),
                &truth.motion,
                &truth.noise,
                &said.verdict,
                &escape(&said.named.join(", ")),
                &truth.seed,
            ];
            html += &row(&cells);
        }
    }
    html + "</table>\n"
}

fn all(summary: &Summary) -> Rate {
    summary.false_alarms.get("all").copied().unwrap_or_else(|| Rate::new(0, 0))
}

fn row(cells: &[&dyn Display]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| format!("<td>{cell}</td>")).collect();
    format!("<tr>{}</tr>\n", cells.concat())
}

fn percent(rate: f64) -> String {
    format!("{:.1} %", 100.0 * rate)
}

fn interval(rate: Rate) -> String {
    format!("{:.1} to {:.1} %", 100.0 * rate.low, 100.0 * rate.high)
}
