// The page's side of the worker: hands over canvases, sizes, colours; passes on what arrives.

const worker = new Worker('/js/worker.js', { type: 'module' });
const listeners = {};

export const post = (k, rest = {}, transfer = []) => worker.postMessage({ k, ...rest }, transfer);
export const on = (k, listener) => { (listeners[k] ??= []).push(listener); };

worker.onmessage = ({ data }) => listeners[data.k]?.forEach(listener => listener(data));

/// Gives a canvas to the worker and keeps it told of the canvas's size.
export function lend(name, canvas) {
  const offscreen = canvas.transferControlToOffscreen();
  post('canvas', { name, canvas: offscreen }, [offscreen]);
  new ResizeObserver(([entry]) => {
    const { width, height } = entry.contentRect;
    post('size', { name, width, height, ratio: Math.min(2, devicePixelRatio) });
  }).observe(canvas);
}

const COLOURS = {
  s3: 's3', rule: 'rule', t3: 't3', warn: 'warn', line1: 'line-1', line2: 'line-2', line3: 'line-3', onLine: 'on-line', ghost: 'ghost', trail: 'trail',
  metal: 'metal', base: 'base', core: 'core', dome: 'dome', floor: 'floor', edge: 'edge', deep: 'deep', axisX: 'axis-x', axisY: 'axis-y', axisZ: 'axis-z',
};

/// Tells the worker the theme's colours.
export function sendColours() {
  const style = getComputedStyle(document.documentElement);
  post('colours', { colours: Object.fromEntries(Object.entries(COLOURS).map(([key, name]) => [key, style.getPropertyValue(`--${name}`).trim()])) });
}
