// Pages, keys, theme, sounds and the turning of the picture.
import { post, sendColours } from './link.js';

const root = document.documentElement, $ = id => document.getElementById(id);
const tabs = [...document.querySelectorAll('[data-go]')], names = tabs.map(tab => tab.dataset.go);
let audio = null;

export function go(name) {
  root.dataset.tab = name;
  document.body.classList.toggle('compact', name !== 'operate');
  for (const tab of tabs) {
    const isThis = tab.dataset.go === name;
    $(tab.dataset.go).hidden = !isThis;
    tab.setAttribute('aria-selected', String(isThis));
    tab.tabIndex = isThis ? 0 : -1;
  }
  post('shown', { isShown: name === 'operate' && !document.hidden });
  visitors[name]?.();
}

const visitors = {};
/// Calls somebody whenever a page is opened.
export const onVisit = (name, visitor) => { visitors[name] = visitor; };

export function setTheme(theme) {
  root.dataset.theme = theme;
  remember('theme', theme);
  sendColours();
}

/// A browser may keep nothing; then the next visit begins anew.
const remember = (key, value) => { try { localStorage.setItem(`krait-${key}`, value); } catch { /* not kept */ } };
const remembered = key => { try { return localStorage.getItem(`krait-${key}`); } catch { return null; } };

/// Tones, one after the other, if sounds are on.
export function play(tones) {
  if (!audio || $('sound').getAttribute('aria-pressed') !== 'true') return;
  tones.forEach((hertz, i) => {
    const [tone, gain, from] = [audio.createOscillator(), audio.createGain(), audio.currentTime + 0.16 * i];
    tone.frequency.value = hertz;
    gain.gain.setValueAtTime(0.08, from);
    gain.gain.exponentialRampToValueAtTime(0.001, from + 0.14);
    tone.connect(gain).connect(audio.destination);
    tone.start(from);
    tone.stop(from + 0.15);
  });
}

function toggleSound() {
  const button = $('sound'), isOn = button.getAttribute('aria-pressed') !== 'true';
  if (isOn) audio ??= new AudioContext();
  button.setAttribute('aria-pressed', String(isOn));
}

/// Lets pointer, wheel and arrow keys turn a picture that the worker paints.
export function turnWithPointer(canvas, name) {
  let last = null;
  canvas.addEventListener('pointerdown', event => { last = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener('pointermove', event => {
    if (!last) return;
    post('turn', { name, azimuth: (event.clientX - last[0]) * 0.008, elevation: (event.clientY - last[1]) * 0.008 });
    last = [event.clientX, event.clientY];
    if (name === 'scene') pressed(null);
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, () => { last = null; });
  canvas.addEventListener('wheel', event => { event.preventDefault(); post('zoom', { name, factor: Math.exp(event.deltaY * 0.001) }); }, { passive: false });
  canvas.addEventListener('keydown', event => {
    const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
    if (turn) { post('turn', { name, azimuth: turn[0], elevation: turn[1] }); event.preventDefault(); if (name === 'scene') pressed(null); }
    if (event.key === '+') post('zoom', { name, factor: 0.9 });
    if (event.key === '-') post('zoom', { name, factor: 1.1 });
  });
}

const views = [...document.querySelectorAll('[data-view]')];
const pressed = chosen => views.forEach(view => view.setAttribute('aria-pressed', String(view === chosen)));

/// The keys of the page itself: its rooms, its theme, its sounds. Those of the commands are in `commands.js`.
export function pressByKey(key) {
  if (names[Number(key) - 1]) go(names[Number(key) - 1]);
  else if (key.toLowerCase() === 't') $('theme').click();
  else if (key.toLowerCase() === 's') toggleSound();
}

export function start() {
  for (const tab of tabs) tab.addEventListener('click', () => go(tab.dataset.go));
  document.querySelector('.tabs').addEventListener('keydown', event => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = (names.indexOf(root.dataset.tab) + step + names.length) % names.length;
    go(names[next]);
    tabs[next].focus();
  });
  for (const view of views) view.addEventListener('click', () => { post('view', { name: view.dataset.view }); pressed(view); });
  $('theme').addEventListener('click', () => setTheme(root.dataset.theme === 'dark' ? 'light' : 'dark'));
  $('sound').addEventListener('click', toggleSound);
  addEventListener('keydown', event => {
    if (event.target.matches('input, select, textarea') || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    pressByKey(event.key);
  });
  document.addEventListener('visibilitychange', () => post('shown', { isShown: root.dataset.tab === 'operate' && !document.hidden }));
  turnWithPointer($('scene'), 'scene');
  const wish = remembered('theme') ?? (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');
  setTheme(wish);
  go('operate');
}
