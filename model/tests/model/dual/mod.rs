//! Dual numbers over any number, dual numbers included: derivatives to rounding, without formulas for them.

use core::ops::{Add, Div, Mul, Sub};

/// What a formula needs of its numbers.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// A constant.
    fn of(value: f64) -> Self;
    /// The plain number at the bottom.
    fn value(self) -> f64;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn sin(self) -> Self {
        f64::sin(self)
    }
    fn cos(self) -> Self {
        f64::cos(self)
    }
}

/// re + eps e with e^2 = 0: eps carries the derivative.
#[derive(Clone, Copy, Debug)]
pub struct Dual<N> {
    pub re: N,
    pub eps: N,
}

impl<N: Number> Add for Dual<N> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { re: self.re + o.re, eps: self.eps + o.eps }
    }
}

impl<N: Number> Sub for Dual<N> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { re: self.re - o.re, eps: self.eps - o.eps }
    }
}

impl<N: Number> Mul for Dual<N> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { re: self.re * o.re, eps: self.eps * o.re + self.re * o.eps }
    }
}

impl<N: Number> Div for Dual<N> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let re = self.re / o.re;
        Self { re, eps: (self.eps - re * o.eps) / o.re }
    }
}

impl<N: Number> Number for Dual<N> {
    fn of(value: f64) -> Self {
        Self { re: N::of(value), eps: N::of(0.0) }
    }
    fn value(self) -> f64 {
        self.re.value()
    }
    fn sin(self) -> Self {
        Self { re: self.re.sin(), eps: self.re.cos() * self.eps }
    }
    fn cos(self) -> Self {
        Self { re: self.re.cos(), eps: N::of(0.0) - self.re.sin() * self.eps }
    }
}
