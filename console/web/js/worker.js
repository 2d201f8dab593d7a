// The worker: keeps the live connection, paints the pictures, and blanks them when nothing new arrives, even if the page hangs.
import { Curve } from './curve.js';
import { Scene } from './scene.js';
import { degrees, machineOf, pairs } from './snake.js';

const STALE_MS = 500, PATIENCE_MS = [0, 500, 1000, 2000, 5000], PING_EVERY_MS = 1000;
const canvases = {};
let scene = null, strip = null, replay = null, socket = null, colours = null, facts = null, machine = null, frame = null;
let arrived = -Infinity, attempt = 0, isShown = true, isBlank = true, session = null, offset = null, ahead = anyOffset(), lastShape = null, recorded = null, glass = null;

const tell = (k, rest) => postMessage({ k, ...rest });

// Between what the server's clock less this page's lies, ms, for all that is known.
function anyOffset() { return { least: -Infinity, most: Infinity }; }

// The server stamped a message before it came here, and an answer after it was asked for. Bounds that the clocks have drifted out of
// since (a page by way of another machine) give way to the new ones.
function narrow(stamp, asked, came) {
  const least = stamp - came, most = stamp - asked, within = value => Math.min(Math.max(value, least), most);
  ahead = { least: within(ahead.least), most: within(ahead.most) };
  offset = ahead.most === Infinity ? null : (ahead.least + ahead.most) / 2;
}

/// An instant of the page, ms since 1970, on the server's clock: when a hand pressed, however long the page has hung since.
const onServer = at => at - performance.timeOrigin + offset;

const machineSaid = facts => JSON.stringify({ ...facts, recording: null, compensation: null });

function connect() {
  const url = `ws://${self.location.host}/live`;
  socket = new WebSocket(url);
  socket.onopen = () => { attempt = 0; ping(); };
  socket.onmessage = event => take(JSON.parse(event.data));
  socket.onclose = () => {
    offset = null;
    ahead = anyOffset();
    setTimeout(connect, PATIENCE_MS[Math.min(attempt++, PATIENCE_MS.length - 1)]);
  };
}

function take(message) {
  switch (message.k) {
    case 'frame': return takeFrame(message);
    case 'hello':
      // Another console, or a chain of another machine: recording and compensation are the chain's, all else the machine's.
      if (session !== null && (session !== message.session || machineSaid(message.facts) !== machineSaid(facts))) return tell('reload', {});
      session = message.session;
      facts = message.facts;
      // Of joints nothing is known but their positions, which the page shows as bars.
      machine = facts.joints && !facts.joints.segments.length ? null : machineOf(facts);
      return tell('hello', { hello: message });
    case 'pong': return narrow(message.now_ms, message.t, performance.now());
    default: return tell(message.k, { message });
  }
}

function takeFrame(message) {
  frame = message;
  arrived = performance.now();
  narrow(frame.t_ms, -Infinity, arrived);
  if (!facts) return;
  const bends = machine && shapeOf(frame).bends;
  if (bends && frame.shown !== 'stale') scene?.remember(bends, machine);
  strip?.add(frame.t_ms, frame.err_rms === null ? null : frame.err_rms * facts.per_si);
}

/// Measured and wanted bend vectors of a frame, or of a picture of a recording.
function shapeOf({ bend, setpoint, joints }) {
  if (machine.isOne) return { bends: bend && [bend], wanted: setpoint && [setpoint] };
  // Positions of another machine than this page's are none that can be drawn.
  const own = values => values?.length === 2 * machine.segments.length ? pairs(values) : null;
  return { bends: own(joints?.measured), wanted: own(joints?.wanted) };
}

function ping() {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ k: 'ping', t: performance.now() }));
}

/// How long after it was sent the newest frame came, ms: a slow way keeps frames of long ago in its buffers. 0 where that is not known.
const late = () => frame && offset !== null ? Math.max(0, arrived + offset - frame.t_ms) : 0;

function blank() {
  scene?.clear();
  strip?.clear();
  isBlank = true;
}

