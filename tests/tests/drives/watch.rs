//! `krait drives --watch`: one document after the other, each of what the servos say then.

use super::PATIENCE;
use krait_drives::ServoMake;
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

/// A quarter of the largest torque, backwards.
const LOAD: f64 = -0.25;

/// What a servo of a make measures of itself: where supply (tenths of a volt) and temperature stand in its registers, what they are at
/// first, V and degrees Celsius, and its current at [`LOAD`], A.
struct Own {
    supply_at: usize,
    temperature_at: usize,
    supply_v: f64,
    celsius: f64,
    current_a: f64,
}

impl Own {
    fn of(make: ServoMake) -> Self {
        let (supply_at, temperature_at, supply_v, current_a) = match make {
            ServoMake::Sts3215 => (62, 63, 7.4, -100.0 * 6.5e-3),
            ServoMake::Xl330 => (144, 146, 5.0, -0.367),
        };
        Self { supply_at, temperature_at, supply_v, celsius: 31.0, current_a }
    }
}

/// The second servo is turned by hand, is loaded, gets warm and loses voltage while somebody looks; all of it is seen, of the others
/// nothing, and Ctrl-C ends the look.
pub fn second_moves_to(counts: i32, make: ServoMake, emulator: &Emulator) {
    let port = emulator.path().display().to_string();
    let mut watch = Krait::start(&["drives", "--watch", "--port", &port, "--last-id", "9", "--json"]);
    let before = document(&mut watch);
    assert_eq!((before[1]["id"].as_i64(), before[1]["reading"]["counts"].as_i64()), (Some(2), Some(2048)), "{before}");
    let own = Own::of(make);
    {
        let mut wire = emulator.wire();
        let servo = &mut wire.servos[1];
        (servo.place, servo.load) = (f64::from(counts), LOAD);
        (servo.registers[own.supply_at], servo.registers[own.temperature_at]) = (48, 57);
    }
    let is_near = |reading: &Value, key: &str, expected: f64| {
        reading[key].as_f64().is_some_and(|found| (found - expected).abs() < 1e-9)
    };
    // A document may be under way already.
    let newest = (0..3).map(|_| document(&mut watch)).find(|servos| servos[1]["reading"]["counts"] == counts);
    let newest = newest.expect("it is where it was turned to");
    let at_first = (0.0, own.supply_v, own.celsius);
    for (k, (current_a, supply_v, celsius)) in [at_first, (own.current_a, 4.8, 57.0), at_first].into_iter().enumerate()
    {
        let reading = &newest[k]["reading"];
        let is_right = is_near(reading, "current_a", current_a)
            && is_near(reading, "supply_v", supply_v)
            && is_near(reading, "temperature_celsius", celsius);
        assert!(is_right, "servo {}: {reading}", k + 1);
    }
    watch.signal(Signal::INT);
    assert_eq!(watch.end(PATIENCE).code, Some(0));
}
