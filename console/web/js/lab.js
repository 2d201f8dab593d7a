// The lab, step by step: compare, diagnose, add. Each step opens with its answer as a sentence; the waterfall grows beside it.
import { nameColumns } from './columns.js';
import { ErrorMeter } from './exchange.js';
import { drawing, make, write } from './format.js';
import { residualPictures, sketch } from './pictures.js';
import { showQuiz } from './quiz.js';
import { MARKS } from './states.js';
import { prime, reportLink, run, say, second, tile, work } from './work.js';

const page = document.getElementById('lab');
const STEPS = ['Compare', 'Diagnose', 'Add', 'Run'];
const parts = {};
let isBuilt = false, shelf = { models: [], data: [], named: [] }, step = 0, results = [], falls = [], effect = null, where = {}, added = null, isQuiz = false;
// The bars up to a model that an effect was added to, for the same measurement.
let grown = null;

let unit = '°';
const deg = value => `${value.toFixed(2)}${unit}`;

function choice(name, label) {
  const select = document.createElement('select');
  select.setAttribute('aria-label', label);
  parts[name] = select;
  return select;
}

function build() {
  isBuilt = true;
  const data = make('section', 'card pick', make('h2', '', 'Measurement'), choice('data', 'Measurement'));
  parts.file = document.createElement('input');
  Object.assign(parts.file, { type: 'file', accept: '.csv', className: 'unseen', id: 'lab-file' });
  const drop = make('label', 'drop', 'Choose or drop a CSV');
  drop.htmlFor = 'lab-file';
  parts.columns = second('Name its columns', columns);
  data.append(parts.file, drop, parts.columns);
  const model = make('section', 'card pick', make('h2', '', 'Model'), choice('model', 'Model'));
  parts.steps = make('ol', 'steps');
  parts.quiz = second('Quiz: find the hidden effect', () => { isQuiz = true; draw(); });
  parts.fall = make('div', 'fall-picture');
  parts.fallSays = make('p');
  const fall = make('section', 'card fall', make('h2', '', 'Error after each effect ', make('em', '', 'rms, on data not fitted to')), parts.fall, parts.fallSays);
  page.replaceChildren(make('div', 'rail', data, model, parts.steps, parts.quiz), work, fall);
  parts.data.addEventListener('change', restart);
  parts.model.addEventListener('change', restart);
  parts.file.addEventListener('change', () => hand(parts.file.files[0]));
  page.addEventListener('dragover', event => event.preventDefault());
  page.addEventListener('drop', event => { event.preventDefault(); hand(event.dataTransfer.files[0]); });
}

export function useInLab(name) { wanted = name; }
let wanted = null;

export async function showLab() {
  const isFirst = !isBuilt;
  if (isFirst) { build(); restart(); }
  await fill();
  if (isFirst && !isQuiz) draw();
  if (wanted && shelf.data.includes(wanted)) { parts.data.value = wanted; wanted = null; restart(); }
}

async function fill() {
  const answer = await fetch('/lab');
  if (!answer.ok) return;
  shelf = await answer.json();
  for (const name of ['data', 'model']) {
    const names = name === 'data' ? shelf.data : shelf.models, before = parts[name].value;
    parts[name].replaceChildren(...names.map(value => { const option = make('option', '', value); option.value = value; return option; }));
    if (names.includes(before)) parts[name].value = before;
  }
}

async function hand(file) {
  if (!file) return;
  const name = file.name.replace(/[^A-Za-z0-9._-]/g, '-').replace(/^[.-]+/, '');
  const answer = await fetch(`/lab/data/${encodeURIComponent(name)}`, { method: 'POST', body: file });
  if (!answer.ok) { say('The file was not taken.', await answer.text()); return; }
  await fill();
  parts.data.value = name;
  restart();
  columns();
}

/// Which column is what: proposed by the lab, agreed to or changed here, and kept beside the file.
async function columns() {
  const data = parts.data.value;
  restart();
  const model = await nameColumns(data, restart);
  if (model === null) return;
  await fill();
  Object.assign(parts.data, { value: data });
  Object.assign(parts.model, { value: model });
  restart();
}

