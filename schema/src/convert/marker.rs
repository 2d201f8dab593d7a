//! Mirror of a mark: the bytes as they were sent, and the text for people.

use super::Mirrored;
use crate::proto;
use krait_ipc::message::{MARKER_TEXT_MAX, Marker};

impl Mirrored for Marker {
    type Mirror = proto::Marker;

    fn mirror(&self) -> proto::Marker {
        let n_used = self.text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        proto::Marker {
            sequence: self.sequence,
            sample_ns: self.sample_ns,
            sender_pid: self.sender_pid,
            n_text: self.n_text,
            text_bytes: self.text[..n_used].to_vec(),
            text: self.text().unwrap_or_default().to_owned(),
        }
    }

    fn restore(mirror: &proto::Marker) -> Result<Self, String> {
        let mut text = [0; MARKER_TEXT_MAX];
        let n_bytes = mirror.text_bytes.len();
        let place = text
            .get_mut(..n_bytes)
            .ok_or_else(|| format!("text_bytes holds {n_bytes} bytes, expected at most {MARKER_TEXT_MAX}"))?;
        place.copy_from_slice(&mirror.text_bytes);
        let proto::Marker { sequence, sample_ns, sender_pid, n_text, .. } = *mirror;
        Ok(Self { sequence, sample_ns, sender_pid, n_text, text })
    }
}
