//! A device that talks nonsense: counted, refused, without effect.

use crate::chain::{User, VmChain};
use crate::model::{Model, VENDOR_REPORT_ID};
use crate::spacemouse::SpaceMouse;
use crate::verdict::PartVerdict;
use anyhow::Context;
use krait_ipc::clock;
use std::thread::sleep;
use std::time::Duration;

/// How often every kind is sent.
const N_ROUNDS: u64 = 5;
/// Silence after a volley, so that every report of it has been read.
const SETTLE: Duration = Duration::from_millis(100);
const MOVED_DEG: f64 = 5.0;

/// Short, long, unknown and out-of-range reports change nothing but a count; a good one after them moves the snake.
pub fn malformed() -> anyhow::Result<PartVerdict> {
    // It declares one axis, so that the kernel hands reports on which krait must find too short.
    let mut mouse = SpaceMouse::plug(Model::ShortCompact)?;
    let chain = VmChain::start("malformed", User::Root, 2.5)?;
    mouse.wait_until_read()?;
    let (delivered, droppable) = (delivered(), droppable());
    mouse.press(0)?;
    mouse.release()?;
    let n_good_before = mouse.n_sent;
    let begin_ns = clock::monotonic_ns();
    send_all(&mut mouse, &delivered)?;
    let refused_ns = clock::monotonic_ns();
    send_all(&mut mouse, &droppable)?;
    let end_ns = clock::monotonic_ns();
    let n_bad = mouse.n_sent - n_good_before;
    mouse.hold(250, 300)?;
    mouse.release()?;
    let released_ns = clock::monotonic_ns();
    let n_good = mouse.n_sent - n_bad;
    let (ended, journal) = chain.end()?;
    mouse.unplug()?;

    let mut verdict = PartVerdict::default();
    let n_delivered = N_ROUNDS * delivered.len() as u64;
    let n_droppable = N_ROUNDS * droppable.len() as u64;
    let n_refused = journal.input_at(refused_ns).context("no input")?.n_refused;
    let last = journal.inputs.last().context("no input")?;
    let n_refused_later = last.n_refused.saturating_sub(n_refused);
    verdict.check("refused", n_refused == n_delivered, format!("{n_refused}/{n_delivered}"));
    let kernel_dropped = n_droppable.checked_sub(n_refused_later);
    verdict.check("kernel_dropped", kernel_dropped.is_some(), format!("{kernel_dropped:?}/{n_droppable}"));
    verdict.check("decoded", last.n_reports == n_good, format!("{}/{n_good}", last.n_reports));
    let moved_deg = journal.moved_deg(begin_ns, end_ns);
    verdict.check("moved_deg", moved_deg == 0.0, moved_deg);
    let present = journal.input_at(end_ns).is_some_and(|input| input.operator_present());
    verdict.check("still_present", present, present);
    let good_deg = journal.moved_deg(end_ns, released_ns);
    verdict.check("good_moved_deg", good_deg > MOVED_DEG, format!("{good_deg:.1}"));
    let n_lost = ended.json()?.pointer("/samples/lost").and_then(serde_json::Value::as_u64);
    verdict.check("lost", n_lost == Some(0), format!("{n_lost:?}"));
    verdict.check("exit_code", ended.code == Some(0), format!("{:?}", ended.code));
    Ok(verdict)
}

fn send_all(mouse: &mut SpaceMouse, reports: &[Vec<u8>]) -> anyhow::Result<()> {
    for _ in 0..N_ROUNDS {
        for report in reports {
            mouse.send(report)?;
        }
        sleep(Duration::from_millis(8));
    }
    sleep(SETTLE);
    Ok(())
}

/// What the kernel hands on: as long as declared or longer, under a declared id. Every one would be a push of the cap.
fn delivered() -> Vec<Vec<u8>> {
    let push = |id: u8, n_bytes: usize| {
        let axes = [250_i16.to_le_bytes(); 32].concat();
        [&[id], &axes[..n_bytes - 1]].concat()
    };
    let beyond = [[1].as_slice(), &401_i16.to_le_bytes(), &[0; 4]].concat();
    vec![push(1, 3), push(1, 6), push(1, 8), push(1, 12), push(1, 14), push(1, 64), push(2, 8), push(2, 64)]
        .into_iter()
        .chain([push(3, 8), push(VENDOR_REPORT_ID, 8), beyond])
        .collect()
}

/// What some kernels drop themselves: undeclared ids and reports shorter than declared.
fn droppable() -> Vec<Vec<u8>> {
    vec![vec![1], vec![2, 250], vec![2, 250, 0, 250, 0], vec![9, 1, 2, 3], vec![VENDOR_REPORT_ID]]
}
