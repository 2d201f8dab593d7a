//! Numbers that carry tangents, so that one piece of code gives an effect's value and its exact derivatives.
//!
//! Forward mode: a [`Dual`] is a value with K tangents; every operation applies the chain rule. An effect is written once for
//! *parameters* P and *variables* S. Three pairs are used: (f64, f64) for values, (f64, Dual) for derivatives with respect to
//! the shape at constant memory, (Dual, Dual) for derivatives with respect to parameters, where memory carries tangents too.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// An array of three from its places, without the machinery of `core::array::from_fn`, which is not inlined.
#[inline(always)]
pub(crate) fn three<T>(mut f: impl FnMut(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// A number that elementary functions can be applied to.
pub trait Real:
    Copy
    + Debug
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// Whether numbers of this type can have tangents.
    const HAS_TANGENTS: bool;
    /// A number without tangents.
    fn constant(value: f64) -> Self;
    /// The number without its tangents.
    fn value(self) -> f64;
    /// f(self), given the value of f and its derivative here.
    fn chain(self, value: f64, slope: f64) -> Self;
    /// f(x, y), given the value of f and its derivatives by x and y here.
    fn chain_of_two(x: Self, y: Self, value: f64, slope: [f64; 2]) -> Self;

    /// Square root; the slope at zero counts as zero.
    fn sqrt(self) -> Self {
        let root = self.value().sqrt();
        self.chain(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }
    /// Its square.
    #[inline(always)]
    fn square(self) -> Self {
        let x = self.value();
        self.chain(x * x, 2.0 * x)
    }
    /// One divided by it.
    #[inline(always)]
    fn recip(self) -> Self {
        let inverse = 1.0 / self.value();
        self.chain(inverse, -inverse * inverse)
    }
    /// e to this power.
    fn exp(self) -> Self {
        let value = self.value().exp();
        self.chain(value, value)
    }
    /// Sine.
    fn sin(self) -> Self {
        let (sin, cos) = self.value().sin_cos();
        self.chain(sin, cos)
    }
    /// Cosine.
    fn cos(self) -> Self {
        let (sin, cos) = self.value().sin_cos();
        self.chain(cos, -sin)
    }
    /// Absolute value; the slope at zero counts as +1.
    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }
}

/// A variable that can be combined with parameters of type P.
pub trait Scalar<P: Real>: Real + Add<P, Output = Self> + Sub<P, Output = Self> + Mul<P, Output = Self> {
    /// A parameter as a variable.
    fn lift(parameter: P) -> Self;
    /// The variable as memory keeps it.
    fn settle(self) -> P;
}

impl Real for f64 {
    const HAS_TANGENTS: bool = false;
    fn constant(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
    fn chain(self, value: f64, _slope: f64) -> Self {
        value
    }
    #[inline(always)]
    fn chain_of_two(_x: Self, _y: Self, value: f64, _slope: [f64; 2]) -> Self {
        value
    }
}

impl Scalar<f64> for f64 {
    fn lift(parameter: f64) -> Self {
        parameter
    }
    fn settle(self) -> f64 {
        self
    }
}

/// A value with K tangents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const K: usize> {
    /// The value.
    pub value: f64,
    /// Its derivatives.
    pub tangent: [f64; K],
}

impl<const K: usize> Dual<K> {
    /// A variable whose derivative with respect to direction `index` is one; out of range, it has no tangent.
    pub fn seed(value: f64, index: usize) -> Self {
        let mut tangent = [0.0; K];
        if let Some(own) = tangent.get_mut(index) {
            *own = 1.0;
        }
        Self { value, tangent }
    }

    #[inline(always)]
    fn combine(self, other: Self, value: f64, by_self: f64, by_other: f64) -> Self {
        let mut tangent = self.tangent;
        for (own, others) in tangent.iter_mut().zip(other.tangent) {
            *own = *own * by_self + others * by_other;
        }
        Self { value, tangent }
    }
}

impl<const K: usize> Default for Dual<K> {
    fn default() -> Self {
        Self { value: 0.0, tangent: [0.0; K] }
    }
}

impl<const K: usize> Real for Dual<K> {
    const HAS_TANGENTS: bool = true;
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self { value, tangent: [0.0; K] }
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }
    #[inline(always)]
    fn chain_of_two(x: Self, y: Self, value: f64, slope: [f64; 2]) -> Self {
        x.combine(y, value, slope[0], slope[1])
    }
    #[inline(always)]
    fn chain(self, value: f64, slope: f64) -> Self {
        let mut tangent = self.tangent;
        for own in &mut tangent {
            *own *= slope;
        }
        Self { value, tangent }
    }
}

impl<const K: usize> Scalar<f64> for Dual<K> {
    #[inline(always)]
    fn lift(parameter: f64) -> Self {
        Self::constant(parameter)
    }
    #[inline(always)]
    fn settle(self) -> f64 {
        self.value
    }
}

impl<const K: usize> Scalar<Dual<K>> for Dual<K> {
    fn lift(parameter: Self) -> Self {
        parameter
    }
    fn settle(self) -> Self {
        self
    }
}

impl<const K: usize> Add for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.combine(other, self.value + other.value, 1.0, 1.0)
    }
}

impl<const K: usize> Sub for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.combine(other, self.value - other.value, 1.0, -1.0)
    }
}

impl<const K: usize> Mul for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.combine(other, self.value * other.value, other.value, self.value)
    }
}

impl<const K: usize> Div for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let inverse = 1.0 / other.value;
        let value = self.value * inverse;
        self.combine(other, value, inverse, -value * inverse)
    }
}

impl<const K: usize> Neg for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.chain(-self.value, -1.0)
    }
}

impl<const K: usize> AddAssign for Dual<K> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<const K: usize> Add<f64> for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<const K: usize> Sub<f64> for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<const K: usize> Mul<f64> for Dual<K> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.chain(self.value * other, other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A function that uses every operation.
    fn all<S: Scalar<f64>>(x: S, y: S) -> S {
        ((x * y + 2.0).sqrt() / y.exp() - (x.sin() * y.cos() * 3.0)).abs() + (-x) * 0.5 - 0.25
    }

    #[test]
    fn tangents_are_central_differences_and_values_are_plain_arithmetic() {
        for (x, y) in [(0.3, 0.7), (-0.4, 1.9), (1.5, -0.2)] {
            let dual = all(Dual::<2>::seed(x, 0), Dual::seed(y, 1));
            assert!((dual.value - all(x, y)).abs() < 1e-15);
            let h = 1e-5;
            let by_x = (all(x + h, y) - all(x - h, y)) / (2.0 * h);
            let by_y = (all(x, y + h) - all(x, y - h)) / (2.0 * h);
            assert!((dual.tangent[0] - by_x).abs() < 1e-9 && (dual.tangent[1] - by_y).abs() < 1e-9);
            assert!(by_x != 0.0 && by_y != 0.0 && dual.tangent != [by_x, by_y]);
        }
    }
}
