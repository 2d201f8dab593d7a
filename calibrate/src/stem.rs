//! The angle phi of the stem, with eta, play and static friction, from recorded encoders, load cells and shapes.
//!
//! Only 2 mu phi acts, so mu must be known. A row counts where every line has gone through its play since it turned; rows of one
//! direction within 0.05 mm are one reading, their mean. The likelihood is that of `stem_rows`.

use crate::fit::undetermined;
use crate::lines::Turning;
use crate::stem_rows::Rows;
use crate::{CalibrateError, CalibratedValue, ConeFriction, LeastSquares};
use core::ops::RangeInclusive;
use krait_model::MachineParameters;
use nalgebra::{DMatrix, Matrix4, Vector2, Vector3, Vector4};

/// Rows whose actuators are within this of the first one are one reading, m.
const ONE_READING_M: f64 = 50e-6;
/// Standard deviations of an encoder that count as motion.
const MOVED_SD: f64 = 6.0;
/// Readings that a fit needs.
const FEWEST: usize = 4;
/// Standard errors above these leave a value open: eta, 1; half-width, m; f_s, N; phi, rad (3 deg).
const OPEN: [f64; 4] = [0.1, 60e-6, 0.6, 0.0524];
/// Names, and steps that matter.
const PARAMETERS: [(&str, f64); 4] =
    [("eta", 0.1), ("half_width_m", 1e-5), ("f_s_n", 0.1), ("the stem's angle phi", 0.01)];
/// Largest step that counts as none, in these.
const SETTLED: f64 = 1e-6;
const MAX_ITERATIONS: u32 = 100;
const MAX_HALVINGS: u32 = 12;

/// What a standard deviation of a bend can be, rad.
pub const BEND_SD_RAD: RangeInclusive<f64> = 1e-6..=0.2;

/// One row of measurements; NaN where nothing was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StemRow {
    /// A new number begins anew: nothing is known of the directions.
    pub trial: u32,
    /// Encoders, m, push positive.
    pub q_tilde_m: [f64; 3],
    /// Load cells at the actuators, N, push positive.
    pub loads_n: [f64; 3],
    /// Measured bend vector, rad.
    pub bend_rad: [f64; 2],
    /// Its standard deviation in each component, rad; NaN: the stated one.
    pub bend_sd_rad: f64,
}

/// What is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StemSettings {
    /// Dimensions and material; `phi_rad` is where the fit begins.
    pub machine: MachineParameters,
    /// Friction mu of the cone, 1.
    pub mu: f64,
    /// Its standard error, 1; 0 if none is stated.
    pub mu_se: f64,
    /// Where in the cone the friction acts.
    pub cone: ConeFriction,
    /// Share of its load that a line carries inside the snake, so that it extends there: the effect `inside-extension`; 0: none.
    pub inside_share: f64,
    /// Standard deviation of a load cell, N.
    pub cell_sd_n: f64,
    /// Standard deviation of a component of the measured bend where a row has none, rad.
    pub bend_sd_rad: f64,
    /// Standard deviation of an encoder with all that moves it alike in the rows of one reading, m.
    pub encoder_sd_m: f64,
}

/// The mean of rows at one place in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StemReading {
    pub q_tilde_m: Vector3<f64>,
    pub q_sd_m: f64,
    /// Direction in which each line moved last, 1 or -1.
    pub signs: Vector3<f64>,
    /// Loads and their standard deviation, N.
    pub loads_n: Option<(Vector3<f64>, f64)>,
    /// Bend vector and the standard deviation of a component, rad.
    pub bend_rad: Option<(Vector2<f64>, f64)>,
}

/// eta (1), half-width (m), f_s (N) and phi (rad) with their covariance, mu taken for exact.
#[derive(Clone, Debug, PartialEq)]
pub struct Stem {
    /// The fit.
    pub fit: LeastSquares,
    /// Readings on the way against the elastic load, and back.
    pub n_readings: [usize; 2],
    /// Readings with loads.
    pub n_with_loads: usize,
    mu: f64,
    mu_se: f64,
}

impl Stem {
    /// eta, 1, with its standard error.
    pub fn eta(&self) -> (f64, f64) {
        (self.fit.value[0], self.fit.se(0))
    }

    /// Half-width of the play, m, with its standard error.
    pub fn half_width_m(&self) -> (f64, f64) {
        (self.fit.value[1], self.fit.se(1))
    }

    /// f_s, N, with its standard error.
    pub fn f_s_n(&self) -> (f64, f64) {
        (self.fit.value[2], self.fit.se(2))
    }

