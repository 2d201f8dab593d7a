//! `krait calibrate poses --chain`: the real processes lead the simulated snake from pose to pose, and its eta and play come out.

use core::time::Duration;
use krait_ipc::{InstanceName, resources_of};
use krait_model::model_file::ModelFile;
use krait_tests::{Ended, TempFolder, instance_name, processes_of, real_drives, samples_in};
use std::path::Path;

const PATIENCE: Duration = Duration::from_secs(400);
/// Friction is known; eta and the play are to be found.
const MODEL: &str = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"static-friction\"\nf_s_n = 1.959\n\
                     [[effect]]\nkind = \"cone-friction\"\nmu = 0.1727\n";
const ETA: f64 = 1.22;
const HALF_WIDTH_M: f64 = 0.089e-3;

/// Runs it with these words besides, and these typed.
fn calibrate(name: &str, folder: &TempFolder, words: &[&str], typed: &str) -> Ended {
    let instance = instance_name(name);
    let (model, csv) = (folder.file("robot.toml"), folder.file("poses.csv"));
    std::fs::write(&model, MODEL).expect("written");
    let mut all = vec!["calibrate", "poses", "--csv", &csv, "--model", &model, "--chain", "--instance", &instance];
    all.extend(["--speed-deg-per-s", "90", "--settle-s", "0.1", "--measure-s", "0.3"]);
    all.extend(words);
    let ended = Ended::fed(&all, typed, PATIENCE);
    assert_eq!(processes_of(&instance), [], "no process is left");
    let name = InstanceName::new(&instance).expect("a name");
    assert_eq!(resources_of(&name), Vec::<std::path::PathBuf>::new(), "no shared memory is left");
    ended
}

#[test]
fn the_chain_goes_through_the_poses_by_itself_and_eta_and_play_are_the_snakes_own() {
    let folder = TempFolder::new("poses-chain");
    let recording = folder.file("poses.mcap");
    // A mean of a dozen shapes of 0.3 deg, and an encoder of a micrometre.
    let words = ["--engage", "--sd-deg", "0.12", "--recording", &recording];
    let ended = calibrate("poses-chain", &folder, &words, "y\n");
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    let file =
        ModelFile::parse(&std::fs::read_to_string(folder.file("robot.toml")).expect("written")).expect("a model");
    let value = |effect: &str, parameter: &str| {
        let effect = file.effects().iter().find(|e| e.setting().kind().name() == effect).expect("found");
        let se = effect.origin(parameter).expect("with its origin").se.expect("with its error");
        (effect.setting().value(parameter).expect("a value"), se)
    };
    let ((eta, eta_se), (half, half_se)) = (value("stiffness-scale", "eta"), value("backlash", "half_width_m"));
    println!("eta {eta} +- {eta_se}, half-width {half} +- {half_se}");
    assert!((eta - ETA).abs() < 4.0 * eta_se && eta_se < 0.011, "{eta} +- {eta_se}");
    assert!((half - HALF_WIDTH_M).abs() < 4.0 * half_se && half_se < 7e-6, "{half} +- {half_se}");
    let table = std::fs::read_to_string(folder.file("poses.csv")).expect("readings");
    assert!(table.lines().count() >= 1 + 9 + 6, "a plane and the check: {table}");
    // The recording is that of a chain which was led: by its marks, whose numbers rise.
    let marks: Vec<String> = samples_in(&recording)
        .into_iter()
        .filter_map(|sample| match sample {
            krait_schema::Sample::DeviceMarker(mark) => mark.text().map(str::to_owned),
            _ => None,
        })
        .collect();
    assert_eq!(marks.first().map(String::as_str), Some("experiment begins"));
    assert_eq!(marks.last().map(String::as_str), Some("experiment ends"));
    assert!(marks.len() >= 2 + 9 + 6 && marks[1].starts_with("experiment pose 1 at rest"), "{marks:?}");
}

#[test]
fn bends_may_be_typed_while_the_chain_holds_each_pose() {
    let folder = TempFolder::new("poses-typed");
    // The first pose is left out, of the second a bend is typed, then it stops: too little for a value, and the reading is kept.
    let ended = calibrate("poses-typed", &folder, &["--engage", "--typed"], "s\n20.5 0.25\nq\n");
    assert_eq!(ended.code, Some(2), "{}\n{}", ended.stdout, ended.stderr);
    assert!(ended.stderr.contains("not determined"), "{}", ended.stderr);
    let table = std::fs::read_to_string(folder.file("poses.csv")).expect("readings");
    assert_eq!(table.lines().count(), 2, "{table}");
    let row: Vec<&str> = table.lines().nth(1).expect("a row").split(',').collect();
    let bend_rad: f64 = row[4].parse().expect("a number");
    assert!((bend_rad.to_degrees() - 20.5).abs() < 1e-9, "{table}");
    let q1_m: f64 = row[7].parse().expect("a number");
    assert!((0.3e-3..3e-3).contains(&q1_m.abs()), "line 1 has moved: {table}");
}

#[test]
fn nothing_moves_without_consent_nor_where_the_chain_may_not_bend_so_far() {
    let folder = TempFolder::new("poses-asked");
    let ended = calibrate("poses-asked", &folder, &[], "no\n");
    assert_eq!(ended.code, Some(2));
    assert!(ended.sentence().contains("nothing was moved"), "{}", ended.stderr);
    let drives = real_drives(&folder);
    let ended = calibrate("poses-real", &folder, &["--engage", "--config", &drives], "");
    assert_eq!(ended.code, Some(2));
    // Real drives are asked about although --engage is there.
    let sentence = ended.sentence();
    assert!(sentence.contains("nothing was moved") || sentence.contains("the chain's limit"), "{sentence}");
    let narrow = folder.file("narrow.toml");
    std::fs::write(&narrow, "[resolve]\nmax_bend_rad = 1.0\n").expect("written");
    // The plan keeps within the limit and says its price; one that was asked for is refused.
    let ended = calibrate("poses-narrow", &folder, &["--config", &narrow], "no\n");
    assert!(ended.sentence().contains("nothing was moved"), "{}", ended.stderr);
    for words in ["limits allow bends up to 53 deg", "max_bend_rad", "53.3 deg", "of up to 53 deg"] {
        assert!(ended.stdout.contains(words), "{words}: {}", ended.stdout);
    }
    assert!(ended.stdout.contains("times the standard errors of the full plan"), "{}", ended.stdout);
    let ended = calibrate("poses-narrow", &folder, &["--engage", "--config", &narrow, "--largest-deg", "60"], "");
    assert!(ended.sentence().contains("give 53 or less"), "{}", ended.stderr);
    // Lines that may carry little bend little, whatever the bends may be.
    let weak = folder.file("weak.toml");
    std::fs::write(&weak, "[slave.limits]\npull_n = 30.0\npush_n = 30.0\n").expect("written");
    let ended = calibrate("poses-weak", &folder, &["--config", &weak], "no\n");
    assert!(
        ended.stdout.contains("a line may carry 30 N") && ended.sentence().contains("nothing was moved"),
        "{}",
        ended.stdout
    );
    assert!(!Path::new(&folder.file("poses.csv")).exists(), "nothing was read");
}
