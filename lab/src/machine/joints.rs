//! Joints under the lab: the forward model of `krait_model::joints`, row by row.

use super::{Candidate, MachineUnderTest, OpenNumber, joint_candidates, snake};
use crate::joint::{Number, Starts};
use crate::{LabError, Measurements, Parameter, Term};
use krait_model::KnownColumns;
use krait_model::effects::{EffectKind, SLOPE};
use krait_model::joints::{JointChain, JointEffect, JointPredictor};
use krait_model::model_file::{Joints, Known, ModelFile};

/// Joints with their model.
#[derive(Clone, Debug)]
pub struct JointsLab {
    joints: Joints,
    effects: Vec<Term>,
    /// Values of the effects that the model file gives with a standard error.
    open: Vec<OpenNumber>,
    /// Where the effects' memory begins, as far as data said.
    starts: Starts,
}

impl JointsLab {
    /// The machine of a model file; `None` if it is of another kind.
    pub fn new(file: &ModelFile) -> Option<Self> {
        let krait_model::model_file::Machine::Joints(joints) = file.machine() else { return None };
        let effects = file.effects().iter().map(|effect| snake::term(effect.setting())).collect();
        Some(Self { joints: joints.clone(), effects, open: snake::open_values(file), starts: Starts::default() })
    }

    /// The same with these gains and offsets.
    pub fn calibrated(&self, gains: &[f64], offsets: &[f64]) -> Self {
        let mut own = self.clone();
        for (k, (gain, offset)) in gains.iter().zip(offsets).enumerate() {
            own.joints.gain[k][k] = *gain;
            own.joints.offset[k] = *offset;
        }
        own
    }

    /// The same with the gain or the offset of a joint, from 0, left to every fit.
    pub(super) fn with_free(&self, is_offset: bool, joint: usize) -> Self {
        let mut own = self.clone();
        let known = if is_offset { &mut own.joints.offset_known } else { &mut own.joints.gain_known };
        known[joint] = Known::Free;
        own
    }

    /// The same with these values of its own effects.
    pub(crate) fn with_effects(&self, effects: &[Term]) -> Self {
        Self { effects: effects.to_vec(), ..self.clone() }
    }

    /// Where the memory of its effects begins in each trial.
    pub(crate) fn starts(&self) -> &Starts {
        &self.starts
    }

    /// The same, beginning there.
    pub(crate) fn with_starts(&self, starts: Starts) -> Self {
        Self { starts, ..self.clone() }
    }

    /// The machine of the model file.
    pub fn joints(&self) -> &Joints {
        &self.joints
    }

    /// What is known of a joint's own gain.
    pub(crate) fn gain_known(&self, joint: usize) -> Number {
        number(self.joints.gain[joint][joint], &self.joints.gain_known[joint])
    }

    /// What is known of a joint's offset.
    pub(crate) fn offset_known(&self, joint: usize) -> Number {
        number(self.joints.offset[joint], &self.joints.offset_known[joint])
    }

    /// Commands behind the model's own effects, row after row: passed on, added, and added at the sensor.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the effects make no chain.
    pub(crate) fn parts(&self, data: &Measurements) -> Result<[Vec<f64>; 3], LabError> {
        let n = self.joints.n;
        let mut parts = [(); 3].map(|()| Vec::with_capacity(data.n_rows() * n));
        self.walk(&self.effects, data, |predictor, _| {
            let own = predictor.parts();
            for (all, own) in parts.iter_mut().zip([&own.passed, &own.added, &own.behind]) {
                all.extend_from_slice(&own[..n]);
            }
        })?;
        Ok(parts)
    }

