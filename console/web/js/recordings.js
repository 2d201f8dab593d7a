// Recordings: the list, and a player that shows each as pictures in the same view, framed as not live.
import { CompareView } from './compare.js';
import { clock, drawing, instant, make, thousands, write } from './format.js';
import { go, turnWithPointer } from './shell.js';
import { JointBars } from './joints.js';
import { degrees } from './snake.js';
import { lend, on, post } from './link.js';
import { useInLab } from './lab.js';
import { MARKS } from './states.js';
import { verdictOf } from './verdict.js';
import { ended } from './work.js';

const page = document.getElementById('recordings');
const SPEEDS = [0.25, 0.5, 1, 2, 5, 20];
const parts = {};
/// Pictures over which the tip's path goes on while a film plays, beside those that a step leaves out: a shape that is older than half a
/// second is none.
const REACH = 15;
let wanted = null, film = null, errors = [], at = 0, isPlaying = false, speed = 1, lastTick = 0, chosen = null, isBuilt = false, wasOpened = false, facts = null, bars = null;
// Which film was asked for last, and the picture that the tip's path has come to.
let turn = 0, trailAt = -Infinity;

function build() {
  isBuilt = true;
  parts.rows = make('tbody');
  const titles = make('tr', '', ...['when', 'recording', 'length', 'marks', 'lost', 'size'].map((name, i) => make('th', i > 1 ? 'n' : '', name)));
  parts.compare = make('button', 'second', 'Verify');
  parts.use = make('button', 'second', 'Use in Lab');
  parts.folder = make('em');
  parts.other = document.createElement('select');
  parts.other.setAttribute('aria-label', 'The other recording');
  parts.pair = make('button', 'second', 'Compare');
  const list = make('section', 'card list', make('h2', '', 'Recordings ', parts.folder), make('div', 'rows', make('table', '', make('thead', '', titles), parts.rows)), make('div', 'acts', parts.use, parts.compare, make('span', 'pair', parts.other, parts.pair)));
  parts.verdict = make('p', 'verdict-says');
  parts.verdict.setAttribute('role', 'status');
  list.append(parts.verdict);
  parts.canvas = document.createElement('canvas');
  parts.canvas.className = 'scene';
  parts.ribbon = make('div', 'ribbon', 'Choose a recording');
  parts.joints = make('div', 'joints');
  parts.joints.setAttribute('role', 'img');
  parts.joints.hidden = true;
  const stage = make('div', 'stage not-live', parts.canvas, parts.joints, parts.ribbon);
  parts.play = make('button', 'prime square', '▶');
  parts.play.setAttribute('aria-label', 'Play or pause');
  parts.time = make('b', 'num', '0:00:00.0');
  parts.length = make('span', 'num');
  parts.speed = document.createElement('select');
  parts.speed.setAttribute('aria-label', 'Speed');
  parts.speed.append(...SPEEDS.map(value => { const option = make('option', '', `${value} ×`); option.value = String(value); option.selected = value === 1; return option; }));
  parts.off = make('b', 'num', '–');
  parts.state = make('span', 'state-word');
  const controls = make('div', 'controls', parts.play, parts.time, parts.length, parts.speed, make('span', 'spread'), parts.state, make('span', '', 'off by'), parts.off);
  parts.scrub = document.createElement('input');
  Object.assign(parts.scrub, { type: 'range', min: 0, max: 0, step: 1, value: 0, disabled: true });
  parts.scrub.setAttribute('aria-label', 'Instant');
  parts.curve = make('div', 'curve');
  parts.marks = make('div', 'marks');
  parts.head = make('div', 'head');
  const player = make('section', 'card player', controls, make('div', 'scrub', parts.curve, parts.marks, parts.head, parts.scrub));
  parts.viewer = make('div', 'viewer', stage, player);
  parts.compared = new CompareView(() => compared(false));
  page.replaceChildren(list, parts.viewer, parts.compared.element);
  parts.canvas.tabIndex = 0;
  parts.canvas.setAttribute('aria-label', 'The recorded snake in three dimensions. Arrow keys turn the view.');
  lend('replay', parts.canvas);
  turnWithPointer(parts.canvas, 'replay');
  parts.play.addEventListener('click', () => { isPlaying = film !== null && !isPlaying; if (isPlaying && at >= film.t_s.length - 1) at = 0; button(); });
  parts.speed.addEventListener('change', () => { speed = Number(parts.speed.value); });
  parts.scrub.addEventListener('input', () => { at = Number(parts.scrub.value); show(); });
  parts.use.addEventListener('click', () => { if (chosen) { useInLab(chosen); go('lab'); } });
  parts.compare.addEventListener('click', verify);
  parts.pair.addEventListener('click', () => {
    if (!chosen) { tell({ say: 'Choose a recording first, then the other one beside “Compare”.' }); return; }
    parts.verdict.replaceChildren();
    compared(true);
    parts.compared.show(chosen, parts.other.value);
  });
  requestAnimationFrame(tick);
}

