//! Pages of the lab: whole, alone, the same bytes each time, and safe against names from outside.

use krait_lab::compare::compare;
use krait_lab::diagnose::{DiagnoseOptions, FoundEffect, diagnose};
use krait_lab::machine::{JointsLab, MachineUnderTest, SnakeLab};
use krait_lab::read::{ColumnMap, read};
use krait_lab::report::{PageOrigin, added_page, comparison_page, diagnosis_page, history_page, residual_curves};
use krait_lab::{AddOptions, Measurements, Term, add};
use krait_lab_benchmark::generate::{Kind, Recipe, generate};
use krait_model::model_file::ModelFile;

const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror=\"alert('2')\">&.csv";

fn snake() -> SnakeLab {
    let file = ModelFile::parse("format = 1\n[machine]\nkind = \"snake\"\n").expect("a model");
    SnakeLab::new(&file).expect("a snake")
}

/// A minute of a snake with hidden backlash, under a name that wants to be markup.
fn data() -> Measurements {
    let hidden = vec![(Kind::from_name("backlash").expect("a kind"), 3.0)];
    let recipe = Recipe { hidden, seconds: 60.0, seed: 7, ..Recipe::default() };
    let mut data = generate(&recipe).expect("data").measurements;
    data.source = HOSTILE.to_owned();
    data.sha256 = "00ff".repeat(16);
    data
}

fn origin() -> PageOrigin<'static> {
    PageOrigin { command: "krait lab diagnose --data '</script><b>'", version: "1.2.3" }
}

/// The page without the embedded script, which is not ours and contains any string.
fn own(page: &str) -> String {
    let start = page.find("<script").expect("the embedded script");
    let end = start + page[start..].find("</script>").expect("its end") + "</script>".len();
    assert!(end - start > 1_000_000, "the script that draws is on the page");
    format!("{}{}", &page[..start], &page[end..])
}

/// Every element that is opened is closed, in order.
fn assert_well_formed(markup: &str) {
    let mut open: Vec<String> = Vec::new();
    let mut rest = markup;
    while let Some(at) = rest.find('<') {
        let end = at + rest[at..].find('>').expect("a tag ends");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        let name: String = tag.trim_start_matches('/').chars().take_while(|c| c.is_ascii_alphanumeric()).collect();
        assert!(!name.is_empty() || tag.starts_with('!'), "a tag has a name: {tag}");
        assert!(!tag.contains("src=") && !tag.contains("href="), "the page fetches nothing: {tag}");
        if tag.starts_with('/') {
            assert_eq!(open.pop().as_deref(), Some(name.as_str()), "closed in order: {tag}");
        } else if !tag.starts_with('!') && name != "meta" {
            open.push(name.clone());
        }
        if name == "script" && !tag.starts_with('/') {
            rest = &rest[rest.find("</script>").expect("a script ends")..];
        }
    }
    assert!(open.is_empty(), "all closed: {open:?}");
}

fn assert_alone_and_safe(page: &str) {
    let own = own(page);
    assert_well_formed(&own);
    for outside in ["http:", "https:", "@import", "url("] {
        assert!(!own.contains(outside), "the page fetches nothing: {outside}");
    }
    assert!(!own.contains("<img") && !own.contains("</script><b>"), "names from outside are text");
    assert!(own.contains("&lt;img src=x"), "and still to be read");
    assert!(page.len() < 8_000_000, "{} bytes", page.len());
}

/// These words, each behind the one before.
fn assert_in_order(page: &str, words: &[&str]) {
    let page = own(page);
    let mut at = 0;
    for word in words {
        at += page[at..].find(word).unwrap_or_else(|| panic!("{word} is not on the page, or before {words:?}"));
    }
}

/// The markup of the picture of this title.
fn figure<'a>(page: &'a str, title: &str) -> &'a str {
    let start = page.find(&format!("<b>{title}")).unwrap_or_else(|| panic!("no picture {title}"));
    &page[start..start + page[start..].find("</figure>").expect("its end")]
}

/// The error bars of a picture.
fn lengths(figure: &str) -> Vec<f64> {
    let bars = figure.split("\"error_y\"").skip(1).filter_map(|own| own.split_once("\"array\":[")?.1.split_once(']'));
    bars.flat_map(|(array, _)| array.split(',')).filter_map(|x| x.parse().ok()).collect()
}