    /// phi, rad, with its standard error where mu is exact.
    pub fn phi_at_mu_rad(&self) -> (f64, f64) {
        (self.fit.value[3], self.fit.se(3))
    }

    /// phi, rad, with its standard error, mu's own included.
    pub fn phi_rad(&self) -> (f64, f64) {
        let (phi_rad, se) = self.phi_at_mu_rad();
        (phi_rad, se.hypot(phi_rad * self.mu_se / self.mu))
    }

    /// For the model file.
    pub fn calibrated(&self) -> Vec<CalibratedValue> {
        let value = |effect, parameter, (value, se)| CalibratedValue { effect, parameter, value, se };
        vec![
            value("machine", "phi_rad", self.phi_rad()),
            value("stiffness-scale", "eta", self.eta()),
            value("static-friction", "f_s_n", self.f_s_n()),
            value("backlash", "half_width_m", self.half_width_m()),
        ]
    }

    /// The values in words, and what the data are short of.
    pub fn sentences(&self) -> String {
        let ((eta, eta_se), (h, h_se), (f_s, f_s_se)) = (self.eta(), self.half_width_m(), self.f_s_n());
        let (phi, at_mu) = self.phi_at_mu_rad();
        let ([there, back], fit) = (self.n_readings, &self.fit);
        let mut text = format!(
            "stem angle phi {:.2} +- {:.2} deg with mu {:.4} exact, +- {:.2} deg with mu's own error {:.4}; g = e^(2 mu phi) {:.4}\n\
             eta {eta:.4} +- {eta_se:.4}, half-width {:.4} +- {:.4} mm, f_s {f_s:.3} +- {f_s_se:.3} N\n\
             {} readings ({there} against the load, {back} on the way back, {} with loads), chi2 {:.1}/{}",
            phi.to_degrees(),
            at_mu.to_degrees(),
            self.mu,
            self.phi_rad().1.to_degrees(),
            self.mu_se,
            (2.0 * self.mu * phi).exp(),
            h * 1e3,
            h_se * 1e3,
            there + back,
            self.n_with_loads,
            fit.chi2,
            fit.dof
        );
        if there == 0 || back == 0 {
            text += "\none direction only: eta and phi scale its loads alike and are told apart by the shape alone; readings of the \
                     other direction would determine phi several times as well";
        }
        text
    }
}

/// Sums of the rows of one reading.
#[derive(Clone, Copy, Debug)]
struct Group {
    first_m: Vector3<f64>,
    signs: Vector3<f64>,
    /// Of rows with loads, with a bend, with both.
    sums: [Sum; 3],
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    n: f64,
    q_m: Vector3<f64>,
    tau_n: Vector3<f64>,
    bend_rad: Vector2<f64>,
    bend_variance: f64,
}

impl Group {
    fn new(first_m: Vector3<f64>, signs: Vector3<f64>) -> Self {
        Self { first_m, signs, sums: [Sum::default(); 3] }
    }

    fn holds(&self, q_m: &Vector3<f64>, signs: &Vector3<f64>) -> bool {
        self.signs == *signs && (q_m - self.first_m).amax() <= ONE_READING_M
    }

    fn add(&mut self, row: &StemRow, bend_sd_rad: f64) {
        let has = [row.loads_n.iter().all(|x| x.is_finite()), row.bend_rad.iter().all(|x| x.is_finite())];
        for (sum, counts) in self.sums.iter_mut().zip([has[0], has[1], has[0] && has[1]]) {
            if counts {
                sum.n += 1.0;
                sum.q_m += Vector3::from(row.q_tilde_m);
                sum.tau_n += Vector3::from(row.loads_n);
                sum.bend_rad += Vector2::from(row.bend_rad);
                sum.bend_variance += bend_sd_rad * bend_sd_rad;
            }
        }
    }

    /// The mean of the rows that have most.
    fn reading(&self, settings: &StemSettings) -> Option<StemReading> {
        let [loads, bends, both] = &self.sums;
        let sum = [both, loads, bends].into_iter().find(|sum| sum.n > 0.0)?;
        let n = sum.n;
        let (has_loads, has_bend) = (loads.n > 0.0, bends.n > 0.0 && (both.n > 0.0 || loads.n == 0.0));
        Some(StemReading {
            q_tilde_m: sum.q_m / n,
            q_sd_m: settings.encoder_sd_m,
            signs: self.signs,
            loads_n: has_loads.then(|| (sum.tau_n / n, settings.cell_sd_n / n.sqrt())),
            bend_rad: has_bend.then(|| (sum.bend_rad / n, sum.bend_variance.sqrt() / n)),
        })
    }
}

