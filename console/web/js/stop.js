// With script the stop acts on pressing down and by key; without, the form acts on letting go.
const button = document.getElementById('stop'), say = document.getElementById('say'), rest = say.textContent;
let timer = 0;

async function stop() {
  clearTimeout(timer);
  button.className = 'sent';
  say.textContent = 'sent …';
  let outcome = { is_done: false, say: 'The console does not answer. Use the machine’s emergency stop.' };
  try {
    const answer = await fetch(location.pathname, { method: 'POST', headers: { Accept: 'application/json' } });
    if (answer.ok) outcome = await answer.json();
  } catch { /* the sentence above says it */ }
  button.className = outcome.is_done ? 'done' : 'failed';
  say.textContent = outcome.say;
  if (outcome.is_done) timer = setTimeout(() => { button.className = ''; say.textContent = rest; }, 8000);
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
  const page = document.documentElement.dataset.page;
  if (page && parent !== window && event.key.length === 1 && event.key !== ' ' && !event.repeat && !event.ctrlKey && !event.metaKey && !event.altKey) parent.postMessage({ key: event.key }, page);
});
addEventListener('message', event => { if (event.origin === document.documentElement.dataset.page && event.data === 'stop') stop(); });