#[test]
fn a_page_of_a_diagnosis_is_whole_alone_safe_and_the_same_each_time() {
    let (machine, data) = (snake(), data());
    let page = || {
        let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("a diagnosis");
        diagnosis_page(&machine, &data, &found, origin()).expect("a page")
    };
    let first = page();
    assert_alone_and_safe(&first);
    for section in [
        "Next experiment",
        "Error after each effect",
        "Missing effects",
        "What cannot be told apart",
        "Residual over time",
        "Worst seconds",
        "Residual loops",
        "To check on the machine",
        "Map.",
        "Speed.",
        "Direction split",
        "Travel since the last reversal",
        "Time at rest",
        "Autocorrelation.",
        "All candidates",
        "What is left",
        "SHA-256",
        "1.2.3",
        "seed",
        "noise floor",
    ] {
        assert!(first.contains(section), "{section}");
    }
    assert_in_order(
        &first,
        &[
            "class=\"verdict\"",
            "Residual over time.",
            "Worst seconds.",
            "Residual loops.",
            "Waterfall.",
            "Missing effects",
            "Next experiment",
            "Direction split.",
            "All candidates",
        ],
    );
    assert!(!own(&first).contains(", measured"), "no curve of the measurement lies on one of the model");
    for picture in ["Residual over time.", "Residual loops."] {
        assert_eq!(
            figure(&first, picture).matches("\"type\":\"line\"").count(),
            2,
            "the floor, above and below: {picture}"
        );
    }
    for picture in ["Waterfall.", "Speed."] {
        assert_eq!(figure(&first, picture).matches("\"type\":\"line\"").count(), 1, "the floor is a line: {picture}");
    }
    for picture in ["Waterfall.", "Speed.", "Direction split.", "Travel since the last reversal.", "Time at rest."] {
        assert!(!lengths(figure(&first, picture)).is_empty(), "error bars: {picture}");
    }
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool").install(page);
    assert!(first == one_thread, "the same bytes again, and with one thread");
}

#[test]
fn a_page_of_a_comparison_shows_the_error_and_where_it_is() {
    let (machine, data) = (snake(), data());
    let found = compare(&machine, &data).expect("a comparison");
    let page = comparison_page(&machine, &data, &found, origin()).expect("a page");
    assert!(page.contains(&format!("{:.4}", found.error.rms)), "the figure of the terminal");
    assert!(page.contains("Where, in numbers"));

    assert_in_order(&page, &["class=\"verdict\"", "Residual over time.", "Residual loops.", "In numbers", "Map."]);

    let curves = residual_curves(&machine, &data).expect("curves");
    let [along, across] = &curves.axes[..] else { panic!("two axes: {curves:?}") };
    let squares = along.residual.iter().zip(&across.residual).map(|(a, b)| a * a + b * b).filter(|s| s.is_finite());
    let squares: Vec<f64> = squares.collect();
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!((rms / found.error.rms - 1.0).abs() < 0.1, "{rms}, {} in all rows", found.error.rms);
    assert!(curves.time_s.len() <= 1500 && along.direction.len() == curves.time_s.len(), "thinned, and of one length");
}

#[test]
fn a_long_record_is_thinned() {
    let (machine, mut data) = (snake(), data());
    let found = compare(&machine, &data).expect("a comparison");
    let short = comparison_page(&machine, &data, &found, origin()).expect("a page").len();
    let rows: Vec<usize> = (0..data.n_rows()).cycle().take(20 * data.n_rows()).collect();
    data = data.select(&rows);
    data.time_s = (0..rows.len()).map(|k| k as f64 * 0.02).collect();
    let long = comparison_page(&machine, &data, &found, origin()).expect("a page").len();
    assert!(long < short + 1_000_000, "{short} bytes became {long}");
}

#[test]
fn a_page_of_a_history_takes_no_markup_from_the_file() {
    let entry = "[[history]]\neffect = \"</script><b>x\"\ndata = \"<img src=x>\"\ndata_sha256 = \"00\"\n\
                 heldout_rms_deg = { before = 2.0, after = 0.5, noise_floor = 0.4 }\n";
    let file = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"snake\"\n{entry}")).expect("a model");
    let page = history_page(&file, HOSTILE, origin());
    assert_alone_and_safe(&page);
    // (2^2 - 0.5^2) / (2^2 - 0.4^2)
    assert!(page.contains("98 % explained"), "the waterfall says how much of what there was");
}

