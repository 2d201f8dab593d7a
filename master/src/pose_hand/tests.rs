//! A pose sender that moves, jumps, falls silent, sends nonsense and is not alone.

use super::*;
use crate::MasterConfig;

const MS: i64 = 1_000_000;
const CLOSED: f64 = 1.0;
const OPEN: f64 = 0.0;

fn address(port: u16) -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], port))
}

fn packet(gripper: f64, x: f64) -> [u8; 72] {
    PosePacket { gripper, position: [x, 0.0, 0.0], orientation: [1.0, 0.0, 0.0, 0.0] }.encode()
}

fn response() -> Response {
    Response::new(&MasterConfig::default())
}

struct Bench {
    hand: PoseHand,
    now_ns: i64,
}

impl Bench {
    /// A hand that was seen open and holds now, at 0 m.
    fn held() -> Self {
        let mut bench = Self { hand: PoseHand::new(PoseConfig::default()), now_ns: 0 };
        bench.send(OPEN, 0.0).expect("open");
        bench.send(CLOSED, 0.0).expect("closed");
        assert!(bench.hand.is_held());
        bench
    }

    fn send(&mut self, gripper: f64, x: f64) -> Result<(), PoseRefusal> {
        self.now_ns += MS;
        self.hand.on_packet(&packet(gripper, x), address(1), self.now_ns)
    }

    /// The tip's way to the right, m, in so many ticks of a millisecond.
    fn way_m(&mut self, n_ticks: usize) -> f64 {
        (0..n_ticks).map(|_| self.tick() * 1e-3).sum()
    }

    fn tick(&mut self) -> f64 {
        self.now_ns += MS;
        self.hand.watch(self.now_ns);
        self.hand.step(&response(), self.now_ns).tip_vel_in_view_m_per_s[0]
    }
}

#[test]
fn the_tip_goes_the_hands_way_times_the_scale_evenly_or_in_bursts_and_where_the_hand_is_does_not_matter() {
    let mut ways = Vec::new();
    for (n_per_burst, from_m) in [(1, 0.0), (1, 5.0), (20, -3.0)] {
        let mut bench = Bench { hand: PoseHand::new(PoseConfig::default()), now_ns: 0 };
        bench.send(OPEN, from_m).expect("open");
        bench.send(CLOSED, from_m).expect("closed");
        let mut way_m = 0.0;
        // 20 mm in 400 ms: 50 mm/s, a fifth of the hand's full speed.
        for step in 1..=400_i32 {
            way_m += bench.tick() * 1e-3;
            if step % n_per_burst == 0 {
                for of_burst in (step - n_per_burst + 1)..=step {
                    let x = from_m + f64::from(of_burst) * 50e-6;
                    bench.hand.on_packet(&packet(CLOSED, x), address(1), bench.now_ns).expect("a hand's motion");
                }
            }
        }
        // The hand stands still.
        for _ in 0..600 {
            way_m += bench.tick() * 1e-3;
            bench.hand.on_packet(&packet(CLOSED, from_m + 0.02), address(1), bench.now_ns).expect("still");
        }
        ways.push(way_m);
    }
    // A tenth of 20 mm, less what is within the dead zone (3 % of 7.5 mm of the hand, a tenth of it at the tip) and a little
    // that is still being made up for.
    for way_m in ways {
        assert!((1.96e-3..=2.0e-3).contains(&way_m), "{way_m}");
    }
}

#[test]
fn a_closed_gripper_that_was_never_seen_open_moves_nothing() {
    let mut bench = Bench { hand: PoseHand::new(PoseConfig::default()), now_ns: 0 };
    for step in 0..50_i32 {
        bench.send(CLOSED, f64::from(step) * 1e-4).expect("a packet");
        assert_eq!((bench.tick(), bench.hand.is_held()), (0.0, false));
    }
    assert_eq!(bench.hand.state(), DeviceState::AtRest);
}

#[test]
fn what_happens_while_the_gripper_is_open_moves_nothing_and_neither_does_taking_hold_elsewhere() {
    let mut bench = Bench::held();
    bench.send(OPEN, 0.0).expect("open");
    bench.send(OPEN, 1.0).expect("far, while open");
    bench.send(CLOSED, 1.0).expect("closed there");
    assert_eq!(bench.way_m(50), 0.0);
    assert!(bench.hand.is_held() && bench.hand.flags() == 0);
}

