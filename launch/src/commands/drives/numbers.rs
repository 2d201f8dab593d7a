//! Changes one number of each actuator in the text of a configuration, and nothing else of it.

use crate::cli_drives::DrivesArgs;
use crate::commands::overwrite::{refuse_existing, write_whole};
use crate::config::Config;
use anyhow::{Context, bail};
use core::ops::Range;
use krait_slave::ActuatorConfig;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Spanned;

/// A number of an actuator's table.
pub(super) struct Number {
    key: &'static str,
    of: fn(&ActuatorConfig) -> Option<i32>,
    set: fn(&mut ActuatorConfig, i32),
}

/// Which way its counts grow.
pub(super) const SIGN: Number =
    Number { key: "sign", of: |actuator| Some(actuator.sign), set: |actuator, sign| actuator.sign = sign };

/// What its encoder reads at zero.
pub(super) const ZERO_COUNT: Number = Number {
    key: "zero_count",
    of: |actuator| actuator.zero_count,
    set: |actuator, count| actuator.zero_count = Some(count),
};

/// Refuses a file that cannot be written, before anything is moved for it.
///
/// # Errors
/// As [`refuse_existing`].
pub(super) fn refuse_out(args: &DrivesArgs) -> anyhow::Result<()> {
    args.out.as_ref().map_or(Ok(()), |out| refuse_existing(out, "toml", args.force))
}

/// Writes the configuration with these numbers, one per actuator, to `--out`, where that is named. How many are other ones than before.
///
/// # Errors
/// As [`with_numbers`] and [`refuse_existing`]; the file cannot be written.
pub(super) fn write(args: &DrivesArgs, text: &str, number: &Number, values: &[i32]) -> anyhow::Result<usize> {
    let (edited, n_changed) = with_numbers(text, number, values)?;
    if let Some(out) = &args.out {
        // Somebody may have made it meanwhile.
        refuse_out(args)?;
        write_whole(out, edited)
            .with_context(|| format!("{} could not be written; name a file in a folder of yours", out.display()))?;
    }
    Ok(n_changed)
}

/// What a person reads of that; `names` is what such numbers are called.
pub(super) fn sentence(out: Option<&Path>, n_changed: usize, names: &str) -> String {
    match (out.map(Path::display), n_changed) {
        (Some(out), 0) => format!("All {names} are as configured; {out} is written, as the configuration was.\n"),
        (Some(out), _) => {
            format!("{out} is written: the configuration with {n_changed} of its {names} changed and nothing else.\n")
        }
        (None, 0) => format!("All {names} are as configured.\n"),
        (None, _) => format!("{n_changed} of the {names} to change; --out FILE writes the configuration with them.\n"),
    }
}

/// The part of a configuration that is changed.
#[derive(Deserialize)]
struct Places {
    slave: SlavePlaces,
}

#[derive(Deserialize)]
struct SlavePlaces {
    drive: DrivePlaces,
}

#[derive(Deserialize)]
struct DrivePlaces {
    actuator: Vec<BTreeMap<String, Spanned<toml::Value>>>,
}

