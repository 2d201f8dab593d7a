// Small pictures of the lab, drawn here: the residual over time and over the position, and the sketch of an effect.
import { drawing, make, sign } from './format.js';

/// What an effect alone adds over the position, drawn by the model with the fitted values.
export function sketch({ position, change, unit: own, is_across: isAcross }) {
  const [width, height, margin] = [300, 120, 8], [left, right] = [Math.min(...position), Math.max(...position)];
  const [low, high] = [Math.min(0, ...change), Math.max(0, ...change)];
  const x = value => margin + (width - 2 * margin) * (value - left) / (right - left || 1), y = value => height - margin - (height - 2 * margin) * (value - low) / (high - low || 1);
  const points = position.map((value, i) => `${x(value).toFixed(1)},${y(change[i]).toFixed(1)}`).join(' ');
  const picture = drawing(`0 0 ${width} ${height}`, `<path class="zero" d="M${margin} ${y(0).toFixed(1)}H${width - margin}"/><polyline points="${points}"/>`);
  const span = (a, b, digits) => `${a.toFixed(digits)} to ${b.toFixed(digits)}${sign(own)}`;
  const says = `It alone adds ${span(low, high, 2)} ${isAcross ? 'across' : 'along'} the motion, drawn over the position from ${span(left, right, 0)}: slowly out and back, and a smaller way inside.`;
  return make('figure', 'sketch', picture, make('figcaption', '', says));
}

const HEIGHT = 116, FOOT = 20, LEFT = 44;

/// The residual of each axis: over time, and over the position with a stroke that leans the way it moves. All have one scale;
/// the grey band is the measurement's own noise.
export function residualPictures({ time_s: time, unit, directions, axes }, floor) {
  const known = axes.flatMap(axis => axis.residual.filter(value => value !== null));
  const top = Math.max(known.reduce((most, value) => Math.max(most, Math.abs(value)), 0), 1e-6) * 1.08;
  const noise = floor === null ? 0 : Math.min(top, floor / Math.sqrt(axes.length));
  return make('div', 'residuals', ...axes.flatMap(axis => {
    const shown = axis.residual.filter(value => value !== null), ends = shown.length ? shown.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [shown[0], shown[0]]) : [0, 0];
    const between = `between ${ends[0].toFixed(2)} and ${ends[1].toFixed(2)}${sign(unit)}`;
    return [
      figure(560, time, axis, { top, noise, inner: overTime }, `${axis.name}, over time (s)`, between),
      figure(320, axis.position, axis, { top, noise, inner: overPosition }, `${axis.name}, over the position (${unit === 'deg' ? '°' : unit})`, `${between}; / ${directions[0]}, \\ ${directions[1]}`),
    ];
  }));
}

function figure(width, across, axis, { top, noise, inner }, title, says) {
  const places = across.filter(value => value !== null), [left, right] = places.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [places[0] ?? 0, places[0] ?? 0]);
  const x = value => LEFT + (width - LEFT - 6) * (value - left) / (right - left || 1), y = value => (HEIGHT - FOOT) * (1 - value / top) / 2;
  const step = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find(size => top / size < 2.5) ?? top / 2;
  let back = noise ? `<rect class="floor" x="${LEFT}" y="${y(noise)}" width="${width - LEFT}" height="${y(-noise) - y(noise)}"/>` : '';
  for (let k = -2; k <= 2; k += 1) {
    const value = k * step;
    if (Math.abs(value) < top) back += `<path class="grid" d="M${LEFT} ${y(value).toFixed(1)}H${width}"/><text x="${LEFT - 6}" y="${(y(value) + 4).toFixed(1)}" text-anchor="end">${Number(value.toPrecision(2))}</text>`;
  }
  for (const [value, anchor, at] of [[left, 'start', LEFT], [right, 'end', width]]) back += `<text x="${at}" y="${HEIGHT - 4}" text-anchor="${anchor}">${Number(value.toPrecision(3))}</text>`;
  const picture = drawing(`0 0 ${width} ${HEIGHT}`, back + inner(across, axis, x, y));
  picture.removeAttribute('aria-hidden');
  picture.setAttribute('role', 'img');
  picture.setAttribute('aria-label', `${title}: ${says}`);
  return make('figure', '', picture, make('figcaption', '', make('b', '', title), ` ${says}`));
}

function overTime(time, { residual }, x, y) {
  let path = '', isPen = false;
  residual.forEach((value, i) => {
    if (value === null) { isPen = false; return; }
    path += `${isPen ? 'L' : 'M'}${x(time[i]).toFixed(1)} ${y(value).toFixed(1)}`;
    isPen = true;
  });
  return `<path class="trace" d="${path}"/>`;
}

function overPosition(position, { residual, direction }, x, y) {
  const strokes = { '1': '', '-1': '' };
  residual.forEach((value, i) => {
    if (value === null || !direction[i]) return;
    const lean = direction[i];
    strokes[lean] += `M${(x(position[i]) - 2).toFixed(1)} ${(y(value) + 2 * lean).toFixed(1)}l4 ${-4 * lean}`;
  });
  return `<path class="rising" d="${strokes['1']}"/><path class="falling" d="${strokes['-1']}"/>`;
}
