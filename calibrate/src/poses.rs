//! eta and the half-width of the play from guided poses: the robot moves, the user measures the bend.
//!
//! In each plane the snake first bends 30 deg the other way, so that every direction is known, then takes five bends from below
//! and the same from above. The bend is an unknown of the fit: what encoders and values predict is compared with what was
//! measured, because a measured bend on both sides pulls eta down. Six poses that the fit never sees check it.

use crate::fit::{Parameter, fit};
use crate::lines::{ConeFriction, Lines, Turning};
use crate::log::ReadingLog;
use crate::pictures::Pictures;
use crate::pose_answers::{Answer, picture_of, typed};
use crate::pose_plan::direction;
use crate::{CalibrateError, CalibratedValue, Dialogue, LeastSquares, pose_price};
use krait_model::MachineParameters;
use nalgebra::{Vector2, Vector3};
use std::io::{BufRead, Write};
use std::path::Path;

pub use crate::pose_plan::PosePlan;
pub use crate::pose_reading::PoseReading;

/// Degrees of freedom before which it does not end: a whole plane up and down, so that the check asks for no extrapolation.
const LEAST_DOF: usize = 18;
/// Standard errors at which the dialogue ends: eta, 1, and half-width, m.
const ENOUGH: [f64; 2] = [0.01, 6e-6];
/// Standard errors above these leave a value open.
const OPEN: [f64; 2] = [0.1, 60e-6];
/// Part of the reading's standard deviation that the poses of the check may be off by, rms.
const CHECK_LIMIT: f64 = 2.0;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseSettings {
    /// Dimensions and material.
    pub machine: MachineParameters,
    /// Friction mu of the cone, 1.
    pub mu: f64,
    /// Friction f_s, N.
    pub f_s_n: f64,
    /// Where in the cone the friction acts.
    pub cone: ConeFriction,
    /// Share of its load that a line carries inside the snake, so that it extends there: the effect `inside-extension`; 0: none.
    pub inside_share: f64,
    /// Standard deviation of each component of a measured bend vector, rad.
    pub sd_rad: f64,
    /// Planes and how far; with planes of one camera only the component of each bend in the picture counts.
    pub plan: PosePlan,
}

/// Where the robot shall go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGoal {
    /// The planned bend vector, rad.
    pub bend_rad: Vector2<f64>,
    /// Actuator positions for it with eta 1, m, push positive.
    pub q_tilde_m: Vector3<f64>,
    /// The plane of a picture that shows it from one side, deg, 0 to less than 180; none for the straight pose.
    pub picture_deg: Option<f64>,
}

/// Where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseReached {
    /// Encoders, m.
    pub q_m: Vector3<f64>,
    /// The bend vector, rad, where whoever moved it has measured that too: nothing is asked then.
    pub bend_rad: Option<[f64; 2]>,
}

impl From<Vector3<f64>> for PoseReached {
    /// Of a robot that only its encoders are known of.
    fn from(q_m: Vector3<f64>) -> Self {
        Self { q_m, bend_rad: None }
    }
}

/// eta (1) and half-width (m) with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// The fit.
    pub fit: LeastSquares,
    /// Error of the predicted bend on the poses of the check, rad rms; `None` before they are measured.
    pub check_rms_rad: Option<f64>,
    /// The same in standard deviations of the readings.
    pub check_rms_sd: Option<f64>,
}

impl Poses {
    /// eta, 1, with its standard error.
    pub fn eta(&self) -> (f64, f64) {
        (self.fit.value[0], self.fit.se(0))
    }

    /// Half-width, m, with its standard error.
    pub fn half_width_m(&self) -> (f64, f64) {
        (self.fit.value[1], self.fit.se(1))
    }

    /// For the model file.
    pub fn calibrated(&self) -> Vec<CalibratedValue> {
        let value = |effect, parameter, (value, se)| CalibratedValue { effect, parameter, value, se };
        vec![value("stiffness-scale", "eta", self.eta()), value("backlash", "half_width_m", self.half_width_m())]
    }

    fn sentence(&self) -> String {
        let ((eta, eta_se), (h, h_se)) = (self.eta(), self.half_width_m());
        format!("eta {eta:.3} +- {eta_se:.3}, half-width {:.3} +- {:.3} mm", h * 1e3, h_se * 1e3)
    }