function paint() {
  requestAnimationFrame(paint);
  const now = performance.now(), since = now - arrived;
  const age = frame?.age_ms === null || !frame ? Infinity : frame.age_ms + late() + since;
  const isLate = late() > STALE_MS, isStale = since > STALE_MS || !frame || frame.shown === 'stale' || isLate;
  if (isStale) {
    if (!isBlank) blank();
    tell('stale', { age, hasConnection: socket?.readyState === WebSocket.OPEN && since < STALE_MS, lateMs: isLate ? late() : null });
    return;
  }
  if (frame === lastShape && !scene?.goal) return tell('frame', { frame, age, glass });
  lastShape = frame;
  isBlank = false;
  if (isShown && colours && facts) {
    if (machine) scene?.draw({ ...shapeOf(frame), jaw: opened(frame.jaw), machine, colours, isLimited: frame.shown === 'limited' });
    strip?.draw(frame.t_ms, frame.sigma ? Math.SQRT2 * degrees(frame.sigma) : 0, colours, { unit: facts.unit === 'mm' ? '' : '°', least: facts.joints ? 0.1 : 1.1 });
  }
  // Glass latency: from the stamp of the state in shared memory to here, where its picture is painted.
  const isPainted = isShown && offset !== null && frame.age_ms !== null;
  glass = isPainted ? performance.now() + offset - (frame.t_ms - frame.age_ms) : null;
  tell('frame', { frame, age, glass, isPainted });
}

/// How far a jaw is and shall be open: the angle from where it is closed.
function opened(jaw) {
  if (!jaw || !facts.jaw) return null;
  const from = value => value === null ? null : Math.max(0, value - facts.jaw[0]);
  return { measured: from(jaw.measured), wanted: from(jaw.wanted) };
}

/// A picture of a recording: painted when it changes, and by nothing that is live.
function paintReplay() {
  if (!replay || !recorded || !machine || !colours) return;
  replay.draw({ ...shapeOf(recorded), jaw: opened(recorded.jaw), machine, colours, isLimited: false });
}

onmessage = ({ data }) => {
  switch (data.k) {
    case 'canvas':
      canvases[data.name] = data.canvas;
      if (data.name === 'scene') scene = new Scene(data.canvas);
      if (data.name === 'replay') replay = new Scene(data.canvas);
      if (data.name === 'strip') strip = new Curve(data.canvas, 20);
      break;
    case 'size': ({ scene, strip, replay })[data.name]?.resize(data.width, data.height, data.ratio); lastShape = null; if (data.name === 'replay') paintReplay(); break;
    case 'colours': colours = data.colours; lastShape = null; paintReplay(); break;
    case 'picture': {
      recorded = data;
      if (data.isJump) replay?.clear();
      const bends = machine && shapeOf(data).bends;
      if (bends) replay?.remember(bends, machine);
      paintReplay();
      break;
    }
    case 'forget': recorded = null; replay?.clear(); break;
    case 'turn': ({ scene, replay })[data.name]?.turn(data.azimuth, data.elevation); lastShape = null; paintReplay(); break;
    case 'zoom': ({ scene, replay })[data.name]?.zoom(data.factor); lastShape = null; paintReplay(); break;
    case 'view': scene?.preset(data.name, facts?.view_roll_rad ?? 0); lastShape = null; break;
    case 'shown': isShown = data.isShown; lastShape = null; break;
    case 'wish':
      // Without a connection nothing is kept for later: the page says so when no answer comes.
      if (socket?.readyState === WebSocket.OPEN && offset !== null) {
        socket.send(JSON.stringify({ k: 'wish', id: data.id, wish: data.wish, session, at_ms: onServer(data.at) }));
      }
      break;
    case 'take':
      if (socket?.readyState === WebSocket.OPEN && offset !== null) {
        socket.send(JSON.stringify({ k: 'take', id: data.id, session, at_ms: onServer(data.at) }));
      }
      break;
    case 'hand':
      // Where the way is blocked nothing queues up.
      if (socket?.readyState === WebSocket.OPEN && offset !== null && socket.bufferedAmount === 0) {
        socket.send(JSON.stringify({ k: 'pad', n: data.n, held: data.held, x: data.x, y: data.y, jaw: data.jaw, session, at_ms: onServer(data.at) }));
      }
      break;
    case 'connect': connect(); setInterval(ping, PING_EVERY_MS); requestAnimationFrame(paint); break;
  }
};
