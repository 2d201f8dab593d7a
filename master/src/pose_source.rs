//! A pose sender on a UDP socket: waits for packets and hands them on, a bounded number at a time. It judges nothing but whose
//! they are: another user of this machine is nobody's hand.

use crate::source::sleep_until;
use crate::udp_owner::owner_of;
use crate::{Layout, MasterError, Plug, PoseConfig, RawReport, ReportSource, SourceEvent};
use krait_ipc::clock;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::geteuid;
use rustix::time::Timespec;
use std::io::{Error, ErrorKind};
use std::net::{SocketAddr, UdpSocket};

/// Packets that are taken at one wake-up. A sender that floods keeps the master from its tick no longer than these take; what
/// does not fit into the kernel's queue (some 270 packets) the kernel throws away.
const MOST_AT_ONCE: usize = 64;

/// Senders that are remembered as this user's.
const MOST_KNOWN: usize = 8;
/// A new sender is looked up in a table of the kernel, at most so often in a time; and at most once in it refusals are told, ns.
const MOST_LOOK_UPS: u32 = 4;
const LOOK_UPS_WITHIN_NS: i64 = 100_000_000;
const TELL_EVERY_NS: i64 = 1_000_000_000;

/// Listens for the packets of a pose sender.
#[derive(Debug)]
pub struct PoseSource {
    socket: UdpSocket,
    n_left: usize,
    told_ns: Option<i64>,
    // A failure of the socket is told once, until it works again.
    has_failed: bool,
    senders: Senders,
}

/// Whose packets are taken.
#[derive(Debug, Default)]
struct Senders {
    known: Vec<SocketAddr>,
    /// The newest one that was refused.
    refused: Option<SocketAddr>,
    told_ns: Option<i64>,
    since_ns: i64,
    n_look_ups: u32,
}

impl Senders {
    /// Whether a sender may be heard: this user's own, root's, or one of another machine.
    fn admit(&mut self, sender: SocketAddr, now_ns: i64) -> bool {
        if self.known.contains(&sender) {
            return true;
        }
        if self.refused == Some(sender) || !self.may_look_up(now_ns) {
            return false;
        }
        if let Err(why) = look_up(sender) {
            self.refused = Some(sender);
            if self.told_ns.is_none_or(|told_ns| now_ns.saturating_sub(told_ns) > TELL_EVERY_NS) {
                self.told_ns = Some(now_ns);
                tracing::warn!("poses from {sender} are refused: {why}; run the sender as this user, with one socket");
            }
            return false;
        }
        if self.known.len() == MOST_KNOWN {
            self.known.remove(0);
        }
        self.known.push(sender);
        true
    }

    fn may_look_up(&mut self, now_ns: i64) -> bool {
        if now_ns.saturating_sub(self.since_ns) > LOOK_UPS_WITHIN_NS {
            (self.since_ns, self.n_look_ups) = (now_ns, 0);
        }
        self.n_look_ups += 1;
        self.n_look_ups <= MOST_LOOK_UPS
    }
}

/// Says why a sender is not to be heard.
fn look_up(sender: SocketAddr) -> Result<(), String> {
    let own = geteuid().as_raw();
    match owner_of(sender) {
        Ok(Some(user)) if user == own || user == 0 => Ok(()),
        Ok(Some(user)) => Err(format!("the socket belongs to user id {user}, expected {own}")),
        Ok(None) if sender.ip().is_loopback() => Err("that socket is closed, so nobody knows whose it was".to_owned()),
        Ok(None) => Ok(()),
        Err(error) => Err(format!("whose they are cannot be found out: {error}")),
    }
}

impl PoseSource {
    /// Listens on the address that the configuration names.
    ///
    /// # Errors
    /// [`MasterError::Listen`] where there is none, or the kernel does not give it.
    pub fn open(config: &PoseConfig) -> Result<Self, MasterError> {
        let missing = || MasterError::Listen {
            address: "no address".to_owned(),
            source: Error::new(ErrorKind::InvalidInput, "none is configured"),
        };
        let address = config.listen.ok_or_else(missing)?;
        let refused = |source| MasterError::Listen { address: address.to_string(), source };
        let socket = UdpSocket::bind(address).map_err(refused)?;
        socket.set_nonblocking(true).map_err(refused)?;
        tracing::info!(%address, "listening for poses; the packets carry no authentication");
        Ok(Self { socket, n_left: 0, told_ns: None, has_failed: false, senders: Senders::default() })
    }

    fn receive(&mut self, now_ns: i64) -> Option<SourceEvent> {
        let mut buffer = [0; RawReport::MAX_BYTES];
        loop {
            match self.socket.recv_from(&mut buffer) {
                Ok((n_bytes, sender)) => {
                    self.has_failed = false;
                    if !self.senders.admit(sender, now_ns) {
                        self.n_left = self.n_left.checked_sub(1)?;
                        continue;
                    }
                    let packet = RawReport::clipped(&buffer[..n_bytes.min(buffer.len())]);
                    return Some(SourceEvent::Packet { stamp_ns: now_ns, sender, packet });
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return None,
                Err(error) => {
                    if !std::mem::replace(&mut self.has_failed, true) {
                        tracing::error!(%error, "the socket for poses failed");
                        return Some(SourceEvent::Plug { device: 0, stamp_ns: now_ns, plug: Plug::Out });
                    }
                    return None;
                }
            }
        }
    }
}

impl ReportSource for PoseSource {
    fn start(&mut self, _now_ns: i64) {}