/// The readings that rows make.
fn readings(rows: &[StemRow], settings: &StemSettings) -> Vec<StemReading> {
    let moved_m = MOVED_SD * settings.encoder_sd_m;
    let mut found = Vec::new();
    let mut group: Option<Group> = None;
    let mut turning: Option<(u32, Turning)> = None;
    for row in rows {
        let q_m = Vector3::from(row.q_tilde_m);
        let signs = match &mut turning {
            Some((trial, turning)) if *trial == row.trial => {
                turning.follow(q_m);
                turning.signs()
            }
            _ => {
                turning = Some((row.trial, Turning::of(q_m, moved_m)));
                None
            }
        };
        if group.as_ref().is_some_and(|own| !signs.is_some_and(|signs| own.holds(&q_m, &signs))) {
            found.extend(group.take().and_then(|own| own.reading(settings)));
        }
        if let Some(signs) = signs {
            let bend_sd_rad = if row.bend_sd_rad.is_finite() { row.bend_sd_rad } else { settings.bend_sd_rad };
            group.get_or_insert_with(|| Group::new(q_m, signs)).add(row, bend_sd_rad);
        }
    }
    found.extend(group.and_then(|own| own.reading(settings)));
    found
}

/// Fits phi, eta, play and static friction to rows in order of time.
///
/// # Errors
/// [`CalibrateError::Setting`] for a setting out of range; [`CalibrateError::NotDetermined`] where the rows leave a value open,
/// with what would determine it; [`CalibrateError::Misfit`] where the law does not describe them.
pub fn stem(rows: &[StemRow], settings: &StemSettings) -> Result<Stem, CalibrateError> {
    let law = law(settings)?;
    let readings = readings(rows, settings);
    let n_with_loads = readings.iter().filter(|r| r.loads_n.is_some()).count();
    let open = |k: usize, found: String, ways: Option<[usize; 2]>| CalibrateError::NotDetermined {
        parameter: PARAMETERS[k].0,
        found,
        missing: missing(n_with_loads, ways),
    };
    if readings.len() < FEWEST {
        let found =
            format!("{} reading(s) of lines that have gone through their play since they turned", readings.len());
        return Err(open(3, found, None));
    }
    let unsettled = || open(3, "the fit does not settle".to_owned(), None);
    let mut value = Vector4::new(1.0, 0.0, 0.5, settings.machine.phi_rad.clamp(0.1, 3.0));
    let mut own: Vec<Vector3<f64>> = readings
        .iter()
        .map(|r| r.bend_rad.map_or_else(|| law.bend_rad(r.q_tilde_m) * 0.6, |(bend_rad, _)| bend_rad).push(0.0))
        .collect();
    for _ in 0..MAX_ITERATIONS {
        let known = law.reduced(&readings, &value, &own).ok_or_else(unsettled)?;
        let covariance = match covariance(&known.normal) {
            Ok(covariance) => covariance,
            Err(k) => {
                let found = "no reading depends on it, or only together with another value".to_owned();
                return Err(open(k, found, Some(ways(&law, &readings, &value, &own))));
            }
        };
        let step = -covariance * known.gradient;
        let mut part = 1.0;
        let mut taken = None;
        for _ in 0..MAX_HALVINGS {
            let (next, moved) = (value + step * part, known.moved(&own, &step, part));
            if law.chi2(&readings, &next, &moved) <= known.chi2 * (1.0 + 1e-12) + 1e-12 {
                taken = Some((next, moved));
                break;
            }
            part *= 0.5;
        }
        let settled = (0..4).all(|k| (step[k] / PARAMETERS[k].1).abs() < SETTLED);
        let Some((next, moved)) = taken else {
            if settled || is_flat(&step, &covariance) {
                return accept(&law, settings, &readings, (value, own), covariance);
            }
            return Err(unsettled());
        };
        (value, own) = (next, moved);
        if settled {
            return accept(&law, settings, &readings, (value, own), covariance);
        }
    }
    Err(unsettled())
}

/// Whether a step is a small part of the standard deviations: at a kink of the law, where a line's load is zero, none is better.
fn is_flat(step: &Vector4<f64>, covariance: &Matrix4<f64>) -> bool {
    (0..4).all(|k| step[k].abs() < 0.05 * covariance[(k, k)].sqrt())
}

