//! What an experiment came to: errors pose by pose, their spread part by part, the bench beside each, and the camera's noise.

use super::measured::{Announced, MeasuredPass, MeasuredPose, announced, measured};
use super::protocol::{Leg, Part, Protocol, WantedPose};
use crate::bench::{Bench, Pose, bend_error_deg, plane_error_deg, vector_error_deg};
use crate::variants::VariantKind;
use anyhow::Context;
use krait_ipc::Reason;
use krait_model::{Chain, Circumstances, LearntParameter, Snake};
use krait_record::Recording;
use krait_report::{LearntReport, Spread};
use krait_sim::Truth;
use nalgebra::Vector2;
use serde::Serialize;
use std::path::Path;

/// Below this bend the plane is too ill-defined for its error to mean anything, deg.
const PLANE_FROM_DEG: f64 = 15.0;

/// What a pass ran with, as far as the outcome needs it.
pub struct PassModel {
    /// Its equations, for the bench.
    pub chain: Chain,
    /// The parameters that it learns.
    pub learnt: Vec<LearntParameter>,
}

/// An experiment and what it came to.
#[derive(Debug, Serialize)]
pub struct FigureOutcome {
    /// What was done.
    pub protocol: Protocol,
    /// The camera's noise, from shapes of one pose.
    pub noise: ReadingNoise,
    /// One entry per pass.
    pub passes: Vec<PassOutcome>,
    /// Compensations whose pass never began.
    pub never_begun: Vec<String>,
}

/// What the camera scatters by while nothing moves.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ReadingNoise {
    /// Standard deviation of one shape, along x and y together (root of the mean variance), deg.
    pub sd_of_a_shape_deg: f64,
    /// Shapes that it rests on.
    pub n_shapes: usize,
}

/// One compensation.
#[derive(Debug, Serialize)]
pub struct PassOutcome {
    /// Its name.
    pub compensation: String,
    /// Whether every pose was measured.
    pub is_complete: bool,
    /// Why not, where the experiment failed.
    pub failed: Option<String>,
    /// What was in force at the last pose, of a model that learns.
    pub learnt: Vec<LearntReport>,
    /// Its parts.
    pub parts: Vec<PartOutcome>,
    /// Its poses.
    pub poses: Vec<PoseOutcome>,
}

/// One part of a pass.
#[derive(Clone, Debug, Serialize)]
pub struct PartOutcome {
    /// Which.
    pub part: Part,
    /// Error of the bend.
    pub bend: PoseErrors,
    /// Error of the plane, of poses that bend by 15 deg or more; absent where there are none.
    pub plane: Option<PoseErrors>,
    /// Distance of the bend vectors, deg.
    pub vector_deg: Spread,
}

/// Errors of one kind over the poses of a part.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PoseErrors {
    /// Measured minus commanded, deg.
    pub measured_deg: Spread,
    /// Standard error of its root mean square, deg.
    pub rms_se_deg: f64,
    /// Root mean square that the camera's noise alone would give, deg.
    pub floor_deg: f64,
    /// The same poses on the paper's bench, which has no noise, deg.
    pub bench_deg: Spread,
    /// Sum over the poses of (measured minus bench, over the standard error) squared.
    pub chi2_against_bench: f64,
}

/// One pose.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PoseOutcome {
    /// Its number, from 1.
    pub pose: u32,
    /// What it belongs to.
    pub part: Part,
    /// When it was measured, after the pass's first motion, s.
    pub at_s: f64,
    /// A limit of `compensate` that kept the actuators from where they were wanted, in its own words.
    pub limited_by: Option<&'static str>,
    /// Wanted bend and plane, deg.
    pub wanted_deg: [f64; 2],
    /// The setpoint's bend vector, deg.
    pub commanded_deg: [f64; 2],
    /// The mean of the measured bend vectors, deg.
    pub measured_deg: [f64; 2],
    /// Its standard error along x and y, deg.
    pub se_deg: [f64; 2],
    /// Shapes that it is of.
    pub n_shapes: usize,
    /// Encoders, mm.
    pub q_tilde_mm: [f64; 3],
    /// Loads at the actuators, N; null where not measured.
    pub tau_n: [f64; 3],
    /// Error of the bend, deg.
    pub bend_error_deg: f64,
    /// Its standard error, deg.
    pub bend_se_deg: f64,
    /// Error of the plane, deg.
    pub plane_error_deg: f64,
    /// Its standard error, deg.
    pub plane_se_deg: f64,
    /// Distance of the bend vectors, deg.
    pub vector_error_deg: f64,
    /// The bench's bend vector, deg.
    pub bench_deg: [f64; 2],
    /// Error of the bend on the bench, deg.
    pub bench_bend_error_deg: f64,
    /// Error of the plane on the bench, deg.
    pub bench_plane_error_deg: f64,
}

