//! The chains by name: what each passes its messages over.

use crate::peer::Peer;

/// A chain that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChainKind {
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
}

impl ChainKind {
    /// Every chain; these are measured unless others are asked for.
    pub const ALL: [Self; 8] = [
        Self::FloorFutex,
        Self::Iceoryx2Default,
        Self::Krait,
        Self::KraitRecorded,
        Self::UnixDatagram,
        Self::Pipe,
        Self::CycloneDds,
        Self::Zenoh,
    ];

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
        for kind in ChainKind::ALL {
            assert_eq!(ChainKind::from_name(kind.name()), Ok(kind));
        }
        let error = ChainKind::from_name("kraid").expect_err("unknown");
        assert!(ChainKind::ALL.into_iter().all(|kind| error.contains(kind.name())), "{error}");
    }
}
