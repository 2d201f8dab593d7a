//! The operators and numbers of formulas, for the library that parses them: values with tangents, and nothing but arithmetic.

use super::real::{Dual, Real};
use exmex::{BinOp, FlatEx, MakeOperators, MatchLiteral, Operator};

/// An expression over values with K tangents.
pub(super) type Expression<const K: usize> = FlatEx<Dual<K>, Arithmetic, Numbers>;

/// The operators of formulas.
#[derive(Clone, Debug)]
pub(super) struct Arithmetic;

impl<const K: usize> MakeOperators<Dual<K>> for Arithmetic {
    fn make<'a>() -> Vec<Operator<'a, Dual<K>>> {
        let bin = |apply, prio, is_commutative| BinOp { apply, prio, is_commutative };
        vec![
            Operator::make_bin_unary("+", bin(|a, b| a + b, 0, true), |a| a),
            Operator::make_bin_unary("-", bin(|a, b| a - b, 1, false), |a| -a),
            Operator::make_bin("*", bin(|a, b| a * b, 2, true)),
            Operator::make_bin("/", bin(|a, b| a / b, 3, false)),
            Operator::make_bin("^", bin(power, 4, false)),
            Operator::make_bin("min", bin(|a, b| if b.value < a.value { b } else { a }, 5, true)),
            Operator::make_bin("max", bin(|a, b| if b.value > a.value { b } else { a }, 5, true)),
            Operator::make_unary("abs", Dual::abs),
            Operator::make_unary("sign", |a| Dual::constant(if a.value == 0.0 { 0.0 } else { a.value.signum() })),
            Operator::make_unary("sqrt", Dual::sqrt),
            Operator::make_unary("exp", Dual::exp),
            Operator::make_unary("ln", |a| a.chain(a.value.ln(), 1.0 / a.value)),
            Operator::make_unary("sin", Dual::sin),
            Operator::make_unary("cos", Dual::cos),
            Operator::make_unary("tan", |a| a.chain(a.value.tan(), 1.0 + a.value.tan().powi(2))),
            Operator::make_unary("atan", |a| a.chain(a.value.atan(), 1.0 / (1.0 + a.value * a.value))),
            Operator::make_unary("tanh", |a| a.chain(a.value.tanh(), 1.0 - a.value.tanh().powi(2))),
            Operator::make_constant("pi", Dual::constant(core::f64::consts::PI)),
        ]
    }
}

/// The words that are operators, for messages.
pub(super) const FORMULA_FUNCTIONS: [&str; 12] =
    ["min", "max", "abs", "sign", "sqrt", "exp", "ln", "sin", "cos", "tan", "atan", "tanh"];

fn power<const K: usize>(a: Dual<K>, b: Dual<K>) -> Dual<K> {
    let value = a.value.powf(b.value);
    let by_a = if b.value == 0.0 { 0.0 } else { b.value * a.value.powf(b.value - 1.0) };
    let by_b = if a.value > 0.0 { value * a.value.ln() } else { 0.0 };
    a.chain(value, by_a) + b.chain(0.0, by_b)
}

/// Decimal numbers with an optional exponent; the library's own do not know exponents.
#[derive(Clone, Debug)]
pub(super) struct Numbers;

impl MatchLiteral for Numbers {
    fn is_literal(text: &str) -> Option<&str> {
        let digits = |from: usize| text[from..].find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len() - from) + from;
        let whole = digits(0);
        let mantissa = if text[whole..].starts_with('.') { digits(whole + 1) } else { whole };
        if mantissa == 0 || mantissa == 1 && whole == 0 {
            return None;
        }
        let Some(exponent) = text[mantissa..].strip_prefix(['e', 'E']) else { return Some(&text[..mantissa]) };
        let from = mantissa + 1 + usize::from(exponent.starts_with(['+', '-']));
        let end = digits(from);
        Some(&text[..if end > from { end } else { mantissa }])
    }
}

impl<const K: usize> core::str::FromStr for Dual<K> {
    type Err = core::num::ParseFloatError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse().map(Self::constant)
    }
}
