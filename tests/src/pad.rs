//! A page's drive pad by hand, and what a recording says of the hand on it.

use crate::http::{Console, Live, next_of_kind};
use crate::motion::samples_in;
use krait_ipc::message::{DeviceState, OperatorInput, Phase};
use krait_schema::Sample;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tungstenite::Message;

/// Frames that a change may take: two minutes of a page that misses none.
const MOST_FRAMES: usize = 7200;

/// A page that may drive.
pub struct PadPage {
    live: Live,
    session: String,
    /// Its number.
    pub page: u64,
    /// The number of its newest frame.
    pub n: u64,
    n_asked: u64,
}

impl PadPage {
    /// Opens a page of a console.
    pub fn open(console: &Console) -> Self {
        let mut live = console.page();
        let hello = next_of_kind(&mut live, "hello");
        let session = hello["session"].as_str().expect("a session").to_owned();
        Self { live, session, page: hello["page"].as_u64().expect("a number"), n: 0, n_asked: 0 }
    }

    /// The next picture; it paces what a page says.
    pub fn frame(&mut self) -> Value {
        next_of_kind(&mut self.live, "frame")
    }

    /// Asks for the pad; what the console answers.
    pub fn take(&mut self) -> Value {
        let now_ms = self.frame()["t_ms"].clone();
        self.ask(&now_ms);
        self.answer()
    }

    /// Asks for the pad and does not wait.
    pub fn ask(&mut self, now_ms: &Value) {
        self.n_asked += 1;
        self.send(&json!({ "k": "take", "id": self.n_asked, "session": self.session, "at_ms": now_ms }));
    }

    /// The answer to what was asked.
    pub fn answer(&mut self) -> Value {
        next_of_kind(&mut self.live, "ack")
    }

    /// Says something of the pad, with fields in place of what is right.
    pub fn say(&mut self, held: bool, [x, y]: [f64; 2], at_ms: &Value, wrong: &Value) {
        self.n += 1;
        let mut said = json!({ "k": "pad", "n": self.n, "held": held, "x": x, "y": y, "jaw": 0, "session": self.session, "at_ms": at_ms });
        for (key, value) in wrong.as_object().into_iter().flatten() {
            said[key] = value.clone();
        }
        self.send(&said);
    }

    fn send(&mut self, said: &Value) {
        self.live.send(Message::text(said.to_string())).expect("sent");
    }

    /// Holds the pad, a frame for each picture, until a picture is as wanted. Where a busy machine holds this test up for longer
    /// than the lease, it lets go and holds anew, as a person would.
    pub fn hold_until(&mut self, what: &str, deflection: [f64; 2], mut is_so: impl FnMut(&Value) -> bool) -> Value {
        self.until(what, |page, frame| {
            let is_lost = frame["operator"]["device"] == "lost";
            page.say(!is_lost, deflection, &frame["t_ms"], &Value::Null);
            is_so(frame)
        })
    }

    /// Holds the pad for half a second of pictures and never lets go; what is seen of it at the end.
    pub fn hold_for_a_while(&mut self, deflection: [f64; 2]) -> Value {
        let mut n = 0;
        self.until("a while", |page, frame| {
            page.say(true, deflection, &frame["t_ms"], &Value::Null);
            n += 1;
            n > 30
        })
    }

    /// Says that the pad is let go until a picture is as wanted.
    pub fn let_go_until(&mut self, what: &str, mut is_so: impl FnMut(&Value) -> bool) -> Value {
        self.until(what, |page, frame| {
            page.say(false, [0.0; 2], &frame["t_ms"], &Value::Null);
            is_so(frame)
        })
    }

    /// Looks at each picture until one is as wanted.
    pub fn until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self, &Value) -> bool) -> Value {
        let mut last = Value::Null;
        for _ in 0..MOST_FRAMES {
            last = self.frame();
            if is_so(self, &last) {
                return last;
            }
        }
        panic!("never {what}; last {last}");
    }
}

/// How many inputs still said that the operator is present after the newest frame that counted, for each time that the pad was
/// lost; and how many commands to follow rest on an input that did not.
pub fn pad_losses(recording: &str) -> (Vec<usize>, usize) {
    let samples = samples_in(recording);
    let inputs: Vec<&OperatorInput> = samples
        .iter()
        .filter_map(|sample| if let Sample::Input(input) = sample { Some(input) } else { None })
        .collect();
    let is_lost = |input: &OperatorInput| input.device() == Some(DeviceState::Lost);
    let mut losses = Vec::new();
    for (at, pair) in inputs.windows(2).enumerate() {
        if is_lost(pair[1]) && !is_lost(pair[0]) {
            assert!(pair[0].operator_present() && !pair[1].operator_present(), "{pair:?}");
            let n_frames = pair[0].n_reports;
            // The input that carried the newest frame is no tick of the lease.
            losses.push(inputs[..at].iter().rev().take_while(|input| input.n_reports == n_frames).count());
        }
    }
    let by_number: BTreeMap<u64, &OperatorInput> = inputs.iter().map(|input| (input.sequence, *input)).collect();
    let without_hand = samples.iter().filter(|sample| {
        let Sample::Command(command) = sample else { return false };
        let input = by_number.get(&command.input_sequence);
        command.phase == Phase::Following as u32 && input.is_some_and(|input| !input.operator_present())
    });
    (losses, without_hand.count())
}
