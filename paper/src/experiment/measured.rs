//! What was measured, out of the recording alone: for each pose the shapes that were exposed while it stood still.

use super::protocol::{Protocol, WantedPose};
use crate::bench::Pose;
use anyhow::{Context, bail, ensure};
use krait_ipc::ExperimentMark;
use krait_ipc::message::{ModelUpdate, three};
use krait_ipc::{Reason, Reasons};
use krait_record::Recording;
use krait_schema::Sample;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Key of the experiment in a recording's metadata record `krait`.
pub const METADATA_KEY: &str = "experiment";
/// Most that the setpoint may stray while a pose is measured, rad (0.02 deg).
const STRAY_RAD: f64 = 3.5e-4;
/// Limits of `compensate` that leave a command at rest elsewhere than wanted.
const LIMITS: [Reason; 2] = [Reason::StrokeLimit, Reason::ForceLimit];
/// Fewest shapes that have a spread worth its name.
const FEWEST_SHAPES: usize = 4;

/// An experiment as the recording names it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Announced {
    /// What is done in each pass.
    pub protocol: Protocol,
    /// The passes, in their order.
    pub passes: Vec<AnnouncedPass>,
}

/// One pass: the protocol once with one compensation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnnouncedPass {
    /// The compensation's name.
    pub compensation: String,
    /// Whether its model learns while the snake moves.
    pub learns: bool,
}

/// One pose as it was measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredPose {
    /// Its number, from 1.
    pub number: u32,
    /// What was wanted.
    pub wanted: WantedPose,
    /// The setpoint and the mean of the shapes.
    pub pose: Pose,
    /// Standard deviation of one shape, along x and y, rad.
    pub sd_rad: Vector2<f64>,
    /// Shapes that the mean is of.
    pub n: usize,
    /// When it was measured, after the pass's first motion, s.
    pub at_s: f64,
    /// A limit that kept the actuators from where the compensation wanted them.
    pub limit: Option<Reason>,
}

impl MeasuredPose {
    /// Standard error of the mean along a direction, rad.
    pub fn se_rad(&self, along: Vector2<f64>) -> f64 {
        self.sd_rad.component_mul(&along).norm() / (self.n as f64).sqrt()
    }
}

/// One pass as it was measured.
pub(super) struct MeasuredPass {
    /// Its poses, in their order; fewer than the protocol has where it was broken off.
    pub poses: Vec<MeasuredPose>,
    /// What had been learnt at the last of them.
    pub update: Option<ModelUpdate>,
    /// Whether it came to its end.
    pub is_complete: bool,
    /// Why it did not, as its master said.
    pub failed: Option<String>,
}

/// The experiment that a recording is of.
///
/// # Errors
/// One sentence: it is of none, or of one that this program does not know.
pub fn announced(recording: &Recording) -> anyhow::Result<Announced> {
    let text = recording.contents().metadata.get("krait").and_then(|about| about.get(METADATA_KEY)).context(
        "it is of no experiment; `krait experiment` makes one, and `krait compare` looks at any other recording",
    )?;
    let Announced { protocol, passes } =
        serde_json::from_str(text).context("it names an experiment that this program does not know")?;
    ensure!((1..=100).contains(&passes.len()), "it names {} passes, expected 1 to 100", passes.len());
    Ok(Announced { protocol: protocol.checked()?, passes })
}

/// Everything of a recording that the poses need, in the order of time.
#[derive(Default)]
struct Track {
    setpoints: Vec<(i64, Vector2<f64>)>,
    shapes: Vec<(i64, Vector2<f64>)>,
    encoders: Vec<(i64, [f64; 3], [f64; 3])>,
    limits: Vec<(i64, Reason)>,
    updates: Vec<ModelUpdate>,
    marks: Vec<(i64, ExperimentMark)>,
}

/// Reads the passes of an experiment.
///
/// # Errors
/// One sentence: it cannot be read, or a pose that it marks was not measured.
pub(super) fn measured(path: &Path, announced: &Announced) -> anyhow::Result<Vec<MeasuredPass>> {
    let track = Track::read(path)?;
    let begins = |(_, (_, mark)): &(usize, &(i64, ExperimentMark))| *mark == ExperimentMark::Begins;
    let starts: Vec<usize> = track.marks.iter().enumerate().filter(begins).map(|(idx, _)| idx).collect();
    ensure!(!starts.is_empty(), "no pose was reached in it; run the experiment again");
    ensure!(
        starts.len() <= announced.passes.len(),
        "{} passes begin in it and it names {}",
        starts.len(),
        announced.passes.len()
    );
    let mut passes = Vec::new();
    for (k, start) in starts.iter().enumerate() {
        let end = starts.get(k + 1).copied().unwrap_or(track.marks.len());
        let name = &announced.passes[k].compensation;
        let pass =
            track.pass(&announced.protocol, &track.marks[*start..end]).with_context(|| format!("pass {name}"))?;
        passes.push(pass);
    }
    Ok(passes)
}

