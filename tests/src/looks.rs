//! Whether a page looks right: nothing is cut off, leaves the window or lies over something else, in every size and theme.

use crate::browser::BrowserPage;
use crate::world::wait_until;
use core::time::Duration;
use serde_json::json;

/// Windows that are looked at.
pub const SIZES: [(u32, u32); 3] = [(1024, 768), (1440, 900), (1920, 1080)];
/// Layout and words of the newest frame take a few pictures to come.
const PATIENCE: Duration = Duration::from_secs(30);

/// Where a page may have more than its window shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scrolls {
    /// Everything is seen at once.
    Nowhere,
    /// A part of it scrolls up and down.
    Within,
}

/// What is cut off, leaves the window or lies over something else, a sentence each: lines of text, and what can be pressed or read.
const WRONG: &str = "(scrolls => {
    const isBlank = !document.getElementById('blank').hidden, wrong = [];
    const isShown = e => e.checkVisibility({ visibilityProperty: true, opacityProperty: true }) && !e.closest('.unseen') && !(isBlank && e.closest('.stage') && !e.closest('.blank'));
    const say = e => `${e.id ? '#' + e.id : e.className || e.tagName} “${e.textContent.trim().slice(0, 40)}”`;
    // What a part that scrolls shows of it: nothing of it is wrong where that is nothing.
    const within = ({ left, right, top, bottom }, of) => {
        for (let around = of; scrolls && around && around !== document.body; around = around.parentElement) {
            if (!/auto|scroll/.test(getComputedStyle(around).overflowY)) continue;
            const own = around.getBoundingClientRect();
            [top, bottom] = [Math.max(top, own.top), Math.min(bottom, own.bottom)];
        }
        return { of, left, right, top, bottom };
    };
    const shrunk = ({ left, right, top, bottom }, part) => ({ left, right, top: top + part * (bottom - top), bottom: bottom - part * (bottom - top) });
    const texts = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
        const parent = walker.currentNode.parentElement;
        if (!walker.currentNode.data.trim() || !isShown(parent)) continue;
        const range = document.createRange();
        range.selectNodeContents(walker.currentNode);
        // A font's box is higher than its letters.
        for (const rect of range.getClientRects()) texts.push(within(shrunk(rect, 0.2), parent));
    }
    const selectors = ['#glyph', '.command', '#stop', '.needs > div', '.card', '.bar', '#dial', '.views', '#pad', '.tabs button', '.icon', '.fact'];
    const boxes = selectors.flatMap(selector => [...document.querySelectorAll(selector)]).filter(e => isShown(e) && e.getBoundingClientRect().width > 0)
        .map(of => within(of.getBoundingClientRect(), of));
    const isSeen = ({ top, bottom }) => bottom - top > 1;
    for (const { of, left, right, top, bottom } of [...texts, ...boxes].filter(isSeen)) {
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
    over(texts.filter(isSeen));
    over(boxes.filter(isSeen));
    return wrong.slice(0, 6);
})";

/// Whether a press on STOP meets it, wherever it is pressed; also where the page has none.
pub const STOP_IS_FREE: &str = "(stop => {
    if (!stop?.checkVisibility()) return true;
    const { left, top, width, height } = stop.getBoundingClientRect(), parts = [0.03, 0.5, 0.97];
    return parts.every(x => parts.every(y => document.elementFromPoint(left + x * width, top + y * height) === stop));
})(document.querySelector('#stop-place iframe'))";

impl BrowserPage {
    /// Waits until nothing is wrong with what is seen, and keeps a picture of it.
    ///
    /// # Panics
    /// Something stays wrong.
    pub fn keep_right(&mut self, name: &str, scrolls: Scrolls) {
        let mut wrong = json!(null);
        let is_right = wait_until(PATIENCE, || {
            wrong = self.value(&format!("{WRONG}({})", scrolls == Scrolls::Within));
            wrong == json!([]) && self.value(STOP_IS_FREE) == json!(true)
        });
        self.keep(name);
        assert!(is_right, "{name}: {wrong:#}, or something lies over STOP");
    }

    /// The same in every size and theme.
    pub fn keep_right_everywhere(&mut self, name: &str, scrolls: Scrolls) {
        for (width, height) in SIZES {
            self.resize(width, height);
            for theme in ["light", "dark"] {
                self.in_theme(theme);
                self.keep_right(&format!("{name}-{theme}-{width}"), scrolls);
            }
        }
    }
}

/// The points of a canvas as it is shown, row by row, four bytes each, for a script; whoever painted it.
pub fn canvas_points(canvas: &str) -> String {
    format!(
        "(own => {{
            const copy = document.createElement('canvas');
            [copy.width, copy.height] = [own.clientWidth, own.clientHeight];
            const g = copy.getContext('2d', {{ willReadFrequently: true }});
            g.drawImage(own, 0, 0, copy.width, copy.height);
            return g.getImageData(0, 0, copy.width, copy.height).data;
        }})(document.querySelector('{canvas}'))"
    )
}
