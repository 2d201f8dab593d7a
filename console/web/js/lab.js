// The lab, step by step: compare, diagnose, add. Each step opens with its answer as a sentence; the waterfall grows beside it.
import { effectCard, explainedTiles, fallen, isAtNoise, placeOf, valuesOf, whereBars } from './answers.js';
import { handedOver, nameColumns } from './columns.js';
import { ErrorMeter } from './exchange.js';
import { drawing, make, write } from './format.js';
import { residualPictures } from './pictures.js';
import { showQuiz } from './quiz.js';
import { MARKS } from './states.js';
import { waterfall } from './waterfall.js';
import { holding, isHeld, isRefused, onHeld, prime, reportLink, run, say, second, showLost, tile, work } from './work.js';

const page = document.getElementById('lab');
const STEPS = ['Compare', 'Diagnose', 'Add', 'Run'], CHOICES = ['data', 'model', 'formulas'];
const parts = {};
let isBuilt = false, shelf = { models: [], data: [], formulas: [], named: [] }, step = 0, results = [], falls = [], isQuiz = false;
// What the steps are of: another object with each choice, so that a job knows its own. The rail shows the model that was written since.
let chosen = { base: '', data: '', formulas: '' }, added = null;
// Under which name the lab keeps what was dropped last.
let kept = { name: null, says: '' };
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
  parts.kept = make('p', 'before');
  data.append(parts.file, drop, parts.kept, parts.columns);
  parts.before = make('p', 'before');
  // Seen where a model in the folder has formulas.
  parts.offer = make('div', 'offer', make('h2', '', 'Formulas of your own'), choice('formulas', 'Formulas of your own'), make('p', 'before', 'tried beside the known effects'));
  const model = make('section', 'card pick', make('h2', '', 'Model'), choice('model', 'Model'), parts.before, parts.offer);
  parts.steps = make('ol', 'steps');
  parts.quiz = second('Quiz: find the hidden effect', () => { if (!isRefused()) { isQuiz = true; draw(); } });
  parts.fall = make('div', 'fall-picture');
  parts.fallSays = make('p');
  const fall = make('section', 'card fall', make('h2', '', 'Error after each effect ', make('em', '', 'rms, on data not fitted to')), parts.fall, parts.fallSays);
  page.replaceChildren(make('div', 'rail', data, model, parts.steps, parts.quiz), work, fall);
  for (const name of CHOICES) parts[name].addEventListener('change', () => { isRefused() ? showChosen() : restart(); });
  parts.file.addEventListener('click', event => { if (isRefused()) event.preventDefault(); });
  parts.file.addEventListener('change', () => { hand(parts.file.files[0]); parts.file.value = ''; });
  page.addEventListener('dragover', event => event.preventDefault());
  page.addEventListener('drop', event => { event.preventDefault(); hand(event.dataTransfer.files[0]); });
}

export function useInLab(name) { wanted = name; }
let wanted = null;

export async function showLab() {
  if (!isBuilt) { build(); restart(); }
  await catchUp();
  showLost(async () => { await fill(); restart(); });
}

/// What the lists have now, and what was wanted from Recordings: at once, or when the job has ended.
async function catchUp() {
  await fill();
  if (isHeld()) { if (wanted) isRefused(`${wanted} is chosen when the job has ended.`); return; }
  if (wanted && shelf.data.includes(wanted)) {
    parts.data.value = wanted;
    wanted = null;
    restart();
  } else if (parts.data.value !== chosen.data || (!added && parts.model.value !== chosen.base)) isQuiz ? choose() : restart();
}

const choose = () => { chosen = { base: parts.model.value, data: parts.data.value, formulas: parts.formulas.value }; };
const showChosen = () => { [parts.data.value, parts.model.value, parts.formulas.value] = [chosen.data, added ?? chosen.base, chosen.formulas]; };

// Nobody changes what a job was ordered for; whoever stands on a list by keyboard goes on from the job.
onHeld(isNow => {
  if (!isBuilt) return;
  const isThere = CHOICES.some(name => parts[name] === document.activeElement);
  for (const name of CHOICES) parts[name].disabled = isNow;
  if (isNow && isThere) work.querySelector('h1')?.focus();
  if (!isNow && wanted) catchUp();
});

/// A step whose job holds what was chosen until its answer is shown.
const ordered = act => (...own) => { if (!isRefused()) holding(() => act(chosen, ...own)); };

async function fill() {
  let answer;
  try { answer = await fetch('/lab'); } catch { return; }
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
  if (!file || isRefused()) return;
  const taken = await holding(async () => {
    const own = await handedOver(file, draw);
    if (own) await fill();
    return own;
  });
  if (!taken) return;
  kept = taken;
  parts.data.value = kept.name;
  columns();
}

/// Which column is what: proposed by the lab, agreed to or changed here, and kept beside the file.
async function columns() {
  if (isRefused()) return;
  restart();
  const of = chosen, model = await nameColumns(of.data, restart);
  if (model === null || of !== chosen) return;
  await fill();
  if (of !== chosen) return;
  [parts.data.value, parts.model.value] = [of.data, model];
  restart();
}

