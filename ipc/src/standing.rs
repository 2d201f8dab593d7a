//! The priority of a thread that somebody else's sample waits for, for as long as one waits.
//!
//! Problem: a thread that a process of the chain starts is not given the process's priority ([`crate::Realtime::apply`]). One that reads a
//! device stands before the process all the same: on a busy core its report, or the loss of its device, waits for every other program.
//! Intuition: such a thread takes the priority of the one that opened it, and gives it back where slow work begins.

use crate::realtime::set_policy;

/// How a thread is scheduled, as far as others can take it over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// Its priority under SCHED_FIFO; 0: time sharing.
    priority: u8,
}

impl Standing {
    /// That of the calling thread; time sharing where the kernel does not tell.
    pub fn of_this_thread() -> Self {
        let mut found = libc::sched_param { sched_priority: 0 };
        #[allow(unsafe_code)]
        // SAFETY: the call takes a number and gives one.
        let policy = unsafe { libc::sched_getscheduler(0) };
        #[allow(unsafe_code)]
        // SAFETY: the call writes the structure that it is given and nothing else.
        let result = unsafe { libc::sched_getparam(0, &raw mut found) };
        let is_fifo = policy >= 0 && result == 0 && policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO;
        Self { priority: if is_fifo { u8::try_from(found.sched_priority).unwrap_or(0) } else { 0 } }
    }

    /// Gives it to the calling thread; where it is time sharing, nothing changes. Threads that it starts later are not given it.
    ///
    /// # Errors
    /// What the kernel says when it refuses; the thread goes on as it was.
    pub fn take(self) -> std::io::Result<()> {
        if self.priority == 0 {
            return Ok(());
        }
        set_policy(libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK, self.priority)
    }

    /// Gives it back: time sharing again, which is never refused.
    ///
    /// # Errors
    /// As [`Standing::take`].
    pub fn leave(self) -> std::io::Result<()> {
        if self.priority == 0 {
            return Ok(());
        }
        set_policy(libc::SCHED_OTHER, 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Realtime;

    /// A thread of its own, so that its policy ends with it.
    fn in_a_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(work).join().expect("no panic"))
    }

    #[test]
    fn a_thread_takes_the_priority_of_the_one_that_opened_it_and_gives_it_back() {
        in_a_thread(|| {
            let refused = Realtime { priority: 7, ..Realtime::ORDINARY }.apply(3, "main");
            let own = Standing::of_this_thread();
            assert_eq!(own.priority == 7, refused.is_empty(), "{refused:?}");
            in_a_thread(|| {
                assert_eq!(Standing::of_this_thread().priority, 0, "it is not given by itself");
                own.take().expect("the one that opened it has it");
                assert_eq!(Standing::of_this_thread(), own);
                in_a_thread(|| assert_eq!(Standing::of_this_thread().priority, 0));
                own.leave().expect("never refused");
                assert_eq!(Standing::of_this_thread().priority, 0);
            });
        });
    }

    #[test]
    fn time_sharing_is_left_as_it_is() {
        in_a_thread(|| {
            let own = Standing::of_this_thread();
            assert_eq!(own.priority, 0);
            own.take().and_then(|()| own.leave()).expect("nothing is asked of the kernel");
            assert_eq!(Standing::of_this_thread(), own);
        });
    }
}
