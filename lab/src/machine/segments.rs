//! Segments in series under the lab: the forward model of all of them on their lines, row by row.

use super::snake::{own_parameter, term};
use super::{Candidate, MachineUnderTest, OpenNumber, acting, nearest, snake, snake_candidates};
use crate::{LabError, Measurements, Parameter, Term};
use krait_model::EffectSetting;
use krait_model::effects::{EffectKind, SegmentEffect, SegmentLaw};
use krait_model::model_file::{Machine, ModelFile};
use krait_model::segments::{
    Bends, LineValues, SEGMENT_EFFECTS, SegmentChain, SegmentPredictor, Segments, SegmentsParameters,
};

/// Segments with their model.
#[derive(Clone, Debug)]
pub struct SegmentsLab {
    parameters: SegmentsParameters,
    segments: Segments,
    effects: Vec<Term>,
    open: Vec<OpenNumber>,
}

impl SegmentsLab {
    /// The machine of a model file; `None` if it is of another kind.
    pub fn new(file: &ModelFile) -> Option<Self> {
        let Machine::Segments(parameters) = file.machine() else { return None };
        let segments = Segments::new(parameters).ok()?;
        let effects = file.effects().iter().map(|effect| term(effect.setting())).collect();
        let mut open = snake::open_values(file);
        let is_open =
            |own: &OpenNumber| open.iter().any(|other| (other.effect, other.parameter) == (own.effect, own.parameter));
        let learnt: Vec<OpenNumber> = learnt_values(file).filter(|own| !is_open(own)).collect();
        open.extend(learnt);
        Some(Self { parameters: parameters.clone(), segments, effects, open })
    }

    /// The chain of a list of effects, in the order in which they act.
    fn chain(&self, effects: &[Term]) -> Result<SegmentChain, LabError> {
        let order = acting(self.effects.len(), effects).into_iter().map(|k| &effects[k]);
        let settings: Vec<EffectSetting> = order.map(|own| snake::setting(own, kind)).collect::<Result<_, _>>()?;
        Ok(SegmentChain::new(&self.parameters, &settings)?)
    }

    /// The forward model over all rows, which `take` sees after each of them with its time, s.
    fn run(
        &self,
        effects: &[Term],
        data: &Measurements,
        mut take: impl FnMut(&mut SegmentPredictor, f64),
    ) -> Result<(), LabError> {
        let chain = self.chain(effects)?;
        let mut predictor = chain.predictor();
        for row in 0..data.n_rows() {
            if data.starts_trial(row) {
                predictor = chain.predictor();
            }
            let mut q_tilde_m = LineValues::zeros();
            q_tilde_m.iter_mut().zip(data.input(row)).for_each(|(own, q)| *own = *q);
            predictor.step(&q_tilde_m);
            take(&mut predictor, data.time_s[row]);
        }
        Ok(())
    }

    /// Why no data can show an effect on this machine.
    fn cannot(&self, kind: EffectKind) -> Option<String> {
        let is_seen = |law| matches!(law, SegmentLaw::Backlash | SegmentLaw::CameraScale | SegmentLaw::CameraOffset);
        let is_elastic = match kind {
            EffectKind::Backlash | EffectKind::Latency => false,
            EffectKind::OfSegment(own) => !is_seen(own.law),
            _ => true,
        };
        (is_elastic && self.parameters.rigid_lines).then(|| "needs elastic lines, and the model's are rigid".to_owned())
    }
}

impl MachineUnderTest for SegmentsLab {
    fn kind(&self) -> &'static str {
        "segments"
    }

    fn tip_pos_m(&self, output: &[f64]) -> Option<[f64; 3]> {
        let mut bends_rad = Bends::zeros();
        bends_rad.iter_mut().zip(output).for_each(|(own, bend)| *own = *bend);
        Some(self.segments.tip_pos_in_base_m(&bends_rad).into())
    }

    fn effects(&self) -> &[Term] {
        &self.effects
    }

    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError> {
        if let Some(own) = snake::formula_parameters(term) {
            return Ok(own);
        }
        Ok(kind(&term.name)?.definition().parameters.iter().map(own_parameter).collect())
    }

    fn open_numbers(&self) -> Vec<OpenNumber> {
        self.open.clone()
    }

    fn candidates(&self, data: &Measurements) -> Vec<Candidate> {
        let n = self.segments.n();
        // What one segment has is what all have.
        let is_of_all =
            |own: &SegmentEffect| n == 1 && !matches!(own.law, SegmentLaw::CameraScale | SegmentLaw::CameraOffset);
        let of_one = SegmentEffect::all().filter(|own| own.segment < n && !is_of_all(own)).map(EffectKind::OfSegment);
        let kinds = SEGMENT_EFFECTS.into_iter().chain(of_one);
        let candidate = |kind| {
            let own = snake_candidates::of_kind(kind, data)?;
            Some(Candidate { cannot: self.cannot(kind).or(own.cannot.clone()), ..own })
        };
        kinds.filter_map(candidate).collect()
    }

    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let mut outputs = Vec::with_capacity(data.outputs.len());
        self.run(effects, data, |now, time_s| outputs.extend(now.observed_rad(time_s).iter().take(data.n_outputs)))?;
        Ok(outputs)
    }

    fn predict_with_loads(
        &self,
        effects: &[Term],
        data: &Measurements,
    ) -> Result<(Vec<f64>, Option<Vec<f64>>), LabError> {
        if self.parameters.rigid_lines {
            return Ok((self.predict(effects, data)?, None));
        }
        let (mut outputs, mut loads_n) =
            (Vec::with_capacity(data.outputs.len()), Vec::with_capacity(data.inputs.len()));
        self.run(effects, data, |now, time_s| {
            outputs.extend(now.observed_rad(time_s).iter().take(data.n_outputs));
            loads_n.extend(now.actuator_load_n().into_iter().flat_map(|all| all.iter().take(data.n_inputs)));
        })?;
        Ok((outputs, Some(loads_n)))
    }
}

/// The values that a model learns while the machine moves: a fit begins from what the file says of them.
fn learnt_values(file: &ModelFile) -> impl Iterator<Item = OpenNumber> {
    file.effects().iter().enumerate().flat_map(|(effect, own)| {
        let setting = own.setting();
        let open = |(parameter, name): (usize, &str)| {
            let prior = Some((setting.value(name)?, setting.learn(name)?.sd));
            Some(OpenNumber { effect, parameter, prior, from: None })
        };
        setting.parameter_names().enumerate().filter_map(open).collect::<Vec<_>>()
    })
}

/// The effect of a name, of all segments or of one.
pub(super) fn kind(name: &str) -> Result<EffectKind, LabError> {
    let of_all = SEGMENT_EFFECTS.into_iter().find(|own| own.name() == name);
    of_all.or_else(|| SegmentEffect::from_name(name).map(EffectKind::OfSegment)).ok_or_else(|| {
        let of_one = SegmentEffect::all().map(|own| own.definition().name);
        LabError::UnknownEffect {
            name: name.to_owned(),
            machine: "segments",
            nearest: nearest(name, SEGMENT_EFFECTS.map(EffectKind::name).into_iter().chain(of_one)),
        }
    })
}