function restart() {
  [step, results, falls, places, found, one, order, added, isQuiz] = [0, [], [], [], [], 0, [], null, false];
  choose();
  draw();
}

function draw() {
  page.classList.toggle('asks', isQuiz);
  parts.quiz.setAttribute('aria-pressed', String(isQuiz));
  parts.columns.hidden = !chosen.data.endsWith('.csv');
  write(parts.kept, kept.name === chosen.data ? kept.says : '');
  const focused = [...parts.steps.children].findIndex(own => own.contains(document.activeElement));
  parts.steps.replaceChildren(...STEPS.map((name, i) => {
    const isDone = results[i] !== undefined;
    const number = make('i', '', isDone ? drawing(MARKS.yes.box, MARKS.yes.inner) : String(i + 1));
    const button = make('button', '', number, make('span', '', make('b', '', name), make('em', '', results[i]?.short ?? ['How far off?', 'What is missing?', 'Watch the error fall', 'See it follow'][i])));
    // A model that is there already can be run with at once.
    button.disabled = i > results.length && i !== 3;
    button.addEventListener('click', () => { if (!isRefused()) { [step, isQuiz] = [i, false]; draw(); } });
    return make('li', i === step && !isQuiz ? 'current' : isDone ? 'done' : '', button);
  }));
  // Whoever stands on a step by keyboard stays there.
  parts.steps.children[focused]?.firstChild.focus();
  (isQuiz ? showQuiz : results[step]?.draw ?? [askCompare, askDiagnose, askAdd, askRun][step])();
  drawBars();
}

/// The bars, and what the rail's model comes from.
function drawBars() {
  write(parts.before, added ? `written from ${chosen.base}, which steps 1 and 2 are of` : '');
  waterfall(parts.fall, parts.fallSays, falls, unit);
}

// What a job is ordered for, with the clocks that a diagnosis of these measurements found.
const clocked = (of, model = of.base) => ({ model, data: of.data, clock: clocks.of === of.data ? clocks.words : [] });
let clocks = { of: null, words: [] };

function askCompare() {
  const { base, data } = chosen;
  if (!data) { say('Choose a measurement.', 'A recording of krait, or a CSV with time, encoders and the measured bend. What your columns are called does not matter: they are named here.'); return; }
  say(`How far is ${base} from ${data}?`, `The model predicts the bend from the encoders; the measurement says what it was.${shelf.named.includes(data) ? ' Its columns have the names that were kept beside it.' : ''}`, [], [prime('Compare', compare)]);
}

const grownBars = (of, model = of.base) => grown?.model === model && grown.data === of.data ? [...grown.falls] : null;

/// The answer of a job; none where something else is chosen by now, which it would be taken for.
async function answerOf(of, order, title) {
  const answer = await run(order, title, draw);
  return of === chosen ? answer : null;
}

const compare = ordered(async of => {
  const answer = await answerOf(of, { verb: 'compare', ...clocked(of) }, 'Comparing …');
  if (!answer) return;
  const { error, rows, where } = answer, named = answer.unit ?? error.unit ?? 'deg', floor = answer.noise_floor ?? error.noise_floor ?? answer.noise_floor_deg ?? null;
  unit = named === 'deg' ? '°' : ` ${named}`;
  falls = grownBars(of) ?? [{ name: answer.calibration?.some(own => !own.held) ? 'after calibration' : 'model as given', value: error.rms }];
  falls.floor = floor;
  const isNoise = floor !== null && error.rms < 1.1 * floor;
  results[0] = {
    short: `${error.rms.toFixed(2)}${unit} off${floor === null ? '' : `; noise ${floor.toFixed(2)}${unit}`}`,
    draw: () => say(isNoise ? 'The model explains the measurement.' : `The model is off by ${error.rms.toFixed(2)}${unit}.`, floor === null ? `In ${rows} rows.` : `The measurement’s own noise is ${floor.toFixed(2)}${unit}: ${isNoise ? 'nothing explainable is left' : `${(error.rms / floor).toFixed(1)} times as much`}.`, [
      make('div', 'tiles', tile('rms', `${error.rms.toFixed(2)}${unit}`), tile('95 of 100 within', `${error.p95.toFixed(2)}${unit}`), tile('largest', `${error.max.toFixed(2)}${unit}`), tile('rows', String(rows))),
      make('h2', '', 'What the model leaves ', make('em', '', 'measured minus predicted')), residualPictures(answer.curves, floor),
      make('h2', '', 'Where it is worst ', make('em', '', 'rms by circumstance')), whereBars(where, floor)], [prime('Diagnose', () => { step = 1; draw(); diagnose(); }), second('Fit its values', () => fit(of.base)), reportLink('compare')]),
  };
  results.length = 1;
  step = 0;
  draw();
});

function askDiagnose() {
  say('What is missing?', 'Every effect that is known is tried, alone and in pairs, on data that it was not fitted to.', [], [prime('Diagnose', diagnose)]);
}

