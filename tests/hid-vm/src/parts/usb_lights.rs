//! Num Lock, Caps Lock and Scroll Lock of a keyboard in krait's hand tell of the chain, and are as they were when it is given back.

use super::lights::{CODE, FAST_HAND, SETTLED_NS, STOPPED};
use crate::chain::{User, VmChain, signal};
use crate::codes::Code;
use crate::qmp::{Act, Qmp};
use crate::usb_hand::{plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_master::InputDevice;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

const KEYBOARD: (&str, &str) = ("usb-kbd", "USB Keyboard");
const LOCKS: [&str; 3] = ["::numlock", "::capslock", "::scrolllock"];

/// The kernel's files of the three lights of a device: another keyboard may have some too.
fn files(device: &InputDevice) -> anyhow::Result<[PathBuf; 3]> {
    let event = device.node.file_name().context("a node has a name")?;
    let folder = Path::new("/sys/class/input").join(event).join("device");
    let lights: Vec<PathBuf> = std::fs::read_dir(folder)?.flatten().map(|entry| entry.path()).collect();
    let of = |lock: &str| {
        let found = lights.iter().find(|path| path.to_string_lossy().ends_with(lock));
        found.map(|path| path.join("brightness")).with_context(|| format!("the keyboard has no light {lock}"))
    };
    Ok([of(LOCKS[0])?, of(LOCKS[1])?, of(LOCKS[2])?])
}

/// What the lights were seen to do.
pub struct Watched {
    files: [PathBuf; 3],
    seen: [Vec<(i64, bool)>; 3],
}

impl Watched {
    /// The three lights of a device, which were not looked at yet.
    pub fn of(device: &InputDevice) -> anyhow::Result<Self> {
        Ok(Self { files: files(device)?, seen: Default::default() })
    }

    /// Which are on.
    pub fn look(&mut self) -> anyhow::Result<[bool; 3]> {
        let mut lit = [false; 3];
        for (idx, file) in self.files.iter().enumerate() {
            lit[idx] = std::fs::read_to_string(file).context("a light")?.trim() != "0";
            self.seen[idx].push((clock::monotonic_ns(), lit[idx]));
        }
        Ok(lit)
    }

    /// Looks for a while; each light's code, what was before left out.
    pub fn watch(&mut self, duration: Duration, settled_ns: i64) -> anyhow::Result<[Code; 3]> {
        let (begun_ns, until_ns) = (clock::monotonic_ns(), clock::monotonic_ns() + duration.as_nanos() as i64);
        while clock::monotonic_ns() < until_ns {
            self.look()?;
            sleep(Duration::from_millis(10));
        }
        Ok(self.seen.each_ref().map(|seen| Code::within(seen, begun_ns + settled_ns, until_ns)))
    }
}

/// Each state in turn.
pub fn lights(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    std::fs::write(FAST_HAND.0, FAST_HAND.1).context(FAST_HAND.0)?;
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let mut watched = Watched::of(&device)?;
    let before = watched.look()?;
    verdict.check("before", before == [false; 3], format!("{before:?}").replace(' ', ""));
    let node = device.node.display().to_string();
    let more = ["--profile", "keyboard", "--node", &node, "--config", FAST_HAND.0];
    let chain = VmChain::start_with("usb-lights", User::Root, 18.0, &more)?;
    let mut judge = |name, [engaged, limit, fault]: [Code; 3], is_met: fn(&[Code; 3]) -> bool| {
        let codes = [engaged, limit, fault];
        let words = codes.each_ref().map(Code::word).join(",");
        verdict.check(name, is_met(&codes), words);
    };
    judge("taken", watched.watch(CODE, SETTLED_NS)?, |[e, l, f]| e.is_wink() && l.is_dark() && f.is_dark());
    qmp.press("spc")?;
    let engaged = watched.watch(Duration::from_millis(1200), SETTLED_NS)?;
    judge("engaged", engaged, |[e, l, f]| e.is_steady() && l.is_dark() && f.is_dark());
    qmp.act(&[Act::Key("right", true)])?;
    let limit = watched.watch(Duration::from_millis(3500), 8 * SETTLED_NS)?;
    judge("limit", limit, |[e, l, f]| e.is_steady() && l.is_steady() && f.is_dark());
    qmp.act(&[Act::Key("right", false)])?;
    signal("slave", "STOP")?;
    let silent = watched.watch(STOPPED, 2 * SETTLED_NS)?;
    signal("slave", "CONT")?;
    judge("fault", silent, |[e, l, f]| e.is_dark() && l.is_dark() && f.is_fast());
    qmp.press("esc")?;
    sleep(Duration::from_millis(300));
    let after = watched.look()?;
    verdict.check("as_before", after == before, format!("{after:?}").replace(' ', ""));
    let (ended, _) = chain.end()?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    // A slave that was stopped for so long has missed samples, and that is told by the code; nobody has died.
    verdict.check("ended", ended.code.is_some(), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}
