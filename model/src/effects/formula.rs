//! Effects that a user writes: a formula of shape, loads and columns that adds to a hook.
//!
//! Text is parsed by the library exmex over numbers with a tangent for each name that varies, so that one evaluation gives the
//! value and its derivative with respect to each of them; what holds still costs nothing. Only the operators listed here exist: a formula
//! can do nothing but arithmetic. Evaluation works on the stack as long as the formula is not longer than what is accepted.

use super::definition::{Class, Definition, Hook, effect};
use super::formula_error::FormulaError;
use super::formula_operators::{Expression, FORMULA_FUNCTIONS};
use super::formula_variables::{
    ALL_HOOKS, COLUMNS, FORCE, FORMULA_VARIABLES, JOINT, STEM_ANGLE, TEMPERATURE, TIME, Values,
};
use super::prepared::MAX_PARAMETERS;
use super::real::{Dual, Real, Scalar};
use super::varying::FormulaColumn;
use exmex::prelude::*;

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
    /// Names that stand for columns; of joints alone.
    pub columns: Vec<FormulaColumn>,
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

/// What a name in the expression stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Variable(usize),
    Parameter(usize),
    /// By its place in the formula's own list.
    Column(usize),
}

/// Names that vary where a chain is inverted: a load, or the two components of a bend.
const FEW_NAMES: usize = 2;

/// A parsed formula. The same expression stands there for values with no tangent, few, and as many as there may be names.
#[derive(Clone, Debug)]
pub(crate) struct Formula {
    pub hook: Hook,
    plain: Expression<0>,
    few: Expression<FEW_NAMES>,
    all: Expression<MAX_FORMULA_NAMES>,
    names: Vec<Meaning>,
    /// Place of each of its columns among those of the model.
    places: Vec<usize>,
}

impl Formula {
    /// Parses and checks a snake's: known names only, not too long, finite over the machine's workspace.
    pub(crate) fn new(formula: &FormulaText) -> Result<Self, FormulaError> {
        match formula.columns.first() {
            Some(own) => Err(FormulaError::Column { formula: formula.name.clone(), name: own.name.clone() }),
            None => Self::at(formula, ALL_HOOKS),
        }
    }

    /// The same for joints; `place` says where a column stands among those of the model.
    pub(crate) fn for_joints(formula: &FormulaText, place: impl Fn(&str) -> usize) -> Result<Self, FormulaError> {
        let places = formula.columns.iter().map(|own| place(&own.column)).collect();
        Ok(Self { places, ..Self::at(formula, JOINT)? })
    }

    /// The same for whichever machine has its hook; places of columns are those in its own list.
    pub(crate) fn of_any_machine(formula: &FormulaText) -> Result<Self, FormulaError> {
        let hooks = match formula.hook {
            Hook::Joint => JOINT,
            Hook::Force => FORCE,
            _ => ALL_HOOKS,
        };
        Ok(Self { places: (0..formula.columns.len()).collect(), ..Self::at(formula, hooks)? })
    }

