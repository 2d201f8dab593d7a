//! What a long job of the lab is at, for whoever waits: a few words at the beginning of each stage, told to nobody unless a program
//! asks for them.

use std::sync::OnceLock;

static LISTENER: OnceLock<fn(&str)> = OnceLock::new();

/// From now on this hears each stage as it begins; it may be called by several threads. Whoever asked first stays.
pub fn tell_stages(listener: fn(&str)) {
    let _the_first_stays = LISTENER.set(listener);
}

/// A stage begins.
pub(crate) fn stage(words: &str) {
    if let Some(listener) = LISTENER.get() {
        listener(words);
    }
}
