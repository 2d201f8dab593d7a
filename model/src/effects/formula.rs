//! Effects that a user writes: a formula of shape, loads and columns that adds to a hook.
//!
//! Text is parsed by the library exmex over numbers with twelve tangents, one for each name that the formula uses, so that one
//! evaluation gives the value and its derivative with respect to each of them. Only the operators listed here exist: a formula
//! can do nothing but arithmetic. Evaluation works on the stack as long as the formula is not longer than what is accepted.

use super::definition::{Class, Definition, Hook, effect};
use super::formula_error::FormulaError;
use super::operators::play;
use super::prepared::{MAX_PARAMETERS, Now, Prepared};
use super::real::{Dual, Real, Scalar};
use exmex::prelude::*;
use exmex::{BinOp, MakeOperators, MatchLiteral, Operator};

pub(super) static FORMULA: Definition = Definition {
    repeatable: true,
    n_states: 3,
    ..effect("formula", Hook::Eps, Class::User, "adds the formula's value at its hook")
};

/// The most names, variables and parameters together, that one formula can use.
pub const MAX_FORMULA_NAMES: usize = 12;
/// The most numbers and names, counted as often as they stand there: what evaluates without the heap.
const MAX_WORDS: usize = 32;
/// Bounds how deeply parentheses can be nested.
const MAX_BYTES: usize = 400;
/// Travel of q over which the variable `direction` turns, m.
const DIRECTION_TRAVEL_M: f64 = 20e-6;

type Lanes = Dual<MAX_FORMULA_NAMES>;

/// A formula as it stands in a model file.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaText {
    /// Its name.
    pub name: String,
    /// Where its value is added.
    pub hook: Hook,
    /// The expression.
    pub text: String,
    /// Its parameters.
    pub parameters: Vec<FormulaParameter>,
}

/// One parameter of a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct FormulaParameter {
    /// Name in the expression.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its unit, for reports.
    pub unit: String,
}

/// A variable that a formula can use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FormulaVariable {
    /// Name.
    pub name: &'static str,
    /// Unit and meaning.
    pub meaning: &'static str,
    /// At which hooks it is known.
    pub hooks: &'static [Hook],
}

const LINE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo];
const SHAPE: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas];
const ALL: &[Hook] = &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Meas, Hook::Enc];

const fn variable(name: &'static str, meaning: &'static str, hooks: &'static [Hook]) -> FormulaVariable {
    FormulaVariable { name, meaning, hooks }
}

/// Every variable, in the order of their values.
pub const FORMULA_VARIABLES: [FormulaVariable; 16] = [
    variable("bend", "rad: bend from straight", SHAPE),
    variable("delta", "rad: plane of bending, 0 at the straight pose", SHAPE),
    variable("bend_x", "rad: first component of the bend vector", SHAPE),
    variable("bend_y", "rad: second component of the bend vector", SHAPE),
    variable("q1", "m: displacement of line 1 at the snake", LINE),
    variable("q2", "m: displacement of line 2 at the snake", LINE),
    variable("q3", "m: displacement of line 3 at the snake", LINE),
    variable("q_i", "m: displacement of this line at the snake", LINE),
    variable("tau_i", "N: load of this line at the snake, push positive", LINE),
    variable("direction", "-1 to 1: sign of motion of this line, turning over 20 um of q_i", LINE),
    variable("q_tilde_i", "m: position of this line's actuator", &[Hook::Enc]),
    variable("axis", "0 for bend_x, 1 for bend_y: what the value is added to", &[Hook::Meas]),
    variable("line", "1, 2 or 3", &[Hook::Eps, Hook::Tau, Hook::Geo, Hook::Enc]),
    variable("time_s", "s", ALL),
    variable("stem_angle_rad", "rad: needs the column", ALL),
    variable("temperature_c", "deg C: needs the column", ALL),
];

const TIME: usize = 13;
const STEM_ANGLE: usize = 14;
const TEMPERATURE: usize = 15;

/// The variables' values.
pub(crate) type Values<S> = [S; FORMULA_VARIABLES.len()];

/// What a name in the expression stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Variable(usize),
    Parameter(usize),
}

/// A parsed formula.
#[derive(Clone, Debug)]
pub(crate) struct Formula {
    pub hook: Hook,
    expression: FlatEx<Lanes, Arithmetic, Numbers>,
    names: Vec<Meaning>,
}