    fn enough(&self) -> bool {
        self.fit.dof >= LEAST_DOF && self.eta().1 < ENOUGH[0] && self.half_width_m().1 < ENOUGH[1]
    }
}

/// Fits eta and half-width to the readings that are not for the check, and checks with the others.
///
/// # Errors
/// [`CalibrateError::NotDetermined`], [`CalibrateError::Setting`].
pub fn poses(readings: &[PoseReading], settings: &PoseSettings) -> Result<Poses, CalibrateError> {
    fitted(readings, settings, [1.0, 0.0])
}

fn fitted(readings: &[PoseReading], settings: &PoseSettings, start: [f64; 2]) -> Result<Poses, CalibrateError> {
    let lines = lines(settings)?;
    let mut parameters = vec![
        Parameter { name: "eta", start: start[0], scale: 0.1 },
        Parameter { name: "half_width_m", start: start[1], scale: 1e-5 },
    ];
    let zero_sd_rad = zero_sd_rad(readings);
    if zero_sd_rad.is_some() {
        parameters.extend(["zero of b_x", "zero of b_y"].map(|name| Parameter { name, start: 0.0, scale: 1e-3 }));
    }
    let zero = |value: &[f64], k: usize| value.get(2 + k).copied().unwrap_or(0.0);
    let of = |check: bool, value: &[f64]| {
        let mut all = Vec::new();
        for r in readings.iter().filter(|r| r.check == check && r.is_measured()) {
            let b = lines.bend_rad(r.q_m(), &r.signs(), value[0], value[1])?;
            // The pictures' zero is of the picture: of b_x where one side is all that is seen.
            let errors = r.errors_rad(b).into_iter().enumerate();
            all.extend(errors.map(|(k, (error, sd))| ((error - zero(value, k)) / sd, sd)));
        }
        Some(all)
    };
    let residuals = |value: &[f64]| {
        let own = of(false, value)?.into_iter().map(|(in_sd, _)| in_sd);
        let prior = zero_sd_rad.into_iter().flat_map(|sd| [zero(value, 0) / sd[0], zero(value, 1) / sd[1]]);
        Some(own.chain(prior).collect())
    };
    let fit = fit(&parameters, residuals, |_| missing(readings))?;
    let checked = of(true, &fit.value).filter(|all| !all.is_empty());
    let rms = |of: fn(&(f64, f64)) -> f64| {
        checked.as_ref().map(|all| (all.iter().map(|one| of(one).powi(2)).sum::<f64>() / all.len() as f64).sqrt())
    };
    let (check_rms_rad, check_rms_sd) = (rms(|(in_sd, sd_rad)| in_sd * sd_rad), rms(|(in_sd, _)| *in_sd));
    Ok(Poses { fit, check_rms_rad, check_rms_sd })
}

/// What the pictures of a session have in common, rad, for each component: the base that all of their bends begin at has one error. It is
/// unknown in the fit, within this; nothing for bends that were typed.
fn zero_sd_rad(readings: &[PoseReading]) -> Option<[f64; 2]> {
    let own: Vec<[f64; 2]> = readings.iter().filter_map(|r| r.base_sd_xy_rad).collect();
    let mean = |k: usize| {
        let seen: Vec<f64> = own.iter().map(|sd| sd[k]).filter(|sd| sd.is_finite()).collect();
        // Of one side's pictures the second component is not seen, and its zero moves nothing.
        if seen.is_empty() { 1e-3 } else { (seen.iter().sum::<f64>() / seen.len() as f64).max(1e-9) }
    };
    (!own.is_empty()).then(|| [mean(0), mean(1)])
}

fn lines(settings: &PoseSettings) -> Result<Lines, CalibrateError> {
    if !(settings.sd_rad > 1e-6 && settings.sd_rad < 0.2) {
        let (name, expected) = ("the standard deviation of a bend", "1e-6 to 0.2 rad");
        return Err(CalibrateError::Setting { name, found: settings.sd_rad, expected });
    }
    Lines::new(&settings.machine, settings.mu, settings.f_s_n, settings.cone, settings.inside_share)
        .ok_or_else(|| CalibrateError::Model("its machine is out of range".to_owned()))
}

