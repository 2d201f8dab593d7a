//! The four functions of the bend that a circular arc needs, smooth through the straight pose.
//!
//! Each is an even power series in b; the closed forms cancel at small b, so the series is used below one radian.

/// Values at one bend b.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    /// sin b / b.
    pub sinc: f64,
    /// (1 - cos b) / b^2.
    pub cosc: f64,
    /// (b - sin b) / b^3.
    pub sinc3: f64,
    /// (d sinc / d b) / b.
    pub sinc_slope: f64,
    /// (d cosc / d b) / b.
    pub cosc_slope: f64,
}

impl Arc {
    /// The functions of b, given b^2 in rad2.
    pub(crate) fn of_square(u: f64) -> Self {
        if u < 1.0 { Self::series(u) } else { Self::closed(u.sqrt()) }
    }

    /// Ten terms: the first one left out is below 1e-17 of the sum at b = 1 rad.
    fn series(u: f64) -> Self {
        let mut arc = Self { sinc: 0.0, cosc: 0.0, sinc3: 0.0, sinc_slope: 0.0, cosc_slope: 0.0 };
        // term = (-u)^k / (2k)!, previous = (-u)^(k-1) / (2k)!
        let (mut term, mut previous) = (1.0, 0.0);
        let mut n = 0.0;
        for _ in 0..10 {
            arc.sinc += term / (n + 1.0);
            arc.cosc += term / ((n + 1.0) * (n + 2.0));
            arc.sinc3 += term / ((n + 1.0) * (n + 2.0) * (n + 3.0));
            arc.sinc_slope -= n * previous / (n + 1.0);
            arc.cosc_slope -= n * previous / ((n + 1.0) * (n + 2.0));
            let factor = 1.0 / ((n + 1.0) * (n + 2.0));
            previous = term * factor;
            term *= -u * factor;
            n += 2.0;
        }
        arc
    }

    fn closed(b: f64) -> Self {
        let (sin, cos) = b.sin_cos();
        let (sinc, cosc) = (sin / b, (1.0 - cos) / (b * b));
        Self {
            sinc,
            cosc,
            sinc3: (1.0 - sinc) / (b * b),
            sinc_slope: (cos - sinc) / (b * b),
            cosc_slope: (sinc - 2.0 * cosc) / (b * b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(arc: Arc) -> [f64; 5] {
        [arc.sinc, arc.cosc, arc.sinc3, arc.sinc_slope, arc.cosc_slope]
    }

    #[test]
    fn series_and_closed_form_meet_at_one_radian() {
        for (series, closed) in array(Arc::series(1.0)).into_iter().zip(array(Arc::closed(1.0))) {
            assert!((series - closed).abs() < 4e-16, "{series} {closed}");
        }
    }

    #[test]
    fn the_straight_pose_has_its_known_limits() {
        assert_eq!(array(Arc::of_square(0.0)), [1.0, 0.5, 1.0 / 6.0, -1.0 / 3.0, -1.0 / 12.0]);
    }
}
