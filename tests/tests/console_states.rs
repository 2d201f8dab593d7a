//! Every state that the page knows, in three sizes and two themes: word and shape tell it from every other without colour, nothing is cut
//! off, and nothing overlaps. What the page shows is read from it: the texts where they stand, and the shape as it is painted.
//!
//! 78 pictures take a minute, so `.ci/run` asks for this by name. With KRAIT_SHOTS=FOLDER they are kept there.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::Reason;
use krait_ipc::message::{DeviceState, OperatingState, OperatorInput, Phase, SlaveState};
use krait_tests::{Browser, BrowserPage, ChainScene, ChainSender, Console, Krait, instance_name, wait_until};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);
const SIZES: [(u32, u32); 3] = [(1024, 768), (1440, 900), (1920, 1080)];
/// Cells of a shape's side.
const SIDE: usize = 32;
/// Cells in which two shapes differ at least: a twentieth of the picture.
const FEWEST_APART: usize = SIDE * SIDE / 20;

/// What is cut off, leaves the window or lies over something else, a sentence each: lines of text, and what can be pressed or read.
const WRONG: &str = "(() => {
    const isBlank = !document.getElementById('blank').hidden, wrong = [];
    const isShown = e => e.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && !e.closest('.unseen') && !(isBlank && e.closest('.stage') && !e.closest('.blank'));
    const say = e => `${e.id ? '#' + e.id : e.className || e.tagName} “${e.textContent.trim().slice(0, 40)}”`;
    const shrunk = ({ left, right, top, bottom }, part) => ({ left, right, top: top + part * (bottom - top), bottom: bottom - part * (bottom - top) });
    const texts = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
        const parent = walker.currentNode.parentElement;
        if (!walker.currentNode.data.trim() || !isShown(parent)) continue;
        const range = document.createRange();
        range.selectNodeContents(walker.currentNode);
        // A font's box is higher than its letters.
        for (const rect of range.getClientRects()) texts.push({ of: parent, ...shrunk(rect, 0.2) });
    }
    const selectors = ['#glyph', '.command', '#stop', '.needs > div', '.card', '.bar', '#dial', '.views', '.tabs button', '.icon', '.fact'];
    const boxes = selectors.flatMap(selector => [...document.querySelectorAll(selector)]).filter(e => isShown(e) && e.getBoundingClientRect().width > 0)
        .map(of => { const { left, right, top, bottom } = of.getBoundingClientRect(); return { of, left, right, top, bottom }; });
    for (const { of, left, right, top, bottom } of [...texts, ...boxes]) {
        if (left < -1 || top < -1 || right > innerWidth + 1 || bottom > innerHeight + 1) wrong.push(`${say(of)} leaves the window`);
        for (let around = of; around && around !== document.body; around = around.parentElement) {
            const style = getComputedStyle(around), own = around.getBoundingClientRect();
            if (around.tagName === 'svg' || around === of && boxes.some(box => box.of === of)) continue;
            if (style.overflowX !== 'visible' && (left < own.left - 1 || right > own.right + 1)) wrong.push(`${say(of)} is cut off by ${around.className || around.id}`);
            if (style.overflowY !== 'visible' && (top < own.top - 1 || bottom > own.bottom + 1)) wrong.push(`${say(of)} is cut off by ${around.className || around.id}`);
        }
    }
    const isOver = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
    const over = all => all.forEach((a, i) => all.slice(i + 1).forEach(b => {
        if (isOver(a, b) && !a.of.contains(b.of) && !b.of.contains(a.of)) wrong.push(`${say(a.of)} lies over ${say(b.of)}`);
    }));
    over(texts);
    over(boxes);
    return wrong.slice(0, 6);
})()";

/// Each state and a chain that is in it.
fn scenes() -> Vec<(&'static str, ChainScene)> {
    use OperatingState::{Disabled, Enabled, Fault, Paused};
    let homed = SlaveState::IS_HOMED;
    let of = |operating, flags, reasons: &[Reason]| ChainScene::of(operating, homed | flags, reasons);
    let driven = |flags: u32, device: DeviceState, phase: Phase, reasons: &[Reason]| {
        of(Enabled, SlaveState::ENGAGED, reasons).driven(flags, device, phase)
    };
    let (present, known) = (OperatorInput::OPERATOR_PRESENT, DeviceState::Live);
    let mut relaxing = of(Paused, 0, &[Reason::Relaxing]);
    relaxing.state.as_mut().expect("a state").desired_state = Disabled as u32;
    let second = SlaveState::failed_drive_flags(2);
    vec![
        ("emergency", of(Fault, second | SlaveState::HARDWARE_STOP, &[Reason::DriveFault])),
        ("fault", of(Fault, second | SlaveState::OTHERS_HOLD, &[Reason::DriveFault])),
        ("disabled", of(Disabled, 0, &[Reason::SlaveNotEnabled])),
        ("homing", ChainScene::of(Enabled, SlaveState::IS_BUSY, &[Reason::SlaveNotHomed])),
        ("relaxing", relaxing),
        ("paused", of(Paused, 0, &[Reason::StopAsked])),
        ("lost", driven(present, DeviceState::Lost, Phase::Holding, &[Reason::DeviceLost])),
        ("clutched", driven(present | OperatorInput::CLUTCH, known, Phase::Holding, &[Reason::Clutched])),
        ("ready", driven(0, known, Phase::Holding, &[Reason::OperatorAbsent])),
        ("holding", driven(present, known, Phase::Holding, &[Reason::NotEngaged, Reason::StageRestarted])),
        ("limited", driven(present, known, Phase::Following, &[Reason::BendLimit])),
        ("following", driven(present, known, Phase::Following, &[])),
        // Nothing is said any more.
        ("stale", ChainScene::default()),
    ]
}

