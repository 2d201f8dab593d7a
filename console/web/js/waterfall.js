// The lab's bars: the error after each effect.
import { drawing, write } from './format.js';

/// Bars of errors with a name each, a guess dashed, beside the noise (`falls.floor`); and a sentence of what they are.
export function waterfall(picturePlace, sentencePlace, falls, unit) {
  if (!falls.length) { picturePlace.replaceChildren(); write(sentencePlace, 'The bars come with the first comparison.'); return; }
  const [width, height, low, left] = [400, 460, 74, 56], top = Math.max(...falls.map(fall => fall.value), falls.floor ?? 0) * 1.22;
  const y = value => (height - low) * (1 - value / top) + 4, each = (width - left - 6) / Math.max(3, falls.length);
  const ticks = [0.25, 0.5, 1, 2, 5, 10].find(size => top / size < 5) ?? 20;
  // Unit and names come from files: they are set as text.
  const texts = [], say = (className, anchor, x, y, text) => texts.push(label({ class: className, 'text-anchor': anchor, x, y }, text));
  let inner = '';
  for (let value = 0; value < top; value += ticks) {
    inner += `<path class="grid" d="M${left} ${y(value)}H${width}"/>`;
    say('tick', 'end', left - 6, y(value) + 4, `${value}${unit}`);
  }
  if (falls.floor) inner += `<rect class="floor" x="${left}" y="${y(falls.floor)}" width="${width - left}" height="${y(0) - y(falls.floor)}"/>`;
  falls.forEach((fall, i) => {
    const x = left + 6 + each * i, isLast = i === falls.length - 1 && i > 0;
    inner += `<rect class="${fall.isGuess ? 'guess' : isLast ? 'bar last' : 'bar'}" x="${x}" y="${y(fall.value)}" width="${each * 0.8}" height="${Math.max(1, y(0) - y(fall.value))}" rx="3"/>`;
    const middle = x + each * 0.4;
    say('value', 'middle', middle, y(fall.value) - 8, `${fall.value.toFixed(2)}${unit}`);
    linesOf(fall.name).forEach((words, k) => say('name', 'middle', middle, height - low + 24 + 16 * k, words));
  });
  const picture = drawing(`0 0 ${width} ${height}`, inner);
  picture.append(...texts);
  picturePlace.replaceChildren(picture);
  const last = falls.at(-1);
  write(sentencePlace, falls.some(fall => fall.isGuess) ? 'Dashed: what it would bring, tried on data that it was not fitted to.' : falls.floor && last.value < 1.05 * falls.floor ? 'The last bar meets the noise (grey): nothing explainable is left.' : falls.floor ? 'Grey: the measurement’s own noise.' : '');
}

/// A name in lines of a bar's width.
const linesOf = name => name.length <= 12 ? [name] : name.split(/(?<=[ -])/).reduce((lines, word) => { (lines.at(-1) + word).length > 13 ? lines.push(word) : lines[lines.length - 1] += word; return lines; }, ['']);

function label(attributes, text) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', 'text');
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.textContent = text;
  return element;
}
