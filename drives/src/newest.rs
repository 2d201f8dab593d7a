//! The newest value between two threads: replaced whole, read whole, nobody waits, nothing allocates.
//!
//! Problem: the slave's step and the bus's thread exchange plain values. A lock makes one wait for the other; so does a queue
//! of one that is overwritten, whose writer spins while a reader that was put to sleep still holds the place.
//!
//! Intuition: a value is a few words with a counter that is odd while they are being written. A reader that meets an odd
//! counter, or another one afterwards, has read a mixture, and keeps what it had: there is something newer in a moment.
//!
//! Failure: a reader that is disturbed again and again keeps an older value, whose age its stamp tells.

use core::sync::atomic::{AtomicU64, Ordering, fence};

/// Times that a reader tries before it keeps what it has.
const TRIES: usize = 3;

/// A plain value as words.
pub trait AsWords<const N: usize>: Copy {
    /// The words.
    fn to_words(&self) -> [u64; N];
    /// The value of words that [`AsWords::to_words`] made.
    fn from_words(words: &[u64; N]) -> Self;
}

/// The place that one thread writes and another reads.
#[derive(Debug)]
pub struct Newest<const N: usize> {
    /// Odd while the words are being written.
    counter: AtomicU64,
    words: [AtomicU64; N],
}

impl<const N: usize> Newest<N> {
    /// A place with a first value.
    pub fn new<T: AsWords<N>>(first: &T) -> Self {
        Self { counter: AtomicU64::new(0), words: first.to_words().map(AtomicU64::new) }
    }

    /// Replaces the value. Only one thread may do so.
    ///
    /// # Real-time
    /// No allocation, no waiting: `N` + 2 stores.
    pub fn put<T: AsWords<N>>(&self, value: &T) {
        let counter = self.counter.load(Ordering::Relaxed);
        self.counter.store(counter.wrapping_add(1), Ordering::Relaxed);
        fence(Ordering::Release);
        for (place, word) in self.words.iter().zip(value.to_words()) {
            place.store(word, Ordering::Relaxed);
        }
        self.counter.store(counter.wrapping_add(2), Ordering::Release);
    }

    /// The newest value; `None` where it was being replaced all the time.
    ///
    /// # Real-time
    /// No allocation, no waiting: at most three times `N` + 2 loads.
    pub fn get<T: AsWords<N>>(&self) -> Option<T> {
        (0..TRIES).find_map(|_| {
            let before = self.counter.load(Ordering::Acquire);
            if before % 2 == 1 {
                return None;
            }
            let words = core::array::from_fn(|k| self.words[k].load(Ordering::Relaxed));
            fence(Ordering::Acquire);
            (self.counter.load(Ordering::Relaxed) == before).then(|| T::from_words(&words))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Same([u64; 40]);

    impl AsWords<40> for Same {
        fn to_words(&self) -> [u64; 40] {
            self.0
        }
        fn from_words(words: &[u64; 40]) -> Self {
            Self(*words)
        }
    }

    #[test]
    fn a_reader_beside_a_writer_sees_whole_values_only_and_they_never_go_back() {
        let place = Newest::new(&Same([0; 40]));
        std::thread::scope(|scope| {
            scope.spawn(|| (1..=300_000).for_each(|k| place.put(&Same([k; 40]))));
            let (mut newest, mut n_seen) = (0, 0_u64);
            while newest < 300_000 {
                let Some(Same(words)) = place.get::<Same>() else { continue };
                assert!(words.iter().all(|word| *word == words[0]), "a mixture: {words:?}");
                assert!(words[0] >= newest, "{} after {newest}", words[0]);
                n_seen += u64::from(words[0] != newest);
                newest = words[0];
            }
            assert!(n_seen >= 1);
        });
    }
}
