//! The operators and numbers of formulas, for the library that parses them: values with tangents, and nothing but arithmetic.

use super::formula::MAX_FORMULA_NAMES;
use super::real::{Dual, Real};
use exmex::{BinOp, MakeOperators, MatchLiteral, Operator};

/// A number with a tangent for each name that a formula can use.
pub(super) type Lanes = Dual<MAX_FORMULA_NAMES>;

/// The operators of formulas.
#[derive(Clone, Debug)]
pub(super) struct Arithmetic;

impl MakeOperators<Lanes> for Arithmetic {
    fn make<'a>() -> Vec<Operator<'a, Lanes>> {
        let bin = |apply, prio, is_commutative| BinOp { apply, prio, is_commutative };
        vec![
            Operator::make_bin_unary("+", bin(|a, b| a + b, 0, true), |a| a),
            Operator::make_bin_unary("-", bin(|a, b| a - b, 1, false), |a| -a),
            Operator::make_bin("*", bin(|a, b| a * b, 2, true)),
            Operator::make_bin("/", bin(|a, b| a / b, 3, false)),
            Operator::make_bin("^", bin(power, 4, false)),
            Operator::make_bin("min", bin(|a, b| if b.value < a.value { b } else { a }, 5, true)),
            Operator::make_bin("max", bin(|a, b| if b.value > a.value { b } else { a }, 5, true)),
            Operator::make_unary("abs", Lanes::abs),
            Operator::make_unary("sign", |a| Lanes::constant(if a.value == 0.0 { 0.0 } else { a.value.signum() })),
            Operator::make_unary("sqrt", Lanes::sqrt),
            Operator::make_unary("exp", Lanes::exp),
            Operator::make_unary("ln", |a| a.chain(a.value.ln(), 1.0 / a.value)),
            Operator::make_unary("sin", Lanes::sin),
            Operator::make_unary("cos", Lanes::cos),
            Operator::make_unary("tan", |a| a.chain(a.value.tan(), 1.0 + a.value.tan().powi(2))),
            Operator::make_unary("atan", |a| a.chain(a.value.atan(), 1.0 / (1.0 + a.value * a.value))),
            Operator::make_unary("tanh", |a| a.chain(a.value.tanh(), 1.0 - a.value.tanh().powi(2))),
            Operator::make_constant("pi", Lanes::constant(core::f64::consts::PI)),
        ]
    }
}

/// The words that are operators, for messages.
pub(super) const FORMULA_FUNCTIONS: [&str; 12] =
    ["min", "max", "abs", "sign", "sqrt", "exp", "ln", "sin", "cos", "tan", "atan", "tanh"];

fn power(a: Lanes, b: Lanes) -> Lanes {
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

impl core::str::FromStr for Lanes {
    type Err = core::num::ParseFloatError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        text.parse().map(Self::constant)
    }
}
