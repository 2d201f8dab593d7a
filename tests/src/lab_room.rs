//! The lab's page by hand: its buttons and its bars.

use crate::browser::BrowserPage;

/// Waits for a button of the step by its words, and presses it.
pub fn press(page: &mut BrowserPage, words: &str) {
    let button = format!("[...document.querySelectorAll('#lab .work button')].find(b => b.textContent === '{words}')");
    page.wait_for(words, &format!("{button} !== undefined"));
    page.value(&format!("{button}.click()"));
}

/// The numbers above the bars.
pub fn bar_values(page: &mut BrowserPage) -> Vec<f64> {
    let texts =
        page.value("[...document.querySelectorAll('#lab .fall text.value')].map(t => parseFloat(t.textContent))");
    texts.as_array().expect("numbers").iter().map(|own| own.as_f64().expect("a number")).collect()
}

/// Waits for so many bars of what is in the model, and guesses.
pub fn bars(page: &mut BrowserPage, n_solid: usize, n_guesses: usize) {
    page.wait_for(
        &format!("{n_solid} bars and {n_guesses} guesses"),
        &format!(
            "document.querySelectorAll('#lab .fall rect.bar').length === {n_solid} \
             && document.querySelectorAll('#lab .fall rect.guess').length === {n_guesses}"
        ),
    );
}

/// Chooses by a select's label.
pub fn choose(page: &mut BrowserPage, label: &str, value: &str) {
    let select = format!("document.querySelector('#lab select[aria-label=\"{label}\"]')");
    page.value(&format!("{select}.value = '{value}'; {select}.dispatchEvent(new Event('change')); 0"));
}
