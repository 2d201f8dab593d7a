//! Pipes and datagrams: made by the process that starts the relays, which find them as standard input and output.

use super::{PATIENCE, Place};
use crate::relay::{Inlet, Outlet};
use crate::{BenchError, ChainKind};
use krait_ipc::WaitMode;
use krait_ipc::clock::monotonic_ns;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, read, write};
use std::io::{self, stdin, stdout};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixDatagram;
use std::process::Stdio;

/// The hops of a round, before its processes have taken them.
pub(crate) struct Pipework {
    hops: Vec<(Option<OwnedFd>, Option<OwnedFd>)>,
}

impl Pipework {
    /// Makes the hops, where messages travel over file descriptors at all.
    pub(crate) fn new(kind: ChainKind, n_hops: usize) -> io::Result<Option<Self>> {
        let make: fn() -> io::Result<(OwnedFd, OwnedFd)> = match kind {
            ChainKind::Pipe => || io::pipe().map(|(reader, writer)| (reader.into(), writer.into())),
            ChainKind::UnixDatagram => || {
                let (reader, writer) = UnixDatagram::pair()?;
                reader.set_read_timeout(Some(PATIENCE))?;
                Ok((reader.into(), writer.into()))
            },
            _ => return Ok(None),
        };
        let hops = (0..n_hops).map(|_| make().map(|(reader, writer)| (Some(reader), Some(writer))));
        Ok(Some(Self { hops: hops.collect::<io::Result<_>>()? }))
    }

    /// Hands over the ends that belong to the process between hop `idx - 1` and hop `idx`.
    pub(crate) fn streams_of(&mut self, idx: usize) -> (Stdio, Stdio) {
        let input = idx.checked_sub(1).and_then(|hop| self.hops.get_mut(hop)?.0.take());
        let output = self.hops.get_mut(idx).and_then(|hop| hop.1.take());
        (input.map_or_else(Stdio::null, Stdio::from), output.map_or_else(Stdio::null, Stdio::from))
    }
}

/// Standard input or output of a relay.
pub(crate) struct Fd {
    fd: OwnedFd,
    chain: &'static str,
    mode: WaitMode,
}

impl Fd {
    pub(crate) fn inlet(place: &Place) -> Result<Self, BenchError> {
        let fd = stdin().as_fd().try_clone_to_owned();
        let fd = fd.map_err(BenchError::transport(place.kind.name(), "taking standard input"))?;
        let inlet = Self { fd, chain: place.kind.name(), mode: place.plan.wait };
        if inlet.mode == WaitMode::Polling {
            let flags =
                fcntl_getfl(&inlet.fd).map_err(BenchError::transport(inlet.chain, "looking at standard input"))?;
            fcntl_setfl(&inlet.fd, flags | OFlags::NONBLOCK)
                .map_err(BenchError::transport(inlet.chain, "not blocking on standard input"))?;
        }
        Ok(inlet)
    }

    pub(crate) fn outlet(place: &Place) -> Result<Self, BenchError> {
        let fd = stdout().as_fd().try_clone_to_owned();
        let fd = fd.map_err(BenchError::transport(place.kind.name(), "taking standard output"))?;
        Ok(Self { fd, chain: place.kind.name(), mode: place.plan.wait })
    }
}

impl Inlet for Fd {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
        let (mut n_read, begun_ns) = (0, monotonic_ns());
        while n_read < message.len() {
            match read(&self.fd, &mut message[n_read..]) {
                Ok(0) => return Ok(false),
                Ok(n) => n_read += n,
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) if self.mode == WaitMode::Polling => {
                    if monotonic_ns() - begun_ns > PATIENCE.as_nanos() as i64 {
                        return Ok(false);
                    }
                    core::hint::spin_loop();
                }
                Err(Errno::AGAIN) => return Ok(false),
                Err(error) => return Err(BenchError::transport(self.chain, "reading")(error)),
            }
        }
        Ok(true)
    }
}

impl Outlet for Fd {
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
        let mut n_written = 0;
        while n_written < message.len() {
            match write(&self.fd, &message[n_written..]) {
                Ok(n) => n_written += n,
                Err(Errno::INTR) => {}
                Err(error) => return Err(BenchError::transport(self.chain, "writing")(error)),
            }
        }
        Ok(())
    }
}
