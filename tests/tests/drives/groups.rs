//! Groups of antagonists that the machine of the model does not have.

use super::*;

/// The group of lines that hold each other is read before the bus is opened.
#[test]
fn lines_of_a_group_that_cannot_hold_each_other_are_refused_before_anything_is_opened() {
    let (instance, folder) = (instance_name("groups"), TempFolder::new("groups"));
    let make = ServoMake::Sts3215;
    let emulator = emulator(make);
    let config = configuration_of(make, &folder, &emulator, 3, ["", "", "group = 2\n"]);
    let out = folder.file("out.toml");
    for words in [&["run", "--engage"][..], &["drives", "--calibrate", "--out", &out]] {
        let ended = Ended::of(&[words, &["--config", &config, "--instance", &instance]].concat(), PATIENCE);
        let sentence = ended.sentence();
        assert!(
            sentence.contains("[slave.drive] group = 1: actuators 1, 2 cannot hold each other"),
            "{}",
            ended.stderr
        );
        assert_eq!((ended.code, Path::new(&out).exists()), (Some(2), false));
    }
    let wire = emulator.wire().clone();
    assert!(wire.servos.iter().all(|servo| servo.n_goals == 0 && !servo.is_powered()), "{:?}", wire.servos);
}
