//! Which effects stand beside what no effect makes.
//!
//! Problem: a part of the truth that no effect makes is taken for one that is nearly like it: a cable that stiffens for weight, friction
//! that differs along the way for dry friction, a snake that prefers some planes for coupled lines.
//! Intuition: what remains is put beside the effects in shapes that name no physics, and an effect stands where it takes away much that
//! these shapes cannot, on blocks that neither was fitted to.

use super::fine_shapes::fine_shapes;
use super::force_rest::{FRICTION, slow_wave};
use super::rhythm::rhythm;
use super::screen::{block_moments, orthonormal, remove};
use super::structure::{dictionary, held_out_share, of_groups};
use crate::fit::{Fit, dot};
use crate::noise::bounds;
use crate::{LabError, Problem, Quantity, Term};
use core::f64::consts::TAU;
use rayon::prelude::*;

/// A shape that takes away less of the rest is not put beside the effects, and no more than so many are.
const LEAST_SHARE: f64 = 0.1;
const MOST_SHAPES: usize = 3;
/// Dry friction is at least this part of the friction that it and shapes of friction make: every friction that differs has a mean.
const STEADY: f64 = 0.65;
const DRY: &str = "coulomb";
/// What it takes beside a shift of all outputs counts: what rises within seconds and then stays is a shift.
const DRIFT: &str = "thermal-drift";
/// Groups of the dictionary that a snake's fine shapes take the place of.
const FINER: [&str; 2] = ["the pose", "the plane of bending"];

/// A shape that what remains has.
#[derive(Clone)]
enum Shape {
    /// All columns of the fine shape in this place, of a snake.
    Fine(usize),
    /// All columns of the group of this name.
    Group(&'static str),
    /// A wave in time with so many periods in the record, for each output.
    Wave(Vec<f64>),
    /// All outputs are shifted from this time on, s.
    Jump(f64),
}

/// Shapes that stand beside effects, the one that takes most first.
#[derive(Clone)]
pub(super) struct Shapes {
    /// The effects whose prediction says where the machine is and how it moves.
    at: Vec<Term>,
    shapes: Vec<(Shape, usize)>,
}

/// A shape that may be taken up.
pub(super) struct Offer {
    shape: Shape,
    /// Its columns, and the time of one that is chosen.
    pub n: usize,
    /// How much of the sum of squares it takes away.
    pub gain: f64,
}

impl Shapes {
    /// None yet, of a machine that is where these effects put it.
    pub(super) fn none(at: &[Term]) -> Self {
        Self { at: at.to_vec(), shapes: Vec::new() }
    }

    /// Takes up the shape that takes most of what a fit and these shapes leave; whether there is one.
    ///
    /// # Errors
    /// [`LabError`] where effects make no chain.
    pub(super) fn grow(&mut self, problem: &Problem, fit: &Fit, seed: u64) -> Result<bool, LabError> {
        if self.shapes.len() == MOST_SHAPES {
            return Ok(false);
        }
        let Rest { outputs, basis, left } = self.rest(problem, fit)?;
        let predicted = problem.machine.predict(&self.at, &problem.data)?;
        let rest = of_groups(&outputs, &left, &basis, dictionary(&outputs, &predicted, false), seed);
        let periods = match problem.data.quantity {
            Quantity::Force => Some(slow_wave(&outputs, &left)),
            Quantity::Snake | Quantity::Segments | Quantity::Joints => rhythm(&outputs, &left).map(|rhythm| {
                let (low, high) = bounds(problem.data.time_s.iter().copied());
                vec![rhythm.hz * (high - low); problem.data.n_outputs]
            }),
        };
        let jump_s = best_jump(&outputs, &left);
        let share_of = |shape: &Shape| share(&outputs, &shape.in_time(&outputs), &left);
        let in_time = periods.map(Shape::Wave).into_iter().chain([Shape::Jump(jump_s)]);
        let best = in_time.map(|shape| (share_of(&shape), shape)).max_by(|a, b| a.0.total_cmp(&b.0));
        let group = rest.groups.first().map(|group| (group.share, Shape::Group(group.name)));
        let best = best.into_iter().chain(group).filter(|(share, _)| *share > LEAST_SHARE);
        let Some((_, shape)) = best.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Ok(false) };
        self.shapes.push((shape, 0));
        Ok(true)
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Their numbers.
    pub(super) fn n_columns(&self) -> usize {
        self.shapes.iter().map(|(_, n)| n).sum()
    }

