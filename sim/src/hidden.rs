//! The truth of effects that a model may lack beyond friction and play: off unless a truth file asks for them.

use crate::truth::MachineTruth;
use serde::{Deserialize, Serialize};

/// A key of a truth file with the value found and its range: key, found, low, high.
pub(super) type Range = (&'static str, f64, f64, f64);

/// What the lines do beyond stretching, rubbing in the cone and having play. Three values are those of lines 1, 2, 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LinesTruth {
    /// Compliance of each actuator behind its encoder, m/N; 0 to 1e-4; neutral 0.
    pub actuator_m_per_n: f64,
    /// Lines stretch inside the snake too, by this share of what their length there gives under their load, 1; 0 to 1.5;
    /// neutral 0.
    pub inside: f64,
    /// Share of a line's stretch that comes slowly (standard linear solid), 1; 0 to 0.5; neutral 0.
    pub creep_part: f64,
    /// Time in which it comes, s; 0.05 to 1e5.
    pub creep_time_s: f64,
    /// Drag on each line's end at the disk, N s/m; 0 to 1e5; neutral 0.
    pub drag_n_s_per_m: f64,
    /// Force of the sliders beside each line's end when all of them slip (Iwan), N; 0 to 50; neutral 0.
    pub rub_n: f64,
    /// Travel after which the last slider slips, m; 1e-6 to 5e-3.
    pub rub_travel_m: f64,
    /// That force at rest is larger by this part, 1; 0 to 2; neutral 0.
    pub rub_breakaway: f64,
    /// Speed at which this part has fallen to 1/e, m/s; 1e-5 to 0.1.
    pub rub_speed_m_per_s: f64,
    /// Friction at the spacer disks: loads lose e^(this times bend), 1; 0 to 1; neutral 0. Moves the cone's friction there.
    pub disk_mu: f64,
    /// Radius of the cone's two bends, m, along which its friction is spread; 0 to l_c_m / (2 phi_rad); 0: friction is all at the
    /// cone's end at the snake.
    pub cone_radius_m: f64,
    /// Each line's hole is turned round the snake by this, rad; -0.3 to 0.3; neutral 0.
    pub angle_rad: [f64; 3],
    /// Each line's hole is further out by this part of r, 1; -0.3 to 0.3; neutral 0.
    pub radius: [f64; 3],
    /// Each line is softer by this part, 1; -0.5 to 0.5; neutral 0.
    pub softness: [f64; 3],
    /// Lines are softer by this part where they are pushed, 1; 0 to 1e5; neutral 0: tubes. 1e4: cables, which go slack.
    pub push_softness: f64,
    /// Line i gives by this part of what line j moves, 1, for ij = 12, 13, 21, 23, 31, 32; each -0.3 to 0.3; neutral 0.
    pub coupling: [f64; 6],
}

/// What the bent snake itself does beyond bending elastically in an arc.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BendingTruth {
    /// Strain of the tube's fibres from which on they are softer, 1; 0.001 to 0.08.
    pub soft_strain: f64,
    /// By which part they are softer beyond it, 1; 0 to 1; neutral 0.
    pub softening: f64,
    /// Moment of friction against any change of the bend vector, N m; 0 to 0.05; neutral 0.
    pub friction_n_m: f64,
    /// What it grows with the sum of the lines' loads, N m per N; 0 to 0.01; neutral 0.
    pub friction_m: f64,
    /// Force on the tip along the base's axis, N, positive away from the base; -1 to 1; neutral 0.
    pub axial_tip_force_n: f64,
    /// Detents: the snake likes some planes better, by a moment of this per rad of bend, N m/rad; 0 to 0.02; neutral 0.
    pub detent_n_m_per_rad: f64,
    /// How many planes it likes in one turn: 1 to 24.
    pub detent_planes: f64,
}

/// Encoders that do not read what the actuators do. Three values are those of lines 1, 2, 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EncodersTruth {
    /// Reading at zero, m; each -0.002 to 0.002; neutral 0.
    pub zero_m: [f64; 3],
    /// They read too much by this part, 1; each -0.1 to 0.1; neutral 0.
    pub scale: [f64; 3],
    /// Amplitude of the screws' periodic error, m; 0 to 5e-5; neutral 0.
    pub screw_m: f64,
    /// Pitch of the screws, m; 5e-4 to 0.01.
    pub screw_pitch_m: f64,
    /// Phase of each screw, rad; each -3.2 to 3.2.
    pub screw_phase_rad: [f64; 3],
    /// Each encoder stays where it is once it has come this far from zero, m; 0 to 0.01; neutral 0, which is never.
    pub sticks_at_m: [f64; 3],
}

