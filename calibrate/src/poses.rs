//! eta and the half-width of the play from guided poses: the robot moves, the user measures the bend.
//!
//! In each plane the snake first bends 30 deg the other way, so that every direction is known, then takes five bends from below
//! and the same from above. The bend is an unknown of the fit: what encoders and values predict is compared with what was
//! measured, because a measured bend on both sides pulls eta down. Six poses that the fit never sees check it.

use crate::fit::{Parameter, fit};
use crate::lines::{ConeFriction, Lines, Turning};
use crate::log::ReadingLog;
use crate::pictures::Pictures;
use crate::pose_plan::plan;
use crate::{CalibrateError, CalibratedValue, Dialogue, LeastSquares, Reply};
use krait_model::MachineParameters;
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, Write};
use std::path::Path;

/// Degrees of freedom before which it does not end: a whole plane up and down, so that the check asks for no extrapolation.
const LEAST_DOF: usize = 18;
/// Standard errors at which the dialogue ends: eta, 1, and half-width, m.
const ENOUGH: [f64; 2] = [0.01, 6e-6];
/// Standard errors above these leave a value open.
const OPEN: [f64; 2] = [0.1, 60e-6];
/// Part of the reading's standard deviation that the poses of the check may be off by, rms.
const CHECK_LIMIT: f64 = 2.0;

/// One row of the CSV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseReading {
    /// Place in the plan, from 1.
    pub pose: u32,
    /// Whether it is kept for the check.
    pub check: bool,
    /// Planned plane, deg.
    pub plane_deg: f64,
    /// Planned bend, deg.
    pub bend_deg: f64,
    /// Measured bend vector, rad; NaN where a picture is yet to show it.
    pub b_x_rad: f64,
    /// Second component, rad; NaN where it was seen from the front only.
    pub b_y_rad: f64,
    /// Standard deviation of each component, rad.
    pub sd_rad: f64,
    /// Encoders, m, push positive.
    pub q1_m: f64,
    /// Line 2.
    pub q2_m: f64,
    /// Line 3.
    pub q3_m: f64,
    /// Direction in which line 1 moved last, 1 or -1.
    pub s1: f64,
    /// Line 2.
    pub s2: f64,
    /// Line 3.
    pub s3: f64,
    /// The picture that shows the bend; none: it was typed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Standard deviation of each component where the picture states its own, rad; never in the CSV.
    #[serde(skip)]
    pub sd_xy_rad: Option<[f64; 2]>,
}

impl PoseReading {
    /// Whether its bend is known, or what the front shows of it.
    fn is_measured(&self) -> bool {
        self.b_x_rad.is_finite()
    }

    /// Components that are known.
    fn n_components(&self) -> usize {
        [self.b_x_rad, self.b_y_rad].into_iter().filter(|b| b.is_finite()).count()
    }

    fn sd_rad(&self) -> [f64; 2] {
        self.sd_xy_rad.unwrap_or([self.sd_rad; 2])
    }
}

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
    /// Whether the bend is seen from the front only, so that just planes 0 and 180 deg are gone through and the component in them counts.
    pub front_only: bool,
}