impl FigureOutcome {
    /// Reads a recording and computes everything from it. `model_of` says what the model of a name was, `truth` what the bench is.
    ///
    /// # Errors
    /// One sentence that names the recording: it is of no experiment, or a pose or pass of it was not measured.
    pub fn of(
        path: &Path,
        truth: &Truth,
        model_of: impl Fn(&str) -> anyhow::Result<PassModel>,
    ) -> anyhow::Result<Self> {
        Self::read(path, truth, model_of).with_context(|| format!("recording {}", path.display()))
    }

    fn read(path: &Path, truth: &Truth, model_of: impl Fn(&str) -> anyhow::Result<PassModel>) -> anyhow::Result<Self> {
        let Announced { protocol, passes } = announced(&Recording::open_beginning(path)?)?;
        let announced = Announced { protocol, passes };
        let found = measured(path, &announced)?;
        let noise = ReadingNoise::of(&found);
        let mut passes = Vec::new();
        for (pass, about) in found.iter().zip(&announced.passes) {
            let model = model_of(&about.compensation)?;
            let bench = on_the_bench(truth, &model.chain, &about.compensation, &announced.protocol)?;
            passes.push(PassOutcome::of(pass, &about.compensation, &model, &bench));
        }
        let never_begun = announced.passes.iter().skip(passes.len()).map(|pass| pass.compensation.clone()).collect();
        Ok(Self { protocol: announced.protocol, noise, passes, never_begun })
    }

    /// Whether every pass was done to its end.
    pub fn is_complete(&self) -> bool {
        self.never_begun.is_empty() && self.passes.iter().all(|pass| pass.is_complete)
    }
}

impl ReadingNoise {
    fn of(passes: &[MeasuredPass]) -> Self {
        let poses = || passes.iter().flat_map(|pass| &pass.poses);
        let freedom: f64 = poses().map(|pose| (pose.n - 1) as f64).sum();
        let squares: f64 = poses().map(|pose| 0.5 * pose.sd_rad.norm_squared() * (pose.n - 1) as f64).sum();
        Self {
            sd_of_a_shape_deg: (squares / freedom.max(1.0)).sqrt().to_degrees(),
            n_shapes: poses().map(|p| p.n).sum(),
        }
    }
}

impl PassOutcome {
    fn of(pass: &MeasuredPass, compensation: &str, model: &PassModel, bench: &[Pose]) -> Self {
        let on_bench =
            |pose: &MeasuredPose| bench.get(pose.number as usize - 1).map(|bench| PoseOutcome::of(pose, bench));
        let poses: Vec<PoseOutcome> = pass.poses.iter().filter_map(on_bench).collect();
        Self {
            compensation: compensation.to_owned(),
            is_complete: pass.is_complete,
            failed: pass.failed.clone(),
            learnt: pass.update.as_ref().map_or_else(Vec::new, |update| LearntReport::of(update, &model.learnt)),
            parts: Part::ALL.into_iter().filter_map(|part| PartOutcome::of(part, &poses)).collect(),
            poses,
        }
    }
}

impl PartOutcome {
    fn of(part: Part, poses: &[PoseOutcome]) -> Option<Self> {
        let own: Vec<&PoseOutcome> = poses.iter().filter(|pose| pose.part == part).collect();
        let has_plane = |pose: &&PoseOutcome| pose.wanted_deg[0] >= PLANE_FROM_DEG;
        Some(Self {
            part,
            bend: PoseErrors::of(own.iter().map(|p| (p.bend_error_deg, p.bend_se_deg, p.bench_bend_error_deg)))?,
            plane: PoseErrors::of(
                own.iter()
                    .copied()
                    .filter(has_plane)
                    .map(|p| (p.plane_error_deg, p.plane_se_deg, p.bench_plane_error_deg)),
            ),
            vector_deg: Spread::of(own.iter().map(|p| p.vector_error_deg)),
        })
    }
}