    /// With one more.
    pub(super) fn and(mut self, offer: Offer) -> Self {
        self.shapes.push((offer.shape, offer.n));
        self
    }

    /// Without the one in this place.
    pub(super) fn without(mut self, place: usize) -> Self {
        self.shapes.remove(place);
        self
    }

    /// What may be taken up beside a snake's effects and these shapes, and how much of what they leave it takes.
    ///
    /// # Errors
    /// [`LabError`] where effects make no chain.
    pub(super) fn offers(&self, problem: &Problem, fit: &Fit) -> Result<Vec<Offer>, LabError> {
        let rest = self.rest(problem, fit)?;
        let predicted = problem.machine.predict(&self.at, &problem.data)?;
        let fine = fine_shapes(&rest.outputs, &predicted).into_iter().enumerate();
        let fine = fine.map(|(k, own)| (Shape::Fine(k), own));
        let coarse = dictionary(&rest.outputs, &predicted, false).into_iter();
        let coarse = coarse.filter(|own| !FINER.contains(&own.name)).map(|own| (Shape::Group(own.name), own.columns));
        let all: Vec<(Shape, Vec<Vec<f64>>)> = fine.chain(coarse).collect();
        let weighed = |own: Vec<Vec<f64>>| own.into_iter().map(|own| rest.outputs.laid_out(own)).collect();
        let mut offers: Vec<Offer> =
            all.into_par_iter().map(|(shape, own)| rest.offer(shape, weighed(own), 0)).collect();
        offers.extend(rest.wave());
        offers.push(rest.jump());
        Ok(offers)
    }

    /// The rhythm in what a fit and these shapes leave, if there is one.
    ///
    /// # Errors
    /// [`LabError`] where effects make no chain.
    pub(super) fn wave(&self, problem: &Problem, fit: &Fit) -> Result<Option<Offer>, LabError> {
        Ok(self.rest(problem, fit)?.wave())
    }

    /// The jump that takes most of what a fit and these shapes leave.
    ///
    /// # Errors
    /// [`LabError`] where effects make no chain.
    pub(super) fn jump(&self, problem: &Problem, fit: &Fit) -> Result<Offer, LabError> {
        Ok(self.rest(problem, fit)?.jump())
    }

    fn rest<'a>(&self, problem: &Problem<'a>, fit: &Fit) -> Result<Rest<'a>, LabError> {
        let outputs = problem.of_outputs();
        let slopes: Vec<Vec<f64>> = fit.slopes.iter().map(|slope| problem.outputs_of(slope)).collect();
        let basis = orthonormal(&[slopes, self.columns(&outputs)?].concat());
        let mut left = problem.outputs_of(&fit.residual);
        remove(&basis, &mut left);
        Ok(Rest { outputs, basis, left })
    }

    /// Their columns with an offset of each output, weighted and laid out as the problem's residuals are.
    ///
    /// # Errors
    /// [`LabError`] where the effects of [`Self::none`] make no chain.
    pub(super) fn columns(&self, problem: &Problem) -> Result<Vec<Vec<f64>>, LabError> {
        self.columns_of(problem, |_| true)
    }

    fn columns_of(&self, problem: &Problem, is_wanted: impl Fn(&Shape) -> bool) -> Result<Vec<Vec<f64>>, LabError> {
        let is_snake = problem.data.quantity == Quantity::Snake;
        let mut columns = if is_snake { Vec::new() } else { jump(problem, f64::NEG_INFINITY) };
        let wanted: Vec<&Shape> = self.shapes.iter().map(|(own, _)| own).filter(|shape| is_wanted(shape)).collect();
        if wanted.iter().any(|shape| matches!(shape, Shape::Group(_) | Shape::Fine(_))) {
            let predicted = problem.machine.predict(&self.at, &problem.data)?;
            if is_snake {
                let is_own =
                    |place: usize| wanted.iter().any(|shape| matches!(shape, Shape::Fine(own) if *own == place));
                let fine = fine_shapes(problem, &predicted).into_iter().enumerate().filter(|(place, _)| is_own(*place));
                columns.extend(fine.flat_map(|(_, own)| own).map(|own| problem.laid_out(own)));
            }
            let is_own = |name: &str| wanted.iter().any(|shape| matches!(shape, Shape::Group(own) if *own == name));
            let groups = dictionary(problem, &predicted, false).into_iter().filter(|group| is_own(group.name));
            columns.extend(groups.flat_map(|group| group.columns).map(|own| problem.laid_out(own)));
        }
        columns.extend(wanted.iter().flat_map(|shape| shape.in_time(problem)));
        Ok(columns)
    }
}

