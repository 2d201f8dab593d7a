//! The part of a profile that says what the device shows: which light is for what, and what it rumbles for. Read from TOML, checked once.

use crate::LightRole;
use crate::evdev_names::{light_code, light_name};
use crate::profile_axis::{Wrong, wrong};
use serde::Deserialize;

/// Weakest and strongest rumble, as a part of the most that the device can: what is weaker is not felt.
const STRENGTHS: core::ops::RangeInclusive<f64> = 0.05..=1.0;

/// The table of lights that are for one thing each.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReadLights {
    engaged: Option<String>,
    limit: Option<String>,
    fault: Option<String>,
    load: Option<String>,
    compensation: Option<String>,
}

/// The table of what it rumbles for.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReadRumble {
    limit: Option<f64>,
    fault: Option<f64>,
    load: Option<f64>,
    compensation: Option<f64>,
}

impl ReadLights {
    /// What lights are for; `light` is the one for everything.
    pub(crate) fn checked(&self, light: &Option<String>) -> Result<Vec<(LightRole, u16)>, Wrong> {
        let Self { engaged, limit, fault, load, compensation } = self;
        let named = [
            ("light", LightRole::All, light),
            ("lights.engaged", LightRole::Engaged, engaged),
            ("lights.limit", LightRole::Limit, limit),
            ("lights.fault", LightRole::Fault, fault),
            ("lights.load", LightRole::Load, load),
            ("lights.compensation", LightRole::Compensation, compensation),
        ];
        let mut lights: Vec<(LightRole, u16)> = Vec::new();
        for (key, role, name) in named {
            let Some(name) = name else { continue };
            let code = light_code(name);
            let code = code.ok_or_else(|| wrong(key, "a light of the kernel as in \"LED_SCROLLL\"", name))?;
            if lights.iter().any(|(_, other)| *other == code) {
                return Err(wrong(key, "each light of the device at most once", name));
            }
            lights.push((role, code));
        }
        Ok(lights)
    }
}

impl ReadRumble {
    /// What it rumbles for, and how strongly.
    pub(crate) fn checked(&self) -> Result<Vec<(LightRole, f64)>, Wrong> {
        let Self { limit, fault, load, compensation } = self;
        let named = [
            ("rumble.limit", LightRole::Limit, limit),
            ("rumble.fault", LightRole::Fault, fault),
            ("rumble.load", LightRole::Load, load),
            ("rumble.compensation", LightRole::Compensation, compensation),
        ];
        let mut rumble = Vec::new();
        for (key, role, strength) in named {
            let Some(strength) = *strength else { continue };
            if !STRENGTHS.contains(&strength) {
                return Err(wrong(key, "0.05 to 1 of the strongest rumble", &strength.to_string()));
            }
            rumble.push((role, strength));
        }
        match rumble.is_empty() {
            true => Err(("rumble", "at least one of limit, fault, load and compensation", "none".to_owned())),
            false => Ok(rumble),
        }
    }
}

/// How a profile names what a light or a rumble is for; none for a light that is for everything.
pub(crate) fn key_of(role: LightRole) -> Option<&'static str> {
    match role {
        LightRole::All => None,
        LightRole::Engaged => Some("engaged"),
        LightRole::Limit => Some("limit"),
        LightRole::Fault => Some("fault"),
        LightRole::Load => Some("load"),
        LightRole::Compensation => Some("compensation"),
    }
}

/// The head's lines of what the device shows.
pub(crate) fn text_of(lights: &[(LightRole, u16)], rumble: &[(LightRole, f64)]) -> String {
    let all = lights.iter().filter(|(role, _)| key_of(*role).is_none());
    let mut text: String = all.map(|(_, code)| format!("light = \"{}\"\n", light_name(*code))).collect();
    let named =
        lights.iter().filter_map(|(role, code)| Some(format!("{} = \"{}\"", key_of(*role)?, light_name(*code))));
    let strong = rumble.iter().filter_map(|(role, strength)| Some(format!("{} = {strength:?}", key_of(*role)?)));
    for (table, members) in [("lights", named.collect::<Vec<_>>()), ("rumble", strong.collect())] {
        if !members.is_empty() {
            text += &format!("{table} = {{ {} }}\n", members.join(", "));
        }
    }
    text
}
