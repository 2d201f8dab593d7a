//! A snake under the lab: the chain's forward model, row by row.

use super::{Candidate, MachineUnderTest, OpenNumber, geometry, snake_candidates};
use crate::fit::fit_to_end;
use crate::free::free_variables;
use crate::prepare::prepare;
use crate::tip::{N_POS, align, with_bends};
use crate::{FittedData, LabError, Measurements, Parameter, Term};
use krait_model::effects::{EffectKind, FormulaText};
use krait_model::model_file::{FileEffect, ModelFile, SnakeMachine};
use krait_model::{Chain, Circumstances, EffectSetting, KnownColumns, Prediction, Snake};
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Trials of more rows than this together are predicted beside each other.
const MANY: usize = 30_000;

/// A snake with its model.
#[derive(Clone, Debug)]
pub struct SnakeLab {
    machine: SnakeMachine,
    snake: Snake,
    /// The effects of the model file, and its geometry behind them.
    effects: Vec<Term>,
    /// What of both a fit finds, or is drawn to.
    open: Vec<OpenNumber>,
}

impl SnakeLab {
    /// The machine of a model file; `None` if it is of another kind.
    pub fn new(file: &ModelFile) -> Option<Self> {
        let krait_model::model_file::Machine::Snake(machine) = file.machine() else { return None };
        let snake = Snake::new(&machine.parameters).ok()?;
        let mut effects: Vec<Term> = file.effects().iter().map(|effect| term(effect.setting())).collect();
        let mut open = open_values(file);
        open.extend(geometry::open_numbers(file, machine, effects.len()));
        effects.push(geometry::term(machine));
        Some(Self { machine: machine.clone(), snake, effects, open })
    }

    /// The chain of a list of effects, in the order in which they act.
    fn chain(&self, effects: &[Term], columns: KnownColumns) -> Result<Chain, LabError> {
        let order = acting(self.effects.len(), effects).into_iter().map(|k| &effects[k]);
        let settings: Vec<EffectSetting> = order
            .filter(|term| !geometry::is_geometry(term))
            .map(|term| setting(term, kind))
            .collect::<Result<_, _>>()?;
        Ok(Chain::new(&geometry::in_list(&self.machine, effects), self.machine.settings, &settings, columns)?)
    }

    /// The chain's forward model over all rows: what `part` makes of the predictions of stretches of them, in their order.
    fn run<T: Send>(
        &self,
        effects: &[Term],
        data: &Measurements,
        part: impl Fn(&mut dyn Iterator<Item = Prediction>, usize) -> T + Sync,
    ) -> Result<Vec<T>, LabError> {
        let columns = KnownColumns {
            time: true,
            stem_angle: data.stem_angle_rad.is_some(),
            temperature: data.temperature_c.is_some(),
            named: false,
        };
        let chain = self.chain(effects, columns)?;
        let of_rows = |rows: Range<usize>| {
            let mut predictor = chain.predictor();
            let n_rows = rows.len();
            let mut predicted = rows.map(|row| {
                if data.starts_trial(row) {
                    predictor = chain.predictor();
                }
                let reading_m = Vector3::from_column_slice(data.input(row));
                predictor.step(reading_m, &circumstances(data, row))
            });
            part(&mut predicted, n_rows)
        };
        Ok(stretches(data).into_par_iter().map(of_rows).collect())
    }

    /// The predicted bends of all rows, nearest to the measured ones in what a tracker of these data leaves open.
    fn seen(&self, parts: Vec<Vec<f64>>, data: &Measurements) -> Vec<f64> {
        let mut outputs = joined(parts);
        align(&self.snake, &mut outputs, data);
        outputs
    }
}

