// Latency: where a sample's time goes, beside what it may take; the processes; the last minute.
import { machineFindings } from './doctor.js';
import { drawing, make, micros, thousands, write } from './format.js';
import { MARKS } from './states.js';
import { on } from './link.js';

const page = document.getElementById('latency');
const N_BINS = 50, DECADES = ['1 µs', '10 µs', '100 µs', '1 ms', '10 ms'];
let hello = null, glasses = [], hops = [], tiles = {}, procs = null, history = null, lossDetail = null;

const bar = us => Math.max(0, Math.min(N_BINS, Math.log10(Math.max(1, us)) * 10));

on('hello', message => { hello = message.hello; build(); });
on('frame', ({ glass, isPainted }) => { if (isPainted) { glasses.push(glass); if (glasses.length > 600) glasses.shift(); } });
on('slow', ({ message }) => { if (hello && !page.hidden) show(message); });

function tile(name, title) {
  const [number, note, box] = [make('b', 'num'), make('em'), make('div')];
  box.append(make('span', '', title), number, note);
  tiles[name] = { box, number, note };
  return box;
}

function set(name, number, note, isOver = false) {
  const { box, number: big, note: small } = tiles[name];
  write(big, number);
  write(small, note);
  box.classList.toggle('over', isOver);
}

function build() {
  const head = make('section', 'card tiles', tile('median', 'Hand to drive, median'), tile('most', '99 of 100 within'), tile('late', 'Late samples'), tile('lost', 'Lost samples'), tile('glass', 'Robot to this picture'), tile('pages', 'Pages open'));
  const table = make('table');
  const axis = DECADES.map((name, i) => `<text x="${20 * i}%" y="14">${name}</text>`).join('');
  const titles = make('tr', '', make('th', '', 'hop'), make('th', '', drawing('', axis)));
  titles.querySelector('svg').removeAttribute('viewBox');
  titles.querySelector('svg').setAttribute('class', 'axis');
  for (const name of ['median', 'p99', 'worst']) titles.append(make('th', 'n', name, make('em', '', 'budget')));
  titles.append(make('th'));
  hops = hello.stretches.map(name => {
    const row = { picture: make('td'), cells: ['', '', ''].map(() => ({ number: make('b'), budget: make('em') })), verdict: make('td', 'verdict') };
    row.element = make('tr', '', make('th', '', name), row.picture, ...row.cells.map(({ number, budget }) => make('td', 'n', number, budget)), row.verdict);
    return row;
  });
  table.append(make('thead', '', titles), make('tbody', '', ...hops.map(({ element }) => element)));
  const keys = make('div', 'keys', make('span', '', make('i'), 'median'), make('span', '', make('i', 'allowed'), 'budget of the median, and of p99 (dashed)'), make('span', '', make('i', 'box'), 'beyond the budget of p99'));
  const count = make('em');
  tiles.count = { number: count };
  const where = make('section', 'card hops', make('h2', '', 'Where a sample’s time goes ', count), table, keys);
  procs = make('tbody');
  const columns = ['process', 'pid', 'CPU', 'memory', 'lost', 'refused', 'restarts', ''];
  const titleRow = make('tr', '', ...columns.map((name, i) => make('th', i === 0 || i === 7 ? '' : name === 'pid' ? 'n pid' : 'n', name)));
  lossDetail = make('em');
  const processes = make('section', 'card procs', make('h2', '', 'Processes ', lossDetail), make('table', '', make('thead', '', titleRow), procs), machineFindings);
  // Where it is longer than its place, the arrow keys scroll it.
  processes.tabIndex = 0;
  processes.setAttribute('aria-label', 'Processes, and this machine');
  history = make('div', 'history-picture');
  const past = make('section', 'card history', make('h2', '', 'Hand to drive, last 60 s ', make('em', '', 'median, p99 and worst of each second')));
  history = past;
  page.replaceChildren(head, where, processes, past);
}

function show({ latency, processes, n_lost_here, n_pages, n_skipped }) {
  const whole = latency.stretches.at(-1), budget = hello.facts.budgets.at(-1);
  const n = thousands(latency.n);
  write(tiles.count.number, latency.n ? `all ${n} samples since this page’s server began; logarithmic axis` : 'no sample yet');
  const figure = value => latency.n ? micros(value) : '–';
  set('median', figure(whole.p50_us), `budget ${micros(budget.p50_us)}`, whole.p50_us > budget.p50_us);
  set('most', figure(whole.p99_us), `budget ${micros(budget.p99_us)}`, whole.p99_us > budget.p99_us);
  set('late', thousands(latency.n_late), `beyond ${micros(budget.worst_us)}, of ${n}`, latency.n_late > 0);
  const lost = processes.reduce((sum, process) => sum + (process.n_lost ?? 0), 0);
  set('lost', thousands(lost), `by the processes; ${thousands(n_lost_here)} here`, lost > 0);
  const sorted = [...glasses].sort((a, b) => a - b);
  set('glass', sorted.length ? `${sorted[sorted.length >> 1].toFixed(0)} ms` : '–', 'median of those painted; goal 30 ms');
  set('pages', String(n_pages), `${thousands(n_skipped)} pictures skipped by slow ones`);
  hops.forEach((row, i) => hop(row, latency.stretches[i], hello.facts.budgets[i], latency.n));
  procs.replaceChildren(...processes.flatMap(processRow));
  past(latency.seconds, budget);
}

