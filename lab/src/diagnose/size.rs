//! How large an effect is, in words that stand behind its name or its title: headline, report and page say the same.

use super::answer::FoundEffect;
use krait_model::effects::explanation;

/// Parameters that are the effect itself: a title says what they are.
const SAID_BY_TITLE: [&str; 8] = ["clearance", "delay", "f_c", "f_s", "k", "moment", "offset", "torque"];

impl FoundEffect {
    /// Its size, as the first of the parameters that were fitted tells it; `None` where none was.
    pub(crate) fn size(&self) -> Option<String> {
        self.parameters.iter().find(|own| own.is_free).map(|own| in_words(&own.name, &own.unit, own.value))
    }

    /// What people call it, with its size ("play: 0.180 mm in all"); `None` for a formula of one's own.
    pub fn title(&self) -> Option<String> {
        with_size(&self.name, self.size())
    }
}

/// What people call an effect of this name, with a parameter of it as its size: name, unit and value; `None` for a formula of one's own.
pub fn titled(effect: &str, parameter: Option<(&str, &str, f64)>) -> Option<String> {
    with_size(effect, parameter.map(|(name, unit, value)| in_words(name, unit, value)))
}

fn with_size(effect: &str, size: Option<String>) -> Option<String> {
    let title = explanation(effect)?.title;
    Some(size.map_or_else(|| title.to_owned(), |size| format!("{title}: {size}")))
}

/// A parameter in the unit that people think in.
fn in_words(name: &str, unit: &str, value: f64) -> String {
    let with_unit = |value: f64| match unit {
        "rad" => format!("{} deg", three_digits(value.to_degrees())),
        "m" => format!("{} mm", three_digits(1e3 * value)),
        "1" => three_digits(value),
        other => format!("{} {other}", three_digits(value)),
    };
    match without_unit(name) {
        "" => with_unit(value),
        "half_width" => format!("{} in all", with_unit(2.0 * value)),
        "eta" => {
            let word = if value < 1.0 { "softer" } else { "stiffer" };
            format!("{} % {word}", three_digits(100.0 * (value - 1.0).abs()))
        }
        "relative" | "scale" => {
            let sign = if value < 0.0 { "-" } else { "+" };
            format!("{sign}{} %", three_digits(100.0 * value.abs()))
        }
        bare if SAID_BY_TITLE.contains(&bare) => with_unit(value),
        bare => format!("{} {}", bare.replace('_', " "), with_unit(value)),
    }
}

/// A parameter's name without its unit: the number has one behind it. One that is a unit and no more is nothing.
fn without_unit(name: &str) -> &str {
    if let Some((front, _)) = name.split_once("_per_") {
        return front.rsplit_once('_').map_or("", |(own, _)| own);
    }
    ["_m", "_rad", "_s", "_n", "_nm"].iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name)
}

/// A number with three digits that count.
fn three_digits(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !(1e-3..1e4).contains(&size) {
        return if value == 0.0 { "0".to_owned() } else { format!("{value:.2e}") };
    }
    let behind_point = (2.0 - size.log10().floor()).max(0.0) as usize;
    format!("{value:.behind_point$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::answer::FoundParameter;

    fn found(name: &str, parameters: &[(&str, f64, &str, bool)]) -> FoundEffect {
        let parameter = |&(name, value, unit, is_free): &(&str, f64, &str, bool)| FoundParameter {
            name: name.to_owned(),
            unit: unit.to_owned(),
            value,
            se: 0.0,
            se_naive: 0.0,
            is_free,
            on_bound: false,
        };
        FoundEffect {
            name: name.to_owned(),
            class: vec![name.to_owned()],
            before: 1.0,
            after: 0.5,
            probability: 1.0,
            parameters: parameters.iter().map(parameter).collect(),
            joint: None,
            sketch: None,
        }
    }

    #[test]
    fn a_title_carries_its_size_in_a_unit_that_people_think_in() {
        for (name, parameter, said) in [
            ("backlash", ("half_width_m", 0.9e-4, "m"), "play: 0.180 mm in all"),
            ("backlash-2", ("half_width_m", 0.9e-4, "m"), "play: 0.180 mm in all"),
            ("backlash", ("half_width", 0.6, "deg"), "play: 1.20 deg in all"),
            ("backlash", ("half_width", 0.01, "rad"), "play: 1.15 deg in all"),
            ("stiffness-scale", ("eta", 0.79, "1"), "stiffness is another: 21.0 % softer"),
            ("stiffness-scale", ("eta", 1.22, "1"), "stiffness is another: 22.0 % stiffer"),
            ("radius-error", ("relative", -0.02, "1"), "lines lie at another radius: -2.00 %"),
            ("static-friction", ("f_s_n", 1.959, "N"), "static friction: 1.96 N"),
            ("latency", ("delay_s", 0.012, "s"), "delay: 0.0120 s"),
            ("cone-friction", ("mu", 0.1727, "1"), "friction round a bend of the line: mu 0.173"),
            ("twist", ("rad_per_rad", 0.0437, "rad/rad"), "the snake twists: 0.0437 rad/rad"),
            ("actuator-compliance", ("compliance_m_per_n", 5.986e-6, "m/N"), "drives give way: compliance 5.99e-6 m/N"),
        ] {
            let (key, value, unit) = parameter;
            let parameters = [("joint", 2.0, "1", false), (key, value, unit, true)];
            assert_eq!(found(name, &parameters).title().as_deref(), Some(said), "{name}");
        }
    }

    #[test]
    fn what_was_not_fitted_has_no_size_and_a_formula_no_title() {
        assert_eq!(found("backlash", &[("half_width_m", 0.9e-4, "m", false)]).title().as_deref(), Some("play"));
        assert_eq!(found("my-own", &[("k", 1.0, "1", true)]).title(), None);
    }
}