/// What lies between the bent arc and the bend vector that a perfect camera would read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SightTruth {
    /// The plane turns with the bend, rad/rad; -1 to 1; neutral 0.
    pub twist_rad_per_rad: f64,
    /// The plane slips by this times the area that the bend vector sweeps, 1/rad; shrinks as the snake straightens;
    /// -2 to 2; neutral 0.
    pub plane_slip_per_rad: f64,
    /// The end disk does not follow the first part of a bend, rad; 0 to 0.5; neutral 0.
    pub dead_bend_rad: f64,
    /// Curvature grows along the snake by this part from its middle to its tip, and the angle is read off the tip's place,
    /// 1; -1 to 1; neutral 0.
    pub curvature_slope: f64,
    /// What that part grows with the bend's square, 1/rad²; -0.5 to 0.5; neutral 0.
    pub curvature_slope_per_rad2: f64,
    /// Both components are larger by this times their product, 1/rad; -0.5 to 0.5; neutral 0.
    pub product_per_rad: f64,
    /// The camera reads bends too large by this part, 1; -0.3 to 0.3; neutral 0.
    pub scale: f64,
    /// It is tilted by this, rad; each -0.5 to 0.5; neutral 0.
    pub offset_rad: [f64; 2],
    /// The whole snake sways with this amplitude, as on a chest that breathes, rad; each -0.5 to 0.5; neutral 0.
    pub sway_rad: [f64; 2],
    /// How often, Hz; 0.01 to 5.
    pub sway_hz: f64,
    /// Its frames show the snake as it stood this long before their stamp, s; 0 to 0.4; neutral 0.
    pub clock_error_s: f64,
}

/// What changes with time, counted from the first command. Three values are those of lines 1, 2, 3.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SlowTruth {
    /// The snake becomes stiffer by this part, 1; -0.5 to 0.5; neutral 0.
    pub stiffness: f64,
    /// The lines become longer by this, m; each -0.002 to 0.002; neutral 0.
    pub line_m: [f64; 3],
    /// Time in which both come, s; 1 to 1e5.
    pub time_s: f64,
    /// A collision shortens the lines by this at once, m; each -0.002 to 0.002; neutral 0.
    pub collision_m: [f64; 3],
    /// When it happens, s; 0 to 1e6.
    pub collision_time_s: f64,
    /// Play that each actuator has more from an instant on, m; 0 to 0.002; neutral 0.
    pub change_play_m: f64,
    /// The snake is stiffer by this part from that instant on, 1; -0.5 to 2; neutral 0.
    pub change_stiffness: f64,
    /// That instant, s; 0 to 1e6.
    pub change_time_s: f64,
}

impl Default for LinesTruth {
    fn default() -> Self {
        Self {
            actuator_m_per_n: 0.0,
            inside: 0.0,
            creep_part: 0.0,
            creep_time_s: 10.0,
            drag_n_s_per_m: 0.0,
            rub_n: 0.0,
            rub_travel_m: 1e-4,
            rub_breakaway: 0.0,
            rub_speed_m_per_s: 3e-4,
            disk_mu: 0.0,
            cone_radius_m: 0.0,
            angle_rad: [0.0; 3],
            radius: [0.0; 3],
            softness: [0.0; 3],
            push_softness: 0.0,
            coupling: [0.0; 6],
        }
    }
}

impl Default for BendingTruth {
    fn default() -> Self {
        Self {
            soft_strain: 0.01,
            softening: 0.0,
            friction_n_m: 0.0,
            friction_m: 0.0,
            axial_tip_force_n: 0.0,
            detent_n_m_per_rad: 0.0,
            detent_planes: 5.0,
        }
    }
}

impl Default for EncodersTruth {
    fn default() -> Self {
        Self {
            zero_m: [0.0; 3],
            scale: [0.0; 3],
            screw_m: 0.0,
            screw_pitch_m: 1e-3,
            screw_phase_rad: [0.0; 3],
            sticks_at_m: [0.0; 3],
        }
    }
}

impl Default for SightTruth {
    fn default() -> Self {
        Self {
            twist_rad_per_rad: 0.0,
            plane_slip_per_rad: 0.0,
            dead_bend_rad: 0.0,
            curvature_slope: 0.0,
            curvature_slope_per_rad2: 0.0,
            product_per_rad: 0.0,
            scale: 0.0,
            offset_rad: [0.0; 2],
            sway_rad: [0.0; 2],
            sway_hz: 0.25,
            clock_error_s: 0.0,
        }
    }
}

impl Default for SlowTruth {
    fn default() -> Self {
        Self {
            stiffness: 0.0,
            line_m: [0.0; 3],
            time_s: 600.0,
            collision_m: [0.0; 3],
            collision_time_s: 60.0,
            change_play_m: 0.0,
            change_stiffness: 0.0,
            change_time_s: 60.0,
        }
    }
}

