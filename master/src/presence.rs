//! How an operator says "I am here", "hold still" and "open": dead-man, clutch and other buttons, as a configuration names them.

use serde::{Deserialize, Serialize};

/// Buttons that a message can carry.
const N_BUTTONS: u8 = 32;

/// What counts as the operator's presence; without it nothing moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum Presence {
    /// While this button is held: `hold:<button>`.
    Hold(u8),
    /// Switched on and off by pressing this button: `toggle:<button>`.
    Toggle(u8),
}

/// A button that does something while it is held: the clutch, a jaw that opens or closes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum HoldButton {
    /// No button does.
    None,
    /// While this button is held: `hold:<button>`.
    Hold(u8),
}

/// A button of which each press does something: sets a mark, turns fine motion on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub enum PressButton {
    /// No button does.
    None,
    /// Each press of this button: `press:<button>`.
    Press(u8),
}

impl PressButton {
    /// The button, if there is one.
    pub(crate) fn button(self) -> Option<u8> {
        match self {
            Self::None => None,
            Self::Press(button) => Some(button),
        }
    }

    /// Whether it is among these buttons.
    pub(crate) fn is_in(self, buttons: u32) -> bool {
        self.button().is_some_and(|button| is_down(buttons, button))
    }
}

impl HoldButton {
    /// The button, if there is one.
    pub(crate) fn button(self) -> Option<u8> {
        match self {
            Self::None => None,
            Self::Hold(button) => Some(button),
        }
    }

    /// Whether it is among these buttons.
    pub(crate) fn is_in(self, buttons: u32) -> bool {
        self.button().is_some_and(|button| is_down(buttons, button))
    }
}

impl TryFrom<String> for PressButton {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        match (text.as_str(), text.split_once(':')) {
            ("none", _) => Some(Self::None),
            (_, Some(("press", button))) => button_of(button).map(Self::Press),
            _ => None,
        }
        .ok_or_else(|| format!("{text:?} is no press, expected \"none\" or \"press:<0..31>\""))
    }
}

impl From<PressButton> for String {
    fn from(press: PressButton) -> Self {
        match press {
            PressButton::None => "none".to_owned(),
            PressButton::Press(button) => format!("press:{button}"),
        }
    }
}

impl TryFrom<String> for Presence {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        match (text.as_str(), text.split_once(':')) {
            (_, Some(("hold", button))) => button_of(button).map(Self::Hold),
            (_, Some(("toggle", button))) => button_of(button).map(Self::Toggle),
            _ => None,
        }
        .ok_or_else(|| format!("{text:?} is no way to be present, expected \"hold:<0..31>\" or \"toggle:<0..31>\""))
    }
}

impl From<Presence> for String {
    fn from(presence: Presence) -> Self {
        match presence {
            Presence::Hold(button) => format!("hold:{button}"),
            Presence::Toggle(button) => format!("toggle:{button}"),
        }
    }
}

impl TryFrom<String> for HoldButton {
    type Error = String;
    fn try_from(text: String) -> Result<Self, String> {
        match (text.as_str(), text.split_once(':')) {
            ("none", _) => Some(Self::None),
            (_, Some(("hold", button))) => button_of(button).map(Self::Hold),
            _ => None,
        }
        .ok_or_else(|| format!("{text:?} is no button to hold, expected \"none\" or \"hold:<0..31>\""))
    }
}

impl From<HoldButton> for String {
    fn from(hold: HoldButton) -> Self {
        match hold {
            HoldButton::None => "none".to_owned(),
            HoldButton::Hold(button) => format!("hold:{button}"),
        }
    }
}

/// Whether a button of a message's bits is down.
pub(crate) fn is_down(buttons: u32, button: u8) -> bool {
    buttons & (1 << (button % N_BUTTONS)) != 0
}

fn button_of(text: &str) -> Option<u8> {
    text.parse().ok().filter(|button| *button < N_BUTTONS)
}
