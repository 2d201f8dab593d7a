//! What can be hidden in generated data: each kind with the plant's parameters, its size, and the names that count as right.

use super::random::Random;
use core::f64::consts::TAU;
use krait_sim::Truth;

const K1: &[&str] = &["stiffness-scale", "radius-error", "camera-scale", "actuator-compliance", "inside-extension"];
const K2: &[&str] = &["backlash", "static-friction", "bouc-wen", "prandtl-ishlinskii"];
const K3: &[&str] = &["cone-friction", "disk-friction", "hole-clearance", "distributed-capstan"];
const K4: &[&str] = &["superelastic-softening", "non-constant-curvature", "axial-tip-force"];
const K5: &[&str] = &["tension-compression-asymmetry", "line-buckling"];
const K6: &[&str] = &["latency", "viscous-friction"];
const K7: &[&str] = &["plane-offset", "twist"];
const K8: &[&str] = &["lateral-tip-force", "encoder-zero", "camera-offset"];
/// Any linear map of the bend vector can be made by holes out of place and by coupled lines.
const SECOND: &[&str] = &["encoder-scale", "unequal-lines", "cross-coupling"];
const UNKNOWN: &[&str] = &["unknown"];

/// An effect of the plant that can be hidden.
#[derive(Clone, Copy, Debug)]
pub struct Kind {
    /// Its name; those that no known effect explains begin with `x_`.
    pub name: &'static str,
    /// One line for a table.
    pub about: &'static str,
    /// Names that count as right; the catalogue's own first.
    pub right: &'static [&'static str],
    /// Where the search for the wanted size begins.
    pub(super) typical: f64,
    /// Largest amplitude.
    pub(super) most: f64,
    /// Largest size in noise lengths of 0.42 deg that a rich motion can give it.
    pub most_size: f64,
    apply: fn(&mut Truth, f64, &Draw),
    known: fn(&Truth) -> Vec<(&'static str, f64)>,
}

/// What is drawn once for each hidden effect: signs, directions, times.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    sign: f64,
    part: [f64; 3],
    angle: [f64; 3],
    three: [f64; 3],
    six: [f64; 6],
    seconds: f64,
}

impl Draw {
    pub(super) fn new(random: &mut Random, seconds: f64) -> Self {
        Self {
            sign: random.sign(),
            part: core::array::from_fn(|_| random.between(0.0, 1.0)),
            angle: core::array::from_fn(|_| random.between(-TAU / 2.0, TAU / 2.0)),
            three: random.direction(),
            six: random.direction(),
            seconds,
        }
    }

    /// Between two values, as often in each factor of two.
    fn between_log(&self, k: usize, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.part[k])
    }
}

impl Kind {
    /// The kind of that name; `None` if there is none.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        Self::all().find(|kind| kind.name == name)
    }

    /// Every kind, those that are only hidden by name last.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        KINDS.iter().chain(NAMED)
    }

    /// Whether it scales every bend, as a wrong dimension of the snake does.
    pub fn is_of_scale(&self) -> bool {
        self.right.contains(&"radius-error")
    }

    /// Whether an effect of the catalogue explains it.
    pub fn is_known(&self) -> bool {
        self.right != UNKNOWN
    }

    /// Whether a name that counts as right for one does for the other.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        self.right.iter().any(|name| other.right.contains(name))
    }

    pub(super) fn hide(&self, truth: &mut Truth, amplitude: f64, draw: &Draw) {
        (self.apply)(truth, amplitude, draw);
    }

    /// Parameters of the first right effect that the truth fixes, by their names in a model file; empty where the plant's
    /// own law is not the catalogue's.
    pub fn known_parameters(&self, truth: &Truth) -> Vec<(&'static str, f64)> {
        (self.known)(truth)
    }
}

fn nothing(_: &Truth) -> Vec<(&'static str, f64)> {
    Vec::new()
}

fn polar(size: f64, angle: f64) -> [f64; 2] {
    [size * angle.cos(), size * angle.sin()]
}

