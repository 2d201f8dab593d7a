//! A hand controller and a pedal at once, each with its thread: order, buttons that give way, losses, what is given back, lights.

use super::*;
use crate::Plug;
use crate::hid_source::tests::{Act, host, wait_for_event};
use crate::lights::{HandState, LightShow};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;

struct Both {
    acts: [Sender<Act>; 2],
    lights: [Arc<AtomicU64>; 2],
    source: JoinedSource,
}

fn both(kept_buttons: u32) -> Both {
    let [(hand_acts, hand_light, hand), (pedal_acts, pedal_light, pedal)] = [host(0), host(0)];
    let source = JoinedSource::open_on(vec![Box::new(hand), Box::new(pedal)], &DeviceChoice::Any, kept_buttons);
    Both { acts: [hand_acts, pedal_acts], lights: [hand_light, pedal_light], source: source.expect("open") }
}

impl Both {
    fn does(&self, device: usize, act: Act) {
        self.acts[device].send(act).expect("its port lives");
    }

    fn says(&self, device: usize, bytes: &[u8]) {
        self.does(device, Act::HidReport(bytes.to_vec()));
    }
}

/// Whose an event is, when, and its bytes, if it is a report.
fn report_of(event: SourceEvent) -> Option<(usize, i64, Vec<u8>)> {
    let SourceEvent::HidReport { device, stamp_ns, report } = event else { return None };
    Some((device, stamp_ns, report.as_bytes().to_vec()))
}

#[test]
fn reports_that_wait_come_in_the_order_of_their_stamps_whichever_device_sent_them() {
    let mut both = both(u32::MAX);
    for k in 0..20_u8 {
        let device = usize::from(k / 3 % 2);
        let n_waiting = both.source.devices[device].0.n_events();
        both.says(device, &[3, k]);
        while both.source.devices[device].0.n_events() == n_waiting {
            std::thread::yield_now();
        }
    }
    let mut last_ns = i64::MIN;
    for k in 0..20_u8 {
        let (device, stamp_ns, bytes) = report_of(wait_for_event(&mut both.source)).expect("a report");
        assert_eq!((device, bytes), (usize::from(k / 3 % 2), vec![3, k]));
        assert!(stamp_ns >= last_ns);
        last_ns = stamp_ns;
    }
    assert!(both.source.next_event(0).is_none());
}

#[test]
fn a_button_that_a_pedal_names_is_taken_out_of_the_caps_reports_and_nothing_else_is() {
    let mut both = both(!1);
    for (device, sent, due) in [
        (0, &[3, 0b11][..], &[3, 0b10][..]),
        (0, &[3, 1, 0xff, 1, 1, 1, 1], &[3, 0, 0xff, 1, 1, 1, 1]),
        (0, &[1, 1, 0, 1, 0, 1, 0], &[1, 1, 0, 1, 0, 1, 0]),
        (0, &[3], &[3]),
        (1, &[3, 0b11], &[3, 0b11]),
    ] {
        both.says(device, sent);
        let (whose, _, bytes) = report_of(wait_for_event(&mut both.source)).expect("a report");
        assert_eq!((whose, bytes.as_slice()), (device, due));
    }
}

#[test]
fn each_is_lost_and_found_by_itself_and_says_whose_loss_it_is() {
    let mut both = both(u32::MAX);
    both.does(1, Act::Vanish);
    assert!(matches!(wait_for_event(&mut both.source), SourceEvent::Plug { device: 1, plug: Plug::Out, .. }));
    assert!(matches!(wait_for_event(&mut both.source), SourceEvent::Plug { device: 1, plug: Plug::In, .. }));
    both.does(0, Act::Drop);
    assert!(matches!(wait_for_event(&mut both.source), SourceEvent::Plug { device: 0, plug: Plug::Out, .. }));
    assert!(matches!(wait_for_event(&mut both.source), SourceEvent::Plug { device: 0, plug: Plug::In, .. }));
    both.says(1, &[3, 1]);
    assert_eq!(report_of(wait_for_event(&mut both.source)).expect("a report").0, 1);
}

#[test]
fn whichever_is_given_back_ends_the_hand_and_lets_the_other_go_too() {
    for given_back in [0, 1] {
        let mut both = both(u32::MAX);
        both.does(given_back, Act::GiveBack);
        assert!(matches!(wait_for_event(&mut both.source), SourceEvent::GivenBack));
        let are_over = (0..10_000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            both.source.devices.iter().all(|(source, _)| source.is_over())
        });
        assert!(are_over, "a thread still reads");
        let lights = both.lights.map(|light| light.load(Ordering::SeqCst));
        assert_eq!(lights, [0, 0], "both were left as they were");
        assert!(both.source.next_event(0).is_none());
        both.source.wait_until(clock::monotonic_ns() + 1_000_000);
    }
}

#[test]
fn the_lights_of_both_follow_the_chain() {
    let mut both = both(u32::MAX);
    let mut show = LightShow::new(1000);
    let becomes = |is_on: u64| {
        (0..10_000).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            both.lights.iter().all(|light| light.load(Ordering::SeqCst) == is_on)
        })
    };
    both.source.show(show.look(Some(HandState::Limit.into())));
    assert!(becomes(0), "the first gap of a limit");
    both.source.show(show.look(Some(HandState::Engaged.into())));
    assert!(becomes(1));
}
