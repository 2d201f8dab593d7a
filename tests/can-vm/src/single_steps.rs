//! `krait drives --watch` and `--jog` on the interface: what is shown is where the drives are, and a key press is one small step.

use crate::monitor::Monitor;
use crate::program::{CONFIG, TURNED, ZERO, krait};
use crate::verdict::PartVerdict;
use crate::world::{INTERFACE, PER_M, kill};
use anyhow::{Context, bail, ensure};
use core::time::Duration;
use krait_drives::cia402::has_torque;
use rustix::process::Signal;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};

/// Longest step of one key press, counts: 0.1 mm.
const STEP: i32 = (PER_M / 1e4) as i32;
/// Of the drive that is moved, from 1.
const MOVED: usize = 2;

/// Where the three drives are by two documents of `--watch`, one after the other.
fn watched() -> anyhow::Result<Vec<i64>> {
    let mut watch = krait(&["drives", "--watch", "--interface", INTERFACE, "--last-id", "5", "--json"])
        .stdout(Stdio::piped())
        .spawn()
        .context("krait drives --watch")?;
    let said = watch.stdout.take().context("its standard output")?;
    let mut documents = serde_json::Deserializer::from_reader(said).into_iter::<Value>();
    let mut newest = Vec::new();
    for _ in 0..2 {
        let document = documents.next().context("--watch has ended")??;
        let drives = document.as_array().context("no list of drives")?;
        let ids: Vec<_> = drives.iter().filter_map(|drive| drive["id"].as_u64()).collect();
        ensure!(ids == [1, 2, 3], "--watch shows the drives {ids:?}");
        newest = drives.iter().filter_map(|drive| drive["reading"]["counts"].as_i64()).collect();
    }
    kill(&watch, Signal::INT)?;
    let ended = watch.wait()?;
    ensure!(ended.success(), "--watch ended with {ended}");
    Ok(newest)
}

/// `--jog` with its keys, and the bus beside it.
struct Jog<'a> {
    program: Child,
    keys: Option<ChildStdin>,
    lines: Receiver<String>,
    monitor: &'a mut Monitor,
    /// Farthest that each drive was from where it stood before the newest key, counts.
    farthest: [i32; 3],
}

impl<'a> Jog<'a> {
    fn begin(config: &str, monitor: &'a mut Monitor) -> anyhow::Result<Self> {
        let mut program = krait(&["drives", "--jog", &MOVED.to_string(), "--config", config])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .context("krait drives --jog")?;
        let (keys, said) = (program.stdin.take(), program.stdout.take().context("its standard output")?);
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            BufReader::new(said).lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        let mut jog = Self { program, keys, lines, monitor, farthest: [0; 3] };
        let line = jog.line()?;
        ensure!(line.contains("is under power"), "--jog says {line:?}");
        Ok(jog)
    }

    /// The next line that it says, with the bus watched meanwhile.
    fn line(&mut self) -> anyhow::Result<String> {
        let before = self.monitor.counts;
        self.farthest = [0; 3];
        for _ in 0..20_000 {
            std::thread::sleep(Duration::from_millis(1));
            self.monitor.drain()?;
            for (k, farthest) in self.farthest.iter_mut().enumerate() {
                let way = self.monitor.counts[k] - before[k];
                *farthest = if way.abs() > farthest.abs() { way } else { *farthest };
            }
            if let Ok(line) = self.lines.try_recv() {
                return Ok(line);
            }
        }
        bail!("--jog says nothing")
    }

    /// A key and Enter: how far each drive went, and what was said.
    fn press(&mut self, key: &str) -> anyhow::Result<([i32; 3], String)> {
        for _ in 0..3 {
            let before = self.monitor.counts;
            self.keys.as_mut().context("its keys")?.write_all(format!("{key}\n").as_bytes())?;
            let said = self.line()?;
            // The machine stood still for too long, and the key has moved nothing.
            if !said.starts_with("the drives had stopped") {
                return Ok((core::array::from_fn(|k| self.monitor.counts[k] - before[k]), said));
            }
        }
        bail!("the machine stood still again and again")
    }

    /// The end of its keys takes the power.
    fn end(mut self) -> anyhow::Result<bool> {
        self.keys = None;
        let ended = loop {
            std::thread::sleep(Duration::from_millis(1));
            self.monitor.drain()?;
            if let Some(ended) = self.program.try_wait()? {
                break ended;
            }
        };
        self.monitor.drain()?;
        Ok(ended.success() && !self.monitor.status.iter().any(|status| has_torque(*status)))
    }
}

/// The drives stand at [`ZERO`], and do so again at the end.
pub fn judge(verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let mut monitor = Monitor::new()?;
    let zero = i64::from(ZERO);
    let shown = watched()?;
    verdict.check("watch_shows_zero", shown == [zero; 3], format!("{shown:?}"));

    let mut jog = Jog::begin(CONFIG, &mut monitor)?;
    let push = Key { name: "step", key: "", counts: STEP, words: "told 0.100 mm, reads 0.100 mm" };
    judge_key(&mut jog, &push, verdict)?;
    let is_off = jog.end()?;
    verdict.check("jog_ends_without_power", is_off, is_off);
    let shown = watched()?;
    verdict.check("watch_shows_the_step", shown == [zero, zero + i64::from(STEP), zero], format!("{shown:?}"));

    // Wound the other way round, the same key moves the other way.
    let turned = std::fs::read_to_string(CONFIG)?.replacen("id = 2\n", "id = 2\nsign = -1\n", 1);
    std::fs::write(TURNED, turned).context(TURNED)?;
    let mut jog = Jog::begin(TURNED, &mut monitor)?;
    for key in [
        Key { name: "turned_back", key: "-", counts: STEP, words: "told -0.200 mm, reads -0.200 mm" },
        Key { name: "turned_step", key: "", counts: -STEP, words: "told -0.100 mm, reads -0.100 mm" },
        Key { name: "turned_again", key: "", counts: -STEP, words: "told 0.000 mm, reads 0.000 mm" },
    ] {
        judge_key(&mut jog, &key, verdict)?;
    }
    let is_off = jog.end()?;
    verdict.check("turned_ends_without_power", is_off, is_off);
    let shown = watched()?;
    verdict.check("watch_shows_zero_again", shown == [zero; 3], format!("{shown:?}"));
    Ok(())
}

/// What a key press must come to.
struct Key {
    name: &'static str,
    key: &'static str,
    /// Way of the drive, counts.
    counts: i32,
    words: &'static str,
}

/// One key press: the drive goes by what is expected and at no instant farther, the others stand. A count is rounding.
fn judge_key(jog: &mut Jog<'_>, expected: &Key, verdict: &mut PartVerdict) -> anyhow::Result<()> {
    let (way, said) = jog.press(expected.key)?;
    let is_right = (way[MOVED - 1] - expected.counts).abs() <= 1 && jog.farthest[MOVED - 1].abs() <= STEP + 1;
    let others_stand = jog.farthest[0] == 0 && jog.farthest[2] == 0;
    let is_said = said.replace("-0.000", "0.000").starts_with(expected.words);
    let found = format!("{way:?},farthest_{:?},\"{said}\"", jog.farthest);
    verdict.check(expected.name, is_right && others_stand && is_said, found);
    Ok(())
}