/// What a plan that is not the full one costs, in words: the standard errors to expect of it beside those of the full one.
///
/// # Errors
/// [`CalibrateError::Setting`], [`CalibrateError::Model`].
pub fn price(settings: &PoseSettings) -> Result<Option<String>, CalibrateError> {
    Ok(pose_price::sentence(&settings.plan, &lines(settings)?, settings.sd_rad))
}

/// The largest bend, whole degrees, in every plane of the full plan that needs no more than this travel of an actuator, m, and this load
/// at it, N, for a snake of this eta; at most `most_deg`.
///
/// # Errors
/// [`CalibrateError::Setting`], [`CalibrateError::Model`].
pub fn largest_deg_within(
    settings: &PoseSettings,
    eta: f64,
    (most_deg, travel_m, load_n): (f64, f64, f64),
) -> Result<f64, CalibrateError> {
    let lines = lines(settings)?;
    let fits = |bend_deg: f64| {
        (0..24).all(|k| {
            let towards = direction(f64::from(k) * 15.0);
            let (bend_rad, signs) = (towards * bend_deg.to_radians(), lines.motion(towards).map(f64::signum));
            lines.encoders_m(bend_rad, &signs, eta, 0.0).amax() <= travel_m
                && lines.actuator_loads_n(bend_rad, &signs, eta).amax() <= load_n
        })
    };
    let mut bend_deg = most_deg.floor();
    while bend_deg > 0.0 && !fits(bend_deg) {
        bend_deg -= 1.0;
    }
    Ok(bend_deg)
}

/// Readings that would determine both.
fn missing(readings: &[PoseReading]) -> String {
    let fitted = || readings.iter().filter(|r| !r.check && r.is_measured());
    let n = fitted().count();
    let ways = |sign: f64| fitted().any(|r| r.s1 == sign);
    if n < 4 {
        "poses: ten from below and ten from above, 10 to 60 deg".to_owned()
    } else if !(ways(1.0) && ways(-1.0)) {
        "poses from above: the way back tells play from eta".to_owned()
    } else {
        format!("more poses over 10 to 60 deg ({n} so far), or a better camera")
    }
}

/// Refuses values that are not determined, or that the poses of the check do not bear out.
fn accept(found: &Poses, readings: &[PoseReading]) -> Result<(), CalibrateError> {
    for (k, (parameter, (value, se))) in
        [("eta", found.eta()), ("half_width_m", found.half_width_m())].into_iter().enumerate()
    {
        if se > OPEN[k] {
            let found = format!("{value:.5} +- {se:.5}");
            return Err(CalibrateError::NotDetermined { parameter, found, missing: missing(readings) });
        }
    }
    found.fit.check("is the camera's error as stated, and do mu and f_s belong to this robot? krait lab diagnose may name an effect")?;
    let checked = || readings.iter().filter(|r| r.check && r.is_measured());
    let n_checked = checked().count();
    let Some(ratio) = found.check_rms_sd.filter(|_| n_checked >= 6) else {
        let found = format!("{n_checked} poses are kept for the check");
        let missing = "the six poses of the check".to_owned();
        return Err(CalibrateError::NotDetermined { parameter: "the model's error", found, missing });
    };
    if ratio > CHECK_LIMIT {
        let n: usize = checked().map(PoseReading::n_components).sum();
        return Err(CalibrateError::Misfit {
            chi2: ratio * ratio * n as f64,
            dof: n,
            limit: CHECK_LIMIT * CHECK_LIMIT * n as f64,
            advice: "the poses that were not fitted are off: krait lab diagnose may name the effect that is missing",
        });
    }
    Ok(())
}

