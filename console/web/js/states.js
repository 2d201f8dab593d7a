// The states of the banner: a word, a sentence, a shape; any one of the three is enough. And the small marks.

const outline = 'fill="none" stroke="currentColor" stroke-width="8" stroke-linecap="round" stroke-linejoin="round"';
const cut = 'fill="none" stroke="var(--s1)" stroke-linecap="round" stroke-linejoin="round"';

export const STATES = {
  stale: { word: 'No picture', say: 'Nothing arrives from the robot.', shape: `<rect x="8" y="18" width="80" height="56" rx="6" ${outline} stroke-dasharray="14 12"/><path d="M30 92 66 4" ${outline}/>` },
  emergency: { word: 'Emergency stop', say: 'The machine’s own stop cut the drives’ power.', shape: `<rect x="8" y="8" width="80" height="80" rx="10" ${outline}/><circle cx="48" cy="48" r="31" fill="currentColor"/><circle cx="48" cy="48" r="17" ${cut} stroke-width="6"/>` },
  fault: { word: 'Fault', say: 'The drives failed; nothing may move.', shape: `<path d="M30 5h36l25 25v36L66 91H30L5 66V30z" fill="currentColor"/><path d="M48 23v31m0 17v1" ${cut} stroke-width="10"/>` },
  disabled: { word: 'Disabled', say: 'Drive power is off.', shape: `<path d="M27 23a37 37 0 1 0 42 0M48 7v38" ${outline}/>` },
  homing: { word: 'Homing', say: 'The drives are finding their zero. Keep clear.', shape: `<circle cx="48" cy="48" r="40" ${outline} stroke-dasharray="38 25"/><path d="m29 50 19-17 19 17v20H29z" fill="currentColor"/>` },
  relaxing: { word: 'Relaxing', say: 'The lines are relaxed, then power goes off.', shape: `<path d="M8 30c14-22 26 22 40 0s26 22 40 0M8 52h80" ${outline}/><path d="M48 62v26m-14-12 14 14 14-14" ${outline}/>` },
  paused: { word: 'Paused', say: 'Holding still, power on.', shape: `<rect x="8" y="8" width="80" height="80" rx="14" ${outline}/><path d="M37 32v32m22-32v32" ${outline}/>` },
  lost: { word: 'Device lost', say: 'Holding still: the operator’s controls are lost.', shape: `<path d="M48 9 90 84H6z" ${outline}/><path d="m38 46 20 22m0-22L38 68" ${outline}/>` },
  clutched: { word: 'Clutched', say: 'Your hand is free; the snake holds still.', shape: `<path d="M37 12a37 37 0 0 0 0 72z" ${outline}/><path d="M59 12a37 37 0 0 1 0 72z" ${outline}/>` },
  ready: { word: 'Ready', say: 'Holding still; no operator is present.', shape: `<circle cx="48" cy="48" r="40" ${outline}/><circle cx="48" cy="48" r="9" fill="currentColor"/>` },
  holding: { word: 'Holding', say: 'Holding still; the reasons stand on the right.', shape: `<path d="M48 7 89 48 48 89 7 48z" ${outline}/><path d="M34 48h28" ${outline}/>` },
  limited: { word: 'Limited', say: 'It follows, up to a limit.', shape: `<path d="M48 26 89 88H7z" fill="currentColor" stroke="currentColor" stroke-width="6" stroke-linejoin="round"/><path d="M8 9h80" ${outline}/><path d="M48 47v18m0 11v1" ${cut} stroke-width="9"/>` },
  following: { word: 'Following', say: 'The snake follows your hand.', shape: `<circle cx="48" cy="48" r="44" fill="currentColor"/><path d="m31 28 19 20-19 20m22-40 19 20-19 20" ${cut} stroke-width="9"/>` },
};

const mark = inner => ({ box: '0 0 30 30', inner });
export const MARKS = {
  hold: mark('<rect x="5" y="5" width="20" height="20" rx="4" fill="none" stroke="currentColor" stroke-width="3.500"/>'),
  info: mark('<path d="M15 13v10m0-16v.5" stroke="currentColor" stroke-width="4" stroke-linecap="round"/>'),
  warn: mark('<path d="m15 4 12 22H3z" fill="currentColor" stroke="currentColor" stroke-width="2" stroke-linejoin="round"/><path d="M15 12v7m0 3.500v.1" stroke="var(--s1)" stroke-width="3" stroke-linecap="round"/>'),
  fault: mark('<path d="M9.500 2h11L28 9.500v11L20.500 28h-11L2 20.500v-11z" fill="currentColor"/><path d="M15 8v9m0 5v.1" stroke="var(--s1)" stroke-width="3.400" stroke-linecap="round"/>'),
  ok: mark('<circle cx="15" cy="15" r="13" fill="currentColor"/><path d="m9 15.500 4.500 4.500L21 11" fill="none" stroke="var(--s1)" stroke-width="3.400" stroke-linecap="round" stroke-linejoin="round"/>'),
  yes: mark('<path d="m6 15 6 6L24 8" fill="none" stroke="currentColor" stroke-width="4" stroke-linecap="round" stroke-linejoin="round"/>'),
  no: mark('<circle cx="15" cy="15" r="10" fill="none" stroke="currentColor" stroke-width="4"/>'),
  unknown: mark('<path d="M10 11a5 5 0 1 1 7 4.600c-1.400.8-2 1.700-2 3.400m0 5v.1" fill="none" stroke="currentColor" stroke-width="3.600" stroke-linecap="round"/>'),
};

/// Two tones or three for a state, in hertz; silence for the rest.
export const TONES = { following: [660, 880], ready: [440], clutched: [440], paused: [440, 330], relaxing: [330, 440], disabled: [330], emergency: [300, 220, 300], fault: [300, 220, 300], stale: [220, 220], lost: [300, 220] };
