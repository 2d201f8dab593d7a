//! Lights of a keyboard that count load and compensation in quarters: as many flashes as the chain's own recording says.

use super::lights::{SETTLED_NS, STOPPED};
use super::usb_keyboard::KEYBOARD;
use super::usb_lights::Watched;
use crate::chain::{Journal, User, VmChain, signal};
use crate::codes::Code;
use crate::qmp::{Act, Qmp};
use crate::usb_hand::{plugged, unplugged};
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use krait_ipc::message::three;
use std::thread::sleep;
use std::time::Duration;

/// Num Lock tells as before, Caps Lock of the load, Scroll Lock of compensation.
const PROFILE: (&str, &str) = (
    "/tmp/meters.toml",
    "name = \"Meters\"\nid = \"0627:0001\"\nrelease = \"KEY_ESC\"\nlights = { engaged = \"LED_NUML\", load = \"LED_CAPSL\", compensation = \"LED_SCROLLL\" }\n[[axis]]\nof = \"x\"\nplus = \"KEY_RIGHT\"\nminus = \"KEY_LEFT\"\n[[button]]\nof = 0\nfrom = \"KEY_SPACE\"\n",
);
/// With this limit, N, the load is told by one flash where the snake is at its limit, and compensation by two.
const LIMIT_N: f64 = 100.0;
const CONFIG: &str = "/tmp/meters-chain.toml";
/// Below this way compensation is compared with it, m (docs/hands.md).
const LEAST_WAY_M: f64 = 0.4e-3;
/// Names of the two checks at a bend, and how long the key is held for it.
const BENDS: [(&str, &str, Duration); 3] = [
    ("load_a_little_bent", "compensation_a_little_bent", Duration::from_millis(120)),
    ("load_more_bent", "compensation_more_bent", Duration::from_millis(300)),
    ("load_at_the_limit", "compensation_at_the_limit", Duration::from_millis(2500)),
];
/// How long the snake may take to come to rest, and lights to be as before.
const REST: Duration = Duration::from_millis(500);
/// How long lights are looked at in one state: two codes that may still tell of the way there, and more than one whole code.
const LOOKED_AT: Duration = Duration::from_millis(7500);
const SETTLING_NS: i64 = 4_200_000_000;
const CHAIN_S: f64 = 42.0;

