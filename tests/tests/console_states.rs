//! Every state that the page knows, in three sizes and two themes: word and shape tell it from every other without colour, nothing is cut
//! off, and nothing overlaps. What the page shows is read from it: the texts where they stand, and the shape as it is painted.
//!
//! 78 pictures take a minute, so `.ci/run` asks for this by name. With KRAIT_SHOTS=FOLDER they are kept there.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_ipc::Reason;
use krait_ipc::message::{DeviceState, OperatingState, OperatorInput, Phase, SlaveState};
use krait_tests::{Browser, BrowserPage, ChainScene, ChainSender, Console, Krait, SIZES, Scrolls, instance_name};
use rustix::process::Signal;
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);
/// Cells of a shape's side.
const SIDE: usize = 32;
/// Cells in which two shapes differ at least: a twentieth of the picture.
const FEWEST_APART: usize = SIDE * SIDE / 20;

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
        let shown = format!("document.documentElement.dataset.shown === '{name}'");
        page.wait_for(name, &shown);
        page.wait_for("the shape is drawn", "document.querySelector('#glyph svg') !== null");
        let (mut seen, mut painted) = (Vec::new(), Vec::new());
        for (width, height) in SIZES {
            page.resize(width, height);
            for theme in ["dark", "light"] {
                page.in_theme(theme);
                let place = format!("{name}, {width} x {height}, {theme}");
                // A page that waited long for a busy machine says so meanwhile, and is looked at once more.
                let looked = (0..20).find_map(|_| {
                    page.wait_for(name, &shown);
                    page.keep_right(&format!("state-{name}-{theme}-{width}"), Scrolls::Nowhere);
                    let word = page.text("#word");
                    let is_titled = page.value("document.title").as_str().is_some_and(|title| title.starts_with(&word));
                    let (sentence, painted) = (page.text("#sentence"), shape(&mut page));
                    (page.value(&shown) == true).then_some((word, is_titled, sentence, painted))
                });
                let (word, is_titled, sentence, own) = looked.unwrap_or_else(|| panic!("{place}: it does not stay"));
                assert!(is_titled && sentence.ends_with('.'), "{place}: {word:?}, {sentence:?}");
                seen.push(word);
                painted.push(own);
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
