//! What is said of drives and a bus that are not as they should be: one sentence, before anybody has power.

use super::{ZERO, three};
use crate::cia402::{Cia402, Frame, State, home_here, open, scan};
use crate::emulator::{CanBus, CanDrive, CanWire};
use crate::{BusGone, Seen};
use core::sync::atomic::AtomicBool;
use krait_slave::{DriveMode, SlaveConfig};

/// Opens a bus, or says why not; nobody gets power or a target.
fn opened(bus: &CanBus, config: &SlaveConfig) -> Result<(Cia402<CanWire>, Seen), String> {
    let sentence = |error: crate::OpenError| error.to_string();
    let opened =
        open::setup(config).map_err(sentence).and_then(|_| Cia402::open(config, bus.own_time().0).map_err(sentence));
    for drive in &bus.lock().drives {
        assert_eq!((drive.state(), drive.n_targets), (State::SwitchOnDisabled, 0));
    }
    if let Err(sentence) = &opened {
        assert!(!sentence.contains('\n') && sentence.len() < 420, "{sentence}");
    }
    opened
}

fn refusal(change: impl Fn(&CanBus, &mut SlaveConfig)) -> String {
    let (bus, mut config) = three();
    change(&bus, &mut config);
    opened(&bus, &config).map(|_| panic!("it was opened")).unwrap_or_else(|sentence: String| sentence)
}

#[test]
fn drives_are_configured_before_they_can_have_power() {
    let (bus, config) = three();
    let (_can, seen) = opened(&bus, &config).unwrap();
    assert_eq!(seen.counts[..3], [ZERO + 1, ZERO + 2, ZERO + 3]);
    for drive in &bus.lock().drives {
        let object = |index, sub| drive.object(index, sub);
        assert_eq!(object(0x1016, 1), 127 << 16 | 50, "it stops by itself 50 ms after the last heartbeat of 127");
        assert_eq!((object(0x1017, 0), object(0x1029, 1), object(0x6007, 0)), (10, 1, 3));
        assert_eq!((object(0x605A, 0), object(0x6085, 0)), (6, 2_048_000), "1 m/s2 in counts");
        assert_eq!((object(0x60C2, 1), object(0x60C2, 2)), (2, 0xFD), "2 times 10 to the -3 s");
        assert_eq!((object(0x6060, 0), object(0x6072, 0)), (8, 500));
        assert_eq!((object(0x1400, 2), object(0x1800, 2)), (1, 1), "at each SYNC");
    }
}

