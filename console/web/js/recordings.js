// Recordings: the list, and a player that shows each as pictures in the same view, framed as not live.
import { CompareView } from './compare.js';
import { clock, drawing, instant, make, thousands, write } from './format.js';
import { go, turnWithPointer } from './shell.js';
import { JointBars, farthest } from './joints.js';
import { degrees } from './snake.js';
import { lend, on, post } from './link.js';
import { useInLab } from './lab.js';
import { MARKS } from './states.js';
import { verdictOf } from './verdict.js';
import { ended } from './work.js';

const page = document.getElementById('recordings');
const SPEEDS = [0.25, 0.5, 1, 2, 5, 20];
const parts = {};
let wanted = null, film = null, errors = [], at = 0, isPlaying = false, speed = 1, lastTick = 0, chosen = null, isBuilt = false, wasOpened = false, facts = null, bars = null;

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

async function open(name) {
  compared(false);
  chosen = name;
  isPlaying = false;
  for (const row of parts.rows.children) row.classList.toggle('chosen', row.dataset.name === name);
  write(parts.ribbon, `Reading ${name} …`);
  const answer = await fetch(`/recordings/${encodeURIComponent(name)}`);
  if (!answer.ok) { write(parts.ribbon, await answer.text()); return; }
  film = await answer.json();
  const n = film.joints_wanted.find(joints => joints)?.length ?? 0;
  // Limits and unit of joints are those of the machine that this console was started for.
  const fits = n > 0 && facts?.joints?.low.length === n;
  bars = fits ? new JointBars(parts.joints, facts) : null;
  parts.joints.hidden = !fits;
  const isDrawn = n === 0 || (fits && facts.joints.segments.length > 0);
  parts.canvas.hidden = !isDrawn;
  errors = film.t_s.map((_, i) => n > 0 ? jointError(i) : film.bend[i] && film.setpoint[i] ? degrees(Math.hypot(film.bend[i][0] - film.setpoint[i][0], film.bend[i][1] - film.setpoint[i][1])) : null);
  at = 0;
  write(parts.ribbon, n > 0 && !fits ? `${n} joints of another machine: open them with krait console ${name}` : `Recording ${name.replace(/\.mcap$/, '')} – not live`);
  Object.assign(parts.scrub, { max: Math.max(0, film.t_s.length - 1), disabled: film.t_s.length < 2 });
  write(parts.length, `of ${instant(film.t_s.at(-1) ?? 0)}`);
  curve();
  post('forget');
  button();
  show();
}

/// How far the joint or segment that is farthest off is from where it shall be; nothing without this machine's unit.
function jointError(i) {
  const [measured, wanted] = [film.joints[i], film.joints_wanted[i]];
  return bars && measured && wanted?.length === measured.length ? farthest(facts, measured, wanted) * facts.per_si : null;
}

function curve() {
  const n = errors.length, step = Math.max(1, Math.floor(n / 600)), values = [];
  for (let i = 0; i < n; i += step) values.push(Math.max(0, ...errors.slice(i, i + step).filter(value => value !== null)));
  const top = Math.max(bars ? 0.05 : 1, ...values) * 1.1;
  const points = values.map((value, i) => `${(1000 * i / Math.max(1, values.length - 1)).toFixed(1)} ${(100 - 96 * value / top).toFixed(1)}`);
  const picture = drawing('0 0 1000 100', `<path class="area" d="M0 100L${points.join('L')}L1000 100z"/><path class="line" d="M${points.join('L')}"/>`);
  picture.setAttribute('preserveAspectRatio', 'none');
  parts.curve.replaceChildren(picture);
  const seconds = film.t_s.at(-1) || 1;
  parts.marks.replaceChildren(...film.marks.map(([t_s, text]) => { const mark = make('span', '', text); mark.style.left = `${100 * t_s / seconds}%`; return mark; }));
}

function button() { write(parts.play, isPlaying ? '❚❚' : '▶'); }

function show() {
  if (!film?.t_s.length) return;
  const i = Math.min(film.t_s.length - 1, Math.floor(at));
  const joints = { measured: film.joints[i], wanted: film.joints_wanted[i], err_rms: null };
  if (bars) {
    bars.move(joints);
    bars.write(joints);
  }
  const jaw = film.jaw_wanted.length ? { measured: film.jaw[i], wanted: film.jaw_wanted[i] } : null;
  if (!parts.canvas.hidden) post('picture', { bend: film.bend[i], setpoint: film.setpoint[i], joints, jaw });
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
  at = Math.min(film.t_s.length - 1, at + speed * since / 1000 / (film.t_s[1] - film.t_s[0]));
  if (at >= film.t_s.length - 1) { isPlaying = false; button(); }
  show();
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
