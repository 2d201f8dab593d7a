//! Records raw reports beside the running master: a bounded queue and a thread of its own, so that a slow or full disk never
//! delays the operator's input.

use crate::{HidRecordingWriter, MasterError, RecordedEvent, RecordingHeader, ReportSource};
use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};
use std::fs::File;
use std::io::{self, BufWriter};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

/// Reports that may wait for the disk: 8 s of the fastest SpaceMouse.
const QUEUE: usize = 1024;

/// Hands reports to the writing thread; dropping it ends the file.
#[derive(Debug)]
pub(crate) struct ReportLog {
    // Both are `Some` until the log is dropped.
    queue: Option<Sender<(i64, usize, RecordedEvent)>>,
    thread: Option<JoinHandle<()>>,
    n_dropped: Arc<AtomicU64>,
}

impl ReportLog {
    /// Creates the file, never over an existing one, and starts the thread.
    pub(crate) fn create(path: &Path, source: &dyn ReportSource) -> Result<Self, MasterError> {
        let failed = |source| MasterError::File { path: path.to_owned(), doing: "written", source };
        let (vendor_id, product_id) = source.vid_pid().unwrap_or_default();
        let (layout, beside) = (source.layout(), source.beside());
        let notes = vec!["recorded by krait master".to_owned()];
        let file = BufWriter::new(File::options().write(true).create_new(true).mode(0o600).open(path).map_err(failed)?);
        let header = RecordingHeader { vendor_id, product_id, layout, beside, notes };
        let writer = HidRecordingWriter::new(file, &header).map_err(failed)?;
        let (queue, events) = bounded(QUEUE);
        let n_dropped = Arc::new(AtomicU64::new(0));
        let (counter, shown_path) = (Arc::clone(&n_dropped), path.to_owned());
        let work = move || {
            if let Err(error) = write_all(writer, &events, &counter) {
                tracing::error!(path = %shown_path.display(), %error, "the report recording stopped; free the disk and record again");
            }
        };
        let thread = std::thread::Builder::new()
            .name("krait-reports".to_owned())
            .spawn(work)
            .map_err(|source| MasterError::Thread { name: "krait-reports", source })?;
        Ok(Self { queue: Some(queue), thread: Some(thread), n_dropped })
    }

    /// Takes what came of one of the hand's devices without waiting; returns whether the writer still lives and had room.
    pub(crate) fn push(&self, device: usize, stamp_ns: i64, event: RecordedEvent) -> bool {
        match self.queue.as_ref().map(|queue| queue.try_send((stamp_ns, device, event))) {
            Some(Ok(())) => true,
            Some(Err(TrySendError::Full(_) | TrySendError::Disconnected(_))) | None => {
                self.n_dropped.fetch_add(1, Ordering::Relaxed);
                false
            }
        }
    }
}

impl Drop for ReportLog {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(Err(_)) = self.thread.take().map(JoinHandle::join) {
            tracing::error!("the thread that records reports died; its file has no `end` line");
        }
    }
}

fn write_all(
    mut writer: HidRecordingWriter<BufWriter<File>>,
    events: &Receiver<(i64, usize, RecordedEvent)>,
    n_dropped: &AtomicU64,
) -> io::Result<()> {
    while let Ok((stamp_ns, device, event)) = events.recv() {
        let n_gone = n_dropped.swap(0, Ordering::Relaxed);
        if n_gone > 0 {
            writer.note(&format!("{n_gone} reports near here were dropped because the disk was too slow"))?;
        }
        writer.push_of(device, stamp_ns, &event)?;
        if events.is_empty() {
            writer.flush()?;
        }
    }
    writer.finish().map(drop)
}
