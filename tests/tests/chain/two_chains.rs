//! Two chains on one machine do not disturb each other; a second chain under the same name is refused.

use core::time::Duration;
use krait_tests::{Ended, Krait, TempFolder, instance_name, processes_of, wait_for_motion};
use rustix::process::Signal;

const PATIENCE: Duration = Duration::from_secs(240);

#[test]
fn two_instances_run_side_by_side() {
    let folder = TempFolder::new("two");
    let runs: Vec<Krait> = ["left", "right"]
        .map(|side| {
            let recording = folder.file(&format!("{side}.mcap"));
            let instance = instance_name(side);
            Krait::start(&[
                "run",
                "--engage=again",
                "--instance",
                &instance,
                "--recording",
                &recording,
                "--seconds",
                "5",
                "--json",
            ])
        })
        .into();
    for run in runs {
        let ended = run.end(PATIENCE);
        let figures = ended.json();
        assert_eq!(ended.code, Some(0), "{}", ended.stderr);
        assert!(figures["samples"]["received"].as_u64().is_some_and(|n| n > 3000), "{figures}");
        assert_eq!(figures["samples"]["lost"], 0, "{figures}");
    }
}

#[test]
fn a_second_chain_under_the_same_name_is_refused_and_the_first_goes_on() {
    let (instance, folder) = (instance_name("same"), TempFolder::new("same"));
    let recording = folder.file("first.mcap");
    let first = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    wait_for_motion(&instance, &recording);
    let second = Ended::of(
        &["run", "--engage=again", "--instance", &instance, "--recording", &folder.file("second.mcap")],
        PATIENCE,
    );
    assert_eq!(second.code, Some(2));
    let sentence = second.sentence();
    assert!(
        sentence.contains(&instance) && sentence.contains("already") && sentence.contains("--instance"),
        "{sentence}"
    );
    assert_eq!(processes_of(&instance).len(), 7, "the first goes on");
    first.signal(Signal::INT);
    assert_eq!(first.end(PATIENCE).code, Some(0));
}
