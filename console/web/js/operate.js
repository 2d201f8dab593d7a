// Operate: the banner, what holds the motion back, the dial, the lines; numbers ten times a second, positions with each picture.
import { clock, drawing, make, sign, signed, write } from './format.js';
import { degrees, pairs } from './snake.js';
import { MARKS, STATES, TONES } from './states.js';
import { on } from './link.js';
import { play } from './shell.js';
import { JointBars } from './joints.js';

const $ = id => document.getElementById(id);
const TEXT_EVERY_MS = 100, OLD_MS = 150;
let hello = null, facts = null, shown = '', textDue = 0, lastReasons = '', reasonRows = [], staleSince = null, bars = [], dial = null, joints = null;

/// The tracking error in the unit that is shown, and its sign: degrees, or millimetres of joints that slide.
const off = value => value * facts.per_si;
/// Sentences speak of the snake, which joints are none of.
const named = text => facts?.joints ? text.replace(/\bsnake\b/g, 'robot') : text;
const unit = () => sign(facts.unit);

on('hello', message => {
  hello = message.hello;
  facts = hello.facts;
  write($('fact-drives').lastElementChild, !facts.is_simulated ? 'Real drives' : facts.joints?.segments.length ? 'Simulated segments' : facts.joints ? 'Simulated joints' : 'Simulated snake');
  write($('edge-name'), `limit ${degrees(facts.max_bend_rad).toFixed(0)}°`);
  document.documentElement.dataset.machine = facts.joints?.segments.length ? 'segments' : facts.joints ? 'joints' : 'snake';
  if (facts.joints) joints = new JointBars($('joints'), facts);
  // Beside the picture, not in its place.
  if (facts.joints?.segments.length) $('bends').append($('joints'));
  write($('lines-title').firstChild, facts.joints && !facts.joints.segments.length ? 'Actuators ' : facts.jaw ? 'Lines and jaw ' : 'Lines ');
  $('jaw').hidden = !facts.jaw;
  document.documentElement.toggleAttribute('data-jaw', Boolean(facts.jaw));
  if (facts.jaw) [$('jaw-bar').min, $('jaw-bar').max] = facts.jaw.map(degrees);
  makeDial();
  makeBars();
});

on('frame', ({ frame, age, glass }) => {
  if (!facts) return;
  const now = performance.now();
  staleSince = null;
  move(frame);
  // Another state has other words at once: its name beside the sentence of the one before would contradict it.
  const isNew = frame.shown !== shown;
  show(frame.shown);
  if (!isNew && now < textDue) return;
  textDue = now + TEXT_EVERY_MS;
  // What holds the motion back is said first, so that numbers that cannot be shown never keep it from being said.
  sentence(frame);
  needs(frame);
  reasons(frame);
  live(age > OLD_MS ? 'old' : '', age > OLD_MS ? `${(age / 1000).toFixed(1)} s old` : 'Live', glass === null || age > OLD_MS ? '' : `${glass.toFixed(0)} ms`);
  numbers(frame);
});

on('stale', ({ hasConnection, silentFrom, lateMs }) => {
  const now = performance.now(), from = silentFrom ?? now - 500;
  const isNew = staleSince === null;
  staleSince ??= { at: new Date(Date.now() - (now - from)), from, isFirst: !shown };
  show('stale');
  if (!isNew && now < textDue) return;
  textDue = now + TEXT_EVERY_MS;
  const seconds = ((now - staleSince.from) / 1000).toFixed(1);
  write($('blank-title'), staleSince.isFirst ? 'No picture yet' : `No picture since ${staleSince.at.toTimeString().slice(0, 8)}`);
  write($('blank-text'), silentFrom !== undefined
    ? `The part of this page that paints has been silent for ${seconds} s. What the robot does now is not known here: look at the robot. If this stays, load the page anew.`
    : lateMs
    ? `Pictures come ${(lateMs / 1000).toFixed(1)} s late, because the way to this page is slow. What the robot does now is not known here: look at the robot.`
    : hasConnection
    ? `The drives have not reported for ${seconds} s. What the robot does now is not known here: look at the robot.`
    : `Nothing has arrived for ${seconds} s. What the robot does now is not known here: look at the robot. Connecting again … A console that was started anew has printed a new address.`);
  for (const id of ['bend-now', 'plane-now', 'off-now']) write($(id), '–');
  write($('error-now'), '');
  joints?.blank();
  write($('jaw-now'), '–');
  for (const bar of bars) { write(bar.mm, '–'); write(bar.newton, '–'); }
  for (const id of ['need-drives', 'need-operator', 'need-clutch']) need(id, 'unknown', 'unknown', 'unknown');
  write($('need-scale').querySelector('dd span'), '–');
  list([{ level: 'info', say: 'Not known.', todo: 'What was shown is too old.' }], 'stale');
  write($('sentence'), STATES.stale.say);
  live('gone', silentFrom !== undefined ? 'No painter' : lateMs ? 'Too late' : hasConnection ? 'No state' : 'No connection', '');
});