impl Track {
    fn read(path: &Path) -> anyhow::Result<Self> {
        let mut track = Self::default();
        for part in Recording::open_parts(path)? {
            for recorded in part.samples()? {
                track.take(recorded?.sample);
            }
        }
        track.setpoints.sort_by_key(|(ns, _)| *ns);
        track.shapes.sort_by_key(|(ns, _)| *ns);
        track.encoders.sort_by_key(|(ns, ..)| *ns);
        track.limits.sort_by_key(|(ns, _)| *ns);
        track.updates.sort_by_key(|update| update.sample_ns);
        track.marks.sort_by_key(|(ns, _)| *ns);
        Ok(track)
    }

    fn take(&mut self, sample: Sample) {
        match sample {
            Sample::Setpoint(m) if m.n_joints == 0 => self.setpoints.push((m.sample_ns, m.bend_rad.into())),
            Sample::Shape(m) => {
                self.shapes.extend(m.valid_bend_rad().map(|bend| (m.sample_ns, Vector2::from(bend))));
            }
            Sample::State(m) => {
                self.encoders.push((m.sample_ns, three(&m.measured_q_m), three(&m.measured_tau_n)));
            }
            Sample::Command(m) => {
                let limit = Reasons::from_bits(m.reasons).iter().find(|reason| LIMITS.contains(reason));
                self.limits.extend(limit.map(|limit| (m.sample_ns, limit)));
            }
            Sample::ModelUpdate(m) => self.updates.push(m),
            Sample::DeviceMarker(m) => {
                let mark = m.text().and_then(ExperimentMark::parse);
                self.marks.extend(mark.map(|mark| (m.sample_ns, mark)));
            }
            _ => {}
        }
    }

    fn pass(&self, protocol: &Protocol, marks: &[(i64, ExperimentMark)]) -> anyhow::Result<MeasuredPass> {
        let begun_ns = marks.first().map_or(0, |(ns, _)| *ns);
        let mut pass = MeasuredPass { poses: Vec::new(), update: None, is_complete: false, failed: None };
        for (ns, mark) in marks {
            match mark {
                ExperimentMark::AtRest { pose, for_ns } => {
                    let wanted = (*pose as usize).checked_sub(1).and_then(|idx| protocol.poses.get(idx));
                    let Some(wanted) = wanted else { bail!("it marks a pose {pose} that the experiment has not") };
                    let window_ns = (ns.saturating_sub(*for_ns), *ns);
                    let measured = self.pose(*pose, *wanted, begun_ns, window_ns);
                    pass.poses.push(measured.with_context(|| format!("pose {pose}"))?);
                    pass.update = self.update_at(begun_ns, *ns);
                }
                ExperimentMark::Failed(sentence) => pass.failed = Some(sentence.clone()),
                ExperimentMark::Ends => pass.is_complete = pass.poses.len() == protocol.poses.len(),
                ExperimentMark::Begins => {}
            }
        }
        Ok(pass)
    }

    /// The newest update of this pass before an instant.
    fn update_at(&self, begun_ns: i64, now_ns: i64) -> Option<ModelUpdate> {
        let n = self.updates.partition_point(|update| update.sample_ns <= now_ns);
        self.updates[..n].last().filter(|update| update.sample_ns >= begun_ns).copied()
    }

    fn pose(
        &self,
        number: u32,
        wanted: WantedPose,
        begun_ns: i64,
        (from_ns, to_ns): (i64, i64),
    ) -> anyhow::Result<MeasuredPose> {
        let setpoints = within(&self.setpoints, |row| row.0, from_ns, to_ns);
        let shapes = within(&self.shapes, |row| row.0, from_ns, to_ns);
        let encoders = within(&self.encoders, |row| row.0, from_ns, to_ns);
        ensure!(
            shapes.len() >= FEWEST_SHAPES,
            "{} shapes were measured while it stood still, expected {FEWEST_SHAPES} or more; measure for longer with --measure-s, and look whether the camera sees the snake",
            shapes.len()
        );
        ensure!(
            !setpoints.is_empty() && !encoders.is_empty(),
            "the recording has a gap there; run the experiment again"
        );
        let commanded = mean(setpoints.iter().map(|(_, bend)| *bend), setpoints.len());
        let stray = setpoints.iter().map(|(_, bend)| (bend - commanded).norm()).fold(0.0, f64::max);
        ensure!(stray <= STRAY_RAD, "the setpoint strayed by {:.3} deg while it was measured", stray.to_degrees());
        let reached = mean(shapes.iter().map(|(_, bend)| *bend), shapes.len());
        let squares = shapes.iter().map(|(_, bend)| (bend - reached).component_mul(&(bend - reached)));
        let sd_rad = (squares.sum::<Vector2<f64>>() / (shapes.len() - 1) as f64).map(f64::sqrt);
        // Standing still: any instant is as good as another.
        let (_, q_tilde_m, tau_n) = encoders[encoders.len() / 2];
        let pose = Pose {
            wanted_rad: commanded,
            q_tilde_m: q_tilde_m.into(),
            reached_rad: reached,
            tau_tilde_n: tau_n.into(),
        };
        let at_s = from_ns.saturating_sub(begun_ns) as f64 * 1e-9;
        let limit = within(&self.limits, |row| row.0, from_ns, to_ns).first().map(|(_, limit)| *limit);
        Ok(MeasuredPose { number, wanted, pose, sd_rad, n: shapes.len(), at_s, limit })
    }
}

