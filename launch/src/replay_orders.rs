//! What a person tells a replay that runs: lines on standard input, and Ctrl-C.

use std::io::BufRead;
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};

/// Lines that may wait; whoever types faster waits.
const N_WAITING: usize = 64;

/// An order to a running replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Stand still.
    Pause,
    /// Go on.
    Resume,
    /// One sample more.
    Step,
    /// Come to rest and end.
    Stop,
}

/// Orders from standard input.
pub struct Orders {
    lines: Receiver<Order>,
    has_ended: bool,
}

impl Orders {
    /// Begins to listen, in a thread that ends with the program.
    ///
    /// # Errors
    /// The thread could not be started.
    pub fn listen() -> std::io::Result<Self> {
        let (sender, lines) = sync_channel(N_WAITING);
        std::thread::Builder::new().name("orders".to_owned()).spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                let Some(order) = order_of(line.trim()) else {
                    tracing::warn!(line, "expected pause, resume, stop or an empty line");
                    continue;
                };
                if sender.send(order).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { lines, has_ended: false })
    }

    /// The next order, if there is one.
    pub fn next(&mut self) -> Option<Order> {
        match self.lines.try_recv() {
            Ok(order) => Some(order),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.has_ended = true;
                None
            }
        }
    }

    /// Whether no order will come any more: standard input is at its end.
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }
}

fn order_of(line: &str) -> Option<Order> {
    match line {
        "" => Some(Order::Step),
        "pause" => Some(Order::Pause),
        "resume" => Some(Order::Resume),
        "stop" => Some(Order::Stop),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_an_order_or_nothing() {
        assert_eq!(order_of(""), Some(Order::Step));
        assert_eq!(order_of("pause"), Some(Order::Pause));
        assert_eq!(order_of("rm -rf"), None);
    }
}
