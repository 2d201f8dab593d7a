// A measurement is handed over, and which column of it is what: the lab's proposal as a table, which somebody changes or agrees to.
import { make } from './format.js';
import { named, prime, run, say, sayAtWork, second } from './work.js';

const numbered = (base, n, words) => Array.from({ length: n }, (_, i) => [`${base}${i + 1}`, words(i + 1)]);
// The lab's columns without their units, in words.
const meanings = kind => [
  ['', [['', 'not used'], ['time', 'time'], ['trial', 'label of trials']]],
  kind === 'force'
    ? ['Joints', [...numbered('q', 6, k => `angle ${k}`), ...numbered('tau', 6, k => `torque ${k}`), ...numbered('i', 6, k => `current ${k}`)]]
    : ['Snake', [...numbered('q', 3, k => `line ${k}, position`), ['bend_x', 'bend, x'], ['bend_y', 'bend, y'], ['theta_l', 'bend, angle'], ['delta', 'bend, its plane'], ...numbered('tau', 3, k => `line ${k}, load`)]],
  [kind === 'force' ? 'Joints with a command' : 'Joints, segments', [...numbered('u', 12, k => `command ${k}`), ...numbered('y', 8, k => `measured ${k}`)]],
];
const MACHINES = { snake: 'a snake', joints: 'joints', segments: 'segments in series', force: 'joints with a torque or a current' };
const UNITS = ['s', 'ms', 'us', 'ns', 'm', 'cm', 'mm', 'um', 'rad', 'mrad', 'deg', 'n', 'mn', 'kn'];
// Without a unit of the file's own, the lab's.
const OWN = [[/^time$/, 's'], [/^q\d$/, 'm'], [/^(bend_[xy]|theta_l|delta)$/, 'rad'], [/^tau\d$/, 'n']];

/// Hands a file over: the name that it was given, another one where its own was taken, and what is said of that; null where it was not
/// taken. `back` shows what stood here before.
export async function handedOver(file, back) {
  sayAtWork(`Taking ${file.name} …`, 'It goes into the lab’s folder.');
  const name = file.name.replace(/[^A-Za-z0-9._-]/g, '-').replace(/^[.-]+/, '');
  const refused = why => { say('The file was not taken.', why, [], [prime('Back', back)]); return null; };
  try {
    const answer = await fetch(`/lab/data/${encodeURIComponent(name)}`, { method: 'POST', body: file });
    if (!answer.ok) return refused(await answer.text());
    const { name: given, is_new: isNew } = await answer.json();
    const says = !isNew ? `The same file was here already, as ${given}.` : given !== name ? `Kept as ${given}: the name ${name} was taken.` : given !== file.name ? `Kept as ${given}.` : '';
    return { name: given, says };
  } catch { return refused('The console does not answer.'); }
}

/// The model to go on with when the columns are named; null where it came to nothing.
export async function nameColumns(data, back) {
  const seen = await run({ verb: 'columns', data, map: [] }, `Looking at ${data} …`, back);
  return seen ? new Promise(done => ask(data, seen, back, done)) : null;
}