function restart() {
  [step, results, falls, effect, where, added, isQuiz] = [0, [], [], null, {}, null, false];
  draw();
}

function draw() {
  page.classList.toggle('asks', isQuiz);
  parts.quiz.setAttribute('aria-pressed', String(isQuiz));
  parts.columns.hidden = !parts.data.value.endsWith('.csv');
  parts.steps.replaceChildren(...STEPS.map((name, i) => {
    const isDone = results[i] !== undefined;
    const number = make('i', '', isDone ? drawing(MARKS.yes.box, MARKS.yes.inner) : String(i + 1));
    const button = make('button', '', number, make('span', '', make('b', '', name), make('em', '', results[i]?.short ?? ['How far off?', 'What is missing?', 'Watch the error fall', 'See it follow'][i])));
    // A model that is there already can be run with at once.
    button.disabled = i > results.length && i !== 3;
    button.addEventListener('click', () => { step = i; isQuiz = false; draw(); });
    return make('li', i === step && !isQuiz ? 'current' : isDone ? 'done' : '', button);
  }));
  (isQuiz ? showQuiz : results[step]?.draw ?? [askCompare, askDiagnose, askAdd, askRun][step])();
  waterfall();
}

const files = () => ({ model: parts.model.value, data: parts.data.value });
// The same with the clocks that a diagnosis of these measurements found.
const clocked = () => ({ ...files(), clock: clocks.of === parts.data.value ? clocks.words : [] });
let clocks = { of: null, words: [] };

function askCompare() {
  if (!parts.data.value) { say('Choose a measurement.', 'A recording of krait, or a CSV with time, encoders and the measured bend. What your columns are called does not matter: they are named here.'); return; }
  say(`How far is ${parts.model.value} from ${parts.data.value}?`, `The model predicts the bend from the encoders; the measurement says what it was.${shelf.named.includes(parts.data.value) ? ' Its columns have the names that were kept beside it.' : ''}`, [], [prime('Compare', compare)]);
}

const grownBars = () => grown?.model === parts.model.value && grown.data === parts.data.value ? [...grown.falls] : null;

async function compare() {
  const answer = await run({ verb: 'compare', ...clocked() }, 'Comparing …', draw);
  if (!answer) return;
  const { error, rows, where } = answer, named = answer.unit ?? error.unit ?? 'deg', floor = answer.noise_floor ?? error.noise_floor ?? answer.noise_floor_deg ?? null;
  unit = named === 'deg' ? '°' : ` ${named}`;
  falls = grownBars() ?? [{ name: answer.calibration?.some(own => !own.held) ? 'after calibration' : 'model as given', value: error.rms }];
  falls.floor = floor;
  const isNoise = floor !== null && error.rms < 1.1 * floor;
  results[0] = {
    short: `${error.rms.toFixed(2)}${unit} off${floor === null ? '' : `; noise ${floor.toFixed(2)}${unit}`}`,
    draw: () => say(isNoise ? 'The model explains the measurement.' : `The model is off by ${error.rms.toFixed(2)}${unit}.`, floor === null ? `In ${rows} rows.` : `The measurement’s own noise is ${floor.toFixed(2)}${unit}: ${isNoise ? 'nothing explainable is left' : `${(error.rms / floor).toFixed(1)} times as much`}.`, [
      make('div', 'tiles', tile('rms', `${error.rms.toFixed(2)}${unit}`), tile('95 of 100 within', `${error.p95.toFixed(2)}${unit}`), tile('largest', `${error.max.toFixed(2)}${unit}`), tile('rows', String(rows))),
      make('h2', '', 'What the model leaves ', make('em', '', 'measured minus predicted')), residualPictures(answer.curves, floor),
      make('h2', '', 'Where it is worst ', make('em', '', 'rms by circumstance')), whereBars(where, floor)], [prime('Diagnose', () => { step = 1; draw(); diagnose(); }), second('Fit its values', fit), reportLink('compare')]),
  };
  results.length = 1;
  step = 0;
  draw();
}

