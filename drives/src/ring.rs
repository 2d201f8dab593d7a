//! Values from one thread to another in their order, without a lock and without the heap: what finds no room is left out.
//!
//! Problem: the bus's thread must hand over every cycle and wait for nobody; a queue that others may write too makes a writer
//! spin while a reader of lower priority was interrupted with a place in its hand.
//!
//! Intuition: one writes, one reads, a value is a few words. The writer tells how many it has written, the reader how many it has
//! taken; each writes one counter and reads the other.
//!
//! Failure: a full ring takes nothing; the writer counts that.

use crate::newest::AsWords;
use core::sync::atomic::{AtomicU64, Ordering};

/// Room for `ROOM` values of `N` words, which one thread writes and another reads.
#[derive(Debug)]
pub(crate) struct Ring<const N: usize, const ROOM: usize> {
    n_written: AtomicU64,
    n_taken: AtomicU64,
    /// On the heap from the start.
    places: Box<[[AtomicU64; N]]>,
}

impl<const N: usize, const ROOM: usize> Ring<N, ROOM> {
    pub(crate) fn new() -> Self {
        let places = (0..ROOM).map(|_| core::array::from_fn(|_| AtomicU64::new(0))).collect();
        Self { n_written: AtomicU64::new(0), n_taken: AtomicU64::new(0), places }
    }

    /// Writes a value behind the others; returns whether there was room. Only one thread may do so.
    ///
    /// # Real-time
    /// No allocation, no waiting.
    pub(crate) fn push<T: AsWords<N>>(&self, value: &T) -> bool {
        let n_written = self.n_written.load(Ordering::Relaxed);
        // Whatever the reader has taken is free: it has read it before it said so.
        let n_waiting = n_written.wrapping_sub(self.n_taken.load(Ordering::Acquire));
        if n_waiting >= ROOM as u64 {
            return false;
        }
        for (place, word) in self.places[Self::place(n_written)].iter().zip(value.to_words()) {
            place.store(word, Ordering::Relaxed);
        }
        self.n_written.store(n_written.wrapping_add(1), Ordering::Release);
        true
    }

    /// Takes the oldest value. Only one thread may do so.
    ///
    /// # Real-time
    /// As [`Ring::push`].
    pub(crate) fn pop<T: AsWords<N>>(&self) -> Option<T> {
        let n_taken = self.n_taken.load(Ordering::Relaxed);
        if self.n_written.load(Ordering::Acquire) == n_taken {
            return None;
        }
        let place = &self.places[Self::place(n_taken)];
        let words = core::array::from_fn(|k| place[k].load(Ordering::Relaxed));
        self.n_taken.store(n_taken.wrapping_add(1), Ordering::Release);
        Some(T::from_words(&words))
    }

    fn place(n: u64) -> usize {
        (n % ROOM as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Same(u64);

    impl AsWords<30> for Same {
        fn to_words(&self) -> [u64; 30] {
            [self.0; 30]
        }
        fn from_words(words: &[u64; 30]) -> Self {
            assert!(words.iter().all(|word| *word == words[0]), "a mixture: {words:?}");
            Self(words[0])
        }
    }

    #[test]
    fn a_reader_beside_a_writer_takes_whole_values_in_order_and_each_is_taken_or_was_refused() {
        const N: u64 = 200_000;
        let ring = Ring::<30, 16>::new();
        let (mut n_taken, mut newest) = (0, 0);
        let n_refused = std::thread::scope(|scope| {
            let writer = scope.spawn(|| (1..=N).filter(|k| !ring.push(&Same(*k))).count() as u64);
            loop {
                let is_over = writer.is_finished();
                while let Some(Same(value)) = ring.pop() {
                    assert!(value > newest, "{value} after {newest}");
                    (newest, n_taken) = (value, n_taken + 1);
                }
                if is_over {
                    return writer.join().unwrap();
                }
            }
        });
        assert_eq!(n_taken + n_refused, N);
    }

    #[test]
    fn a_full_ring_keeps_what_it_has_and_goes_on_when_there_is_room() {
        let ring = Ring::<30, 4>::new();
        let pushed: Vec<bool> = (1..=6).map(|k| ring.push(&Same(k))).collect();
        assert_eq!(pushed, [true, true, true, true, false, false]);
        assert_eq!(ring.pop(), Some(Same(1)));
        assert!(ring.push(&Same(7)));
        let rest: Vec<_> = core::iter::from_fn(|| ring.pop::<Same>()).collect();
        assert_eq!(rest, [2, 3, 4, 7].map(Same));
    }
}
