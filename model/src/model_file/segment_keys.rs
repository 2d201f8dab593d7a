//! The keys of a machine of segments: one list that reading, writing and "assumed" share, so that none of them forgets a key.

use super::machine::NumberKey;
use crate::MachineParameters;
use crate::segments::{SegmentParameters, SegmentsParameters};

/// The numbers under `[machine]`; ranges are in [`SegmentsParameters::check`].
pub(super) const WHOLE_KEYS: [NumberKey<SegmentsParameters>; 6] = [
    NumberKey {
        name: "phi_rad",
        doc: "rad, 0 to pi: angle of each of the cone's two arcs",
        get: |m| m.phi_rad,
        set: |m, v| m.phi_rad = v,
    },
    NumberKey {
        name: "preload_n",
        doc: "N, -200 to 200, push positive: load that every line would have by itself; what of it bends nothing is kept",
        get: |m| m.preload_n,
        set: |m, v| m.preload_n = v,
    },
    NumberKey {
        name: "low_n",
        doc: "N, -inf to high_n and at most 200: smallest load of a line at the snake; -inf: none",
        get: |m| m.low_n,
        set: |m, v| m.low_n = v,
    },
    NumberKey {
        name: "high_n",
        doc: "N, -200 to inf: largest load of a line at the snake; inf: none; below zero for wires, which only pull",
        get: |m| m.high_n,
        set: |m, v| m.high_n = v,
    },
    NumberKey {
        name: "strain_limit",
        doc: "1, 0.001 to 0.08: strain of the outer fibre (d_outer/2) b / L beyond which no shape is planned",
        get: |m| m.settings.strain_limit,
        set: |m, v| m.settings.strain_limit = v,
    },
    NumberKey {
        name: "transition_m",
        doc: "m, 1e-9 to 0.001: travel over which a line's sign of motion turns in the compensator",
        get: |m| m.settings.transition_m,
        set: |m, v| m.settings.transition_m = v,
    },
];

/// The numbers under each `[[machine.segment]]`, without those of its lines.
pub(super) const SEGMENT_KEYS: [NumberKey<SegmentParameters>; 6] = [
    NumberKey {
        name: "l_m",
        doc: "m, 0.005 to 0.5, more than pi times the largest r_m that runs in it: primary backbone, disk to disk",
        get: |s| s.l_m,
        set: |s, v| s.l_m = v,
    },
    NumberKey {
        name: "e_pa",
        doc: "Pa, 1e9 to 4e11: Young's modulus of its primary backbone and of its lines, along their whole length",
        get: |s| s.e_pa,
        set: |s, v| s.e_pa = v,
    },
    NumberKey {
        name: "d_outer_m",
        doc: "m, 0.00005 to 0.005: outer diameter of these backbones",
        get: |s| s.d_outer_m,
        set: |s, v| s.d_outer_m = v,
    },
    NumberKey {
        name: "d_inner_m",
        doc: "m, 0 to 0.99 d_outer_m: inner diameter",
        get: |s| s.d_inner_m,
        set: |s, v| s.d_inner_m = v,
    },
    NumberKey {
        name: "l_d_m",
        doc: "m, 0.001 to 10: length of its lines in the holder",
        get: |s| s.l_d_m,
        set: |s, v| s.l_d_m = v,
    },
    NumberKey {
        name: "l_c_m",
        doc: "m, 0.001 to 10: length of its lines in the cone",
        get: |s| s.l_c_m,
        set: |s, v| s.l_c_m = v,
    },
];

/// What `azimuth_deg` says.
pub(super) const AZIMUTH_DOC: &str =
    "deg, -360 to 360, one for each line that ends at this segment's disk; 2 or more, 3 to 12 in all";
/// What `r_m` says.
pub(super) const RADIUS_DOC: &str =
    "m, 0.0003 to 0.02: distance of its lines from the primary backbone, one number or one for each";

/// Radius of a line where the file leaves it out, m: the paper's.
pub(super) fn default_radius_m() -> f64 {
    MachineParameters::default().r_m
}

/// A segment as a file begins with that says nothing about it: the paper's dimensions, no lines yet.
pub(super) fn default_segment() -> SegmentParameters {
    SegmentParameters::of_table_i(&[])
}

/// The degrees that read back as exactly these radians, with the shortest text where several do.
pub(super) fn degrees(azimuth_rad: f64) -> f64 {
    let near = azimuth_rad.to_degrees();
    let round = (near * 1e9).round() / 1e9;
    let neighbours = [near, near.next_up(), near.next_down(), near.next_up().next_up(), near.next_down().next_down()];
    let exact = [round].into_iter().chain(neighbours).find(|own| own.to_radians() == azimuth_rad);
    exact.unwrap_or(near)
}

/// Azimuths that a file can say: to the last digit that degrees can hold.
pub(super) fn sayable(mut machine: SegmentsParameters) -> SegmentsParameters {
    for line in machine.segments.iter_mut().flat_map(|segment| &mut segment.lines) {
        line.azimuth_rad = degrees(line.azimuth_rad).to_radians();
    }
    machine
}

#[cfg(test)]
mod tests {
    use super::degrees;

    #[test]
    fn whole_and_broken_degrees_come_back_as_they_were() {
        for tenth in -3600..=3600 {
            let own = f64::from(tenth) / 10.0;
            assert_eq!(degrees(own.to_radians()).to_bits() << 1, own.to_bits() << 1, "{own}");
        }
    }

    #[test]
    fn what_was_said_once_is_said_again() {
        let mut rad = -6.0_f64;
        while rad < 6.0 {
            let said = degrees(rad).to_radians();
            assert_eq!(degrees(said).to_radians(), said);
            rad += 0.000_731;
        }
    }
}