    fn at(formula: &FormulaText, hooks: &[Hook]) -> Result<Self, FormulaError> {
        let name = || formula.name.clone();
        if !hooks.contains(&formula.hook) {
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
        let own_names =
            || formula.parameters.iter().map(|p| &p.name).chain(formula.columns.iter().map(|own| &own.name));
        let is_twice = |name: &String| own_names().filter(|own| *own == name).count() > 1;
        if let Some(bad) = own_names().find(|name| !is_free_word(name) || is_twice(name)) {
            return Err(FormulaError::ParameterName { formula: name(), name: bad.clone() });
        }
        if let Some(word) = words(&formula.text).find(|word| is_name(word) && !is_known(formula, word)) {
            return Err(FormulaError::unknown_name(formula, word));
        }
        if let Some(reason) = refused_text(&formula.text) {
            return Err(FormulaError::Syntax { formula: name(), reason: reason.to_owned() });
        }
        let parsed = Self::parsed(formula)?;
        let found = parsed.names.len();
        if found > MAX_FORMULA_NAMES {
            return Err(FormulaError::TooManyNames { formula: name(), found, limit: MAX_FORMULA_NAMES });
        }
        parsed.check_finite(formula)?;
        Ok(parsed)
    }

    fn parsed(formula: &FormulaText) -> Result<Self, FormulaError> {
        let all = parse::<MAX_FORMULA_NAMES>(formula)?;
        let names = all.var_names().iter().map(|word| meaning(formula, word)).collect::<Result<_, _>>()?;
        let places = vec![0; formula.columns.len()];
        Ok(Self { hook: formula.hook, plain: parse(formula)?, few: parse(formula)?, all, names, places })
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
        let own = self.own(values, |k| S::lift(parameters[k]));
        let own = own.get(..self.names.len())?;
        match own.iter().filter(|own| varies(**own)).count() {
            0 => sum(&self.plain, own),
            1..=FEW_NAMES => sum(&self.few, own),
            _ => sum(&self.all, own),
        }
    }

    /// What the names stand for.
    fn own<S: Real>(&self, values: &Values<S>, parameter: impl Fn(usize) -> S) -> [S; MAX_FORMULA_NAMES] {
        let mut all = [S::constant(0.0); MAX_FORMULA_NAMES];
        for (own, name) in all.iter_mut().zip(&self.names) {
            *own = match *name {
                Meaning::Variable(k) => values[k],
                Meaning::Parameter(k) => parameter(k),
                Meaning::Column(k) => values[COLUMNS + self.places[k]],
            };
        }
        all
    }

    /// Evaluates on a grid of the workspace, with the slope by every name.
    fn check_finite(&self, formula: &FormulaText) -> Result<(), FormulaError> {
        let mut parameters = [0.0; MAX_PARAMETERS];
        for (own, given) in parameters.iter_mut().zip(&formula.parameters) {
            *own = given.value;
        }
        for (values, bend_rad, delta_rad) in workspace() {
            let mut own = self.own(&values, |k| parameters[k]).map(Dual::<MAX_FORMULA_NAMES>::constant);
            own.iter_mut().enumerate().for_each(|(k, own)| *own = Dual::seed(own.value, k));
            if sum(&self.all, own.get(..self.names.len()).unwrap_or(&own)).is_none() {
                let (formula, text) = (formula.name.clone(), formula.text.clone());
                return Err(FormulaError::NotFinite { formula, text, bend_rad, delta_rad });
            }
        }
        Ok(())
    }
}

/// Values of all variables over a grid of the workspace, each with its bend and plane, rad.
pub(super) fn workspace() -> impl Iterator<Item = (Values<f64>, f64, f64)> {
    const BENDS: [f64; 6] = [0.0, 1e-9, 0.1, 0.5, 1.0, 1.57];
    const DELTAS: [f64; 5] = [-2.6, -1.1, 0.0, 0.8, 2.1];
    let poses = BENDS.into_iter().flat_map(|bend| DELTAS.into_iter().map(move |delta| (bend, delta)));
    poses.flat_map(|(bend, delta)| {
        [-1.0, 0.0, 1.0].into_iter().map(move |sign: f64| {
            let (x, y) = (bend * delta.cos(), bend * delta.sin());
            let (q, tau) = (sign * 1.684e-3 * bend, sign * 20.0 * bend);
            let values = [
                bend,
                delta,
                x,
                y,
                q,
                q,
                q,
                q,
                tau,
                sign,
                q,
                0.0,
                1.0 + sign.abs(),
                2.0 + sign,
                10.0 * bend,
                sign,
                25.0,
                x,
                y,
                sign,
                1.0,
                x,
                10.0 * y,
                100.0 * x,
                tau,
                q,
                sign,
                bend,
                x,
            ];
            (values, bend, delta)
        })
    })
}

fn parse<const K: usize>(formula: &FormulaText) -> Result<Expression<K>, FormulaError> {
    let syntax = |reason: &str| FormulaError::Syntax { formula: formula.name.clone(), reason: reason.to_owned() };
    Expression::parse(&formula.text).map_err(|error| syntax(error.msg()))
}

/// Whether a value has a tangent that is not zero.
fn varies<S: Real>(own: S) -> bool {
    S::HAS_TANGENTS && own != S::constant(own.value())
}

/// An expression's value where its names are these, of which no more than K may vary; `None` where it is not finite.
fn sum<S: Real, const K: usize>(expression: &Expression<K>, own: &[S]) -> Option<S> {
    let mut lanes = [Dual::<K>::default(); MAX_FORMULA_NAMES];
    let mut n = 0;
    for (lane, own) in lanes.iter_mut().zip(own) {
        *lane = Dual::constant(own.value());
        if varies(*own) {
            *lane = Dual::seed(own.value(), n);
            n += 1;
        }
    }
    let found = expression.eval(lanes.get(..own.len())?).ok()?;
    if !(found.value.is_finite() && found.tangent.iter().all(|slope| slope.is_finite())) {
        return None;
    }
    let mut sum = S::constant(found.value);
    for (own, slope) in own.iter().filter(|own| varies(**own)).zip(found.tangent) {
        sum += (*own - S::constant(own.value())) * S::constant(slope);
    }
    Some(sum)
}

fn meaning(formula: &FormulaText, word: &str) -> Result<Meaning, FormulaError> {
    if let Some(k) = formula.parameters.iter().position(|p| p.name == word) {
        return Ok(Meaning::Parameter(k));
    }
    if let Some(k) = formula.columns.iter().position(|own| own.name == word) {
        return Ok(Meaning::Column(k));
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
        || formula.columns.iter().any(|own| own.name == word)
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

/// Whether a parameter or a column of a formula may be called so.
pub fn is_free_word(name: &str) -> bool {
    let word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let starts = name.starts_with(|c: char| c.is_ascii_alphabetic());
    word && starts
        && name != "pi"
        && !FORMULA_FUNCTIONS.contains(&name)
        && FORMULA_VARIABLES.iter().all(|v| v.name != name)
}

#[cfg(test)]
mod tests {
    use super::super::real::Dual;
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn formula(text: &str) -> FormulaText {
        let parameters = vec![FormulaParameter { name: "a".to_owned(), value: 0.7, unit: "1".to_owned() }];
        FormulaText { name: "f".to_owned(), hook: Hook::Eps, text: text.to_owned(), parameters, columns: Vec::new() }
    }

    /// Value and tangents by (bend_x, a) at bend_x 0.5 and a 0.7.
    fn at_half(text: &str) -> Dual<2> {
        let mut values: Values<Dual<2>> = [Dual::constant(0.2); _];
        values[2] = Dual::seed(0.5, 0);
        // Not a formula of the chain: the square root below has no slope at the straight pose.
        Formula::parsed(&formula(text)).unwrap().evaluate(&values, &[Dual::seed(0.7, 1)]).unwrap()
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
