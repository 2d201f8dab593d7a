// The tracking error before and after the chain took another model: measured while it follows, side by side, live.
import { make, sign, write } from './format.js';
import { on } from './link.js';

/// A figure rests on the last ten seconds of following, and on one at least; a screen may have any number of pictures a second.
const LAST_MS = 10_000, LEAST_MS = 1000, EASED_IN_MS = 2000;
let errors = [], followsSince = null, running = null, facts = null;
const meters = new Set();

on('hello', ({ hello }) => { facts = hello.facts; });
on('slow', ({ message }) => { running = message.model; });
on('frame', ({ frame }) => {
  const now = frame.t_ms;
  if (!['following', 'limited'].includes(frame.shown)) followsSince = null;
  else followsSince ??= now;
  // The error is that of a second: what lies in it from before the snake followed is no error of the model.
  if (followsSince !== null && now - followsSince > EASED_IN_MS && frame.err_rms !== null && now > (errors.at(-1)?.at ?? -Infinity)) errors.push({ at: now, error: frame.err_rms * facts.per_si });
  while (errors.length && now - errors[0].at > LAST_MS) errors.shift();
  for (const meter of meters) meter.show();
});

const rms = () => errors.length < 2 || errors.at(-1).at - errors[0].at < LEAST_MS ? null : Math.sqrt(errors.reduce((sum, { error }) => sum + error * error, 0) / errors.length);
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
    [errors, followsSince] = [[], null];
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
