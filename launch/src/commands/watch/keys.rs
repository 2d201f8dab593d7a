//! What a key means: one state, no terminal, no clock.

/// Bytes that a mark is written in at most; a mark may be somewhat longer.
const MOST_BYTES: usize = 200;
const ESCAPE: u8 = 0x1b;
const BACKSPACE: [u8; 2] = [0x7f, 0x08];

/// What a key asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeyOrder {
    /// The snake shall stop.
    Stop,
    /// The snake shall pause.
    Pause,
    /// This instant gets a mark.
    Mark {
        /// When `m` was pressed, CLOCK_MONOTONIC, ns.
        at_ns: i64,
        /// What was written then.
        text: String,
    },
    /// The watch ends; the chain goes on.
    Quit,
}

/// Keys so far.
#[derive(Debug, Default)]
pub struct Keys {
    /// When `m` was pressed, and the bytes of the mark so far.
    mark: Option<(i64, Vec<u8>)>,
}

impl Keys {
    /// Takes a byte from the terminal at an instant.
    pub fn take(&mut self, byte: u8, now_ns: i64) -> Option<KeyOrder> {
        let Some((at_ns, mut text)) = self.mark.take() else { return self.command(byte, now_ns) };
        match byte {
            ESCAPE => return None,
            b'\n' | b'\r' => {
                let text = String::from_utf8_lossy(&text).trim().to_owned();
                return (!text.is_empty()).then_some(KeyOrder::Mark { at_ns, text });
            }
            _ if BACKSPACE.contains(&byte) => {
                // A character may be several bytes long.
                while text.pop().is_some_and(|last| last & 0xc0 == 0x80) {}
            }
            _ if byte >= b' ' && text.len() < MOST_BYTES => text.push(byte),
            _ => {}
        }
        self.mark = Some((at_ns, text));
        None
    }

    fn command(&mut self, byte: u8, now_ns: i64) -> Option<KeyOrder> {
        match byte.to_ascii_lowercase() {
            b's' | b' ' => Some(KeyOrder::Stop),
            b'p' => Some(KeyOrder::Pause),
            b'q' => Some(KeyOrder::Quit),
            b'm' => {
                self.mark = Some((now_ns, Vec::new()));
                None
            }
            _ => None,
        }
    }

    /// The mark that is being written.
    pub fn mark(&self) -> Option<String> {
        self.mark.as_ref().map(|(_, text)| String::from_utf8_lossy(text).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(keys: &mut Keys, typed: &str) -> Vec<KeyOrder> {
        typed.bytes().enumerate().filter_map(|(at, byte)| keys.take(byte, at as i64)).collect()
    }

    #[test]
    fn a_stop_is_one_key_in_either_case_and_other_keys_do_nothing() {
        let mut keys = Keys::default();
        assert_eq!(
            all(&mut keys, "sS x\x1b[Ap?q"),
            [vec![KeyOrder::Stop; 3], vec![KeyOrder::Pause, KeyOrder::Quit]].concat()
        );
    }

    #[test]
    fn a_mark_is_of_the_instant_of_its_key_and_may_hold_every_letter() {
        let mut keys = Keys::default();
        let text = "vessel, 2\u{b5}".to_owned();
        assert_eq!(all(&mut keys, "xmvessel, 2\u{e4}\x7f\u{b5}\r"), [KeyOrder::Mark { at_ns: 1, text }]);
        assert_eq!(all(&mut keys, "mabc\x1bs"), [KeyOrder::Stop], "escape leaves the mark");
        assert_eq!(all(&mut keys, "m  \rs"), [KeyOrder::Stop], "an empty mark is none");
        assert_eq!(all(&mut keys, &format!("m{}", "a".repeat(1000))), []);
        assert_eq!(keys.mark().map(|text| text.len()), Some(MOST_BYTES));
    }
}
