//! `krait paper`: its figures come out, its pictures and page can be read by any browser, and it fails when the claim does.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An empty folder of this test's own.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("paper-{name}-{}", std::process::id()));
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    folder
}

fn krait_paper(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_krait")).arg("paper").args(arguments).output().unwrap()
}

fn json(out: &Path) -> Value {
    let ended = krait_paper(&["--json", "--out", out.to_str().unwrap()]);
    assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
    serde_json::from_slice(&ended.stdout).unwrap()
}

fn close(value: &Value, expected: f64, tolerance: f64) {
    let found = value.as_f64().unwrap_or(f64::NAN);
    assert!((found - expected).abs() <= tolerance, "expected {expected}, found {found}");
}

/// The number whose name contains all of these words, of the error at a place that contains `place`.
fn number<'a>(paper: &'a Value, place: &str, words: &[&str]) -> &'a Value {
    let contains = |value: &Value, word: &str| value.as_str().unwrap().contains(word);
    let errors = paper["errors"].as_array().unwrap();
    let numbers = errors.iter().filter(|e| contains(&e["place"], place)).flat_map(|e| e["numbers"].as_array().unwrap());
    let mut named = numbers.filter(|n| words.iter().all(|word| contains(&n["what"], word)));
    &named.next().unwrap_or_else(|| panic!("no number {words:?} at {place}"))["value"]
}

fn is_well_formed(text: &str) -> bool {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
    roxmltree::Document::parse_with_options(text, options).is_ok()
}