#[test]
fn a_jump_ends_the_hold_with_its_name_until_the_gripper_was_open() {
    let mut bench = Bench::held();
    bench.send(CLOSED, 0.001).expect("moves");
    assert!(bench.tick() > 0.0);
    assert_eq!(bench.send(CLOSED, 0.2), Err(PoseRefusal::Jumped));
    assert_eq!((bench.tick(), bench.hand.is_held(), bench.hand.flags()), (0.0, false, OperatorInput::HAND_JUMPED));
    bench.send(CLOSED, 0.201).expect("goes on elsewhere");
    assert_eq!((bench.tick(), bench.hand.is_held(), bench.hand.flags()), (0.0, false, OperatorInput::HAND_JUMPED));
    bench.send(OPEN, 0.2).expect("open");
    bench.send(CLOSED, 0.2).expect("closed");
    assert!(bench.hand.is_held() && bench.hand.flags() == 0);
    assert_eq!(bench.hand.n_refused(PoseRefusal::Jumped), 1);
}

#[test]
fn a_turn_that_no_hand_makes_is_a_jump_too() {
    let mut bench = Bench::held();
    let half_turn = PosePacket { gripper: CLOSED, position: [0.0; 3], orientation: [0.0, 0.0, 1.0, 0.0] }.encode();
    assert_eq!(bench.hand.on_packet(&half_turn, address(1), bench.now_ns + MS), Err(PoseRefusal::Jumped));
}

#[test]
fn silence_beyond_the_lease_is_a_loss_and_the_hand_must_open_first() {
    let mut bench = Bench::held();
    bench.send(CLOSED, 0.001).expect("moves");
    let heard_ns = bench.now_ns;
    bench.hand.watch(heard_ns + 100 * MS);
    assert!(bench.hand.is_held());
    bench.hand.watch(heard_ns + 100 * MS + 1);
    assert_eq!((bench.hand.is_held(), bench.hand.state()), (false, DeviceState::Lost));
    bench.now_ns = heard_ns + 150 * MS;
    bench.send(CLOSED, 0.001).expect("heard again");
    assert_eq!((bench.hand.is_held(), bench.hand.state(), bench.tick()), (false, DeviceState::AtRest, 0.0));
    let mut slept = Bench::held();
    slept.now_ns += 150 * MS;
    slept.send(CLOSED, 0.001).expect("nobody looked meanwhile");
    assert!(!slept.hand.is_held());
}

#[test]
fn a_second_sender_is_ignored_until_the_first_has_been_silent_for_long() {
    let mut bench = Bench::held();
    let other = |bench: &mut Bench, gripper, at_ns| bench.hand.on_packet(&packet(gripper, 0.0), address(2), at_ns);
    let heard_ns = bench.now_ns;
    assert_eq!(other(&mut bench, OPEN, heard_ns + MS), Err(PoseRefusal::AnotherSender));
    assert!(bench.hand.is_held(), "nor does it let go");
    assert_eq!(other(&mut bench, CLOSED, heard_ns + 2000 * MS), Err(PoseRefusal::AnotherSender));
    assert_eq!(bench.hand.state(), DeviceState::Lost, "its packets renew no lease");
    other(&mut bench, CLOSED, heard_ns + 2001 * MS).expect("taken over");
    assert!(!bench.hand.is_held(), "it has not been seen open");
    assert_eq!(bench.send(OPEN, 0.0), Err(PoseRefusal::AnotherSender), "the first is now the second");
    other(&mut bench, OPEN, heard_ns + 2002 * MS).expect("open");
    other(&mut bench, CLOSED, heard_ns + 2003 * MS).expect("closed");
    assert!(bench.hand.is_held());
    assert_eq!(bench.hand.n_refused(PoseRefusal::AnotherSender), 3);
}

#[test]
fn nonsense_is_counted_renews_no_lease_and_binds_nobody() {
    let mut bench = Bench::held();
    let heard_ns = bench.now_ns;
    for step in 1..=200 {
        let refused = bench.hand.on_packet(&[0; 71], address(1), heard_ns + step * MS);
        assert_eq!(refused, Err(PoseRefusal::WrongSize));
    }
    assert_eq!((bench.hand.state(), bench.hand.counts()), (DeviceState::Lost, (2, 200)));
    let mut fresh = PoseHand::new(PoseConfig::default());
    fresh.on_packet(&[0; 72], address(9), 0).expect_err("no kind");
    fresh.on_packet(&packet(OPEN, 0.0), address(1), 1).expect("the first that speaks sense");
    assert_eq!(fresh.state(), DeviceState::AtRest);
}

#[test]
fn however_fast_the_hand_the_tip_is_no_faster_than_its_full_speed_and_stops_soon_after_it() {
    let mut bench = Bench::held();
    let full = MasterConfig::default().full_speed_m_per_s;
    for step in 1..=300_i32 {
        bench.send(CLOSED, f64::from(step) * 2e-3).expect("2 m/s of packets' time, below a jump");
        assert!(bench.tick() <= full * (1.0 + 1e-12));
    }
    // The hand stands still: at most the stretch is made up for.
    let way_m = (0..90).map(|_| bench.tick() * 1e-3).sum::<f64>();
    assert!(way_m > 0.0 && way_m <= full * PoseConfig::default().follow_s, "{way_m}");
}
