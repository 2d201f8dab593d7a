//! Words of failures that travel between threads by number.

/// The port went away.
pub const PORT_GONE: &str = "its port is gone, as when the USB adapter is unplugged";
/// The port takes nothing.
pub const PORT_BLOCKED: &str = "its port takes no more bytes";
/// It was asked for again.
pub const PORT_STILL_GONE: &str = "its port is still gone; plug the USB adapter in";
/// Somebody else is there now.
pub const OTHER_SERVOS: &str =
    "its port is back, but not with the servos of the configuration, as `krait drives` shows";
/// The thread has ended.
pub const THREAD_ENDED: &str = "its thread has ended";
/// Supply outside its range.
pub const VOLTAGE: &str = "a supply voltage out of its range";
/// Encoder.
pub const SENSOR: &str = "a failure of its encoder";
/// Too hot.
pub const HEAT: &str = "that it is too hot";
/// Too much current.
pub const CURRENT: &str = "too much current";
/// More than one.
pub const SEVERAL: &str = "several failures at once";
/// Power was asked for and did not come.
pub const NOT_POWERED: &str = "no power";
/// The CAN interface went away.
pub const CAN_GONE: &str = "its CAN interface is gone, as when the adapter is unplugged";
/// The CAN interface was switched off.
pub const CAN_DOWN: &str = "its CAN interface is down, as after `ip link set down`; `sudo ip link set can0 up type can bitrate 1000000` with its name";
/// The controller has left the bus.
pub const BUS_OFF: &str = "its CAN interface is bus-off after too many errors on the wire; check bit rate, termination and cable, then set the interface down and up";
/// It was asked for again.
pub const CAN_STILL_GONE: &str = "its CAN interface is still gone; plug the adapter in and set the interface up";
/// Somebody else has taken it meanwhile.
pub const CAN_IN_USE: &str = "its CAN interface is back, but in use by another program; end that";
/// Somebody else is there now.
pub const OTHER_DRIVES: &str =
    "a drive on it is not the one of the configuration, or refuses what it must do; `krait drives` shows who is there";
/// Nobody takes frames.
pub const CAN_BLOCKED: &str = "its CAN interface takes no more frames, as when no drive is left that acknowledges them";
/// Somebody else is master.
pub const SECOND_MASTER: &str = "another program or device on the CAN bus does what only a master does; end it";
/// More than one answer to a SYNC.
pub const OUT_OF_STEP: &str = "more than one answer in a cycle, so that it is not in step, as after it froze";
/// It has stopped by itself.
pub const QUICK_STOPPED: &str = "a quick stop of its own, as when it missed this program's heartbeat";
/// It is too far from its target.
pub const FOLLOWING: &str = "that it does not follow its targets";
/// It takes no part any more.
pub const LEFT: &str = "that it has left Operation Enabled by itself";
/// CAN errors.
pub const COMMUNICATION: &str = "a failure of its communication";
/// Any other.
pub const OF_ITS_OWN: &str = "a failure of its own; see the code in its manual";
/// In the servo's circuit.
pub const ELECTRICAL: &str = "an electrical shock in its circuit, or too weak a supply";
/// It goes on all the same.
pub const OVERLOAD: &str = "an overload";