/// A learnt value as the command writes it, its numbers without exponents.
const readable = sentence => sentence.replace(/-?[\d.]+e-?\d+/g, text => { const number = Number(text); return number && Math.abs(number) < 1e-3 ? number.toExponential(3).replace(/\.?0+e/, 'e') : String(Number(number.toPrecision(4))); }).replace(' +- ', ' ± ');

export async function showRecordings() {
  if (!isBuilt) build();
  const answer = await fetch('/recordings');
  if (!answer.ok) { write(parts.verdict, await answer.text()); return; }
  const entries = await answer.json();
  const today = new Date().toDateString();
  parts.rows.replaceChildren(...entries.map(entry => {
    const when = new Date(entry.modified_s * 1000), day = when.toDateString() === today ? 'today' : when.toISOString().slice(0, 10);
    const name = make('button', 'plain', entry.name.replace(/\.mcap$/, ''));
    name.addEventListener('click', () => open(entry.name));
    const note = entry.is_being_recorded ? make('em', '', 'being recorded') : entry.missing.length ? make('em', 'odd', entry.missing[0]) : make('em', '', entry.compensation ? `compensation ${entry.compensation}` : '');
    const row = make('tr', entry.name === chosen ? 'chosen' : '', make('td', '', make('b', '', when.toTimeString().slice(0, 5)), make('em', '', day)), make('td', '', name, note, ...entry.learnt.map(own => make('em', 'learnt', readable(own)))), make('td', 'n', entry.seconds === null ? '–' : clock(entry.seconds)), make('td', 'n', String(entry.n_marks)), make('td', entry.n_lost ? 'n odd' : 'n', entry.n_lost === null ? '–' : thousands(entry.n_lost)), make('td', 'n', `${(entry.bytes / 1e6).toFixed(1)} MB`));
    row.dataset.name = entry.name;
    return row;
  }));
  const other = parts.other.value;
  parts.other.replaceChildren(...entries.map(({ name }) => new Option(`with ${name.replace(/\.mcap$/, '')}`, name, false, name === other)));
  if (!entries.length) write(parts.verdict, 'No recording is in this folder yet; krait run makes one.');
  if (wanted) { const name = wanted; wanted = null; await open(name); }
}

/// The recording that the console was started for comes first, once.
on('hello', ({ hello }) => {
  facts = hello.facts;
  if (!hello.facts.opens || wasOpened) return;
  wasOpened = true;
  wanted = hello.facts.opens;
  go('recordings');
});

/// The comparison stands in the place of the player.
function compared(isShown) {
  parts.viewer.hidden = isShown;
  parts.compared.element.hidden = !isShown;
}

/// What was shown is of another recording than the one that was asked for.
function clear() {
  [film, errors, bars, at, isPlaying, trailAt] = [null, [], null, 0, false, -Infinity];
  Object.assign(parts.scrub, { max: 0, value: 0, disabled: true });
  for (const part of [parts.curve, parts.marks, parts.joints]) part.replaceChildren();
  parts.joints.hidden = true;
  parts.head.style.left = '0';
  for (const [part, text] of [[parts.time, instant(0)], [parts.length, ''], [parts.off, '–'], [parts.state, '']]) write(part, text);
  post('forget');
  button();
}

/// A film, or the sentence that says why there is none.
async function filmOf(name) {
  try {
    const answer = await fetch(`/recordings/${encodeURIComponent(name)}`);
    return answer.ok ? await answer.json() : await answer.text();
  } catch { return 'The console does not answer.'; }
}

async function open(name) {
  compared(false);
  chosen = name;
  clear();
  for (const row of parts.rows.children) row.classList.toggle('chosen', row.dataset.name === name);
  write(parts.ribbon, `Reading ${name} …`);
  const own = turn += 1, read = await filmOf(name);
  // Another one was asked for by now.
  if (own !== turn) return;
  if (typeof read === 'string') { write(parts.ribbon, read); return; }
  film = read;
  const n = film.joints_wanted.find(joints => joints)?.length ?? 0;
  // Limits and unit of joints are those of the machine that this console was started for.
  const fits = n > 0 && facts?.joints?.low.length === n;
  bars = fits ? new JointBars(parts.joints, facts) : null;
  parts.joints.hidden = !fits;
  const isDrawn = n === 0 || (fits && facts.joints.segments.length > 0);
  parts.canvas.hidden = !isDrawn;
  // Without this machine's unit nothing is said of joints.
  errors = film.off.map(off => off === null || (n > 0 && !bars) ? null : n > 0 ? off * facts.per_si : degrees(off));
  write(parts.ribbon, n > 0 && !fits ? `${n} joints of another machine: open them with krait console ${name}` : `Recording ${name.replace(/\.mcap$/, '')} – not live`);
  Object.assign(parts.scrub, { max: Math.max(0, film.t_s.length - 1), disabled: film.t_s.length < 2 });
  write(parts.length, `of ${instant(film.t_s.at(-1) ?? 0)}`);
  curve();
  show();
}

