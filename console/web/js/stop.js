// With script the stop acts on pressing down and by key; without, the form acts on letting go.
const button = document.getElementById('stop'), say = document.getElementById('say'), rest = say.textContent, page = document.documentElement.dataset.page;
let timer = 0, nth = 0;
// Whoever pressed waits no longer than this to be told that nothing is confirmed.
const ANSWERS_WITHIN_MS = 1500, NO_ANSWER = { is_done: false, say: 'The console does not answer. Use the machine’s emergency stop.' };

async function stop() {
  const own = ++nth, tell = outcome => {
    // Only the newest press speaks.
    if (own !== nth) return;
    clearTimeout(timer);
    button.className = outcome.is_done ? 'done' : 'failed';
    say.textContent = outcome.say;
    if (outcome.is_done) timer = setTimeout(() => { button.className = ''; say.textContent = rest; }, 8000);
  };
  clearTimeout(timer);
  button.className = 'sent';
  say.textContent = 'sent …';
  // An answer that comes later still is shown in its place.
  timer = setTimeout(() => tell(NO_ANSWER), ANSWERS_WITHIN_MS);
  try {
    const answer = await fetch(location.pathname, { method: 'POST', headers: { Accept: 'application/json' } });
    tell(answer.ok ? await answer.json() : NO_ANSWER);
  } catch { tell(NO_ANSWER); }
}

// The keyboard comes along, also with a finger, which does not bring it by itself.
button.addEventListener('pointerdown', event => { if (event.button === 0) { stop(); button.focus(); } });
// What a pointer (detail above 0) or a key clicks has already stopped when it was pressed down; a screen reader's click has not.
button.addEventListener('click', event => { event.preventDefault(); if (event.detail === 0) stop(); });
addEventListener('keydown', event => {
  if (!['Escape', 'Enter', ' '].includes(event.key)) return;
  event.preventDefault();
  if (!event.repeat) stop();
});
// Whoever pressed the stop has the keyboard here; the letters of the other commands go on to the page.
addEventListener('keydown', event => {
  if (page && parent !== window && event.key.length === 1 && event.key !== ' ' && !event.repeat && !event.ctrlKey && !event.metaKey && !event.altKey) parent.postMessage({ key: event.key, at: performance.timeOrigin + event.timeStamp }, page);
});
// The page's Escape comes here, once the page knows that somebody is here.
if (page && parent !== window) parent.postMessage('here', page);
addEventListener('message', event => { if (event.origin === page && event.data === 'stop') stop(); });
