// Joints: a bar for each, from its lower to its upper limit, with where it is, where it shall be, and how far it is off.
// Segments in series: two bars each, for the two components of its bend vector, beside the picture of their arcs.
import { make, sign, signed, write } from './format.js';

/// What each bar is called: the joint's number, or segment and component.
const namesOf = facts => facts.joints.low.map((_, i) => facts.joints.segments.length ? `${Math.floor(i / 2) + 1}${'xy'[i % 2]}` : String(i + 1));

export class JointBars {
  /// Fills an element with one row for each joint; `facts` has limits and the unit that is shown.
  constructor(holder, facts) {
    this.holder = holder;
    this.facts = facts;
    const names = namesOf(facts);
    const digits = facts.unit === 'deg' ? 0 : 1;
    this.rows = facts.joints.low.map((low, i) => {
      const [seen, told, zero] = [make('div', 'seen'), make('div', 'told'), make('div', 'zero')];
      const [off, at] = [make('span', 'off num'), make('b', 'num')];
      const [from, to] = [low, facts.joints.high[i]].map(value => make('small', 'num', signed(value * facts.per_si, digits)));
      const row = make('div', 'joint', make('span', 'id', names[i]), make('div', 'track', zero, seen, told), at, make('div', 'ends', from, to), off);
      zero.style.left = `${100 * this.part(0, i)}%`;
      return { row, seen, told, off, at };
    });
    holder.replaceChildren(...this.rows.map(({ row }) => row));
  }

  /// Where a position lies between a joint's limits, 0 to 1.
  part(value, i) {
    const [low, high] = [this.facts.joints.low[i], this.facts.joints.high[i]];
    return Math.max(0, Math.min(1, (value - low) / (high - low)));
  }

  /// Bars, with each picture.
  move({ wanted, measured }) {
    this.rows.forEach(({ seen, told }, i) => {
      told.hidden = !wanted;
      if (wanted) told.style.left = `${100 * this.part(wanted[i], i)}%`;
      seen.hidden = !measured;
      if (measured) seen.style.left = `${100 * this.part(measured[i], i)}%`;
    });
  }

  /// Numbers, ten times a second.
  write({ wanted, measured, err_rms }) {
    const show = value => `${signed(value * this.facts.per_si, 2)}${sign(this.facts.unit)}`;
    this.rows.forEach(({ at, off }, i) => {
      write(at, measured ? show(measured[i]) : 'not measured');
      write(off, err_rms ? `off ${(err_rms[i] * this.facts.per_si).toFixed(2)}` : '');
    });
    const [names, kind] = [namesOf(this.facts), this.facts.joints.segments.length ? 'components of bend vectors' : 'joints'];
    const told = this.rows.map((_, i) => `${kind === 'joints' ? 'joint' : 'segment'} ${names[i]} ${measured ? show(measured[i]) : 'not measured'}, wanted ${wanted ? show(wanted[i]) : 'nothing'}`);
    this.holder.setAttribute('aria-label', `${this.rows.length} ${kind}: ${told.join('; ')}.`);
  }

  /// What was shown is too old.
  blank() {
    this.move({ wanted: null, measured: null });
    for (const { at, off } of this.rows) { write(at, '–'); write(off, ''); }
  }
}