/// What effects and shapes leave of the outputs.
struct Rest<'a> {
    outputs: Problem<'a>,
    /// What they can make.
    basis: Vec<Vec<f64>>,
    left: Vec<f64>,
}

impl Rest<'_> {
    /// A shape of these columns with so many numbers beside.
    fn offer(&self, shape: Shape, mut columns: Vec<Vec<f64>>, n: usize) -> Offer {
        let n = n + columns.len();
        // What is there already would be made large by rounding.
        columns.retain_mut(|own| {
            let whole = dot(own, own);
            remove(&self.basis, own);
            dot(own, own) > 1e-6 * whole
        });
        let gain = orthonormal(&columns).iter().map(|own| dot(own, &self.left).powi(2)).sum();
        Offer { shape, n, gain }
    }

    fn wave(&self) -> Option<Offer> {
        let (low, high) = bounds(self.outputs.data.time_s.iter().copied());
        let rhythm = rhythm(&self.outputs, &self.left)?;
        let shape = Shape::Wave(vec![rhythm.hz * (high - low); self.outputs.data.n_outputs]);
        let columns = shape.in_time(&self.outputs);
        Some(self.offer(shape, columns, 1))
    }

    fn jump(&self) -> Offer {
        let shape = Shape::Jump(best_jump(&self.outputs, &self.left));
        let columns = shape.in_time(&self.outputs);
        self.offer(shape, columns, 1)
    }
}

impl Shape {
    /// The columns of a shape in time, weighted and laid out as residuals are; none for a group.
    fn in_time(&self, problem: &Problem) -> Vec<Vec<f64>> {
        match self {
            Self::Group(_) | Self::Fine(_) => Vec::new(),
            Self::Wave(periods) => waves(problem, periods),
            Self::Jump(from_s) => jump(problem, *from_s),
        }
    }
}

/// What effects do beside shapes.
pub(super) struct Standing {
    /// The share that each effect behind the model's own takes of what the shapes and the others leave; 0 for dry friction that is no
    /// more than the mean of friction that differs.
    pub shares: Vec<f64>,
    /// What effects and shapes leave together, root mean square in the outputs' unit.
    pub left_rms: f64,
}

/// What the effects behind the model's own do beside these shapes; `fit` has nothing taken out of its residuals and slopes.
///
/// # Errors
/// [`LabError`] where effects make no chain.
pub(super) fn standing(problem: &Problem, fit: &Fit, n_own: usize, shapes: &Shapes) -> Result<Standing, LabError> {
    let every = shapes.columns(problem)?;
    let is_friction = |shape: &Shape| matches!(shape, Shape::Group(name) if FRICTION.contains(name));
    let steady = shapes.columns_of(problem, |shape| !is_friction(shape))?;
    let mut left = problem.outputs_of(&fit.residual);
    let all = [every.as_slice(), &fit.slopes].concat();
    remove(&orthonormal(&all.iter().map(|own| problem.outputs_of(own)).collect::<Vec<_>>()), &mut left);
    let share_of = |place: usize| -> Result<f64, LabError> {
        let mut without = fit.effects.clone();
        without.remove(place);
        let target = problem.residual(&without)?;
        let slopes = |is_own: bool| {
            let own = fit.variables.iter().zip(&fit.slopes).filter(move |(v, _)| (v.effect == place) == is_own);
            own.map(|(_, slope)| slope.clone()).collect::<Vec<_>>()
        };
        // What is nearly the same as others would only spoil the inverse.
        let taken = |columns: &[&[Vec<f64>]]| share(problem, &orthonormal(&columns.concat()), &target);
        let (own, others) = (slopes(true), slopes(false));
        let shift = if fit.effects[place].name == DRIFT { jump(problem, f64::NEG_INFINITY) } else { Vec::new() };
        let [all, without] = [taken(&[&every, &shift, &others, &own]), taken(&[&every, &shift, &others])];
        if fit.effects[place].name == DRY {
            let [none, dry] = [taken(&[&steady, &others]), taken(&[&steady, &others, &own])];
            if dry - none < STEADY * (all - none) {
                return Ok(0.0);
            }
        }
        Ok((all - without) / (1.0 - without).max(f64::MIN_POSITIVE))
    };
    let shares = (n_own..fit.effects.len()).map(share_of).collect::<Result<_, _>>()?;
    Ok(Standing { shares, left_rms: problem.rms_of_outputs(dot(&left, &left)) })
}

