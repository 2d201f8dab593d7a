//! What a long job of the lab is at: a line for each stage on standard error, in a terminal, and for the console's page.

use std::io::{IsTerminal, Write, stderr};
use std::sync::{Mutex, PoisonError};

/// Has the stages told, if somebody waits who reads them.
pub(super) fn tell() {
    if stderr().is_terminal() || std::env::var_os(krait_console::STAGES).is_some() {
        krait_lab::tell_stages(say);
    }
}

/// Threads that are at the same say it once.
fn say(words: &str) {
    static LAST: Mutex<String> = Mutex::new(String::new());
    let mut last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    if *last != words {
        words.clone_into(&mut last);
        let _nobody_reads_on_is_fine = writeln!(stderr(), "{words}");
    }
}
