//! What the model saw at the instants of the newest slave states, so that a shape finds the one at its exposure.

use crate::step::seconds_between;

/// States that are kept: a quarter of a second at 1 kHz covers the latency of a camera.
const N_KEPT: usize = 256;

/// An instant, and what the model saw then.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sighted<S> {
    pub stamp_ns: i64,
    pub sight: S,
}

/// The newest of them.
#[derive(Clone, Debug)]
pub(crate) struct Pairing<S> {
    kept: Box<[Sighted<S>]>,
    n_noted: usize,
}

impl<S: Copy + Default> Pairing<S> {
    pub fn new() -> Self {
        let nothing = Sighted { stamp_ns: i64::MIN, sight: S::default() };
        Self { kept: vec![nothing; N_KEPT].into_boxed_slice(), n_noted: 0 }
    }

    /// Allocates nothing.
    pub fn note(&mut self, stamp_ns: i64, sight: S) {
        self.kept[self.n_noted % N_KEPT] = Sighted { stamp_ns, sight };
        self.n_noted += 1;
    }

    /// The nearest to an instant, if it is near enough.
    pub fn at(&self, sample_ns: i64, max_gap_ms: f64) -> Option<Sighted<S>> {
        let kept = &self.kept[..self.n_noted.min(N_KEPT)];
        let nearest = kept.iter().min_by_key(|own| own.stamp_ns.abs_diff(sample_ns))?;
        let gap_ms = seconds_between(nearest.stamp_ns, sample_ns).abs() * 1e3;
        (gap_ms <= max_gap_ms).then_some(*nearest)
    }
}