#[test]
fn a_page_of_an_added_effect_shows_it_before_and_after() {
    let (machine, data) = (snake(), data());
    let mut term = Term::new("backlash", Vec::new());
    term.values = machine.parameters(&term).expect("known").iter().map(|own| own.default).collect();
    let added = add(
        &machine,
        &data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )
    .expect("added");
    let page = added_page(&machine, &data, &added, "backlash", origin()).expect("a page");
    assert_alone_and_safe(&page);
    assert!(page.contains("half_width_m"));
    assert_in_order(&page, &["class=\"verdict\"", "Residual over time.", "Error before and after", "half_width_m"]);
}

/// Two joints, the first with play, in radians.
fn joints(what: &str) -> (JointsLab, Measurements) {
    let file = ModelFile::parse("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n").expect("a model");
    let mut text = String::from("time_s,u1_rad,u2_rad,y1_rad,y2_rad\n");
    let mut held = 0.0_f64;
    for k in 0..3000_u32 {
        let t = f64::from(k) * 0.02;
        let (a, b) = (0.6 * (0.7 * t).sin() + 0.25 * (1.9 * t).sin(), 0.5 * (0.5 * t + 1.0).sin());
        held = held.clamp(a - 0.03, a + 0.03);
        // Far from smooth, and the same each time.
        let noise = |k: f64| 0.004 * ((k * 12.9898).sin() * 43_758.547).fract();
        let (first, second) = (held + noise(f64::from(k)), b + noise(f64::from(k) + 0.5));
        text += &format!("{t:.2},{a:.6},{b:.6},{first:.6},{second:.6}\n");
    }
    let path = std::env::temp_dir().join(format!("krait-lab-report-{}-{what}.csv", std::process::id()));
    std::fs::write(&path, text).expect("a file");
    let data = read(&path, &ColumnMap::default(), file.machine().into()).expect("measurements");
    std::fs::remove_file(&path).expect("the file goes");
    (JointsLab::new(&file).expect("joints"), data)
}

#[test]
fn pages_of_joints_show_each_output_and_no_bend() {
    let (machine, data) = joints("pages");
    let found = diagnose(&machine, &data, &DiagnoseOptions::default()).expect("a diagnosis");
    let compared = compare(&machine, &data).expect("a comparison");
    let mut term = Term::new("backlash", Vec::new());
    term.values = machine.parameters(&term).expect("known").iter().map(|own| own.default).collect();
    let added = add(
        &machine,
        &data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )
    .expect("added");
    let diagnosed = diagnosis_page(&machine, &data, &found, origin()).expect("a page");
    let title = found.effects.first().and_then(FoundEffect::title).expect("a title");
    assert!(title.starts_with("play: ") && title.ends_with(" in all"), "{title}");
    let verdict = format!("The model lacks &quot;{title}&quot; at joint 1");
    assert!(diagnosed.contains(&verdict), "what it is called, how large, and where: {:?}", found.sentence);
    assert!(diagnosed.contains(&format!(": {title}</h3>")), "above its words too");
    assert_eq!(lengths(figure(&diagnosed, "Waterfall.")).len(), 2, "before and after, of joints too");
    for page in [
        diagnosed,
        comparison_page(&machine, &data, &compared, origin()).expect("a page"),
        added_page(&machine, &data, &added, "backlash", origin()).expect("a page"),
    ] {
        let own = own(&page);
        assert_well_formed(&own);
        for words in ["y1, model", "y2, model", "predicted position", "rising", "each joint", "Autocorrelation."] {
            assert!(own.contains(words), "{words}");
        }
        assert!(!own.contains("bend x") && !own.contains("plane delta"), "what only a snake has");
        assert!(own.contains("\"dash\""), "the second output's curves differ from the first one's");
    }
}

#[test]
fn the_bars_of_an_added_effect_have_whiskers() {
    let (machine, data) = joints("whiskers");
    let mut term = Term::new("backlash", Vec::new());
    term.values = machine.parameters(&term).expect("known").iter().map(|own| own.default).collect();
    let added = add(
        &machine,
        &data,
        &AddOptions { term, from_given: false, free: Vec::new(), refit: Vec::new(), recordings: Vec::new() },
    )
    .expect("added");
    let page = added_page(&machine, &data, &added, "backlash", origin()).expect("a page");
    let lengths = lengths(figure(&page, "Waterfall."));
    assert!(lengths.len() == 2 && lengths.iter().all(|half| *half > 0.0 && *half < 0.5 * added.before), "{lengths:?}");
}
