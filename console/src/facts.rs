//! What a page is told once about the chain it looks at: machine, limits, budgets, names.

use krait_record::Views;
use serde::Serialize;

/// Facts of one chain; the program that starts the console takes them from the chain's configuration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// Name of the instance.
    pub instance: String,
    /// Whether the drives are simulated.
    pub is_simulated: bool,
    /// Length of the primary backbone, m; 0 for joints and segments.
    pub l_m: f64,
    /// Pitch radius of the secondary backbones, m; 0 for joints and segments.
    pub r_m: f64,
    /// How many actuators there are.
    pub n_actuators: usize,
    /// Unit in which the tracking error and the positions of joints are shown: `deg`, or `mm` where joints slide.
    pub unit: &'static str,
    /// How many of it are a radian, or a metre where the joints slide.
    pub per_si: f64,
    /// The joints, or the components of the segments' bend vectors, where the machine is no snake.
    pub joints: Option<JointFacts>,
    /// The jaw of a snake's gripper closed and open, rad, where it has one; its wire is the last actuator.
    pub jaw: Option<[f64; 2]>,
    /// Largest bend, rad.
    pub max_bend_rad: f64,
    /// Largest distance of an actuator from its zero, m.
    pub max_stroke_m: f64,
    /// Largest load of a line by the model, N.
    pub max_load_n: f64,
    /// What the measured load of each actuator may be.
    pub loads: Vec<LoadFacts>,
    /// Roll of the camera's view about the straight snake, rad.
    pub view_roll_rad: f64,
    /// Name of the compensation.
    pub compensation: String,
    /// What the operator does to be present, as in "Press button 1 to follow."
    pub presence_hint: String,
    /// The recording, if one is made.
    pub recording: Option<String>,
    /// The recording of the folder that the page opens first; none beside a chain.
    pub opens: Option<String>,
    /// What a sample may take, of each hop and then end to end.
    pub budgets: Vec<HopBudget>,
}

impl Facts {
    /// Whether a page of these facts shows a chain of others rightly: recording and compensation are the chain's, all else the machine's.
    pub(crate) fn is_same_machine(&self, other: &Self) -> bool {
        let (recording, compensation) = (self.recording.clone(), self.compensation.clone());
        *self == Self { recording, compensation, ..other.clone() }
    }
}

/// What is known of a chain that came after the console.
#[derive(Debug)]
pub struct NewChain {
    /// What pages are told.
    pub facts: Facts,
    /// What is drawn for engineers' own viewers, where they are served.
    pub views: Option<Views>,
}

/// Joints, as the page shows them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointFacts {
    /// Where each joint may be, rad (m where it slides).
    pub low: Vec<f64>,
    /// As `low`.
    pub high: Vec<f64>,
    /// The segments in series, two places each, in place of joints; none: joints.
    pub segments: Vec<SegmentFacts>,
}

/// A segment, as the page draws it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentFacts {
    /// Length of its primary backbone, m.
    pub l_m: f64,
    /// The lines that end at its disk.
    pub lines: Vec<LineFacts>,
}

/// A line, which runs at the same place through every segment before its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineFacts {
    /// Azimuth about the primary backbone, rad.
    pub azimuth_rad: f64,
    /// Distance from the primary backbone, m.
    pub r_m: f64,
}

/// Limits of an actuator's measured load, N; infinite where loads are not measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoadFacts {
    /// While it is pulled.
    pub pull_n: f64,
    /// While it is pushed.
    pub push_n: f64,
}

impl LoadFacts {
    /// The limit on the side of a load; a push is positive.
    pub fn limit_n(&self, tau_n: f64) -> f64 {
        if tau_n > 0.0 { self.push_n } else { self.pull_n }
    }
}

/// What a stretch of the way may take, us.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HopBudget {
    /// Median, us.
    pub p50_us: f64,
    /// 99th percentile, us.
    pub p99_us: f64,
    /// Every single sample, us.
    pub worst_us: f64,
}
