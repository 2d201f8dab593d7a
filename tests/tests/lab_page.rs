//! The lab's page from a comparison to the last bar: two hidden effects, added one after the other, each with a bar of its own.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Browser, BrowserPage, Console, Ended, Krait, TempFolder, instance_name};

const PATIENCE: Duration = Duration::from_secs(240);

#[test]
fn the_bars_grow_while_effects_are_added_and_no_model_is_overwritten() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("lab-page"), instance_name("lab-page"));
    let data = folder.file("data.csv");
    let hidden = ["--kind", "backlash+plane-offset", "--size", "2.5,2.5", "--seconds", "60", "--rate", "25"];
    let made = Ended::of(&[&["lab", "generate", "--seed", "5", "--out", &data], &hidden[..]].concat(), PATIENCE);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &folder.path().display().to_string()]);
    let mut page = browser.page(&Console::of(&mut server).address, 1280, 800);
    page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=lab]').click()");
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    bars(&mut page, 1, 2);
    let first = page.text("#lab .work .prime");
    press(&mut page, &first);
    press(&mut page, &first);
    bars(&mut page, 2, 0);
    press(&mut page, "Diagnose again with it");
    bars(&mut page, 2, 1);
    let second = page.text("#lab .work .prime");
    assert!(second.starts_with("Add ") && second != first, "{second}");
    press(&mut page, &second);
    press(&mut page, &second);
    bars(&mut page, 3, 0);
    // The same again from the beginning: the model that is there stays, and the bars are those of the base.
    page.value(
        "(select => { select.value = 'base.toml'; select.dispatchEvent(new Event('change')); })(\
         [...document.querySelectorAll('#lab select')].find(s => [...s.options].some(o => o.value === 'base.toml')))",
    );
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    bars(&mut page, 1, 2);
    press(&mut page, &first);
    press(&mut page, &first);
    bars(&mut page, 2, 0);
    let models =
        page.value("[...document.querySelectorAll('#lab option')].map(o => o.value).filter(v => v.endsWith('.toml'))");
    let effect = first.trim_start_matches("Add ");
    for name in [format!("base-{effect}.toml"), format!("base-{effect}-2.toml")] {
        assert!(models.as_array().is_some_and(|all| all.iter().any(|own| *own == name.as_str())), "{name}: {models}");
    }
}

/// Waits for a button of the step by its words, and presses it.
fn press(page: &mut BrowserPage, words: &str) {
    let button = format!("[...document.querySelectorAll('#lab .work button')].find(b => b.textContent === '{words}')");
    page.wait_for(words, &format!("{button} !== undefined"));
    page.value(&format!("{button}.click()"));
}

/// Waits for so many bars of what is in the model, and guesses.
fn bars(page: &mut BrowserPage, n_solid: usize, n_guesses: usize) {
    page.wait_for(
        &format!("{n_solid} bars and {n_guesses} guesses"),
        &format!(
            "document.querySelectorAll('#lab .fall rect.bar').length === {n_solid} \
             && document.querySelectorAll('#lab .fall rect.guess').length === {n_guesses}"
        ),
    );
}
