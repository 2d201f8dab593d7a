//! The kernel's names of axes and buttons (linux/input-event-codes.h), those that hands, mice and keyboards have; any other goes by its number.

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

/// Axes that tell a way, not a place.
const WAYS: [(&str, u16); 12] = [
    ("REL_X", 0x00),
    ("REL_Y", 0x01),
    ("REL_Z", 0x02),
    ("REL_RX", 0x03),
    ("REL_RY", 0x04),
    ("REL_RZ", 0x05),
    ("REL_HWHEEL", 0x06),
    ("REL_DIAL", 0x07),
    ("REL_WHEEL", 0x08),
    ("REL_MISC", 0x09),
    ("REL_WHEEL_HI_RES", 0x0b),
    ("REL_HWHEEL_HI_RES", 0x0c),
];

/// Keys of keyboards; buttons of joysticks, gamepads, mice, tablets and pedals.
const BUTTONS: [(&str, u16); 144] = [
    ("KEY_ESC", 1),
    ("KEY_1", 2),
    ("KEY_2", 3),
    ("KEY_3", 4),
    ("KEY_4", 5),
    ("KEY_5", 6),
    ("KEY_6", 7),
    ("KEY_7", 8),
    ("KEY_8", 9),
    ("KEY_9", 10),
    ("KEY_0", 11),
    ("KEY_MINUS", 12),
    ("KEY_EQUAL", 13),
    ("KEY_BACKSPACE", 14),
    ("KEY_TAB", 15),
    ("KEY_Q", 16),
    ("KEY_W", 17),
    ("KEY_E", 18),
    ("KEY_R", 19),
    ("KEY_T", 20),
    ("KEY_Y", 21),
    ("KEY_U", 22),
    ("KEY_I", 23),
    ("KEY_O", 24),
    ("KEY_P", 25),
    ("KEY_LEFTBRACE", 26),
    ("KEY_RIGHTBRACE", 27),
    ("KEY_ENTER", 28),
    ("KEY_LEFTCTRL", 29),
    ("KEY_A", 30),
    ("KEY_S", 31),
    ("KEY_D", 32),
    ("KEY_F", 33),
    ("KEY_G", 34),
    ("KEY_H", 35),
    ("KEY_J", 36),
    ("KEY_K", 37),
    ("KEY_L", 38),
    ("KEY_SEMICOLON", 39),
    ("KEY_APOSTROPHE", 40),
    ("KEY_GRAVE", 41),
    ("KEY_LEFTSHIFT", 42),
    ("KEY_BACKSLASH", 43),
    ("KEY_Z", 44),
    ("KEY_X", 45),
    ("KEY_C", 46),
    ("KEY_V", 47),
    ("KEY_B", 48),
    ("KEY_N", 49),
    ("KEY_M", 50),
    ("KEY_COMMA", 51),
    ("KEY_DOT", 52),
    ("KEY_SLASH", 53),
    ("KEY_RIGHTSHIFT", 54),
    ("KEY_KPASTERISK", 55),
    ("KEY_LEFTALT", 56),
    ("KEY_SPACE", 57),
    ("KEY_CAPSLOCK", 58),
    ("KEY_F1", 59),
    ("KEY_F2", 60),
    ("KEY_F3", 61),
    ("KEY_F4", 62),
    ("KEY_F5", 63),
    ("KEY_F6", 64),
    ("KEY_F7", 65),
    ("KEY_F8", 66),
    ("KEY_F9", 67),
    ("KEY_F10", 68),
    ("KEY_NUMLOCK", 69),
    ("KEY_SCROLLLOCK", 70),
    ("KEY_KP7", 71),
    ("KEY_KP8", 72),
    ("KEY_KP9", 73),
    ("KEY_KPMINUS", 74),
    ("KEY_KP4", 75),
    ("KEY_KP5", 76),
    ("KEY_KP6", 77),
    ("KEY_KPPLUS", 78),
    ("KEY_KP1", 79),
    ("KEY_KP2", 80),
    ("KEY_KP3", 81),
    ("KEY_KP0", 82),
    ("KEY_KPDOT", 83),
    ("KEY_102ND", 86),
    ("KEY_F11", 87),
    ("KEY_F12", 88),
    ("KEY_KPENTER", 96),
    ("KEY_RIGHTCTRL", 97),
    ("KEY_KPSLASH", 98),
    ("KEY_SYSRQ", 99),
    ("KEY_RIGHTALT", 100),
    ("KEY_HOME", 102),
    ("KEY_UP", 103),
    ("KEY_PAGEUP", 104),
    ("KEY_LEFT", 105),
    ("KEY_RIGHT", 106),
    ("KEY_END", 107),
    ("KEY_DOWN", 108),
    ("KEY_PAGEDOWN", 109),
    ("KEY_INSERT", 110),
    ("KEY_DELETE", 111),
    ("KEY_PAUSE", 119),
    ("BTN_0", 0x100),
    ("BTN_1", 0x101),
    ("BTN_2", 0x102),
    ("BTN_3", 0x103),
    ("BTN_LEFT", 0x110),
    ("BTN_RIGHT", 0x111),
    ("BTN_MIDDLE", 0x112),
    ("BTN_SIDE", 0x113),
    ("BTN_EXTRA", 0x114),
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
    ("BTN_TOOL_PEN", 0x140),
    ("BTN_TOUCH", 0x14a),
    ("BTN_STYLUS", 0x14b),
    ("BTN_STYLUS2", 0x14c),
    ("BTN_DPAD_UP", 0x220),
    ("BTN_DPAD_DOWN", 0x221),
    ("BTN_DPAD_LEFT", 0x222),
    ("BTN_DPAD_RIGHT", 0x223),
];

/// Lights.
const LIGHTS: [(&str, u16); 11] = [
    ("LED_NUML", 0),
    ("LED_CAPSL", 1),
    ("LED_SCROLLL", 2),
    ("LED_COMPOSE", 3),
    ("LED_KANA", 4),
    ("LED_SLEEP", 5),
    ("LED_SUSPEND", 6),
    ("LED_MUTE", 7),
    ("LED_MISC", 8),
    ("LED_MAIL", 9),
    ("LED_CHARGING", 10),
];

/// Largest number of an absolute axis and of a button.
const ABS_MAX: u16 = 0x3f;
pub(crate) const KEY_MAX: u16 = 0x2ff;

/// The number of an axis: by its name, or itself in decimal or, after `0x`, in hexadecimal.
pub(crate) fn axis_code(text: &str) -> Option<u16> {
    code_of(&AXES, text, ABS_MAX)
}

/// The number of an axis that tells a way, by its name only: a number is that of an absolute one.
pub(crate) fn way_code(text: &str) -> Option<u16> {
    WAYS.iter().find(|(name, _)| *name == text).map(|(_, code)| *code)
}

/// The number of a light, by its name.
pub(crate) fn light_code(text: &str) -> Option<u16> {
    LIGHTS.iter().find(|(name, _)| *name == text).map(|(_, code)| *code)
}

/// The name of a light's number, or the number.
pub(crate) fn light_name(code: u16) -> String {
    name_of(&LIGHTS, code)
}

/// The number of a button or key, by its name or itself.
pub(crate) fn button_code(text: &str) -> Option<u16> {
    code_of(&BUTTONS, text, KEY_MAX)
}

/// The name of an axis' number, or the number.
pub(crate) fn axis_name(code: u16) -> String {
    name_of(&AXES, code)
}

/// The name of the number of an axis that tells a way, or the number.
pub(crate) fn way_name(code: u16) -> String {
    name_of(&WAYS, code)
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
