// The hand on the drive pad: pointer, touch, keyboard or gamepad as one deflection, in the camera's x (right) and y (down).
// Hold to run: nothing counts that is not held at this moment.

/// Part of the full deflection that an arrow key asks for; a finger finds the rest.
const KEY_PART = 0.5;
/// A stick rests within this part of its way.
const STICK_DEAD_PART = 0.15;
/// Shoulder buttons of a gamepad with the standard layout.
const SHOULDERS = [4, 5];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const AWAY = { held: false, x: 0, y: 0 };

export class Hand {
  /// `field` is the round part of the pad; `reach` its radius as a part of half its width.
  constructor(field, reach) {
    this.field = field;
    this.reach = reach;
    this.pointer = null;
    this.keys = new Set();
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
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.code === 'Space' || event.key === ' ' || ARROWS[event.key])) return;
    event.preventDefault();
    const name = ARROWS[event.key] ? event.key : 'Space';
    if (isDown) this.keys.add(name); else this.keys.delete(name);
  }

  /// What the hand does now.
  read() {
    if (this.pointer) return { held: true, x: this.pointer.x, y: this.pointer.y };
    if (this.keys.has('Space')) {
      const sum = [0, 1].map(i => Object.entries(ARROWS).reduce((all, [key, way]) => all + (this.keys.has(key) ? way[i] : 0), 0));
      const size = Math.hypot(...sum) || 1;
      return { held: true, x: KEY_PART * sum[0] / size, y: KEY_PART * sum[1] / size };
    }
    return document.hasFocus() ? stick() : AWAY;
  }
}

/// The first gamepad whose shoulder button is held. Of a layout that is not the standard one nobody knows which button that is.
function stick() {
  const pad = gamepads().find(pad => SHOULDERS.some(button => pad.buttons[button]?.pressed));
  if (!pad) return AWAY;
  const [x, y] = pad.axes, size = Math.hypot(x, y);
  if (!(size > STICK_DEAD_PART)) return { held: true, x: 0, y: 0 };
  const part = (Math.min(1, size) - STICK_DEAD_PART) / (1 - STICK_DEAD_PART) / size;
  return { held: true, ...within(x * part, y * part) };
}

/// Gamepads with the standard layout.
export const gamepads = () => [...(navigator.getGamepads?.() ?? [])].filter(pad => pad?.connected && pad.mapping === 'standard');

/// The same direction, no further than the edge.
function within(x, y) {
  const size = Math.max(1, Math.hypot(x, y));
  return { x: x / size, y: y / size };
}
