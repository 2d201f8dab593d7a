//! What a calibration wrote into a model file beside what a fit to other data finds: do the two agree?

use crate::{Added, Measurements, fitted_to};
use krait_model::model_file::ModelFile;

/// Standard errors of both together beyond which two values are not the same.
const APART: f64 = 3.0;

/// A sentence for each fitted parameter whose value in the file came with a standard error, from other data than these, and lies too
/// far away.
pub fn disagreements(file: &ModelFile, added: &Added, data: &Measurements) -> Vec<String> {
    let again = fitted_to(file, data);
    let of_other_data = |place: usize, name: &str| {
        let label = file.effects().get(place).map_or("", |effect| effect.setting().label());
        !again.iter().any(|(effect, own)| effect == label && own == name)
    };
    let robust = |k: usize| added.uncertainty.robust.get(k).copied().unwrap_or(f64::NAN);
    let fitted = added.variables.iter().enumerate();
    fitted
        .filter(|(_, own)| of_other_data(own.effect, &own.name))
        .filter_map(|(k, own)| disagreement(file, own.effect, &own.name, own.value(&added.terms), robust(k)))
        .collect()
}

/// One parameter: place of its effect in the file, name, fitted value and its standard error.
fn disagreement(file: &ModelFile, place: usize, name: &str, found: f64, found_se: f64) -> Option<String> {
    let effect = file.effects().get(place)?;
    let origin = effect.origin(name)?;
    let (value, se) = (effect.setting().value(name)?, origin.se?);
    let apart = (found - value).abs() / se.hypot(found_se);
    if apart.is_nan() || apart <= APART {
        return None;
    }
    let from = origin.from.as_deref().unwrap_or("the file");
    let of = origin.date.as_deref().map_or(String::new(), |day| format!(" of {day}"));
    Some(format!(
        "{}.{name}: this fit says {found:.4e} +- {found_se:.1e}, {from}{of} said {value:.4e} +- {se:.1e}, {apart:.1} standard errors \
         apart: {}",
        effect.setting().label(),
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
        let told = |found, se| disagreement(&file, 0, "half_width_m", found, se);
        assert_eq!(told(100e-6, 4e-6), None, "2.2 standard errors of both together");
        let sentence = told(110e-6, 4e-6).expect("4.2 standard errors");
        assert!(sentence.contains("play.csv of 2026-05-01") && sentence.contains("4.2 standard errors"), "{sentence}");
        assert!(sentence.contains("backlash.half_width_m") && sentence.contains("zero of a line"), "{sentence}");
        assert_eq!(disagreement(&file, 1, "half_width_m", 1.0, 1e-9), None, "an effect that the file does not have");
        assert_eq!(told(f64::NAN, 4e-6), None);
    }
}
