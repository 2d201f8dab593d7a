//! Predicted bends with their slopes by the parameters that are learnt, carried along with the memory of every line.
//!
//! Problem: for each learnt parameter (eta, share, f_s, mu, half-width, the camera's delay) the change of the bends for a change of the parameter that was there
//! all along. Per prior standard deviation of the parameter, one column each.
//!
//! ```text
//! F(x; parameters, s, p) = 0   =>   dx = -(dF/dx)^-1 dF at constant x,        F and x as in `forward`
//! p: moves with half_width where the play pushes or draws it, else stays
//! s: follows x and tau where line k slides, else stays
//! ```
//!
//! where: at constant x a line that sticks has c_d dtau = ds - tau dc_d; one that slides to the side z = 1 (pushed) or -1 has
//! (c_d + c_c g') z dtau = z dp - z tau dc_d - c_c (dg' (z tau + f_s) + g' df_s), g' = g or 1/g. dF = d eta grad E - J^T dtau.
//!
//! Analytical, because all of it is at hand: the tangent matrix of the equilibrium is factored once more for all parameters together, where
//! differences would find an equilibrium for each. And the tangents of the memory let new values move it (`set`).
//!
//! Failure: slopes are one-sided where a line begins to slide or to stick. Readings that are not finite have none.

use super::forward::{Loaded, N, Unknowns};
use super::{LineValues, MAX_BENDS, MAX_LINES, SegmentChain, SegmentPredictor};
use crate::chain::DelayLine;
use crate::effects::{Dual, EffectKind};
use crate::vector_learner::SlopedPredictor;
use crate::{Circumstances, MAX_LEARNT};
use nalgebra::{RowSVector, SMatrix};

type Row = RowSVector<f64, MAX_LEARNT>;
type PerLine = SMatrix<f64, MAX_LINES, MAX_LEARNT>;
type Sloped = ([f64; MAX_BENDS], SMatrix<f64, MAX_BENDS, MAX_LEARNT>);

/// A [`SegmentPredictor`] with slopes by the parameters that are learnt.
#[derive(Clone, Debug)]
pub struct SegmentTangents {
    plain: SegmentPredictor,
    /// Prior standard deviations; 0 in lanes without a parameter.
    sd: Row,
    values: [f64; MAX_LEARNT],
    unknowns: SMatrix<f64, N, MAX_LEARNT>,
    play_m: PerLine,
    seat_m: PerLine,
    /// What the camera has yet to show, where it is late.
    delay: Option<Box<DelayLine<Dual<MAX_LEARNT>, MAX_BENDS>>>,
}

impl SegmentTangents {
    pub(super) fn new(chain: &SegmentChain) -> Self {
        Self {
            plain: chain.predictor(),
            sd: Row::from_fn(|_, lane| chain.learnt().get(lane).map_or(0.0, |own| own.learn.sd)),
            values: chain.start_values(),
            unknowns: SMatrix::zeros(),
            play_m: PerLine::zeros(),
            seat_m: PerLine::zeros(),
            delay: chain.delay_s.map(|_| Box::new(DelayLine::new())),
        }
    }

    /// d parameter / d lanes: the standard deviation of an effect's parameter where it is learnt.
    fn seed(&self, kind: EffectKind) -> Row {
        let lane = self.plain.chain.lanes.iter().position(|own| *own == kind);
        let mut seed = Row::zeros();
        if let Some(lane) = lane {
            seed[lane] = self.sd[lane];
        }
        seed
    }

    /// The plays take their slope from the half-width where they are at its end.
    fn note_plays(&mut self, q_tilde_m: &LineValues) {
        let wider_m = self.seed(EffectKind::Backlash);
        for k in 0..self.plain.chain.machine.n_lines() {
            let (play_m, half_m) = (self.plain.play_m[k], self.plain.chain.half_width_m(k));
            if play_m < q_tilde_m[k] - half_m {
                self.play_m.set_row(k, &-wider_m);
            } else if play_m > q_tilde_m[k] + half_m {
                self.play_m.set_row(k, &wider_m);
            }
        }
    }

    /// d tau_k at constant unknowns, and d c_d of the line there.
    fn load(&self, loaded: &Loaded, k: usize) -> (Row, Row) {
        let (chain, machine) = (&self.plain.chain, &self.plain.chain.machine);
        let Loaded { tau_n, slope, side, .. } = *loaded;
        let (inside_m, _) = self.plain.inside_and_end_m(&self.plain.unknowns, k);
        let softer = self.seed(EffectKind::InsideExtension) * (machine.give_per_n[k] * inside_m);
        if side == 0.0 {
            return ((self.seat_m.row(k) - softer * tau_n) / slope, softer);
        }
        let (cone_n, capstan) = chain.friction(k).pushed(side * tau_n);
        // d g' = +-2 phi g' d mu, + where it enlarges the load.
        let sharper = self.seed(EffectKind::ConeFriction) * (2.0 * machine.phi_rad * cone_n.signum());
        let rubs = sharper * cone_n + self.seed(EffectKind::StaticFriction) * capstan;
        let pushes = (self.play_m.row(k) - softer * tau_n) * side - rubs * machine.c_c_m_per_n[k];
        (pushes * (side / slope), softer)
    }

