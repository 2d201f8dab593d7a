//! The stop: a few words of shared memory that anybody of the same user can count up, and that can do nothing else.
//!
//! Problem: a stop must get through from any number of sources, also while the supervisor, the channels' other writers or
//! iceoryx2 itself are out of order; and whoever asked must know that it was obeyed.
//!
//! Intuition: one word counts the stops that were asked for, another how many of them the slave has obeyed. The slave looks
//! at the first before each command that it executes; it stops when that has changed and then repeats the count in the
//! second. No writer can be in another's way, and none can take a stop back.

use crate::ground::open_private;
use crate::shared_words::SharedWords;
use crate::{InstanceName, IpcError};
use core::sync::atomic::Ordering::SeqCst;
use std::io;
use std::path::Path;

/// The counts lie a cache line apart.
const N_WORDS: usize = 32;
const ASKED: usize = 0;
const OBEYED: usize = 16;

/// The stop of an instance; see [`crate::Bus::stop_switch`].
#[derive(Debug)]
pub struct StopSwitch {
    words: SharedWords,
}

impl StopSwitch {
    /// Its name among the channels.
    pub(crate) const CHANNEL: &str = "stop";

    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        Ok(Self { words: SharedWords::open(path, N_WORDS)? })
    }

    /// The stop of an instance that has one, opened without joining the instance: it takes no lock and no memory, so that a stop
    /// gets through where both have run out. Nothing where nobody has made it, or where the ground is not this user's alone.
    ///
    /// # Errors
    /// [`IpcError::InstanceName`], or [`IpcError::Channel`] when the file that is there cannot be used.
    pub fn of(instance: &str) -> Result<Option<Self>, IpcError> {
        let instance = InstanceName::new(instance)?;
        if open_private(instance.ground()).is_err() {
            return Ok(None);
        }
        let words = SharedWords::open_existing(&instance.bell_path(Self::CHANNEL), N_WORDS);
        let words = words.map_err(|error| IpcError::Channel {
            instance: instance.as_str().to_owned(),
            channel: Self::CHANNEL.to_owned(),
            doing: "opening it",
            source_text: error.to_string(),
        })?;
        Ok(words.map(|words| Self { words }))
    }

    /// Asks for a stop. The number that comes back is obeyed when [`StopSwitch::is_obeyed`] says so.
    pub fn press(&self) -> u32 {
        self.words.words()[ASKED].fetch_add(1, SeqCst).wrapping_add(1)
    }

    /// How often a stop was asked for so far, modulo 2^32.
    ///
    /// # Real-time
    /// One load.
    pub fn asked(&self) -> u32 {
        self.words.words()[ASKED].load(SeqCst)
    }

    /// The slave says that it has obeyed every stop up to a number.
    pub fn obey(&self, number: u32) {
        self.words.words()[OBEYED].store(number, SeqCst);
    }

    /// Whether a stop has been obeyed.
    pub fn is_obeyed(&self, number: u32) -> bool {
        // The count may pass its end; half of its range is more stops than anybody waits for.
        self.words.words()[OBEYED].load(SeqCst).wrapping_sub(number) < u32::MAX / 2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stop_of_many_sources_is_counted_and_obeyed_by_number() {
        let path = Path::new("/dev/shm").join(format!("krait-test-stop-{}", std::process::id()));
        let slave = StopSwitch::open(&path).expect("made");
        let numbers: Vec<u32> = std::thread::scope(|scope| {
            let sources: Vec<_> = (0..8)
                .map(|_| {
                    let source = StopSwitch::open(&path).expect("opened");
                    scope.spawn(move || (0..100).map(|_| source.press()).collect::<Vec<u32>>())
                })
                .collect();
            sources.into_iter().flat_map(|source| source.join().expect("ended")).collect()
        });
        std::fs::remove_file(&path).expect("there");
        assert_eq!(slave.asked(), 800);
        let mut sorted = numbers.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (1..=800).collect::<Vec<u32>>(), "each press has a number of its own");
        assert!(numbers.iter().all(|number| !slave.is_obeyed(*number)));
        slave.obey(799);
        assert!(slave.is_obeyed(1) && slave.is_obeyed(799) && !slave.is_obeyed(800));
    }
}
