//! Formulas of one's own on the lab's page: a model in the folder that has some is offered, and what is found of them is added.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

use core::f64::consts::TAU;
use core::fmt::Write;
use krait_tests::{Browser, Console, Krait, Scrolls, TempFolder, bar_values, bars, choose, instance_name, press};

const MODEL: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 2\n";
const BUMP: &str = "[[effect]]\nkind = \"formula\"\nname = \"bump\"\nhook = \"joint\"\n\
                    formula = \"a * exp(0 - ((u_i - c) / w)^2)\"\nparams = { a = 0.01, c = 0.1, w = 0.2 }\n";

/// A minute of two joints; the second has a bump at 0.2 rad that no effect of the library makes, and both have noise that repeats each time.
fn data() -> String {
    let mut text = String::from("time_s,u1_rad,u2_rad,y1_rad,y2_rad\n");
    let mut state = 7_u64;
    let mut noise = || {
        let even = |state: &mut u64| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        0.002 * (-2.0 * (1.0 - even(&mut state)).ln()).sqrt() * (TAU * even(&mut state)).cos()
    };
    for k in 0..3000_u32 {
        let t = f64::from(k) * 0.02;
        let (a, b) = (0.6 * (0.7 * t).sin(), 0.5 * (0.45 * t + 1.0).sin() + 0.3 * (1.3 * t).sin());
        let bump = 0.03 * (-((b - 0.2) / 0.1_f64).powi(2)).exp();
        let (first, second) = (1.04 * a + 0.01 + noise(), 0.97 * b - 0.02 + bump + noise());
        writeln!(text, "{t:.2},{a:.7},{b:.7},{first:.7},{second:.7}").expect("a line");
    }
    text
}

#[test]
fn a_formula_of_a_model_in_the_folder_is_offered_found_and_added() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("formulas"), instance_name("formulas"));
    for (name, text) in [("data.csv", data()), ("base.toml", MODEL.to_owned()), ("own.toml", format!("{MODEL}{BUMP}"))]
    {
        std::fs::write(folder.file(name), text).expect("written");
    }
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &folder.path().display().to_string()]);
    let mut page = browser.page(&Console::of(&mut server).address, 1280, 800);
    page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=lab]').click()");
    page.wait_for("what can be offered", "document.querySelectorAll('#lab .offer:not([hidden]) option').length === 2");
    let offers = page.value("[...document.querySelectorAll('#lab .offer option')].map(option => option.textContent)");
    assert_eq!(offers, serde_json::json!(["none", "own.toml"]));
    choose(&mut page, "Formulas of your own", "own.toml");
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    bars(&mut page, 1, 1);
    let card = page.text("#lab .effect h3");
    assert_eq!(card, "bump (joint 2)");
    page.keep_right_everywhere("formulas", Scrolls::Within);
    press(&mut page, "Add bump");
    press(&mut page, "Add bump");
    bars(&mut page, 2, 0);
    let shown = bar_values(&mut page);
    assert!(shown[1] < 0.7 * shown[0], "the error falls: {shown:?}");
    let written = std::fs::read_to_string(folder.file("base-bump.toml")).expect("the model that was written");
    assert!(written.contains("name = \"bump\"") && written.contains("max(1 - abs(joint - 2), 0)"), "{written}");
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);

    // Only what is in the list can be offered, and the lab's own sentence says what is wrong with a value.
    let asked = |page: &mut krait_tests::BrowserPage, order: &str| {
        page.value(&format!(
            "fetch('/lab/job', {{ method: 'POST', body: JSON.stringify({order}) }}).then(answer => answer.text())"
        ))
    };
    let diagnose = "{ verb: 'diagnose', model: 'base.toml', data: 'data.csv', effects: '../own.toml' }";
    let said = asked(&mut page, diagnose);
    assert!(said.as_str().is_some_and(|said| said.contains("no model \"../own.toml\" with formulas")), "{said}");
    let add = "{ verb: 'add', model: 'base.toml', data: 'data.csv', effect: 'bump', effects: 'own.toml', out: 'x.toml', set: [['a b', 1]] }";
    let said = asked(&mut page, add);
    assert!(said.as_str().is_some_and(|said| said.starts_with("At most 16 values")), "{said}");
}
