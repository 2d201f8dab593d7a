//! The law of one line between snake and actuator: static friction, the cone's capstan, and between which positions it sticks.
//!
//! hi(tau) = max(g x, x/g) with x = tau + f_s while the line is pushed, lo(tau) = -hi(-tau) while it is drawn back, g = e^(2 mu phi);
//! the cone gives c_c times that. Both ends of the span travel with tau by a slope of g or 1/g.

/// Friction of every line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Friction {
    /// f_s, N, at least 0.
    pub f_s_n: f64,
    /// g, at least 1.
    capstan: f64,
    /// 1/g: a step asks for it line by line.
    per_capstan: f64,
}

/// Two values, of a line that is about to be drawn back and of one that is about to be pushed, as middle and half of the difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Span {
    pub middle: f64,
    pub half: f64,
}

impl Span {
    /// The value for a sign of motion, -1 to 1.
    pub fn at(&self, sign: f64) -> f64 {
        self.middle + self.half * sign
    }

    fn of(low: f64, high: f64) -> Self {
        Self { middle: 0.5 * (low + high), half: 0.5 * (high - low) }
    }
}

impl Friction {
    /// Of f_s, N, and g.
    pub fn new(f_s_n: f64, capstan: f64) -> Self {
        Self { f_s_n, capstan, per_capstan: capstan.recip() }
    }

    /// The same f_s with another g.
    pub fn with_capstan(self, capstan: f64) -> Self {
        Self::new(self.f_s_n, capstan)
    }

    /// What both make of a line.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            f_s_n: self.f_s_n + other.f_s_n,
            capstan: self.capstan * other.capstan,
            per_capstan: self.per_capstan * other.per_capstan,
        }
    }

    /// hi(tau), N, and its slope, 1.
    pub fn pushed(&self, tau_n: f64) -> (f64, f64) {
        let x = tau_n + self.f_s_n;
        let slope = if x >= 0.0 { self.capstan } else { self.per_capstan };
        (slope * x, slope)
    }

    /// lo(tau), N, and its slope, 1.
    pub fn drawn(&self, tau_n: f64) -> (f64, f64) {
        let (load, slope) = self.pushed(-tau_n);
        (-load, slope)
    }

    /// Loads at the actuator, N, and their slopes.
    pub fn loads(&self, tau_n: f64) -> (Span, Span) {
        let ((low, low_slope), (high, high_slope)) = (self.drawn(tau_n), self.pushed(tau_n));
        (Span::of(low, high), Span::of(low_slope, high_slope))
    }

    /// Solves squeeze = c_d tau + c_c hi(tau) for tau, N, m and m/N; rising in tau, a broken line of two pieces. Also gives the slope
    /// of the right side there. `None` where nothing gives.
    pub fn load_while_pushed(&self, squeeze_m: f64, c_d_m_per_n: f64, c_c_m_per_n: f64) -> Option<(f64, f64)> {
        // At tau = -f_s the cone carries nothing.
        let beyond_m = squeeze_m + c_d_m_per_n * self.f_s_n;
        let slope = c_d_m_per_n + c_c_m_per_n * if beyond_m >= 0.0 { self.capstan } else { self.per_capstan };
        (slope > 0.0).then(|| (beyond_m / slope - self.f_s_n, slope))
    }
}
