//! Changes the signs of actuators in the text of a configuration, and nothing else of it.

use crate::config::Config;
use anyhow::bail;
use core::ops::Range;
use serde::Deserialize;
use toml::Spanned;

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
    actuator: Vec<ActuatorPlaces>,
}

#[derive(Deserialize)]
struct ActuatorPlaces {
    id: Option<Spanned<u32>>,
    sign: Option<Spanned<i32>>,
}

/// The text with these signs, one per actuator; comments and order stay. A sign that is not there and need not be is not added.
///
/// # Errors
/// One sentence where the text has no place for a sign.
pub(super) fn with_signs(text: &str, signs: &[i32]) -> anyhow::Result<String> {
    let mut wanted = Config::parse(text)?;
    let places: Places = toml::from_str(text)?;
    let mut edited = text.to_owned();
    // From the end, so that the places before stay.
    for (k, (place, sign)) in places.slave.drive.actuator.iter().zip(signs).enumerate().rev() {
        let known = &mut wanted.slave.drive.actuator[k].sign;
        if core::mem::replace(known, *sign) == *sign {
            continue;
        }
        let ways: Vec<(Range<usize>, String)> = match (&place.sign, &place.id) {
            (Some(old), _) => vec![(old.span(), sign.to_string())],
            // A line of its own before the id, or in braces behind it.
            (None, Some(id)) => {
                let line = edited[..id.span().start].rfind('\n').map_or(0, |end| end + 1);
                let indent: String = edited[line..].chars().take_while(|c| matches!(c, ' ' | '\t')).collect();
                vec![
                    (line..line, format!("{indent}sign = {sign}\n")),
                    (id.span().end..id.span().end, format!(", sign = {sign}")),
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
                "actuator {}: no place for `sign = {sign}` was found in the configuration; write it into its table",
                k + 1
            )
        };
        edited = text;
    }
    Ok(edited)
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