/// The error over time; where nothing was measured, there is none to draw.
function curve() {
  const n = errors.length, step = Math.max(1, Math.floor(n / 600)), values = [], stretches = [];
  for (let i = 0; i < n; i += step) {
    const own = errors.slice(i, i + step).filter(value => value !== null);
    values.push(own.length ? Math.max(...own) : null);
  }
  const top = Math.max(bars ? 0.05 : 1, ...values) * 1.1;
  values.forEach((value, i) => {
    if (value === null) return;
    if (i === 0 || values[i - 1] === null) stretches.push([]);
    const x = (1000 * i / Math.max(1, values.length - 1)).toFixed(1);
    stretches.at(-1).push({ x, point: `${x} ${(100 - 96 * value / top).toFixed(1)}` });
  });
  const line = stretch => stretch.map(({ point }) => point).join('L');
  const areas = stretches.map(own => `M${own[0].x} 100L${line(own)}L${own.at(-1).x} 100z`);
  // A single value is a short line too.
  const lines = stretches.map(own => `M${line(own)}h1`);
  const picture = drawing('0 0 1000 100', `<path class="area" d="${areas.join('')}"/><path class="line" d="${lines.join('')}"/>`);
  picture.setAttribute('preserveAspectRatio', 'none');
  parts.curve.replaceChildren(picture);
  const seconds = film.t_s.at(-1) || 1;
  parts.marks.replaceChildren(...film.marks.map(([t_s, text]) => { const mark = make('span', '', text); mark.style.left = `${100 * t_s / seconds}%`; return mark; }));
}

function button() { write(parts.play, isPlaying ? '❚❚' : '▶'); }

/// The picture of now. One that does not follow on the last within `reach` pictures is a jump: there the tip has drawn no path.
function show(reach = 1) {
  if (!film?.t_s.length) return;
  const i = Math.min(film.t_s.length - 1, Math.floor(at)), isJump = i < trailAt || i - trailAt > reach;
  const joints = { measured: film.joints[i], wanted: film.joints_wanted[i], err_rms: null };
  if (bars) {
    bars.move(joints);
    bars.write(joints);
  }
  const jaw = film.jaw_wanted.length ? { measured: film.jaw[i], wanted: film.jaw_wanted[i] } : null;
  if (film.bend[i] || joints.measured) trailAt = i;
  if (!parts.canvas.hidden) post('picture', { bend: film.bend[i], setpoint: film.setpoint[i], joints, jaw, isJump });
  write(parts.time, instant(film.t_s[i]));
  write(parts.off, errors[i] === null ? '–' : bars ? `${errors[i].toFixed(2)} ${facts.unit}` : `${errors[i].toFixed(1)}°`);
  write(parts.state, film.operating[i].toLowerCase());
  parts.scrub.value = String(i);
  parts.head.style.left = `${100 * i / Math.max(1, film.t_s.length - 1)}%`;
}

function tick(now) {
  requestAnimationFrame(tick);
  const since = Math.min(200, now - lastTick);
  lastTick = now;
  if (!isPlaying || page.hidden || film.t_s.length < 2) return;
  const step = speed * since / 1000 / (film.t_s[1] - film.t_s[0]);
  at = Math.min(film.t_s.length - 1, at + step);
  if (at >= film.t_s.length - 1) { isPlaying = false; button(); }
  show(REACH + Math.ceil(step));
}

/// A verdict, or what is under way: a mark, a word, a sentence.
function tell({ mark = 'info', word = '', say }) {
  parts.verdict.replaceChildren(make('i', mark, drawing(MARKS[mark].box, MARKS[mark].inner)), make('span', '', make('b', '', word), ` ${say}`));
}

async function verify() {
  if (parts.compare.getAttribute('aria-disabled') === 'true') return;
  if (!chosen) { tell({ say: 'Choose a recording first.' }); return; }
  const name = chosen.replace(/\.mcap$/, ''), own = verdict => tell({ ...verdict, say: `${name}: ${verdict.say}` });
  parts.compare.setAttribute('aria-disabled', 'true');
  own({ say: 'Its input goes through fresh processes …' });
  const job = await ended({ verb: 'verify', data: chosen }, said => { if (said) own({ say: said }); });
  parts.compare.setAttribute('aria-disabled', 'false');
  own(verdictOf(job));
}

on('hello', ({ hello }) => { if (isBuilt) write(parts.folder, hello.facts.instance); });
