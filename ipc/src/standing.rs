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
    /// That of the calling thread, from the kernel's own book of it; time sharing where that cannot be read.
    pub fn of_this_thread() -> Self {
        let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap_or_default();
        Self { priority: fifo_priority(&stat).unwrap_or(0) }
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

/// The priority under SCHED_FIFO that a thread's `stat` tells: fields 40 (priority) and 41 (policy) of proc(5), behind the name, which is the
/// second and may hold anything.
fn fifo_priority(stat: &str) -> Option<u8> {
    let mut behind_name = stat.rsplit_once(')')?.1.split_whitespace().skip(37);
    let (priority, policy) = (behind_name.next()?, behind_name.next()?);
    (policy.parse() == Ok(libc::SCHED_FIFO)).then(|| priority.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Priority, Realtime};

    /// A thread of its own, so that its policy ends with it.
    fn in_a_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
        std::thread::scope(|scope| scope.spawn(work).join().expect("no panic"))
    }

    #[test]
    fn a_thread_takes_the_priority_of_the_one_that_opened_it_and_gives_it_back() {
        in_a_thread(|| {
            let refused = Realtime { priority: Priority::Fixed(7), ..Realtime::ORDINARY }.apply(3, "main");
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
    fn a_priority_is_read_behind_whatever_name_a_thread_has() {
        let stat = |tail: &str| format!("12 (a) b (c) S {}{tail}", "0 ".repeat(36));
        assert_eq!(fifo_priority(&stat("40 1 0 0")), Some(40));
        for tail in ["0 0 0 0", "40 2 0 0", "300 1 0", "40", ""] {
            assert_eq!(fifo_priority(&stat(tail)), None, "{tail:?}");
        }
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
