//! The size of the first load: everything that a browser fetches of the page before anybody clicks, in bytes as they are served.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Browser, Console, Krait, TempFolder, instance_name};
use rustix::process::Signal;
use std::collections::BTreeMap;

/// What the first load may take at most, bytes.
const MOST_BYTES: u64 = 150_000;
const PATIENCE: Duration = Duration::from_secs(60);

#[test]
fn everything_that_the_page_loads_before_a_click_is_under_150_kb_as_served() {
    let (instance, folder) = (instance_name("first-load"), TempFolder::new("first-load"));
    let lab = folder.file("lab");
    let mut krait = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let console = Console::of(&mut krait);
    let of_page = loads(|path, headers| console.request("GET", path, headers, ""), "/".to_owned());
    let of_stop = loads(|path, headers| console.at_stop("GET", path, headers), console.stop_path());
    assert!(
        of_page.len() > 30 && of_page.contains_key("/js/worker.js") && of_page.contains_key("/js/scene.js"),
        "{of_page:?}"
    );
    assert!(of_stop.len() == 3, "{of_stop:?}");
    let n_bytes: u64 = of_page.values().chain(of_stop.values()).sum();
    assert!(n_bytes < MOST_BYTES, "the first load takes {n_bytes} bytes: {of_page:?} {of_stop:?}");

    // What a browser fetches is what was counted.
    if let Some(browser) = Browser::start() {
        let mut page = browser.page(&console.address, 1280, 800);
        page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
        page.wait_for("it has begun", "document.getElementById('blank-text').textContent !== 'Waiting for the robot.' || document.documentElement.dataset.shown !== undefined");
        let fetched = page.value(
            "performance.getEntriesByType('resource').filter(entry => new URL(entry.name).origin === location.origin && entry.initiatorType !== 'fetch')
             .map(entry => [new URL(entry.name).pathname, entry.encodedBodySize])",
        );
        let fetched = fetched.as_array().expect("a list");
        assert!(fetched.len() > 20, "{fetched:?}");
        for entry in fetched {
            let path = entry[0].as_str().expect("a path");
            assert_eq!(of_page.get(path), entry[1].as_u64().as_ref(), "{path} of {of_page:?}");
        }
    }
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// Every file that a document needs, and those that these need, each with its bytes on the way to a browser.
fn loads(get: impl Fn(&str, &[(&str, &str)]) -> krait_tests::HttpAnswer, document: String) -> BTreeMap<String, u64> {
    let (mut sizes, mut open) = (BTreeMap::new(), vec![document]);
    while let Some(path) = open.pop() {
        if sizes.contains_key(&path) {
            continue;
        }
        let text = get(&path, &[]);
        assert_eq!(text.status, 200, "{path}: {text:?}");
        let served = get(&path, &[("Accept-Encoding", "gzip, deflate")]);
        let n_bytes = served.header("content-length").and_then(|n| n.parse().ok()).expect("a length");
        sizes.insert(path.clone(), n_bytes);
        open.extend(needs(&path, &text.body));
    }
    sizes
}

/// The paths that a text names for a browser to load at once: styles, scripts, pictures, modules and workers.
fn needs(path: &str, text: &str) -> Vec<String> {
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let is_page = !path.ends_with(".js") && !path.ends_with(".css");
    let begins: &[&str] =
        if is_page { &["href=\"", "src=\""] } else { &["from './", "import './", "new Worker('", "url('"] };
    let mut found = Vec::new();
    for begin in begins {
        for (at, _) in text.match_indices(begin) {
            let rest = &text[at + begin.len()..];
            let end = rest.find(['"', '\'']).expect("a quote that ends");
            let name = &rest[..end];
            found.push(if begin.ends_with("./") { format!("{folder}/{name}") } else { name.to_owned() });
        }
    }
    found
}
