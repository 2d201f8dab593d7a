//! Words of failures that travel between threads by number.

/// The port went away.
pub const PORT_GONE: &str = "its port is gone, as when the USB adapter is unplugged";
/// The port takes nothing.
pub const PORT_BLOCKED: &str = "its port takes no more bytes";
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