impl Formula {
    /// Parses and checks: known names only, not too long, finite over the machine's workspace.
    pub(crate) fn new(formula: &FormulaText) -> Result<Self, FormulaError> {
        let name = || formula.name.clone();
        if !ALL.contains(&formula.hook) {
            return Err(FormulaError::Hook { formula: name(), hook: formula.hook.word() });
        }
        let n_words = words(&formula.text).count();
        if n_words > MAX_WORDS {
            return Err(FormulaError::TooLong { formula: name(), found: n_words, limit: MAX_WORDS });
        }
        if formula.parameters.len() > MAX_PARAMETERS {
            return Err(FormulaError::TooManyParameters {
                formula: name(),
                found: formula.parameters.len(),
                limit: MAX_PARAMETERS,
            });
        }
        if let Some(bad) = formula.parameters.iter().find(|p| !is_free_word(&p.name)) {
            return Err(FormulaError::ParameterName { formula: name(), name: bad.name.clone() });
        }
        if let Some(word) = words(&formula.text).find(|word| is_name(word) && !is_known(formula, word)) {
            return Err(FormulaError::unknown_name(formula, word));
        }
        if let Some(reason) = refused_text(&formula.text) {
            return Err(FormulaError::Syntax { formula: name(), reason: reason.to_owned() });
        }
        let expression = FlatEx::<Lanes, Arithmetic, Numbers>::parse(&formula.text)
            .map_err(|e| FormulaError::Syntax { formula: name(), reason: e.msg().to_owned() })?;
        let names: Vec<Meaning> =
            expression.var_names().iter().map(|word| meaning(formula, word)).collect::<Result<_, _>>()?;
        if names.len() > MAX_FORMULA_NAMES {
            return Err(FormulaError::TooManyNames { formula: name(), found: names.len(), limit: MAX_FORMULA_NAMES });
        }
        let parsed = Self { hook: formula.hook, expression, names };
        parsed.check_finite(formula)?;
        Ok(parsed)
    }

    pub(crate) fn uses_time(&self) -> bool {
        self.names.contains(&Meaning::Variable(TIME))
    }

    pub(crate) fn uses_stem_angle(&self) -> bool {
        self.names.contains(&Meaning::Variable(STEM_ANGLE))
    }

    pub(crate) fn uses_temperature(&self) -> bool {
        self.names.contains(&Meaning::Variable(TEMPERATURE))
    }

    /// Value with tangents; `None` where it is not finite.
    pub(crate) fn evaluate<P: Real, S: Scalar<P>>(&self, values: &Values<S>, parameters: &[P]) -> Option<S> {
        let mut lanes = [Lanes::default(); MAX_FORMULA_NAMES];
        let own = |name: &Meaning| match *name {
            Meaning::Variable(k) => values[k],
            Meaning::Parameter(k) => S::lift(parameters[k]),
        };
        for (k, (lane, name)) in lanes.iter_mut().zip(&self.names).enumerate() {
            *lane = Lanes::seed(own(name).value(), k);
        }
        let found = self.expression.eval(lanes.get(..self.names.len())?).ok()?;
        if !(found.value.is_finite() && found.tangent.iter().all(|t| t.is_finite())) {
            return None;
        }
        let mut sum = S::constant(found.value);
        for (name, slope) in self.names.iter().zip(found.tangent) {
            let own = own(name);
            sum += (own - S::constant(own.value())) * S::constant(slope);
        }
        Some(sum)
    }

    /// Evaluates on a grid of the workspace.
    fn check_finite(&self, formula: &FormulaText) -> Result<(), FormulaError> {
        let mut parameters = [0.0; MAX_PARAMETERS];
        for (own, given) in parameters.iter_mut().zip(&formula.parameters) {
            *own = given.value;
        }
        for bend in [0.0, 1e-9, 0.1, 0.5, 1.0, 1.57] {
            for delta in [-2.6, -1.1, 0.0, 0.8, 2.1_f64] {
                for sign in [-1.0, 0.0, 1.0] {
                    let (x, y) = (bend * delta.cos(), bend * delta.sin());
                    let (q, tau) = (sign * 1.684e-3 * bend, sign * 20.0 * bend);
                    let values =
                        [bend, delta, x, y, q, q, q, q, tau, sign, q, 0.0, 1.0 + sign.abs(), 10.0 * bend, sign, 25.0];
                    if self.evaluate(&values, &parameters).is_none() {
                        let (formula, text) = (formula.name.clone(), formula.text.clone());
                        return Err(FormulaError::NotFinite { formula, text, bend_rad: bend, delta_rad: delta });
                    }
                }
            }
        }
        Ok(())
    }
}

/// The variables at a line, from shape, displacements and loads; `direction` keeps its memory in the effect's state.
pub(crate) fn line_values<P: Real, S: Scalar<P>>(
    e: &Prepared<P>,
    state: &mut [P],
    b: [S; 2],
    q: [S; 3],
    tau: S,
    i: usize,
    now: &Now,
) -> Values<S> {
    let half = P::constant(0.5 * DIRECTION_TRAVEL_M);
    let p = play(state[e.state + i], q[i], half, now.fresh);
    if now.commit {
        state[e.state + i] = p.settle();
    }
    let direction = (q[i] - p) * (P::constant(1.0) / half);
    let mut values = shape_values(b, now);
    values[4..8].copy_from_slice(&[q[0], q[1], q[2], q[i]]);
    (values[8], values[9]) = (tau, direction);
    values[12] = S::constant([1.0, 2.0, 3.0][i]);
    values
}

