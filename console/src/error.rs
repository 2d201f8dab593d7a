//! What can keep a console from working, each in one sentence.

use core::net::{IpAddr, SocketAddr};
use krait_ipc::IpcError;
use std::io::ErrorKind;

/// The console cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    /// A channel of the instance.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The listening socket.
    #[error("{}", cannot_listen(SocketAddr::new(*.address, *.port), .source))]
    Listen {
        /// The address of this machine.
        address: IpAddr,
        /// The port that was asked for.
        port: u16,
        /// What the kernel said.
        source: std::io::Error,
    },
    /// The kernel's random numbers.
    #[error("the console gets no random numbers from the kernel for its token: {0}")]
    Random(rand::rngs::SysError),
    /// The server's own threads.
    #[error("the console cannot start its server: {0}")]
    Start(std::io::Error),
    /// Figures that cannot be written as JSON.
    #[error("the console cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Histograms that cannot be made.
    #[error("the console cannot make its histograms: {0:?}")]
    Histogram(hdrhistogram::CreationError),
}

/// What, where, found and what to do; the kernel's words only where these are not known.
fn cannot_listen(at: SocketAddr, source: &std::io::Error) -> String {
    let at = format!("the console cannot listen on {at}");
    let other = "choose another with --port or --stop-port, or 0 for any that is free";
    match source.kind() {
        ErrorKind::AddrInUse => {
            format!("{at}: expected a free port, found another program on it; end that, or {other}")
        }
        ErrorKind::PermissionDenied => {
            format!("{at}: expected a port that a user may take, found one of the system's (below 1024); {other}")
        }
        _ => format!("{at}: expected a free port, found: {source}; {other}"),
    }
}

impl From<hdrhistogram::CreationError> for ConsoleError {
    fn from(error: hdrhistogram::CreationError) -> Self {
        Self::Histogram(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_that_is_taken_is_told_without_the_kernels_numbers() {
        for kind in [98, 13] {
            let (address, source) = (IpAddr::from([127, 0, 0, 1]), std::io::Error::from_raw_os_error(kind));
            let told = ConsoleError::Listen { address, port: 80, source }.to_string();
            assert!(told.contains("127.0.0.1:80") && told.contains("expected") && !told.contains("os error"), "{told}");
        }
    }
}
