//! The drive pad of a page as a device: a hand that must be heard of again and again, or it counts as gone. Pure.
//!
//! Whoever holds the pad has a lease, renewed by each frame. A lease that runs out drops presence, and the hand must be seen
//! off the pad before it counts again: a page that hung and comes back with the finger still down moves nothing.

use krait_ipc::message::{DeviceState, DriveWish};

/// Why a frame of a pad does not count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PadRefusal {
    /// No pad can say this.
    OutOfRange,
    /// Another page holds the pad.
    AnotherDrives,
    /// It was heard before, or one that was said later was.
    Repeated,
    /// It is about an instant that is too long ago, or has yet to come.
    NotFresh,
    /// The hand must be off the pad first.
    LetGoFirst,
}

/// Follows the page that drives.
#[derive(Clone, Copy, Debug, Default)]
pub struct PadLease {
    driver: Option<Driver>,
    held: Option<Held>,
    is_lost: bool,
    n_taken: u64,
    n_refused: u64,
}

/// The page that drives, or did last.
#[derive(Clone, Copy, Debug)]
struct Driver {
    sender_pid: u32,
    page: u64,
    frame: u64,
    must_let_go: bool,
}

/// A pad that is held.
#[derive(Clone, Copy, Debug)]
struct Held {
    since_ns: i64,
    deflection_permille: [i32; 2],
    jaw: [bool; 2],
}

