// The tracking error before and after the chain took another model: measured while it follows, side by side, live.
import { make, sign, write } from './format.js';
import { on } from './link.js';

/// Pictures that a figure rests on: the last ten seconds of following.
const MOST = 600, FEWEST = 60;
let errors = [], follows = 0, running = null, facts = null;
const meters = new Set();

on('hello', ({ hello }) => { facts = hello.facts; });
on('slow', ({ message }) => { running = message.model; });
on('frame', ({ frame }) => {
  // The error is that of a second: what lies in it from before the snake followed is no error of the model.
  follows = ['following', 'limited'].includes(frame.shown) ? follows + 1 : 0;
  if (follows > 120 && frame.err_rms !== null) errors.push(frame.err_rms * facts.per_si);
  if (errors.length > MOST) errors.shift();
  for (const meter of meters) meter.show();
});

const rms = () => errors.length < FEWEST ? null : Math.sqrt(errors.reduce((sum, e) => sum + e * e, 0) / errors.length);
const said = value => value === null ? '–' : `${value.toFixed(2)}${sign(facts.unit)}`;

/// The figures of one exchange; it begins with those of before.
export class ErrorMeter {
  constructor() {
    this.before = rms();
    this.hash = null;
    [this.was, this.is] = [make('b', 'num', said(this.before)), make('b', 'num', '–')];
    this.fills = [make('i'), make('i')];
    this.sentence = make('p', 'run-says');
    const row = (name, value, fill) => make('div', '', make('span', '', name), make('div', 'track', fill), value);
    this.element = make('div', 'run-error', make('div', 'where', row('before', this.was, this.fills[0]), row('now', this.is, this.fills[1])), this.sentence);
  }

  /// The chain goes on with the model of this hash.
  exchanged(hash) {
    this.hash = hash;
    [errors, follows] = [[], 0];
    meters.clear();
    meters.add(this);
    this.show();
  }

  show() {
    const now = running === this.hash ? rms() : null, top = Math.max(this.before ?? 0, now ?? 0) || 1;
    write(this.is, said(now));
    [this.before, now].forEach((value, i) => { this.fills[i].style.width = `${100 * (value ?? 0) / top}%`; });
    write(this.sentence, running !== this.hash ? 'Waiting for the first command that rests on it.'
      : now === null ? 'The commands rest on it. The figure comes after some seconds of following: take hold anew.'
      : this.before === null ? `The tracking error is ${said(now)}; before, nothing followed.` : `The tracking error was ${said(this.before)}; it is ${said(now)} now.`);
  }
}