fn law(settings: &StemSettings) -> Result<Rows, CalibrateError> {
    let ranges = [
        ("mu", settings.mu, 1e-3..=1.0, "0.001 to 1"),
        ("the standard deviation of a load cell", settings.cell_sd_n, 1e-4..=100.0, "0.0001 to 100 N"),
        ("the standard deviation of a bend", settings.bend_sd_rad, BEND_SD_RAD, "1e-6 to 0.2 rad"),
        ("the standard deviation of an encoder", settings.encoder_sd_m, 1e-8..=1e-3, "1e-8 to 0.001 m"),
    ];
    for (name, found, range, expected) in ranges {
        if !range.contains(&found) {
            return Err(CalibrateError::Setting { name, found, expected });
        }
    }
    Rows::new(&settings.machine, settings.mu, settings.cone, settings.inside_share)
        .ok_or_else(|| CalibrateError::Model("its machine is out of range".to_owned()))
}

/// The inverse of normal equations, or the parameter that they leave open.
fn covariance(normal: &Matrix4<f64>) -> Result<Matrix4<f64>, usize> {
    let scaled = DMatrix::from_fn(4, 4, |i, k| normal[(i, k)] * PARAMETERS[i].1 * PARAMETERS[k].1);
    if let Some(k) = undetermined(&scaled) {
        return Err(k);
    }
    let inverse = scaled.try_inverse().ok_or(3_usize)?;
    Ok(Matrix4::from_fn(|i, k| inverse[(i, k)] * PARAMETERS[i].1 * PARAMETERS[k].1))
}

/// Readings against the load, and on the way back.
fn ways(law: &Rows, readings: &[StemReading], value: &Vector4<f64>, own: &[Vector3<f64>]) -> [usize; 2] {
    let against = |(r, own): (&StemReading, &Vector3<f64>)| law.at(value, own.xy(), own.z, &r.signs).against > 0.0;
    let there = readings.iter().zip(own).filter(|pair| against(*pair)).count();
    [there, readings.len() - there]
}

/// Refuses values that are not determined, or a law that does not hold.
fn accept(
    law: &Rows,
    settings: &StemSettings,
    readings: &[StemReading],
    (value, own): (Vector4<f64>, Vec<Vector3<f64>>),
    covariance: Matrix4<f64>,
) -> Result<Stem, CalibrateError> {
    let n_rows: usize = readings
        .iter()
        .map(|r| 3 + if r.loads_n.is_some() { 3 } else { 0 } + if r.bend_rad.is_some() { 2 } else { 0 })
        .sum();
    let fit = LeastSquares {
        value: value.iter().copied().collect(),
        covariance: DMatrix::from_fn(4, 4, |i, k| covariance[(i, k)]),
        chi2: law.chi2(readings, &value, &own),
        dof: n_rows.saturating_sub(4 + 3 * readings.len()),
    };
    let n_readings = ways(law, readings, &value, &own);
    let n_with_loads = readings.iter().filter(|r| r.loads_n.is_some()).count();
    for k in [3, 2, 1, 0] {
        if fit.se(k) > OPEN[k] || !fit.se(k).is_finite() {
            let found = match k {
                3 => format!("{:.1} +- {:.1} deg", value[k].to_degrees(), fit.se(k).to_degrees()),
                _ => format!("{:.5} +- {:.5}", value[k], fit.se(k)),
            };
            let missing = missing(n_with_loads, Some(n_readings));
            return Err(CalibrateError::NotDetermined { parameter: PARAMETERS[k].0, found, missing });
        }
    }
    fit.check(
        "do the cells read zero without load and one newton for each, and are their error and the camera's as stated? krait lab \
         diagnose may name an effect",
    )?;
    Ok(Stem { fit, n_readings, n_with_loads, mu: settings.mu, mu_se: settings.mu_se })
}

/// Readings that would determine all.
fn missing(n_with_loads: usize, ways: Option<[usize; 2]>) -> String {
    if n_with_loads == 0 {
        "load cells at the actuators (tau1_n to tau3_n): without them friction in the stem moves the shape like play and stiffness"
            .to_owned()
    } else if ways.is_some_and(|[there, back]| there == 0 || back == 0) {
        "the other direction: one alone cannot tell stem friction from stiffness, which scale its loads alike"
            .to_owned()
    } else {
        "slow motion over 10 to 60 deg there and back, in several planes, each line 0.35 mm beyond every turn, or better cells"
            .to_owned()
    }
}
