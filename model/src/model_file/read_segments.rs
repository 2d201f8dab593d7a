//! `[machine]` of kind segments, from text: the whole, and one `[[machine.segment]]` after the other from the base on.

use super::ModelFileError;
use super::machine::NumberKey;
use super::read::{Section, as_number, count};
use super::segment_keys::{SEGMENT_KEYS, WHOLE_KEYS, default_radius_m, default_segment};
use crate::ChainError;
use crate::segments::{LineParameters, SegmentParameters, Segments, SegmentsParameters};

/// Reads and checks the machine.
pub(super) fn segments(section: &Section) -> Result<SegmentsParameters, ModelFileError> {
    let mut known = vec!["kind", "lines", "segment"];
    known.extend(WHOLE_KEYS.iter().map(|key| key.name));
    section.only(&known)?;
    let mut machine = SegmentsParameters { rigid_lines: section.rigid_lines()?, ..SegmentsParameters::default() };
    numbers(section, &WHOLE_KEYS, &mut machine)?;
    let sections = section.sections("segment")?;
    machine.segments = sections.iter().map(segment).collect::<Result<_, _>>()?;
    Segments::new(&machine).map_err(|source| {
        let own = source.segment().and_then(|number| sections.get(number - 1)).unwrap_or(section);
        ModelFileError::Chain { line: own.line_of_key(source.key()), source: ChainError::Segments(source) }
    })?;
    Ok(machine)
}

fn segment(section: &Section) -> Result<SegmentParameters, ModelFileError> {
    let mut known = vec!["azimuth_deg", "r_m"];
    known.extend(SEGMENT_KEYS.iter().map(|key| key.name));
    section.only(&known)?;
    let mut segment = default_segment();
    numbers(section, &SEGMENT_KEYS, &mut segment)?;
    let azimuths_deg = section.get("azimuth_deg").ok_or_else(|| {
        section.missing("azimuth_deg", "the azimuths of the lines that end at this segment, as [0, 120, 240]")
    })?;
    let azimuths_deg = section.all_numbers("azimuth_deg", azimuths_deg)?;
    let radii_m = match section.get("r_m") {
        None => vec![default_radius_m(); azimuths_deg.len()],
        Some(value) => match as_number(value.get_ref()) {
            Some(radius_m) => vec![radius_m; azimuths_deg.len()],
            None => {
                let radii_m = section.all_numbers("r_m", value)?;
                count(section.line_at(value), "r_m", radii_m.len(), azimuths_deg.len())?;
                radii_m
            }
        },
    };
    let lines = azimuths_deg.iter().zip(radii_m);
    let line =
        |(azimuth_deg, radius_m): (&f64, f64)| LineParameters { azimuth_rad: azimuth_deg.to_radians(), radius_m };
    segment.lines = lines.map(line).collect();
    Ok(segment)
}

fn numbers<T>(section: &Section, keys: &[NumberKey<T>], own: &mut T) -> Result<(), ModelFileError> {
    for key in keys {
        if let Some(given) = section.number(key.name)? {
            (key.set)(own, given.value);
        }
    }
    Ok(())
}