on('slow', ({ message }) => {
  const recording = $('fact-recording');
  recording.hidden = message.recording_s === null;
  if (message.recording_s !== null) write(recording.querySelector('b'), clock(message.recording_s));
});

function live(className, word, number) {
  const fact = $('fact-live');
  if (fact.className !== `fact ${className}`) fact.className = `fact ${className}`;
  write(fact.querySelector('span'), word);
  write(fact.querySelector('b'), number);
}

function show(state) {
  if (state === shown) return;
  shown = state;
  document.documentElement.dataset.shown = state;
  const { word, shape } = STATES[state];
  $('glyph').replaceChildren(drawing('0 0 96 96', shape));
  write($('word'), word);
  document.title = `${word} – krait`;
  $('blank').hidden = state !== 'stale';
  play(TONES[state] ?? []);
}

/// Whether the joints that move are those of this page's configuration; a console that was started with another one draws none of them.
const isOfThisMachine = frame => !frame.joints || frame.joints.wanted.length === facts.joints?.low.length;

/// The words of a reason: those of this instant, where it has several causes.
const wordsOf = reason => reason.words ?? hello.reasons[reason.id];

function sentence(frame) {
  const worst = frame.reasons.map(wordsOf);
  const limit = worst.find(reason => reason.banner);
  const text = named(frame.shown === 'limited' && limit ? limit.banner : frame.state?.failure ? frame.state.failure : frame.shown === 'holding' && worst.length ? worst[0].say : frame.shown === 'ready' ? `Holding still. ${frame.pad ? 'Hold the drive pad to follow.' : facts.presence_hint}` : frame.shown === 'lost' && frame.pad ? 'Holding still: the page that drives is lost.' : STATES[frame.shown].say);
  write($('sentence'), text);
}

function need(id, className, mark, word) {
  const element = $(id), key = className + mark + word;
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  element.className = className;
  element.querySelector('i').replaceChildren(drawing(MARKS[mark].box, MARKS[mark].inner));
  write(element.querySelector('dd span'), word);
}

function needs({ state, operator, motion_scale }) {
  const operating = state.operating, isCut = shown === 'emergency';
  const isMoving = operating === 'ENABLED' && state.homed;
  if (operating === 'FAULT') need('need-drives', 'bad', 'fault', isCut ? 'cut off' : 'fault');
  else need('need-drives', '', isMoving ? 'yes' : 'no', state.busy ? 'homing' : operating === 'ENABLED' && !state.homed ? 'not homed' : operating.toLowerCase());
  if (!operator) need('need-operator', 'unknown', 'unknown', 'unknown');
  else if (operator.device === 'lost') need('need-operator', 'odd', 'warn', 'lost');
  else need('need-operator', '', operator.present ? 'yes' : 'no', operator.present ? 'present' : 'absent');
  if (operator) need('need-clutch', '', operator.clutch ? 'no' : 'yes', operator.clutch ? 'pressed' : 'released');
  else need('need-clutch', 'unknown', 'unknown', 'unknown');
  write($('need-scale').querySelector('dd span'), motion_scale === null ? '–' : `${(100 * motion_scale).toFixed(0)} %`);
}

function reasons(frame) {
  const items = frame.reasons.map(reason => {
    const words = wordsOf(reason);
    return { level: words.level, say: words.say, todo: [reason.value, words.todo].filter(Boolean).join(' ') };
  });
  const hand = frame.state?.operating === 'ENABLED' && frame.operator ? ofHand(frame.operator) : [];
  if (!isOfThisMachine(frame)) {
    const behind = items.findIndex(({ level }) => level === 'hold' || level === 'info');
    items.splice(behind < 0 ? items.length : behind, 0, { level: 'warn', say: 'This page is of another machine.', todo: 'Start krait console anew, without --config.' });
  }
  // Silence is no good news: only while it follows does nothing hold it back.
  if (frame.shown === 'following' && items.every(({ level }) => level === 'info')) items.unshift({ level: 'ok', say: 'Nothing.', alone: 'Nothing holds it back.', todo: frame.operator?.locked.length ? 'What is not locked of your motion passes.' : 'All of your motion passes.' });
  if (!items.length) items.push({ level: 'hold', say: `${STATES[frame.shown].word}.`, todo: STATES[frame.shown].say });
  return list([...items, ...hand], '');
}