impl PadLease {
    /// Takes what a page said. To let go counts however old it is.
    ///
    /// # Errors
    /// [`PadRefusal`], which is also counted.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn on_wish(&mut self, wish: &DriveWish, now_ns: i64) -> Result<(), PadRefusal> {
        self.watch(now_ns);
        let judged = self.judge(wish, now_ns);
        self.n_taken += u64::from(judged.is_ok());
        self.n_refused += u64::from(judged.is_err());
        judged
    }

    /// Notes whether the lease has run out.
    pub fn watch(&mut self, now_ns: i64) {
        if self.held.is_some_and(|held| now_ns.saturating_sub(held.since_ns) > DriveWish::LEASE_NS) {
            self.lose();
        }
    }

    /// The channel is gone.
    pub fn lose(&mut self) {
        (self.held, self.is_lost) = (None, true);
        if let Some(driver) = &mut self.driver {
            driver.must_let_go = true;
        }
    }

    /// The deflection along view x and y while the pad is held, thousandths.
    pub fn deflection_permille(&self) -> Option<[i32; 2]> {
        self.held.map(|held| held.deflection_permille)
    }

    /// Whether the jaw of a gripper shall open, and whether it shall close, while the pad is held.
    pub fn jaw(&self) -> [bool; 2] {
        self.held.map_or([false; 2], |held| held.jaw)
    }

    /// What is known of the pad.
    pub fn state(&self) -> DeviceState {
        match (self.driver, self.held) {
            _ if self.is_lost => DeviceState::Lost,
            (_, Some(_)) => DeviceState::Live,
            (Some(_), None) => DeviceState::AtRest,
            (None, None) => DeviceState::Waiting,
        }
    }

    /// Frames that counted, and frames that were refused.
    pub fn counts(&self) -> (u64, u64) {
        (self.n_taken, self.n_refused)
    }

    fn judge(&mut self, wish: &DriveWish, now_ns: i64) -> Result<(), PadRefusal> {
        if !wish.is_valid() {
            return Err(PadRefusal::OutOfRange);
        }
        let is_driver = |driver: &Driver| (driver.sender_pid, driver.page) == (wish.sender_pid, wish.page);
        let mut driver = match self.driver.filter(is_driver) {
            Some(driver) => driver,
            None if self.held.is_some() => return Err(PadRefusal::AnotherDrives),
            None => Driver { sender_pid: wish.sender_pid, page: wish.page, frame: 0, must_let_go: true },
        };
        if !wish.is_held() {
            driver.frame = driver.frame.max(wish.frame);
            driver.must_let_go = false;
            (self.driver, self.held, self.is_lost) = (Some(driver), None, false);
            return Ok(());
        }
        if wish.frame <= driver.frame || self.held.is_some_and(|held| wish.sample_ns < held.since_ns) {
            return Err(PadRefusal::Repeated);
        }
        if !(0..=DriveWish::LEASE_NS).contains(&now_ns.saturating_sub(wish.sample_ns)) {
            return Err(PadRefusal::NotFresh);
        }
        driver.frame = wish.frame;
        self.driver = Some(driver);
        if driver.must_let_go {
            return Err(PadRefusal::LetGoFirst);
        }
        let DriveWish { sample_ns: since_ns, deflection_permille, .. } = *wish;
        self.held = Some(Held { since_ns, deflection_permille, jaw: wish.jaw() });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn wish(page: u64, frame: u64, sample_ns: i64, is_held: bool) -> DriveWish {
        let flags = u32::from(is_held);
        DriveWish { sequence: 1, sample_ns, page, frame, sender_pid: 7, flags, deflection_permille: [500, 0] }
    }

    /// A pad that page 1 holds since 0.
    fn held() -> PadLease {
        let mut pad = PadLease::default();
        pad.on_wish(&wish(1, 1, 0, false), 0).expect("off the pad");
        pad.on_wish(&wish(1, 2, 0, true), 0).expect("held");
        pad
    }

    #[test]
    fn a_hold_counts_for_its_lease_and_comes_back_only_after_it_was_let_go() {
        let mut pad = held();
        pad.watch(150 * MS);
        assert_eq!((pad.deflection_permille(), pad.state()), (Some([500, 0]), DeviceState::Live));
        pad.watch(150 * MS + 1);
        assert_eq!((pad.deflection_permille(), pad.state()), (None, DeviceState::Lost));
        assert_eq!(pad.on_wish(&wish(1, 3, 160 * MS, true), 160 * MS), Err(PadRefusal::LetGoFirst));
        assert_eq!((pad.deflection_permille(), pad.state()), (None, DeviceState::Lost));
        pad.on_wish(&wish(1, 4, 170 * MS, false), 170 * MS).expect("let go");
        assert_eq!(pad.state(), DeviceState::AtRest);
        pad.on_wish(&wish(1, 5, 180 * MS, true), 180 * MS).expect("held anew");
        assert_eq!(pad.state(), DeviceState::Live);
    }

    #[test]
    fn a_lease_that_ran_out_while_nobody_looked_is_lost_all_the_same() {
        let mut pad = held();
        assert_eq!(pad.on_wish(&wish(1, 3, 400 * MS, true), 400 * MS), Err(PadRefusal::LetGoFirst));
    }

    #[test]
    fn the_lease_counts_from_the_hand_and_not_from_the_arrival() {
        let mut pad = held();
        pad.on_wish(&wish(1, 3, 10 * MS, true), 150 * MS).expect("held up on its way");
        pad.watch(161 * MS);
        assert_eq!(pad.state(), DeviceState::Lost);
    }

    #[test]
    fn what_is_old_repeated_or_from_the_future_renews_nothing() {
        let mut pad = held();
        for (frame, sample_ns, why) in [
            (2, 100 * MS, PadRefusal::Repeated),
            (1, 100 * MS, PadRefusal::Repeated),
            (3, -60 * MS, PadRefusal::Repeated),
            (3, 100 * MS + 1, PadRefusal::NotFresh),
            (3, i64::MAX, PadRefusal::NotFresh),
        ] {
            assert_eq!(pad.on_wish(&wish(1, frame, sample_ns, true), 100 * MS), Err(why), "{frame} {sample_ns}");
        }
        let mut fresh = PadLease::default();
        fresh.on_wish(&wish(1, 1, 0, false), 0).expect("off the pad");
        for sample_ns in [0, i64::MIN] {
            assert_eq!(fresh.on_wish(&wish(1, 2, sample_ns, true), 151 * MS), Err(PadRefusal::NotFresh));
        }
        pad.watch(150 * MS + 1);
        assert_eq!((pad.state(), pad.counts()), (DeviceState::Lost, (2, 5)));
        assert_eq!(fresh.state(), DeviceState::AtRest);
    }

    #[test]
    fn no_other_page_drives_or_stops_while_one_holds_and_the_next_one_must_show_its_hand_off_the_pad() {
        let mut pad = held();
        for is_held in [true, false] {
            assert_eq!(pad.on_wish(&wish(2, 9, 10 * MS, is_held), 10 * MS), Err(PadRefusal::AnotherDrives));
        }
        assert_eq!(pad.state(), DeviceState::Live);
        pad.on_wish(&wish(1, 3, 20 * MS, false), 20 * MS).expect("let go");
        assert_eq!(pad.on_wish(&wish(2, 10, 30 * MS, true), 30 * MS), Err(PadRefusal::LetGoFirst));
        pad.on_wish(&wish(2, 11, 40 * MS, false), 40 * MS).expect("off the pad");
        pad.on_wish(&wish(2, 12, 50 * MS, true), 50 * MS).expect("drives");
        let of_another_console = DriveWish { sender_pid: 8, ..wish(2, 13, 60 * MS, true) };
        assert_eq!(pad.on_wish(&of_another_console, 60 * MS), Err(PadRefusal::AnotherDrives));
    }

    #[test]
    fn to_let_go_counts_however_old_it_is_and_nonsense_never_does() {
        let mut pad = held();
        for nonsense in [
            DriveWish { flags: 8 + 1, ..wish(1, 3, 0, true) },
            DriveWish { deflection_permille: [1001, 0], ..wish(1, 3, 0, true) },
            DriveWish { deflection_permille: [0, i32::MIN], ..wish(1, 3, 0, true) },
        ] {
            assert_eq!(pad.on_wish(&nonsense, 0), Err(PadRefusal::OutOfRange));
        }
        pad.on_wish(&wish(1, 0, -900 * MS, false), 100 * MS).expect("let go");
        assert_eq!(pad.state(), DeviceState::AtRest);
        assert_eq!(pad.on_wish(&wish(1, 2, 100 * MS, true), 100 * MS), Err(PadRefusal::Repeated), "of before");
    }
}