    /// What the camera shows at this time, with its slopes, where these are those of the newest bends.
    fn seen(&mut self, slopes: SMatrix<f64, MAX_BENDS, MAX_LEARNT>, time_s: f64) -> Sloped {
        let shown_rad: [f64; MAX_BENDS] = self.plain.shown_rad(time_s).into();
        let later = self.seed(EffectKind::Latency);
        let (Some(delay), Some(delay_s)) = (&mut self.delay, self.plain.chain.delay_s) else {
            return (shown_rad, slopes);
        };
        let dual = |value: f64, tangent: &dyn Fn(usize) -> f64| Dual { value, tangent: core::array::from_fn(tangent) };
        let now = core::array::from_fn(|i| dual(shown_rad[i], &|lane| slopes[(i, lane)]));
        let seen = delay.pass(time_s, now, dual(delay_s, &|lane| later[lane]));
        (seen.map(|own| own.value), SMatrix::from_fn(|i, lane| seen[i].tangent[lane]))
    }

    /// Slopes of the bends behind the formulas, from those before them.
    fn seen_by_formulas(
        &self,
        slopes: &SMatrix<f64, MAX_BENDS, MAX_LEARNT>,
        time_s: f64,
    ) -> SMatrix<f64, MAX_BENDS, MAX_LEARNT> {
        let (chain, bends_rad) = (&self.plain.chain, self.plain.bends_rad());
        let dual = |i: usize| -> Dual<MAX_LEARNT> {
            Dual { value: bends_rad[i], tangent: core::array::from_fn(|lane| slopes[(i, lane)]) }
        };
        let seen = chain.seen.add(core::array::from_fn(dual), chain.machine.n(), time_s);
        SMatrix::from_fn(|i, lane| seen[i].tangent[lane])
    }

    /// The slopes of the newest equilibrium, before the lines that have slid are noted.
    fn note_equilibrium(&mut self) {
        let (chain, machine) = (&self.plain.chain, &self.plain.chain.machine);
        if self.plain.is_rigid() {
            self.unknowns.fixed_rows_mut::<MAX_BENDS>(0).copy_from(&(machine.pinv() * self.play_m));
            return;
        }
        let at = &self.plain.unknowns;
        let mut rest = SMatrix::<f64, N, MAX_LEARNT>::zeros();
        let grad = machine.grad_energy_nm(&self.plain.bends_rad()).component_mul(&chain.of_segments.eta);
        rest.fixed_rows_mut::<MAX_BENDS>(0).copy_from(&(grad * self.seed(EffectKind::StiffnessScale)));
        let row = |k: usize| SegmentPredictor::row(machine.j(), machine.segment_of(k), k);
        for k in 0..machine.n_lines() {
            let (load, _) = self.load(&self.plain.loaded(at, k), k);
            rest -= row(k) * load;
        }
        let (_, tangent) = self.plain.equations(at);
        // The equilibrium is stable, so that this matrix is positive definite: it always has its inverse.
        let Some(unknowns) = tangent.lu().solve(&-rest) else { return };
        let mut seat_m = self.seat_m;
        for k in 0..machine.n_lines() {
            let loaded = self.plain.loaded(at, k);
            if loaded.side == 0.0 {
                continue;
            }
            let (row, (load, softer)): (Unknowns, _) = (row(k), self.load(&loaded, k));
            let load = load - self.plain.falls(&loaded, &row, k).transpose() * unknowns;
            let mut travels = row;
            let mut bends = travels.fixed_rows_mut::<MAX_BENDS>(0);
            bends *= 1.0 + loaded.tau_n * chain.inside * machine.give_per_n[k];
            seat_m.set_row(k, &(travels.transpose() * unknowns + softer * loaded.tau_n + load * loaded.c_d_m_per_n));
        }
        (self.unknowns, self.seat_m) = (unknowns, seat_m);
    }
}

impl SlopedPredictor<MAX_BENDS, MAX_LINES> for SegmentTangents {
    fn step(&mut self, q_tilde_m: &[f64; MAX_LINES], at: &Circumstances) -> Sloped {
        let q_tilde_m = LineValues::from(*q_tilde_m);
        if !q_tilde_m.iter().all(|q| q.is_finite()) {
            return self.seen(SMatrix::zeros(), at.time_s);
        }
        self.note_plays(&q_tilde_m);
        self.plain.balance(&q_tilde_m);
        self.note_equilibrium();
        self.plain.settle();
        let mut slopes: SMatrix<f64, MAX_BENDS, MAX_LEARNT> = self.unknowns.fixed_rows::<MAX_BENDS>(0).into();
        if !self.plain.chain.seen.is_empty() {
            slopes = self.seen_by_formulas(&slopes, at.time_s);
        }
        for (mut row, scale) in slopes.row_iter_mut().zip(self.plain.chain.of_segments.seen_scale.iter()) {
            row *= *scale;
        }
        self.seen(slopes, at.time_s)
    }

    /// Also moves everything that is remembered to where it would be, to first order, had the values been these all along.
    fn set(&mut self, values: &[f64; MAX_LEARNT]) {
        let mut moved = SMatrix::<f64, MAX_LEARNT, 1>::zeros();
        for (lane, (own, &value)) in self.values.iter_mut().zip(values).enumerate() {
            if own.is_finite() && value.is_finite() {
                moved[lane] = (value - *own) / self.sd[lane];
                *own = value;
            }
        }
        self.plain.unknowns += self.unknowns * moved;
        self.plain.play_m += self.play_m * moved;
        self.plain.seat_m += self.seat_m * moved;
        self.plain.chain.set(&self.values);
    }
}
