// The page's side of the worker: hands over canvases, sizes, colours; passes on what arrives, and says so where the worker falls silent.

const worker = new Worker('/js/worker.js', { type: 'module' });
const listeners = {};

// The worker speaks with each picture. One that is silent for so long has died or hangs, and what it painted is too old.
const SILENT_MS = 500, LOOK_EVERY_MS = 100;
// Its scripts may take longer to come than a picture.
const LOADS_MS = 3000;
let heard = 0, looked = 0, patienceMs = LOADS_MS;

export const post = (k, rest = {}, transfer = []) => worker.postMessage({ k, ...rest }, transfer);
export const on = (k, listener) => { (listeners[k] ??= []).push(listener); };
const tell = data => listeners[data.k]?.forEach(listener => listener(data));

worker.onmessage = ({ data }) => { heard = performance.now(); patienceMs = SILENT_MS; tell(data); };

/// Lets the worker connect; from here on it has to speak.
export function connect() {
  post('connect');
  heard = looked = performance.now();
  setInterval(() => {
    const now = performance.now();
    // A page that was hidden or hung itself has not listened: what the worker said meanwhile may still wait.
    if (document.hidden || now - looked > 3 * LOOK_EVERY_MS) heard = now;
    looked = now;
    if (now - heard > patienceMs) tell({ k: 'stale', hasConnection: false, silentFrom: heard });
  }, LOOK_EVERY_MS);
}

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