impl LinesTruth {
    pub(super) fn ranges(&self, machine: &MachineTruth) -> Vec<Range> {
        // Two arcs of the angle phi fit into the cone.
        let largest_m = machine.l_c_m / (2.0 * machine.phi_rad.max(0.01));
        let mut ranges = vec![
            ("lines.actuator_m_per_n", self.actuator_m_per_n, 0.0, 1e-4),
            ("lines.inside", self.inside, 0.0, 1.5),
            ("lines.creep_part", self.creep_part, 0.0, 0.5),
            ("lines.creep_time_s", self.creep_time_s, 0.05, 1e5),
            ("lines.drag_n_s_per_m", self.drag_n_s_per_m, 0.0, 1e5),
            ("lines.rub_n", self.rub_n, 0.0, 50.0),
            ("lines.rub_travel_m", self.rub_travel_m, 1e-6, 5e-3),
            ("lines.rub_breakaway", self.rub_breakaway, 0.0, 2.0),
            ("lines.rub_speed_m_per_s", self.rub_speed_m_per_s, 1e-5, 0.1),
            ("lines.disk_mu", self.disk_mu, 0.0, 1.0),
            ("lines.cone_radius_m", self.cone_radius_m, 0.0, largest_m),
            ("lines.push_softness", self.push_softness, 0.0, 1e5),
        ];
        each(&mut ranges, "lines.angle_rad", &self.angle_rad, 0.3);
        each(&mut ranges, "lines.radius", &self.radius, 0.3);
        each(&mut ranges, "lines.softness", &self.softness, 0.5);
        each(&mut ranges, "lines.coupling", &self.coupling, 0.3);
        ranges
    }
}

impl BendingTruth {
    pub(super) fn ranges(&self) -> Vec<Range> {
        vec![
            ("bending.soft_strain", self.soft_strain, 1e-3, 0.08),
            ("bending.softening", self.softening, 0.0, 1.0),
            ("bending.friction_n_m", self.friction_n_m, 0.0, 0.05),
            ("bending.friction_m", self.friction_m, 0.0, 0.01),
            ("bending.axial_tip_force_n", self.axial_tip_force_n, -1.0, 1.0),
            ("bending.detent_n_m_per_rad", self.detent_n_m_per_rad, 0.0, 0.02),
            ("bending.detent_planes", self.detent_planes, 1.0, 24.0),
        ]
    }
}

impl EncodersTruth {
    pub(super) fn ranges(&self) -> Vec<Range> {
        let mut ranges = vec![
            ("encoders.screw_m", self.screw_m, 0.0, 5e-5),
            ("encoders.screw_pitch_m", self.screw_pitch_m, 5e-4, 0.01),
        ];
        each(&mut ranges, "encoders.zero_m", &self.zero_m, 2e-3);
        each(&mut ranges, "encoders.scale", &self.scale, 0.1);
        each(&mut ranges, "encoders.screw_phase_rad", &self.screw_phase_rad, 3.2);
        ranges.extend(self.sticks_at_m.map(|sticks_at_m| ("encoders.sticks_at_m", sticks_at_m, 0.0, 0.01)));
        ranges
    }
}

impl SightTruth {
    pub(super) fn ranges(&self) -> Vec<Range> {
        let mut ranges = vec![
            ("sight.twist_rad_per_rad", self.twist_rad_per_rad, -1.0, 1.0),
            ("sight.plane_slip_per_rad", self.plane_slip_per_rad, -2.0, 2.0),
            ("sight.dead_bend_rad", self.dead_bend_rad, 0.0, 0.5),
            ("sight.curvature_slope", self.curvature_slope, -1.0, 1.0),
            ("sight.curvature_slope_per_rad2", self.curvature_slope_per_rad2, -0.5, 0.5),
            ("sight.product_per_rad", self.product_per_rad, -0.5, 0.5),
            ("sight.scale", self.scale, -0.3, 0.3),
            ("sight.sway_hz", self.sway_hz, 0.01, 5.0),
            ("sight.clock_error_s", self.clock_error_s, 0.0, 0.4),
        ];
        each(&mut ranges, "sight.offset_rad", &self.offset_rad, 0.5);
        each(&mut ranges, "sight.sway_rad", &self.sway_rad, 0.5);
        ranges
    }
}

impl SlowTruth {
    pub(super) fn ranges(&self) -> Vec<Range> {
        let mut ranges = vec![
            ("slow.stiffness", self.stiffness, -0.5, 0.5),
            ("slow.time_s", self.time_s, 1.0, 1e5),
            ("slow.collision_time_s", self.collision_time_s, 0.0, 1e6),
            ("slow.change_play_m", self.change_play_m, 0.0, 2e-3),
            ("slow.change_stiffness", self.change_stiffness, -0.5, 2.0),
            ("slow.change_time_s", self.change_time_s, 0.0, 1e6),
        ];
        each(&mut ranges, "slow.line_m", &self.line_m, 2e-3);
        each(&mut ranges, "slow.collision_m", &self.collision_m, 2e-3);
        ranges
    }
}

fn each(ranges: &mut Vec<Range>, key: &'static str, values: &[f64], limit: f64) {
    ranges.extend(values.iter().map(|&value| (key, value, -limit, limit)));
}