fn within<T>(rows: &[T], ns: impl Fn(&T) -> i64, from_ns: i64, to_ns: i64) -> &[T] {
    let (from, to) = (rows.partition_point(|row| ns(row) < from_ns), rows.partition_point(|row| ns(row) <= to_ns));
    &rows[from..to.max(from)]
}

fn mean(bends: impl Iterator<Item = Vector2<f64>>, n: usize) -> Vector2<f64> {
    bends.sum::<Vector2<f64>>() / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{ApproachSide, Before};

    const MS: i64 = 1_000_000;

    /// A second of a snake that stands at 0.5 rad, seen at 50 Hz a tenth of a radian short and with some noise.
    fn track() -> Track {
        let every = |step: i64| (0..1000 / step).map(move |k| k * step * MS);
        let noise = |k: i64| if (k / MS) % 40 == 0 { 0.01 } else { -0.01 };
        Track {
            setpoints: every(1).map(|ns| (ns, Vector2::new(0.5, 0.0))).collect(),
            shapes: every(20).map(|ns| (ns, Vector2::new(0.4 + noise(ns), 0.0))).collect(),
            encoders: every(1).map(|ns| (ns, [1e-3; 3], [f64::NAN; 3])).collect(),
            ..Track::default()
        }
    }

    fn protocol() -> Protocol {
        let before = Before { side: ApproachSide::None, take_up_deg: 0.0, n_learning_rounds: 0 };
        Protocol::fig_10(10.0, 20.0, before).expect("a protocol")
    }

    fn marks(pose: u32, for_ns: i64) -> Vec<(i64, ExperimentMark)> {
        vec![(0, ExperimentMark::Begins), (900 * MS, ExperimentMark::AtRest { pose, for_ns })]
    }

    #[test]
    fn a_pose_is_the_mean_of_its_window_with_the_error_of_a_mean() {
        let pass = track().pass(&protocol(), &marks(2, 400 * MS)).expect("a pass");
        assert!(!pass.is_complete, "one pose of three");
        let pose = pass.poses[0];
        assert_eq!((pose.number, pose.n), (2, 21));
        assert!((pose.pose.reached_rad.x - 0.4).abs() < 1e-3 && pose.pose.wanted_rad.x == 0.5, "{pose:?}");
        let se = pose.se_rad(Vector2::new(1.0, 0.0));
        assert!((se - 0.01 / 21f64.sqrt()).abs() < 1e-4, "{se}");
    }

    #[test]
    fn what_was_not_measured_is_named_and_what_failed_keeps_what_was() {
        let refused = |track: &Track, marks: &[(i64, ExperimentMark)]| match track.pass(&protocol(), marks) {
            Err(error) => format!("{error:#}"),
            Ok(_) => panic!("it was taken"),
        };
        assert!(refused(&track(), &marks(2, 40 * MS)).contains("3 shapes"));
        assert!(refused(&track(), &marks(4, 400 * MS)).contains("a pose 4"));
        assert!(refused(&track(), &marks(0, 400 * MS)).contains("a pose 0"));
        let mut moving = track();
        moving.setpoints[700].1.x = 0.6;
        assert!(refused(&moving, &marks(1, 400 * MS)).contains("strayed"));
        let blind = Track { shapes: Vec::new(), ..track() };
        assert!(refused(&blind, &marks(1, 400 * MS)).contains("camera"));

        let mut failed = marks(1, 400 * MS);
        failed.push((950 * MS, ExperimentMark::Failed("before or at pose 2, it stuck".to_owned())));
        let pass = track().pass(&protocol(), &failed).expect("a pass");
        assert_eq!((pass.poses.len(), pass.failed.as_deref()), (1, Some("before or at pose 2, it stuck")));
    }
}