function whereBars(where, floor) {
  const worst = where.slice(0, 9), top = Math.max(...worst.map(bin => bin.rms), floor ?? 0);
  return make('div', 'where', ...worst.map(bin => {
    const fill = make('i');
    fill.style.width = `${100 * bin.rms / top}%`;
    return make('div', '', make('span', '', `${bin.by} ${bin.bin}`), make('div', 'track', fill), make('b', 'num', bin.rms.toFixed(2)));
  }));
}

function askDiagnose() {
  say('What is missing?', 'Every effect that is known is tried, alone and in pairs, on data that it was not fitted to.', [], [prime('Diagnose', diagnose)]);
}

async function diagnose() {
  const answer = await run({ verb: 'diagnose', ...files() }, 'Trying every effect …', draw);
  if (!answer) return;
  const found = answer.effects.length ? answer.effects : answer.partial, n = found.length;
  clocks = { of: parts.data.value, words: (answer.clocks ?? []).map(own => `${own.shift_s.toFixed(4)},${own.rate_ppm.toFixed(1)}`) };
  effect = found[0]?.effect ?? null;
  where = found.length ? placeOf(found[0], answer.variations) : {};
  const count = n === 1 ? 'One effect is missing' : `${n} effects are missing`;
  const title = { none: 'Nothing is missing.', missing: `${count}.`, partly: `${count}, and something besides.`, unknown: 'Nothing known explains it.', 'too-short': 'These data are too short to say.' }[answer.verdict] ?? answer.verdict;
  results[1] = {
    short: n ? found.map(own => own.effect).join(', ') : title,
    draw: () => say(title, `${answer.sentence[0].toUpperCase()}${answer.sentence.slice(1)}.`, [
      ...[...(answer.variations ?? []).map(own => own.sentence), ...(answer.cautions ?? []).map(own => `Caution: ${own}`)].map(text => make('p', 'aside', `${text[0].toUpperCase()}${text.slice(1)}.`)),
      make('div', 'effects', ...found.map(own => effectCard(own, placeOf(own, answer.variations)))),
      ...(answer.next_experiment ? [make('p', 'next-experiment', make('b', '', 'Next experiment: '), answer.next_experiment.do)] : []),
    ], effect ? [prime(`Add ${effect}`, () => { step = 2; draw(); }), reportLink('diagnose')] : [reportLink('diagnose')]),
  };
  results.length = 2;
  falls = grownBars() ?? falls.slice(0, 1);
  falls.floor = answer.noise_floor;
  let all = answer.base_heldout_rms;
  for (const own of found) {
    all = own.joint === null ? own.heldout_rms.after : fallen(all, own.heldout_rms);
    falls.push({ name: `+ ${own.effect}`, value: all, isGuess: true });
  }
  step = 1;
  draw();
}

// Every bar is the error of all joints together: of one joint's effect it falls by what that joint's mean square falls.
function fallen(all, { before, after }) {
  return Math.sqrt(Math.max(0, all ** 2 - before ** 2 + after ** 2));
}

// The joint that has an effect, and the column that one of its numbers depends on.
function placeOf({ effect: name, joint }, variations) {
  const own = (variations ?? []).find(one => one.in_effects && one.column && one.effect === name && one.joint === joint);
  return { joint: joint ?? null, by: own ? `${own.parameter}=${own.column.name}` : null };
}

