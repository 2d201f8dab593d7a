//! The model of joints, checked, and its predictor: one step for each row of commands.

use super::{JointEffect, MAX_JOINTS, N_STATES, Now, hysteresis, position, rate};
use crate::chain::DelayLine;
use crate::effects::formula::Formula;
use crate::effects::formula_variables::joint_values;
use crate::effects::varying::VaryingStep;
use crate::effects::{Definition, EffectKind, Hook, MAX_COLUMNS, MAX_PARAMETERS};
use crate::model_file::{Joints, Known};
use crate::{ChainError, Circumstances, EffectSetting, KnownColumns, LearntParameter};

/// Joints with their effects, checked.
#[derive(Clone, Debug)]
pub struct JointChain {
    joints: Joints,
    stages: Vec<Stage>,
    learnt: Vec<LearntParameter>,
    columns: Vec<String>,
}

/// One effect, ready to run.
#[derive(Clone, Debug)]
struct Stage {
    what: What,
    /// The joint, from 0; `None`: every joint.
    joint: Option<usize>,
    /// Parameters behind `joint`.
    c: [f64; MAX_PARAMETERS],
    varying: Option<VaryingStep>,
}

#[derive(Clone, Debug)]
enum What {
    Effect(JointEffect),
    Formula(Box<Formula>),
}

/// Predicts measured positions step by step; owns the memory of every effect.
#[derive(Clone, Debug)]
pub struct JointPredictor {
    chain: JointChain,
    states: Vec<[[f64; N_STATES]; MAX_JOINTS]>,
    /// One for each latency and joint, in the order of the effects.
    delays: Vec<DelayLine<f64>>,
    first_s: Option<f64>,
    last_s: f64,
    u: [f64; MAX_JOINTS],
    y: [f64; MAX_JOINTS],
    /// Sign of each command's last change.
    motion: [f64; MAX_JOINTS],
    /// The columns, each as it was last measured; NaN before.
    columns: [f64; MAX_COLUMNS],
    parts: JointParts,
    n_formula_faults: u64,
}

/// What a step was made of: y = G (passed + added) + c + behind, joint by joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointParts {
    /// The commands as the effects that pass them on leave them.
    pub passed: [f64; MAX_JOINTS],
    /// What the effects that add have added.
    pub added: [f64; MAX_JOINTS],
    /// What the effects at the sensor and formulas have added.
    pub behind: [f64; MAX_JOINTS],
}

/// More effects than this are refused.
const MAX_EFFECTS: usize = 32;

impl JointChain {
    /// Checks joints and effects.
    ///
    /// # Errors
    /// [`ChainError`] for an effect that is not a joint's, a joint that there is not, too many effects, a formula, or a column
    /// that is not there.
    pub fn new(joints: &Joints, effects: &[EffectSetting], columns: KnownColumns) -> Result<Self, ChainError> {
        if effects.len() > MAX_EFFECTS {
            return Err(ChainError::TooMany { found: effects.len(), limit: MAX_EFFECTS });
        }
        let names = column_names(effects, columns)?;
        let stages = effects.iter().map(|effect| stage(effect, joints.n, columns, &names)).collect::<Result<_, _>>()?;
        Ok(Self { joints: joints.clone(), stages, learnt: crate::chain::learnt(effects)?, columns: names })
    }

    /// The parameters that are learnt while the joints move, in the order of the effects.
    pub fn learnt(&self) -> &[LearntParameter] {
        &self.learnt
    }

    /// The columns with names of their own that the effects need, in the order of [`Circumstances::columns`].
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// A predictor whose memory is fresh.
    pub fn predictor(&self) -> JointPredictor {
        let is_latency = |stage: &&Stage| matches!(stage.what, What::Effect(JointEffect::Latency));
        let n_delays = self.joints.n * self.stages.iter().filter(is_latency).count();
        JointPredictor {
            states: vec![[[0.0; N_STATES]; MAX_JOINTS]; self.stages.len()],
            delays: vec![DelayLine::new(); n_delays],
            first_s: None,
            last_s: 0.0,
            u: [0.0; MAX_JOINTS],
            y: [0.0; MAX_JOINTS],
            motion: [0.0; MAX_JOINTS],
            columns: [f64::NAN; MAX_COLUMNS],
            parts: JointParts::default(),
            n_formula_faults: 0,
            chain: self.clone(),
        }
    }
}

impl JointChain {
    /// How many joints there are.
    pub fn n(&self) -> usize {
        self.joints.n
    }

    /// c of a joint, in units of y.
    pub(super) fn offset(&self, i: usize) -> f64 {
        self.joints.offset[i]
    }

    /// The first joint, from 0, whose own gain was fitted and lies within so many standard errors of zero, with both.
    pub(super) fn gain_of_chance(&self, errors: f64) -> Option<(usize, f64, f64)> {
        let own = |(i, known): (usize, &Known)| match known {
            Known::Fitted { se, .. } if self.gain(i, i).abs() < errors * se => Some((i, self.gain(i, i), *se)),
            _ => None,
        };
        self.joints.gain_known.iter().enumerate().find_map(own)
    }