const diagnose = ordered(async of => {
  const effects = of.formulas || null;
  const answer = await answerOf(of, { verb: 'diagnose', model: of.base, data: of.data, effects }, 'Trying every effect …');
  if (!answer) return;
  const shown = answer.effects.length ? answer.effects : answer.partial, n = shown.length;
  clocks = { of: of.data, words: (answer.clocks ?? []).map(own => `${own.shift_s.toFixed(4)},${own.rate_ppm.toFixed(1)}`) };
  places = shown.map(own => placeOf(own, effects, answer.variations));
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
  falls = grownBars(of) ?? falls.slice(0, 1);
  falls.floor = answer.noise_floor;
  let all = answer.base_heldout_rms;
  for (const own of shown) {
    all = own.joint === null ? own.heldout_rms.after : fallen(all, own.heldout_rms);
    falls.push({ name: `+ ${own.effect}`, value: all, isGuess: true });
  }
  step = 1;
  draw();
});

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

function askAdd() {
  if (!found.length) { say('There is nothing to add.', 'The diagnosis names no effect.'); return; }
  const { effect } = found[one];
  say(`Add ${effect}?`, `It is fitted to one part of the data and scored on another. A new model is written; ${chosen.base} stays as it is.`, [], [prime(`Add ${effect}`, add)]);
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
async function take(of, answer, bars, name) {
  added = answer.model.split('/').at(-1);
  falls = [...bars, { name, value: answer.heldout_rms.after }];
  falls.floor = answer.noise_floor;
  grown = { model: added, data: of.data, falls: [...falls] };
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

const add = ordered(async of => {
  const own = found[one], bars = grownBars(of) ?? falls.slice(0, 1);
  const answer = await answerOf(of, { verb: 'add', ...clocked(of), ...own, out: unused(`${stemOf(of.base)}-${own.effect}`) }, `Fitting ${own.effect} …`);
  if (!answer) return;
  await take(of, answer, bars, `+ ${own.effect}`);
  const { before, after } = answer.heldout_rms, model = added;
  settle(deg(after), `With ${own.effect} the error is ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise: nothing explainable is left.' : 'Something is left; diagnose again with the new model.', 'add', [second('Fit all values again', () => fit(model))]);
});

/// Everything that was found, one on the model of the other in the order of the chain: each time all values that these data gave are fitted
/// again together. What is written until something fails stays.
const addAll = ordered(async of => {
  const all = order.map(i => found[i]);
  let before = null, answer = null, model = of.base, bars = grownBars(of) ?? falls.slice(0, 1);
  for (const [k, own] of all.entries()) {
    answer = await answerOf(of, { verb: 'add', ...clocked(of, model), ...own, out: unused(`${stemOf(model)}-${own.effect}`) }, `Fitting ${own.effect}, ${k + 1} of ${all.length} …`);
    if (!answer) return;
    await take(of, answer, bars, `+ ${own.effect}`);
    before ??= answer.heldout_rms.before;
    [model, bars] = [added, [...falls]];
  }
  const names = all.map(own => own.effect).join(' and '), { after } = answer.heldout_rms;
  settle(`${deg(after)}, fitted together`, `With ${names}, fitted together, the error is ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise: nothing explainable is left.' : 'Something is left; diagnose again with the new model.', 'add');
});

// Everything that was fitted before, and what the model file leaves free, once more and together.
const fit = ordered(async (of, model) => {
  const bars = grownBars(of, model) ?? falls.slice(0, 1);
  const answer = await answerOf(of, { verb: 'fit', ...clocked(of, model), out: unused(`${stemOf(model)}-fit`) }, 'Fitting all values …');
  if (!answer) return;
  await take(of, answer, bars, 'fitted again');
  const { before, after } = answer.heldout_rms;
  settle(`${deg(after)}, fitted again`, `Fitted together, the values leave ${deg(after)}. It was ${deg(before)}.`, answer, isAtNoise(answer) ? 'That is the measurement’s own noise.' : 'Something is left; diagnose again with it.', 'fit');
});

function again(out) {
  return second('Diagnose again with it', () => { const floor = falls.floor; parts.model.value = out; restart(); falls = grownBars(chosen) ?? []; falls.floor = floor; step = 1; draw(); diagnose(); });
}

function askRun() {
  const model = parts.model.value;
  say(`Run the chain with ${model}?`, 'The stages that rest on the model begin anew with it, and so does the recording. The machine holds still until the operator takes hold anew.', [make('pre', '', `krait model exchange ${shelf.folder}/${model}`)], [prime('Run with it', () => exchange(model))]);
}

const exchange = ordered(async (of, model) => {
  const meter = new ErrorMeter(), answer = await answerOf(of, { verb: 'exchange', model }, 'Exchanging the model …');
  if (!answer) return;
  meter.exchanged(answer.hash);
  results[3] = { short: 'it runs', draw: () => say(`The chain runs with ${model}.`, 'Take hold anew; the bars show the tracking error of the last ten seconds of following.', [meter.element]) };
  step = 3;
  draw();
});
