//! The stops that anybody may ask for, as the slave sees them.

use krait_ipc::StopSwitch;

/// The stops that were asked for and those that have been obeyed.
#[derive(Debug)]
pub struct Stops {
    switch: StopSwitch,
    seen: u32,
    obeyed: u32,
}

impl Stops {
    /// Stops of before the start have no motion left to end.
    pub fn new(switch: StopSwitch) -> Self {
        let seen = switch.asked();
        switch.obey(seen);
        Self { switch, seen, obeyed: seen }
    }

    /// Whether a stop was asked for since the last look.
    pub fn look(&mut self) -> bool {
        let asked = self.switch.asked();
        core::mem::replace(&mut self.seen, asked) != asked
    }

    /// The drives stand still: tells everybody who asked.
    pub fn obey(&mut self) {
        if core::mem::replace(&mut self.obeyed, self.seen) != self.seen {
            self.switch.obey(self.seen);
        }
    }
}