impl MachineUnderTest for SnakeLab {
    fn kind(&self) -> &'static str {
        "snake"
    }

    fn tip_pos_m(&self, output: &[f64]) -> Option<[f64; 3]> {
        let &[x, y] = output.first_chunk::<2>()?;
        Some(self.snake.tip_pos_in_base_m(Vector2::new(x, y)).into())
    }

    fn bends_of_tip(&self, data: Measurements) -> Result<Measurements, LabError> {
        if data.n_outputs != N_POS {
            return Ok(data);
        }
        let predicted_rad = self.predict(&self.effects, &data)?;
        with_bends(&self.snake, &predicted_rad, data)
    }

    fn effects(&self) -> &[Term] {
        &self.effects
    }

    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError> {
        if let Some(own) = formula_parameters(term) {
            return Ok(own);
        }
        if geometry::is_geometry(term) {
            return Ok(geometry::parameters());
        }
        Ok(kind(&term.name)?.definition().parameters.iter().map(own_parameter).collect())
    }

    fn open_numbers(&self) -> Vec<OpenNumber> {
        self.open.clone()
    }

    fn calibrated_on(&self, data: &Measurements) -> Result<Option<Box<dyn MachineUnderTest>>, LabError> {
        if self.open.iter().all(|own| own.prior.is_some()) {
            return Ok(None);
        }
        let variables = free_variables(self, data, &[])?;
        let effects = fit_to_end(&prepare(self, data)?.problem, &self.effects, &variables)?.effects;
        Ok(Some(Box::new(Self { effects, ..self.clone() })))
    }

    fn candidates(&self, data: &Measurements) -> Vec<Candidate> {
        let mut all = snake_candidates::all(data);
        for candidate in &mut all {
            let other_law = EffectKind::from_name(candidate.name).and_then(EffectKind::excludes).map(EffectKind::name);
            if let Some(own) = self.effects.iter().find(|own| Some(own.name.as_str()) == other_law) {
                candidate.cannot = Some(format!("is another law of {}, which the model has", own.name));
            }
        }
        all
    }

    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError> {
        let part = |predicted: &mut dyn Iterator<Item = Prediction>, n_rows: usize| {
            let mut outputs = Vec::with_capacity(2 * n_rows);
            predicted.for_each(|own| outputs.extend_from_slice(own.observed_bend_rad.as_slice()));
            outputs
        };
        Ok(self.seen(self.run(effects, data, part)?, data))
    }

    fn predict_with_loads(
        &self,
        effects: &[Term],
        data: &Measurements,
    ) -> Result<(Vec<f64>, Option<Vec<f64>>), LabError> {
        let part = |predicted: &mut dyn Iterator<Item = Prediction>, n_rows: usize| {
            let (mut outputs, mut loads_n) = (Vec::with_capacity(2 * n_rows), Vec::with_capacity(3 * n_rows));
            predicted.for_each(|own| {
                outputs.extend_from_slice(own.observed_bend_rad.as_slice());
                loads_n.extend_from_slice(own.actuator_load_n.as_slice());
            });
            (outputs, loads_n)
        };
        let (outputs, loads_n) = self.run(effects, data, part)?.into_iter().unzip();
        Ok((self.seen(outputs, data), Some(joined(loads_n))))
    }
}

/// Stretches of rows that are predicted beside each other: of many rows each trial, else all of them.
fn stretches(data: &Measurements) -> Vec<Range<usize>> {
    let n = data.n_rows();
    if n <= MANY {
        return core::iter::once(0..n).collect();
    }
    let starts: Vec<usize> = (0..n).filter(|row| data.starts_trial(*row)).collect();
    let ends = starts.iter().skip(1).copied().chain([n]);
    starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
}

fn joined(mut parts: Vec<Vec<f64>>) -> Vec<f64> {
    if parts.len() == 1 { parts.swap_remove(0) } else { parts.concat() }
}

/// The values of effects that the model file leaves to the fits, or gives with a standard error.
pub(super) fn open_values(file: &ModelFile) -> Vec<OpenNumber> {
    file.effects().iter().enumerate().flat_map(|(place, effect)| open_values_of(file, place, effect)).collect()
}

fn open_values_of(file: &ModelFile, place: usize, effect: &FileEffect) -> Vec<OpenNumber> {
    let open = |(parameter, name): (usize, &str)| {
        if effect.is_free(name) {
            return Some(OpenNumber { effect: place, parameter, prior: None, from: None });
        }
        let origin = effect.origin(name)?;
        let se = origin.se.filter(|se| *se > 0.0)?;
        let value = effect.setting().value(name)?;
        let from = FittedData::of(file, origin.from.as_deref(), origin.date.as_deref());
        Some(OpenNumber { effect: place, parameter, prior: Some((value, se)), from })
    };
    effect.setting().parameter_names().enumerate().filter_map(open).collect()
}