function effectCard(own, place) {
  const values = Object.entries(own.params).filter(([, value]) => value.free !== false).map(([name, value]) => make('tr', '', make('th', '', name), make('td', 'n', `${value.value.toPrecision(3)} ${value.unit}`), make('td', 'n', `± ${value.se.toPrecision(1)}`)));
  const others = own.class.filter(name => name !== own.effect);
  const words = own.explanation ? [make('p', '', own.explanation.what), make('p', '', make('b', '', 'To check on the machine: '), own.explanation.check)] : [];
  if (own.sketch) words.splice(1, 0, sketch(own.sketch));
  const card = make('div', 'effect', make('h3', '', (own.explanation ? `${own.effect}: ${own.explanation.title}` : own.effect) + (own.joint ? ` (joint ${own.joint})` : '')), ...words, make('p', '', `The error falls from ${deg(own.heldout_rms.before)} to ${deg(own.heldout_rms.after)}; it came out best in ${(100 * own.probability).toFixed(0)} of 100 resamplings.`), make('table', '', make('tbody', '', ...values)));
  if (others.length) {
    const group = make('fieldset', '', make('legend', '', `These data cannot tell it from ${others.length} other${others.length > 1 ? 's' : ''}`));
    for (const name of [own.effect, ...others]) {
      const radio = document.createElement('input');
      Object.assign(radio, { type: 'radio', name: `class-${own.effect}-${own.joint ?? ''}`, value: name, checked: name === own.effect });
      radio.addEventListener('change', () => { [effect, where] = [name, name === own.effect ? place : { ...place, by: null }]; work.querySelector('.prime').textContent = `Add ${name}`; });
      group.append(make('label', '', radio, name));
    }
    card.append(group);
  }
  return card;
}

function askAdd() {
  say(`Add ${effect}?`, `It is fitted to one part of the data and scored on another. A new model is written; ${parts.model.value} stays as it is.`, [], [prime(`Add ${effect}`, add)]);
}

// A model's name that none in the folder has.
function unused(stem) {
  const isTaken = name => shelf.models.includes(`${name}.toml`);
  let name = stem;
  for (let n = 2; isTaken(name); n += 1) name = `${stem}-${n}`;
  return `${name}.toml`;
}

async function add() {
  const base = parts.model.value.replace(/\.toml$/, ''), out = unused(`${base}-${effect}`);
  const answer = await run({ verb: 'add', ...clocked(), effect, ...where, out }, `Fitting ${effect} …`, draw);
  if (!answer) return;
  added = out;
  const { before, after } = answer.heldout_rms, floor = answer.noise_floor;
  falls = grownBars() ?? falls.slice(0, 1);
  falls.push({ name: `+ ${effect}`, value: after });
  falls.floor = floor;
  grown = { model: out, data: parts.data.value, falls: [...falls] };
  const name = effect;
  results[2] = {
    short: `${deg(after)} with ${name}`,
    draw: () => say(`With ${name} the error is ${deg(after)}. It was ${deg(before)}.`, floor !== null && after < 1.05 * floor ? 'That is the measurement’s own noise: nothing explainable is left.' : 'Something is left; diagnose again with the new model.', [
      valuesOf(answer)], [prime('Run with it', () => { step = 3; draw(); }), again(out), second('Fit all values again', () => { parts.model.value = out; fit(); }), reportLink('add')]),
  };
  results.length = 3;
  step = 2;
  await fill();
  draw();
}

function valuesOf(answer) {
  return make('table', 'values', make('tbody', '', ...Object.entries(answer.params).map(([key, value]) => make('tr', '', make('th', '', key), make('td', 'n', `${value.value.toPrecision(4)} ${value.unit}`), make('td', 'n', `± ${value.se.toPrecision(2)}`), make('td', '', value.on_bound ? 'on its bound' : '')))));
}

// Everything that was fitted before, and what the model file leaves free, once more and together.
async function fit() {
  const base = parts.model.value.replace(/\.toml$/, ''), out = unused(`${base}-fit`), isGrown = grownBars();
  const answer = await run({ verb: 'fit', ...clocked(), out }, 'Fitting all values …', draw);
  if (!answer) return;
  added = out;
  const { before, after } = answer.heldout_rms, floor = answer.noise_floor;
  falls = isGrown ?? falls.slice(0, 1);
  falls.push({ name: 'fitted again', value: after });
  falls.floor = floor;
  grown = { model: out, data: parts.data.value, falls: [...falls] };
  const ending = floor !== null && after < 1.05 * floor ? 'That is the measurement’s own noise.' : 'Something is left; diagnose again with it.';
  results[2] = {
    short: `${deg(after)}, fitted again`,
    draw: () => say(`Fitted together, the values leave ${deg(after)}. It was ${deg(before)}.`, ending, [valuesOf(answer)], [prime('Run with it', () => { step = 3; draw(); }), again(out), reportLink('fit')]),
  };
  results.length = 3;
  step = 2;
  await fill();
  draw();
}

