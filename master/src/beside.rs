//! Devices beside the hand controller, such as a foot pedal: which they are, and which device each button and axis of the hand comes from.

use crate::{AXIS_NAMES, DeviceChoice, MasterConfig, MasterError, Profile};
use serde::{Deserialize, Serialize};
use std::convert::Infallible;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// One of them, as `[[master.beside]]` says it.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BesideConfig {
    /// Its profile, a file or a built-in name.
    pub profile: PathBuf,
    /// Its node; none: the one that the profile names.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<PathBuf>,
}

impl FromStr for BesideConfig {
    type Err = Infallible;
    /// `PROFILE` or `PROFILE=NODE`, as on a command line.
    fn from_str(text: &str) -> Result<Self, Infallible> {
        let (profile, node) = text.split_once('=').map_or((text, None), |(profile, node)| (profile, Some(node.into())));
        Ok(Self { profile: profile.into(), node })
    }
}

/// The profiles of a hand of several devices, of which no two say the same.
#[derive(Clone, Debug, PartialEq)]
pub struct JoinedHand {
    /// That of the hand controller; none of a SpaceMouse.
    pub(crate) hand: Option<Profile>,
    /// Those of the devices beside it.
    pub(crate) beside: Vec<Profile>,
    /// What a hand controller without a profile is called.
    bare: String,
}

/// What a device gives: its name in a sentence, axes and buttons, a bit each.
struct Claim {
    whose: String,
    axes: u32,
    buttons: u32,
}

impl Claim {
    fn of(profile: &Profile, place: &str) -> Self {
        Self {
            whose: format!("{:?} ({place})", profile.name),
            axes: profile.axes.iter().fold(0, |bits, axis| bits | 1 << axis.axis_idx),
            buttons: buttons_of(profile),
        }
    }
}

impl JoinedHand {
    /// Reads every profile of a configuration.
    ///
    /// # Errors
    /// As [`Profile::of_device`]; [`MasterError::Claimed`] where two devices say one thing.
    pub fn read(config: &MasterConfig) -> Result<Self, MasterError> {
        let read = |path: &Path, node: Option<&Path>| Profile::of_device(path, node);
        let hand = config.profile.as_deref().map(|path| read(path, config.node.as_deref())).transpose()?;
        let beside = config.beside.iter().map(|one| read(&one.profile, one.node.as_deref()));
        let beside = beside.collect::<Result<_, _>>()?;
        let bare = match (&config.spacenavd, &config.device) {
            (Some(_), _) => "the hand behind spacenavd".to_owned(),
            (None, DeviceChoice::Any) => "the SpaceMouse".to_owned(),
            (None, one) => format!("the device {one}"),
        };
        let joined = Self { hand, beside, bare };
        joined.check()?;
        Ok(joined)
    }

    /// No OR and no sum: a pedal that is let go must be enough to end what it holds, whatever is pressed elsewhere.
    fn check(&self) -> Result<(), MasterError> {
        let first = match &self.hand {
            Some(profile) => Claim::of(profile, "[master] profile"),
            // One body with six axes, and the buttons that nobody else names.
            None => Claim { whose: self.bare.clone(), axes: 0x3f, buttons: 0 },
        };
        let mut claims = vec![first];
        for (idx, profile) in self.beside.iter().enumerate() {
            let claim = Claim::of(profile, &format!("[[master.beside]] number {}", idx + 1));
            for other in &claims {
                let (axes, buttons) = (other.axes & claim.axes, other.buttons & claim.buttons);
                let what = match (axes, buttons) {
                    (0, 0) => continue,
                    (0, _) => format!("button {}", buttons.trailing_zeros()),
                    _ => format!("axis {}", AXIS_NAMES[axes.trailing_zeros() as usize]),
                };
                return Err(MasterError::Claimed { what, first: other.whose.clone(), second: claim.whose });
            }
            claims.push(claim);
        }
        Ok(())
    }

    /// Buttons of the hand controller that count: of one without a profile those that no device beside it names.
    pub(crate) fn kept_buttons(&self) -> u32 {
        if self.hand.is_some() {
            return u32::MAX;
        }
        !self.beside.iter().fold(0, |bits, profile| bits | buttons_of(profile))
    }

