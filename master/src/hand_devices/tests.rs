//! A hand controller and a pedal through the master's core: either loss ends the motion, each has its own silence, and a recording of both
//! gives the same inputs again.

use crate::{
    Engage, HidRecording, HidRecordingWriter, HidReport, HoldButton, MasterConfig, MasterCore, Plug, Presence,
    RecordedEvent, RecordingHeader,
};
use krait_ipc::message::{DeviceState, OperatorInput};

const MS: i64 = 1_000_000;
const HAND: usize = 0;
const PEDAL: usize = 1;
const PUSHED: HidReport = HidReport::Motion([300, 0, 0, 0, 0, 0]);
const AT_REST: HidReport = HidReport::Motion([0; 6]);

/// A master whose operator is present while the pedal is down.
fn core() -> MasterCore {
    let (presence, clutch) = (Presence::Hold(0), HoldButton::None);
    MasterCore::new(&MasterConfig { engage: Engage::Once, presence, clutch, ..MasterConfig::default() }).expect("good")
}

fn says(core: &mut MasterCore, device: usize, report: HidReport, now_ns: i64) {
    core.on_report_of(device, report.encode().as_bytes(), now_ns).expect("a report");
}

fn moves(input: &OperatorInput) -> bool {
    input.tip_vel_in_view_m_per_s != [0.0; 3]
}

/// A core that moves at 3 ms: the pedal is down and the cap is pushed.
fn moving() -> MasterCore {
    let mut core = core();
    says(&mut core, PEDAL, HidReport::Buttons(1), MS);
    says(&mut core, HAND, PUSHED, 2 * MS);
    assert!(moves(&core.on_tick(3 * MS)));
    core
}

#[test]
fn the_loss_of_either_ends_the_motion_with_the_next_input_and_a_pedal_held_through_it_counts_from_its_next_press() {
    for lost in [HAND, PEDAL] {
        let mut core = moving();
        core.on_unplugged_of(lost);
        // The other one goes on as if nothing had happened, and revives nothing.
        says(&mut core, HAND, if lost == PEDAL { PUSHED } else { AT_REST }, 4 * MS);
        if lost == HAND {
            core.on_unplugged_of(HAND);
        }
        let input = core.on_tick(4 * MS);
        assert_eq!((input.device(), input.flags, input.buttons), (Some(DeviceState::Lost), 0, 0), "{lost} is lost");
        assert!(!moves(&input));
        core.on_plugged_of(lost);
        let mut now_ns = 10 * MS;
        let mut next = |core: &mut MasterCore, device, report| {
            now_ns += 8 * MS;
            says(core, device, report, now_ns);
            core.on_tick(now_ns + MS)
        };
        next(&mut core, HAND, AT_REST);
        assert!(!moves(&next(&mut core, HAND, PUSHED)), "both are back, and nobody has said so");
        if lost == HAND {
            // The pedal never told that it was let go; whatever else it tells, it was not pressed anew.
            assert!(!moves(&next(&mut core, PEDAL, HidReport::Buttons(1 | 1 << 4))));
        }
        next(&mut core, PEDAL, HidReport::Buttons(0));
        next(&mut core, HAND, AT_REST);
        next(&mut core, PEDAL, HidReport::Buttons(1));
        assert!(moves(&next(&mut core, HAND, PUSHED)), "{lost} was lost");
    }
}

#[test]
fn a_cap_that_is_held_while_it_comes_back_must_have_been_still_whatever_the_pedal_says() {
    let mut core = moving();
    core.on_unplugged_of(HAND);
    says(&mut core, PEDAL, HidReport::Buttons(0), 4 * MS);
    core.on_plugged_of(HAND);
    assert_eq!(core.on_tick(5 * MS).device(), Some(DeviceState::Live), "the pedal speaks, and the cap has not yet");
    says(&mut core, HAND, PUSHED, 6 * MS);
    says(&mut core, PEDAL, HidReport::Buttons(1), 7 * MS);
    assert!(!moves(&core.on_tick(8 * MS)));
    says(&mut core, HAND, AT_REST, 9 * MS);
    core.on_tick(10 * MS);
    says(&mut core, HAND, PUSHED, 11 * MS);
    assert!(moves(&core.on_tick(12 * MS)));
}

#[test]
fn a_pedal_that_is_back_and_has_not_spoken_keeps_no_cap_from_being_still() {
    let mut core = moving();
    core.on_unplugged_of(PEDAL);
    core.on_plugged_of(PEDAL);
    says(&mut core, HAND, AT_REST, 4 * MS);
    core.on_tick(5 * MS);
    says(&mut core, PEDAL, HidReport::Buttons(1), 6 * MS);
    says(&mut core, HAND, PUSHED, 6 * MS);
    assert!(moves(&core.on_tick(7 * MS)), "pressed and pushed at once");
}

#[test]
fn a_device_that_has_not_spoken_is_not_lost_and_each_falls_silent_by_its_own_rules() {
    let mut core = core();
    assert_eq!(core.on_tick(0).device(), Some(DeviceState::Waiting));
    says(&mut core, PEDAL, HidReport::Buttons(1), MS);
    let input = core.on_tick(500 * MS);
    assert_eq!((input.device(), input.operator_present()), (Some(DeviceState::AtRest), true), "a cap nobody touches");
    for silent in [HAND, PEDAL] {
        let mut core = core;
        says(&mut core, silent, HidReport::Motion([0, 0, 0, 0, 0, 100]), 500 * MS);
        for now_ms in 501..=600 {
            says(&mut core, HAND + PEDAL - silent, AT_REST, now_ms * MS);
            assert_eq!(core.on_tick(now_ms * MS).device(), Some(DeviceState::Live), "{now_ms}");
        }
        says(&mut core, HAND + PEDAL - silent, AT_REST, 601 * MS);
        let input = core.on_tick(601 * MS);
        assert_eq!((input.device(), input.flags), (Some(DeviceState::Lost), 0), "{silent} was deflected and is silent");
    }
}