impl PoseErrors {
    /// Of triples of an error, its standard error and the bench's; nothing of none.
    fn of(poses: impl Iterator<Item = (f64, f64, f64)>) -> Option<Self> {
        let poses: Vec<_> = poses.collect();
        let measured_deg = Spread::of_any(poses.iter().map(|(error, ..)| error))?;
        let n = poses.len() as f64;
        let sum = |term: fn(&(f64, f64, f64)) -> f64| poses.iter().map(term).sum::<f64>();
        let rms_se_deg = sum(|(error, se, _)| (error * se).powi(2)).sqrt() / (n * measured_deg.rms);
        Some(Self {
            measured_deg,
            rms_se_deg: if measured_deg.rms > 0.0 { rms_se_deg } else { 0.0 },
            floor_deg: (sum(|(_, se, _)| se * se) / n).sqrt(),
            bench_deg: Spread::of(poses.iter().map(|(.., bench)| bench)),
            chi2_against_bench: sum(|(error, se, bench)| ((error - bench) / se.max(1e-9)).powi(2)),
        })
    }
}

impl PoseOutcome {
    fn of(measured: &MeasuredPose, bench: &Pose) -> Self {
        let MeasuredPose { number, wanted, pose, n, at_s, limit, .. } = *measured;
        let deg = |v: Vector2<f64>| v.map(f64::to_degrees).into();
        let along = bend_direction(wanted);
        let across = Vector2::new(-along.y, along.x);
        Self {
            pose: number,
            part: wanted.part,
            at_s,
            limited_by: limit.map(Reason::sentence),
            wanted_deg: [wanted.bend_deg, wanted.delta_deg],
            commanded_deg: deg(pose.wanted_rad),
            measured_deg: deg(pose.reached_rad),
            se_deg: deg(measured.sd_rad / (n as f64).sqrt()),
            n_shapes: n,
            q_tilde_mm: (pose.q_tilde_m * 1e3).into(),
            tau_n: pose.tau_tilde_n.into(),
            bend_error_deg: bend_error(wanted, &pose),
            bend_se_deg: measured.se_rad(along).to_degrees(),
            plane_error_deg: plane_error_deg(&pose),
            plane_se_deg: (measured.se_rad(across) / pose.reached_rad.norm()).to_degrees(),
            vector_error_deg: vector_error_deg(&pose),
            bench_deg: deg(bench.reached_rad),
            bench_bend_error_deg: bend_error(wanted, bench),
            bench_plane_error_deg: plane_error_deg(bench),
        }
    }
}

/// The unit vector along which a pose bends.
fn bend_direction(wanted: WantedPose) -> Vector2<f64> {
    let (sin, cos) = wanted.delta_deg.to_radians().sin_cos();
    Vector2::new(cos, sin)
}

/// On a ramp the error along its plane, as Fig. 10 has it: it keeps its sign through straight.
fn bend_error(wanted: WantedPose, pose: &Pose) -> f64 {
    match wanted.part {
        Part::Up | Part::Back => (pose.reached_rad - pose.wanted_rad).dot(&bend_direction(wanted)).to_degrees(),
        Part::Turn | Part::FromStraight | Part::Pose => bend_error_deg(pose),
    }
}

/// The same ways on the bench: the paper's own compensations where the name is one of theirs, the model's equations otherwise.
fn on_the_bench(truth: &Truth, chain: &Chain, name: &str, protocol: &Protocol) -> anyhow::Result<Vec<Pose>> {
    let kind = match name {
        "off" => Some(VariantKind::Off),
        "naive" => Some(VariantKind::Naive),
        // What learning aims at: the signs of motion with the bench's own parameters.
        "estimated" => {
            Some(VariantKind::MotionSign { eta: truth.effects.load_scale, half_width_m: 0.5 * truth.effects.play_m })
        }
        _ => None,
    };
    let legs = protocol.legs(false);
    match kind {
        Some(kind) => along(truth, &legs, kind.commands(&Snake::new(chain.machine())?)?),
        None => {
            let mut compensator = chain.compensator()?;
            along(truth, &legs, |bend| compensator.step(bend, &Circumstances::at(0.0)).q_tilde_m)
        }
    }
}

fn along(
    truth: &Truth,
    legs: &[Leg],
    mut command: impl FnMut(Vector2<f64>) -> nalgebra::Vector3<f64>,
) -> anyhow::Result<Vec<Pose>> {
    let mut bench = Bench::new(truth)?;
    let mut poses = Vec::new();
    for leg in legs {
        let mut last = None;
        for bend in &leg.bends_rad {
            last = Some(bench.move_to(*bend, command(*bend))?);
        }
        poses.extend(last.filter(|_| leg.pose > 0));
    }
    Ok(poses)
}
