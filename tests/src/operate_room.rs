//! What the page's Operate room shows of a frame, read from the page and held against the frame itself: the row of what following needs,
//! and the bars of the actuators.

use crate::BrowserPage;
use serde_json::Value;

/// A line of the row: class, word, and the mark beside it.
pub type Need = [String; 3];

/// In the page: where a bar's fills and its mark lie, as parts of their tracks, and what is written.
const BAR: &str = "bar => {
    const [track, load] = bar.querySelectorAll('.track'), place = e => e.getBoundingClientRect();
    const part = (e, of) => { const [own, all] = [place(e), place(of)]; return [(own.left - all.left) / all.width, (own.right - all.left) / all.width]; };
    const told = bar.querySelector('.told');
    return {
        position: part(track.querySelector('.fill'), track), load: part(load.querySelector('.fill'), load)[1],
        told: told.style.display === 'none' ? null : (([a, b]) => (a + b) / 2)(part(told, track)),
        mm: bar.querySelector('.mm').textContent, newton: bar.querySelector('.newton').textContent, name: bar.querySelector('.id').textContent,
        colours: [...bar.querySelectorAll('.fill, .id')].map(e => getComputedStyle(e).backgroundColor),
    };
}";

/// From the next picture on each frame is held against the page that has just shown it: words and numbers where they change, and in every
/// sixth picture where the bars lie, to two pixels. `window.row` gathers what differs and what was seen.
const WATCH: &str = "import('/js/link.js').then(({ on }) => {
    const facts = FACTS, bars = [...document.querySelectorAll('#bars .bar')], read = BAR;
    const row = window.row = { n: 0, n_placed: 0, wrong: [], words: [], widest: bars.map(() => 0), n_told: 0, n_loaded: 0 };
    const last = {};
    const wrong = text => { if (row.wrong.length < 8) row.wrong.push(text); };
    // A text that has just changed is of this frame.
    const isNew = (key, text) => { const changed = last[key] !== undefined && last[key] !== text; last[key] = text; return changed; };
    const near = (what, is, shall, within) => { if (!(Math.abs(is - shall) <= within)) wrong(`${what}: ${is}, expected ${shall}`); };
    const number = text => Number(text.replace('\u{2212}', '-').replace(/[^0-9.-]/g, ''));
    const part = metres => Math.max(-1, Math.min(1, metres / facts.max_stroke_m));
    on('frame', ({ frame }) => {
        if (!frame.state) return;
        row.n += 1;
        const { operating, homed, busy, q_m, tau_n } = frame.state, own = frame.operator;
        const words = {
            drives: operating === 'FAULT' ? 'fault' : busy ? 'homing' : operating === 'ENABLED' && !homed ? 'not homed' : operating.toLowerCase(),
            operator: !own ? 'unknown' : own.device === 'lost' ? 'lost' : own.present ? 'present' : 'absent',
            clutch: !own ? 'unknown' : own.clutch ? 'pressed' : 'released',
            scale: frame.motion_scale === null ? '–' : `${(100 * frame.motion_scale).toFixed(0)} %`,
        };
        for (const [id, word] of Object.entries(words)) {
            const shown = document.querySelector(`#need-${id} dd span`).textContent;
            if (isNew(id, shown) && shown !== word) wrong(`${id}: ${shown}, expected ${word}`);
            if (!row.words.includes(`${id} ${shown}`)) row.words.push(`${id} ${shown}`);
        }
        bars.forEach((bar, i) => {
            const mm = bar.querySelector('.mm').textContent, newton = bar.querySelector('.newton').textContent;
            if (isNew(`mm ${i}`, mm)) near(`mm of ${i}`, number(mm), 1e3 * q_m[i], 0.0051);
            if (isNew(`N ${i}`, newton)) {
                if (tau_n[i] === null) { if (newton !== 'not measured') wrong(`N of ${i}: ${newton}, expected none`); }
                else near(`N of ${i}`, number(newton), tau_n[i], 0.051);
            }
        });
        if (row.n % 6) return;
        row.n_placed += 1;
        bars.map(read).forEach((bar, i) => {
            const pixels = n => n / bars[i].querySelector('.track').clientWidth, q = part(q_m[i]);
            row.widest[i] = Math.max(row.widest[i], Math.abs(q));
            near(`position of ${i} from`, bar.position[0], 0.5 + 0.5 * Math.min(0, q), pixels(2));
            near(`position of ${i} to`, bar.position[1], 0.5 + 0.5 * Math.max(0, q), pixels(2));
            const most = tau_n[i] > 0 ? facts.loads[i].push_n : facts.loads[i].pull_n;
            near(`load of ${i}`, bar.load, Math.min(1, Math.abs(tau_n[i] ?? 0) / most), pixels(2));
            row.n_loaded += bar.load > 0.01;
            if (frame.q_tilde_m) { row.n_told += 1; near(`told of ${i}`, bar.told ?? NaN, 0.5 + 0.5 * part(frame.q_tilde_m[i]), pixels(2)); }
        });
    });
    return 0;
})";

/// Begins to hold every frame against the page; `facts` are those of the hello.
pub fn watch_operate_room(page: &mut BrowserPage, facts: &Value) {
    page.value(&WATCH.replace("FACTS", &facts.to_string()).replace("BAR", &format!("({BAR})")));
}

/// What was gathered since.
pub fn seen_in_operate_room(page: &mut BrowserPage) -> Value {
    page.value("window.row")
}

/// The bars as they are shown now.
pub fn bars_shown(page: &mut BrowserPage) -> Vec<Value> {
    let bars = page.value(&format!("[...document.querySelectorAll('#bars .bar')].map({BAR})"));
    bars.as_array().expect("bars").clone()
}

/// The row as it is shown now: drives, operator, clutch, motion. A page that has just opened has none yet: then all is empty.
pub fn needs_shown(page: &mut BrowserPage) -> [Need; 4] {
    let row = page.value(
        "['drives', 'operator', 'clutch', 'scale'].map(id => document.getElementById(`need-${id}`)).map(e => [e?.className ?? '', e?.querySelector('dd span')?.textContent ?? '', e?.querySelector('i')?.innerHTML ?? ''])",
    );
    [0, 1, 2, 3].map(|k| [0, 1, 2].map(|i| row[k][i].as_str().expect("text").to_owned()))
}