#[test]
fn objects_that_a_drive_may_lack_are_done_without_and_others_are_named() {
    let (bus, config) = three();
    for (index, sub) in [(0x6007, 0), (0x1029, 1), (0x605A, 0), (0x6085, 0), (0x6065, 0), (0x6076, 0), (0x6502, 0)] {
        bus.lock().drives[0].remove_object(index, sub);
    }
    let (_, seen) = opened(&bus, &config).unwrap();
    assert!(seen.torque_nm[0].is_nan() && seen.torque_nm[1].is_finite(), "without 6076 no load: {:?}", seen.torque_nm);
    let sentence = refusal(|bus, _| bus.lock().drives[1].remove_object(0x6072, 0));
    assert!(sentence.contains("actuator 2 (id 2) refuses object 6072:00") && sentence.contains("no such object"));
    assert!(sentence.contains("torque_limit = 1.0"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives[2].remove_object(0x1016, 1));
    assert!(sentence.contains("actuator 3 (id 3) refuses object 1016:01 (abort code 0x06020000"), "{sentence}");
}

#[test]
fn a_drive_that_limits_its_own_speed_to_less_than_the_rate_is_refused_where_its_unit_is_certain() {
    const TURNS_PER_MINUTE: u32 = 0x00B4_4700;
    let limited = |bus: &CanBus, unit: Option<u32>, most: u32| {
        let drive = &mut bus.lock().drives[1];
        if let Some(unit) = unit {
            drive.add_object(0x60A9, 0, unit);
        }
        drive.add_object(0x6080, 0, most);
    };
    // The screw's lead is 2 mm: 30 mm/s are 15 turns/s.
    let rate = |config: &mut SlaveConfig| config.limits.rate_m_per_s = 0.03;
    let sentence = refusal(|bus, config| {
        rate(config);
        limited(bus, Some(TURNS_PER_MINUTE), 899);
    });
    assert!(sentence.contains("actuator 2 (id 2) limits its motor to 899 turns/min (object 6080)"), "{sentence}");
    assert!(sentence.contains("expected at least 900, which its rate_m_per_s needs"), "{sentence}");
    assert!(sentence.contains("lower rate_m_per_s"), "{sentence}");
    // Enough; no limit told; a rate of its own that it can do; other units, or none that it tells.
    let cases: [(Option<u32>, u32, Option<f64>); 6] = [
        (Some(TURNS_PER_MINUTE), 900, None),
        (Some(TURNS_PER_MINUTE), 0, None),
        (Some(TURNS_PER_MINUTE), 450, Some(0.015)),
        (Some(0xFDB4_4700), 1, None),
        (Some(0x00B5_0300), 1, None),
        (None, 1, None),
    ];
    for (unit, most, own) in cases {
        let (bus, mut config) = three();
        rate(&mut config);
        config.drive.actuator[1].rate_m_per_s = own;
        limited(&bus, unit, most);
        assert!(opened(&bus, &config).is_ok(), "{unit:X?} {most} {own:?}");
    }
}

#[test]
fn strangers_and_the_silent_are_named_and_left_alone() {
    let sentence = refusal(|bus, _| bus.lock().drives[1].set_object(0x1018, 2, 0x6350_0000));
    assert!(
        sentence.contains("actuator 2 (id 2) is a stranger: its product is 0x63500000, expected 0x00000001"),
        "{sentence}"
    );
    let sentence = refusal(|bus, _| bus.lock().drives[0].set_object(0x1018, 1, 7));
    assert!(sentence.contains("its vendor is 0x00000007, expected 0x00000555"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives[2].set_object(0x1000, 0, 0x0003_0191));
    assert!(sentence.contains("its device profile is 401, expected 402"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives[2].set_object(0x6502, 0, 0x20));
    assert!(sentence.contains("no cyclic synchronous position mode"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives[1].faults.is_dead = true);
    assert!(sentence.contains("actuator 2 (id 2) does not answer, while others do"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives.clear());
    assert!(sentence.contains("no drive answers on vcan0, expected 3 with the ids 1, 2, 3"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().drives.push(CanDrive::new(2, 0.0)));
    assert!(
        sentence.contains("two drives seem to have the id 2") && sentence.contains("one drive on the bus"),
        "{sentence}"
    );

    // A stranger on the bus is asked nothing and told nothing.
    let (bus, config) = three();
    bus.lock().drives.push(CanDrive::new(9, 0.0));
    opened(&bus, &config).unwrap();
    let stranger = bus.lock().drives[3].clone();
    assert_eq!((stranger.object(0x1016, 1), stranger.object(0x6060, 0), stranger.n_targets), (0, 0, 0));
}

#[test]
fn another_master_is_named_by_what_it_does() {
    for (frame, words) in [
        (Frame::new(0x080, &[]), "it sends SYNC"),
        (Frame::new(0x000, &[1, 0]), "it sends network commands"),
        (Frame::new(0x77F, &[5]), "it sends the heartbeat of node 127"),
        (Frame::new(0x202, &[0; 6]), "it sends targets"),
        (Frame::new(0x602, &[0; 8]), "it sends questions"),
    ] {
        let sentence = refusal(|bus, _| bus.lock().inject(frame));
        assert!(sentence.contains("another master is on the CAN bus") && sentence.contains(words), "{sentence}");
        let (bus, _) = three();
        bus.lock().inject(frame);
        assert!(scan(&mut bus.own_time().0, 5).unwrap_err().to_string().contains(words));
    }
}

#[test]
fn configurations_that_cannot_be_are_refused_before_the_bus_is_touched() {
    let sentence = refusal(|_, config| config.drive.actuator[1].zero_count = None);
    assert!(sentence.contains("actuator 2 has no zero_count"), "{sentence}");
    let sentence = refusal(|_, config| config.drive.actuator[0].zero_count = Some(500));
    assert!(sentence.contains("zero_count 500 is within") && sentence.contains("is_absolute"), "{sentence}");
    let (bus, mut config) = three();
    (config.drive.actuator[0].zero_count, config.drive.actuator[0].is_absolute) = (Some(500), true);
    opened(&bus, &config).unwrap();
    let sentence = refusal(|_, config| {
        (config.drive.actuator[0].counts_per_turn, config.drive.actuator[0].gear) = (100_000_000, 10.0);
    });
    assert!(sentence.contains("more than a drive can count"), "{sentence}");
    let sentence = refusal(|_, config| config.drive.period_ms = 2.001);
    assert!(sentence.contains("object 60C2"), "{sentence}");
    let sentence = refusal(|_, config| config.drive.baud = 125_000);
    assert!(sentence.contains("period_ms = 2: 3") && sentence.contains("125000 baud need"), "{sentence}");
    let sentence = refusal(|bus, _| bus.lock().gone = Some(BusGone { what: crate::texts::CAN_DOWN }));
    assert!(sentence.contains("its CAN interface is down"), "{sentence}");
}

#[test]
fn a_scan_asks_only_and_finds_every_node_strangers_too() {
    let (bus, _) = three();
    bus.lock().drives[1].set_object(0x1000, 0, 0x0003_0191);
    bus.lock().drives[2].set_object(0x6077, 0, 0xFFF6);
    bus.lock().drives[2].add_object(0x6080, 0, 3000);
    bus.lock().drives[2].add_object(0x60A9, 0, 0x00B4_4700);
    let (mut wire, _) = bus.own_time();
    let found = scan(&mut wire, 20).unwrap();
    let told: Vec<_> = found.iter().map(|drive| (drive.id, drive.is_known(), drive.vendor, drive.serial)).collect();
    assert_eq!(told, [(1, true, 0x555, 1), (2, false, 0x555, 2), (3, true, 0x555, 3)]);
    assert_eq!((found[0].most_speed, found[0].velocity_unit), (None, None));
    assert_eq!((found[2].most_speed, found[2].is_in_turns_per_minute()), (Some(3000), true));
    let reading = crate::cia402::CanReading::of(&mut wire, 3).unwrap().unwrap();
    assert_eq!(reading.counts, ZERO + 3);
    assert_eq!(crate::cia402::CanReading::of(&mut wire, 7).unwrap(), None);
    bus.lock().drives.push(CanDrive::new(3, 0.0));
    assert!(scan(&mut wire, 20).unwrap_err().to_string().contains("two drives seem to have the id 3"));
}

/// Nobody asks for a stop.
static GO_ON: AtomicBool = AtomicBool::new(false);

#[test]
fn homing_that_is_ended_leaves_no_power_and_says_so() {
    let (bus, config) = three();
    for k in 0..3 {
        bus.lock().with(k, |drive, out| drive.power_loss(out));
    }
    let (mut can, mut seen) = opened(&bus, &config).unwrap();
    let sentence = can.home(&config, &mut seen, &AtomicBool::new(true)).unwrap_err().to_string();
    assert!(sentence.contains("the drives have no power") && sentence.contains("begin anew"), "{sentence}");
    for drive in &bus.lock().drives {
        assert_eq!((drive.counts(), drive.state(), drive.object(0x6060, 0)), (0, State::SwitchOnDisabled, 8));
    }
    can.home(&config, &mut seen, &GO_ON).unwrap();
    assert_eq!(seen.counts[..3], [ZERO; 3], "it can be begun anew");
}

#[test]
fn homing_where_they_stand_gives_the_zero_and_moves_nothing() {
    let (bus, config) = three();
    // As after power came: the encoders begin at 0, wherever the axes stand.
    for k in 0..3 {
        bus.lock().with(k, |drive, out| drive.power_loss(out));
    }
    let (mut can, mut seen) = opened(&bus, &config).unwrap();
    assert_eq!(seen.counts[..3], [0; 3]);
    let places: Vec<f64> = bus.lock().drives.iter().map(|drive| drive.place).collect();
    can.home(&config, &mut seen, &GO_ON).unwrap();
    assert_eq!(seen.counts[..3], [ZERO; 3]);
    for (drive, place) in bus.lock().drives.iter().zip(places) {
        assert_eq!((drive.place, drive.state(), drive.object(0x6060, 0)), (place, State::SwitchOnDisabled, 8));
    }
    // An emergency stop is pressed on the third: it gets no power, and it is the one that is named.
    bus.lock().with(2, |drive, out| drive.press_emergency_stop(None, out));
    let sentence = can.home(&config, &mut seen, &GO_ON).unwrap_err().to_string();
    assert!(sentence.contains("ctuator 3 (id 3)"), "{sentence}");
    bus.lock().drives[2].release_emergency_stop();
    bus.lock().drives[1].remove_object(0x6098, 0);
    let sentence = can.home(&config, &mut seen, &GO_ON).unwrap_err().to_string();
    assert!(sentence.contains("actuator 2 (id 2) refuses object 6098:00"), "{sentence}");
}

#[test]
fn a_drive_that_keeps_its_count_is_not_homed_beside_others_and_gets_no_power() {
    let (bus, mut config) = three();
    (config.drive.actuator[1].is_absolute, config.drive.actuator[1].zero_count) = (true, Some(0));
    for k in [0, 2] {
        bus.lock().with(k, |drive, out| drive.power_loss(out));
    }
    let (mut can, mut seen) = opened(&bus, &config).unwrap();
    // It would be named if it were told to get power.
    bus.lock().with(1, |drive, out| drive.press_emergency_stop(None, out));
    can.home(&config, &mut seen, &GO_ON).unwrap();
    assert_eq!(seen.counts[..3], [ZERO, ZERO + 2, ZERO]);
    assert_eq!(bus.lock().drives[1].object(0x6098, 0), 0, "it was told no homing method");
    config.drive.actuator[2].zero_count = None;
    let sentence = can.home(&config, &mut seen, &GO_ON).unwrap_err().to_string();
    assert!(sentence.contains("actuator 3 has no zero_count") && sentence.contains("choose one"), "{sentence}");
}

#[test]
fn in_a_dry_run_drives_are_not_homed_because_that_takes_power() {
    let (bus, mut config) = three();
    config.drive.mode = DriveMode::Dry;
    let (mut can, mut seen) = opened(&bus, &config).unwrap();
    let n_frames = bus.lock().n_frames;
    let sentence = can.home(&config, &mut seen, &GO_ON).unwrap_err().to_string();
    assert!(sentence.contains("mode = \"dry\"") && sentence.contains("set it to \"live\""), "{sentence}");
    assert_eq!(bus.lock().n_frames, n_frames, "they were told nothing");
    for drive in &bus.lock().drives {
        assert_eq!((drive.state(), drive.n_targets, drive.object(0x6060, 0)), (State::SwitchOnDisabled, 0, 8));
    }
    // The same before the interface is opened: there is none of this name.
    config.drive.interface = Some("no-such-can".to_owned());
    assert_eq!(home_here(&config, &GO_ON).unwrap_err().to_string(), sentence);
}
