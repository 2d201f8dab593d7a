//! From counts to the tip's velocity and back: axis map, dead zone, response curve and scale as one pure function.
//!
//! v = v_full ((|a| - d) / (1 - d))^p a / |a|,   |a| limited to 1,   0 for |a| <= d
//!
//! where: a: deflection in the view frame as a part of the full one; d: dead zone; p: exponent; v_full: speed at full
//! deflection, m/s. Dead zone and curve act on the length of the vector, so that the direction of motion is always the
//! direction of the hand and there is no jump at the dead zone's edge.

use crate::axis_map::SignedAxis;
use crate::{AXIS_LIMIT_COUNTS, AxisMap, MasterConfig};
use krait_ipc::message::DriveWish;

/// The mapping of one checked configuration.
#[derive(Clone, Copy, Debug)]
pub struct Response {
    axis_map: AxisMap,
    dead_zone_ratio: f64,
    exponent: f64,
    full_speed_m_per_s: f64,
    full_turn_rad_per_s: f64,
}

/// What a stretch asks for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Followed {
    /// Velocity of the tip in the view frame, m/s.
    pub(crate) tip_vel_in_view_m_per_s: [f64; 3],
    /// Angular velocity of the tip in the view frame, rad/s.
    pub(crate) tip_angular_vel_in_view_rad_per_s: [f64; 3],
    /// What of the stretch is spent in the time to follow in, of the device's axes.
    pub(crate) spent: [f64; 6],
}

impl Response {
    /// The mapping of a configuration that has passed its check.
    pub fn new(config: &MasterConfig) -> Self {
        Self {
            axis_map: config.axis_map,
            dead_zone_ratio: config.dead_zone_ratio,
            exponent: config.response_exponent,
            full_speed_m_per_s: config.full_speed_m_per_s,
            full_turn_rad_per_s: config.full_turn_rad_per_s,
        }
    }

    /// Velocity of the tip in the view frame, m/s, for the device's axes (x, y, z, rx, ry, rz, counts). Always finite, and
    /// never faster than the full speed.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn tip_vel_in_view_m_per_s(&self, axes: [i16; 6]) -> [f64; 3] {
        self.of(self.axis_map.axes(), axes, self.full_speed_m_per_s)
    }

    /// Angular velocity of the tip in the view frame, rad/s, likewise, by the axes about which the device is turned.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn tip_angular_vel_in_view_rad_per_s(&self, axes: [i16; 6]) -> [f64; 3] {
        self.of(self.axis_map.turns(), axes, self.full_turn_rad_per_s)
    }

    /// The velocity for a stretch of the device's axes, parts of the full one of any size and fraction, and what it spends of
    /// the stretch: dead zone and curve of it.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub(crate) fn follow(&self, stretch: [f64; 6]) -> Followed {
        let mut spent = [0.0; 6];
        let mut of = |map: [SignedAxis; 3]| {
            let shaped = self.shaped(map.map(|axis| axis.sign() * stretch[axis.axis_idx()]), 1.0);
            for (axis, part) in map.into_iter().zip(shaped) {
                spent[axis.axis_idx()] = axis.sign() * part;
            }
            shaped
        };
        let (way, turn) = (of(self.axis_map.axes()), of(self.axis_map.turns()));
        Followed {
            tip_vel_in_view_m_per_s: way.map(|part| part * self.full_speed_m_per_s),
            tip_angular_vel_in_view_rad_per_s: turn.map(|part| part * self.full_turn_rad_per_s),
            spent,
        }
    }

    fn of(&self, map: [SignedAxis; 3], axes: [i16; 6], full: f64) -> [f64; 3] {
        self.shaped(map.map(|axis| axis.sign() * ratio(axes[axis.axis_idx()])), full)
    }

    /// Velocity of the tip in the view frame, m/s, for a deflection along view x and y, thousandths of the full one: a pad is
    /// drawn as the camera sees, so that no axis map stands between. Always finite, and never faster than the full speed.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn pad_vel_in_view_m_per_s(&self, [x_permille, y_permille]: [i32; 2]) -> [f64; 3] {
        let part = |permille: i32| (f64::from(permille) / f64::from(DriveWish::FULL_PERMILLE)).clamp(-1.0, 1.0);
        self.shaped([part(x_permille), part(y_permille), 0.0], self.full_speed_m_per_s)
    }

    /// Dead zone and curve, for a deflection as a part of the full one.
    fn shaped(&self, deflection: [f64; 3], full: f64) -> [f64; 3] {
        let length = norm(deflection);
        if length <= self.dead_zone_ratio || length == 0.0 {
            return [0.0; 3];
        }
        let beyond = (length.min(1.0) - self.dead_zone_ratio) / (1.0 - self.dead_zone_ratio);
        let gain = full * beyond.powf(self.exponent) / length;
        deflection.map(|d| gain * d)
    }

    /// The whole counts that come nearest to asking for a velocity (m/s, view frame); the inverse of
    /// [`Response::tip_vel_in_view_m_per_s`] up to rounding. Faster than full speed is a full deflection.
    pub fn axes_for(&self, tip_vel_in_view_m_per_s: [f64; 3]) -> [i16; 6] {
        let mut axes = [0_i16; 6];
        let speed_m_per_s = norm(tip_vel_in_view_m_per_s);
        if speed_m_per_s == 0.0 {
            return axes;
        }
        let beyond = (speed_m_per_s / self.full_speed_m_per_s).min(1.0).powf(1.0 / self.exponent);
        let length = self.dead_zone_ratio + (1.0 - self.dead_zone_ratio) * beyond;
        for (axis, vel) in self.axis_map.axes().into_iter().zip(tip_vel_in_view_m_per_s) {
            let counts = axis.sign() * length * vel / speed_m_per_s * f64::from(AXIS_LIMIT_COUNTS);
            axes[axis.axis_idx()] = counts.round() as i16;
        }
        axes
    }
}