/// What was watched: names of the two checks, from when to when, and the codes of both lights.
struct Seen {
    names: [&'static str; 2],
    from_ns: i64,
    to_ns: i64,
    codes: [Code; 2],
}

/// Straight, three bends, and drives that say nothing.
pub fn meters(qmp: &mut Qmp) -> anyhow::Result<PartVerdict> {
    let mut verdict = PartVerdict::default();
    std::fs::write(PROFILE.0, PROFILE.1).context(PROFILE.0)?;
    let limits = format!("[slave.limits]\npush_n = {LIMIT_N:?}\npull_n = {LIMIT_N:?}\nstrain = 0.02\n");
    std::fs::write(CONFIG, format!("[master]\nfull_speed_m_per_s = 0.1\n{limits}")).context(CONFIG)?;
    let device = plugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let mut watched = Watched::of(&device)?;
    let before = watched.look()?;
    let arguments = ["--profile", PROFILE.0, "--config", CONFIG];
    let chain = VmChain::start_with("usb-meters", User::Root, CHAIN_S, &arguments)?;
    let mut all = vec![watch(&mut watched, ["load_straight", "compensation_straight"])?];
    qmp.press("spc")?;
    for (load, compensation, held) in BENDS {
        qmp.act(&[Act::Key("right", true)])?;
        sleep(held);
        qmp.act(&[Act::Key("right", false)])?;
        sleep(REST);
        all.push(watch(&mut watched, [load, compensation])?);
    }
    signal("slave", "STOP")?;
    let [_, load, compensation] = watched.watch(STOPPED, 2 * SETTLED_NS)?;
    signal("slave", "CONT")?;
    verdict.check("dark_in_a_fault", load.is_dark() && compensation.is_dark(), load.word() + &compensation.word());
    qmp.press("esc")?;
    sleep(REST);
    let after = watched.look()?;
    verdict.check("as_before", after == before, format!("{after:?}").replace(' ', ""));
    let (ended, journal) = chain.end()?;
    unplugged(qmp, KEYBOARD.0, KEYBOARD.1)?;
    let mut told: [Vec<usize>; 2] = Default::default();
    let mut n_swapped = 0;
    for seen in &all {
        let due = due(&journal, seen.from_ns, seen.to_ns);
        let flashes = seen.codes.each_ref().map(Code::flashes);
        let meets = |light: usize, meter: usize| {
            let [least, most] = due[meter];
            !flashes[light].is_empty() && flashes[light].iter().all(|n| (least..=most).contains(n))
        };
        for (k, name) in seen.names.into_iter().enumerate() {
            let figure = format!("{:?}of{:?},{}", flashes[k], due[k], seen.codes[k].word());
            verdict.check(name, meets(k, k), figure.replace(' ', ""));
        }
        n_swapped += usize::from(meets(0, 1) && meets(1, 0));
        told.iter_mut().zip(&flashes).for_each(|(told, flashes)| told.extend(flashes));
    }
    verdict.check("control_swapped_differs", n_swapped < all.len(), format!("{n_swapped}/{}", all.len()));
    // Each has told several values: a light that always flashes once would not do.
    let n_values = told.each_mut().map(|told| {
        told.sort_unstable();
        told.dedup();
        told.len()
    });
    verdict.check("values_told", n_values.iter().all(|n| *n >= 2), format!("{told:?}").replace(' ', ""));
    // A slave that was stopped for so long has missed samples, and that is told by the code; nobody has died.
    verdict.check("ended", ended.code.is_some(), format!("{:?}", ended.code));
    if !verdict.passed() {
        verdict.check("said", false, format!("{:?}", ended.stderr));
    }
    Ok(verdict)
}

/// What the lights of load and compensation show once they have told the peak of before to its end.
fn watch(watched: &mut Watched, names: [&'static str; 2]) -> anyhow::Result<Seen> {
    let from_ns = clock::monotonic_ns();
    let [_, load, compensation] = watched.watch(LOOKED_AT, SETTLING_NS)?;
    Ok(Seen { names, from_ns, to_ns: clock::monotonic_ns(), codes: [load, compensation] })
}

/// Quarters of load and compensation by the recording within a stretch of time, the least and the most of each.
fn due(journal: &Journal, from_ns: i64, to_ns: i64) -> [[usize; 2]; 2] {
    let largest = |all: [f64; 3]| all.into_iter().map(f64::abs).fold(0.0, f64::max);
    let within = |at_ns: i64| (from_ns..to_ns).contains(&at_ns);
    let states = journal.states.iter().filter(|state| within(state.sample_ns));
    let loads = states.map(|state| largest(three(&state.measured_tau_n)) / LIMIT_N);
    let commands = journal.commands.iter().filter(|command| within(command.sample_ns));
    let shares = commands.map(|command| {
        let (told_m, bare_m) = (three(&command.q_tilde_m), three(&command.q_uncompensated_m));
        largest(core::array::from_fn(|k| told_m[k] - bare_m[k])) / largest(told_m).max(LEAST_WAY_M)
    });
    [bounds(loads), bounds(shares)]
}

/// The least and the most quarters of some ratios; of none at all the least is above the most, which no light meets.
fn bounds(ratios: impl Iterator<Item = f64>) -> [usize; 2] {
    let (least, most) = ratios.fold((f64::INFINITY, 0.0_f64), |(least, most), r| (least.min(r), most.max(r)));
    [least, most].map(|ratio| (4.0 * ratio).clamp(0.0, 4.0) as usize)
}