/// The variables that a shape has.
pub(crate) fn shape_values<S: Real>(b: [S; 2], now: &Now) -> Values<S> {
    let mut values = [S::constant(0.0); FORMULA_VARIABLES.len()];
    let square = b[0] * b[0] + b[1] * b[1];
    values[0] = square.sqrt();
    values[1] = plane(b, square.value());
    (values[2], values[3]) = (b[0], b[1]);
    values[TIME] = S::constant(now.time_s);
    values[STEM_ANGLE] = S::constant(now.stem_angle_rad);
    values[TEMPERATURE] = S::constant(now.temperature_c);
    values
}

/// The variables at an encoder.
pub(crate) fn encoder_values<S: Real>(q_tilde: S, i: usize, now: &Now) -> Values<S> {
    let mut values = shape_values([S::constant(0.0); 2], now);
    values[10] = q_tilde;
    values[12] = S::constant([1.0, 2.0, 3.0][i]);
    values
}

/// Sets which component of the bend vector is asked for.
pub(crate) fn set_axis<S: Real>(values: &mut Values<S>, axis: f64) {
    values[11] = S::constant(axis);
}

/// delta with its tangents, which count as zero where delta has no meaning.
fn plane<S: Real>(b: [S; 2], square: f64) -> S {
    let delta = b[1].value().atan2(b[0].value());
    if square < 1e-18 {
        return S::constant(if square > 0.0 { delta } else { 0.0 });
    }
    let (by_x, by_y) = (-b[1].value() / square, b[0].value() / square);
    let turned =
        (b[0] - S::constant(b[0].value())) * S::constant(by_x) + (b[1] - S::constant(b[1].value())) * S::constant(by_y);
    turned + S::constant(delta)
}

/// Numbers and names of a formula; a number with an exponent may count as two.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')).filter(|word| !word.is_empty())
}

fn is_name(word: &str) -> bool {
    !word.starts_with(|c: char| c.is_ascii_digit() || c == '.')
}

fn is_known(formula: &FormulaText, word: &str) -> bool {
    word == "pi"
        || FORMULA_FUNCTIONS.contains(&word)
        || FORMULA_VARIABLES.iter().any(|v| v.name == word)
        || formula.parameters.iter().any(|p| p.name == word)
}

/// What the library would read in another way than its writer may have meant, or should not be given.
fn refused_text(text: &str) -> Option<&'static str> {
    if text.trim().is_empty() {
        return Some("it is empty");
    }
    if text.len() > MAX_BYTES || text.contains(['{', '}']) {
        return Some("it has braces or more than 400 bytes");
    }
    // The library reads -x^2 as (-x)^2.
    let compact: Vec<char> = text.chars().filter(|c| !c.is_whitespace()).collect();
    let unary = |k: usize| compact[k] == '-' && (k == 0 || "(,+-*/^".contains(compact[k - 1]));
    let ambiguous = (0..compact.len()).any(|k| unary(k) && compact.get(operand_end(&compact, k + 1)) == Some(&'^'));
    ambiguous.then_some("a minus stands before a power, which could mean (-x)^2 or -(x^2); use parentheses")
}

/// Where an operand that begins at `k` ends: a word, parentheses, or a word with parentheses.
fn operand_end(text: &[char], mut k: usize) -> usize {
    while text.get(k).is_some_and(|c| c.is_alphanumeric() || *c == '_' || *c == '.') {
        k += 1;
    }
    let mut depth = 0;
    while let Some(c) = text.get(k).filter(|c| depth > 0 || **c == '(') {
        depth += i32::from(*c == '(') - i32::from(*c == ')');
        k += 1;
        if depth == 0 {
            break;
        }
    }
    k
}

fn is_free_word(name: &str) -> bool {
    let word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic());
    word && starts
        && name != "pi"
        && !FORMULA_FUNCTIONS.contains(&name)
        && FORMULA_VARIABLES.iter().all(|v| v.name != name)
}

fn meaning(formula: &FormulaText, word: &str) -> Result<Meaning, FormulaError> {
    if let Some(k) = formula.parameters.iter().position(|p| p.name == word) {
        return Ok(Meaning::Parameter(k));
    }
    match FORMULA_VARIABLES.iter().position(|v| v.name == word) {
        Some(k) if FORMULA_VARIABLES[k].hooks.contains(&formula.hook) => Ok(Meaning::Variable(k)),
        Some(_) => {
            let (formula, hook) = (formula.name.clone(), formula.hook.word());
            Err(FormulaError::NotAtHook { formula, name: word.to_owned(), hook })
        }
        None => Err(FormulaError::unknown_name(formula, word)),
    }
}

