//! The master's core: drained reports, losses, ends, the hand's own buttons, and a device that was given back.

use super::*;

const MS: i64 = 1_000_000;

fn core() -> MasterCore {
    MasterCore::new(&MasterConfig { engage: crate::Engage::Once, ..MasterConfig::default() })
        .expect("default configuration")
}

fn push(core: &mut MasterCore, x_counts: i16, now_ns: i64) {
    core.on_report(HidReport::Translation([x_counts, 0, 0]).encode().as_bytes(), now_ns).expect("report");
}

fn press(core: &mut MasterCore, buttons: u32, now_ns: i64) {
    core.on_report(HidReport::Buttons(buttons).encode().as_bytes(), now_ns).expect("report");
}

#[test]
fn only_reports_replaced_before_an_input_carried_them_are_drained() {
    let mut core = core();
    push(&mut core, 1, 0);
    core.on_report(HidReport::Rotation([1, 0, 0]).encode().as_bytes(), 0).expect("the other half");
    assert_eq!(core.on_tick(0).n_drained, 0, "the halves do not replace each other");
    for x in 0..5 {
        push(&mut core, x, MS);
    }
    press(&mut core, 1, MS);
    press(&mut core, 0, MS);
    let input = core.on_tick(MS);
    assert_eq!((input.n_drained, input.raw_axes[0], input.n_reports), (4, 4, 9), "the newest wins");
    assert!(input.operator_present(), "a press between two inputs is not missed");
}

#[test]
fn silence_while_deflected_stops_motion_and_drops_presence_for_good() {
    let mut core = core();
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    assert!(core.on_tick(MS).tip_vel_in_view_m_per_s[0] > 0.0);
    let lost = core.on_tick(101 * MS);
    assert_eq!((lost.device(), lost.flags, lost.buttons), (Some(DeviceState::Lost), 0, 0));
    assert_eq!(lost.tip_vel_in_view_m_per_s, [0.0; 3]);
    push(&mut core, 300, 110 * MS);
    let back = core.on_tick(110 * MS);
    assert_eq!((back.device(), back.operator_present()), (Some(DeviceState::Live), false));
}

#[test]
fn a_loss_that_the_process_slept_through_still_drops_presence() {
    let mut core = core();
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    push(&mut core, 300, 900 * MS);
    assert!(!core.on_tick(900 * MS).operator_present());
}

#[test]
fn an_ended_recording_means_no_motion_and_no_presence_even_while_deflected() {
    let mut core = core();
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    core.on_ended();
    let input = core.on_tick(MS);
    assert_eq!((input.device(), input.flags), (Some(DeviceState::Ended), 0));
    assert_eq!(input.tip_vel_in_view_m_per_s, [0.0; 3]);
}

#[test]
fn a_device_that_was_given_back_is_lost_and_says_so_in_every_input() {
    let mut core = core();
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    assert!(!core.on_tick(MS).is_given_back());
    core.on_given_back();
    for k in 2..300 {
        let input = core.on_tick(k * MS);
        assert_eq!((input.device(), input.flags), (Some(DeviceState::Lost), OperatorInput::GIVEN_BACK));
        assert_eq!(input.tip_vel_in_view_m_per_s, [0.0; 3]);
    }
}

#[test]
fn the_hands_own_buttons_turn_fine_motion_and_locks_on_and_off_once_for_each_press() {
    let press_of = crate::PressButton::Press;
    let config = MasterConfig {
        fine: press_of(3),
        lock_translation: press_of(4),
        lock_rotation: press_of(5),
        engage: crate::Engage::Once,
        ..MasterConfig::default()
    };
    let mut core = MasterCore::new(&config).expect("a configuration");
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    let whole = core.on_tick(MS);
    let mut after = |buttons| {
        press(&mut core, buttons, MS);
        core.on_tick(MS)
    };
    let fine = after(1 | 1 << 3);
    assert_eq!(fine.scale_permille, 250);
    assert_eq!(fine.tip_vel_in_view_m_per_s, whole.tip_vel_in_view_m_per_s.map(|v| v * 0.25));
    assert_eq!(after(1 | 1 << 3).scale_permille, 250, "held is not pressed again");
    assert_eq!(after(1).scale_permille, 250);
    let locked = after(1 | 1 << 4 | 1 << 5);
    let both = OperatorInput::TRANSLATION_LOCKED | OperatorInput::ROTATION_LOCKED;
    assert_eq!((locked.flags & both, locked.tip_vel_in_view_m_per_s), (both, [0.0; 3]));
    after(1);
    let free = after(1 | 1 << 3 | 1 << 4 | 1 << 5);
    assert_eq!((free.scale_permille, free.flags & both), (1000, 0));
    assert_eq!(free.tip_vel_in_view_m_per_s, whole.tip_vel_in_view_m_per_s);
}

