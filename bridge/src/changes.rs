//! The changes of a machine that were seen since the start, as an update tells them.

use krait_ipc::message::ModelUpdate;
use krait_model::Change;

/// How many, and the newest.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Changes {
    n: u64,
    newest_ns: i64,
    newest: Option<Change>,
    segment: u32,
}

impl Changes {
    /// Counts a change; `segment` from 1, 0 of a snake.
    pub fn note(&mut self, change: Change, segment: u32, shape_ns: i64) {
        *self = Self { n: self.n + 1, newest_ns: shape_ns, newest: Some(change), segment };
    }

    /// The newest.
    pub fn newest(&self) -> Option<Change> {
        self.newest
    }

    /// The same update with what was seen.
    pub fn told(&self, is_watching: bool, update: ModelUpdate) -> ModelUpdate {
        ModelUpdate {
            n_changes: self.n,
            changed_ns: self.newest_ns,
            change_kind: self.newest.map_or(0, |change| change.kind.number()),
            is_watching: u32::from(is_watching),
            changed_segment: self.segment,
            ..update
        }
    }
}
