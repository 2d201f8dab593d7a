// The lab, step by step: compare, diagnose, add. Each step opens with its answer as a sentence; the waterfall grows beside it.
import { effectCard, explainedTiles, valuesOf, whereBars } from './answers.js';
import { nameColumns } from './columns.js';
import { ErrorMeter } from './exchange.js';
import { drawing, make, write } from './format.js';
import { residualPictures } from './pictures.js';
import { showQuiz } from './quiz.js';
import { MARKS } from './states.js';
import { waterfall } from './waterfall.js';
import { prime, reportLink, run, say, second, tile, work } from './work.js';

const page = document.getElementById('lab');
const STEPS = ['Compare', 'Diagnose', 'Add', 'Run'];
const parts = {};
let isBuilt = false, shelf = { models: [], data: [], formulas: [], named: [] }, step = 0, results = [], falls = [], isQuiz = false;
// The model that the first two steps are of, and the one that was written since; the rail shows the newest.
let base = '', added = null;
// What a diagnosis found, each as it can be added; which of them is added alone, and all of them in the order of the chain.
let places = [], found = [], one = 0, order = [];
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
  parts.before = make('p', 'before');
  // Seen where a model in the folder has formulas.
  parts.offer = make('div', 'offer', make('h2', '', 'Formulas of your own'), choice('formulas', 'Formulas of your own'), make('p', 'before', 'tried beside the known effects'));
  const model = make('section', 'card pick', make('h2', '', 'Model'), choice('model', 'Model'), parts.before, parts.offer);
  parts.steps = make('ol', 'steps');
  parts.quiz = second('Quiz: find the hidden effect', () => { isQuiz = true; draw(); });
  parts.fall = make('div', 'fall-picture');
  parts.fallSays = make('p');
  const fall = make('section', 'card fall', make('h2', '', 'Error after each effect ', make('em', '', 'rms, on data not fitted to')), parts.fall, parts.fallSays);
  page.replaceChildren(make('div', 'rail', data, model, parts.steps, parts.quiz), work, fall);
  parts.data.addEventListener('change', restart);
  parts.model.addEventListener('change', restart);
  parts.formulas.addEventListener('change', restart);
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
  if (!added) base = parts.model.value;
  if (isFirst && !isQuiz) draw();
  if (wanted && shelf.data.includes(wanted)) { parts.data.value = wanted; wanted = null; restart(); }
}

async function fill() {
  const answer = await fetch('/lab');
  if (!answer.ok) return;
  shelf = await answer.json();
  for (const [name, names] of [['data', shelf.data], ['model', shelf.models], ['formulas', ['', ...shelf.formulas]]]) {
    const before = parts[name].value;
    parts[name].replaceChildren(...names.map(value => { const option = make('option', '', value || 'none'); option.value = value; return option; }));
    if (names.includes(before)) parts[name].value = before;
  }
  parts.offer.hidden = !shelf.formulas.length;
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
  [step, results, falls, places, found, one, order, base, added, isQuiz] = [0, [], [], [], [], 0, [], parts.model.value, null, false];
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
  drawBars();
}

/// The bars, and what the rail's model comes from.
function drawBars() {
  write(parts.before, added ? `written from ${base}, which steps 1 and 2 are of` : '');
  waterfall(parts.fall, parts.fallSays, falls, unit);
}

const files = (model = base) => ({ model, data: parts.data.value });
// The same with the clocks that a diagnosis of these measurements found.
const clocked = model => ({ ...files(model), clock: clocks.of === parts.data.value ? clocks.words : [] });
let clocks = { of: null, words: [] };

function askCompare() {
  if (!parts.data.value) { say('Choose a measurement.', 'A recording of krait, or a CSV with time, encoders and the measured bend. What your columns are called does not matter: they are named here.'); return; }
  say(`How far is ${base} from ${parts.data.value}?`, `The model predicts the bend from the encoders; the measurement says what it was.${shelf.named.includes(parts.data.value) ? ' Its columns have the names that were kept beside it.' : ''}`, [], [prime('Compare', compare)]);
}

