// The lab's place of work: a sentence, what stands under it and buttons; and a job with its progress and its end.
import { make, write } from './format.js';

export const work = make('section', 'card work');
let isBusy = false;

/// A sentence, what stands under it, and buttons. Whoever works by keyboard goes on from the sentence.
export function say(title, detail, content = [], buttons = []) {
  const isHere = work.contains(document.activeElement), head = make('h1', '', title);
  head.tabIndex = -1;
  work.replaceChildren(make('div', 'ask', head, make('p', '', detail)), ...content, make('div', 'acts', ...buttons));
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

/// Has a job done and gives its answer; null where there is none, which is said. `back` shows what stood here before.
export async function run(order, title, back) {
  if (isBusy) { say('Another job is at work.', 'Wait for it; its answer appears here.'); return null; }
  isBusy = true;
  try {
    const started = await fetch('/lab/job', { method: 'POST', body: JSON.stringify(order) });
    if (!started.ok) { say('This could not be started.', await started.text(), [], [prime('Back', back)]); return null; }
    const said = make('p', 'job-says'), bar = document.createElement('progress');
    bar.setAttribute('aria-label', title);
    const cancel = second('Cancel', () => fetch('/lab/cancel', { method: 'POST' }));
    say(title, 'The same code as the command; at low priority, so that the robot’s processes come first.', [make('div', 'job', bar, said)], [cancel]);
    const from = performance.now();
    for (;;) {
      await new Promise(resume => setTimeout(resume, 400));
      const job = await (await fetch('/lab/job')).json();
      write(said, `${((performance.now() - from) / 1000).toFixed(0)} s  ${job.said}`);
      if (job.stage === 'done') return job.answer;
      if (job.stage === 'cancelled') { say('Cancelled.', 'Its process has ended.', [], [prime('Again', back)]); return null; }
      if (job.stage === 'failed') { say('This could not be done.', job.said.replace(/^krait: /, ''), [], [prime('Back', back)]); return null; }
    }
  } finally { isBusy = false; }
}
