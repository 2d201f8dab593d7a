//! How anybody of the same user asks for another model: the supervisor starts the stages that rest on it anew, and answers.

use super::message;
use super::text::{packed, unpacked};
use iceoryx2::prelude::ZeroCopySend;

/// Bytes that a path or a sentence may have.
pub const MODEL_TEXT_MAX: usize = 240;
/// Processes that may ask at the same time.
const MAX_ASKING: usize = 8;

/// A request to the supervisor to go on with another model file.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.ModelRequest")]
pub struct ModelRequest {
    /// Position among the requests of this sender, from 1.
    pub sequence: u64,
    /// When it was asked for, CLOCK_MONOTONIC, nanoseconds. With `sender_pid` it names the request.
    pub sample_ns: i64,
    /// Hash of the model that is meant, so that a file which was changed meanwhile is refused.
    pub model_hash: u64,
    /// Process id of the sender.
    pub sender_pid: u32,
    /// Bytes of `path` that are used.
    pub n_path: u32,
    /// Absolute path of the model file, UTF-8; zeros behind its end.
    pub path: [u8; MODEL_TEXT_MAX],
}

message!(ModelRequest, "model_request", 1, super::RARE, MAX_ASKING);

impl ModelRequest {
    /// A request of this process; nothing for a path that is too long.
    pub fn new(sequence: u64, sample_ns: i64, model_hash: u64, path: &str) -> Option<Self> {
        let (n_path, path) = packed(path)?;
        Some(Self { sequence, sample_ns, model_hash, sender_pid: std::process::id(), n_path, path })
    }

    /// The path, or `None` where a foreign process has sent what is none.
    pub fn path(&self) -> Option<&str> {
        unpacked(self.n_path, &self.path)
    }
}

/// What became of a request; published by the supervisor.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ZeroCopySend)]
#[type_name("krait.ModelAnswer")]
pub struct ModelAnswer {
    /// Position on the channel, from 1.
    pub sequence: u64,
    /// `sample_ns` of the request.
    pub sample_ns: i64,
    /// `sender_pid` of the request.
    pub sender_pid: u32,
    /// 1 where the stages run with the model, 0 where nothing was changed.
    pub is_done: u32,
    /// Bytes of `text` that are used.
    pub n_text: u32,
    /// Always 0.
    pub reserved: u32,
    /// Why nothing was changed, UTF-8; zeros behind its end.
    pub text: [u8; MODEL_TEXT_MAX],
}

message!(ModelAnswer, "model_answer", 1, super::RARE);

impl ModelAnswer {
    /// The answer to a request; a refusal that is too long is cut.
    pub fn new(sequence: u64, request: &ModelRequest, refusal: Option<&str>) -> Self {
        let sentence = refusal.unwrap_or_default();
        let end = (0..=MODEL_TEXT_MAX.min(sentence.len())).rev().find(|end| sentence.is_char_boundary(*end));
        let (n_text, text) = packed(&sentence[..end.unwrap_or(0)]).unwrap_or((0, [0; MODEL_TEXT_MAX]));
        let (sample_ns, sender_pid) = (request.sample_ns, request.sender_pid);
        Self { sequence, sample_ns, sender_pid, is_done: u32::from(refusal.is_none()), n_text, reserved: 0, text }
    }

    /// Whether this is the answer to a request.
    pub fn is_to(&self, request: &ModelRequest) -> bool {
        (self.sender_pid, self.sample_ns) == (request.sender_pid, request.sample_ns)
    }

    /// Why nothing was changed; empty where a foreign process has sent what is no text.
    pub fn refusal(&self) -> Option<&str> {
        (self.is_done == 0).then(|| unpacked(self.n_text, &self.text).unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_comes_back_and_what_is_none_is_none() {
        let longest = "x".repeat(MODEL_TEXT_MAX);
        let request = ModelRequest::new(1, 5, 7, &longest).expect("the longest");
        assert_eq!(request.path(), Some(longest.as_str()));
        assert!(ModelRequest::new(1, 5, 7, &(longest + "x")).is_none());
        assert_eq!(ModelRequest { n_path: 241, ..request }.path(), None);
        assert_eq!(ModelRequest { path: [0xff; MODEL_TEXT_MAX], ..request }.path(), None);
        let refused = ModelAnswer::new(1, &request, Some(&"ü".repeat(200)));
        assert_eq!(refused.refusal(), Some("ü".repeat(120).as_str()));
        assert!(refused.is_to(&request) && ModelAnswer::new(1, &request, None).refusal().is_none());
    }
}