    pub(super) fn gain(&self, i: usize, k: usize) -> f64 {
        self.joints.gain[i][k]
    }

    /// The definitions of the effects; formulas, which are added behind G, have none.
    pub(super) fn definitions(&self) -> impl Iterator<Item = &'static Definition> {
        self.stages.iter().filter_map(|stage| match &stage.what {
            What::Effect(kind) => Some(kind.definition()),
            What::Formula(_) => None,
        })
    }
}

/// What the inverse and the learner need to know.
impl JointPredictor {
    /// The parameters that are learnt, in the order of the effects.
    pub(super) fn learnt(&self) -> &[LearntParameter] {
        &self.chain.learnt
    }

    /// Sets a parameter that is learnt; what the effect remembers stays.
    pub(super) fn set(&mut self, effect: usize, parameter: usize, value: f64) {
        let stage = &mut self.chain.stages[effect];
        // Of an effect, the first parameter is the joint that it is of, which is not learnt.
        let behind = usize::from(matches!(stage.what, What::Effect(_)));
        stage.c[parameter - behind] = value;
    }

    pub(super) fn n(&self) -> usize {
        self.chain.joints.n
    }

    /// c of a joint, in units of y.
    pub(super) fn offset(&self, i: usize) -> f64 {
        self.chain.offset(i)
    }

    /// What the transmission made of the last commands, in units of u.
    pub(super) fn x(&self, joint: usize) -> f64 {
        self.parts.passed[joint] + self.parts.added[joint]
    }

    /// What the measured position of the last step has besides G of that, in units of y.
    pub(super) fn beside(&self, i: usize) -> f64 {
        self.chain.joints.offset[i] + self.parts.behind[i]
    }

    /// Takes over what another predictor of the same chain remembers. Allocates nothing; delays are not taken over, because
    /// no chain with a latency has an inverse.
    pub(super) fn remember_as(&mut self, other: &Self) {
        self.states.copy_from_slice(&other.states);
        (self.first_s, self.last_s) = (other.first_s, other.last_s);
        (self.u, self.y, self.motion, self.parts) = (other.u, other.y, other.motion, other.parts);
        self.columns = other.columns;
        self.n_formula_faults = other.n_formula_faults;
    }
}

/// The columns that the effects name, each once.
fn column_names(effects: &[EffectSetting], columns: KnownColumns) -> Result<Vec<String>, ChainError> {
    let mut names: Vec<String> = Vec::new();
    for effect in effects {
        for column in effect.columns() {
            if !columns.named {
                return Err(ChainError::MissingColumn { name: effect.label().to_owned(), column: column.to_owned() });
            }
            if !names.iter().any(|own| own == column) {
                names.push(column.to_owned());
            }
        }
    }
    if names.len() > MAX_COLUMNS {
        return Err(ChainError::TooManyColumns { found: names.len(), limit: MAX_COLUMNS });
    }
    Ok(names)
}

fn stage(effect: &EffectSetting, n: usize, columns: KnownColumns, names: &[String]) -> Result<Stage, ChainError> {
    let place = |column: &str| names.iter().position(|own| own == column).unwrap_or(0);
    let values = effect.values();
    let kind = match effect.kind() {
        EffectKind::Joint(kind) => kind,
        EffectKind::Formula => return formula(effect, columns, place),
        other => return Err(ChainError::OtherMachine { name: other.name(), expected: "joints" }),
    };
    let joint = values[0].round();
    if joint > n as f64 {
        let (effect, high) = (effect.kind().name(), n as f64);
        return Err(ChainError::OutOfBounds { effect, key: "joint", found: joint, low: 0.0, high, unit: "(joints)" });
    }
    let mut c = [0.0; MAX_PARAMETERS];
    c.iter_mut().zip(&values[1..]).for_each(|(own, value)| *own = *value);
    let parameters = kind.definition().parameters;
    let varying = effect.varying().and_then(|own| VaryingStep::new(parameters, own, place(&own.column)));
    Ok(Stage { what: What::Effect(kind), joint: (joint as usize).checked_sub(1), c, varying })
}

fn formula(effect: &EffectSetting, columns: KnownColumns, place: impl Fn(&str) -> usize) -> Result<Stage, ChainError> {
    let Some(text) = effect.formula_text() else {
        return Err(ChainError::OtherMachine { name: "formula", expected: "joints" });
    };
    let formula = Formula::for_joints(text, place)?;
    let missing = |column: &str| ChainError::MissingColumn { name: text.name.clone(), column: column.to_owned() };
    if formula.uses_temperature() && !columns.temperature {
        return Err(missing("temperature_c"));
    }
    if formula.uses_time() && !columns.time {
        return Err(missing("time_s"));
    }
    Ok(Stage { what: What::Formula(Box::new(formula)), joint: None, c: *effect.values(), varying: None })
}

impl Stage {
    /// Parameters behind `joint`, as the columns have them now.
    fn now(&self, columns: &[f64; MAX_COLUMNS]) -> [f64; MAX_PARAMETERS] {
        let mut c = self.c;
        if let Some(own) = &self.varying {
            let (parameter, slope) = (own.parameter - 1, own.slope - 1);
            c[parameter] = own.value(c[parameter], c[slope], columns);
        }
        c
    }

