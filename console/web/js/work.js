// The lab's place of work: a sentence, what stands under it and buttons; and a job with its progress and its end.
import { make, write } from './format.js';

export const work = make('section', 'card work');
let isBusy = false;

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

/// Has a job done: its report when it has ended, `refused` where it could not begin. `tell` hears its progress.
export async function ended(order, tell) {
  const without = (stage, said) => ({ stage, said, answer: null });
  try {
    const started = await fetch('/lab/job', { method: 'POST', body: JSON.stringify(order) });
    if (!started.ok) return without('refused', await started.text());
    const { id } = await started.json();
    for (;;) {
      await new Promise(resume => setTimeout(resume, 400));
      const job = await (await fetch('/lab/job')).json();
      // The console keeps one job, and the next one may be another page's.
      if (job?.id !== id) return without('failed', 'Another page has begun another job, and the answer of this one is gone.');
      tell(job.said);
      if (job.stage !== 'running') return job;
    }
  } catch { return without('failed', 'The console does not answer.'); }
}

/// Has a job done and gives its answer; null where there is none, which is said. `back` shows what stood here before.
export async function run(order, title, back) {
  if (isBusy) { say('Another job is at work.', 'Wait for it; its answer appears here.'); return null; }
  isBusy = true;
  const said = make('p', 'job-says'), bar = document.createElement('progress');
  bar.setAttribute('aria-label', title);
  const cancel = second('Cancel', () => fetch('/lab/cancel', { method: 'POST' }));
  say(title, 'The same code as the command; at low priority, so that the robot’s processes come first.', [make('div', 'job', bar, said)], [cancel]);
  const from = performance.now();
  const job = await ended(order, words => write(said, `${((performance.now() - from) / 1000).toFixed(0)} s  ${words}`));
  isBusy = false;
  if (job.stage === 'done') return job.answer;
  if (job.stage === 'cancelled') say('Cancelled.', 'Its process has ended.', [], [prime('Again', back)]);
  else say(job.stage === 'refused' ? 'This could not be started.' : 'This could not be done.', job.said.replace(/^krait: /, ''), [], [prime('Back', back)]);
  return null;
}
