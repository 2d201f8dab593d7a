//! Which emergencies a drive has sent: each code is said once, because one that comes without a change of the status word stops nothing.

use super::node::{is_external, meaning};

/// Codes of a drive that are said until its power is switched on anew: whoever sends ever new ones does not fill the log.
const MOST: usize = 8;

/// Error codes, in the order in which they came.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Emergencies {
    codes: [u16; MOST],
    n: usize,
    n_said: usize,
}

impl Emergencies {
    /// Takes a code; 0 says that an error is over.
    pub(crate) fn hear(&mut self, code: u16) {
        if code != 0 && self.n < MOST && !self.codes[..self.n].contains(&code) {
            self.codes[self.n] = code;
            self.n += 1;
        }
    }

    /// Power is switched on anew: what was said already is news again.
    pub(crate) fn begin_anew(&mut self) {
        self.codes.copy_within(self.n_said..self.n, 0);
        (self.n, self.n_said) = (self.n - self.n_said, 0);
    }

    /// The next code that was not said yet, and whether no further one will be.
    pub(crate) fn take_next(&mut self) -> Option<(u16, bool)> {
        let code = *self.codes[..self.n].get(self.n_said)?;
        self.n_said += 1;
        Some((code, self.n_said == MOST))
    }
}

/// What the log says of a code of a drive, counted from 1.
pub(crate) fn sentence(actuator: usize, id: u8, code: u16, is_last: bool) -> String {
    let what = what(code);
    let further =
        if is_last { "; further codes of this drive are not said until power is switched on anew" } else { "" };
    format!(
        "drive {actuator} (id {id}) sent an emergency (code {code:04X}h): it reports {what}; an emergency alone stops nothing, so look whether the drive is sound before it moves on{further}"
    )
}

/// What the log says of a drive that had failed before anybody opened its bus, with its objects 603F and 1001 where it has them.
pub(crate) fn found_failed(actuator: usize, id: u8, code: Option<u32>, register: Option<u32>) -> String {
    // Some drives have two bytes of their own above the code.
    let said = match code.map(|code| code as u16).filter(|code| *code != 0) {
        Some(code) => format!("error code {code:04X}h (object 603F), so it reports {}", what(code)),
        None => "it tells no error code (object 603F)".to_owned(),
    };
    let register = register.map(|register| format!(", error register {register:02X}h (1001)")).unwrap_or_default();
    format!(
        "drive {actuator} (id {id}) had failed before its bus was opened: {said}{register}; an enable resets that, so check first why it failed"
    )
}

fn what(code: u16) -> &'static str {
    if is_external(code) { "an external error, as an emergency stop is" } else { meaning(code) }
}
