// The drive pad: who has it, what the hand on it does, fifty times a second while it is held. It exists only where a page may drive.
import { ask, momentOf } from './commands.js';
import { drawing, write } from './format.js';
import { Hand, gamepads } from './hand.js';
import { on, post } from './link.js';

const $ = id => document.getElementById(id);
const jaws = [...document.querySelectorAll('#pad-jaw button')];
const EVERY_MS = 20, REACH = 100 / 118;
let page = null, hasJaw = false, seen = null, operator = null, timer = null, hand = null, knob = null, n = 0, wasHeld = false, mustLetGo = true;

const isMine = () => seen !== null && page !== null && seen.driver === page;

on('hello', ({ hello }) => { page = hello.page; n = 0; hasJaw = Boolean(hello.facts.jaw); $('pad-jaw').hidden = !hasJaw; });
on('frame', ({ frame }) => { operator = frame.operator; offer(frame.pad); });
on('stale', () => { seen = null; mustLetGo = true; });

function offer(pad) {
  const hadIt = isMine();
  seen = pad;
  if (!hadIt) mustLetGo = true;
  $('pad').hidden = !pad;
  if (pad && timer === null) timer = setInterval(look, EVERY_MS);
  if (!pad && timer !== null) { clearInterval(timer); timer = null; }
  if (pad) show();
}

/// Reads the hand and says what it does: while it is held, once when it lets go, and again and again while the master has not heard that:
/// it counts the hand as lost until it has seen it off the pad.
function look() {
  const now = hand.read();
  if (!now.held) mustLetGo = false;
  const isHeld = now.held && isMine() && !mustLetGo;
  // The page's own clock at this very moment: what is held up on its way is too old when it comes.
  const isUnheard = !now.held && isMine() && operator?.device === 'lost';
  if (isHeld || wasHeld || isUnheard) post('hand', { n: ++n, held: isHeld, x: isHeld ? now.x : 0, y: isHeld ? now.y : 0, jaw: isHeld && hasJaw ? now.jaw : 0, at: performance.timeOrigin + performance.now() });
  wasHeld = isHeld;
  knob.setAttribute('transform', `translate(${(100 * now.x).toFixed(1)} ${(100 * now.y).toFixed(1)})`);
  $('pad').classList.toggle('held', isHeld);
  for (const button of jaws) button.classList.toggle('held', isHeld && Number(button.dataset.jaw) === now.jaw);
}

function show() {
  const button = $('pad-take'), isTaken = seen.driver !== null && !isMine();
  const says = isMine()
    ? !wasHeld ? mustLetGo ? 'Let go, then hold anew.' : 'Yours. It moves only while you hold.' : operator?.present ? 'You drive. Let go to stop.' : 'It holds still: let go, then hold anew.'
    : isTaken ? `Page ${seen.driver} ${seen.held ? 'drives.' : 'has the pad and has let go.'}` : 'Nobody has the pad.';
  write($('pad-says'), says);
  write(button, isMine() ? 'You have the pad' : isTaken ? 'Take over' : 'Take the pad');
  button.setAttribute('aria-disabled', String(isMine() || seen.held));
  const [keys, gamepad] = hasJaw ? ['or Space + arrows, O, C', ', or shoulder button + left stick, highest, lowest button'] : ['or Space + arrows', ', or shoulder button + left stick'];
  write($('pad-keys'), gamepads().length ? keys + gamepad : keys);
}

export function startPad() {
  const way = angle => `<path class="way" transform="rotate(${angle})" d="M-9 -84 0 -96 9 -84"/>`;
  const picture = drawing('-118 -118 236 236', `<circle class="edge" r="100"/><path class="cross" d="M-76 0H76M0-76V76"/>${[0, 90, 180, 270].map(way).join('')}<circle class="knob" r="17"/>`);
  $('pad-field').replaceChildren(picture);
  knob = picture.querySelector('.knob');
  hand = new Hand($('pad-field'), REACH, jaws);
  $('pad-take').addEventListener('click', event => { if (!isMine()) { mustLetGo = true; ask('take', { at: momentOf(event) }, 'Pad', 'Waiting for the console.'); } });
}