#[test]
fn scale_and_locks_change_velocity_and_nothing_else_and_nonsense_changes_nothing() {
    let mut core = core();
    press(&mut core, 1, 0);
    push(&mut core, 300, 0);
    let whole = core.on_tick(MS);
    let mut after = |lock, unlock, scale_permille| {
        core.on_wish(&MotionWish { sequence: 1, sample_ns: 0, scale_permille, lock, unlock, sender_pid: 1 });
        core.on_tick(MS)
    };
    let half = after(0, 0, 500);
    assert_eq!(half.tip_vel_in_view_m_per_s[0], whole.tip_vel_in_view_m_per_s[0] / 2.0);
    assert_eq!((half.scale_permille, half.raw_axes, half.flags), (500, whole.raw_axes, whole.flags));
    let locked = after(OperatorInput::TRANSLATION_LOCKED, 0, 0);
    assert_eq!((locked.tip_vel_in_view_m_per_s, locked.scale_permille), ([0.0; 3], 500));
    assert_eq!(locked.flags, whole.flags | OperatorInput::TRANSLATION_LOCKED);
    for (lock, unlock, scale) in [(1, 0, 0), (0, 2, 0), (4, 4, 0), (0, 0, 1001), (0, 0, 9)] {
        let same = after(lock, unlock, scale);
        assert_eq!((same.flags, same.scale_permille), (locked.flags, locked.scale_permille));
    }
    let turned = |core: &mut MasterCore, lock, unlock| {
        core.on_wish(&MotionWish { sequence: 1, sample_ns: 0, scale_permille: 500, lock, unlock, sender_pid: 1 });
        core.on_report(HidReport::Rotation([350, 0, 0]).encode().as_bytes(), MS).expect("report");
        core.on_tick(MS).tip_angular_vel_in_view_rad_per_s
    };
    let open = after(0, MotionWish::LOCKS, 1000);
    assert_eq!((open.tip_vel_in_view_m_per_s, open.flags), (whole.tip_vel_in_view_m_per_s, whole.flags));
    let half_turn = MasterConfig::default().full_turn_rad_per_s / 2.0;
    assert_eq!(turned(&mut core, 0, 0), [half_turn, 0.0, 0.0]);
    assert_eq!(turned(&mut core, OperatorInput::ROTATION_LOCKED, 0), [0.0; 3]);
    assert_eq!(turned(&mut core, 0, MotionWish::LOCKS), [half_turn, 0.0, 0.0]);
}

#[test]
fn a_pad_moves_the_tip_the_way_the_camera_sees_while_it_is_held_and_not_a_tick_longer_than_its_lease() {
    let config = MasterConfig { engage: crate::Engage::Once, ..MasterConfig::default() };
    let mut core = MasterCore::with_pad(&config).expect("default configuration");
    let wish = |frame, ms: i64, flags, deflection_permille| {
        let (sequence, sample_ns) = (frame, ms * MS);
        DriveWish { sequence, sample_ns, page: 1, frame, sender_pid: 7, flags, deflection_permille }
    };
    let waiting = core.on_tick(0);
    assert_eq!((waiting.device(), waiting.flags), (Some(DeviceState::Waiting), OperatorInput::FROM_PAD));
    core.on_pad(&wish(1, 0, 0, [1000, 0]), 0).expect("off the pad");
    assert_eq!(core.on_tick(0).tip_vel_in_view_m_per_s, [0.0; 3]);
    let full = config.full_speed_m_per_s;
    for (frame, (deflection, moves)) in [
        ([1000, 0], [full, 0.0, 0.0]),
        ([-1000, 0], [-full, 0.0, 0.0]),
        ([0, 1000], [0.0, full, 0.0]),
        ([0, -1000], [0.0, -full, 0.0]),
    ]
    .into_iter()
    .enumerate()
    {
        core.on_pad(&wish(frame as u64 + 2, 10, DriveWish::HELD, deflection), 10 * MS).expect("held");
        let input = core.on_tick(10 * MS);
        assert_eq!((input.tip_vel_in_view_m_per_s, input.operator_present()), (moves, true));
        assert_eq!(input.raw_axes[..2].iter().map(|axis| i32::from(*axis)).collect::<Vec<_>>(), deflection);
    }
    let jaw = OperatorInput::JAW_OPENS | OperatorInput::JAW_CLOSES;
    for (frame, asks, told) in [
        (6, DriveWish::JAW_OPENS, OperatorInput::JAW_OPENS),
        (7, DriveWish::JAW_CLOSES, OperatorInput::JAW_CLOSES),
        (8, DriveWish::JAW_OPENS | DriveWish::JAW_CLOSES, jaw),
    ] {
        core.on_pad(&wish(frame, 10, DriveWish::HELD | asks, [0; 2]), 10 * MS).expect("held");
        assert_eq!(core.on_tick(10 * MS).flags & jaw, told, "the jaw as it is asked");
    }
    let mut off = core;
    off.on_pad(&wish(9, 10, DriveWish::JAW_OPENS, [0; 2]), 10 * MS).expect("off the pad");
    assert_eq!(off.on_tick(10 * MS).flags, OperatorInput::FROM_PAD, "a jaw that nobody holds");
    let n_present = (11..400).take_while(|ms| core.on_tick(ms * MS).operator_present()).count();
    assert_eq!(n_present, 150, "ticks after the instant of the newest frame");
    let lost = core.on_tick(400 * MS);
    assert_eq!((lost.device(), lost.flags, lost.n_reports), (Some(DeviceState::Lost), OperatorInput::FROM_PAD, 8));
    assert_eq!((lost.tip_vel_in_view_m_per_s, lost.raw_axes), ([0.0; 3], [0; 6]));
    let mut without = self::core();
    assert_eq!(without.on_pad(&wish(1, 0, 0, [0, 0]), 0), Err(PadRefusal::OutOfRange), "another device");
}

#[test]
fn inputs_are_numbered_without_gaps_whatever_happens_between_them() {
    let mut core = core();
    for k in 1..=50_u64 {
        assert!(core.on_report(&[7, 7], 0).is_err());
        core.on_unplugged();
        core.on_plugged();
        let input = core.on_tick(k as i64 * MS);
        assert_eq!((input.sequence, input.n_refused), (k, k));
    }
}