/// The text with these numbers, one per actuator, and how many are other ones than before; comments and order stay. A number that is not
/// there and need not be is not added.
///
/// # Errors
/// One sentence where the text has no place for a number.
fn with_numbers(text: &str, number: &Number, values: &[i32]) -> anyhow::Result<(String, usize)> {
    let Number { key, of, set } = number;
    let (mut wanted, mut n_changed) = (Config::parse(text)?, 0);
    let places: Places = toml::from_str(text)?;
    let mut edited = text.to_owned();
    // From the end, so that the places before stay.
    for (k, (place, value)) in places.slave.drive.actuator.iter().zip(values).enumerate().rev() {
        let known = &mut wanted.slave.drive.actuator[k];
        if of(known) == Some(*value) {
            continue;
        }
        set(known, *value);
        n_changed += 1;
        let ways: Vec<(Range<usize>, String)> = match (place.get(*key), place.get("id")) {
            (Some(old), _) => vec![(old.span(), value.to_string())],
            // A line of its own before the id, or in braces behind it.
            (None, Some(id)) => {
                let line = edited[..id.span().start].rfind('\n').map_or(0, |end| end + 1);
                let indent: String = edited[line..].chars().take_while(|c| matches!(c, ' ' | '\t')).collect();
                vec![
                    (line..line, format!("{indent}{key} = {value}\n")),
                    (id.span().end..id.span().end, format!(", {key} = {value}")),
                ]
            }
            (None, None) => Vec::new(),
        };
        let tried = ways.into_iter().map(|(range, new)| {
            let mut text = edited.clone();
            text.replace_range(range, &new);
            text
        });
        // However the table is written: the text must say what is wanted, and otherwise what it said.
        let mut fitting = tried.filter(|text| Config::parse(text).is_ok_and(|config| config == wanted));
        let Some(text) = fitting.next() else {
            bail!(
                "actuator {}: no place for `{key} = {value}` was found in the configuration; write it into its table",
                k + 1
            )
        };
        edited = text;
    }
    Ok((edited, n_changed))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_signs(text: &str, signs: &[i32]) -> anyhow::Result<String> {
        with_numbers(text, &SIGN, signs).map(|(text, _)| text)
    }

    #[test]
    fn only_the_signs_change_wherever_they_stand_and_comments_stay() {
        let head = "# mine\n[slave.drive]  # servos\nkind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        let tables = "\n[[slave.drive.actuator]]\nid = 1 # left\nsign = 1   # as wound\n\n[[slave.drive.actuator]]\n  \
                      id = 2 # right\n\n[[slave.drive.actuator]]\nsign = -1\nid = 3\n";
        let edited = with_signs(&format!("{head}{tables}"), &[-1, -1, -1]).unwrap();
        let wanted = tables.replace("sign = 1 ", "sign = -1 ").replace("  id = 2", "  sign = -1\n  id = 2");
        assert_eq!(edited, format!("{head}{wanted}"));
        assert_eq!(with_signs(&edited, &[-1, -1, -1]).unwrap(), edited);

        let braces = format!("{head}actuator = [{{ id = 1 }}, {{ id = 2, sign = -1 }}] # two\n");
        let edited = with_signs(&braces, &[-1, 1]).unwrap();
        assert_eq!(edited, braces.replace("id = 1 }", "id = 1, sign = -1 }").replace("2, sign = -1", "2, sign = 1"));

        let nowhere = format!("{head}[[slave.drive.actuator]]\n");
        let sentence = with_signs(&nowhere, &[-1]).unwrap_err().to_string();
        assert!(sentence.contains("actuator 1: no place for `sign = -1`"), "{sentence}");
    }
    #[test]
    fn zeros_are_put_where_they_stand_or_before_the_id_and_counted() {
        let head = "[slave.drive]\nkind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        let tables = "[[slave.drive.actuator]]\nid = 1 # left\nzero_count = 2_048 # straight\n\n[[slave.drive.actuator]]\n\
                      id = 2 # right\n[[slave.drive.actuator]]\nzero_count = 2100\nid = 3\n";
        let (edited, n_changed) = with_numbers(&format!("{head}{tables}"), &ZERO_COUNT, &[2000, 2050, 2100]).unwrap();
        let wanted = tables.replace("2_048 #", "2000 #").replace("id = 2", "zero_count = 2050\nid = 2");
        assert_eq!((edited, n_changed), (format!("{head}{wanted}"), 2));
        let (same, n_changed) = with_numbers(&format!("{head}{wanted}"), &ZERO_COUNT, &[2000, 2050, 2100]).unwrap();
        assert_eq!((same, n_changed), (format!("{head}{wanted}"), 0));
    }
}
