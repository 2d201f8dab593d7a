//! What can keep a console from working, each in one sentence.

use krait_ipc::IpcError;

/// The console cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleError {
    /// A channel of the instance.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// The listening socket.
    #[error("the console cannot listen on 127.0.0.1:{port}: {source}; choose another port with --port, or 0 for any")]
    Listen {
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

impl From<hdrhistogram::CreationError> for ConsoleError {
    fn from(error: hdrhistogram::CreationError) -> Self {
        Self::Histogram(error)
    }
}
