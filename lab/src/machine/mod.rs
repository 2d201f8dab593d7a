//! What a machine must be able to say about itself so that the lab can compare, diagnose and fit it.

mod force;
mod free_joints;
mod geometry;
mod joint_candidates;
mod joints;
mod segments;
mod snake;
mod snake_candidates;

pub use force::ForceLab;
pub(crate) use force::OneJoint;
pub(crate) use free_joints::{FreeJoints, Freed, freed, joint_number};
pub(crate) use geometry::{is_geometry, with_geometry};
pub use joints::JointsLab;
pub use segments::SegmentsLab;
pub use snake::SnakeLab;
pub(crate) use snake::{acting, nearest, term};

use crate::{FittedData, LabError, Measurements, Parameter, Term};

use krait_model::EffectSetting;
use krait_model::effects::FormulaText;
use krait_model::model_file::{self, ModelFile};

/// The machine of a model file.
///
/// # Errors
/// [`LabError::OtherMachine`] for a machine whose numbers its own file would refuse.
pub fn machine_of(file: &ModelFile) -> Result<Box<dyn MachineUnderTest>, LabError> {
    let machine = match file.machine() {
        model_file::Machine::Snake(_) => SnakeLab::new(file).map(|snake| Box::new(snake) as Box<dyn MachineUnderTest>),
        model_file::Machine::Joints(_) => {
            JointsLab::new(file).map(|joints| Box::new(joints) as Box<dyn MachineUnderTest>)
        }
        model_file::Machine::Force(_) => ForceLab::new(file).map(|force| Box::new(force) as Box<dyn MachineUnderTest>),
        model_file::Machine::Segments(_) => {
            SegmentsLab::new(file).map(|segments| Box::new(segments) as Box<dyn MachineUnderTest>)
        }
    };
    let found = "a machine of neither kind";
    machine.ok_or(LabError::OtherMachine { data: "the model".to_owned(), expected: "snake or joints", found })
}

/// A term as an effect of a model file of this machine.
pub(crate) fn setting(machine: &model_file::Machine, term: &Term) -> Result<EffectSetting, LabError> {
    match machine {
        model_file::Machine::Snake(_) => snake::setting(term, snake::kind),
        model_file::Machine::Joints(_) => snake::setting(term, joints::kind),
        model_file::Machine::Force(_) => snake::setting(term, force::kind),
        model_file::Machine::Segments(_) => snake::setting(term, segments::kind),
    }
}

/// An effect that may be missing, and how to look for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The effect's name.
    pub name: &'static str,
    /// What it looks like, for a table.
    pub class: &'static str,
    /// Why these data cannot show it, if they cannot by their columns alone.
    pub cannot: Option<String>,
    /// Values of all parameters at which nothing happens.
    pub neutral: Vec<f64>,
    /// Places of the parameters that a fit frees.
    pub free: Vec<usize>,
    /// Places of those free parameters that scale the effect; away from neutral in every start.
    pub amplitudes: Vec<usize>,
    /// Whether there is one amplitude and its neutral value is a bound, so that it has only one sign.
    pub one_sided: bool,
    /// Values of all parameters at which to look first: one for each cell of a grid over what is no amplitude.
    pub starts: Vec<Vec<f64>>,
    /// A parameter, by its place, and the value beyond which this motion cannot tell the effect from a plainer one.
    pub highest: Option<(usize, f64)>,
    /// How it is periodic in the inputs, if it is: its columns then follow from what a shift of each input does.
    pub periodic: Option<Periodic>,
    /// The user's own equation, of an effect that is offered.
    pub formula: Option<FormulaText>,
}

impl Candidate {
    /// The effect with these values.
    pub fn term(&self, values: Vec<f64>) -> Term {
        match &self.formula {
            Some(formula) => Term { values, formula: Some(formula.clone()), ..Term::new("formula", Vec::new()) },
            None => Term::new(self.name, values),
        }
    }
}

