// Numbers and pieces of the page as text: a true minus, a space where a sign would stand, thousands set apart.

const MINUS = '\u2212', FIGURE_SPACE = '\u2007', THIN = '\u202f';

export const signed = (value, digits) => {
  if (value === null || value === undefined) return '–';
  const size = Math.abs(value).toFixed(digits);
  return (Number(size) === 0 ? FIGURE_SPACE : value < 0 ? MINUS : '+') + size;
};
/// How a unit is written behind a number; a pure number has none.
export const sign = unit => unit === 'deg' ? '°' : unit === '1' ? '' : ` ${unit}`;
export const thousands = n => String(n).replace(/\B(?=(\d{3})+$)/g, THIN);
export const micros = us => us >= 1e6 ? `${(us / 1e6).toFixed(1)} s` : us >= 1000 ? `${(us / 1000).toFixed(1)} ms` : us >= 100 ? `${us.toFixed(0)} µs` : `${us.toFixed(1)} µs`;
export const clock = s => {
  const whole = Math.max(0, Math.floor(s)), two = n => String(n).padStart(2, '0');
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
};

/// The same with tenths, for an instant of a film.
export const instant = s => `${clock(s)}.${Math.floor(Math.max(0, s) * 10) % 10}`;

/// An element with a class, text, and children.
export function make(tag, className = '', ...content) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...content);
  return element;
}

/// An SVG from text and numbers of this page; what comes from a file is set as text, never here.
export function drawing(box, inner) {
  const holder = document.createElement('template');
  holder.innerHTML = `<svg viewBox="${box}" aria-hidden="true">${inner}</svg>`;
  return holder.content.firstChild;
}

/// Sets a text only where it differs, so that a page that stands still costs nothing.
export const write = (element, text) => { if (element.textContent !== text) element.textContent = text; };
