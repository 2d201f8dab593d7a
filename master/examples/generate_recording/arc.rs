//! Where the tip of a circular arc is, for the synthetic operator, who plans a bend and must push the tip there.
//!
//! p(b) = L ((1 - cos b) / b^2 (b_x, -b_y), sin b / b)
//!
//! where: b = |(b_x, b_y)|: bend, rad; (b_x, b_y) = b (cos delta, sin delta): bend vector; L: length of the snake, m. The
//! bending plane lies at azimuth -delta, hence the sign of b_y. Frame: the base frame, z along the straight snake; it is
//! parallel to the view frame that the operator input is given in.

/// Length of the default snake, m.
pub const LENGTH_M: f64 = 0.026;

/// Below this bend the closed form loses digits to cancellation and its series is used, rad.
const SMALL_BEND_RAD: f64 = 1e-4;

/// Tip of the arc in the base frame, m, for a bend vector, rad.
pub fn tip_pos_in_base_m(bend_rad: [f64; 2]) -> [f64; 3] {
    let b = bend_rad[0].hypot(bend_rad[1]);
    let (lateral, axial) = if b < SMALL_BEND_RAD {
        (0.5 - b * b / 24.0, 1.0 - b * b / 6.0)
    } else {
        ((1.0 - b.cos()) / (b * b), b.sin() / b)
    };
    [LENGTH_M * lateral * bend_rad[0], -LENGTH_M * lateral * bend_rad[1], LENGTH_M * axial]
}

/// Derivative of the tip's position by the bend vector, m/rad: one column per component, by central differences.
pub fn jacobian_m_per_rad(bend_rad: [f64; 2]) -> [[f64; 3]; 2] {
    const STEP_RAD: f64 = 1e-5;
    std::array::from_fn(|column| {
        let (mut ahead, mut behind) = (bend_rad, bend_rad);
        ahead[column] += STEP_RAD;
        behind[column] -= STEP_RAD;
        let (ahead, behind) = (tip_pos_in_base_m(ahead), tip_pos_in_base_m(behind));
        std::array::from_fn(|row| (ahead[row] - behind[row]) / (2.0 * STEP_RAD))
    })
}

/// Rate of the bend vector, rad/s, whose tip velocity comes nearest to the given one (m/s, base frame): least squares.
pub fn bend_vel_rad_per_s(bend_rad: [f64; 2], tip_vel_in_base_m_per_s: [f64; 3]) -> [f64; 2] {
    let [a, b] = jacobian_m_per_rad(bend_rad);
    let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
    let (av, bv) = (dot(a, tip_vel_in_base_m_per_s), dot(b, tip_vel_in_base_m_per_s));
    let det = aa * bb - ab * ab;
    [(bb * av - ab * bv) / det, (aa * bv - ab * av) / det]
}

/// Velocity of the tip in the base frame, m/s, for a rate of the bend vector, rad/s.
pub fn tip_vel_in_base_m_per_s(bend_rad: [f64; 2], bend_vel_rad_per_s: [f64; 2]) -> [f64; 3] {
    let [a, b] = jacobian_m_per_rad(bend_rad);
    std::array::from_fn(|row| a[row] * bend_vel_rad_per_s[0] + b[row] * bend_vel_rad_per_s[1])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_bends_towards_minus_delta_and_is_smooth_through_the_straight_pose() {
        let [x, y, z] = tip_pos_in_base_m([0.0, std::f64::consts::FRAC_PI_3]);
        assert!(x == 0.0 && (y + 0.012_414_0).abs() < 1e-6 && (z - 0.021_501_9).abs() < 1e-6, "{y} {z}");
        let (below, above) = (tip_pos_in_base_m([0.999_9e-4, 0.0]), tip_pos_in_base_m([1.000_1e-4, 0.0]));
        assert!((above[0] - below[0] - 0.5 * LENGTH_M * 2e-8).abs() < 1e-13);
        assert_eq!(tip_pos_in_base_m([0.0, 0.0]), [0.0, 0.0, LENGTH_M]);
    }

    #[test]
    fn rates_and_velocities_are_inverse_to_each_other() {
        for bend_rad in [[0.0, 0.0], [0.9, 0.1], [-0.3, 0.8]] {
            let rate = bend_vel_rad_per_s(bend_rad, tip_vel_in_base_m_per_s(bend_rad, [0.7, -0.2]));
            assert!((rate[0] - 0.7).abs() < 1e-9 && (rate[1] + 0.2).abs() < 1e-9, "{rate:?}");
        }
    }
}
