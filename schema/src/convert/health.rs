//! Mirror of a process's health: only the reasons that left a trace are kept, by name.

use super::Mirrored;
use crate::proto;
use krait_ipc::Reasons;
use krait_ipc::message::{Health, N_REASONS_MAX, ReasonRecord};

impl Mirrored for Health {
    type Mirror = proto::Health;

    fn mirror(&self) -> proto::Health {
        proto::Health {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            pid: self.pid,
            reserved: self.reserved,
            n_received: self.n_received,
            n_sent: self.n_sent,
            n_lost: self.n_lost,
            n_refused: self.n_refused,
            reasons_now: self.reasons_now,
            reasons_ever: self.reasons_ever,
            records: (0..).zip(&self.records).filter(|(_, r)| has_trace(r)).map(|(i, r)| mirror_of(i, r)).collect(),
            reasons_text: text_of(Reasons::from_bits(self.reasons_now)),
        }
    }

    fn restore(mirror: &proto::Health) -> Result<Self, String> {
        let mut records = [ReasonRecord::default(); N_REASONS_MAX];
        for record in &mirror.records {
            let place = usize::try_from(record.reason).ok().and_then(|idx| records.get_mut(idx)).ok_or_else(|| {
                format!("records holds reason {}, expected 0 to {}", record.reason, N_REASONS_MAX - 1)
            })?;
            *place =
                ReasonRecord { count: record.count, worst: record.worst, newest: record.newest, limit: record.limit };
        }
        Ok(Self {
            sequence: mirror.sequence,
            sample_ns: mirror.sample_ns,
            pid: mirror.pid,
            reserved: mirror.reserved,
            n_received: mirror.n_received,
            n_sent: mirror.n_sent,
            n_lost: mirror.n_lost,
            n_refused: mirror.n_refused,
            reasons_now: mirror.reasons_now,
            reasons_ever: mirror.reasons_ever,
            records,
        })
    }
}

/// Compares bits, because -0.0 equals 0.0 and is a trace all the same.
fn has_trace(record: &ReasonRecord) -> bool {
    record.count != 0 || record.worst.to_bits() != 0 || record.newest.to_bits() != 0 || record.limit.to_bits() != 0
}

fn mirror_of(reason: i32, record: &ReasonRecord) -> proto::ReasonRecord {
    proto::ReasonRecord { reason, count: record.count, worst: record.worst, limit: record.limit, newest: record.newest }
}

fn text_of(reasons: Reasons) -> String {
    let mut text = String::new();
    for reason in reasons.iter() {
        if !text.is_empty() {
            text.push_str("; ");
        }
        text.push_str(reason.sentence());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::Reason;

    #[test]
    fn every_reason_has_the_same_number_and_name_in_the_file() {
        for reason in Reason::ALL {
            let mirrored = proto::Reason::try_from(reason as i32).expect("in the .proto file");
            let name: String = mirrored.as_str_name().split('_').skip(1).map(str::to_lowercase).collect();
            assert_eq!(name, format!("{reason:?}").to_lowercase());
        }
        assert!(proto::Reason::try_from(Reason::ALL.len() as i32).is_err());
    }

    #[test]
    fn reasons_that_hold_are_in_words_and_only_traces_are_kept() {
        let mut health = Health::default();
        let mut now = Reasons::NONE;
        now.insert(Reason::InputStale);
        now.insert(Reason::StepLimit);
        health.set_now(now);
        health.note(Reason::InputStale, 71.0, 50.0);
        let mirror = health.mirror();
        assert_eq!(mirror.records.len(), 2);
        let expected = format!("{}; {}", Reason::InputStale.sentence(), Reason::StepLimit.sentence());
        assert_eq!(mirror.reasons_text, expected);
    }

    #[test]
    fn a_reason_beyond_the_last_is_refused_with_its_number() {
        for reason in [-1, N_REASONS_MAX as i32, i32::MAX] {
            let records = vec![proto::ReasonRecord { reason, ..proto::ReasonRecord::default() }];
            let error = Health::restore(&proto::Health { records, ..proto::Health::default() }).expect_err("no place");
            assert!(error.contains(&reason.to_string()), "{error}");
        }
    }
}