/// Every kind that a seed may pick, the catalogue's first.
#[rustfmt::skip]
pub const KINDS: &[Kind] = &[
    Kind { name: "stiffness", about: "the snake is stiffer or softer", right: K1, typical: 0.1, most: 0.7, most_size: 8.0,
        apply: |t, a, d| t.effects.load_scale = 1.0 + d.sign * a,
        known: |t| vec![("eta", t.effects.load_scale)] },
    Kind { name: "radius", about: "the lines' pitch radius is wrong", right: &["radius-error", "stiffness-scale", "camera-scale", "actuator-compliance", "inside-extension"], typical: 0.05, most: 0.2, most_size: 8.0,
        apply: |t, a, d| t.machine.r_m *= 1.0 + d.sign * a, known: nothing },
    Kind { name: "compliance", about: "the actuators give", right: &["actuator-compliance", "stiffness-scale", "radius-error", "camera-scale", "inside-extension"], typical: 5e-6, most: 1e-4, most_size: 8.0,
        apply: |t, a, _| t.lines.actuator_m_per_n = a,
        known: |t| vec![("compliance_m_per_n", t.lines.actuator_m_per_n)] },
    Kind { name: "camera-scale", about: "the camera reads too much", right: &["camera-scale", "stiffness-scale", "radius-error", "actuator-compliance", "inside-extension"], typical: 0.03, most: 0.2, most_size: 8.0,
        apply: |t, a, d| t.sight.scale = d.sign * a,
        known: |t| vec![("relative", t.sight.scale)] },
    Kind { name: "backlash", about: "the actuators have play", right: K2, typical: 1e-4, most: 2e-3, most_size: 8.0,
        apply: |t, a, _| t.effects.play_m = a,
        known: |t| vec![("half_width_m", 0.5 * t.effects.play_m)] },
    Kind { name: "static-friction", about: "the wire rubs in the cone, loaded or not", right: &["static-friction", "backlash", "bouc-wen", "prandtl-ishlinskii"], typical: 2.0, most: 20.0, most_size: 8.0,
        apply: |t, a, _| t.effects.f_s_n = a,
        // Beside friction at the disks the plant's lines hold there, along the whole holder: the catalogue's cone is shorter.
        known: |t| if t.lines.disk_mu > 0.0 { Vec::new() } else { vec![("f_s_n", t.effects.f_s_n)] } },
    Kind { name: "rubbing", about: "many sliders along the line (Iwan)", right: &["bouc-wen", "prandtl-ishlinskii", "backlash", "static-friction"], typical: 1.0, most: 50.0, most_size: 8.0,
        apply: |t, a, d| { t.lines.rub_n = a; t.lines.rub_travel_m = d.between_log(0, 5e-5, 3e-4); }, known: nothing },
    Kind { name: "stribeck", about: "sliders whose force falls with speed", right: &["stribeck-friction", "static-friction", "backlash", "bouc-wen", "prandtl-ishlinskii"], typical: 1.0, most: 50.0, most_size: 8.0,
        apply: |t, a, _| { t.lines.rub_n = a; t.lines.rub_travel_m = 6e-5; t.lines.rub_breakaway = 0.6; }, known: nothing },
    Kind { name: "cone", about: "friction of the loaded line round the cone", right: K3, typical: 0.1, most: 1.0, most_size: 8.0,
        apply: |t, a, _| t.effects.mu = a,
        known: |t| vec![("mu", t.effects.mu)] },
    Kind { name: "disk", about: "friction at the spacer disks", right: &["disk-friction", "cone-friction", "hole-clearance", "distributed-capstan"], typical: 0.1, most: 1.0, most_size: 8.0,
        apply: |t, a, _| t.lines.disk_mu = a, known: nothing },
    Kind { name: "bend-friction", about: "a moment against any change of bend", right: &["bend-friction"], typical: 5e-4, most: 0.02, most_size: 8.0,
        apply: |t, a, _| t.bending.friction_n_m = a, known: nothing },
    Kind { name: "softening", about: "NiTi beyond its strain", right: K4, typical: 0.5, most: 1.0, most_size: 8.0,
        apply: |t, a, d| { t.bending.softening = a; t.bending.soft_strain = 0.005 + 0.004 * d.part[0]; }, known: nothing },
    Kind { name: "curvature", about: "curvature grows towards the tip", right: &["non-constant-curvature", "superelastic-softening", "axial-tip-force"], typical: 0.1, most: 0.4, most_size: 8.0,
        apply: |t, a, _| t.sight.curvature_slope_per_rad2 = a, known: nothing },
    Kind { name: "axial-force", about: "a force along the tip's axis", right: &["axial-tip-force", "superelastic-softening", "non-constant-curvature", "stiffness-scale", "radius-error", "camera-scale", "actuator-compliance", "inside-extension"], typical: 0.2, most: 1.0, most_size: 8.0,
        apply: |t, a, d| t.bending.axial_tip_force_n = d.sign * a,
        known: |t| vec![("force_n", t.bending.axial_tip_force_n)] },
    Kind { name: "asymmetry", about: "lines softer pulled than pushed, or the reverse", right: K5, typical: 0.1, most: 0.5, most_size: 8.0,
        apply: |t, a, d| t.effects.asymmetry = d.sign * a, known: nothing },
    Kind { name: "delay", about: "the camera's clock is late", right: K6, typical: 0.05, most: 0.4, most_size: 8.0,
        apply: |t, a, _| t.sight.clock_error_s = a,
        known: |t| vec![("delay_s", t.sight.clock_error_s)] },
    Kind { name: "viscous", about: "drag on the lines", right: &["viscous-friction", "latency"], typical: 300.0, most: 2e4, most_size: 8.0,
        apply: |t, a, _| t.lines.drag_n_s_per_m = a,
        known: |t| vec![("coefficient_n_s_per_m", t.lines.drag_n_s_per_m)] },
    Kind { name: "plane-offset", about: "the plane is turned", right: K7, typical: 0.03, most: 0.5, most_size: 8.0,
        apply: |t, a, d| t.camera.plane_offset_rad = d.sign * a,
        known: |t| vec![("angle_rad", t.camera.plane_offset_rad)] },
    Kind { name: "twist", about: "the plane turns with the bend", right: &["twist", "plane-offset"], typical: 0.05, most: 0.5, most_size: 8.0,
        apply: |t, a, d| t.sight.twist_rad_per_rad = d.sign * a,
        known: |t| vec![("rad_per_rad", t.sight.twist_rad_per_rad)] },
    Kind { name: "tip", about: "a lateral force on the tip", right: K8, typical: 0.1, most: 1.0, most_size: 8.0,
        apply: |t, a, d| t.effects.tip_force_in_base_n = polar(a, d.angle[0]),
        known: |t| vec![("force_x_n", t.effects.tip_force_in_base_n[0]), ("force_y_n", t.effects.tip_force_in_base_n[1])] },
    Kind { name: "encoder-zero", about: "encoders do not read zero at zero", right: &["encoder-zero", "lateral-tip-force", "camera-offset"], typical: 5e-5, most: 1.5e-3, most_size: 8.0,
        apply: |t, a, d| t.encoders.zero_m = d.three.map(|x| a * x), known: nothing },
    Kind { name: "camera-offset", about: "the camera is tilted", right: &["camera-offset", "lateral-tip-force", "encoder-zero"], typical: 0.01, most: 0.4, most_size: 8.0,
        apply: |t, a, d| t.sight.offset_rad = polar(a, d.angle[0]),
        known: |t| vec![("offset_x_rad", t.sight.offset_rad[0]), ("offset_y_rad", t.sight.offset_rad[1])] },
    Kind { name: "encoder-scale", about: "encoders read too much or too little, each differently", right: SECOND, typical: 0.01, most: 0.08, most_size: 8.0,
        apply: |t, a, d| t.encoders.scale = d.three.map(|x| a * x),
        known: |t| vec![("scale1", t.encoders.scale[0]), ("scale2", t.encoders.scale[1]), ("scale3", t.encoders.scale[2])] },
    Kind { name: "unequal-lines", about: "holes out of place", right: &["unequal-lines", "encoder-scale", "cross-coupling"], typical: 0.03, most: 0.2, most_size: 8.0,
        apply: |t, a, d| { t.lines.angle_rad = [0.0, a * d.six[0], a * d.six[1]]; t.lines.radius = [0.0, a * d.six[2], a * d.six[3]]; }, known: nothing },
    Kind { name: "coupling", about: "a line gives when another moves", right: &["cross-coupling", "unequal-lines", "encoder-scale"], typical: 0.02, most: 0.2, most_size: 8.0,
        apply: |t, a, d| t.lines.coupling = d.six.map(|x| a * x), known: nothing },
    Kind { name: "lead-screw", about: "periodic error of the screws", right: &["lead-screw-error"], typical: 1e-5, most: 5e-5, most_size: 1.2,
        apply: |t, a, d| { t.encoders.screw_m = a; t.encoders.screw_pitch_m = d.between_log(0, 6e-4, 2e-3); t.encoders.screw_phase_rad = d.angle; },
        known: |t| vec![("amplitude_m", t.encoders.screw_m), ("pitch_m", t.encoders.screw_pitch_m)] },
    Kind { name: "creep", about: "part of the stretch comes slowly", right: &["creep"], typical: 0.05, most: 0.5, most_size: 8.0,
        apply: |t, a, d| { t.lines.creep_part = a; t.lines.creep_time_s = d.between_log(0, 3.0, 40.0); },
        known: |t| vec![("a1", t.lines.creep_part), ("t1_s", t.lines.creep_time_s)] },
    Kind { name: "drift", about: "stiffness and lines drift over minutes", right: &["thermal-drift"], typical: 0.1, most: 0.5, most_size: 8.0,
        apply: |t, a, d| { t.slow.stiffness = d.sign * a; t.slow.line_m = d.three.map(|x| 2e-3 * a * x); t.slow.time_s = d.between_log(0, 40.0, 200.0); }, known: nothing },
    Kind { name: "x_dead", about: "the snake does not follow the first part of a bend", right: UNKNOWN, typical: 0.02, most: 0.4, most_size: 8.0,
        apply: |t, a, _| t.sight.dead_bend_rad = a, known: nothing },
    Kind { name: "x_collision", about: "a collision shifts the lines in the middle", right: UNKNOWN, typical: 5e-5, most: 1.5e-3, most_size: 8.0,
        apply: |t, a, d| { t.slow.collision_m = d.three.map(|x| a * x); t.slow.collision_time_s = d.seconds * (0.3 + 0.4 * d.part[0]); }, known: nothing },
    Kind { name: "x_detent", about: "the snake likes some planes better", right: UNKNOWN, typical: 1e-3, most: 0.01, most_size: 8.0,
        apply: |t, a, _| { t.bending.detent_n_m_per_rad = a; t.bending.detent_planes = 5.0; }, known: nothing },
    Kind { name: "x_slip", about: "the plane slips with the area that the bend sweeps", right: UNKNOWN, typical: 0.1, most: 1.5, most_size: 8.0,
        apply: |t, a, d| t.sight.plane_slip_per_rad = d.sign * a, known: nothing },
    Kind { name: "x_product", about: "the components of the bend vector cross-talk", right: UNKNOWN, typical: 0.1, most: 0.5, most_size: 8.0,
        apply: |t, a, d| t.sight.product_per_rad = d.sign * a, known: nothing },
    Kind { name: "x_sway", about: "the whole snake sways as on a chest that breathes", right: UNKNOWN, typical: 0.01, most: 0.4, most_size: 8.0,
        apply: |t, a, d| { t.sight.sway_rad = polar(a, d.angle[0]); t.sight.sway_hz = 0.15 + 0.25 * d.part[0]; }, known: nothing },
];

/// Kinds that are hidden by name only: what a seed picks and what the benchmark's cases hide stays what it was before.
#[rustfmt::skip]
const NAMED: &[Kind] = &[
    Kind { name: "inside", about: "the lines give inside the snake too", right: &["inside-extension", "stiffness-scale", "radius-error", "camera-scale", "actuator-compliance"], typical: 0.5, most: 1.5, most_size: 1.2,
        apply: |t, a, _| t.lines.inside = a,
        known: |t| vec![("share", t.lines.inside)] },
    Kind { name: "distributed", about: "friction of the loaded line along the cone's bends", right: &["distributed-capstan", "cone-friction", "disk-friction", "hole-clearance"], typical: 0.2, most: 1.0, most_size: 8.0,
        apply: |t, a, _| { t.effects.mu = a; t.lines.cone_radius_m = 0.02; },
        known: |t| vec![("mu", t.effects.mu)] },
];