const grownBars = (model = base) => grown?.model === model && grown.data === parts.data.value ? [...grown.falls] : null;

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
      make('h2', '', 'Where it is worst ', make('em', '', 'rms by circumstance')), whereBars(where, floor)], [prime('Diagnose', () => { step = 1; draw(); diagnose(); }), second('Fit its values', () => fit(base)), reportLink('compare')]),
  };
  results.length = 1;
  step = 0;
  draw();
}

function askDiagnose() {
  say('What is missing?', 'Every effect that is known is tried, alone and in pairs, on data that it was not fitted to.', [], [prime('Diagnose', diagnose)]);
}

async function diagnose() {
  const effects = parts.formulas.value || null;
  const answer = await run({ verb: 'diagnose', ...files(), effects }, 'Trying every effect …', draw);
  if (!answer) return;
  const shown = answer.effects.length ? answer.effects : answer.partial, n = shown.length;
  clocks = { of: parts.data.value, words: (answer.clocks ?? []).map(own => `${own.shift_s.toFixed(4)},${own.rate_ppm.toFixed(1)}`) };
  places = shown.map(own => ({ effect: own.effect, effects, set: startOf(own), ...placeOf(own, answer.variations) }));
  [found, one, order] = [[...places], 0, answer.chain_order ?? []];
  const count = n === 1 ? 'One effect is missing' : `${n} effects are missing`;
  const title = { none: 'Nothing is missing.', missing: `${count}.`, partly: `${count}, and something besides.`, unknown: 'Nothing known explains it.', 'too-short': 'These data are too short to say.' }[answer.verdict] ?? answer.verdict;
  results[1] = {
    short: n ? shown.map(own => own.effect).join(', ') : title,
    draw: () => say(title, `${answer.sentence[0].toUpperCase()}${answer.sentence.slice(1)}.`, [
      explainedTiles(answer, deg),
      ...[...(answer.variations ?? []).map(own => own.sentence), ...(answer.cautions ?? []).map(own => `Caution: ${own}`)].map(text => make('p', 'aside', `${text[0].toUpperCase()}${text.slice(1)}.`)),
      make('div', 'effects', ...shown.map((own, i) => effectCard(own, found[i].effect, name => chooseAlike(i, name), deg))),
      ...(answer.next_experiment ? [make('p', 'next-experiment', make('b', '', 'Next experiment: '), answer.next_experiment.do)] : []),
    ], [...additions(), reportLink('diagnose')]),
  };
  results.length = 2;
  falls = grownBars() ?? falls.slice(0, 1);
  falls.floor = answer.noise_floor;
  let all = answer.base_heldout_rms;
  for (const own of shown) {
    all = own.joint === null ? own.heldout_rms.after : fallen(all, own.heldout_rms);
    falls.push({ name: `+ ${own.effect}`, value: all, isGuess: true });
  }
  step = 1;
  draw();
}

// A formula of one's own, which nobody has explained, starts from what was found.
const startOf = own => own.explanation ? [] : Object.entries(own.params).map(([name, { value }]) => [name, value]);

/// One of those that look alike instead of the one that was named; a number that depends on a column, and values to start from, are of
/// that one alone.
function chooseAlike(i, name) {
  [found[i], one] = [name === places[i].effect ? places[i] : { ...places[i], effect: name, by: null, set: [] }, i];
  write(work.querySelector('.alone'), `Add ${name}`);
}