#[test]
fn axes_and_buttons_of_both_are_one_hands_and_one_does_not_drain_the_other() {
    let mut core = core();
    says(&mut core, HAND, HidReport::Motion([300, 0, 7, 0, 0, 0]), 0);
    says(&mut core, PEDAL, HidReport::Motion([0, -50, 0, 0, 0, 9]), 0);
    says(&mut core, HAND, HidReport::Buttons(1 << 3), 0);
    says(&mut core, PEDAL, HidReport::Buttons(1), 0);
    core.on_report_of(PEDAL, &[9, 9], 0).expect_err("no report");
    let input = core.on_tick(MS);
    assert_eq!((input.raw_axes, input.buttons), ([300, -50, 7, 0, 0, 9], 1 | 1 << 3));
    assert_eq!((input.n_reports, input.n_refused, input.n_drained), (4, 1, 0));
    says(&mut core, HAND, HidReport::Buttons(0), MS);
    assert_eq!(core.on_tick(2 * MS).buttons, 1, "the pedal is still down");
}

/// A minute of both by chance, with stamps, in order; now and then one of them is unplugged, or plugged in.
fn scene() -> Vec<(i64, usize, RecordedEvent)> {
    let (mut now_ns, mut dice) = (0, 1_u64);
    let mut next = |n: u64| {
        dice = dice.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (dice >> 33) % n
    };
    let said = |report: HidReport| RecordedEvent::Report(report.encode());
    let mut scene = vec![(0, PEDAL, said(HidReport::Buttons(1)))];
    for _ in 0..6000 {
        now_ns += (next(20) * next(20)) as i64 * MS / 10;
        let counts = next(300) as i16;
        let (device, event) = match next(12) {
            0 => (PEDAL, said(HidReport::Buttons(next(2) as u32))),
            1 => (PEDAL, said(HidReport::Motion([0, 0, 0, 0, 0, counts / 100 * 100]))),
            2 => (HAND, said(HidReport::Buttons(next(4) as u32 * 2))),
            3 | 4 => (HAND, said(AT_REST)),
            5 if next(40) == 0 => (next(2) as usize, RecordedEvent::Plug(Plug::Out)),
            5 if next(10) == 0 => (next(2) as usize, RecordedEvent::Plug(Plug::In)),
            _ => (HAND, said(HidReport::Motion([counts, 0, -counts, 0, 0, 0]))),
        };
        scene.push((now_ns, device, event));
    }
    scene
}

/// What a core makes of it, an input each millisecond, without the stamps of hops.
fn inputs(events: impl Iterator<Item = (i64, usize, RecordedEvent)>) -> Vec<OperatorInput> {
    let (mut core, mut inputs) = (core(), Vec::new());
    for (stamp_ns, device, event) in events {
        while inputs.len() as i64 * MS < stamp_ns {
            inputs.push(core.on_tick(inputs.len() as i64 * MS));
        }
        match event {
            RecordedEvent::Report(report) => {
                core.on_report_of(device, report.as_bytes(), stamp_ns).expect("a report");
            }
            RecordedEvent::Plug(Plug::Out) => core.on_unplugged_of(device),
            RecordedEvent::Plug(Plug::In) => core.on_plugged_of(device),
        }
    }
    inputs
}

#[test]
fn a_recording_of_both_gives_the_same_inputs_again_and_without_one_report_or_one_unplugging_it_does_not() {
    let scene = scene();
    let header = RecordingHeader {
        vendor_id: 0x256f,
        product_id: 0xc635,
        layout: None,
        beside: vec![(0x05f3, 0x00ff)],
        notes: Vec::new(),
    };
    let mut writer = HidRecordingWriter::new(Vec::new(), &header).expect("header");
    for (stamp_ns, device, event) in &scene {
        writer.push_of(*device, *stamp_ns + 77, event).expect("written");
    }
    let text = writer.finish().expect("end");
    let recording = HidRecording::parse("both.krr", &text).expect("read");
    assert_eq!(recording.header(), &header);
    let live = inputs(scene.iter().copied());
    let n = |is: fn(&OperatorInput) -> bool| live.iter().filter(|input| is(input)).count();
    assert!(n(moves) > 1000 && n(|input| input.device() == Some(DeviceState::Lost)) > 1000);
    assert!(live == inputs(recording.events()), "every input, to the bit");
    let without = |left_out: fn(usize, &RecordedEvent) -> bool| {
        let place = scene.iter().position(|(_, device, event)| left_out(*device, event)).expect("it is there");
        inputs(recording.events().enumerate().filter(|(k, _)| *k != place).map(|(_, own)| own))
    };
    assert!(live != without(|device, event| device == PEDAL && matches!(event, RecordedEvent::Report(_))));
    assert!(live != without(|_, event| matches!(event, RecordedEvent::Plug(Plug::Out))));
}