function hop(row, stretch, budget, n) {
  const most = Math.max(1, ...stretch.bins), height = count => count ? Math.max(1.5, 38 * count / most) : 0;
  const bins = stretch.bins.map((count, i) => count ? `M${i + 0.08} 40v${-height(count)}h.84v${height(count)}z` : '').join('');
  const at = (us, className) => `<path class="${className}" d="M${bar(us)} 0V40"/>`;
  const grid = [0, 1, 2, 3, 4].map(i => `M${10 * i} 0V40`).join('');
  const inner = `<rect class="beyond" x="${bar(budget.p99_us)}" y="0" width="${N_BINS - bar(budget.p99_us)}" height="40"/><path class="grid" d="${grid}"/><path class="bins" d="${bins}"/>${n ? at(stretch.p50_us, 'median') : ''}${at(budget.p50_us, 'allowed')}${at(budget.p99_us, 'allowed dashed')}`;
  const picture = drawing(`0 0 ${N_BINS} 40`, inner);
  picture.setAttribute('class', 'histogram');
  picture.setAttribute('preserveAspectRatio', 'none');
  row.picture.replaceChildren(picture);
  [['p50_us'], ['p99_us'], ['worst_us']].forEach(([key], i) => {
    write(row.cells[i].number, n ? micros(stretch[key]) : '–');
    write(row.cells[i].budget, micros(budget[key]));
  });
  const isOver = ['p50_us', 'p99_us', 'worst_us'].some(key => stretch[key] > budget[key]);
  verdict(row.verdict, !n ? 'info' : isOver ? 'warn' : 'ok', !n ? 'no sample' : isOver ? 'over' : 'within');
}

function verdict(cell, level, text) {
  if (cell.dataset.key === level + text) return;
  cell.dataset.key = level + text;
  cell.className = `verdict ${level}`;
  cell.replaceChildren(make('i', '', drawing(MARKS[level].box, MARKS[level].inner)), make('span', '', text));
}

function processRow(process) {
  const number = (value, digits = 0) => value === null ? '–' : digits ? value.toFixed(digits) : thousands(value);
  const cell = (text, className = 'n') => make('td', className, text);
  const well = process.says ? [process.level, process.level === 'fault' ? 'fault' : 'look'] : process.is_silent ? ['warn', 'silent'] : ['ok', 'well'];
  const says = make('td');
  verdict(says, ...well);
  const row = make('tr', '', make('th', '', process.name), cell(String(process.pid), 'n pid'), cell(process.cpu_percent === null ? '–' : `${process.cpu_percent.toFixed(1)} %`), cell(process.memory_bytes === null ? '–' : `${(process.memory_bytes / 1e6).toFixed(0)} MB`), cell(number(process.n_lost)), cell(number(process.n_refused)), cell(number(process.n_restarts)), says);
  if (!process.says) return [row];
  const why = make('td', 'why-so', process.says);
  why.colSpan = 8;
  row.className = 'has-why';
  return [row, make('tr', '', why)];
}

function past(seconds, budget) {
  // As large as its place is, so that its letters are as large as others.
  const old = history.querySelector('svg'), [left, low] = [62, 22];
  const [width, height] = old?.clientWidth ? [old.clientWidth, old.clientHeight] : [540, 170];
  const known = seconds.filter(Boolean);
  const top = Math.max(budget.p99_us, ...known.map(s => s.worst_us), 1000) * 1.3, bottom = Math.min(10, ...known.map(s => s.p50_us));
  const x = i => left + (width - left) * (60 - seconds.length + i + 1) / 60;
  const y = us => 6 + (height - low - 6) * (1 - Math.log10(us / bottom) / Math.log10(top / bottom));
  const line = key => seconds.map((s, i) => s ? `${i && seconds[i - 1] ? 'L' : 'M'}${x(i).toFixed(1)} ${y(s[key]).toFixed(1)}` : '').join('');
  let grid = '';
  for (let us = 10 ** Math.ceil(Math.log10(bottom)); us < top; us *= 10) grid += `<path class="grid" d="M${left} ${y(us)}H${width}"/><text x="${left - 8}" y="${y(us) + 4}" text-anchor="end">${micros(us).replace('.0', '')}</text>`;
  for (const s of [60, 40, 20, 0]) grid += `<text x="${left + (width - left) * (60 - s) / 60}" y="${height - 4}" text-anchor="${s === 0 ? 'end' : s === 60 ? 'start' : 'middle'}">${s ? `−${s} s` : 'now'}</text>`;
  const picture = drawing(`0 0 ${width} ${height}`, `${grid}<path class="allowed" d="M${left} ${y(budget.p99_us)}H${width}"/><path class="worst" d="${line('worst_us')}"/><path class="p99" d="${line('p99_us')}"/><path class="p50" d="${line('p50_us')}"/>`);
  if (old) old.replaceWith(picture); else history.append(picture);
}
