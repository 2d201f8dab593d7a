//! What one step found: a set of reasons, each with its worst value beside the limit it broke.

use krait_ipc::message::{Health, N_REASONS_MAX};
use krait_ipc::{Reason, Reasons};

/// A value and the limit it broke, in the unit that the reason's documentation names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Note {
    /// The value furthest beyond the limit.
    pub value: f64,
    /// The limit.
    pub limit: f64,
}

/// Reasons that hold, with their notes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Findings {
    reasons: Reasons,
    notes: [Option<Note>; N_REASONS_MAX],
}

impl Default for Findings {
    fn default() -> Self {
        Self { reasons: Reasons::NONE, notes: [None; N_REASONS_MAX] }
    }
}

impl Findings {
    /// Adds a reason without figures.
    pub fn insert(&mut self, reason: Reason) {
        self.reasons.insert(reason);
    }

    /// Adds a reason with a value and its limit; of several the one furthest beyond is kept.
    pub fn note(&mut self, reason: Reason, value: f64, limit: f64) {
        self.reasons.insert(reason);
        let worse = |old: Note| (value - limit).abs() > (old.value - old.limit).abs();
        let place = &mut self.notes[reason as usize];
        if place.is_none_or(worse) {
            *place = Some(Note { value, limit });
        }
    }

    /// The set of reasons.
    pub fn reasons(&self) -> Reasons {
        self.reasons
    }

    /// The note of a reason, if it came with figures.
    pub fn note_of(&self, reason: Reason) -> Option<Note> {
        self.notes[reason as usize]
    }

    /// Everything that either of two steps found.
    pub fn merged(mut self, other: &Self) -> Self {
        for reason in other.reasons.iter() {
            match other.note_of(reason) {
                Some(note) => self.note(reason, note.value, note.limit),
                None => self.insert(reason),
            }
        }
        self
    }

    /// Adds this step to a process's health.
    pub fn tell(&self, health: &mut Health) {
        health.set_now(self.reasons);
        for reason in self.reasons.iter() {
            if let Some(note) = self.note_of(reason) {
                health.note(reason, note.value, note.limit);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_value_of_a_reason_is_kept_and_reaches_the_health_message() {
        let mut one = Findings::default();
        one.note(Reason::StrokeLimit, 5e-3, 4e-3);
        let mut two = Findings::default();
        two.note(Reason::StrokeLimit, 7e-3, 4e-3);
        two.insert(Reason::NotFinite);
        let both = one.merged(&two);
        assert_eq!(both.note_of(Reason::StrokeLimit), Some(Note { value: 7e-3, limit: 4e-3 }));
        let mut health = Health::default();
        both.tell(&mut health);
        assert_eq!(health.records[Reason::StrokeLimit as usize].worst, 7e-3);
        assert_eq!(health.records[Reason::NotFinite as usize].count, 1);
    }
}