function again(out) {
  return second('Diagnose again with it', () => { const floor = falls.floor; parts.model.value = out; restart(); falls = grownBars() ?? []; falls.floor = floor; step = 1; draw(); diagnose(); });
}

function askRun() {
  const model = added ?? parts.model.value;
  say(`Run the chain with ${model}?`, 'The stages that rest on the model begin anew with it, and so does the recording. The machine holds still until the operator takes hold anew.', [make('pre', '', `krait model exchange ${shelf.folder}/${model}`)], [prime('Run with it', () => exchange(model))]);
}

async function exchange(model) {
  const meter = new ErrorMeter(), answer = await run({ verb: 'exchange', model }, 'Exchanging the model …', draw);
  if (!answer) return;
  meter.exchanged(answer.hash);
  results[3] = { short: 'it runs', draw: () => say(`The chain runs with ${model}.`, 'Take hold anew; the bars show the tracking error of the last ten seconds of following.', [meter.element]) };
  step = 3;
  draw();
}

function waterfall() {
  if (!falls.length) { parts.fall.replaceChildren(); write(parts.fallSays, 'The bars come with the first comparison.'); return; }
  const [width, height, low, left] = [400, 460, 74, 56], top = Math.max(...falls.map(fall => fall.value), falls.floor ?? 0) * 1.22;
  const y = value => (height - low) * (1 - value / top) + 4, each = (width - left - 6) / Math.max(3, falls.length);
  const ticks = [0.25, 0.5, 1, 2, 5, 10].find(size => top / size < 5) ?? 20;
  let inner = '';
  for (let value = 0; value < top; value += ticks) inner += `<path class="grid" d="M${left} ${y(value)}H${width}"/><text class="tick" x="${left - 6}" y="${y(value) + 4}" text-anchor="end">${value}${unit}</text>`;
  if (falls.floor) inner += `<rect class="floor" x="${left}" y="${y(falls.floor)}" width="${width - left}" height="${y(0) - y(falls.floor)}"/>`;
  const texts = [];
  falls.forEach((fall, i) => {
    const x = left + 6 + each * i, isLast = i === falls.length - 1 && i > 0;
    inner += `<rect class="${fall.isGuess ? 'guess' : isLast ? 'bar last' : 'bar'}" x="${x}" y="${y(fall.value)}" width="${each * 0.8}" height="${Math.max(1, y(0) - y(fall.value))}" rx="3"/><text class="value" x="${x + each * 0.4}" y="${y(fall.value) - 8}" text-anchor="middle">${deg(fall.value)}</text>`;
    texts.push([x + each * 0.4, fall.name]);
  });
  const picture = drawing(`0 0 ${width} ${height}`, inner);
  for (const [x, name] of texts) {
    const words = name.length > 12 ? name.split(/(?<=[ -])/).reduce((lines, word) => { (lines.at(-1) + word).length > 13 ? lines.push(word) : lines[lines.length - 1] += word; return lines; }, ['']) : [name];
    words.forEach((word, i) => {
      const text = document.createElementNS('http://www.w3.org/2000/svg', 'text');
      text.setAttribute('class', 'name');
      text.setAttribute('x', x);
      text.setAttribute('y', height - low + 24 + 16 * i);
      text.setAttribute('text-anchor', 'middle');
      text.textContent = word;
      picture.append(text);
    });
  }
  parts.fall.replaceChildren(picture);
  const last = falls.at(-1);
  write(parts.fallSays, falls.some(fall => fall.isGuess) ? 'Dashed: what it would bring, tried on data that it was not fitted to.' : falls.floor && last.value < 1.05 * falls.floor ? 'The last bar meets the noise (grey): nothing explainable is left.' : falls.floor ? 'Grey: the measurement’s own noise.' : '');
}
