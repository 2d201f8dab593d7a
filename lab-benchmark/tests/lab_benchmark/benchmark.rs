//! A benchmark that is ended goes on where it was, and what it says is counted from what it wrote.

use krait_lab_benchmark::benchmark::{GridCell, Group, Options, Outcome, Summary, grid, page, run};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};

const SECONDS: f64 = 30.0;

fn options() -> Options {
    Options { seed: 3, seconds: SECONDS, with_baselines: true }
}

/// One cell of each of these groups.
fn cells() -> Vec<GridCell> {
    let all = grid(3, 1, SECONDS);
    [Group::None, Group::Single, Group::Outside]
        .map(|group| all.iter().find(|cell| cell.group == group).unwrap().clone())
        .to_vec()
}

fn results(name: &str) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("krait-benchmark-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    dir.join("results.jsonl")
}

#[test]
#[ignore = "long at work; .ci/run runs it"]
fn a_benchmark_that_was_ended_goes_on_without_the_line_that_was_cut_short() {
    let (file, cells) = (results("resume"), cells());
    let whole = run(&options(), &cells, &file, |_, _, _| {}).unwrap();
    assert_eq!(whole.len(), 3);
    assert!(whole.iter().all(|outcome| outcome.refused.is_none()), "{whole:?}");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, &text[..text.len() - 40]).unwrap();
    let n_worked = AtomicUsize::new(0);
    let again = run(&options(), &cells, &file, |_, n_cells, _| {
        assert_eq!(n_cells, 3);
        n_worked.fetch_add(1, Ordering::Relaxed);
    })
    .unwrap();
    assert_eq!(n_worked.into_inner(), 1, "only the cell whose line was cut short is worked out again");
    let results: Vec<_> = [&whole, &again].map(|outcomes| outcomes.iter().map(short).collect::<Vec<_>>()).into();
    assert_eq!(results[0], results[1]);
    let kept = std::fs::read_to_string(&file).unwrap();
    assert_eq!(kept.lines().take(3).collect::<Vec<_>>(), text.lines().take(3).collect::<Vec<_>>());
    assert_eq!(kept.lines().count(), 4);
    let sentence = run(&Options { seed: 4, ..options() }, &cells, &file, |_, _, _| {}).unwrap_err().to_string();
    assert!(sentence.contains("another grid"), "{sentence}");
    assert_eq!(std::fs::read_to_string(&file).unwrap().lines().count(), 4, "nothing is lost");
    the_figures_are_those_of_the_lines(&whole);
    std::fs::remove_dir_all(file.parent().unwrap()).unwrap();
}

/// What does not depend on the last digit of a number that was written and read back.
fn short(outcome: &Outcome) -> (String, String, Vec<String>, String) {
    let said = outcome.said.as_ref().unwrap();
    (outcome.id.clone(), said.verdict.clone(), said.named.clone(), format!("{:.9}", said.final_error))
}

fn the_figures_are_those_of_the_lines(outcomes: &[Outcome]) {
    let summary = Summary::new(outcomes);
    assert_eq!((summary.n_cells, summary.top_1.of, summary.outside_claimed.of), (3, 1, 1));
    assert_eq!(summary.top_1.n, usize::from(outcomes.iter().any(|o| o.group == "single" && o.is_top_1())));
    assert_eq!(summary.baselines.len(), 3);
    let baselines = outcomes.iter().find(|o| o.group == "single").unwrap().baselines.as_ref().unwrap();
    let noise = outcomes[1].truth.as_ref().unwrap().noise_rms;
    assert!((baselines.oracle_deg.unwrap() / noise - 1.0).abs() < 0.1, "the true effect leaves the noise");
    assert!(baselines.generic_deg < outcomes[1].truth.as_ref().unwrap().base_rms);
    let html = page(&summary, outcomes, "three < four");
    let script = html.find("<script").unwrap()..html.find("</script>").unwrap();
    let own = format!("{}{}", &html[..script.start], &html[script.end..]);
    assert!(own.contains("three &lt; four") && !own.contains("http"), "a page of its own");
    for picture in ["By size", "By motion", "Rules"] {
        assert!(own.contains(&format!("<b>{picture}.</b>")), "{picture}");
    }
    assert!(own.matches("Plotly.newPlot").count() == 3 && html.len() < 6_000_000, "{} bytes", html.len());
    for outcome in outcomes {
        assert!(html.contains(outcome.truth.as_ref().unwrap().kind.as_str()));
    }
}