/// One button for all that was found, and one for the largest alone.
function additions() {
  if (!found.length) return [];
  const alone = button => { button.classList.add('alone'); return button; }, ask = () => { step = 2; draw(); };
  if (order.length < 2) return [alone(prime(`Add ${found[one].effect}`, ask))];
  return [prime(`Add ${order.length === 2 ? 'both' : `all ${order.length}`} and fit them together`, addAll), alone(second(`Add ${found[one].effect}`, ask))];
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

function askAdd() {
  if (!found.length) { say('There is nothing to add.', 'The diagnosis names no effect.'); return; }
  const { effect } = found[one];
  say(`Add ${effect}?`, `It is fitted to one part of the data and scored on another. A new model is written; ${base} stays as it is.`, [], [prime(`Add ${effect}`, add)]);
}

// A model's name that none in the folder has.
function unused(stem) {
  const isTaken = name => shelf.models.includes(`${name}.toml`), short = stem.slice(0, 66);
  let name = short;
  for (let n = 2; isTaken(name); n += 1) name = `${short}-${n}`;
  return `${name}.toml`;
}

const stemOf = model => model.replace(/\.toml$/, '');

/// What a command has written stands in the rail from here on, with a bar of its own.
async function take(answer, bars, name) {
  added = answer.model.split('/').at(-1);
  falls = [...bars, { name, value: answer.heldout_rms.after }];
  falls.floor = answer.noise_floor;
  grown = { model: added, data: parts.data.value, falls: [...falls] };
  await fill();
  parts.model.value = added;
  drawBars();
}

/// The third step's answer, and what can come after it.
function settle(short, title, answer, ending, verb, more = []) {
  const model = added;
  results[2] = {
    short: `${model}: ${short}`,
    draw: () => say(title, ending, [valuesOf(answer)], [prime('Run with it', () => { step = 3; draw(); }), again(model), ...more, reportLink(verb)]),
  };
  results.length = 3;
  step = 2;
  draw();
}

// As the diagnosis judges it: 4 % above a floor that is known exactly, and two of its standard errors more.
const isAtNoise = ({ heldout_rms: { after }, noise_floor: floor, noise_floor_relative_se: se }) => floor !== null && after <= (1.04 + 2 * se) * floor;

async function add() {
  const own = found[one], bars = grownBars() ?? falls.slice(0, 1), from = base;
  const answer = await run({ verb: 'add', ...clocked(from), ...own, out: unused(`${stemOf(from)}-${own.effect}`) }, `Fitting ${own.effect} …`, draw);
  if (!answer) return;
  await take(answer, bars, `+ ${own.effect}`);
  const { before, after } = answer.heldout_rms, model = added;
  settle(deg(after), `With ${own.effect} the error is ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise: nothing explainable is left.' : 'Something is left; diagnose again with the new model.', 'add', [second('Fit all values again', () => fit(model))]);
}

/// Everything that was found, one on the model of the other in the order of the chain: each time all values that these data gave are fitted
/// again together. What is written until something fails stays.
async function addAll() {
  const all = order.map(i => found[i]);
  let before = null, answer = null, model = base, bars = grownBars() ?? falls.slice(0, 1);
  for (const [k, own] of all.entries()) {
    answer = await run({ verb: 'add', ...clocked(model), ...own, out: unused(`${stemOf(model)}-${own.effect}`) }, `Fitting ${own.effect}, ${k + 1} of ${all.length} …`, draw);
    if (!answer) return;
    await take(answer, bars, `+ ${own.effect}`);
    before ??= answer.heldout_rms.before;
    [model, bars] = [added, [...falls]];
  }
  const names = all.map(own => own.effect).join(' and '), { after } = answer.heldout_rms;
  settle(`${deg(after)}, fitted together`, `With ${names}, fitted together, the error is ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise: nothing explainable is left.' : 'Something is left; diagnose again with the new model.', 'add');
}

// Everything that was fitted before, and what the model file leaves free, once more and together.
async function fit(model) {
  const bars = grownBars(model) ?? falls.slice(0, 1);
  const answer = await run({ verb: 'fit', ...clocked(model), out: unused(`${stemOf(model)}-fit`) }, 'Fitting all values …', draw);
  if (!answer) return;
  await take(answer, bars, 'fitted again');
  const { before, after } = answer.heldout_rms;
  settle(`${deg(after)}, fitted again`, `Fitted together, the values leave ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise.' : 'Something is left; diagnose again with it.', 'fit');
}

function again(out) {
  return second('Diagnose again with it', () => { const floor = falls.floor; parts.model.value = out; restart(); falls = grownBars() ?? []; falls.floor = floor; step = 1; draw(); diagnose(); });
}

function askRun() {
  const model = parts.model.value;
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