/// Goes through the plan as far as a pose is still to be read, and home.
fn walk<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    (log, readings): (&mut ReadingLog, &mut Vec<PoseReading>),
    (settings, lines, pictures): (&PoseSettings, &Lines, Option<&Pictures>),
    go: &mut impl FnMut(&mut Dialogue<R, W>, PoseGoal) -> Result<PoseReached, CalibrateError>,
) -> Result<(), CalibrateError> {
    let plan = settings.plan.places();
    let is_front = !settings.plan.front_deg().is_empty();
    let goal = |bend_rad: Vector2<f64>, picture_deg: f64| PoseGoal {
        bend_rad,
        q_tilde_m: lines.planned_m(bend_rad, 1.0),
        picture_deg: Some(picture_deg),
    };
    let straight = PoseGoal { bend_rad: Vector2::zeros(), q_tilde_m: Vector3::zeros(), picture_deg: None };
    let is_read = |readings: &[PoseReading], k: usize| readings.iter().any(|r| r.pose == k as u32 + 1);
    let mut progress = Progress::of(readings, settings);
    let mut turning = None;
    let mut shown_deg = None;
    for (k, place) in plan.iter().enumerate() {
        let is_wanted = |k: usize| !plan[k].passing && (plan[k].check || !progress.enough) && !is_read(readings, k);
        if !(k..plan.len()).any(is_wanted) {
            break;
        }
        if progress.enough && !place.check {
            continue;
        }
        let pose = k as u32 + 1;
        let turning = match &mut turning {
            Some(turning) => turning,
            none => none.insert(Turning::new(go(dialogue, straight)?.q_m)),
        };
        let wanted = direction(place.plane_deg) * place.bend_deg.to_radians();
        // Through the straight pose first, where the plane changes: a straight line of actuators is then a path in one plane.
        if place.passing && place.bend_deg < 0.0 {
            turning.follow(go(dialogue, straight)?.q_m);
        }
        let reached = go(dialogue, goal(wanted, place.picture_deg()))?;
        let reached_m = reached.q_m;
        turning.follow(reached_m);
        if place.passing || is_read(readings, k) {
            continue;
        }
        let Some(signs) = turning.signs() else {
            dialogue
                .say(&format!("  pose {pose} is left out: a line has not gone through its play since it turned"))?;
            continue;
        };
        let picture_deg = is_front.then(|| place.picture_deg());
        if let Some(plane_deg) = picture_deg.filter(|_| shown_deg != picture_deg && reached.bend_rad.is_none()) {
            dialogue.say(&format!(
                "turn the robot about its axis, or the camera, until the picture shows the plane {plane_deg:.0} deg"
            ))?;
            shown_deg = picture_deg;
        }
        let check = if place.check { ", for the check" } else { "" };
        let (bend_deg, plane_deg) = (place.bend_deg, place.plane_deg);
        let question = format!("pose {pose}: {bend_deg:.1} deg, plane {plane_deg:.0}, from {}{check}", place.from);
        let answer = match (pictures, reached.bend_rad) {
            (Some(_), _) => picture_of(dialogue, &question, pose, readings)?,
            (None, Some(bend_rad)) => {
                let [x, y] = bend_rad.map(f64::to_degrees);
                dialogue.say(&format!("{question}: {x:.3} {y:.3} deg measured"))?;
                Answer::Measured([x, y], None)
            }
            (None, None) => typed(dialogue, &question, picture_deg)?,
        };
        let (bend_deg, image) = match answer {
            Answer::Measured(bend_deg, image) => (bend_deg, image),
            Answer::Skip => continue,
            Answer::Quit => break,
        };
        let reading = PoseReading {
            pose,
            check: place.check,
            plane_deg: place.plane_deg,
            bend_deg: place.bend_deg,
            b_x_rad: bend_deg[0].to_radians(),
            b_y_rad: bend_deg[1].to_radians(),
            sd_rad: settings.sd_rad,
            q1_m: reached_m.x,
            q2_m: reached_m.y,
            q3_m: reached_m.z,
            s1: signs.x,
            s2: signs.y,
            s3: signs.z,
            image,
            sd_xy_rad: None,
            base_sd_xy_rad: None,
        };
        log.add(&reading)?;
        readings.push(reading);
        if pictures.is_none()
            && let Some(found) = progress.refit(readings, settings)
        {
            dialogue.say(&format!("  {}", found.sentence()))?;
        }
    }
    if turning.is_some() {
        go(dialogue, straight)?;
    }
    Ok(())
}

