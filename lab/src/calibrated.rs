//! What a calibration wrote into a model file beside what a fit to other data finds: do the two agree?

use crate::diagnose::Calibration;
use crate::save::called_in;
use crate::{Added, Measurements, fitted_to};
use krait_model::model_file::{Known, Machine, ModelFile};

/// Standard errors of both together beyond which two values are not the same.
const APART: f64 = 3.0;

/// A sentence for each fitted parameter whose value in the file came with a standard error, from other data than these, and lies too
/// far away.
pub fn disagreements(file: &ModelFile, added: &Added, data: &Measurements) -> Vec<String> {
    let (again, labels) = (fitted_to(file, data), called_in(file));
    let of_other_data = |place: usize, name: &str| {
        let label = labels.get(place).map_or("", String::as_str);
        !again.iter().any(|(effect, own)| effect == label && own == name)
    };
    let robust = |k: usize| added.uncertainty.robust.get(k).copied().unwrap_or(f64::NAN);
    let fitted = added.variables.iter().enumerate();
    fitted
        .filter(|(_, own)| of_other_data(own.effect, &own.name))
        .filter_map(|(k, own)| {
            let found = Found { value: own.value(&added.terms), se: robust(k), is_drawn: own.prior.is_some() };
            disagreement(file, own.effect, &own.name, found)
        })
        .collect()
}

/// The same of numbers of the machine, and of effects that a diagnosis freed, to whose value in the file the fit was drawn.
///
/// A fit that is drawn lies between the file and the data: value and file differ by the square root of the difference of their
/// variances, so that the distance is in standard errors of what the data alone would say.
pub fn drawn_away(file: &ModelFile, calibration: &[Calibration]) -> Vec<String> {
    calibration.iter().filter_map(|own| drawn(file, own)).collect()
}

fn drawn(file: &ModelFile, own: &Calibration) -> Option<String> {
    let (value, se) = own.prior?;
    let apart = apart(&Found { value: own.value, se: own.se, is_drawn: true }, value, se);
    if apart.is_nan() || apart <= APART {
        return None;
    }
    let joint = own.joint.map_or(String::new(), |joint| format!(" of joint {joint}"));
    let of_recording = own.recording.as_ref().map_or(String::new(), |name| format!(" in {name}"));
    let known = match file.machine() {
        Machine::Snake(snake) => Some(snake.known(&own.name)),
        _ => None,
    };
    let (from, of) = match known {
        Some(Known::Fitted { from: Some(from), date, .. }) => {
            (from.as_str(), date.as_deref().map_or(String::new(), |day| format!(" of {day}")))
        }
        _ => ("the model file", String::new()),
    };
    Some(format!(
        "{}{joint}{of_recording}: these data draw it to {:.4e} +- {:.1e} {unit}, {from}{of} said {value:.4e} +- {se:.1e} {unit}, \
         {apart:.1} standard errors apart: {}",
        own.name,
        own.value,
        own.se,
        meaning(own.name.rsplit('.').next().unwrap_or(&own.name)),
        unit = own.unit,
    ))
}

/// What a fit found of a parameter.
struct Found {
    value: f64,
    se: f64,
    /// Whether it was drawn to the file's value.
    is_drawn: bool,
}

/// Distance of a fitted value from what was known, in standard errors of their difference; NaN where the data add nothing.
fn apart(found: &Found, value: f64, se: f64) -> f64 {
    let error = if found.is_drawn { (se * se - found.se * found.se).max(0.0).sqrt() } else { se.hypot(found.se) };
    if error > 0.0 { (found.value - value).abs() / error } else { f64::NAN }
}

/// One parameter: place of its effect in the file, name, what was found.
fn disagreement(file: &ModelFile, place: usize, name: &str, found: Found) -> Option<String> {
    let effect = file.effects().get(place)?;
    let origin = effect.origin(name)?;
    let (value, se) = (effect.setting().value(name)?, origin.se?);
    let apart = apart(&found, value, se);
    if apart.is_nan() || apart <= APART {
        return None;
    }
    let Found { value: found, se: found_se, .. } = found;
    let from = origin.from.as_deref().unwrap_or("the file");
    let of = origin.date.as_deref().map_or(String::new(), |day| format!(" of {day}"));
    Some(format!(
        "{}.{name}: this fit says {found:.4e} +- {found_se:.1e}, {from}{of} said {value:.4e} +- {se:.1e}, {apart:.1} standard errors \
         apart: {}",
        called_in(file).get(place).map_or("", String::as_str),
        meaning(name)
    ))
}

/// What a disagreement points to.
fn meaning(parameter: &str) -> &'static str {
    match parameter {
        "half_width_m" => {
            "the difference is friction or the zero of a line rather than play; ask for load cells or weights, or calibrate again"
        }
        "mu" | "f_s_n" => {
            "the lines rub otherwise under the snake's loads than under weights, or have worn; calibrate friction again"
        }
        "phi_rad" => {
            "the stem lies otherwise, or mu is another there; ask for load cells in both directions (krait calibrate stem)"
        }
        _ => {
            "the machine has changed, or this fit takes a missing effect for it; krait lab diagnose may name the effect"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_three_standard_errors_away_is_named_with_both_and_their_origin() {
        let text = "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"backlash\"\n\
                    half_width_m = { value = 89e-6, se = 3e-6, from = \"play.csv\", date = \"2026-05-01\" }\n";
        let file = ModelFile::parse(text).expect("a model file");
        let of = |value, se| Found { value, se, is_drawn: false };
        let told = |found, se| disagreement(&file, 0, "half_width_m", of(found, se));
        assert_eq!(told(100e-6, 4e-6), None, "2.2 standard errors of both together");
        let sentence = told(110e-6, 4e-6).expect("4.2 standard errors");
        assert!(sentence.contains("play.csv of 2026-05-01") && sentence.contains("4.2 standard errors"), "{sentence}");
        assert!(sentence.contains("backlash.half_width_m") && sentence.contains("zero of a line"), "{sentence}");
        assert_eq!(
            disagreement(&file, 1, "half_width_m", of(1.0, 1e-9)),
            None,
            "an effect that the file does not have"
        );
        assert_eq!(told(f64::NAN, 4e-6), None);
    }

    #[test]
    fn a_number_of_the_machine_that_the_data_draw_three_standard_errors_away_is_named_too() {
        let text = "format = 1\n[machine]\nkind = \"snake\"\n\
                    phi_rad = { value = 0.7, se = 0.01, from = \"stem.csv\", date = \"2026-05-01\" }\n";
        let file = ModelFile::parse(text).expect("a model file");
        let of = |value, se| Calibration {
            name: "phi_rad".to_owned(),
            joint: None,
            recording: None,
            value,
            se,
            unit: "rad".to_owned(),
            prior: Some((0.7, 0.01)),
            is_held: false,
        };
        // Data of the file's own precision: half way between both.
        let half = 0.01 / 2_f64.sqrt();
        assert!(drawn_away(&file, &[of(0.7 + 2.9 * half, half)]).is_empty());
        let told = drawn_away(&file, &[of(0.7 + 3.1 * half, half)]);
        assert!(told[0].contains("stem.csv of 2026-05-01") && told[0].contains("3.1 standard errors"), "{told:?}");
        assert!(drawn_away(&file, &[of(0.7, 0.01)]).is_empty(), "data that say nothing");
        assert!(drawn_away(&file, &[of(0.7 + 1e-9, 0.011)]).is_empty(), "no more known than before");
        assert!(drawn_away(&file, &[Calibration { prior: None, ..of(0.9, half) }]).is_empty(), "nothing was known");
    }
}