/// The operators of formulas.
#[derive(Clone, Debug)]
struct Arithmetic;

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
struct Numbers;

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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn formula(text: &str) -> FormulaText {
        let parameters = vec![FormulaParameter { name: "a".to_owned(), value: 0.7, unit: "1".to_owned() }];
        FormulaText { name: "f".to_owned(), hook: Hook::Eps, text: text.to_owned(), parameters }
    }

    /// Value and tangents by (bend_x, a) at bend_x 0.5 and a 0.7.
    fn at_half(text: &str) -> Dual<2> {
        let mut values = [Dual::constant(0.2); FORMULA_VARIABLES.len()];
        values[2] = Dual::seed(0.5, 0);
        // Not a formula of the chain: the square root below has no slope at the straight pose.
        let expression = FlatEx::<Lanes, Arithmetic, Numbers>::parse(text).unwrap();
        let names = expression.var_names().iter().map(|word| meaning(&formula(text), word).unwrap()).collect();
        Formula { hook: Hook::Eps, expression, names }.evaluate(&values, &[Dual::seed(0.7, 1)]).unwrap()
    }

    #[test]
    fn operators_have_their_values_their_order_and_their_slopes() {
        let x = 0.5_f64;
        let cases: [(&str, f64, f64); 16] = [
            ("2 + 3 * bend_x ^ 2 / 4 - 1", 1.0 + 0.75 * x * x, 1.5 * x),
            ("1 / 2 / 2 * bend_x", 0.25 * x, 0.25),
            ("10 - 3 - bend_x", 7.0 - x, -1.0),
            ("(1 + bend_x) * (1 - bend_x)", 1.0 - x * x, -2.0 * x),
            ("0 - bend_x ^ 2", -x * x, -2.0 * x),
            ("2 * -bend_x", -2.0 * x, -2.0),
            ("1.5e-1 * bend_x", 0.15 * x, 0.15),
            ("min(bend_x, 0.3) + max(bend_x, 0.3)", 0.3 + x, 1.0),
            ("abs(0 - bend_x) + sign(bend_x)", x + 1.0, 1.0),
            ("sqrt(bend_x)", x.sqrt(), 0.5 / x.sqrt()),
            ("exp(bend_x) + ln(1 + bend_x)", x.exp() + (1.0 + x).ln(), x.exp() + 1.0 / 1.5),
            ("sin(bend_x) * cos(bend_x)", x.sin() * x.cos(), (2.0 * x).cos()),
            ("tan(bend_x)", x.tan(), 1.0 / x.cos().powi(2)),
            ("atan(bend_x)", x.atan(), 1.0 / (1.0 + x * x)),
            ("tanh(bend_x)", x.tanh(), 1.0 / x.cosh().powi(2)),
            ("cos(pi * bend_x)", (core::f64::consts::PI * x).cos(), -core::f64::consts::PI),
        ];
        for (text, value, slope) in cases {
            let found = at_half(text);
            assert!((found.value - value).abs() < 1e-14, "{text}: {} {value}", found.value);
            assert!((found.tangent[0] - slope).abs() < 1e-14, "{text}: {} {slope}", found.tangent[0]);
        }
    }

    #[test]
    fn parameters_have_slopes_too() {
        let found = at_half("a ^ 2 * bend_x");
        assert!((found.value - 0.245).abs() < 1e-15);
        assert!((found.tangent[1] - 0.7).abs() < 1e-15 && (found.tangent[0] - 0.49).abs() < 1e-15);
    }

    #[test]
    fn a_minus_before_a_power_is_refused_because_it_could_mean_two_things() {
        for text in ["-bend_x ^ 2", "3 * -bend_x^2", "-(bend_x + 1) ^ 2", "a * -sin(bend) ^ 2"] {
            let error = Formula::new(&formula(text)).unwrap_err().to_string();
            assert!(error.contains("parentheses"), "{text}: {error}");
        }
        for text in ["-(bend_x ^ 2)", "a - bend_x ^ 2", "(-bend_x) ^ 2", "-bend_x * a ^ 2"] {
            assert!(Formula::new(&formula(text)).is_ok(), "{text}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, rng_seed: RngSeed::Fixed(3), failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn no_text_makes_the_parser_panic(
            text in "[abeqx0-9.+*/^(), _{}-]{0,40}|(bend|a|sin|min|1e3|[(]|[)]|,|[-+*/^]| ){0,20}|.{0,30}"
        ) {
            let parsed = Formula::new(&formula(&text));
            prop_assert!(parsed.is_ok() || !parsed.unwrap_err().to_string().is_empty());
        }
    }
}
