//! The kernel's names of axes and buttons (linux/input-event-codes.h), those that hands have; any other goes by its number.

/// Axes with an absolute value.
const AXES: [(&str, u16); 14] = [
    ("ABS_X", 0x00),
    ("ABS_Y", 0x01),
    ("ABS_Z", 0x02),
    ("ABS_RX", 0x03),
    ("ABS_RY", 0x04),
    ("ABS_RZ", 0x05),
    ("ABS_THROTTLE", 0x06),
    ("ABS_RUDDER", 0x07),
    ("ABS_WHEEL", 0x08),
    ("ABS_GAS", 0x09),
    ("ABS_BRAKE", 0x0a),
    ("ABS_HAT0X", 0x10),
    ("ABS_HAT0Y", 0x11),
    ("ABS_MISC", 0x28),
];

/// Buttons of joysticks, gamepads, mice and pedals, and keys that pedals send.
const BUTTONS: [(&str, u16); 49] = [
    ("BTN_TRIGGER", 0x120),
    ("BTN_THUMB", 0x121),
    ("BTN_THUMB2", 0x122),
    ("BTN_TOP", 0x123),
    ("BTN_TOP2", 0x124),
    ("BTN_PINKIE", 0x125),
    ("BTN_BASE", 0x126),
    ("BTN_BASE2", 0x127),
    ("BTN_BASE3", 0x128),
    ("BTN_BASE4", 0x129),
    ("BTN_BASE5", 0x12a),
    ("BTN_BASE6", 0x12b),
    ("BTN_SOUTH", 0x130),
    ("BTN_EAST", 0x131),
    ("BTN_NORTH", 0x133),
    ("BTN_WEST", 0x134),
    ("BTN_TL", 0x136),
    ("BTN_TR", 0x137),
    ("BTN_TL2", 0x138),
    ("BTN_TR2", 0x139),
    ("BTN_SELECT", 0x13a),
    ("BTN_START", 0x13b),
    ("BTN_MODE", 0x13c),
    ("BTN_THUMBL", 0x13d),
    ("BTN_THUMBR", 0x13e),
    ("BTN_LEFT", 0x110),
    ("BTN_RIGHT", 0x111),
    ("BTN_MIDDLE", 0x112),
    ("BTN_0", 0x100),
    ("BTN_1", 0x101),
    ("BTN_2", 0x102),
    ("BTN_3", 0x103),
    ("KEY_A", 30),
    ("KEY_B", 48),
    ("KEY_C", 46),
    ("KEY_SPACE", 57),
    ("KEY_ENTER", 28),
    ("KEY_PAGEUP", 104),
    ("KEY_PAGEDOWN", 109),
    ("KEY_UP", 103),
    ("KEY_DOWN", 108),
    ("KEY_LEFT", 105),
    ("KEY_RIGHT", 106),
    ("KEY_F1", 59),
    ("KEY_F2", 60),
    ("KEY_F3", 61),
    ("KEY_LEFTCTRL", 29),
    ("KEY_LEFTSHIFT", 42),
    ("KEY_LEFTALT", 56),
];

/// Largest number of an axis and of a button.
const ABS_MAX: u16 = 0x3f;
const KEY_MAX: u16 = 0x2ff;

/// The number of an axis: by its name, or itself in decimal or, after `0x`, in hexadecimal.
pub(crate) fn axis_code(text: &str) -> Option<u16> {
    code_of(&AXES, text, ABS_MAX)
}

/// The number of a button, likewise.
pub(crate) fn button_code(text: &str) -> Option<u16> {
    code_of(&BUTTONS, text, KEY_MAX)
}

/// The name of an axis' number, or the number.
pub(crate) fn axis_name(code: u16) -> String {
    name_of(&AXES, code)
}

/// The name of a button's number, or the number.
pub(crate) fn button_name(code: u16) -> String {
    name_of(&BUTTONS, code)
}

fn code_of(names: &[(&str, u16)], text: &str, most: u16) -> Option<u16> {
    if let Some((_, code)) = names.iter().find(|(name, _)| *name == text) {
        return Some(*code);
    }
    let number = match text.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16),
        None => text.parse(),
    };
    number.ok().filter(|code| *code <= most)
}

fn name_of(names: &[(&str, u16)], code: u16) -> String {
    let known = names.iter().find(|(_, number)| *number == code);
    known.map_or_else(|| code.to_string(), |(name, _)| (*name).to_owned())
}