    /// Whether it changes what the sensors show, not what the transmission does.
    fn is_behind(&self) -> bool {
        match &self.what {
            What::Effect(kind) => kind.definition().hook == Hook::Meas,
            What::Formula(_) => true,
        }
    }
}

impl JointPredictor {
    /// The measured positions for the next commands, in the machine's units; commands that are not finite repeat the last ones.
    ///
    /// # Real-time
    /// No allocation, no loop longer than joints times effects.
    pub fn step(&mut self, u: &[f64], at: &Circumstances) -> &[f64] {
        let n = self.chain.joints.n;
        if u.len() != n || !u.iter().all(|u| u.is_finite()) {
            return &self.y[..n];
        }
        let fresh = self.first_s.is_none();
        let first_s = *self.first_s.get_or_insert(at.time_s);
        let dt_s = if fresh { 0.0 } else { (at.time_s - self.last_s).max(0.0) };
        let now = Now { elapsed_s: (at.time_s - first_s).max(0.0), dt_s, fresh };
        self.last_s = at.time_s;
        for ((motion, last), u) in self.motion.iter_mut().zip(&mut self.u).zip(u) {
            *motion = if fresh {
                0.0
            } else if u == last {
                *motion
            } else {
                (u - *last).signum()
            };
            *last = *u;
        }
        for (last, column) in self.columns.iter_mut().zip(at.columns).filter(|(_, column)| column.is_finite()) {
            *last = column;
        }
        let mut passed = self.u;
        let added = self.run(false, &mut passed, at, &now);
        let x: [f64; MAX_JOINTS] = core::array::from_fn(|k| passed[k] + added[k]);
        let mut y = [0.0; MAX_JOINTS];
        let rows = self.chain.joints.gain.iter().zip(&self.chain.joints.offset);
        for (y, (row, offset)) in y.iter_mut().zip(rows) {
            *y = offset + row.iter().zip(&x).map(|(g, x)| g * x).sum::<f64>();
        }
        let transmitted = y;
        self.run(true, &mut y, at, &now);
        let behind = core::array::from_fn(|k| y[k] - transmitted[k]);
        self.parts = JointParts { passed, added, behind };
        self.y = y;
        &self.y[..n]
    }

    /// Where the hysteresis of an effect, from 0 in the order of the model, begins on a joint, from 0: -1 and 1 are the two ends of its
    /// plays, 0 their middle, which is where it begins without this. Counts before the first step; another effect has nothing to begin.
    pub fn begin_at(&mut self, effect: usize, joint: usize, start: f64) {
        let is_open = self.first_s.is_none() && start.is_finite();
        if let Some(state) = self.states.get_mut(effect).and_then(|own| own.get_mut(joint)).filter(|_| is_open) {
            *state = [start.clamp(-1.0, 1.0); N_STATES];
        }
    }

    /// How often a formula was not finite since the start, and counted as zero.
    pub fn n_formula_faults(&self) -> u64 {
        self.n_formula_faults
    }

    /// What the last step was made of.
    pub fn parts(&self) -> &JointParts {
        &self.parts
    }

    /// Runs the effects before G, or those behind it, over positions, and gives what is to be added to them.
    fn run(&mut self, is_behind: bool, z: &mut [f64; MAX_JOINTS], at: &Circumstances, now: &Now) -> [f64; MAX_JOINTS] {
        let n = self.chain.joints.n;
        let mut added = [0.0; MAX_JOINTS];
        let mut delays = self.delays.chunks_exact_mut(n);
        for (stage, states) in self.chain.stages.iter().zip(&mut self.states) {
            let is_latency = matches!(stage.what, What::Effect(JointEffect::Latency));
            let mut own_delays = if is_latency && !is_behind { delays.next() } else { None };
            if stage.is_behind() != is_behind {
                continue;
            }
            let before = *z;
            let c = stage.now(&self.columns);
            for joint in (0..n).filter(|joint| stage.joint.is_none_or(|own| own == *joint)) {
                let changed = match (&stage.what, own_delays.as_mut().and_then(|delays| delays.get_mut(joint))) {
                    (What::Effect(_), Some(delay)) => delay.pass(now.elapsed_s, [before[joint], 0.0], stage.c[0])[0],
                    (What::Effect(kind), None) => {
                        let x = position::change(*kind, &c, before[joint], &before, joint);
                        let x = hysteresis::change(*kind, &c, x, &mut states[joint], now);
                        rate::change(*kind, &c, x, &mut states[joint], now)
                    }
                    (What::Formula(formula), _) => {
                        let values =
                            joint_values(self.u[joint], before[joint], self.motion[joint], joint, at, &self.columns);
                        before[joint]
                            + formula.evaluate(&values, &stage.c).unwrap_or_else(|| {
                                self.n_formula_faults += 1;
                                0.0
                            })
                    }
                };
                match &stage.what {
                    What::Effect(kind) if kind.adds() => added[joint] += changed - before[joint],
                    _ => z[joint] = changed,
                }
            }
        }
        added
    }
}