/// The laws of friction in the cone.
const CONE: [&str; 2] = ["cone-friction", "distributed-capstan"];

/// The places of effects in the order in which they act on a line from the tip to its drive. The first `n_own` stand as the model
/// has them; friction along the line that is new comes before that of the cone, which the line reaches last (Xu and Simaan,
/// Eq. (13): tau~ = e^(2 mu phi) (tau + f_s)). The other way round is another law.
pub(crate) fn acting(n_own: usize, effects: &[Term]) -> Vec<usize> {
    let is_along = |k: &usize| ["static-friction", "stribeck-friction"].contains(&effects[*k].name.as_str());
    let mut order: Vec<usize> = (0..effects.len().min(n_own)).collect();
    let new = n_own.min(effects.len())..effects.len();
    for k in new.clone().filter(|k| !is_along(k)).chain(new.filter(is_along)) {
        let cone = order.iter().position(|own| CONE.contains(&effects[*own].name.as_str())).filter(|_| is_along(&k));
        order.insert(cone.unwrap_or(order.len()), k);
    }
    order
}

pub(super) fn circumstances(data: &Measurements, row: usize) -> Circumstances {
    let column = |values: &Option<Vec<f64>>| values.as_ref().map_or(f64::NAN, |values| values[row]);
    Circumstances {
        stem_angle_rad: column(&data.stem_angle_rad),
        temperature_c: column(&data.temperature_c),
        ..Circumstances::at(data.time_s[row])
    }
}

pub(super) fn kind(name: &str) -> Result<EffectKind, LabError> {
    EffectKind::from_name(name).ok_or_else(|| LabError::UnknownEffect {
        name: name.to_owned(),
        machine: "snake",
        nearest: nearest(name, EffectKind::ALL.iter().map(|kind| kind.name())),
    })
}

/// The name that looks most like what was given.
pub(crate) fn nearest<'a>(given: &str, names: impl Iterator<Item = &'a str>) -> String {
    krait_model::nearest_name(given, names).unwrap_or("nothing").to_owned()
}

/// A term as an effect of a model file.
pub(crate) fn setting(
    term: &Term,
    kind: impl Fn(&str) -> Result<EffectKind, LabError>,
) -> Result<EffectSetting, LabError> {
    let mut bare = match &term.formula {
        Some(formula) => EffectSetting::formula(FormulaText::clone(formula)),
        None => EffectSetting::new(kind(&term.name)?),
    };
    if let Some(own) = &term.varying {
        bare = bare.with_column(own.parameter, &own.column, own.at)?;
    }
    let names: Vec<String> = bare.parameter_names().map(str::to_owned).collect();
    let with = |setting: EffectSetting, (name, &value): (&String, &f64)| setting.with(name, value);
    Ok(names.iter().zip(&term.values).try_fold(bare, with)?)
}

/// An effect of a model file as the lab sees it.
pub(crate) fn term(setting: &EffectSetting) -> Term {
    let value = |name| setting.value(name).unwrap_or_else(|| unreachable!("{name} is one of its parameters"));
    Term {
        name: setting.kind().name().to_owned(),
        values: setting.parameter_names().map(value).collect(),
        formula: setting.formula_text().cloned(),
        varying: setting.varying().cloned(),
    }
}

pub(super) fn own_parameter(spec: &krait_model::effects::ParameterSpec) -> Parameter {
    Parameter {
        name: spec.name.to_owned(),
        unit: spec.unit.to_owned(),
        low: spec.low,
        high: spec.high,
        default: spec.default,
    }
}

/// The parameters of a user's formula, which have no bounds; `None` of any other effect.
pub(super) fn formula_parameters(term: &Term) -> Option<Vec<Parameter>> {
    let parameter = |own: &krait_model::effects::FormulaParameter| Parameter {
        name: own.name.clone(),
        unit: own.unit.clone(),
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
        default: own.value,
    };
    term.formula.as_ref().map(|formula| formula.parameters.iter().map(parameter).collect())
}