/// What the operator has chosen at the hand, as `krait state` says it.
function ofHand({ scale, locked }) {
  const said = locked.map(what => `No ${what} is taken from the hand: it is locked.`);
  if (scale !== null && scale !== 1) said.unshift(`The hand moves the tip at ${scale} of the configured speed.`);
  return said.map(say => ({ level: 'info', say, todo: '' }));
}

function list(items, state) {
  const key = state + JSON.stringify(items);
  if (key === lastReasons) return;
  lastReasons = key;
  reasonRows = items.map(({ level, say, todo }) => {
    const icon = make('i', '', drawing(MARKS[level].box, MARKS[level].inner));
    return make('li', level, icon, make('span', '', named(say)), make('small', '', named(todo)));
  });
  fit();
  worst(items[0], items.filter(({ level }) => level !== 'info').length - 1);
}

/// The worst reason in the banner, readable from two metres, and how many of the others hold the motion back too.
function worst({ level, say, alone }, nMore) {
  const [icon, text, count] = $('worst').children;
  $('worst').className = `worst ${level}`;
  icon.replaceChildren(drawing(MARKS[level].box, MARKS[level].inner));
  write(text, named(alone ?? say));
  write(count, nMore > 0 ? `+${nMore}` : '');
}

/// As much as the card has room for, and none of it cut: what to do goes first, then size, and what is left out is counted.
function fit() {
  const list = $('reasons'), card = list.parentElement, isCut = () => card.scrollHeight > card.clientHeight;
  let n = reasonRows.length;
  list.replaceChildren(...reasonRows);
  write($('why-more'), '');
  list.className = '';
  // A page that is not in front has no height.
  if (!card.clientHeight) return;
  for (const size of ['', 'first-todo', 'no-todo', 'no-todo small']) {
    list.className = size;
    if (!isCut()) return;
  }
  while (n > 1 && isCut()) reasonRows[--n].remove();
  write($('why-more'), `and ${reasonRows.length - n} more`);
}
new ResizeObserver(fit).observe($('reasons').parentElement);

function makeDial() {
  const most = degrees(facts.max_bend_rad), ring = part => `<circle class="rings" r="${100 * part}"/>`;
  const name = part => `<text y="${-100 * part - 4}">${(most * part).toFixed(0)}°</text>`;
  const holder = drawing('0 0 1 1', `<path class="cross" d="M-100 0H100M0-100V100"/>${ring(1 / 3)}${ring(2 / 3)}<circle class="limit" r="100"/>${name(1 / 3)}${name(2 / 3)}${name(1)}
    <line class="ray live" x1="0" y1="0"/><circle class="wanted live" r="11"/><circle class="seen live" r="6.500"/>`);
  $('dial').replaceChildren(...holder.childNodes);
  dial = { ray: $('dial').querySelector('.ray'), wanted: $('dial').querySelector('.wanted'), seen: $('dial').querySelector('.seen') };
}

function makeBars() {
  bars = Array.from({ length: facts.n_actuators }, (_, i) => i + 1).map(n => {
    const [fill, told, load] = [make('div', 'fill'), make('div', 'told'), make('div', 'fill')];
    const [mm, newton] = [make('span', 'mm num'), make('span', 'newton num')];
    const track = make('div', 'track', fill, make('div', 'zero'), told);
    const bar = make('div', 'bar', make('span', 'id', facts.jaw && n === facts.n_actuators ? 'J' : String(n)), track, mm, make('div', 'track load', load), newton);
    return { bar, fill, told, load, mm, newton, track };
  });
  $('bars').replaceChildren(...bars.map(({ bar }) => bar));
}

/// From the bend vector to the dial, as the camera sees it: x right, y down, turned by the view's roll.
export function onDial([bx, by]) {
  const [x, y] = [bx, -by], [c, s] = [Math.cos(facts.view_roll_rad), Math.sin(facts.view_roll_rad)];
  return [x * c + y * s, -x * s + y * c];
}

/// What the load of an actuator may be on the side that it has, N; of one without a limit, what the model may foretell.
const mostLoad = (i, tau) => (tau > 0 ? facts.loads[i]?.push_n : facts.loads[i]?.pull_n) ?? facts.max_load_n;

