//! Tells a device at rest from a lost one: both are silent, and only the last word before the silence differs.

use krait_ipc::message::DeviceState;

/// Watches when reports come and what the last ones said.
///
/// A device sends every 8 to 16 ms while its cap is deflected, sends zeros when it is let go, and then falls silent. So
/// silence after zeros is rest, and silence after a deflection is a fault: cable, radio or battery.
#[derive(Clone, Copy, Debug)]
pub struct DeviceMonitor {
    silence_limit_ns: i64,
    report_ns: Option<i64>,
    motion_ns: i64,
    is_deflected: bool,
    is_unplugged: bool,
}

impl DeviceMonitor {
    /// A monitor for a device of which nothing has been heard. `silence_limit_ns` is how long a deflected device may be
    /// silent before it is lost, and how long one at rest is still called live.
    pub fn new(silence_limit_ns: i64) -> Self {
        Self { silence_limit_ns, report_ns: None, motion_ns: 0, is_deflected: false, is_unplugged: false }
    }

    /// Notes a motion report; `is_deflected` says whether any axis is not zero after it.
    pub fn on_motion(&mut self, is_deflected: bool, now_ns: i64) {
        self.motion_ns = now_ns;
        self.is_deflected = is_deflected;
        self.on_other(now_ns);
    }

    /// Notes a report that is not about motion. It shows that the device lives, but not that its deflection is still true.
    pub fn on_other(&mut self, now_ns: i64) {
        self.report_ns = Some(now_ns);
        self.is_unplugged = false;
    }

    /// The device is gone.
    pub fn on_unplugged(&mut self) {
        self.is_unplugged = true;
    }

    /// A device is there again; it waits for its first report.
    pub fn on_plugged(&mut self) {
        *self = Self::new(self.silence_limit_ns);
    }

    /// What is known of the device at an instant. Never [`DeviceState::Ended`]: a device has no end.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn state(&self, now_ns: i64) -> DeviceState {
        let is_over = |since_ns: i64| now_ns.saturating_sub(since_ns) > self.silence_limit_ns;
        match self.report_ns {
            _ if self.is_unplugged => DeviceState::Lost,
            None => DeviceState::Waiting,
            Some(_) if self.is_deflected && is_over(self.motion_ns) => DeviceState::Lost,
            Some(report_ns) if !self.is_deflected && is_over(report_ns) => DeviceState::AtRest,
            Some(_) => DeviceState::Live,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn monitor() -> DeviceMonitor {
        DeviceMonitor::new(100 * MS)
    }

    #[test]
    fn silence_after_zeros_is_rest_however_long() {
        let mut device = monitor();
        device.on_motion(true, 0);
        device.on_motion(false, 8 * MS);
        assert_eq!(device.state(100 * MS), DeviceState::Live);
        assert_eq!(device.state(109 * MS), DeviceState::AtRest);
        assert_eq!(device.state(3_600_000 * MS), DeviceState::AtRest);
    }

    #[test]
    fn silence_while_deflected_is_loss_and_the_next_report_ends_it() {
        let mut device = monitor();
        device.on_motion(true, 0);
        assert_eq!(device.state(100 * MS), DeviceState::Live);
        assert_eq!(device.state(101 * MS), DeviceState::Lost);
        device.on_motion(true, 150 * MS);
        assert_eq!(device.state(150 * MS), DeviceState::Live);
    }

    #[test]
    fn a_button_does_not_prove_that_an_old_deflection_still_holds() {
        let mut device = monitor();
        device.on_motion(true, 0);
        device.on_other(90 * MS);
        assert_eq!(device.state(101 * MS), DeviceState::Lost);
    }

    #[test]
    fn unplugged_is_lost_even_at_rest_and_plugged_in_again_lives_with_its_first_report() {
        let mut device = monitor();
        assert_eq!(device.state(0), DeviceState::Waiting);
        device.on_motion(false, 0);
        device.on_unplugged();
        assert_eq!(device.state(1), DeviceState::Lost);
        device.on_plugged();
        assert_eq!(device.state(2), DeviceState::Waiting);
        device.on_other(3);
        assert_eq!(device.state(3), DeviceState::Live);
    }
}
