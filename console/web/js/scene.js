// The picture of the snake, or of segments in series: floor, workspace of a snake, measured body, trail of the tip, the jaw of a gripper, and
// the commanded shape as a ghost.
import { TURN, VIEWS, arcsOf, cameraFor, circle, cross, degrees, fingers, flat, frameAt, minus, pointIn, tipOf, unit, viewNamed } from './snake.js';
import { arrow, base, disk, finger, tubePiece } from './solids.js';

const N_DISKS = 9, PIECES = 27, TUBE = 0.38, FLOOR = -2.45;
/// Where the camera looks at a snake of this length, mm; a longer machine is seen from as much further away.
const TARGET = 11.2, LENGTH = 26;
/// Off by this much the ghost begins to stand out, degrees, and then over this much more.
const GHOST_FROM = 0.6, GHOST_OVER = 1.6;

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.g = canvas.getContext('2d');
    this.view = { ...VIEWS.oblique };
    this.goal = null;
    this.trail = [];
    this.ghost = 0;
    this.size = { width: 0, height: 0, ratio: 1 };
  }

  resize(width, height, ratio) {
    this.size = { width, height, ratio };
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
  }

  turn(azimuth, elevation) {
    this.goal = null;
    this.view.azimuth -= azimuth;
    this.view.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.view.elevation + elevation));
  }

  zoom(factor) {
    this.goal = null;
    this.view.distance = Math.max(45, Math.min(160, this.view.distance * factor));
  }

  preset(name, roll) { this.goal = viewNamed(name, roll); }

  /// Remembers where the tip was, for about four seconds of pictures.
  remember(bends, machine) {
    this.trail.push(tipOf(bends, machine).centre);
    if (this.trail.length > 240) this.trail.shift();
  }

  clear() {
    this.trail.length = 0;
    this.g.setTransform(1, 0, 0, 1, 0, 0);
    this.g.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  /// `jaw` is how far a gripper is and shall be open, rad, null where that is not known; none for a machine without one.
  draw({ bends, wanted, jaw, machine, colours, isLimited }) {
    const { width, height, ratio } = this.size, g = this.g;
    if (!width || !height) return;
    this.approach();
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    g.lineJoin = 'round';
    // A narrow window steps back so that the whole workspace stays in it. The far distance at a small height leaves room for the strip.
    const distance = this.view.distance * Math.max(1, 1.25 * height / width) * (height < 560 ? 1.08 : 1);
    const size = machine.isOne ? 1 : machine.length / LENGTH;
    const camera = cameraFor({ ...this.view, distance: distance * size }, [0, 0, TARGET * size], width, height);
    // From behind the base, as the camera sees it, base and floor would hide everything.
    const isBehind = this.view.elevation < -0.5;
    // Where the tip of segments in series can be has no edge that the model knows.
    const workspace = isFront => machine.isOne && this.workspace(camera, machine, colours, isLimited, isFront);
    if (!isBehind) this.floor(camera, colours, size);
    workspace(false);
    if (!isBehind) base(g, camera, { low: flat(FLOOR), top: flat(-0.25), low_radius: 3.6, top_radius: 3.1 }, colours.base, colours.deep, colours.metal);
    if (bends) this.body(camera, bends, jaw?.measured ?? null, machine, colours);
    workspace(true);
    this.path(camera, colours);
    if (wanted) this.wanted(camera, wanted, bends, jaw?.wanted ?? null, machine, colours);
    if (bends) {
      const tip = tipOf(bends, machine);
      arrow(g, camera, tip, tip.x, colours.axisX, 'x');
      arrow(g, camera, tip, tip.y, colours.axisY, 'y');
      arrow(g, camera, tip, tip.tangent, colours.axisZ, 'z');
    }
    this.numbers(camera, machine, colours, isBehind, size);
  }

  approach() {
    if (!this.goal) return;
    let rest = 0;
    for (const key of ['azimuth', 'elevation', 'distance']) {
      this.view[key] += (this.goal[key] - this.view[key]) * 0.2;
      rest += Math.abs(this.goal[key] - this.view[key]);
    }
    if (rest < 1e-3) Object.assign(this.view, this.goal);
  }

  stroke(camera, points, style, width, alpha = 1) {
    const g = this.g;
    g.globalAlpha = alpha;
    g.strokeStyle = style;
    g.lineWidth = width;
    g.beginPath();
    points.forEach((point, i) => {
      const [x, y] = camera.project(point);
      if (i) g.lineTo(x, y); else g.moveTo(x, y);
    });
    g.stroke();
    g.globalAlpha = 1;
  }

  floor(camera, colours, size) {
    for (const radius of [5, 10, 15, 20]) this.stroke(camera, circle(flat(FLOOR), radius * size, { n: 64 }), colours.floor, 1, 0.9);
    for (let i = 0; i < 4; i++) {
      const [x, y] = [20 * size * Math.cos(i * TURN / 8), 20 * size * Math.sin(i * TURN / 8)];
      this.stroke(camera, [[x, y, FLOOR], [-x, -y, FLOOR]], colours.floor, 1, 0.9);
    }
  }

  /// Where the tip can be: a dome and its edge. Half of it is painted before the snake, half after.
  workspace(camera, machine, colours, isLimited, isFront) {
    const facing = Math.atan2(camera.back[1], camera.back[0]), from = facing + (isFront ? -1 : 1) * TURN / 4;
    const tipAt = (bend, azimuth) => {
      const [r, , z] = frameAt([bend, 0], 1, machine.length).centre;
      return [r * Math.cos(azimuth), r * Math.sin(azimuth), z];
    };
    const halfRing = (bend, style, width, alpha) => {
      const [radius, , height] = tipAt(bend, 0);
      this.stroke(camera, circle(flat(height), radius, { from, to: from + TURN / 2, n: 48 }), style, width, alpha);
    };
    for (const part of [1 / 3, 2 / 3]) halfRing(machine.maxBend * part, colours.dome, 1, 0.24);
    for (let i = 0; i < 12; i++) {
      const azimuth = i * TURN / 12;
      if ((Math.cos(azimuth - facing) > 0) !== isFront) continue;
      this.stroke(camera, Array.from({ length: 15 }, (_, j) => tipAt(machine.maxBend * j / 14, azimuth)), colours.dome, 1, 0.24);
    }
    halfRing(machine.maxBend, isLimited ? colours.warn : colours.edge, isLimited ? 3.2 : 2.2, isLimited ? 1 : 0.65);
  }

  body(camera, bends, opening, machine, colours) {
    const solids = [];
    arcsOf(bends, machine).forEach((frameOf, j) => this.segment(camera, frameOf, machine.segments[j], colours, solids));
    if (opening !== null) {
      for (const points of fingers(tipOf(bends, machine), opening)) solids.push(...finger(this.g, points.map(camera.project), colours.metal, colours.deep));
    }
    solids.sort((a, b) => b.depth - a.depth);
    for (const solid of solids) solid.paint();
  }

  /// One segment: its backbone, every line that runs in it, and its disks.
  segment(camera, frameOf, { lines, pitch }, colours, solids) {
    const frames = Array.from({ length: PIECES + 1 }, (_, i) => frameOf(i / PIECES));
    const tube = (azimuth, radius, thickness, colour) => {
      const at = i => camera.project(pointIn(frames[i], radius * Math.cos(azimuth), radius * Math.sin(azimuth)));
      let last = at(0);
      for (let i = 1; i <= PIECES; i++) {
        const next = at(i);
        solids.push(tubePiece(this.g, last, next, thickness, colour, colours.deep));
        last = next;
      }
    };
    tube(0, 0, TUBE * 0.92, colours.core);
    for (const { n, azimuth, radius } of lines) tube(azimuth, radius, TUBE, colourOf(n, colours));
    for (let i = 1; i <= N_DISKS; i++) {
      const isEnd = i === N_DISKS;
      solids.push(disk(this.g, camera, frameOf(i / N_DISKS), pitch + 0.62, isEnd ? 0.9 : 0.36, colours.metal, colours.deep));
    }
  }

  path(camera, colours) {
    const steps = 24, per = Math.ceil(this.trail.length / steps);
    if (this.trail.length < 8) return;
    for (let i = 0; i < steps; i++) {
      const part = this.trail.slice(i * per, (i + 1) * per + 1);
      if (part.length > 1) this.stroke(camera, part, colours.trail, 1.5 + 3.5 * i / steps, 0.05 + 0.8 * (i / steps) ** 1.6);
    }
  }

  /// The commanded shape: a ring where the tip shall be, and the outline of the body as far as it differs.
  wanted(camera, wanted, bends, opening, machine, colours) {
    const off = bends ? degrees(Math.max(...bends.map((bend, j) => Math.hypot(bend[0] - wanted[j][0], bend[1] - wanted[j][1])))) : Infinity;
    const shown = Math.min(1, Math.max(0, (off - GHOST_FROM) / GHOST_OVER));
    this.ghost += (shown - this.ghost) * 0.12;
    arcsOf(wanted, machine).forEach((frameOf, j) => this.outline(camera, frameOf, machine.segments[j].pitch + 0.56, colours));
    const tip = tipOf(wanted, machine);
    this.stroke(camera, circle(tip, machine.segments.at(-1).pitch + 1.06), colours.ghost, 3, 0.95);
    if (opening !== null) for (const points of fingers(tip, opening)) this.stroke(camera, points, colours.ghost, 2.4, 0.95);
  }

  outline(camera, frameOf, radius, colours) {
    for (let i = 1; i < N_DISKS; i++) {
      this.stroke(camera, circle(frameOf(i / N_DISKS), radius), colours.ghost, 1.3, 0.06 + 0.42 * this.ghost);
    }
    for (const sign of [-1, 1]) {
      const rail = Array.from({ length: PIECES + 1 }, (_, i) => {
        const frame = frameOf(i / PIECES);
        const aside = unit(cross(frame.tangent, minus(camera.eye, frame.centre)));
        return frame.centre.map((c, j) => c + sign * radius * aside[j]);
      });
      this.stroke(camera, rail, colours.ghost, 1.4, 0.1 + 0.5 * this.ghost);
    }
  }

  /// A number beside each line at the base; those of the next segments further out.
  numbers(camera, { lines }, colours, isBehind, size) {
    const g = this.g;
    for (const { n, ends, azimuth } of lines) {
      const radius = ((isBehind ? 4 : 5.1) + 2.4 * ends) * size;
      const [x, y] = camera.project([radius * Math.cos(azimuth), radius * Math.sin(azimuth), isBehind ? 0 : -1.2]);
      g.fillStyle = colourOf(n, colours);
      g.beginPath();
      g.arc(x, y, 13, 0, TURN);
      g.fill();
      g.fillStyle = colours.onLine;
      g.font = '700 16px Inter, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
      g.textAlign = 'center';
      g.textBaseline = 'middle';
      g.fillText(String(n + 1), x, y + 1);
    }
  }
}

/// Lines take three colours in turn, as their bars do.
const colourOf = (n, colours) => [colours.line1, colours.line2, colours.line3][n % 3];
