//! The verdict for someone who works with the machine and not with its model: what, how much, where, how sure.

use crate::diagnose::{Diagnosis, FoundEffect, Verdict};
use crate::measurements::Names;
use krait_model::effects::explanation;

/// The verdict in plain words.
pub(super) fn plain(diagnosis: &Diagnosis, names: &Names) -> String {
    let unit = &diagnosis.unit;
    let before = diagnosis.base_heldout_rms;
    let floor = match diagnosis.noise_floor {
        Some(floor) => format!("{floor:.3} {unit} of that is noise of the measurement"),
        None => "how much of that is noise of the measurement is not known".to_owned(),
    };
    let off = format!("The model is off by {before:.3} {unit} in the mean; {floor}.");
    let after = format!("{:.3} {unit}", diagnosis.final_heldout_rms);
    match diagnosis.verdict {
        Verdict::None => format!("The model fits the machine. {off} Nothing is left to correct."),
        Verdict::Missing => format!(
            "The model lacks {}. {off} With it taken into account {after} remain. {}",
            causes(&diagnosis.effects, names),
            sure(&diagnosis.effects)
        ),
        Verdict::Partly => format!(
            "The model lacks {}, and something else that was not found. {off} With what was found taken into account {after} remain. {}",
            causes(&diagnosis.effects, names),
            sure(&diagnosis.effects)
        ),
        Verdict::Unknown => format!("The model does not fit the machine, and why was not found. {off}"),
        Verdict::TooShort => format!("The recording is too short to say what is wrong. {off}"),
    }
}

/// The effects as people call them, with size, place and look-alikes.
fn causes(effects: &[FoundEffect], names: &Names) -> String {
    let title = |name: &str| explanation(name).map_or_else(|| name.to_owned(), |own| own.title.to_owned());
    let one = |effect: &FoundEffect| {
        let place = effect.joint.map_or(String::new(), |joint| format!(" at {}", names.joint(joint)));
        let others: Vec<String> = effect.class.iter().skip(1).map(|name| format!("\"{}\"", title(name))).collect();
        let alike = match others.len() {
            0 => String::new(),
            _ => format!(" (or {}: these data cannot tell)", others.join(" or ")),
        };
        let own = effect.title().unwrap_or_else(|| effect.name.clone());
        format!("\"{own}\"{place}{alike}")
    };
    effects.iter().map(one).collect::<Vec<_>>().join(" and ")
}

fn sure(effects: &[FoundEffect]) -> String {
    let least = effects.iter().map(|own| own.probability).fold(1.0, f64::min);
    if least > 0.99 {
        "This is sure to more than 99 %.".to_owned()
    } else {
        format!("This is sure to {:.0} %.", 100.0 * least)
    }
}
