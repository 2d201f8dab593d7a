// Painted solids on a 2-D canvas: tubes, disks and a cone stump, each with the depth by which they are sorted.
import { circle, dot, minus, pointIn, unit } from './snake.js';

const LIGHT = unit([-0.5, -0.62, 0.6]);
const cache = new Map();

const parts = colour => [1, 3, 5].map(i => parseInt(colour.slice(i, i + 2), 16));

/// A colour between two, in steps of a hundredth so that few texts are made.
export function mix(a, b, part) {
  const step = Math.round(Math.max(0, Math.min(1, part)) * 100), key = a + b + step;
  let mixed = cache.get(key);
  if (!mixed) {
    const [from, to] = [parts(a), parts(b)];
    mixed = '#' + from.map((v, i) => Math.round(v + (to[i] - v) * step / 100).toString(16).padStart(2, '0')).join('');
    if (cache.size > 4000) cache.clear();
    cache.set(key, mixed);
  }
  return mixed;
}

const path = (g, points) => points.forEach((p, i) => i ? g.lineTo(p[0], p[1]) : g.moveTo(p[0], p[1]));

/// The faces between two rings; each is turned so that overlapping ones add up.
function mantle(g, lower, upper, fill) {
  g.fillStyle = fill;
  g.beginPath();
  for (let i = 0; i + 1 < lower.length; i++) {
    const face = [lower[i], lower[i + 1], upper[i + 1], upper[i]];
    const area = face.reduce((sum, a, j) => { const b = face[(j + 1) % 4]; return sum + a[0] * b[1] - b[0] * a[1]; }, 0);
    path(g, area < 0 ? face.reverse() : face);
    g.closePath();
  }
  g.fill('nonzero');
}

/// One piece of a tube between two projected points, lit from above left.
export function tubePiece(g, a, b, radius, colour, deep) {
  const width = radius * (a[3] + b[3]), along = [b[0] - a[0], b[1] - a[1]], length = Math.hypot(...along) || 1;
  let across = [-along[1] / length, along[0] / length];
  if (across[0] * 0.62 + across[1] * 0.5 > 0) across = [-across[0], -across[1]];
  const [ox, oy] = [along[0] * 0.07, along[1] * 0.07];
  return { depth: (a[2] + b[2]) / 2 - 0.01, paint: () => {
    for (const [stroke, part, shift] of [[mix(colour, deep, 0.5), 1, 0], [mix(colour, deep, 0.12), 0.74, 0.08], [colour, 0.48, 0.14], [mix(colour, '#ffffff', 0.42), 0.16, 0.2]]) {
      g.strokeStyle = stroke;
      g.lineWidth = Math.max(0.8, width * part);
      g.beginPath();
      g.moveTo(a[0] - ox + across[0] * shift * width, a[1] - oy + across[1] * shift * width);
      g.lineTo(b[0] + ox + across[0] * shift * width, b[1] + oy + across[1] * shift * width);
      g.stroke();
    }
  } };
}

/// A finger of a jaw along projected points, thinner towards its end.
export const finger = (g, points, colour, deep) => points.slice(1).map((point, i) => tubePiece(g, points[i], point, 0.62 - 0.14 * i, colour, deep));

/// A disk across a frame.
export function disk(g, camera, frame, radius, thickness, colour, deep) {
  return { depth: camera.project(frame.centre)[2], paint: () => {
    const isTop = dot(frame.tangent, minus(camera.eye, frame.centre)) > 0, side = isTop ? 1 : -1;
    const far = circle(frame, radius, { z: -side * thickness / 2, n: 36 }).map(camera.project);
    const near = circle(frame, radius, { z: side * thickness / 2, n: 36 }).map(camera.project);
    mantle(g, far, near, mix(colour, deep, 0.55));
    const light = 0.5 + 0.5 * side * dot(frame.tangent, LIGHT);
    g.fillStyle = mix(mix(colour, deep, 0.66), mix(colour, '#ffffff', 0.3), light);
    g.strokeStyle = mix(colour, '#ffffff', 0.45);
    g.lineWidth = 0.8;
    g.beginPath();
    path(g, near);
    g.fill();
    g.globalAlpha = 0.55;
    g.stroke();
    g.globalAlpha = 1;
  } };
}

/// The base: a cone stump under the snake with a bright top.
export function base(g, camera, { low, top, low_radius, top_radius }, colour, deep, metal) {
  const ring = (frame, radius) => circle(frame, radius).map(camera.project);
  const lower = ring(low, low_radius), upper = ring(top, top_radius), xs = [...lower, ...upper].map(p => p[0]);
  const shade = g.createLinearGradient(Math.min(...xs), 0, Math.max(...xs), 0);
  shade.addColorStop(0, mix(colour, deep, 0.4));
  shade.addColorStop(0.3, mix(colour, '#ffffff', 0.16));
  shade.addColorStop(1, mix(colour, deep, 0.62));
  mantle(g, lower, upper, shade);
  for (const [points, fill] of [[upper, mix(colour, '#ffffff', 0.2)], [circle(top, top_radius * 0.8, { z: 0.2 }).map(camera.project), mix(metal, '#ffffff', 0.28)]]) {
    g.fillStyle = fill;
    g.beginPath();
    path(g, points);
    g.fill();
  }
}

/// An axis of the tip's frame with its letter.
export function arrow(g, camera, frame, direction, colour, letter) {
  const start = camera.project(pointIn(frame, 0, 0, 0.45));
  const along = length => camera.project(frame.centre.map((c, i) => c + 0.45 * frame.tangent[i] + length * direction[i]));
  const [end, name] = [along(4.9), along(6.2)], size = Math.hypot(end[0] - start[0], end[1] - start[1]);
  const [nx, ny] = [(end[0] - start[0]) / (size || 1), (end[1] - start[1]) / (size || 1)];
  g.strokeStyle = g.fillStyle = colour;
  g.lineWidth = 2.2;
  g.beginPath();
  g.moveTo(start[0], start[1]);
  g.lineTo(end[0] - 6 * nx, end[1] - 6 * ny);
  g.stroke();
  if (size > 8) {
    g.beginPath();
    path(g, [end, [end[0] - 13 * nx + 5 * ny, end[1] - 13 * ny - 5 * nx], [end[0] - 13 * nx - 5 * ny, end[1] - 13 * ny + 5 * nx]]);
    g.fill();
  }
  g.font = '700 16px Inter, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
  g.textAlign = 'center';
  g.textBaseline = 'middle';
  g.fillText(letter, name[0], name[1]);
}
