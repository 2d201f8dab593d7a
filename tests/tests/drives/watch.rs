//! `krait drives --watch`: one document after the other, each of what the servos say then.

use super::PATIENCE;
use krait_drives::emulator::Emulator;
use krait_tests::Krait;
use rustix::process::Signal;
use serde_json::Value;

/// The next document that a program prints.
fn document(krait: &mut Krait) -> Value {
    let mut text = String::new();
    for _ in 0..200 {
        let line = krait.line();
        text += &line;
        // Of what lies inside the end is indented.
        if line == "]" {
            return serde_json::from_str(&text).expect("a document");
        }
    }
    panic!("no document: {text}");
}

/// The second servo is turned by hand while somebody looks; it is seen there, and Ctrl-C ends the look.
pub fn second_moves_to(counts: i32, emulator: &Emulator) {
    let port = emulator.path().display().to_string();
    let mut watch = Krait::start(&["drives", "--watch", "--port", &port, "--last-id", "9", "--json"]);
    let before = document(&mut watch);
    assert_eq!((before[1]["id"].as_i64(), before[1]["reading"]["counts"].as_i64()), (Some(2), Some(2048)), "{before}");
    emulator.wire().servos[1].place = f64::from(counts);
    // A document may be under way already.
    let is_seen = (0..3).any(|_| document(&mut watch)[1]["reading"]["counts"] == counts);
    assert!(is_seen, "it is where it was turned to");
    watch.signal(Signal::INT);
    assert_eq!(watch.end(PATIENCE).code, Some(0));
}
