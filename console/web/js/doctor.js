// What this machine lacks for a punctual chain: krait doctor's findings as sentences, the worst first.
import { drawing, make } from './format.js';
import { MARKS } from './states.js';
import { second } from './work.js';

const LEVELS = { bad: ['fault', 'A chain cannot run: '], advice: ['warn', 'Could be better: '], good: ['ok', 'Good: '] };
const list = make('ul', 'findings'), ask = second('Ask again', () => askDoctor());
let isAsked = false;

const row = (mark, ...words) => make('li', mark, make('i', '', drawing(MARKS[mark].box, MARKS[mark].inner)), make('span', '', ...words));
const ended = text => text + (/[.!?]$/.test(text) ? '' : '.');
const sentenceOf = text => ended(text.charAt(0).toUpperCase() + text.slice(1));

function sentence({ name, verdict, found, meaning, mend }) {
  const [mark, word] = LEVELS[verdict];
  return row(mark, make('b', '', word), `${name}: ${ended(found)} ${sentenceOf(meaning)}`, ...(mend ? [` To mend it: ${ended(mend).replace(/`/g, '')}`] : []));
}

/// Asks, and again whenever somebody wants it.
async function askDoctor() {
  if (ask.getAttribute('aria-disabled') === 'true') return;
  ask.setAttribute('aria-disabled', 'true');
  list.setAttribute('aria-busy', 'true');
  try {
    const answer = await fetch('/doctor');
    list.replaceChildren(...(answer.ok ? (await answer.json()).findings.map(sentence) : [row('warn', await answer.text())]));
  } catch { list.replaceChildren(row('warn', 'The console does not answer.')); }
  list.setAttribute('aria-busy', 'false');
  ask.setAttribute('aria-disabled', 'false');
}

/// It stays when the page around it is built anew.
export const machineFindings = make('div', 'doctor', make('div', '', make('h2', '', 'This machine ', make('em', '', 'krait doctor')), ask), list);

/// The first time that somebody looks.
export function showLatency() {
  if (isAsked) return;
  isAsked = true;
  askDoctor();
}
