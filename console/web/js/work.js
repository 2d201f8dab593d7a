// The lab's place of work: a sentence, what stands under it and buttons; and a job with its progress, its end, and what waits for that.
import { make, write } from './format.js';

export const work = make('section', 'card work');
/// A job is looked at so often; a look may take so long, and a console that does not answer is asked again for so long.
const LOOK_EVERY_MS = 400, LOOK_MS = 5000, PATIENCE_MS = 20_000;
const HOLDS = 'This waits: what the job was ordered for stays as it is. Cancel the job, or wait for its end.';
const SILENT = 'The console does not answer.';
const waits = make('p', 'job-says waits'), listeners = [];
waits.setAttribute('role', 'status');
// What goes on here, and the jobs that this page follows, those of Recordings too.
let nHeld = 0, nFollowed = 0;

/// A sentence whose files have their names only; where each lies is its title.
export function named(text) {
  return String(text ?? '').split(/((?:\/[^\s"'`:,;()]+)+\/[^\s"'`:,;()/]+)/).map((part, i) => {
    if (i % 2 === 0) return part;
    const name = make('span', 'file', part.split('/').at(-1));
    name.title = part;
    return name;
  });
}

/// A sentence, what stands under it, and buttons. Whoever works by keyboard goes on from the sentence.
export function say(title, detail, content = [], buttons = []) {
  const isHere = work.contains(document.activeElement), head = make('h1', '', title);
  head.tabIndex = -1;
  work.replaceChildren(make('div', 'ask', head, make('p', '', ...named(detail))), ...content, make('div', 'acts', ...buttons));
  if (isHere) head.focus();
}

function button(className, text, act) {
  const made = make('button', className, text);
  if (act) made.addEventListener('click', act);
  return made;
}

export const prime = (text, act) => button('prime', text, act);
export const second = (text, act) => button('second', text, act);

export function reportLink(verb, text = 'Pictures') {
  const link = make('a', 'second', text);
  Object.assign(link, { href: `/lab/report/${verb}`, target: '_blank', rel: 'noopener' });
  return link;
}

export const tile = (title, number, note = '') => make('div', '', make('span', '', title), make('b', 'num', number), make('em', '', note));

/// Hears that what was chosen is held, and that it is not any more.
export const onHeld = listener => { listeners.push(listener); };
export const isHeld = () => nHeld > 0;

function hold(change) {
  const before = isHeld();
  nHeld += change;
  if (isHeld() !== before) listeners.forEach(listener => listener(isHeld()));
}

/// What was chosen stays as it is until `act` has ended.
export async function holding(act) {
  hold(1);
  try { return await act(); } finally { hold(-1); }
}

/// Whether what was chosen is held; whoever wanted to change it is told so.
export function isRefused(words = HOLDS) {
  if (isHeld()) write(waits, words);
  return isHeld();
}

/// What is said while something goes on: what is refused meanwhile is told here.
export function sayAtWork(title, detail, content = [], buttons = []) {
  write(waits, '');
  say(title, detail, [...content, waits], buttons);
}

/// A job as it is shown; what it gives hears the job's progress.
function shown(title, detail) {
  const said = make('p', 'job-says'), bar = document.createElement('progress'), from = performance.now();
  bar.setAttribute('aria-label', title);
  const cancel = second('Cancel', () => fetch('/lab/cancel', { method: 'POST' }).catch(() => write(waits, SILENT)));
  sayAtWork(title, detail, [make('div', 'job', bar, said)], [cancel]);
  return words => write(said, `${((performance.now() - from) / 1000).toFixed(0)} s  ${words}`);
}

const without = (stage, said) => ({ stage, said, answer: null });

/// The job that runs or was the last, null where there was none; nothing where the console does not answer.
async function newest() {
  try {
    const answer = await fetch('/lab/job', { signal: AbortSignal.timeout(LOOK_MS) });
    return answer.ok ? await answer.json() : undefined;
  } catch { return undefined; }
}

/// Looks at a job until it has ended.
async function followed(id, tell) {
  for (let heard = performance.now();;) {
    await new Promise(resume => setTimeout(resume, LOOK_EVERY_MS));
    const job = await newest();
    if (job === undefined && performance.now() - heard > PATIENCE_MS) return without('failed', `${SILENT} The job may go on; it is shown here once the console answers again.`);
    if (job === undefined) { tell(`${SILENT} It is asked again …`); continue; }
    if (job === null) return without('failed', 'The console has begun anew, and the job has ended.');
    // The console keeps one job, and the next one may be another page's.
    if (job.id !== id) return without('failed', 'Another page has begun another job, and the answer of this one is gone.');
    heard = performance.now();
    tell(job.said);
    if (job.stage !== 'running') return job;
  }
}

/// Has a job done: its report when it has ended, `refused` where it could not begin. `tell` hears its progress.
export async function ended(order, tell) {
  nFollowed += 1;
  try {
    const started = await fetch('/lab/job', { method: 'POST', body: JSON.stringify(order) });
    if (!started.ok) return without('refused', await started.text());
    return await followed((await started.json()).id, tell);
  } catch { return without('failed', SILENT); } finally { nFollowed -= 1; }
}

/// Has a job done and gives its answer; null where there is none, which is said. `back` shows what stood here before.
export const run = (order, title, back) => holding(async () => {
  const tell = shown(title, 'The same code as the command; at low priority, so that the robot’s processes come first.');
  const job = await ended(order, tell);
  if (job.stage === 'done') return job.answer;
  if (job.stage === 'cancelled') say('Cancelled.', 'Its process has ended.', [], [prime('Again', back)]);
  // A job that was lost, or one of another page, is shown instead while it runs.
  else say(job.stage === 'refused' ? 'This could not be started.' : 'This could not be done.', job.said.replace(/^krait: /, ''), [], [prime('Back', () => { back(); showLost(back); })]);
  return null;
});

/// Shows the job that runs and that this page does not follow, if there is one: it was begun before the page was loaded, or by another page.
/// `back` goes on from its end.
export async function showLost(back) {
  const isOurs = () => isHeld() || nFollowed > 0;
  if (isOurs()) return;
  const job = await newest();
  if (job?.stage !== 'running' || isOurs()) return;
  await holding(async () => {
    const [name] = /^krait(?: [a-z][a-z-]*)*/.exec(job.command), verb = /^krait lab (compare|diagnose|add|fit)\b/.exec(name)?.[1];
    const tell = shown(`${name} is at work.`, `It was begun before this page was loaded, or by another page: ${job.command}`);
    const { stage, said } = await followed(job.id, tell);
    const [title, detail] = { done: ['The job has ended.', 'What it wrote is in the lab’s folder. For its answer here, have it done again.'], cancelled: ['Cancelled.', 'Its process has ended.'] }[stage] ?? ['The job has failed.', said.replace(/^krait: /, '')];
    say(title, detail, [], [prime('Go on', back), ...(stage === 'done' && verb ? [reportLink(verb)] : [])]);
  });
}
