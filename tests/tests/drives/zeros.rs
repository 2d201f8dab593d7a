//! The configuration that `krait drives --zero --out` writes.

use super::*;

/// `--zero --out` writes the configuration with the one zero that is another, comments and all, and nothing of a person's is overwritten.
pub fn written_to_a_file(folder: &TempFolder, config: &str, instance: &str) {
    let text = std::fs::read_to_string(config).expect("written");
    let (kept, commented) = text.split_once("id = 2").expect("a second actuator");
    let text = format!("# mine\n{kept}id = 2 # right{commented}");
    std::fs::write(config, &text).expect("written");
    let out = folder.file("zeroed.toml");
    let arguments = ["drives", "--zero", "--config", config, "--instance", instance, "--out", &out];
    let zero = Ended::of(&arguments, PATIENCE);
    assert_eq!(zero.code, Some(0), "{}", zero.stderr);
    assert!(zero.stdout.contains("with 1 of its zeros changed and nothing else"), "{}", zero.stdout);
    let (first, second) = text.split_once("id = 2 # right").expect("a second actuator");
    let second = second.replacen("zero_count = 2048", "zero_count = 2100", 1);
    let written = std::fs::read_to_string(&out).expect("written");
    assert_eq!(written, format!("{first}id = 2 # right{second}"));
    let again = Ended::of(&arguments, PATIENCE);
    assert!(again.sentence().contains("zeroed.toml is already there"), "{}", again.stderr);
    let settled = Ended::of(&["drives", "--zero", "--config", &out, "--instance", instance], PATIENCE);
    assert!(settled.stdout.contains("All zeros are as configured."), "{}", settled.stdout);
    let alone = Ended::of(&["drives", "--config", config, "--out", &out], PATIENCE);
    assert!(alone.code == Some(2) && alone.stderr.contains("--zero|--calibrate"), "{}", alone.stderr);
}
