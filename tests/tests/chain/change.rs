//! A machine that changes while it runs: the estimator says so, in the report and in the recording, and adds nothing.

use core::time::Duration;
use krait_record::Recording;
use krait_schema::Sample;
use krait_tests::{Ended, TempFolder, instance_name};
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(240);
/// When the play appears, s after the first command.
const APPEARS_S: f64 = 11.0;

/// A snake that is just what the model says, until its lines have play.
const TRUTH: &str = "[effects]\nplay_m = 0.0\nload_scale = 1.0\nmu = 0.0\nf_s_n = 0.0\n\
                     [slow]\nchange_play_m = 4e-4\nchange_time_s = 11.0\n";
const MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\n";
const CONFIG: &str = "[estimate]\nlearn_s = 5.0\n";

#[test]
fn a_play_that_appears_while_the_chain_runs_is_seen_told_and_recorded() {
    let folder = TempFolder::new("change");
    let file = |name: &str, text: &str| {
        std::fs::write(folder.path().join(name), text).expect("a file");
        folder.file(name)
    };
    let (truth, model) = (file("truth.toml", TRUTH), file("model.toml", MODEL));
    let (config, recording) = (file("krait.toml", CONFIG), folder.file("run.mcap"));
    let ended = Ended::in_time(&recording, || {
        let instance = instance_name("change");
        let mut arguments =
            vec!["run", "--engage=again", "--seconds", "19", "--instance", &instance, "--config", &config];
        arguments.extend(["--truth", &truth, "--model", &model, "--recording", &recording]);
        Ended::of(&arguments, PATIENCE)
    });
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let told = ended.stdout.lines().find_map(|line| line.trim().strip_prefix("Something changed at t = "));
    let told = told.unwrap_or_else(|| panic!("nothing was told:\n{}", ended.stdout));
    let at_s: f64 = told.split_whitespace().next().and_then(|word| word.parse().ok()).expect("a time");
    assert!((APPEARS_S - 1.0..APPEARS_S + 6.0).contains(&at_s), "{told}");
    assert!(ended.stdout.contains("Nothing was added to the model; record 60 s of motion"), "{}", ended.stdout);
    assert_eq!(std::fs::read_to_string(&model).expect("the model file"), MODEL, "the model file is as it was");

    let recorded = Recording::open(Path::new(&recording)).expect("a recording");
    let samples = recorded.samples().expect("samples");
    let updates: Vec<_> = samples
        .filter_map(|sample| match sample.expect("a sample").sample {
            Sample::ModelUpdate(update) => Some(update),
            _ => None,
        })
        .collect();
    let first = updates.iter().find(|update| update.n_changes > 0).expect("the change is recorded");
    assert_eq!((first.changed_ns, first.n_changes), (first.sample_ns, 1));
    let before = updates.iter().filter(|update| update.sequence < first.sequence && update.is_watching == 1).count();
    assert!(before > 100, "it had watched {before} shapes before, and said nothing");
}
