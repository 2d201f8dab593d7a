//! A formula of one's own takes part in a diagnosis, and the command that is printed adds it to the model.

use krait_model::model_file::ModelFile;
use serde_json::Value;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};

const KRAIT: &str = env!("CARGO_BIN_EXE_krait");
const MODEL: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n";
const BUMP: &str = "[[effect]]\nkind = \"formula\"\nname = \"bump\"\nhook = \"joint\"\n\
                    formula = \"a * exp(0 - ((u_i - c) / w)^2)\"\nparams = { a = 0.01, c = 0.1, w = 0.2 }\n";

/// The words as a shell takes them.
fn krait(words: &str) -> Output {
    Command::new("sh").args(["-c", &format!("'{KRAIT}' {words}")]).output().unwrap()
}

fn json(words: &str) -> Value {
    let output = krait(words);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{words}: {output:?}"))
}

/// A minute of a joint with a bump at 0.2 rad that no effect of the library makes, and noise that repeats each time.
fn data() -> String {
    let mut text = String::from("time_s,u1_rad,y1_rad\n");
    let mut state = 7_u64;
    for k in 0..3000_u32 {
        let t = f64::from(k) * 0.02;
        let u = 0.5 * (0.45 * t + 1.0).sin() + 0.3 * (1.3 * t).sin();
        let noise = (0..12).fold(-6.0, |sum, _| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum + (state >> 11) as f64 / (1_u64 << 53) as f64
        });
        let y = 1.03 * u + 0.01 + 0.03 * (-((u - 0.2) / 0.1_f64).powi(2)).exp() + 0.002 * noise;
        writeln!(text, "{t:.2},{u:.7},{y:.7}").unwrap();
    }
    text
}

#[test]
fn a_formula_that_is_offered_is_found_and_the_printed_command_adds_it() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("effects-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = |name: &str, text: &str| {
        fs::write(folder.join(name), text).unwrap();
        folder.join(name).display().to_string()
    };
    let (data, model) = (path("data.csv", &data()), path("base.toml", MODEL));
    let own_text = format!("{MODEL}{BUMP}");
    let own = path("own.toml", &own_text);
    let files = format!("--model {model} --data {data}");

    let found = json(&format!("lab diagnose {files} --effects {own} --json"));
    assert_eq!((&found["verdict"], &found["effects"][0]["effect"]), (&"missing".into(), &"bump".into()), "{found}");
    assert!(found["effects"][0]["explanation"].is_null(), "{found}");

    let said = String::from_utf8(krait(&format!("lab diagnose {files} --effects {own}")).stdout).unwrap();
    let next = said.lines().find_map(|line| line.strip_prefix("Next: krait ")).unwrap_or_else(|| panic!("{said}"));
    assert!(next.starts_with("lab add formula --name bump --hook joint"), "{next}");
    let added = krait(next);
    assert!(added.status.success(), "{next}: {}", String::from_utf8_lossy(&added.stderr));
    let better = next.rsplit(' ').next().unwrap();
    let left = json(&format!("lab diagnose --model {better} --data {data} --json"));
    assert_eq!(left["verdict"], "none", "{left}");

    // The same by its name in the file, and the library's effect where the file has none of that name.
    let short = folder.join("short.toml").display().to_string();
    let added = json(&format!("lab add bump --effects {own} {files} --set a=0.02 --json --out {short}"));
    let (by_name, by_text) = (&added["params"]["a"]["value"], &found["effects"][0]["params"]["a"]["value"]);
    let differ = by_name.as_f64().unwrap() / by_text.as_f64().unwrap() - 1.0;
    assert!(differ.abs() < 0.05, "{added} beside {found}");
    let text = fs::read_to_string(&short).unwrap();
    assert!(text.contains("kind = \"formula\"") && text.contains("name = \"bump\""), "{text}");
    // The fit began elsewhere, and what was found is what the file has; so it is of a fit of that file.
    let written = |file: &str, name: &str| {
        let model = ModelFile::parse(&fs::read_to_string(file).unwrap()).unwrap();
        model.effects()[0].setting().value(name).unwrap()
    };
    for (name, begun) in [("a", 0.02), ("c", 0.1), ("w", 0.2)] {
        let (found, in_file) = (added["params"][name]["value"].as_f64().unwrap(), written(&short, name));
        assert!((found - begun).abs() > 1e-3 && found == in_file, "{name}: {found} found, {in_file} in {text}");
    }
    let off = folder.join("off.toml").display().to_string();
    fs::write(&off, own_text.replace("a = 0.01", "a = 0.02")).unwrap();
    let refitted = folder.join("refitted.toml").display().to_string();
    let words = "--free bump.a --free bump.c --free bump.w --json";
    let fit = json(&format!("lab fit {words} --model {off} --data {data} --out {refitted}"));
    let found = fit["params"]["a"]["value"].as_f64().unwrap();
    assert!((found / by_text.as_f64().unwrap()).abs() > 0.9 && found == written(&refitted, "a"), "{fit}");
    let cubic =
        json(&format!("lab add cubic --effects {own} {files} --json --out {}", folder.join("cubic.toml").display()));
    assert_eq!(cubic["effect"], "cubic", "{cubic}");
    for (more, words) in [
        ("--set b=1", "the formula bump of"),
        ("--set joint=2", "one of 1 to 1, found 2"),
        ("--hook joint", "leave them out"),
    ] {
        let refused =
            krait(&format!("lab add bump --effects {own} {files} {more} --out {}", folder.join("no.toml").display()));
        let why = String::from_utf8(refused.stderr).unwrap();
        assert!(!refused.status.success() && why.contains(words) && why.lines().count() == 1, "{more}: {why}");
    }
    assert!(!folder.join("no.toml").exists());

    let refused = krait(&format!("lab diagnose {files} --effects {model}"));
    let why = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success() && why.contains("no effect of kind formula"), "{why}");
    fs::remove_dir_all(folder).unwrap();
}
