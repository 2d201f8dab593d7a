//! Cone friction from pairs of loads, as in the paper's Table II: a straight line tau~ = a tau + c by least squares.

/// Friction constants of the cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeFrictionFit {
    /// Slope a = e^(2 mu phi), 1.
    pub slope: f64,
    /// Intercept c, in the unit of the loads.
    pub intercept: f64,
    /// mu = ln(a) / (2 phi), 1.
    pub mu: f64,
    /// f_s = c / a, in the unit of the loads.
    pub f_s: f64,
    /// Root mean square of what the line leaves over, in the unit of the loads.
    pub residual_rms: f64,
}

/// Fits mu and f_s of Eq. (13) to pairs (tau, tau~) of one unit; `phi_rad` is the angle of each arc of the cone.
///
/// `None` where the pairs cannot determine a friction: fewer than two of them, all at one load, a slope that is not positive,
/// or a number that is not finite.
pub fn fit_cone_friction(pairs: &[(f64, f64)], phi_rad: f64) -> Option<ConeFrictionFit> {
    let n = pairs.len() as f64;
    let (mean_x, mean_y) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let s_xy: f64 = pairs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let s_xx: f64 = pairs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let slope = s_xy / s_xx;
    let intercept = mean_y - slope * mean_x;
    let left_over: f64 = pairs.iter().map(|(x, y)| (y - slope * x - intercept).powi(2)).sum();
    let fit = ConeFrictionFit {
        slope,
        intercept,
        mu: slope.ln() / (2.0 * phi_rad),
        f_s: intercept / slope,
        residual_rms: (left_over / n).sqrt(),
    };
    let usable = slope > 0.0 && [fit.mu, fit.f_s, fit.residual_rms].iter().all(|v| v.is_finite());
    usable.then_some(fit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_that_determine_nothing_give_nothing() {
        for pairs in [&[][..], &[(1.0, 2.0)], &[(1.0, 2.0), (1.0, 3.0)], &[(1.0, 2.0), (2.0, f64::NAN)]] {
            assert_eq!(fit_cone_friction(pairs, 0.7), None);
        }
        assert_eq!(fit_cone_friction(&[(1.0, 2.0), (2.0, 1.0)], 0.7), None, "a falling line is no friction");
    }
}
