//! What a message costs: one copy and one allocation (iceoryx2's own) at its writer, neither at its readers.

#![allow(clippy::expect_used, reason = "a panic is how a test fails")]

#[path = "../../tests/support/allocations.rs"]
mod allocations;

use allocations::allocations_of;
use core::time::Duration;
use krait_ipc::message::Shape;
use krait_ipc::{Bus, ReadOptions};

fn shape(sequence: u64) -> Shape {
    Shape::of_bend(sequence, 1, 2, [0.25, -0.5])
}

/// Where /dev/shm is mapped into this process.
fn is_in_shared_memory(address: usize) -> bool {
    let maps = std::fs::read_to_string("/proc/self/maps").expect("maps");
    maps.lines().filter(|line| line.contains("/dev/shm/")).any(|line| {
        let range = line.split(' ').next().expect("a range");
        let (from, to) = range.split_once('-').expect("two ends");
        let number = |hex: &str| usize::from_str_radix(hex, 16).expect("hexadecimal");
        (number(from)..number(to)).contains(&address)
    })
}

#[test]
fn readers_neither_allocate_nor_copy_and_a_writer_allocates_at_most_once() {
    let bus = Bus::open(&format!("t-cost-{}", std::process::id()), "test").expect("bus");
    let mut writer = bus.writer::<Shape>().expect("writer");
    let mut readers: Vec<_> = (0..3).map(|_| bus.reader::<Shape>(ReadOptions::waking()).expect("reader")).collect();
    let mut pass = |from: u64, to: u64| {
        let (mut n_writing, mut n_reading) = (0, 0);
        for sequence in from..to {
            n_writing += allocations_of(|| writer.send(&shape(sequence)).expect("send"));
            n_reading += allocations_of(|| {
                for reader in &mut readers {
                    assert!(reader.wait(Duration::from_secs(5)).expect("wait"));
                    assert_eq!(reader.take().expect("take").expect("a message").sequence, sequence);
                }
            });
        }
        (n_writing, n_reading)
    };
    // Connections are made with the first messages.
    pass(1, 10);
    let (n_writing, n_reading) = pass(10, 2010);
    assert_eq!(n_reading, 0, "2000 messages at three readers");
    assert!(n_writing <= 2000, "{n_writing} allocations for 2000 messages at their writer");

    writer.send(&shape(2010)).expect("send");
    let taken: Vec<_> = readers.iter_mut().map(|reader| reader.take().expect("take").expect("a message")).collect();
    let addresses: Vec<usize> = taken.iter().map(|message| core::ptr::from_ref::<Shape>(message).addr()).collect();
    assert!(addresses.iter().all(|address| is_in_shared_memory(*address)), "{addresses:x?}");
    let on_stack = shape(1);
    assert!(!is_in_shared_memory(core::ptr::from_ref(&on_stack).addr()), "the case can tell memory apart");
}