    fn wait_until(&mut self, deadline_ns: i64) {
        let left_ns = deadline_ns.saturating_sub(clock::monotonic_ns());
        if left_ns <= 0 {
            return;
        }
        let timeout = Timespec { tv_sec: left_ns / 1_000_000_000, tv_nsec: left_ns % 1_000_000_000 };
        let mut sockets = [PollFd::new(&self.socket, PollFlags::IN)];
        // A signal ends the wait; the loop asks the time again. A socket that fails must not keep the core busy.
        if self.has_failed || poll(&mut sockets, Some(&timeout)).is_err_and(|error| error != rustix::io::Errno::INTR) {
            sleep_until(deadline_ns);
        }
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        if self.told_ns.replace(now_ns) != Some(now_ns) {
            self.n_left = MOST_AT_ONCE;
        }
        self.n_left = self.n_left.checked_sub(1)?;
        self.receive(now_ns)
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        None
    }

    fn layout(&self) -> Option<Layout> {
        Some(Layout::Pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source on a port that was free, and its address.
    fn source() -> (PoseSource, SocketAddr) {
        let address = UdpSocket::bind("127.0.0.1:0").expect("a port").local_addr().expect("its number");
        let config = PoseConfig { listen: Some(address), ..PoseConfig::default() };
        (PoseSource::open(&config).expect("open"), address)
    }

    #[test]
    fn packets_come_whole_in_order_with_their_sender_and_too_long_ones_stay_too_long() {
        let (mut source, address) = source();
        let [a, b] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a sender"));
        for (sender, bytes) in [(&a, vec![1; 72]), (&b, vec![2; 3]), (&a, vec![3; 1400]), (&a, Vec::new())] {
            assert_eq!(sender.send_to(&bytes, address).expect("sent"), bytes.len());
        }
        source.wait_until(clock::monotonic_ns() + 1_000_000_000);
        let told: Vec<(SocketAddr, Vec<u8>)> = std::iter::from_fn(|| source.next_event(5))
            .map(|event| match event {
                SourceEvent::Packet { stamp_ns: 5, sender, packet } => (sender, packet.as_bytes().to_vec()),
                other => panic!("{other:?}"),
            })
            .collect();
        let [a, b] = [a, b].map(|sender| sender.local_addr().expect("bound"));
        assert_eq!(told, [(a, vec![1; 72]), (b, vec![2; 3]), (a, vec![3; RawReport::MAX_BYTES]), (a, Vec::new())]);
    }

    #[test]
    fn a_sender_that_nobody_has_any_more_is_not_heard_and_a_look_up_is_rare() {
        let mut senders = Senders::default();
        let open = UdpSocket::bind("127.0.0.1:0").expect("a sender");
        let address = |socket: &UdpSocket| socket.local_addr().expect("bound");
        let closed = address(&UdpSocket::bind("127.0.0.1:0").expect("a sender"));
        assert!(!senders.admit(closed, 1) && senders.admit(address(&open), 2));
        let remote: SocketAddr = "192.0.2.1:9".parse().expect("an address");
        assert!(senders.admit(remote, 3), "whose a socket of another machine is, nobody can say");
        let more: Vec<UdpSocket> = (0..3).map(|_| UdpSocket::bind("127.0.0.1:0").expect("a sender")).collect();
        let admitted = more.iter().filter(|socket| senders.admit(address(socket), 4)).count();
        assert_eq!(admitted, 1, "four look-ups within a tenth of a second");
        assert!(more.iter().all(|socket| senders.admit(address(socket), 4 + 2 * LOOK_UPS_WITHIN_NS)));
        assert!(senders.admit(address(&open), 5), "who is known needs none");
    }

    #[test]
    fn a_flood_is_taken_a_bounded_number_at_a_time() {
        let (mut source, address) = source();
        let sender = UdpSocket::bind("127.0.0.1:0").expect("a sender");
        for _ in 0..150 {
            sender.send_to(&[0; 72], address).expect("sent");
        }
        let mut n_at_once = |now_ns| std::iter::from_fn(|| source.next_event(now_ns)).count();
        assert_eq!([1, 2, 3, 4].map(&mut n_at_once), [64, 64, 22, 0]);
    }

    #[test]
    fn an_address_that_is_taken_or_missing_is_named_with_what_to_do() {
        let (_holds, address) = source();
        let config = PoseConfig { listen: Some(address), ..PoseConfig::default() };
        let error = PoseSource::open(&config).expect_err("taken").to_string();
        assert!(error.contains(&address.to_string()) && error.contains("--listen"), "{error}");
        let error = PoseSource::open(&PoseConfig::default()).expect_err("missing").to_string();
        assert!(error.contains("no address") && error.contains("--listen"), "{error}");
    }
}
