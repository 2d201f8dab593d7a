//! The chains by name: what each passes its messages over.

use crate::peer::Peer;

/// A chain that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A futex word and a ring in shared memory, written by hand: the floor of the machine.
    FloorFutex,
    /// iceoryx2 as it comes: `ipc::Service`, one event per hop, `timed_wait`.
    Iceoryx2Default,
    /// krait's chain.
    Krait,
    /// krait's chain while it is recorded and every channel is read by an observer as a console would.
    KraitRecorded,
    /// Datagrams over unix sockets.
    UnixDatagram,
    /// Pipes.
    Pipe,
    /// Eclipse Cyclone DDS, best effort, this machine only.
    CycloneDds,
    /// Zenoh, peer to peer on this machine.
    Zenoh,
    /// iceoryx2 with `blocking_wait`, which has no timeout.
    Iceoryx2Blocking,
    /// iceoryx2 with `ppoll` on the event's socket, drained with `try_wait`.
    Iceoryx2Ppoll,
    /// iceoryx2 with `epoll` on the event's socket, drained with `try_wait`.
    Iceoryx2Epoll,
    /// iceoryx2 with a `WaitSet` and a deadline on the event.
    Iceoryx2WaitSet,
    /// iceoryx2 with a semaphore in shared memory as its event, `blocking_wait`.
    Iceoryx2Semaphore,
    /// iceoryx2 for the data, a futex word beside it for the wake-up: what krait's channels do.
    Iceoryx2Futex,
    /// The same, looking for 50 us before it sleeps.
    Iceoryx2FutexSpin,
}

impl Kind {
    /// Every chain: first those that are measured unless others are asked for, then other ways to wait.
    pub const ALL: [Self; 15] = [
        Self::FloorFutex,
        Self::Iceoryx2Default,
        Self::Krait,
        Self::KraitRecorded,
        Self::UnixDatagram,
        Self::Pipe,
        Self::CycloneDds,
        Self::Zenoh,
        Self::Iceoryx2Blocking,
        Self::Iceoryx2Ppoll,
        Self::Iceoryx2Epoll,
        Self::Iceoryx2WaitSet,
        Self::Iceoryx2Semaphore,
        Self::Iceoryx2Futex,
        Self::Iceoryx2FutexSpin,
    ];
    /// How many of [`Kind::ALL`] are measured unless others are asked for.
    pub const N_STANDARD: usize = 8;

    /// The name on the command line, in tables and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::FloorFutex => "floor-futex",
            Self::Iceoryx2Default => "iceoryx2-default",
            Self::Krait => "krait",
            Self::KraitRecorded => "krait-recorded",
            Self::UnixDatagram => "unix-datagram",
            Self::Pipe => "pipe",
            Self::CycloneDds => "cyclonedds",
            Self::Zenoh => "zenoh",
            Self::Iceoryx2Blocking => "iceoryx2-blocking",
            Self::Iceoryx2Ppoll => "iceoryx2-ppoll",
            Self::Iceoryx2Epoll => "iceoryx2-epoll",
            Self::Iceoryx2WaitSet => "iceoryx2-waitset",
            Self::Iceoryx2Semaphore => "iceoryx2-semaphore",
            Self::Iceoryx2Futex => "iceoryx2-futex",
            Self::Iceoryx2FutexSpin => "iceoryx2-futex-spin",
        }
    }

    /// The chain with a name.
    ///
    /// # Errors
    /// A sentence with every name that there is.
    pub fn from_name(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| format!("{name:?} is no chain that can be measured: expected one of {}", names()))
    }

    /// Why this chain cannot be measured by this program on this machine, and what to install; `None` where it can.
    pub fn missing(self) -> Option<String> {
        let peer = Peer::of(self)?;
        peer.find().is_none().then(|| peer.missing())
    }

    /// Whether its processes are programs of their own, over a library that is no part of krait: one that fails says nothing
    /// against the other chains.
    pub fn is_peer(self) -> bool {
        Peer::of(self).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_chain_is_found_by_its_name_and_an_unknown_one_names_them_all() {
        for kind in Kind::ALL {
            assert_eq!(Kind::from_name(kind.name()), Ok(kind));
        }
        let error = Kind::from_name("kraid").expect_err("unknown");
        assert!(Kind::ALL.into_iter().all(|kind| error.contains(kind.name())), "{error}");
    }
}