/// How much of a residual columns take away on blocks that they were not fitted to.
pub(super) fn share(problem: &Problem, columns: &[Vec<f64>], residual: &[f64]) -> f64 {
    held_out_share(problem, &block_moments(problem, columns, residual), residual)
}

/// Waves of so many periods in the record, for each output.
pub(super) fn waves(problem: &Problem, periods: &[f64]) -> Vec<Vec<f64>> {
    periods.iter().enumerate().flat_map(|(output, &periods)| wave(problem, output, periods)).collect()
}

/// Sine and cosine of the time in one output, weighted and laid out as residuals are.
pub(super) fn wave(problem: &Problem, output: usize, periods: f64) -> [Vec<f64>; 2] {
    let data = &problem.data;
    let (low, high) = bounds(data.time_s.iter().copied());
    let mut waves = [vec![0.0; data.outputs.len()], vec![0.0; data.outputs.len()]];
    for (row, time_s) in data.time_s.iter().enumerate() {
        let place = row * data.n_outputs + output;
        let (sine, cosine) = (TAU * periods * (time_s - low) / (high - low).max(1e-9)).sin_cos();
        (waves[0][place], waves[1][place]) = (sine, cosine);
    }
    waves.map(|wave| problem.laid_out(wave))
}

/// Every output shifted from this time on, weighted and laid out as residuals are.
fn jump(problem: &Problem, from_s: f64) -> Vec<Vec<f64>> {
    let n = problem.data.n_outputs;
    let after = |k: usize| problem.data.time_s[k / n] >= from_s;
    let column = |output: usize| {
        (0..problem.data.outputs.len()).map(|k| f64::from(u8::from(k % n == output && after(k)))).collect()
    };
    (0..n).map(|output| problem.laid_out(column(output))).collect()
}

/// The time of the jump that takes most of a residual, s: of all rows, each the first behind it.
fn best_jump(problem: &Problem, residual: &[f64]) -> f64 {
    let (data, n) = (&problem.data, problem.data.n_outputs);
    let mut rows: Vec<usize> = (0..data.n_rows()).collect();
    rows.sort_by(|a, b| data.time_s[*b].total_cmp(&data.time_s[*a]));
    // Weights squared, and weights times what is left: of all rows, and of those from one on.
    let sums = |own: &mut [[f64; 2]], row: usize| {
        for (k, [squares, product]) in own.iter_mut().enumerate() {
            let weight = problem.weight[row * n + k];
            *squares += weight * weight;
            *product += weight * residual[row * n + k];
        }
    };
    let mut all = vec![[0.0; 2]; n];
    rows.iter().for_each(|row| sums(&mut all, *row));
    let mut after = vec![[0.0; 2]; n];
    let (mut best_s, mut most) = (bounds(data.time_s.iter().copied()).0, 0.0);
    for (place, &row) in rows.iter().enumerate() {
        sums(&mut after, row);
        if rows.get(place + 1).is_none_or(|next| data.time_s[*next] == data.time_s[row]) {
            continue;
        }
        let power = |([own, product], [squares, whole]): (&[f64; 2], &[f64; 2])| {
            let rest = own * (1.0 - own / squares);
            if rest > 1e-9 * squares { (product - whole * own / squares).powi(2) / rest } else { 0.0 }
        };
        let power: f64 = after.iter().zip(&all).map(power).sum();
        if power > most {
            (best_s, most) = (data.time_s[row], power);
        }
    }
    best_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Measurements;
    use crate::machine::SnakeLab;
    use krait_model::model_file::ModelFile;

    #[test]
    fn a_jump_is_found_to_the_row_whatever_the_offset() {
        let n = 2000;
        let time_s: Vec<f64> = (0..n).map(|k| f64::from(k) * 0.02).collect();
        let at_s = time_s[869];
        let rest = time_s.iter().flat_map(|t| if *t >= at_s { [0.004, -0.008] } else { [0.001, 0.002] }).collect();
        let inputs = vec![0.0; 3 * time_s.len()];
        let data = Measurements::bare(String::new(), Quantity::Snake, time_s, (inputs, 3), (rest, 2));
        let model = ModelFile::parse("format = 1\n[machine]\nkind = \"snake\"\n").expect("a model");
        let snake = SnakeLab::new(&model).expect("a snake");
        let problem = Problem::new(&snake, data, &[], 2.0);
        let residual = problem.data.outputs.clone();
        assert_eq!(best_jump(&problem, &residual), at_s);
    }
}
