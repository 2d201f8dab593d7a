//! The machine's own QEMU, spoken to from inside: its control socket is the machine's second serial port. It plugs USB devices of
//! QEMU's making in and out and works them as a person would.

use anyhow::{Context, bail};
use core::time::Duration;
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::sync::mpsc::{Receiver, channel};
use std::thread::sleep;

/// The serial port, which /init has made transparent.
const PORT: &str = "/dev/ttyS1";
/// How long an answer is waited for, of the machine's time: QEMU gives it in milliseconds, and a host that is busy stops the machine too.
const PATIENCE: Duration = Duration::from_secs(60);

/// A conversation with QEMU.
#[derive(Debug)]
pub struct Qmp {
    to: File,
    lines: Receiver<std::io::Result<String>>,
    n_asked: u64,
}

impl Qmp {
    /// Begins it.
    ///
    /// # Errors
    /// There is no such port, or no QEMU behind it.
    pub fn open() -> anyhow::Result<Self> {
        let to = OpenOptions::new().read(true).write(true).open(PORT).context(PORT)?;
        let from = BufReader::new(to.try_clone().context(PORT)?);
        let (tell, lines) = channel();
        // It ends with the process: nobody else reads the port.
        std::thread::spawn(move || from.lines().try_for_each(|line| tell.send(line)));
        let mut qmp = Self { to, lines, n_asked: 0 };
        // Until /init had made it transparent, the port gave QEMU's greeting back; this byte makes QEMU forget what it has begun to read.
        qmp.to.write_all(&[0xff, b'\n']).context(PORT)?;
        qmp.ask("qmp_capabilities", &json!({}))?;
        Ok(qmp)
    }

    /// Has QEMU do something, and waits until it has.
    ///
    /// # Errors
    /// It refuses, or says nothing.
    pub fn ask(&mut self, what: &str, arguments: &Value) -> anyhow::Result<()> {
        self.n_asked += 1;
        let mut line = json!({ "execute": what, "arguments": arguments, "id": self.n_asked }).to_string();
        line.push('\n');
        self.to.write_all(line.as_bytes()).context(PORT)?;
        loop {
            let Ok(line) = self.lines.recv_timeout(PATIENCE) else {
                bail!("QEMU has not answered {what} {arguments} in {} s, or {PORT} has ended", PATIENCE.as_secs());
            };
            let line = line.context(PORT)?;
            // The greeting, answers to itself and events come unasked.
            let Ok(said) = serde_json::from_str::<Value>(&line) else { continue };
            if said["id"] != self.n_asked {
                continue;
            }
            if let Some(error) = said.get("error") {
                bail!("QEMU refuses {what} {arguments}: {error}");
            }
            return Ok(());
        }
    }

    /// Plugs in a USB device under a name.
    ///
    /// # Errors
    /// QEMU refuses.
    pub fn plug(&mut self, driver: &str) -> anyhow::Result<()> {
        self.ask("device_add", &json!({ "driver": driver, "id": driver }))
    }

    /// Pulls it out.
    ///
    /// # Errors
    /// QEMU refuses.
    pub fn unplug(&mut self, driver: &str) -> anyhow::Result<()> {
        self.ask("device_del", &json!({ "id": driver }))
    }

    /// What a person does at one instant.
    ///
    /// # Errors
    /// QEMU refuses.
    pub fn act(&mut self, acts: &[Act]) -> anyhow::Result<()> {
        let events: Vec<Value> = acts.iter().map(Act::event).collect();
        self.ask("input-send-event", &json!({ "events": events }))
    }

    /// Presses a key and lets it go.
    ///
    /// # Errors
    /// QEMU refuses.
    pub fn press(&mut self, key: &'static str) -> anyhow::Result<()> {
        for is_down in [true, false] {
            self.act(&[Act::Key(key, is_down)])?;
            sleep(Duration::from_millis(40));
        }
        Ok(())
    }
}

/// One thing that a person does with a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Moves by counts on an axis (`x`, `y`).
    Move(&'static str, i32),
    /// Goes to a place on an axis, 0 to 32767.
    Place(&'static str, i32),
    /// Presses or lets go of a button, by QEMU's name.
    Button(&'static str, bool),
    /// The same with a key.
    Key(&'static str, bool),
}

impl Act {
    fn event(&self) -> Value {
        match *self {
            Self::Move(axis, value) => json!({ "type": "rel", "data": { "axis": axis, "value": value } }),
            Self::Place(axis, value) => json!({ "type": "abs", "data": { "axis": axis, "value": value } }),
            Self::Button(button, down) => json!({ "type": "btn", "data": { "button": button, "down": down } }),
            Self::Key(key, down) => {
                json!({ "type": "key", "data": { "key": { "type": "qcode", "data": key }, "down": down } })
            }
        }
    }
}
