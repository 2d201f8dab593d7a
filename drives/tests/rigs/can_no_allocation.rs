//! A cycle on CAN must not touch the heap once the bus is open, whatever the drives do: a counting allocator watches it.

use crate::allocations::allocations_of;
use crate::can_rig::{ZERO, config, three};
use krait_drives::cia402::{Cia402, Frame, Wire};
use krait_drives::emulator::CanWire;
use krait_drives::{ActuatorBus, BusGone, Goals, Seen, Trouble};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// The emulated bus until it is open; then canned answers, because emulated drives use the heap.
struct Canned {
    inner: CanWire,
    /// 0: not yet; then the status word that drives answer.
    status: Arc<AtomicU32>,
    waiting: [Option<Frame>; 4],
    now_ns: i64,
}

impl Wire for Canned {
    fn send(&mut self, frame: &Frame) -> Result<(), BusGone> {
        let status = self.status.load(Ordering::Relaxed) as u16;
        if status == 0 {
            return self.inner.send(frame);
        }
        if frame.id() == 0x080 {
            let ([low, high], place) = (status.to_le_bytes(), ZERO.to_le_bytes());
            for id in 1..=3 {
                let answer = [low, high, place[0], place[1], place[2], place[3], 5, 0];
                self.waiting[usize::from(id)] = Some(Frame::new(0x180 + id, &answer));
            }
            // One says what has happened to it, and one boots.
            self.waiting[0] = (status == 0x08).then(|| Frame::new(0x082, &[0x10, 0x23, 1, 0, 0, 0, 0, 0]));
        }
        if frame.id() == 0x603 {
            self.waiting[0] = Some(Frame::new(0x583, &[0x80, 0, 0, 0, 0, 0, 0, 0]));
        }
        Ok(())
    }

    fn receive(&mut self, until_ns: i64) -> Result<Option<Frame>, BusGone> {
        if self.status.load(Ordering::Relaxed) == 0 {
            return self.inner.receive(until_ns);
        }
        let next = self.waiting.iter_mut().find_map(Option::take);
        if next.is_none() {
            self.now_ns = self.now_ns.max(until_ns);
        }
        Ok(next)
    }

    fn now_ns(&self) -> i64 {
        self.inner.now_ns().max(self.now_ns)
    }
}

#[test]
fn cycles_of_every_order_allocate_nothing_also_when_drives_fail_or_start_anew() {
    let emulated = three();
    let status = Arc::new(AtomicU32::new(0));
    let wire = Canned { inner: emulated.own_time().0, status: Arc::clone(&status), waiting: [None; 4], now_ns: 0 };
    let (mut bus, _) = Cia402::open(&config(), wire).unwrap();
    let mut seen = Seen::default();
    let goals = Goals { counts: [ZERO; 12], counts_per_s: [1.0; 12] };
    let mut troubles = [Trouble::None; 2];
    let n = allocations_of(|| {
        for (word, is_on) in [(0x40, false), (0x27, true), (0x08, true), (0x07, true)] {
            status.store(word, Ordering::Relaxed);
            for _ in 0..50 {
                bus.switch(is_on, &goals).unwrap();
                bus.ask(&mut seen).unwrap();
            }
            for _ in 0..50 {
                bus.tell(&goals).unwrap();
                bus.ask(&mut seen).unwrap();
                bus.ask(&mut seen).unwrap();
            }
            bus.tell(&goals).unwrap();
            bus.ask(&mut seen).unwrap();
            if word == 0x08 {
                troubles[0] = seen.trouble[1];
            }
            troubles[1] = seen.trouble[1];
        }
    });
    assert_eq!(n, 0);
    assert!(matches!(troubles[0], Trouble::Tripped { code: 0x2310, .. }), "{troubles:?}");
    assert!(matches!(troubles[1], Trouble::Tripped { .. }) && seen.has_answered[..3] == [true; 3]);
}