/// Part of a full deflection, -1..=1; what a device overshoots is a full deflection.
fn ratio(counts: i16) -> f64 {
    (f64::from(counts) / f64::from(AXIS_LIMIT_COUNTS)).clamp(-1.0, 1.0)
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn response() -> Response {
        Response::new(&MasterConfig::default())
    }

    #[test]
    fn the_tip_goes_where_the_cap_is_pushed() {
        // Raw +X is right, +Y towards the user, +Z down (view: x right, y down, z away).
        let full = MasterConfig::default().full_speed_m_per_s;
        assert_eq!(response().tip_vel_in_view_m_per_s([350, 0, 0, 0, 0, 0]), [full, 0.0, 0.0]);
        let [x, y, z] = response().tip_vel_in_view_m_per_s([0, 0, -200, 0, 0, 0]);
        assert!(x == 0.0 && y < 0.0 && z == 0.0, "pulled up is up: {x} {y} {z}");
        let [x, y, z] = response().tip_vel_in_view_m_per_s([0, -200, 0, 0, 0, 0]);
        assert!(x == 0.0 && y == 0.0 && z > 0.0, "pushed forward is away: {x} {y} {z}");
        assert_eq!(response().tip_vel_in_view_m_per_s([0, 0, 0, 350, 350, 350]), [0.0; 3], "turning moves no place");
        let turn = MasterConfig::default().full_turn_rad_per_s;
        assert_eq!(response().tip_angular_vel_in_view_rad_per_s([350, 350, 350, 0, 350, 0]), [0.0, 0.0, -turn]);
        assert_eq!(response().tip_angular_vel_in_view_rad_per_s([0, 0, 0, 5, 5, 5]), [0.0; 3], "within the dead zone");
    }

    #[test]
    fn the_dead_zone_is_still_inside_and_has_no_jump_at_its_edge() {
        let edge_counts = 10; // 0.03 * 350 = 10.5
        assert_eq!(response().tip_vel_in_view_m_per_s([edge_counts, 0, 0, 0, 0, 0]), [0.0; 3]);
        let mut last = 0.0;
        for counts in edge_counts..=AXIS_LIMIT_COUNTS {
            let vel = response().tip_vel_in_view_m_per_s([counts, 0, 0, 0, 0, 0])[0];
            assert!(vel >= last && vel - last < 0.005 * 0.025, "one count is a small step: {counts}");
            last = vel;
        }
    }

    proptest! {
        #[test]
        fn no_counts_ask_for_more_than_full_speed_or_another_direction(axes in prop::array::uniform6(any::<i16>())) {
            let [x, y, z] = response().tip_vel_in_view_m_per_s(axes);
            prop_assert!(norm([x, y, z]) <= 0.025 * (1.0 + 1e-12));
            prop_assert!(x * f64::from(axes[0]) >= 0.0 && y * f64::from(axes[2]) >= 0.0 && z * f64::from(axes[1]) <= 0.0);
        }

        #[test]
        fn the_inverse_gives_back_the_counts(axes in prop::array::uniform3(-200_i16..=200)) {
            let axes = [axes[0], axes[1], axes[2], 0, 0, 0];
            let vel = response().tip_vel_in_view_m_per_s(axes);
            if vel != [0.0; 3] {
                prop_assert_eq!(response().axes_for(vel), axes);
            }
        }
    }
}
