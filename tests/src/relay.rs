//! A way to a port of this machine that a test can cut and open again: bytes pass in both directions until it does.

use core::sync::atomic::{AtomicU8, Ordering};
use core::time::Duration;
use krait_ipc::clock;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How a way is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WayCut {
    /// Connections stay, and no byte passes: a cable that was pulled.
    Silent = 1,
    /// Connections are closed, and so is every new one: a server that has gone.
    Closed = 2,
    /// What clients send waits until the way is open again, and what servers send passes: a command that is held up.
    Held = 3,
    /// What servers send comes `LATE_BY_NS` later: a way whose buffers are full.
    Late = 4,
}

/// How long what servers send is on its way then, ns.
const LATE_BY_NS: i64 = 1_500_000_000;

const OPEN: u8 = 0;
/// How often what waits looks whether the way is open again.
const LOOK_EVERY: Duration = Duration::from_millis(5);

#[derive(Default)]
struct Way {
    cut: AtomicU8,
    streams: Mutex<Vec<TcpStream>>,
    /// What clients have sent so far.
    asked: Mutex<Vec<u8>>,
}

/// The way itself; its threads end with the test's program.
pub struct CuttableWay {
    port: u16,
    target: u16,
    way: Arc<Way>,
}

fn locked<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl CuttableWay {
    /// A way to a port of 127.0.0.1.
    pub fn to(target: u16) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let way = Arc::new(Way::default());
        let own = Arc::clone(&way);
        std::thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                own.join(client, target);
            }
        });
        Self { port, target, way }
    }

    /// Where it begins.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Where it leads.
    pub fn target(&self) -> u16 {
        self.target
    }

    /// From now on not everything passes.
    pub fn cut(&self, how: WayCut) {
        self.way.cut.store(how as u8, Ordering::SeqCst);
        if how == WayCut::Closed {
            locked(&self.way.streams).drain(..).for_each(|stream| close(&stream));
        }
    }

    /// From now on everything passes again, what was held up first. What was swallowed or closed does not come back.
    pub fn open(&self) {
        self.way.cut.store(OPEN, Ordering::SeqCst);
    }

    /// Whether a client has sent a text so far.
    pub fn was_asked(&self, text: &str) -> bool {
        locked(&self.way.asked).windows(text.len()).any(|part| part == text.as_bytes())
    }
}

fn close(stream: &TcpStream) {
    let _closed_already_is_fine = stream.shutdown(Shutdown::Both);
}

impl Way {
    fn cut(&self) -> u8 {
        self.cut.load(Ordering::SeqCst)
    }

    fn join(self: &Arc<Self>, client: TcpStream, target: u16) {
        let Ok(server) = TcpStream::connect(("127.0.0.1", target)) else { return };
        let both = [&client, &server].map(|stream| stream.try_clone().expect("cloned"));
        let mut streams = locked(&self.streams);
        // Asked for under the lock: no connection slips through while the way is being closed.
        if self.cut() == WayCut::Closed as u8 {
            return;
        }
        let [to_client, to_server] = both;
        streams.extend([&client, &server].map(|stream| stream.try_clone().expect("cloned")));
        drop(streams);
        let (there, back) = (Arc::clone(self), Arc::clone(self));
        std::thread::spawn(move || there.ask(client, to_server));
        std::thread::spawn(move || back.answer(server, to_client));
    }

    fn ask(&self, mut from: TcpStream, mut to: TcpStream) {
        let mut bytes = [0; 16 * 1024];
        while let Ok(n @ 1..) = from.read(&mut bytes) {
            while self.cut() == WayCut::Held as u8 {
                std::thread::sleep(LOOK_EVERY);
            }
            if !self.passes() {
                continue;
            }
            locked(&self.asked).extend_from_slice(&bytes[..n]);
            if to.write_all(&bytes[..n]).is_err() {
                break;
            }
        }
        self.end(&from, &to);
    }

    /// What comes is taken at once and put into a buffer, so that whoever sends does not notice that the way is late.
    fn answer(&self, mut from: TcpStream, to: TcpStream) {
        let mut out = to.try_clone().expect("cloned");
        let (buffer, buffered) = channel::<(i64, Vec<u8>)>();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for (came_ns, bytes) in buffered {
                    while self.cut() == WayCut::Late as u8 && clock::monotonic_ns() - came_ns < LATE_BY_NS {
                        std::thread::sleep(LOOK_EVERY);
                    }
                    if self.passes() && out.write_all(&bytes).is_err() {
                        break;
                    }
                }
            });
            let mut bytes = [0; 16 * 1024];
            while let Ok(n @ 1..) = from.read(&mut bytes) {
                if buffer.send((clock::monotonic_ns(), bytes[..n].to_vec())).is_err() {
                    break;
                }
            }
            drop(buffer);
        });
        self.end(&from, &to);
    }

    fn passes(&self) -> bool {
        [OPEN, WayCut::Held as u8, WayCut::Late as u8].contains(&self.cut())
    }

    fn end(&self, from: &TcpStream, to: &TcpStream) {
        // Whoever is cut off in silence is told nothing of the other end's leaving either.
        if self.cut() != WayCut::Silent as u8 {
            [from, to].into_iter().for_each(close);
        }
    }
}