/// What the readings so far say.
struct Progress {
    /// The values are as precise as wanted: only the poses of the check are still read.
    enough: bool,
    /// Where the next fit starts.
    newest: [f64; 2],
}

impl Progress {
    /// Of readings that an earlier run left.
    fn of(readings: &[PoseReading], settings: &PoseSettings) -> Self {
        let mut progress = Self { enough: false, newest: [1.0, 0.0] };
        progress.refit(readings, settings);
        progress
    }

    fn refit(&mut self, readings: &[PoseReading], settings: &PoseSettings) -> Option<Poses> {
        let found = fitted(readings, settings, self.newest).ok()?;
        // The first few readings leave the values anywhere; the next fit then starts from the beginning again.
        let known = found.eta().1 < OPEN[0] && found.half_width_m().1 < OPEN[1];
        self.newest = if known { [found.eta().0, found.half_width_m().0] } else { [1.0, 0.0] };
        self.enough = self.enough || found.enough();
        Some(found)
    }
}

/// The dialogue: `go` moves the robot straight to a goal and says what the encoders read there, with the bend where it knows that too. With the table of
/// bends of [`crate::photo`], which need not be there yet, each pose takes the name of its pictures in place of a bend.
///
/// # Errors
/// [`CalibrateError`]; what was read is in the CSV.
pub fn run<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    csv: &Path,
    bends: Option<&Path>,
    settings: &PoseSettings,
    mut go: impl FnMut(&mut Dialogue<R, W>, PoseGoal) -> Result<PoseReached, CalibrateError>,
) -> Result<Poses, CalibrateError> {
    let lines = lines(settings)?;
    let pictures = bends.map(Pictures::read).transpose()?;
    let (mut log, mut readings) = ReadingLog::open::<PoseReading>(csv)?;
    if let Some(k) = readings.iter().position(|r| r.image.is_some() != pictures.is_some()) {
        let reason = if pictures.is_some() {
            "its bend was typed, and --bends is for poses that name their pictures: leave it out, or begin another --csv"
        } else {
            "it names a picture: say with --bends which table has its bend"
        };
        return Err(CalibrateError::Row { file: log.name(), row: k + 2, reason: reason.to_owned() });
    }
    let plan = settings.plan.places();
    let is_of_it = |r: &PoseReading| {
        let place = plan.get((r.pose as usize).wrapping_sub(1));
        place.is_some_and(|p| (p.plane_deg, p.bend_deg, p.check) == (r.plane_deg, r.bend_deg, r.check))
    };
    if let Some(k) = readings.iter().position(|r| !is_of_it(r)) {
        let reason =
            "its pose is of another plan: go on with --front and --largest-deg as it was begun, or begin another --csv";
        return Err(CalibrateError::Row { file: log.name(), row: k + 2, reason: reason.to_owned() });
    }
    if let Some(pictures) = &pictures {
        pictures.give(&mut readings, !settings.plan.front_deg().is_empty());
        dialogue.say("At each pose photograph the snake and type the name under which its pictures will be clicked; Enter takes the one in brackets, s skips the pose, q stops and fits.")?;
    } else {
        dialogue
            .say("At each pose type the measured bend vector in deg: b_x b_y; s skips the pose, q stops and fits.")?;
    }
    match walk(dialogue, (&mut log, &mut readings), (settings, &lines, pictures.as_ref()), &mut go) {
        Ok(()) | Err(CalibrateError::Stopped) => {}
        Err(error) => return Err(error),
    }
    if let Some(said) = pictures.as_ref().and_then(|pictures| pictures.waiting(&readings)) {
        if !readings.iter().any(PoseReading::is_measured) {
            return Err(CalibrateError::Pictures(said));
        }
        dialogue.say(&said)?;
    }
    let found = poses(&readings, settings)?;
    let fit = &found.fit;
    let check = found.check_rms_rad.map_or(f64::NAN, f64::to_degrees);
    dialogue.say(&format!(
        "{}, correlation {:.2}, chi2 {:.1}/{}; poses that were not fitted: {check:.2} deg rms",
        found.sentence(),
        fit.correlation(0, 1),
        fit.chi2,
        fit.dof
    ))?;
    accept(&found, &readings)?;
    Ok(found)
}
