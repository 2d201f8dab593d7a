// The beginning: the token from the address becomes a cookie and leaves the address bar; then the pages are set up.
import { connect, lend, on } from './link.js';
import { onVisit, start } from './shell.js';
import { startCommands } from './commands.js';
import './operate.js';
import { startPad } from './pad.js';
import './latency.js';
import { showLatency } from './doctor.js';
import { showLab } from './lab.js';
import { showRecordings } from './recordings.js';

async function enter() {
  const token = location.hash.slice(1);
  if (!token) return;
  history.replaceState(null, '', '/');
  const answer = await fetch('/token', { method: 'POST', body: token });
  if (!answer.ok) {
    document.getElementById('blank-title').textContent = 'This address is of another console';
    document.getElementById('blank-text').textContent = await answer.text();
    throw new Error('the token was refused');
  }
}

on('reload', () => location.reload());
onVisit('latency', showLatency);
onVisit('lab', showLab);
onVisit('recordings', showRecordings);
start();
startCommands();
startPad();
lend('scene', document.getElementById('scene'));
lend('strip', document.getElementById('strip'));
await enter();
connect();
