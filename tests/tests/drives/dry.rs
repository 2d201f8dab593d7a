//! Dry runs: a chain reads servos and says what it would send, and commands that are there to move something are refused.

use super::*;

#[test]
fn a_dry_run_moves_nothing_and_says_what_it_would_send() {
    let make = ServoMake::Sts3215;
    let (instance, folder, emulator) = (instance_name("dry"), TempFolder::new("dry"), emulator(make));
    let config = configuration(make, &folder, &emulator, "mode = \"dry\"");
    let recording = folder.file("run.mcap");
    let arguments = ["run", "--engage", "--instance", &instance, "--config", &config, "--recording", &recording];
    let ended = Ended::of(&[&arguments[..], &["--seconds", "4", "--json"]].concat(), PATIENCE);
    let peak = &ended.json()["passes"][0]["peak_bend_deg"];
    assert!(peak["reached"].is_null() && peak["commanded"].is_number(), "nothing measured the bend: {peak}");
    assert!(ended.stderr.contains("dry run: the actuators would be told to go there"), "{}", ended.stderr);
    let wire = emulator.wire();
    assert!(wire.n_requests > 50 && wire.servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()));
}

#[test]
fn who_wants_to_move_an_actuator_in_a_dry_run_is_refused_before_the_bus_is_opened() {
    let make = ServoMake::Sts3215;
    let (instance, folder, emulator) = (instance_name("dry-jog"), TempFolder::new("dry-jog"), emulator(make));
    let config = configuration(make, &folder, &emulator, "mode = \"dry\"");
    let (csv, model) = (folder.file("play.csv"), folder.file("robot.toml"));
    let play = ["calibrate", "play", "--csv", &csv, "--model", &model, "--drives", "--dial-sd-um", "15"];
    for (arguments, typed, what) in [
        (&["drives", "--jog", "1"][..], "\n", "single steps"),
        (&["drives", "--calibrate"], "", "a calibration"),
        (&play, "yes\n", "measuring its play"),
    ] {
        let words = [arguments, &["--config", &config, "--instance", &instance]].concat();
        let ended = Ended::fed(&words, typed, PATIENCE);
        let expected = format!("[slave.drive] mode = \"dry\": nothing would move; set it to \"live\" for {what}");
        assert!(ended.code == Some(2) && ended.sentence().contains(&expected), "{words:?}: {}", ended.stderr);
        assert!(!ended.stdout.contains("under power"), "{}", ended.stdout);
    }
    assert_eq!(emulator.wire().n_requests, 0, "the servos were not even asked");
}