#[test]
fn tables_and_the_claim_come_out() {
    let out = folder("tables");
    let paper = json(&out);
    close(&paper["table_2"]["mu"], 0.1727, 1e-4);
    close(&paper["table_2"]["f_s_n"], 1.921, 5e-4);
    close(&paper["table_2"]["f_s_n_with_g_10"], 1.959, 5e-4);
    close(&paper["table_2"]["residual_g"]["rms"], 27.0, 0.5);
    close(&paper["table_2"]["residual_g"]["max"], 45.0, 0.5);

    let rows = paper["table_3"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 10);
    let sd = |k: usize| rows[k]["eta_sd"].as_f64().unwrap();
    assert!((1..10).all(|k| sd(k) < sd(k - 1)), "every pose teaches something");
    close(&paper["table_3"]["eta"], 1.22, 3.0 * sd(9));
    close(&paper["table_3"]["lambda_mm"], 0.089, 3.0 * rows[9]["lambda_sd_mm"].as_f64().unwrap());

    let verdict = &paper["verdict"];
    assert_eq!(verdict["holds"], true);
    let rms = |which: &str| verdict[which]["rms"].as_f64().unwrap();
    assert!(
        rms("estimated_deg") < 1.0 && rms("naive_deg") > 1.0 && rms("off_deg") > 2.0 * rms("naive_deg"),
        "{verdict}"
    );
    assert!(verdict["seeds"]["part_within_goal"].as_f64().unwrap() > 0.9, "{verdict}");
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn each_error_shows_its_number() {
    let out = folder("errors");
    let paper = json(&out);
    close(number(&paper, "Eq. (7)", &["30 deg"]), 4.0, 1e-9);
    close(number(&paper, "Eq. (7)", &["60 deg"]), 0.25, 1e-9);
    close(number(&paper, "Eq. (7)", &["80 deg"]), 0.0156, 1e-4);
    close(number(&paper, "df_s", &["added", "g = 10"]), 0.2053, 5e-5);
    close(number(&paper, "dmu", &["0 g"]), 0.0721, 5e-5);
    close(number(&paper, "dmu", &["1800 g"]), 0.0071, 5e-5);
    close(number(&paper, "Eq. (22), lambda", &["4/3"]), 0.1433, 5e-5);
    close(number(&paper, "Eqs. (19), (20)", &["largest difference"]), 0.0, 5e-5);
    close(number(&paper, "Eq. (22)", &["0.0019"]), 0.044, 5e-4);
    close(number(&paper, "Eq. (22)", &["0.0005"]), 0.022, 5e-4);
    close(number(&paper, "Table I", &["0.0294"]), 1.684, 1e-3);
    close(number(&paper, "lambda", &["model", "bend"]), 0.0, 1e-9);
    close(number(&paper, "lambda", &["bench"]), 0.0, 1e-3);
    assert!(number(&paper, "lambda", &["preload"]).as_f64().unwrap() > 1.0);
    close(number(&paper, "Eq. (26)", &["delta = 0, J"]), 6.06, 0.01);
    close(number(&paper, "Eq. (26)", &["all three"]), 0.0, 1e-9);
    let [out_there, back] = ["while bending", "way back"].map(|w| number(&paper, "Eq. (13)", &[w]).as_f64().unwrap());
    assert!(back > 1.5 && back > 3.0 * out_there, "{out_there} {back}");
    let [model, bench] = ["model", "bench"].map(|w| {
        let numbers = paper["errors"].as_array().unwrap().iter().find(|e| e["place"] == "Eq. (9)").unwrap();
        let all = numbers["numbers"].as_array().unwrap();
        let idx = all.iter().position(|n| n["what"].as_str().unwrap().contains("0.5 N")).unwrap();
        all[idx + usize::from(w == "bench")]["value"].as_f64().unwrap()
    });
    assert!((model - bench).abs() < 1e-3 && model.abs() < 15.0, "the model's sign is the bench's: {model} {bench}");
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn pictures_and_page_are_well_formed_and_need_nothing_from_elsewhere() {
    let out = folder("pictures");
    let paper = json(&out);
    let figures = paper["figures"].as_array().unwrap();
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(is_well_formed(&page));
    let surfaces = paper["surfaces"].as_array().unwrap();
    for (picture, parts, y_label) in figures
        .iter()
        .map(|f| (f, &f["curves"], &f["y_label"]))
        .chain(surfaces.iter().map(|s| (s, &s["sheets"], &s["axis_labels"][2])))
    {
        let svg = std::fs::read_to_string(out.join(picture["file"].as_str().unwrap())).unwrap();
        assert!(is_well_formed(&svg) && page.contains(&svg), "{}", picture["file"]);
        assert!(svg.contains(picture["title"].as_str().unwrap()) && svg.contains(y_label.as_str().unwrap()));
        assert!(parts.as_array().unwrap().iter().all(|c| svg.contains(c["label"].as_str().unwrap())));
    }
    for name in ["Fig. 8", "Fig. 9", "Fig. 10", "Fig. 11", "Fig. 12"] {
        let mut all = figures.iter().chain(surfaces);
        assert!(all.any(|f| f["title"].as_str().unwrap().starts_with(name)), "{name}");
    }
    let n_files = std::fs::read_dir(&out).unwrap().count();
    assert_eq!(n_files, figures.len() + surfaces.len() + 1, "one file per picture, and the page");
    assert!(!page.contains("src=") && !page.contains("href=") && !page.contains("NaN"), "the page is self-contained");
    assert!(page.contains("raw data are not available"));
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn the_same_command_gives_the_same_bytes() {
    let (one, two) = (folder("one"), folder("two"));
    assert_eq!(json(&one), json(&two));
    let read = |folder: &Path| std::fs::read(folder.join("index.html")).unwrap();
    assert_eq!(read(&one), read(&two));
    for out in [one, two] {
        std::fs::remove_dir_all(out).unwrap();
    }
}

#[test]
fn a_bench_on_which_naive_compensation_is_enough_makes_the_command_fail() {
    let out = folder("ideal");
    std::fs::create_dir_all(&out).unwrap();
    let truth = out.join("ideal.toml");
    std::fs::write(&truth, "[effects]\nplay_m = 0.0\nload_scale = 1.0\n").unwrap();
    let ended = krait_paper(&["--truth", truth.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let text = String::from_utf8(ended.stdout).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{text}");
    assert!(text.lines().last().unwrap().contains("DOES NOT HOLD"), "{text}");
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn a_folder_that_cannot_be_made_is_one_sentence_that_names_it() {
    let out = folder("file");
    std::fs::write(&out, "a file where a folder should be").unwrap();
    let ended = krait_paper(&["--out", out.to_str().unwrap()]);
    let sentence = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{sentence}");
    assert!(sentence.contains(out.to_str().unwrap()) && sentence.lines().count() == 1, "{sentence}");
    assert!(ended.stdout.is_empty());
    std::fs::remove_file(out).unwrap();
}