/// `seen` is the lab's newest answer that named a machine, or the first; `before` is what was chosen and refused.
function ask(data, seen, back, done, complaint = firstWords(seen.refused), before = null) {
  const rows = seen.columns.map((column, i) => row(column, seen.kind, before?.[i]));
  const titles = make('tr', '', ...['column', 'is', 'unit', 'range', 'why'].map((name, i) => make('th', i === 3 ? 'n' : '', name)));
  const said = make('p', 'complaint', ...named(complaint));
  said.setAttribute('role', 'alert');
  const notes = [...(seen.pairs ?? []), ...(seen.cautions ?? []).map(caution => `Caution: ${caution}`)];
  const table = make('table', 'columns', make('thead', '', titles), make('tbody', '', ...rows.map(({ element }) => element)));
  const [title, detail] = seen.refused
    ? ['What are these columns?', `The lab cannot tell from the names in ${data}. Say what each column is.`]
    : ['Is this what the columns are?', `${data} is of ${MACHINES[seen.kind]}: ${seen.rows} rows in ${seen.duration_s.toFixed(1)} s. What you use is kept beside the file.`];
  say(title, detail, [said, table, ...(notes.length ? [make('ul', 'notes', ...notes.map(note => make('li', '', note)))] : [])], [prime('Use these columns', use), second('Leave it', () => { back(); done(null); })]);

  async function use() {
    const chosen = rows.map(({ value }) => value());
    if (!seen.refused && !before && rows.every(({ isChanged }) => !isChanged())) { keep(); return; }
    const map = chosen.flatMap((own, i) => own.is && !isUnsaid(own.is) ? [argument(own, seen.columns[i])] : []);
    const next = await run({ verb: 'columns', data, map }, 'Reading every row with these columns …', () => ask(data, seen, back, done, '', chosen));
    if (!next) return;
    if (next.refused) { ask(data, seen, back, done, next.refused, chosen); return; }
    // What the lab takes all the same is shown before it is kept.
    const stays = next.columns.filter((column, i) => base(column.is) !== chosen[i].is);
    if (stays.length) ask(data, next, back, done, `The lab takes ${stays.map(column => `“${column.name}” for ${column.is ?? 'nothing'}`).join(', ')} all the same.`);
    else keep();
  }

  async function keep() {
    try {
      const answer = await fetch(`/lab/columns/${encodeURIComponent(data)}`, { method: 'POST' });
      if (answer.ok) done((await answer.json()).model);
      else said.replaceChildren(...named(await answer.text()));
    } catch { said.replaceChildren('The console does not answer.'); }
  }
}

/// What is said before anything is chosen: that no machine was recognised, the title says already.
const firstWords = refused => refused && !refused.includes('was recognised in the columns') ? refused : '';

/// A column that the lab finds by itself and has no name for that could be said.
const isUnsaid = is => /^i\d$/.test(is);

/// `q1_mm=Motor left:mm`, as the command line has it. A unit that the lab does not convert stands in the name alone.
function argument({ is, unit }, { name }) {
  const own = unit || OWN.find(([pattern]) => pattern.test(is))?.[1];
  return `${is}${own ? `_${own}` : ''}=${name}${UNITS.includes(unit) ? `:${unit}` : ''}`;
}

/// A lab column's name without its unit: `bend_x` of `bend_x_rad`.
function base(is) {
  return is === null ? '' : /^(time|trial|[a-z]+\d+|bend_[xy]|theta_l|delta)/.exec(is)?.[0] ?? is;
}

function row(column, kind, before) {
  const is = select(`What ${column.name} is`, before?.is ?? base(column.is), meanings(kind));
  const unit = select(`Unit of ${column.name}`, before?.unit ?? column.unit, [['', [['', 'as the name says'], ...UNITS.map(name => [name, name])]]]);
  const digits = value => Number(value.toPrecision(4));
  const range = column.least === null ? '–' : `${digits(column.least)} to ${digits(column.largest)}`;
  return {
    element: make('tr', '', make('th', '', column.name), make('td', '', is), make('td', '', unit), make('td', 'n', range), make('td', '', column.why)),
    value: () => ({ is: is.value, unit: unit.value }),
    isChanged: () => is.value !== base(column.is) || unit.value !== column.unit,
  };
}

function select(label, value, groups) {
  const made = document.createElement('select');
  made.setAttribute('aria-label', label);
  const option = ([name, words]) => Object.assign(make('option', '', words), { value: name });
  const isKnown = groups.some(([, all]) => all.some(([name]) => name === value));
  if (!isKnown) made.append(option([value, value]));
  for (const [title, all] of groups) {
    const options = all.map(option);
    if (title) made.append(Object.assign(make('optgroup', '', ...options), { label: title }));
    else made.append(...options);
  }
  made.value = value;
  return made;
}
