//! From the bent arc to the bend vector that a perfect camera would read: twist, dead zone, uneven curvature, tilt.
//!
//! In this order: the plane turns by the twist and by what it slipped; a dead zone takes off the first part of the bend;
//! the angle is read off the place of a tip whose curvature may grow along the snake; cross-talk of the components; the
//! camera's own scale and tilt, and a sway of the whole snake. A plane that slips remembers: dφ = k (b_x db_y - b_y db_x), and φ shrinks with the bend.

use crate::hidden::SightTruth;
use core::f64::consts::TAU;

/// Gauss-Legendre nodes and weights on (0, 1), four points: exact to 1e-9 for curvatures that grow linearly.
const NODES: [(f64, f64); 4] = [
    (0.069_431_844_202_973_7, 0.173_927_422_568_727),
    (0.330_009_478_207_571_9, 0.326_072_577_431_273),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273),
    (0.930_568_155_797_026_3, 0.173_927_422_568_727),
];

/// What a camera sees of a bend vector, with the memory of the plane's slip.
#[derive(Clone, Debug)]
pub(crate) struct Sight {
    truth: SightTruth,
    is_neutral: bool,
    slip_rad: f64,
    before_rad: [f64; 2],
}

impl Sight {
    pub(crate) fn new(truth: &SightTruth) -> Self {
        let is_neutral = SightTruth { clock_error_s: 0.0, ..truth.clone() } == SightTruth::default();
        Self { truth: truth.clone(), is_neutral, slip_rad: 0.0, before_rad: [0.0; 2] }
    }

    /// Brings the memory up to date with the arc's bend vector; call along the path.
    pub(crate) fn follow(&mut self, bend_rad: [f64; 2]) {
        if self.truth.plane_slip_per_rad == 0.0 {
            return;
        }
        let [x, y] = self.before_rad;
        let (before, now) = (x.hypot(y), bend_rad[0].hypot(bend_rad[1]));
        if now < before {
            self.slip_rad *= now / before;
        }
        self.slip_rad += self.truth.plane_slip_per_rad * (x * (bend_rad[1] - y) - y * (bend_rad[0] - x));
        self.before_rad = bend_rad;
    }

    /// What a perfect camera reads at an instant, rad.
    pub(crate) fn seen_rad(&self, stamp_ns: i64, bend_rad: [f64; 2]) -> [f64; 2] {
        if self.is_neutral {
            return bend_rad;
        }
        let bend = bend_rad[0].hypot(bend_rad[1]);
        let (sin, cos) = (self.truth.twist_rad_per_rad * bend + self.slip_rad).sin_cos();
        let followed = (bend - self.truth.dead_bend_rad).max(0.0);
        let part = if bend > 0.0 { self.chord_rad(followed) / bend } else { 0.0 };
        let x = part * (cos * bend_rad[0] - sin * bend_rad[1]);
        let y = part * (sin * bend_rad[0] + cos * bend_rad[1]);
        let product = self.truth.product_per_rad * x * y;
        let scale = 1.0 + self.truth.scale;
        let sway = (TAU * self.truth.sway_hz * stamp_ns as f64 * 1e-9).sin();
        let fixed = |k: usize| self.truth.offset_rad[k] + sway * self.truth.sway_rad[k];
        [scale * (x + product) + fixed(0), scale * (y + product) + fixed(1)]
    }

    /// Twice the angle of the tip's place, which is the bend for an arc.
    fn chord_rad(&self, bend: f64) -> f64 {
        let slope = self.truth.curvature_slope + self.truth.curvature_slope_per_rad2 * bend * bend;
        if slope == 0.0 {
            return bend;
        }
        let (mut across, mut along) = (0.0, 0.0);
        for (s, weight) in NODES {
            let (sin, cos) = (bend * (s + slope * (s * s - s))).sin_cos();
            across += weight * sin;
            along += weight * cos;
        }
        2.0 * across.atan2(along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(truth: SightTruth, bend_rad: [f64; 2]) -> [f64; 2] {
        Sight::new(&truth).seen_rad(0, bend_rad)
    }

    #[test]
    fn an_arc_is_seen_as_it_is_and_a_curvature_that_grows_towards_the_tip_is_seen_smaller() {
        let bend = [0.6, -0.3];
        assert_eq!(seen(SightTruth::default(), bend), bend);
        let uneven = seen(SightTruth { curvature_slope: 0.1, ..SightTruth::default() }, [0.2, 0.0]);
        assert!((uneven[0] / 0.2 - (1.0 - 0.1 / 3.0)).abs() < 1e-3, "{uneven:?}, b (1 - a/3) for small b");
        // The quadrature itself, with a slope that changes nothing visible.
        let arc = seen(SightTruth { curvature_slope: 1e-12, ..SightTruth::default() }, [1.4, 0.0]);
        assert!((arc[0] - 1.4).abs() < 1e-8, "{arc:?}");
    }

    #[test]
    fn twist_and_dead_zone_and_tilt_do_what_their_names_say() {
        let [x, y] = seen(SightTruth { twist_rad_per_rad: 0.1, ..SightTruth::default() }, [0.5, 0.0]);
        assert!((y.atan2(x) - 0.05).abs() < 1e-12 && (x.hypot(y) - 0.5).abs() < 1e-12);
        let dead = SightTruth { dead_bend_rad: 0.04, ..SightTruth::default() };
        assert_eq!(seen(dead.clone(), [0.03, 0.0]), [0.0; 2]);
        assert!((seen(dead, [0.0, -0.5])[1] + 0.46).abs() < 1e-12);
        assert_eq!(seen(SightTruth { offset_rad: [0.01, 0.02], ..SightTruth::default() }, [0.0; 2]), [0.01, 0.02]);
    }

    #[test]
    fn a_plane_slips_with_the_area_swept_and_comes_back_when_the_snake_straightens() {
        let mut sight = Sight::new(&SightTruth { plane_slip_per_rad: 0.2, ..SightTruth::default() });
        let mut go = |bend: f64, delta: f64| {
            sight.follow([bend * delta.cos(), bend * delta.sin()]);
            let [x, y] = sight.seen_rad(0, [bend * delta.cos(), bend * delta.sin()]);
            y.atan2(x) - delta
        };
        (0..=1000).for_each(|k| assert!(go(0.8 * f64::from(k) / 1000.0, 0.0).abs() < 1e-12));
        let turned = (0..=1000).map(|k| go(0.8, f64::from(k) / 1000.0)).last().unwrap();
        assert!((turned - 0.2 * 0.64).abs() < 1e-3, "{turned}");
        let back = (0..=1000).map(|k| go(0.8 - 0.4 * f64::from(k) / 1000.0, 1.0)).last().unwrap();
        assert!((back - 0.1 * 0.64).abs() < 1e-3, "{back}");
    }
}
