// The shape of a snake, or of several in series, and the camera that looks at it: pure geometry, millimetres in the frame `base` of
// docs/NOTATION.md.

export const TURN = 2 * Math.PI;
export const degrees = radians => radians * 180 / Math.PI;
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = a => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };

/// Frame at part s (0 to 1) of a circular arc: centre, the disk's x and y, and the tangent. The bending plane's azimuth is -delta.
export function frameAt(bend, s, length) {
  const size = Math.hypot(bend[0], bend[1]);
  const [ux, uy] = size > 1e-9 ? [bend[0] / size, -bend[1] / size] : [1, 0];
  const angle = size * s, sin = Math.sin(angle), cos = Math.cos(angle);
  const aside = size > 1e-6 ? length * (1 - cos) / size : 0;
  const along = size > 1e-6 ? length * sin / size : length * s;
  // The disk turns about the normal of the bending plane and does not twist.
  const turned = (x, y) => {
    const inPlane = x * ux + y * uy, across = -x * uy + y * ux;
    return [inPlane * cos * ux - across * uy, inPlane * cos * uy + across * ux, -inPlane * sin];
  };
  return { centre: [aside * ux, aside * uy, along], x: turned(1, 0), y: turned(0, 1), tangent: [sin * ux, sin * uy, cos] };
}

/// A point given in a frame.
export const pointIn = (frame, x, y, z = 0) => [0, 1, 2].map(i => frame.centre[i] + x * frame.x[i] + y * frame.y[i] + z * frame.tangent[i]);

/// A frame that is given in another one, given like that one.
function within(outer, inner) {
  const turned = v => [0, 1, 2].map(i => v[0] * outer.x[i] + v[1] * outer.y[i] + v[2] * outer.tangent[i]);
  return { centre: pointIn(outer, ...inner.centre), x: turned(inner.x), y: turned(inner.y), tangent: turned(inner.tangent) };
}

/// The segments of a machine, the snake's one or those in series: length, the lines that run in it, and whether each ends there. A line
/// keeps its place in every segment that it passes.
export function machineOf(facts) {
  const own = facts.joints?.segments ?? [{ l_m: facts.l_m, lines: [0, 1, 2].map(i => ({ azimuth_rad: i * TURN / 3, r_m: facts.r_m })) }];
  let n = 0;
  const lines = own.flatMap(({ lines }, j) => lines.map(({ azimuth_rad, r_m }) => ({ n: n++, ends: j, azimuth: azimuth_rad, radius: r_m * 1e3 })));
  const segments = own.map(({ l_m }, j) => {
    const passing = lines.filter(line => line.ends >= j);
    return { length: l_m * 1e3, lines: passing, pitch: Math.max(...passing.map(line => line.radius)) };
  });
  const length = segments.reduce((sum, segment) => sum + segment.length, 0);
  return { segments, lines, length, maxBend: facts.max_bend_rad, isOne: !facts.joints };
}

/// Bend vectors of all segments from the numbers that stand one after the other; nothing where nothing was measured.
export const pairs = values => values ? values.flatMap((x, i) => i % 2 ? [] : [[x, values[i + 1]]]) : null;

/// For each segment its frame at a part s (0 to 1) of its arc; a segment stands on the end of the one before.
export function arcsOf(bends, { segments }) {
  let foot = null;
  return segments.map(({ length }, j) => {
    const on = foot, at = s => on ? within(on, frameAt(bends[j], s, length)) : frameAt(bends[j], s, length);
    foot = at(1);
    return at;
  });
}

/// The frame of the last disk.
export const tipOf = (bends, machine) => arcsOf(bends, machine).at(-1)(1);

/// A frame that lies flat at a height.
export const flat = z => ({ centre: [0, 0, z], x: [1, 0, 0], y: [0, 1, 0], tangent: [0, 0, 1] });

/// Points of a circle in a frame.
export function circle(frame, radius, { from = 0, to = TURN, z = 0, n = 40 } = {}) {
  return Array.from({ length: n + 1 }, (_, i) => {
    const angle = from + (to - from) * i / n;
    return pointIn(frame, radius * Math.cos(angle), radius * Math.sin(angle), z);
  });
}

/// Length of a finger of the jaw, mm, and of each from the middle. A model has the jaw's angle; its size, and the plane in which it
/// opens, which is that of the tip's x here, are made up, and the page says so.
export const FINGER = 5, FINGER_ASIDE = 0.7;

/// Both fingers of a jaw at a frame, each as points from its root to its end; `opening` is the angle between them, rad.
export function fingers(frame, opening) {
  return [-1, 1].map(side => [0, 1 / 3, 2 / 3, 1].map(part => {
    const along = FINGER * part;
    return pointIn(frame, side * (FINGER_ASIDE + along * Math.sin(opening / 2)), 0, 0.45 + along * Math.cos(opening / 2));
  }));
}

/// Views by name. `camera` looks along the straight snake, as the frame `view` does: x right, y down.
export const VIEWS = {
  oblique: { azimuth: -0.62, elevation: 0.30, distance: 85 },
  side: { azimuth: 0, elevation: 0.02, distance: 85 },
  camera: { azimuth: 0, elevation: -Math.PI / 2, distance: 96 },
};

/// A view by name; the camera is turned about the straight snake by its roll.
export const viewNamed = (name, roll) => name === 'camera' ? { ...VIEWS.camera, azimuth: roll } : VIEWS[name] ?? null;

/// A perspective camera that looks at a target; `project` gives x, y, depth and pixels per millimetre.
export function cameraFor({ azimuth, elevation, distance }, target, width, height) {
  const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
  const right = [ca, sa, 0], back = [ce * sa, -ce * ca, se], up = [-se * sa, se * ca, ce];
  const eye = target.map((t, i) => t + distance * back[i]);
  const focal = height / 2 / Math.tan(Math.PI / 12);
  const project = point => {
    const to = minus(point, eye), depth = -dot(to, back);
    return [width / 2 + focal * dot(to, right) / depth, height / 2 - focal * dot(to, up) / depth, depth, focal / depth];
  };
  return { eye, back, project };
}
