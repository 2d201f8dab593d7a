//! The log: to standard error, but never at the cost of a process that has better to do than to wait for a terminal.
//!
//! A terminal that is held (Ctrl-S), a full pipe or a slow disk would block whoever writes to it. So lines go into a bounded
//! queue, a thread of its own writes them, and what does not fit is counted and told when there is room again.

use crate::supervisor::SUPERVISOR_PID;
use core::sync::atomic::{AtomicU64, Ordering::Relaxed};
use core::time::Duration;
use std::io::{self, Write, stderr};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, OnceLock};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

/// Lines that wait at most: some hundred kilobytes.
const N_WAITING: usize = 1024;
/// How long the end of the program waits for the last lines at most.
const END_PATIENCE: Duration = Duration::from_millis(200);

/// The queue of this program's standard error.
static QUEUE: OnceLock<Lines> = OnceLock::new();

/// Puts text for standard error, whole lines or a line that is rewritten, into the queue of the log: nobody waits for it.
pub fn say(text: &str) {
    if let Some(lines) = QUEUE.get() {
        lines.put(text.as_bytes().to_vec());
    }
}

/// Starts logging: warnings unless KRAIT_LOG says otherwise, as `info` or `warn,krait_slave=debug`. Keep what comes back until the
/// end of the program.
pub fn start() -> Log {
    let usual = Targets::new().with_default(LevelFilter::WARN).with_target("iceoryx2", LevelFilter::ERROR);
    let asked = std::env::var_os("KRAIT_LOG").map(|text| text.to_string_lossy().into_owned());
    let (filter, refused) = match asked {
        None => (usual, None),
        Some(text) => text.parse().map_or((usual, Some(text)), |filter| (filter, None)),
    };
    let (log, lines) = Log::new(stderr);
    // The first queue is the one: a program starts its log once.
    let _one_log_only = QUEUE.set(lines.clone());
    let writer = tracing_subscriber::fmt::layer().with_writer(lines);
    tracing_subscriber::registry().with(writer.with_filter(filter)).init();
    // Once: its processes have the same environment as the chain.
    if let Some(found) = refused.filter(|_| std::env::var_os(SUPERVISOR_PID).is_none()) {
        tracing::warn!(
            "KRAIT_LOG is {found:?}: expected levels, as info or warn,krait_slave=debug; warnings are logged"
        );
    }
    log
}

/// The end of the queue at which lines are written.
pub struct Log {
    ended: Receiver<()>,
    orders: SyncSender<Order>,
}

enum Order {
    Write(Vec<u8>),
    End,
}

/// The end of the queue at which lines are put in.
#[derive(Clone)]
pub struct Lines {
    orders: SyncSender<Order>,
    n_dropped: Arc<AtomicU64>,
}

/// One line, until it is complete.
pub struct Line<'a> {
    lines: &'a Lines,
    text: Vec<u8>,
}

impl Log {
    /// A queue before a slow output, which is opened by its own thread.
    fn new<W: Write>(open: impl FnOnce() -> W + Send + 'static) -> (Self, Lines) {
        let (orders, waiting) = sync_channel(N_WAITING);
        let (told, ended) = sync_channel(1);
        let n_dropped = Arc::new(AtomicU64::new(0));
        let lines = Lines { orders: orders.clone(), n_dropped: Arc::clone(&n_dropped) };
        let written = std::thread::Builder::new().name("log".to_owned()).spawn(move || {
            write_all(&waiting, &n_dropped, &mut open());
            let _nobody_waits = told.send(());
        });
        // Without a thread the queue fills up, and every line is counted as dropped: no log is no reason to stop.
        drop(written);
        (Self { ended, orders }, lines)
    }
}

impl Drop for Log {
    /// The last lines, if the output takes them in time.
    fn drop(&mut self) {
        if self.orders.try_send(Order::End).is_ok() {
            let _held_output_keeps_its_lines = self.ended.recv_timeout(END_PATIENCE);
        }
    }
}

fn write_all(waiting: &Receiver<Order>, n_dropped: &AtomicU64, out: &mut impl Write) {
    while let Ok(Order::Write(line)) = waiting.recv() {
        // A closed output takes nothing any more; the queue is still emptied.
        let _closed_is_fine = out.write_all(&line);
        let n = n_dropped.swap(0, Relaxed);
        if n > 0 {
            let _closed_is_fine = writeln!(out, "{n} lines of the log were dropped because nobody took them in time");
        }
    }
}

impl Lines {
    fn put(&self, text: Vec<u8>) {
        match self.orders.try_send(Order::Write(text)) {
            Ok(()) => {}
            Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {
                self.n_dropped.fetch_add(1, Relaxed);
            }
        }
    }
}

impl<'a> MakeWriter<'a> for Lines {
    type Writer = Line<'a>;

    fn make_writer(&'a self) -> Line<'a> {
        Line { lines: self, text: Vec::new() }
    }
}

impl Write for Line<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.text.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for Line<'_> {
    fn drop(&mut self) {
        self.lines.put(core::mem::take(&mut self.text));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc::{Sender, channel};

    /// An output that stands still until it is let go.
    struct Held {
        go: Receiver<()>,
        written: Sender<String>,
        is_held: bool,
    }

    impl Write for Held {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if core::mem::take(&mut self.is_held) {
                self.go.recv().expect("let go");
            }
            self.written.send(String::from_utf8_lossy(bytes).into_owned()).expect("somebody listens");
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn an_output_that_stands_still_stops_nobody_and_what_is_dropped_is_counted() {
        let (let_go, go) = channel();
        let (written, read) = channel();
        let (log, lines) = Log::new(move || Held { go, written, is_held: true });
        // One line is in the writer's hands, or on its way there; the others wait or are dropped.
        for k in 0..N_WAITING + 500 {
            writeln!(lines.make_writer(), "line {k}").expect("a line takes everything");
        }
        let n_dropped = lines.n_dropped.load(Relaxed);
        assert!((499..=500).contains(&n_dropped), "{n_dropped} dropped");
        let_go.send(()).expect("the writer waits");
        drop((log, lines));
        let text: String = read.iter().collect();
        assert!(text.starts_with("line 0\n") && text.contains(&format!("{n_dropped} lines of the log were dropped")));
        assert!(text.contains(&format!("line {}\n", N_WAITING - 1)));
    }
}
