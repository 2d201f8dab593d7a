//! Listens to the bus beside the master: what drives were told at each SYNC, where they were, what they cried.

use crate::world::INTERFACE;
use krait_drives::cia402::{CanListener, Frame, has_torque};
use krait_ipc::clock::monotonic_ns;

/// What was on the bus.
pub struct Monitor {
    listener: CanListener,
    newest: [i32; 3],
    /// When each SYNC was heard, and the targets that were told before it.
    pub syncs: Vec<(i64, [i32; 3])>,
    /// When each emergency was heard, of which node, its code.
    pub emergencies: Vec<(i64, u8, u16)>,
    /// Where drives are by their newest answers.
    pub counts: [i32; 3],
    pub status: [u16; 3],
    pub n_boots: [u32; 3],
    /// Questions for objects and commands of the network's management, which a chain sends before its drives have power.
    pub n_strange: u32,
    /// Answers of drives without power.
    pub n_unpowered: u32,
}

impl Monitor {
    pub fn new() -> anyhow::Result<Self> {
        Ok(Self {
            listener: CanListener::open(INTERFACE)?,
            newest: [0; 3],
            syncs: Vec::new(),
            emergencies: Vec::new(),
            counts: [0; 3],
            status: [0; 3],
            n_boots: [0; 3],
            n_strange: 0,
            n_unpowered: 0,
        })
    }

    /// Takes what has arrived.
    pub fn drain(&mut self) -> anyhow::Result<()> {
        while let Some(frame) = self.listener.receive(i64::MIN)? {
            self.take(&frame, monotonic_ns());
        }
        Ok(())
    }

    fn take(&mut self, frame: &Frame, now_ns: i64) {
        let (function, node) = (frame.id() & 0x780, usize::from(frame.id() & 0x7F));
        match (function, node, frame.data()) {
            (0x080, 0, _) => self.syncs.push((now_ns, self.newest)),
            (0x080, 1..=3, [low, high, ..]) => {
                self.emergencies.push((now_ns, node as u8, u16::from_le_bytes([*low, *high])));
            }
            (0x200, 1..=3, [_, _, p0, p1, p2, p3]) => {
                self.newest[node - 1] = i32::from_le_bytes([*p0, *p1, *p2, *p3]);
            }
            (0x180, 1..=3, [s0, s1, p0, p1, p2, p3, ..]) => {
                self.status[node - 1] = u16::from_le_bytes([*s0, *s1]);
                self.n_unpowered += u32::from(!has_torque(self.status[node - 1]));
                self.counts[node - 1] = i32::from_le_bytes([*p0, *p1, *p2, *p3]);
            }
            (0x600, 1..=3, _) | (0, 0, _) => self.n_strange += 1,
            (0x700, 1..=3, [0]) => self.n_boots[node - 1] += 1,
            _ => {}
        }
    }

    /// Steps of the first drive's target from SYNC to SYNC since an instant, counts.
    pub fn steps_since(&self, from_ns: i64) -> Vec<i32> {
        let first = self.syncs.partition_point(|(heard_ns, _)| *heard_ns < from_ns).saturating_sub(1);
        self.syncs[first..].windows(2).map(|pair| pair[1].1[0] - pair[0].1[0]).collect()
    }
}