#[test]
#[ignore = "78 pictures take a minute; .ci/run runs it"]
fn every_state_is_told_apart_without_colour_and_nothing_is_cut_off_or_overlaps() {
    let Some(browser) = Browser::start() else { return };
    let instance = instance_name("states");
    let mut krait = Krait::start(&["console", "--instance", &instance]);
    let console = Console::of(&mut krait);
    let sender = ChainSender::start(&instance);
    let mut page = browser.page(&console.address, 1440, 900);
    let (mut words, mut shapes) = (Vec::new(), Vec::new());
    for (name, scene) in scenes() {
        sender.say(scene);
        page.wait_for(name, &format!("document.documentElement.dataset.shown === '{name}'"));
        page.wait_for("the shape is drawn", "document.querySelector('#glyph svg') !== null");
        let (mut seen, mut painted) = (Vec::new(), Vec::new());
        for (width, height) in SIZES {
            page.resize(width, height);
            for theme in ["dark", "light"] {
                page.in_theme(theme);
                let place = format!("{name}, {width} x {height}, {theme}");
                // Layout and words of the newest frame take a few pictures to come.
                let mut wrong = json!(null);
                let is_right = wait_until(Duration::from_secs(30), || {
                    wrong = page.value(WRONG);
                    wrong == json!([])
                });
                page.keep(&format!("state-{name}-{theme}-{width}"));
                assert!(is_right, "{place}: {wrong:#}");
                let word = page.text("#word");
                assert!(page.value("document.title").as_str().is_some_and(|title| title.starts_with(&word)), "{place}");
                assert!(page.text("#sentence").ends_with('.'), "{place}: {}", page.text("#sentence"));
                seen.push(word);
                painted.push(shape(&mut page));
            }
        }
        assert!(seen.iter().all(|word| *word == seen[0] && !word.is_empty()), "{name}: one word: {seen:?}");
        words.push((name, seen.swap_remove(0)));
        shapes.push((name, painted));
    }
    for (k, (name, word)) in words.iter().enumerate() {
        assert!(words[k + 1..].iter().all(|(_, other)| other != word), "{name}: {words:?}");
    }
    let mut fewest = (usize::MAX, String::new());
    for (k, (name, own)) in shapes.iter().enumerate() {
        for (other, theirs) in &shapes[k + 1..] {
            for (a, b) in own.iter().zip(theirs) {
                let n_apart = a.bytes().zip(b.bytes()).filter(|(a, b)| a != b).count();
                fewest = fewest.min((n_apart, format!("{name} and {other}")));
            }
        }
    }
    assert!(shapes.len() == 13 && fewest.0 >= FEWEST_APART, "{fewest:?} of {} cells", SIDE * SIDE);
    drop(sender);
    krait.signal(Signal::TERM);
    krait.end(PATIENCE);
}

/// The shape beside the word as it is painted, cell by cell: `1` where it is lighter or darker than the ground, whatever its colour.
fn shape(page: &mut BrowserPage) -> String {
    let place = page.value(
        "(r => ({ x: r.x, y: r.y, width: r.width, height: r.height, scale: 1 }))(document.getElementById('glyph').getBoundingClientRect())",
    );
    let picture = page.call("Page.captureScreenshot", &json!({ "format": "png", "clip": place }));
    let cells = page.value(&format!(
        "(async () => {{
            const bytes = Uint8Array.from(atob('{}'), c => c.charCodeAt(0)), bitmap = await createImageBitmap(new Blob([bytes], {{ type: 'image/png' }}));
            const g = new OffscreenCanvas({SIDE}, {SIDE}).getContext('2d');
            g.drawImage(bitmap, 0, 0, {SIDE}, {SIDE});
            const {{ data }} = g.getImageData(0, 0, {SIDE}, {SIDE});
            const light = Array.from({{ length: {SIDE} * {SIDE} }}, (_, i) => 0.2126 * data[4 * i] + 0.7152 * data[4 * i + 1] + 0.0722 * data[4 * i + 2]);
            const away = light.map(value => Math.abs(value - light[0])), most = Math.max(...away);
            return away.map(value => value > most / 2 ? '1' : '0').join('');
        }})()",
        picture["data"].as_str().expect("a picture")
    ));
    let cells = cells.as_str().expect("cells").to_owned();
    let n_painted = cells.bytes().filter(|cell| *cell == b'1').count();
    assert!((FEWEST_APART..SIDE * SIDE).contains(&n_painted), "{n_painted} cells are painted: {cells}");
    cells
}