function move(frame) {
  const scale = 100 / facts.max_bend_rad, place = bend => onDial(bend).map(v => v * scale);
  const at = (element, bend) => {
    element.toggleAttribute('hidden', !bend);
    element.style.display = bend ? '' : 'none';
    if (bend) { const [x, y] = place(bend); element.setAttribute('transform', `translate(${x.toFixed(2)} ${y.toFixed(2)})`); }
  };
  if (frame.joints && isOfThisMachine(frame)) joints?.move(frame.joints);
  at(dial.seen, frame.bend);
  at(dial.wanted, frame.setpoint);
  const [x, y] = frame.bend ? place(frame.bend) : [0, 0];
  dial.ray.setAttribute('x2', x.toFixed(2));
  dial.ray.setAttribute('y2', y.toFixed(2));
  if (!frame.state) return;
  bars.forEach(({ fill, told, load, track }, i) => {
    const part = Math.max(-1, Math.min(1, frame.state.q_m[i] / facts.max_stroke_m));
    fill.style.transform = `translateX(${part < 0 ? 50 + 50 * part : 50}%) scaleX(${Math.abs(part) / 2})`;
    const wanted = frame.q_tilde_m ? Math.max(-1, Math.min(1, frame.q_tilde_m[i] / facts.max_stroke_m)) : null;
    told.style.display = wanted === null ? 'none' : '';
    if (wanted !== null) told.style.transform = `translateX(${(0.5 + 0.5 * wanted) * track.clientWidth}px)`;
    const tau = frame.state.tau_n[i] ?? null;
    load.style.transform = `scaleX(${tau === null ? 0 : Math.min(1, Math.abs(tau) / mostLoad(i, tau))})`;
  });
}

function numbers(frame) {
  const { bend, state } = frame;
  const size = bend ? degrees(Math.hypot(...bend)) : null;
  write($('bend-now'), size === null ? '–' : `${size.toFixed(1)}°`);
  // The plane counts anticlockwise from the camera's right; of a straight snake there is none.
  const [x, y] = bend ? onDial(bend) : [0, 0];
  write($('plane-now'), size === null ? '–' : size < 2 ? 'any' : `${Math.round(degrees(Math.atan2(-y, x)) + 360) % 360}°`);
  write($('off-now'), frame.err_rms === null ? '–' : `${off(frame.err_rms).toFixed(1)}${unit()}`);
  write($('error-now'), frame.err_rms === null ? '' : `${off(frame.err_rms).toFixed(2)}${unit()}`);
  if (frame.joints && isOfThisMachine(frame)) joints?.write(frame.joints);
  if (frame.jaw) {
    const [seen, told] = [frame.jaw.measured, frame.jaw.wanted].map(value => value === null ? null : degrees(value));
    // Without a camera on it, the bar shows nothing: a wanted angle is no opening.
    $('jaw-bar').value = seen ?? $('jaw-bar').min;
    write($('jaw-now'), `${seen === null ? 'not measured' : `${seen.toFixed(0)}°`} of ${told.toFixed(0)}°`);
  }
  bars.forEach(({ mm, newton }, i) => {
    const [q, tau] = [state?.q_m[i] ?? null, state?.tau_n[i] ?? null];
    write(mm, q === null ? '–' : signed(q * 1e3, 2));
    // Where all or none have power the state tells it.
    const isOff = state?.power.includes(true) && !state.power[i];
    write(newton, isOff ? 'no power told' : tau === null ? 'not measured' : `${signed(tau, 1)} N`);
  });
  const text = frame.joints?.measured && facts.joints?.segments.length
    ? `The segments bend ${pairs(frame.joints.measured).map(own => degrees(Math.hypot(...own)).toFixed(0)).join(' and ')} degrees.`
    : size === null ? 'The camera sees nothing.' : `The snake bends ${size.toFixed(0)} degrees; it is off by ${frame.err_rms === null ? 'an unknown angle' : `${degrees(frame.err_rms).toFixed(1)} degrees`}.`;
  const jaw = frame.jaw ? ` Its jaw is ${frame.jaw.measured === null ? 'not measured' : `open by ${degrees(frame.jaw.measured - (facts.jaw?.[0] ?? 0)).toFixed(0)} degrees`}.` : '';
  if (textDue % 1000 < TEXT_EVERY_MS) $('scene').setAttribute('aria-label', `${text}${jaw} Arrow keys turn the view, plus and minus zoom.`);
}
