// The hand on the drive pad: pointer, touch, keyboard or gamepad as one deflection, in the camera's x (right) and y (down), and the
// jaw of a gripper: 1 opens, -1 closes, 0 stays.
// Hold to run: nothing counts that is not held at this moment.

/// Part of the full deflection that an arrow key asks for; a finger finds the rest.
const KEY_PART = 0.5;
/// A stick rests within this part of its way.
const STICK_DEAD_PART = 0.15;
/// Shoulder buttons of a gamepad with the standard layout; its lowest face button closes the jaw, its highest opens it.
const SHOULDERS = [4, 5], CLOSES = 0, OPENS = 3;
/// Keys for the jaw beside Space.
const JAW_KEYS = { c: -1, o: 1 };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const AWAY = { held: false, x: 0, y: 0, jaw: 0 };

export class Hand {
  /// `field` is the round part of the pad; `reach` its radius as a part of half its width; `jaws` are the buttons of a jaw.
  constructor(field, reach, jaws) {
    this.field = field;
    this.reach = reach;
    this.pointer = null;
    this.keys = new Set();
    /// Who holds a button of the jaw, a pointer or a key, and which.
    this.onJaw = new Map();
    for (const button of jaws) this.listen(button);
    field.addEventListener('pointerdown', event => this.down(event));
    field.addEventListener('pointermove', event => { if (event.pointerId === this.pointer?.id) this.move(event); });
    for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) field.addEventListener(name, event => { if (event.pointerId === this.pointer?.id) this.pointer = null; });
    field.addEventListener('contextmenu', event => event.preventDefault());
    field.addEventListener('keydown', event => this.key(event, true));
    field.addEventListener('keyup', event => this.key(event, false));
    field.addEventListener('blur', () => this.keys.clear());
    addEventListener('blur', () => this.letGo());
    document.addEventListener('visibilitychange', () => { if (document.hidden) this.letGo(); });
  }

  letGo() {
    this.pointer = null;
    this.keys.clear();
    this.onJaw.clear();
  }

  /// A button of the jaw counts while a pointer, or Space or Enter, holds it.
  listen(button) {
    const jaw = Number(button.dataset.jaw);
    button.addEventListener('pointerdown', event => { if (event.button === 0) { this.onJaw.set(event.pointerId, jaw); button.setPointerCapture(event.pointerId); } });
    for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) button.addEventListener(name, event => this.onJaw.delete(event.pointerId));
    button.addEventListener('contextmenu', event => event.preventDefault());
    for (const name of ['keydown', 'keyup']) {
      button.addEventListener(name, event => {
        if (![' ', 'Enter'].includes(event.key) || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        if (name === 'keydown') this.onJaw.set(button, jaw); else this.onJaw.delete(button);
      });
    }
    button.addEventListener('blur', () => this.onJaw.delete(button));
  }

  down(event) {
    if (event.button !== 0 || this.pointer) return;
    this.pointer = { id: event.pointerId, x: 0, y: 0 };
    this.field.setPointerCapture(event.pointerId);
    this.move(event);
  }

  move(event) {
    const { left, top, width, height } = this.field.getBoundingClientRect(), radius = this.reach * width / 2;
    Object.assign(this.pointer, within((event.clientX - left - width / 2) / radius, (event.clientY - top - height / 2) / radius));
  }

  key(event, isDown) {
    const letter = event.key.toLowerCase();
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.code === 'Space' || event.key === ' ' || ARROWS[event.key] || JAW_KEYS[letter])) return;
    event.preventDefault();
    const name = ARROWS[event.key] ? event.key : JAW_KEYS[letter] ? letter : 'Space';
    if (isDown) this.keys.add(name); else this.keys.delete(name);
  }

  /// What the hand does now.
  read() {
    // With a finger on each of its buttons the jaw stays.
    const asked = [...this.onJaw.values()], onButtons = asked.every(jaw => jaw === asked[0]) ? asked[0] ?? 0 : 0;
    if (this.pointer) return { held: true, x: this.pointer.x, y: this.pointer.y, jaw: onButtons };
    if (this.keys.has('Space')) {
      const sum = [0, 1].map(i => Object.entries(ARROWS).reduce((all, [key, way]) => all + (this.keys.has(key) ? way[i] : 0), 0));
      const size = Math.hypot(...sum) || 1;
      const byKey = Object.entries(JAW_KEYS).reduce((all, [key, jaw]) => all + (this.keys.has(key) ? jaw : 0), 0);
      return { held: true, x: KEY_PART * sum[0] / size, y: KEY_PART * sum[1] / size, jaw: onButtons || byKey };
    }
    if (asked.length) return { held: true, x: 0, y: 0, jaw: onButtons };
    return document.hasFocus() ? stick() : AWAY;
  }
}

/// The first gamepad whose shoulder button is held. Of a layout that is not the standard one nobody knows which button that is.
function stick() {
  const pad = gamepads().find(pad => SHOULDERS.some(button => pad.buttons[button]?.pressed));
  if (!pad) return AWAY;
  const isDown = button => pad.buttons[button]?.pressed ? 1 : 0, jaw = isDown(OPENS) - isDown(CLOSES);
  const [x, y] = pad.axes, size = Math.hypot(x, y);
  if (!(size > STICK_DEAD_PART)) return { held: true, x: 0, y: 0, jaw };
  const part = (Math.min(1, size) - STICK_DEAD_PART) / (1 - STICK_DEAD_PART) / size;
  return { held: true, ...within(x * part, y * part), jaw };
}

/// Gamepads with the standard layout.
export const gamepads = () => [...(navigator.getGamepads?.() ?? [])].filter(pad => pad?.connected && pad.mapping === 'standard');

/// The same direction, no further than the edge.
function within(x, y) {
  const size = Math.max(1, Math.hypot(x, y));
  return { x: x / size, y: y / size };
}