/// Where the robot shall go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseGoal {
    /// The planned bend vector, rad.
    pub bend_rad: Vector2<f64>,
    /// Actuator positions for it with eta 1, m, push positive.
    pub q_tilde_m: Vector3<f64>,
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
            let b = lines.bend_rad(q(r), &Vector3::new(r.s1, r.s2, r.s3), value[0], value[1])?;
            let [sd_x, sd_y] = r.sd_rad();
            all.push(((r.b_x_rad - zero(value, 0) - b.x) / sd_x, sd_x));
            if r.b_y_rad.is_finite() {
                all.push(((r.b_y_rad - zero(value, 1) - b.y) / sd_y, sd_y));
            }
        }
        Some(all)
    };
    let residuals = |value: &[f64]| {
        let own = of(false, value)?.into_iter().map(|(in_sd, _)| in_sd);
        let prior = zero_sd_rad.into_iter().flat_map(|sd| [zero(value, 0) / sd, zero(value, 1) / sd]);
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

/// What the pictures of a session have in common, rad: the base that all of their bends begin at has one error, of about a picture's own
/// standard deviation. It is unknown in the fit, within that; nothing for bends that were typed.
fn zero_sd_rad(readings: &[PoseReading]) -> Option<f64> {
    let own: Vec<f64> = readings.iter().filter_map(|r| r.sd_xy_rad).map(|[sd_x, _]| sd_x).collect();
    (!own.is_empty()).then(|| own.iter().sum::<f64>() / own.len() as f64)
}

fn lines(settings: &PoseSettings) -> Result<Lines, CalibrateError> {
    if !(settings.sd_rad > 1e-6 && settings.sd_rad < 0.2) {
        let (name, expected) = ("the standard deviation of a bend", "1e-6 to 0.2 rad");
        return Err(CalibrateError::Setting { name, found: settings.sd_rad, expected });
    }
    Lines::new(&settings.machine, settings.mu, settings.f_s_n, settings.cone, settings.inside_share)
        .ok_or_else(|| CalibrateError::Model("its machine is out of range".to_owned()))
}

fn q(r: &PoseReading) -> Vector3<f64> {
    Vector3::new(r.q1_m, r.q2_m, r.q3_m)
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
    let plan = plan(settings.front_only);
    let goal = |bend_rad: Vector2<f64>| PoseGoal { bend_rad, q_tilde_m: lines.planned_m(bend_rad, 1.0) };
    let straight = PoseGoal { bend_rad: Vector2::zeros(), q_tilde_m: Vector3::zeros() };
    let is_read = |readings: &[PoseReading], k: usize| readings.iter().any(|r| r.pose == k as u32 + 1);
    let mut progress = Progress::of(readings, settings);
    let mut turning = None;
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
        let (sin, cos) = place.plane_deg.to_radians().sin_cos();
        let wanted = Vector2::new(cos, sin) * place.bend_deg.to_radians();
        // Through the straight pose first, where the plane changes: a straight line of actuators is then a path in one plane.
        if place.passing && place.bend_deg < 0.0 {
            turning.follow(go(dialogue, straight)?.q_m);
        }
        let reached = go(dialogue, goal(wanted))?;
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
            (None, None) => typed(dialogue, &question, settings.front_only)?,
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

/// What a pose was answered with.
enum Answer {
    /// A bend, deg, or NaN and the picture that shows it.
    Measured([f64; 2], Option<String>),
    Skip,
    Quit,
}

fn typed<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    question: &str,
    front_only: bool,
) -> Result<Answer, CalibrateError> {
    let (words, n) = if front_only { ("b_x", 1) } else { ("b_x b_y", 2) };
    Ok(match dialogue.numbers(&format!("{question}: {words} deg?"), (n, n), (-180.0, 180.0))? {
        Reply::Numbers(bend) => Answer::Measured([bend[0], bend.get(1).copied().unwrap_or(f64::NAN)], None),
        Reply::Skip | Reply::Empty => Answer::Skip,
        Reply::Quit => Answer::Quit,
    })
}

/// The name under which the pose's pictures will be clicked, which no other pose has.
fn picture_of<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    question: &str,
    pose: u32,
    readings: &[PoseReading],
) -> Result<Answer, CalibrateError> {
    loop {
        let answer = dialogue.ask(&format!("{question}: photograph, name of the pictures? [pose-{pose}]"))?;
        let name = match answer.as_deref() {
            None | Some("q") => return Ok(Answer::Quit),
            Some("s") => return Ok(Answer::Skip),
            Some("") => format!("pose-{pose}"),
            Some(name) => name.to_owned(),
        };
        match readings.iter().find(|r| r.image.as_deref() == Some(name.as_str())) {
            Some(other) => dialogue.say(&format!("  {name:?} is of pose {} already, give another", other.pose))?,
            None => return Ok(Answer::Measured([f64::NAN; 2], Some(name))),
        }
    }
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
    let plan = plan(settings.front_only);
    let is_of_it = |r: &PoseReading| {
        let place = plan.get((r.pose as usize).wrapping_sub(1));
        place.is_some_and(|p| (p.plane_deg, p.bend_deg, p.check) == (r.plane_deg, r.bend_deg, r.check))
    };
    if let Some(k) = readings.iter().position(|r| !is_of_it(r)) {
        let reason = "its pose is of another plan: go on with --front as it was begun, or begin another --csv";
        return Err(CalibrateError::Row { file: log.name(), row: k + 2, reason: reason.to_owned() });
    }
    if let Some(pictures) = &pictures {
        pictures.give(&mut readings, settings.front_only);
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