    fn walk(
        &self,
        effects: &[Term],
        data: &Measurements,
        mut each: impl FnMut(&JointPredictor, &[f64]),
    ) -> Result<(), LabError> {
        let settings = effects.iter().map(|term| snake::setting(term, kind)).collect::<Result<Vec<_>, _>>()?;
        for setting in &settings {
            if let Some(missing) = setting.columns().find(|column| data.beside(column).is_none()) {
                let (name, column) = (setting.label().to_owned(), missing.to_owned());
                return Err(krait_model::ChainError::MissingColumn { name, column }.into());
            }
        }
        let temperature = data.temperature_c.is_some();
        let columns = KnownColumns { time: true, stem_angle: false, temperature, named: true };
        let chain = JointChain::new(&self.joints, &settings, columns)?;
        let beside: Vec<&[f64]> = chain.columns().iter().filter_map(|column| data.beside(column)).collect();
        let mut predictor = chain.predictor();
        let mut y = vec![0.0; self.joints.n];
        for row in 0..data.n_rows() {
            if data.starts_trial(row) {
                predictor = chain.predictor();
                for (effect, joint, start) in self.starts.of_trial(data.trial[row]) {
                    predictor.begin_at(effect, joint, start);
                }
            }
            let mut at = snake::circumstances(data, row);
            at.columns.iter_mut().zip(&beside).for_each(|(own, column)| *own = column[row]);
            y.copy_from_slice(predictor.step(data.input(row), &at));
            each(&predictor, &y);
        }
        Ok(())
    }

    /// The number of an effect, by its name in model files, that may depend on a column.
    pub fn varying_number(&self, effect: &str) -> Option<&'static str> {
        crate::joint::varying_number_of(effect)
    }

    /// Units of the definitions are those of u and y; a model file says which these are.
    pub(crate) fn unit(&self, unit: &str) -> String {
        match unit {
            "u" => self.joints.u_unit.clone(),
            "y" => self.joints.y_unit.clone(),
            "1/u" => format!("1/{}", self.joints.u_unit),
            "u/s" => format!("{}/s", self.joints.u_unit),
            "y/s" => format!("{}/s", self.joints.y_unit),
            "1/u^2" => format!("1/{}^2", self.joints.u_unit),
            other => other.to_owned(),
        }
    }
}

impl MachineUnderTest for JointsLab {
    fn kind(&self) -> &'static str {
        "joints"
    }

    fn error_unit(&self) -> (&str, f64) {
        match self.joints.y_unit.as_str() {
            "rad" => ("deg", 180.0 / core::f64::consts::PI),
            own => (own, 1.0),
        }
    }

    fn input_unit(&self) -> &str {
        &self.joints.u_unit
    }

    fn as_joints(&self) -> Option<&JointsLab> {
        Some(self)
    }

    fn calibrated_on(&self, data: &Measurements) -> Result<Option<Box<dyn MachineUnderTest>>, LabError> {
        Ok(Some(Box::new(crate::joint::calibrated(self, data)?)))
    }

    fn effects(&self) -> &[Term] {
        &self.effects
    }

    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError> {
        if let Some(own) = snake::formula_parameters(term) {
            return Ok(own);
        }
        let own = kind(&term.name)?.definition().parameters.iter().map(snake::own_parameter);
        // The number of a joint, and of the one that acts on it.
        let most = |parameter: &Parameter| match parameter.name.as_str() {
            "joint" | "from" => self.joints.n as f64,
            _ => parameter.high,
        };
        let with_unit = |own: Parameter| Parameter { unit: self.unit(&own.unit), high: most(&own), ..own };
        let mut all: Vec<Parameter> = own.map(with_unit).collect();
        if let Some(varying) = &term.varying {
            let unit = all.iter().find(|own| own.name == varying.parameter).map_or("1", |own| own.unit.as_str());
            let unit = format!("{unit} per {}", varying.column);
            let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
            all.push(Parameter { name: SLOPE.to_owned(), unit, low, high, default: 0.0 });
        }
        Ok(all)
    }

    fn open_numbers(&self) -> Vec<OpenNumber> {
        self.open.clone()
    }

    fn candidates(&self, data: &Measurements) -> Vec<Candidate> {
        joint_candidates::all(data)
    }

    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let mut outputs = Vec::with_capacity(data.n_outputs * data.n_rows());
        self.walk(effects, data, |_, y| outputs.extend_from_slice(y))?;
        Ok(outputs)
    }
}

fn number(value: f64, known: &Known) -> Number {
    match known {
        Known::Absent | Known::Free => Number::Free,
        Known::Held => Number::Held(value),
        Known::Fitted { se, .. } => Number::Near(value, *se),
    }
}

/// The effect of joints that a name stands for.
pub(super) fn kind(name: &str) -> Result<EffectKind, LabError> {
    JointEffect::from_name(name).map(EffectKind::Joint).ok_or_else(|| LabError::UnknownEffect {
        name: name.to_owned(),
        machine: "joints",
        nearest: super::nearest(name, JointEffect::ALL.iter().map(|effect| effect.name())),
    })
}
