//! A machine of segments as text that reads back as the same machine, with or without what each key means.

use super::machine::NumberKey;
use super::segment_keys::{
    AZIMUTH_DOC, RADIUS_DOC, SEGMENT_KEYS, WHOLE_KEYS, default_radius_m, default_segment, degrees,
};
use super::write::{Out, number, numbers};
use crate::segments::SegmentsParameters;

/// Writes the machine behind the line `[machine]`.
pub(super) fn segments(out: &mut Out, machine: &SegmentsParameters) {
    out.line(
        "kind = \"segments\"",
        "1 to 3 snakes in series, each line ends at one of them and passes those before it",
    );
    out.lines(machine.rigid_lines);
    keys(out, &WHOLE_KEYS, machine, &SegmentsParameters::default());
    for segment in &machine.segments {
        out.line("\n[[machine.segment]]", "from the base on");
        let azimuths_deg: Vec<f64> = segment.lines.iter().map(|line| degrees(line.azimuth_rad)).collect();
        out.line(&format!("azimuth_deg = {}", numbers(&azimuths_deg)), AZIMUTH_DOC);
        let radii_m: Vec<f64> = segment.lines.iter().map(|line| line.radius_m).collect();
        let radius = match radii_m.split_first() {
            Some((first, others)) if others.iter().all(|own| own == first) => number(*first),
            _ => numbers(&radii_m),
        };
        out.line(&format!("r_m = {radius}"), &format!("{RADIUS_DOC}; default {}", number(default_radius_m())));
        keys(out, &SEGMENT_KEYS, segment, &default_segment());
    }
}

fn keys<T>(out: &mut Out, keys: &[NumberKey<T>], own: &T, without: &T) {
    for key in keys {
        let default = number((key.get)(without));
        out.line(&format!("{} = {}", key.name, number((key.get)(own))), &format!("{}; default {default}", key.doc));
    }
}