    /// What a person must know when it is taken: which devices are the hand, and what comes from those beside it.
    pub fn sentence(&self) -> String {
        let hand = self.hand.as_ref().map_or_else(|| self.bare.clone(), |profile| format!("{:?}", profile.name));
        let beside: Vec<String> = self.beside.iter().map(given).collect();
        let silent = if self.hand.is_none() && self.kept_buttons() != u32::MAX {
            format!("; a button of {hand} with such a number does nothing")
        } else {
            String::new()
        };
        format!("the hand is {hand} and beside it {}{silent}; whichever is lost ends the motion", beside.join(" and "))
    }

    /// The profiles of all its devices that have one.
    pub fn profiles(&self) -> impl Iterator<Item = &Profile> {
        self.hand.iter().chain(&self.beside)
    }
}

fn buttons_of(profile: &Profile) -> u32 {
    profile.buttons.iter().fold(0, |bits, button| bits | 1 << button.button)
}

/// `"Pedal" (button 0, button 1, axis rz)`.
fn given(profile: &Profile) -> String {
    let buttons = profile.buttons.iter().map(|button| format!("button {}", button.button));
    let axes = profile.axes.iter().map(|axis| format!("axis {}", AXIS_NAMES[axis.axis_idx]));
    format!("{:?} ({})", profile.name, buttons.chain(axes).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(name: &str, axes: &[&str], buttons: &[u8]) -> Profile {
        let mut text = format!("name = \"{name}\"\nid = \"05f3:00ff\"\n");
        for (code, axis) in axes.iter().enumerate() {
            text += &format!("[[axis]]\nof = \"{axis}\"\nfrom = \"{code}\"\n");
        }
        for button in buttons {
            text += &format!("[[button]]\nof = {button}\nfrom = \"{}\"\n", 0x120 + u16::from(*button));
        }
        Profile::parse("test", &text).expect("a profile")
    }

    fn joined(hand: Option<Profile>, beside: &[Profile]) -> JoinedHand {
        JoinedHand { hand, beside: beside.to_vec(), bare: "the SpaceMouse".to_owned() }
    }

    #[test]
    fn two_devices_that_say_one_thing_are_refused_by_both_names() {
        let (stick, pedal) = (profile("Stick", &["x", "y"], &[0, 3]), profile("Pedal", &["rz"], &[1, 2]));
        joined(Some(stick.clone()), std::slice::from_ref(&pedal)).check().expect("each its own");
        for (hand, beside, words) in [
            (
                Some(stick.clone()),
                vec![profile("Pedal", &[], &[1, 3])],
                "button 3 of the hand comes from both \"Stick\" ([master] profile) and \"Pedal\" ([[master.beside]] number 1)",
            ),
            (Some(stick), vec![pedal.clone(), profile("Knob", &["y"], &[])], "axis y of the hand comes from both"),
            (None, vec![pedal.clone()], "axis rz of the hand comes from both the SpaceMouse and \"Pedal\""),
            (None, vec![profile("A", &[], &[5]), profile("B", &[], &[5])], "number 1) and \"B\" ([[master.beside]] n"),
        ] {
            let error = joined(hand, &beside).check().expect_err(words).to_string();
            assert!(error.contains(words) && error.contains("leave it out") && !error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn a_button_that_a_pedal_names_is_no_button_of_the_cap_and_the_start_says_so() {
        let pedal = profile("Pedal", &[], &[0, 9]);
        let hand = joined(None, std::slice::from_ref(&pedal));
        hand.check().expect("the cap's button gives way");
        assert_eq!(hand.kept_buttons(), !(1 | 1 << 9));
        let said = hand.sentence();
        for part in ["the SpaceMouse and beside it \"Pedal\" (button 0, button 9)", "does nothing", "whichever is lost"]
        {
            assert!(said.contains(part), "{said}");
        }
        let stick = joined(Some(profile("Stick", &["x"], &[1])), &[pedal]);
        assert_eq!(stick.kept_buttons(), u32::MAX);
        assert!(!stick.sentence().contains("does nothing"), "{}", stick.sentence());
    }
}
