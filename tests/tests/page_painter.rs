//! The worker that paints hangs or dies: what it painted is covered by the page, which says since when; and comes back with the worker.
//! And what it paints: edge, ghost and path are in the picture, which is another one once it was turned.
//! Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{Browser, BrowserPage, Console, Krait, STOP_IS_FREE, TempFolder, instance_name};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);

/// A loop that ends only once the lab has a measurement of this name.
const HANG: &str = "for (;;) {
    const ask = new XMLHttpRequest();
    ask.open('GET', '/lab', false);
    ask.send();
    if (ask.responseText.includes('goes-on.csv')) break;
}";

#[test]
fn a_painter_that_hangs_or_dies_leaves_no_old_picture_and_the_page_says_since_when() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("painter"), TempFolder::new("painter"));
    let lab = folder.file("lab");
    std::fs::create_dir(&lab).expect("a folder");
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--no-recording"]);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut server).address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    the_picture_has_edge_ghost_and_path(&mut page);
    let painter = page.inner("/js/worker.js");

    page.begin_in(&painter, HANG);
    is_blank(&mut page);
    page.keep("painter-hangs");
    std::fs::write(format!("{lab}/goes-on.csv"), "time_s\n0\n").expect("written");
    page.wait_for("it paints again", "document.documentElement.dataset.shown !== 'stale'");
    page.wait_for("nothing covers its picture", "document.getElementById('blank').hidden");

    page.begin_in(&painter, "self.close()");
    is_blank(&mut page);
    let first = seconds(&mut page);
    page.wait_for(
        "the time goes on",
        &format!("Number(/ ([0-9.]+) s/.exec(document.getElementById('blank-text').textContent)[1]) > {first}"),
    );
    server.signal(Signal::TERM);
    server.end(PATIENCE);
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
}

/// The painter itself, on a canvas that a test can read, with one thing of the picture in a colour that nothing else has.
fn the_picture_has_edge_ghost_and_path(page: &mut BrowserPage) {
    let found = page.value(
        "(async () => {
            const [{ Scene }, { machineOf }] = [await import('/js/scene.js'), await import('/js/snake.js')];
            const machine = machineOf({ joints: null, l_m: 0.025, r_m: 0.003, max_bend_rad: 1.2 });
            const picture = ({ marked = null, wanted = null, path = [], isLimited = false, turned = 0 }) => {
                const colours = new Proxy({}, { get: (_, name) => name === marked ? '#ff00ff' : '#808080' });
                const scene = new Scene(new OffscreenCanvas(600, 600));
                scene.resize(600, 600, 1);
                scene.turn(turned, 0);
                for (const bend of path) scene.remember([bend], machine);
                scene.draw({ bends: [[0.3, 0.2]], wanted, jaw: null, machine, colours, isLimited });
                return scene.g.getImageData(0, 0, 600, 600).data;
            };
            const isMarked = (data, at) => data[at + 3] > 60 && data[at] - data[at + 1] > 60 && data[at + 2] - data[at + 1] > 60;
            const count = (data, is) => { let n = 0; for (let at = 0; at < data.length; at += 4) n += is(data, at); return n; };
            const marked = of => count(picture(of), isMarked);
            const wanted = [[0.8, 0.2]], path = Array.from({ length: 240 }, (_, i) => [0.3, 0.8 - 0.005 * i]);
            const [as, other] = [picture({}), picture({ turned: 0.6 })];
            const turned = count(as, (data, at) => [0, 1, 2, 3].some(i => Math.abs(data[at + i] - other[at + i]) > 40));
            return {
                there: [{ marked: 'edge' }, { marked: 'ghost', wanted }, { marked: 'trail', path }, { marked: 'warn', isLimited: true }].map(of => marked(of) > 100),
                absent: [{ marked: 'edge', isLimited: true }, { marked: 'ghost' }, { marked: 'trail' }, { marked: 'warn' }].map(marked),
                turned: turned > 1000,
            };
        })()",
    );
    assert_eq!(found, json!({ "there": [true, true, true, true], "absent": [0, 0, 0, 0], "turned": true }));
}

/// The page says that there is no picture, since when, and why; and covers the one that was painted.
fn is_blank(page: &mut BrowserPage) {
    page.wait_for("the state is unknown", "document.documentElement.dataset.shown === 'stale'");
    page.wait_for(
        "since when",
        "/^No picture since [0-9:]{8}$/.test(document.getElementById('blank-title').textContent)",
    );
    page.wait_for(
        "why",
        "document.getElementById('blank-text').textContent.startsWith('The part of this page that paints has been silent for ')",
    );
    page.wait_for("the banner says so", "document.getElementById('word').textContent === 'No picture'");
    page.wait_for("figures are gone", "document.getElementById('bend-now').textContent === '–'");
    let covers = "(scene => [[0.02, 0.5], [0.5, 0.5], [0.5, 0.9], [0.98, 0.02]].every(([x, y]) =>
        document.getElementById('blank').contains(document.elementFromPoint(scene.x + x * scene.width, scene.y + y * scene.height))))(document.getElementById('scene').getBoundingClientRect())";
    page.wait_for("the old picture is covered", covers);
    page.wait_for("STOP is not", STOP_IS_FREE);
}

/// How long the page says that the painter has been silent, s.
fn seconds(page: &mut BrowserPage) -> f64 {
    let said = page.text("#blank-text");
    said.split(' ').find_map(|word| word.parse().ok()).unwrap_or_else(|| panic!("a number of seconds in {said}"))
}
