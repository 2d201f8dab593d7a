// A quiz for learners: one effect is hidden. What the model leaves as pictures, names to guess from, the answer and why.
// What is hidden is known to the server's files alone until the guess is right or somebody gives up.
import { titled } from './answers.js';
import { make, sign } from './format.js';
import { residualPictures, sketch } from './pictures.js';
import { prime, reportLink, run, say, second, tile } from './work.js';

const LEVELS = [['easy', 'four times the noise: a look at the pictures shows it'], ['medium', 'twice the noise'], ['hard', 'as large as the noise']];
let level = 'easy', number = '', riddle = null;

export function showQuiz() { riddle === null ? askWhich() : riddle.draw(); }

/// A job may end after somebody has gone on to another step.
const redraw = () => { if (document.getElementById('lab').classList.contains('asks')) showQuiz(); };

function radio(group, value, isChecked, ...words) {
  const input = document.createElement('input');
  Object.assign(input, { type: 'radio', name: group, value, checked: isChecked, required: true });
  return make('label', '', input, make('span', '', ...words));
}

/// A form and the button that sends it; Enter in the form does the same.
function form(id, text, act, ...content) {
  const made = make('form', 'quiz-form', ...content), button = prime(text);
  made.id = id;
  Object.assign(button, { type: 'submit' }).setAttribute('form', id);
  made.addEventListener('submit', event => { event.preventDefault(); act(new FormData(made)); });
  return [made, button];
}

function askWhich(complaint = '') {
  riddle = null;
  const seed = document.createElement('input'), says = make('p', 'complaint', complaint);
  Object.assign(seed, { name: 'seed', inputMode: 'numeric', autocomplete: 'off', size: 8, value: number });
  says.setAttribute('role', 'alert');
  const [made, begin] = form('quiz-new', 'Begin', start,
    make('fieldset', '', make('legend', '', 'How large the effect is'), ...LEVELS.map(([name, says]) => radio('level', name, name === level, make('b', '', name), ` ${says}`))),
    make('label', 'seed', make('b', '', 'Number '), seed, ' the same number gives everybody the same riddle; without one, any'), says);
  say('One effect is hidden. Which one?', 'A simulated snake has one effect that the model lacks. You see what the model leaves of its recording, and guess.', [made], [begin]);
}

async function start(chosen) {
  level = chosen.get('level');
  number = chosen.get('seed').trim();
  if (!/^\d{0,6}$/.test(number)) { askWhich(`“${number}” is no number of a riddle; it has one to six digits.`); return; }
  const made = await run({ verb: 'quiz', level, seed: number === '' ? null : Number(number) }, 'Hiding an effect …', showQuiz);
  if (!made) return;
  const name = made.data.split('/').at(-1);
  const look = await run({ verb: 'look', riddle: name }, 'Comparing the model with its recording …', showQuiz);
  if (!look) return;
  riddle = { name, number: name.match(/\d+/)[0], level, look, choices: made.choices.map((choice, i) => ({ name: choice, says: made.explanations[i], isWrong: false })), draw: () => askGuess() };
  redraw();
}

const described = (name, says) => says ? `${name}: ${says.title}` : name;
const pictures = () => residualPictures(riddle.look.curves, riddle.look.error.noise_floor);

function askGuess(answer = null) {
  const { rms, noise_floor: floor, unit } = riddle.look.error, size = value => `${value.toFixed(2)}${sign(unit)}`;
  const choices = riddle.choices.map(choice => {
    const label = radio('guess', choice.name, false, make('b', '', described(choice.name, choice.says)), make('em', '', choice.isWrong ? ' Not this one.' : ` ${choice.says?.what ?? ''}`));
    label.firstChild.disabled = choice.isWrong;
    return label;
  });
  const [made, button] = form('quiz-guess', 'Guess', chosen => guess(chosen.get('guess')), make('fieldset', '', make('legend', '', 'Which effect is it?'), ...choices));
  say(answer ?? `Riddle ${riddle.number}, ${riddle.level}: which effect is hidden?`, `The model is off by ${size(rms)} (rms)${floor === null ? '' : `; the measurement’s own noise is ${size(floor)}`}.`, [pictures(), made],
    [button, second('Give up', () => guess(null)), reportLink('look', 'More pictures'), second('Another riddle', () => askWhich())]);
}

async function guess(name) {
  const answer = await run({ verb: 'guess', riddle: riddle.name, guess: name }, 'Judging …', showQuiz);
  if (!answer) return;
  if (answer.hidden === null) {
    riddle.choices.forEach(choice => { choice.isWrong ||= choice.name === name; });
    const what = riddle.choices.find(choice => choice.name === name)?.says?.what;
    riddle.draw = () => askGuess(`No, it is not ${name}.${what ? ` With it: ${what}` : ''}`);
  } else {
    const hidden = answer.hidden.join(' and ');
    const title = { right: `Right: it is ${hidden}.`, 'look-alike': `Right as far as anybody can tell: these data show ${name} and ${hidden} alike.` }[answer.judgement] ?? `It was ${hidden}.`;
    riddle.draw = () => tell(title, answer);
  }
  redraw();
}

function tell(title, answer) {
  const { unit } = riddle.look.error, size = value => `${value.toFixed(2)}${sign(unit)}`;
  const words = answer.hidden.map((name, i) => card(titled({ effect: name, title: answer.titles[i] }), answer.explanations[i]));
  say(title, 'This is why:', [make('div', 'effects', ...words), make('div', 'tiles', tile('the effect alone, rms', size(answer.effect_rms_deg)), tile('the noise, rms', size(answer.noise_rms_deg))), pictures()],
    [prime('Another riddle', () => askWhich()), second('How the lab finds it', solve), reportLink('look', 'More pictures')]);
}

function card(title, says, ...more) {
  const words = says ? [make('p', '', says.what), make('p', '', make('b', '', 'To check on the machine: '), says.check)] : [];
  return make('div', 'effect', make('h3', '', title), ...words, ...more);
}

async function solve() {
  const answer = await run({ verb: 'solve', riddle: riddle.name }, 'Trying every effect …', showQuiz);
  if (!answer) return;
  const back = riddle.draw, found = answer.effects.length ? answer.effects : answer.partial;
  const cards = found.map(own => card(titled(own), own.explanation, ...(own.sketch ? [sketch(own.sketch)] : []), make('p', '', `The error falls from ${own.heldout_rms.before.toFixed(2)} to ${own.heldout_rms.after.toFixed(2)}${sign(own.unit)}; it came out best in ${(100 * own.probability).toFixed(0)} of 100 resamplings.`)));
  riddle.draw = () => say(`The lab says: ${answer.sentence}.`, 'It tried every effect that it knows, alone and in pairs, on data that it was not fitted to.', [make('div', 'effects', ...cards)], [prime('Back to the answer', () => { riddle.draw = back; back(); }), reportLink('solve', 'Its pictures')]);
  redraw();
}