/// A number of the machine that its model file leaves to the fits, as a parameter of one entry of [`MachineUnderTest::effects`].
#[derive(Clone, Debug, PartialEq)]
pub struct OpenNumber {
    /// Place of the entry.
    pub effect: usize,
    /// Place of the number in it.
    pub parameter: usize,
    /// The value and the standard error that the file gives, in the number's unit; `None`: it is free.
    pub prior: Option<(f64, f64)>,
    /// The data that this value came from.
    pub from: Option<FittedData>,
}

/// An error of the inputs' readings that is periodic in the inputs themselves, with the same period for all and a phase for each.
#[derive(Clone, Debug, PartialEq)]
pub struct Periodic {
    /// Place of its amplitude, in the inputs' unit, among the parameters.
    pub amplitude: usize,
    /// Place of the period, in the inputs' unit.
    pub period: usize,
    /// Place of each input's phase, rad: reading = position + amplitude sin(2 pi position/period + phase).
    pub phases: Vec<usize>,
}

/// A kind of machine with a model: predicts outputs from the history of inputs.
pub trait MachineUnderTest: Sync {
    /// Word in model files.
    fn kind(&self) -> &'static str;

    /// Unit of reported errors, and how many there are to one unit of the outputs.
    fn error_unit(&self) -> (&str, f64) {
        ("deg", 180.0 / core::f64::consts::PI)
    }

    /// Unit of the inputs.
    fn input_unit(&self) -> &str {
        "m"
    }

    /// Where outputs put the machine's tip, m; `None` for a machine without one.
    fn tip_pos_m(&self, _output: &[f64]) -> Option<[f64; 3]> {
        None
    }

    /// Measurements as fits want them: a snake's bends, where a table has its tip's positions instead.
    ///
    /// # Errors
    /// [`LabError::Tip`] where the positions make no bends, [`LabError::Chain`] where the model as given cannot be computed.
    fn bends_of_tip(&self, data: Measurements) -> Result<Measurements, LabError> {
        Ok(data)
    }

    /// As a machine of kind force.
    fn as_force(&self) -> Option<&ForceLab> {
        None
    }

    /// This machine, if it is one of joints.
    fn as_joints(&self) -> Option<&JointsLab> {
        None
    }

    /// The effects of its model, in order.
    fn effects(&self) -> &[Term];

    /// The parameters of an effect, in order.
    ///
    /// # Errors
    /// [`LabError::UnknownEffect`].
    fn parameters(&self, term: &Term) -> Result<Vec<Parameter>, LabError>;

    /// The numbers of the machine itself that every fit finds, or is drawn to.
    fn open_numbers(&self) -> Vec<OpenNumber> {
        Vec::new()
    }

    /// The machine with what its model file leaves to the fits as these data say; `None` where it leaves nothing.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the model as given cannot be computed.
    fn calibrated_on(&self, _data: &Measurements) -> Result<Option<Box<dyn MachineUnderTest>>, LabError> {
        Ok(None)
    }

    /// Every effect that may be missing, with those that these data cannot show.
    fn candidates(&self, data: &Measurements) -> Vec<Candidate>;

    /// Outputs of every row, row after row, for the history of inputs with these effects instead of the model's own.
    ///
    /// The machine starts afresh at each trial's first row.
    ///
    /// # Errors
    /// [`LabError::Chain`] where the effects make no chain.
    fn predict(&self, effects: &[Term], data: &Measurements) -> Result<Vec<f64>, LabError>;

    /// The same, and the loads at the actuators, N, push positive, row after row of one for each line; no loads for a machine
    /// without lines, or with rigid ones.
    ///
    /// # Errors
    /// As [`MachineUnderTest::predict`].
    fn predict_with_loads(
        &self,
        effects: &[Term],
        data: &Measurements,
    ) -> Result<(Vec<f64>, Option<Vec<f64>>), LabError> {
        Ok((self.predict(effects, data)?, None))
    }
}
