// What the lab's answers are made of on the page: tiles, bars by circumstance, cards of effects, tables of values.
import { make, sign } from './format.js';
import { sketch } from './pictures.js';
import { tile } from './work.js';

/// Where the error is worst, beside the noise.
export function whereBars(where, floor) {
  const worst = where.slice(0, 9), top = Math.max(...worst.map(bin => bin.rms), floor ?? 0);
  return make('div', 'where', ...worst.map(bin => {
    const fill = make('i');
    fill.style.width = `${100 * bin.rms / top}%`;
    return make('div', '', make('span', '', `${bin.by} ${bin.bin}`), make('div', 'track', fill), make('b', 'num', bin.rms.toFixed(2)));
  }));
}

/// How much of the error is explained, and what a fit without any model would leave, where the diagnosis says so.
export function explainedTiles({ base_heldout_rms: before, final_heldout_rms: after, explained_share: share, model_free_rms: free }, deg) {
  const tiles = [tile('without effects', deg(before)), tile('with what was found', deg(after))];
  if (share !== null && share !== undefined) tiles.push(tile('explained', `${(100 * share).toFixed(0)} %`, 'of what there is above the noise'));
  if (free !== null && free !== undefined) tiles.push(tile('a fit without a model', deg(free), 'leaves this: a hint, no bound'));
  return make('div', 'tiles explained', ...tiles);
}

/// What an effect is called, with its size, as the command and the report say it; a formula of one's own has its name alone.
export const titled = own => own.title ? `${own.effect}: ${own.title}` : own.effect;

/// An effect with its words, its sketch and its values; `choose` hears which of those that look alike is meant, and `chosen` is its name.
export function effectCard(own, chosen, choose, deg) {
  const values = Object.entries(own.params).filter(([, value]) => value.free !== false).map(([name, value]) => make('tr', '', make('th', '', name), make('td', 'n', `${value.value.toPrecision(3)}${sign(value.unit)}`), make('td', 'n', `± ${value.se.toPrecision(1)}`)));
  const others = own.class.filter(name => name !== own.effect);
  const words = own.explanation ? [make('p', '', own.explanation.what), make('p', '', make('b', '', 'To check on the machine: '), own.explanation.check)] : [];
  if (own.sketch) words.splice(1, 0, sketch(own.sketch));
  const card = make('div', 'effect', make('h3', '', titled(own) + (own.joint ? ` (joint ${own.joint})` : '')), ...words, make('p', '', `The error falls from ${deg(own.heldout_rms.before)} to ${deg(own.heldout_rms.after)}; it came out best in ${(100 * own.probability).toFixed(0)} of 100 resamplings.`), make('table', '', make('tbody', '', ...values)));
  if (others.length) {
    const group = make('fieldset', '', make('legend', '', `These data cannot tell it from ${others.length} other${others.length > 1 ? 's' : ''}`));
    for (const name of [own.effect, ...others]) {
      const radio = document.createElement('input');
      Object.assign(radio, { type: 'radio', name: `class-${own.effect}-${own.joint ?? ''}`, value: name, checked: name === chosen });
      radio.addEventListener('change', () => choose(name));
      group.append(make('label', '', radio, name));
    }
    card.append(group);
  }
  return card;
}

/// The values that a fit found, each with its standard error; those of a new effect beside others' have its name before them.
export function valuesOf(answer) {
  const isBeside = Object.keys(answer.params).some(key => key.includes('.'));
  const named = key => isBeside && !key.includes('.') ? `${answer.effect}.${key}` : key;
  return make('table', 'values', make('tbody', '', ...Object.entries(answer.params).map(([key, value]) => make('tr', '', make('th', '', named(key)), make('td', 'n', `${value.value.toPrecision(4)}${sign(value.unit)}`), make('td', 'n', `± ${value.se.toPrecision(2)}`), make('td', '', value.on_bound ? 'on its bound' : '')))));
}

/// As the diagnosis judges it: 4 % above a floor that is known exactly, and two of its standard errors more.
export const isAtNoise = ({ heldout_rms: { after }, noise_floor: floor, noise_floor_relative_se: se }) => floor !== null && after <= (1.04 + 2 * se) * floor;

/// An effect that a diagnosis found as it can be added: the joint that has it, the column that one of its numbers depends on, and the values
/// to start from. A formula of one's own, which nobody has explained, starts from what was found.
export function placeOf(own, effects, variations) {
  const varied = (variations ?? []).find(one => one.in_effects && one.column && one.effect === own.effect && one.joint === own.joint);
  const set = own.explanation ? [] : Object.entries(own.params).map(([name, { value }]) => [name, value]);
  return { effect: own.effect, effects, set, joint: own.joint ?? null, by: varied ? `${varied.parameter}=${varied.column.name}` : null };
}

/// Every bar is the error of all joints together: of one joint's effect it falls by what that joint's mean square falls.
export function fallen(all, { before, after }) {
  return Math.sqrt(Math.max(0, all ** 2 - before ** 2 + after ** 2));
}
