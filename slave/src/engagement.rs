//! Whether the operator has engaged: latched here, cleared by whatever could surprise, and asked for deliberately.
//!
//! Nothing follows the operator before the operator was seen absent and then present after the newest event that clears the
//! latch: start, a change of the operating state, a fault, a stop, a stall, a process that began anew, another model. An
//! edge counts for a short while, in which every condition must come to hold; after that a new one is needed.

use crate::findings::{Findings, Note};
use krait_ipc::Reason;

/// How long an edge from absent to present waits for the conditions, ns.
const EDGE_NS: i64 = 500_000_000;

/// The latch.
#[derive(Clone, Copy, Debug, Default)]
pub struct Engagement {
    is_engaged: bool,
    has_seen_absent: bool,
    edge_ns: Option<i64>,
    /// What ended the newest engagement, until the next one.
    ended_by: Option<(Reason, Option<Note>)>,
}

impl Engagement {
    /// Whether commands may be executed.
    pub fn is_engaged(&self) -> bool {
        self.is_engaged
    }

    /// An event after which the operator must engage anew.
    pub fn clear(&mut self, event: Option<(Reason, Option<Note>)>) {
        if self.is_engaged {
            self.ended_by = event;
        }
        *self = Self { ended_by: self.ended_by, ..Self::default() };
    }

    /// The operator is seen absent.
    pub fn absent(&mut self) {
        *self = Self { has_seen_absent: true, ended_by: self.ended_by, ..Self::default() };
    }

    /// The operator is seen present; `is_met` says that every other condition holds.
    pub fn present(&mut self, now_ns: i64, is_met: bool) {
        if self.is_engaged {
            return;
        }
        if core::mem::take(&mut self.has_seen_absent) {
            self.edge_ns = Some(now_ns);
        }
        let is_new = self.edge_ns.is_some_and(|edge_ns| now_ns.saturating_sub(edge_ns) <= EDGE_NS);
        if is_new && is_met {
            *self = Self { is_engaged: true, ..Self::default() };
        }
    }

    /// Says what is missing, and what ended the newest engagement.
    pub(crate) fn tell(&self, findings: &mut Findings) {
        if self.is_engaged {
            return;
        }
        findings.insert(Reason::NotEngaged);
        match self.ended_by {
            Some((reason, Some(note))) => findings.note(reason, note.value, note.limit),
            Some((reason, None)) => findings.insert(reason),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn only_an_edge_engages_and_every_event_asks_for_another() {
        let mut latch = Engagement::default();
        latch.present(0, true);
        assert!(!latch.is_engaged(), "present from the start is no edge");
        latch.absent();
        latch.present(MS, true);
        assert!(latch.is_engaged());
        latch.clear(Some((Reason::ChainStalled, Some(Note { value: 60.0, limit: 50.0 }))));
        latch.present(2 * MS, true);
        assert!(!latch.is_engaged(), "the operator must be seen absent first");
        let mut findings = Findings::default();
        latch.tell(&mut findings);
        assert_eq!(findings.note_of(Reason::ChainStalled), Some(Note { value: 60.0, limit: 50.0 }));
        assert!(findings.reasons().contains(Reason::NotEngaged));
        latch.absent();
        latch.present(3 * MS, true);
        assert!(latch.is_engaged());
        latch.absent();
        assert!(!latch.is_engaged(), "letting go ends it");
    }

    #[test]
    fn an_edge_waits_half_a_second_for_the_conditions_and_no_longer() {
        let mut latch = Engagement::default();
        latch.absent();
        latch.present(0, false);
        latch.present(400 * MS, true);
        assert!(latch.is_engaged());
        latch.absent();
        latch.present(1000 * MS, false);
        latch.present(1501 * MS, true);
        assert!(!latch.is_engaged());
    }
}
