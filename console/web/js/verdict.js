// What `krait verify` found, in words: the same bytes; others, and where first; or why nothing says either.
import { thousands } from './format.js';

const unknown = why => ({ mark: 'warn', word: 'Could not be verified.', say: why });
const counted = (n, one) => `${thousands(n)} ${one}${n === 1 ? '' : 's'}`;
const sentence = text => text.charAt(0).toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? '' : '.');

/// The verdict of a job that has ended. Only an answer that says so in every field is "Verified".
export function verdictOf({ stage, said, answer }) {
  if (stage === 'cancelled') return unknown('It was cancelled.');
  if (stage !== 'done') return unknown(said ? sentence(said.replace(/^krait: /, '')) : 'Its process ended without a word.');
  const { setpoints_identical, commands_identical, updates_identical, not_repeated, behind_cut, first_difference, missing } = answer ?? {};
  const numbers = [setpoints_identical, commands_identical, updates_identical, not_repeated, behind_cut];
  if (!numbers.every(Number.isInteger) || first_difference === undefined || !Array.isArray(missing)) return unknown('The answer is not one of krait verify; look at it with the command.');
  const n = setpoints_identical + commands_identical + updates_identical;
  if (first_difference) return differs(n, first_difference, answer);
  if (not_repeated) return unknown(`${counted(not_repeated, 'message')} could not be repeated: the recording holds them twice, out of order, or without what they rest on. ${counted(n, 'other')} came out the same.`);
  if (!n) return unknown('Nothing in it could be compared.');
  const cut = behind_cut ? ` ${counted(behind_cut, 'message')} at the end rest on what is behind the cut and were not compared.` : '';
  const lacks = missing.length ? ` The recording is not whole: ${sentence(missing.join('; '))}` : '';
  return { mark: 'ok', word: 'Verified.', say: `${counted(setpoints_identical, 'setpoint')}, ${counted(commands_identical, 'command')} and ${counted(updates_identical, 'model update')} came out of fresh processes byte for byte.${cut}${lacks}` };
}

/// A repetition stops at the first difference: what comes behind it rests on it.
function differs(n, { process, run, sequence, field, recorded, repeated }, { recorded_with, verified_with }) {
  const versions = recorded_with === verified_with ? '' : ` Recorded with krait ${recorded_with}, verified with krait ${verified_with}.`;
  return { mark: 'fault', word: 'Differs.', say: `First in output ${thousands(sequence)} of ${process}, run ${run}: ${field} was ${recorded} and is ${repeated} now. ${counted(n, 'message')} before it came out the same; what comes behind it was not compared.${versions}` };
}
