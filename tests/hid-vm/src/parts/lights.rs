//! The light of a SpaceMouse tells what becomes of its motion: taken, engaged, at a limit, no word of the drives.

use crate::chain::{User, VmChain, signal};
use crate::codes::Code;
use crate::model::Model;
use crate::spacemouse::{SpaceMouse, Switched};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use std::thread::sleep;
use std::time::Duration;

/// A fast hand, so that the snake is soon at its limit.
pub const FAST_HAND: (&str, &str) = ("/tmp/fast.toml", "[master]\nfull_speed_m_per_s = 0.1\n");
/// Longer than a whole code and a wink.
pub const CODE: Duration = Duration::from_millis(4500);
/// How long the code of before may still be seen: looks, the reading thread and the machine.
pub const SETTLED_NS: i64 = 250_000_000;
/// Less than a process may be silent before it is killed.
pub const STOPPED: Duration = Duration::from_millis(1500);

/// Each state in turn, and what the light did.
pub fn lights() -> anyhow::Result<PartVerdict> {
    std::fs::write(FAST_HAND.0, FAST_HAND.1).context(FAST_HAND.0)?;
    let mut mouse = SpaceMouse::plug(Model::Compact)?;
    let chain = VmChain::start_with("lights", User::Root, 16.0, &["--config", FAST_HAND.0])?;
    mouse.wait_until_read()?;
    let mut at = vec![clock::monotonic_ns()];
    sleep(CODE);
    at.push(clock::monotonic_ns());
    mouse.press(0)?;
    mouse.hold(60, 800)?;
    at.push(clock::monotonic_ns());
    mouse.hold(350, CODE.as_millis() as i64)?;
    at.push(clock::monotonic_ns());
    mouse.hold(-350, 300)?;
    mouse.release()?;
    at.push(clock::monotonic_ns());
    sleep(Duration::from_millis(500));
    signal("slave", "STOP")?;
    at.push(clock::monotonic_ns());
    sleep(STOPPED);
    signal("slave", "CONT")?;
    at.push(clock::monotonic_ns());
    let (ended, journal) = chain.end()?;
    let lit = mouse.lit();
    mouse.unplug()?;

    let switched: Vec<(i64, bool)> = lit.iter().map(|(at_ns, what)| (*at_ns, *what == Switched::On)).collect();
    let code = |idx: usize, settled_ns: i64| Code::within(&switched, at[idx] + settled_ns, at[idx + 1]);
    let mut verdict = PartVerdict::default();
    let n_other = lit.iter().filter(|(_, what)| *what == Switched::Nothing).count();
    verdict.check("other", n_other == 0, n_other);
    let mut judge = |name, code: Code, is_met: bool| verdict.check(name, is_met, code.word());
    let taken = code(0, SETTLED_NS);
    judge("taken", Code::within(&switched, at[0] + SETTLED_NS, at[1]), taken.is_wink());
    let engaged = code(1, SETTLED_NS);
    judge("engaged", code(1, SETTLED_NS), engaged.is_steady());
    // The snake is on its way first.
    let limit = code(2, 4 * SETTLED_NS);
    judge("limit", code(2, 4 * SETTLED_NS), limit.is_two_gaps());
    let silent = code(5, 2 * SETTLED_NS);
    judge("fault", code(5, 2 * SETTLED_NS), silent.is_fast());
    let is_dark = switched.last().is_some_and(|(_, is_on)| !*is_on);
    verdict.check("dark_at_end", is_dark, is_dark);
    let bent = journal.moved_deg(at[2], at[3]);
    verdict.check("bent_deg", bent > 40.0, format!("{bent:.1}"));
    // A slave that was stopped for so long has missed samples, and that is told by the code; nobody has died.
    verdict.check("ended", ended.code.is_some(), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}
