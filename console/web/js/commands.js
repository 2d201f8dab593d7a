// Commands: sent once, confirmed only by the drives' own state; a button that does nothing now says why.
import { drawing, write } from './format.js';
import { MARKS, STATES } from './states.js';
import { on, post } from './link.js';
import { pressByKey as pressPageKey } from './shell.js';

const $ = id => document.getElementById(id);
const WORDS = {
  enable: ['Enable', 'power on', 'E'], 'clear-fault': ['Clear fault', 'then enable', 'E'], home: ['Home', 'find zero', 'E'],
  pause: ['Pause', 'hold still', 'P'], resume: ['Resume', 'go on', 'P'], disable: ['Disable', 'power off', 'D'],
};
const ANSWER_WITHIN_MS = 4000;
let nextId = 1, waiting = new Map(), state = null, shown = 'stale', stopUrl = null, isStopHere = false;

/// What each of the three buttons is in a state, and whether it does something now.
function offers() {
  const operating = state?.operating, is = (...names) => shown !== 'stale' && names.includes(operating);
  const first = operating === 'FAULT' ? 'clear-fault' : operating === 'ENABLED' && !state.homed ? 'home' : 'enable';
  // Power is about to go: only the stop has a meaning.
  const goes = shown === 'relaxing', second = operating === 'PAUSED' && !goes ? 'resume' : 'pause';
  return [
    [first, first === 'enable' ? is('DISABLED') : shown !== 'stale' && !state?.busy],
    [second, !goes && is('ENABLED', 'PAUSED')],
    ['disable', !goes && is('ENABLED', 'PAUSED', 'FAULT')],
  ];
}

on('hello', ({ hello }) => {
  if (!hello.stop_url || stopUrl === hello.stop_url) return;
  [stopUrl, isStopHere] = [hello.stop_url, false];
  const frame = document.createElement('iframe');
  frame.id = 'stop';
  frame.title = 'STOP';
  frame.src = stopUrl;
  $('stop-place').replaceChildren(frame);
});

on('frame', ({ frame }) => { state = frame.state; shown = frame.shown; update(); });
on('stale', () => { shown = 'stale'; update(); });
on('ack', ({ message }) => {
  const asked = waiting.get(message.id);
  if (!asked) return;
  settle(message.id);
  const after = Math.round(performance.now() - asked.at);
  tell(message.is_done ? 'ok' : 'warn', message.is_done ? message.say : `${asked.word}: ${message.say}`, `${new Date().toTimeString().slice(0, 8)}, ${after} ms after the press`);
});

const buttons = [...document.querySelectorAll('.command')];

function update() {
  offers().forEach(([wish, isUseful], i) => {
    const button = buttons[i], key = wish + isUseful;
    if (button.dataset.key === key) return;
    button.dataset.key = key;
    button.dataset.wish = wish;
    const [word, note, letter] = WORDS[wish];
    write(button.querySelector('b'), word);
    write(button.querySelector('span'), note);
    write(button.querySelector('kbd'), letter);
    button.setAttribute('aria-disabled', String(!isUseful));
    button.classList.toggle('next', isUseful && ['enable', 'resume', 'home', 'clear-fault'].includes(wish));
  });
}

function tell(level, title, detail) {
  $('ack').className = `ack ${level}`;
  $('ack').querySelector('i').replaceChildren(drawing(MARKS[level].box, MARKS[level].inner));
  write($('ack-title'), title);
  write($('ack-detail'), detail);
}

function settle(id) {
  clearTimeout(waiting.get(id).timer);
  waiting.delete(id);
  if (!waiting.size) buttons.forEach(button => button.classList.remove('sent'));
}

/// `at`: when the hand pressed, ms since 1970. A page that hung meanwhile asks for nothing that is long past.
function press(button, at) {
  const wish = button.dataset.wish, word = WORDS[wish]?.[0];
  if (!wish) return;
  if (button.getAttribute('aria-disabled') === 'true') {
    tell('info', `${word} does nothing now`, shown === 'stale' ? 'The state of the drives is not known.' : `The state is: ${STATES[shown].word}.`);
    return;
  }
  button.classList.add('sent');
  ask('wish', { wish, at }, word, 'Waiting for the drives’ own state.');
}

/// When an event happened, ms since 1970.
export const momentOf = event => performance.timeOrigin + event.timeStamp;

/// Sends a command once, with its instant `rest.at`; what became of it is told when the answer comes.
export function ask(kind, rest, word, waits) {
  const id = nextId++;
  tell('info', `${word} sent`, waits);
  waiting.set(id, { word, at: performance.now(), timer: setTimeout(() => { settle(id); tell('warn', `${word}: no answer`, 'Nothing came back. Look at the robot.'); }, ANSWER_WITHIN_MS) });
  post(kind, { id, ...rest });
}

/// The key that stops from anywhere, by the stop's own document; where that has not come, a pause by the live connection is what is left.
function stop() {
  if (isStopHere) $('stop').contentWindow.postMessage('stop', new URL(stopUrl).origin);
  else ask('wish', { wish: 'pause', at: performance.timeOrigin + performance.now() }, 'Pause', 'The STOP of this page has not come, so a pause was asked for.');
}

/// While a finger holds the pad, the browser gives every further finger to this page, also one that is on the stop's own document.
function stopByFinger({ pointerType, clientX, clientY }) {
  const place = $('stop')?.getBoundingClientRect();
  if (pointerType === 'touch' && place && clientX >= place.left && clientX <= place.right && clientY >= place.top && clientY <= place.bottom) stop();
}

function pressByKey(key, at) {
  const button = buttons[{ e: 0, p: 1, d: 2 }[key.toLowerCase()]];
  if (button) press(button, at);
}

export function startCommands() {
  for (const button of buttons) button.addEventListener('click', event => press(button, momentOf(event)));
  addEventListener('pointerdown', stopByFinger, true);
  addEventListener('keydown', event => {
    if (event.key === 'Escape') {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) stop();
      return;
    }
    if (event.target.matches('input, select, textarea') || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    pressByKey(event.key, momentOf(event));
  }, true);
  addEventListener('message', event => {
    if (!stopUrl || event.origin !== new URL(stopUrl).origin) return;
    isStopHere ||= event.data === 'here';
    if (typeof event.data?.key !== 'string') return;
    pressByKey(event.data.key, event.data.at);
    pressPageKey(event.data.key);
  });
  tell('info', 'No command sent yet', 'Commands are confirmed here by the drives’ own state.');
}
