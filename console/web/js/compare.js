// Two recordings over their common time: the verdict, the table and the pictures of krait compare.
import { make } from './format.js';
import { ended, prime, second } from './work.js';

const TITLES = { 'tracking.svg': 'Tracking error', 'bend.svg': 'Bend of the setpoint', 'measured.svg': 'Bend that was measured', 'latency.svg': 'Latency from the device to the drive' };
const plain = name => name.replace(/\.mcap$/, '');
const upper = text => text.charAt(0).toUpperCase() + text.slice(1);

/// The place of a comparison; `close` brings back what stood there before.
export class CompareView {
  constructor(close) {
    this.close = close;
    this.element = make('section', 'card compared');
    this.element.tabIndex = 0;
    this.element.setAttribute('aria-label', 'Comparison of two recordings');
    this.element.hidden = true;
    this.n = 0;
  }

  fill(title, content, buttons) {
    const says = make('h1', '', title);
    says.setAttribute('role', 'status');
    this.element.replaceChildren(make('div', 'ask', says), ...content, make('div', 'acts', ...buttons));
  }

  async show(a, b, passes = [1, 1]) {
    this.element.hidden = false;
    const turn = this.n += 1, said = make('p', 'job-says'), close = () => { this.n += 1; this.close(); };
    this.fill(`Comparing ${plain(a)} with ${plain(b)} …`, [said], [second('Cancel', () => fetch('/lab/cancel', { method: 'POST' }))]);
    const job = await ended({ verb: 'compare-recordings', a, b, pass_a: passes[0], pass_b: passes[1] }, words => { said.textContent = words; });
    // Somebody has gone on to another recording by now.
    if (turn !== this.n) return;
    const back = prime('Back to the pictures', close);
    if (job.stage !== 'done') {
      const why = job.stage === 'cancelled' ? 'Its process has ended.' : job.said.replace(/^krait: /, '');
      this.fill(job.stage === 'cancelled' ? 'Cancelled.' : 'These two could not be compared.', [make('p', '', why)], [back]);
      return;
    }
    this.answer(job, [a, b], back);
  }

  answer({ id, answer }, names, back) {
    const sides = [answer.a, answer.b], rerun = passes => this.show(...names, passes);
    const who = sides.map((side, i) => make('p', 'which', make('b', '', `${'AB'[i]}: `), plain(names[i]), ...pass(side, i, sides, rerun), ...side.missing.map(what => make('em', 'odd', ` Not whole: ${what}`))));
    const rows = answer.figures.map(({ name, a, b, difference }) => make('tr', '', make('th', '', name), ...[a, b, difference].map(text => make('td', 'n', text))));
    const head = make('tr', '', make('th', '', ''), ...['A', 'B', 'B − A'].map(text => make('th', 'n', text)));
    const marks = sides.flatMap((side, i) => side.marks.map(({ at_s: at, text }) => make('li', '', make('b', 'num', `${'AB'[i]} ${at.toFixed(1)} s `), text)));
    const pictures = answer.pictures.map(path => path.split('/').at(-1)).filter(file => TITLES[file]).map(file => {
      const picture = make('img');
      Object.assign(picture, { src: `/lab/compared/${file}?job=${id}`, alt: `${TITLES[file]} of A and B over the time since the first motion` });
      return picture;
    });
    this.fill(upper(answer.verdict), [...who, make('p', '', `${answer.apart_says}.`), make('div', 'shots', ...pictures), make('table', 'figures', make('thead', '', head), make('tbody', '', ...rows)), ...(marks.length ? [make('h2', '', 'Marks ', make('em', '', 'since the first motion')), make('ul', 'marked', ...marks)] : [])], [back]);
  }
}

/// Which of the chains that ran in a recording, where it holds several.
function pass(side, i, sides, rerun) {
  if (side.n_passes < 2) return [];
  const select = document.createElement('select');
  select.setAttribute('aria-label', `Chain of ${'AB'[i]}`);
  for (let n = 1; n <= side.n_passes; n += 1) select.append(new Option(`chain ${n} of ${side.n_passes}`, n, false, n === side.pass));
  select.addEventListener('change', () => rerun(sides.map((own, k) => k === i ? Number(select.value) : own.pass)));
  return [' ', select];
}
