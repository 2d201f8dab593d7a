//! Lines of bounded length from a file descriptor, without waiting longer than asked.

use crate::line::MAX_LINE_BYTES;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fd::AsFd;
use rustix::io::Errno;
use rustix::time::Timespec;

/// Bytes read at once.
const CHUNK_BYTES: usize = 16 * 1024;

/// Cuts what comes from a descriptor into lines.
#[derive(Debug)]
pub struct LineReader<F> {
    source: F,
    buffer: Vec<u8>,
    /// Where the next line begins.
    begin: usize,
    /// Up to here there is no end of a line.
    searched: usize,
    /// The rest of a line that was too long is being skipped.
    is_skipping: bool,
    has_ended: bool,
}

/// What there was to read.
#[derive(Debug, PartialEq, Eq)]
pub enum Cut<'a> {
    /// A line without its end.
    Line(&'a [u8]),
    /// A line of more than [`MAX_LINE_BYTES`]; its bytes are skipped.
    TooLong,
    /// Nothing yet.
    Nothing,
    /// The source has ended.
    End,
}

impl<F: AsFd> LineReader<F> {
    /// Lines of a source.
    pub fn new(source: F) -> Self {
        Self { source, buffer: Vec::new(), begin: 0, searched: 0, is_skipping: false, has_ended: false }
    }

    /// Reads once if there is something within `patience_ms`; [`LineReader::cut`] then has it. False: there was nothing.
    ///
    /// # Errors
    /// What the kernel said.
    pub fn fill(&mut self, patience_ms: i64) -> Result<bool, Errno> {
        if self.has_ended {
            return Ok(false);
        }
        let patience = Timespec { tv_sec: patience_ms / 1000, tv_nsec: patience_ms % 1000 * 1_000_000 };
        let mut waiting = [PollFd::new(&self.source, PollFlags::IN)];
        match poll(&mut waiting, Some(&patience)) {
            Ok(0) | Err(Errno::INTR) => return Ok(false),
            Ok(_) => {}
            Err(error) => return Err(error),
        }
        self.buffer.drain(..self.begin);
        self.searched -= self.begin;
        self.begin = 0;
        let filled = self.buffer.len();
        self.buffer.resize(filled + CHUNK_BYTES, 0);
        let read = rustix::io::read(&self.source, &mut self.buffer[filled..]);
        let n = match read {
            Ok(n) => n,
            Err(Errno::INTR | Errno::AGAIN) => {
                self.buffer.truncate(filled);
                return Ok(false);
            }
            // A peer that is gone has ended, whatever it left unsaid.
            Err(Errno::CONNRESET) => 0,
            Err(error) => return Err(error),
        };
        self.buffer.truncate(filled + n);
        self.has_ended = n == 0;
        Ok(true)
    }

    /// The next line of what has been read. A last line without an end counts once the source has ended.
    pub fn cut(&mut self) -> Cut<'_> {
        loop {
            let rest = self.buffer.get(self.searched..).unwrap_or(&[]);
            let Some(found) = rest.iter().position(|byte| *byte == b'\n') else { break };
            let (begin, end) = (self.begin, self.searched + found);
            (self.begin, self.searched) = (end + 1, end + 1);
            if core::mem::replace(&mut self.is_skipping, false) {
                continue;
            }
            if end - begin > MAX_LINE_BYTES {
                return Cut::TooLong;
            }
            return Cut::Line(without_return(&self.buffer[begin..end]));
        }
        self.searched = self.buffer.len();
        let n_open = self.searched - self.begin;
        if self.has_ended {
            let begin = core::mem::replace(&mut self.begin, self.searched);
            let was_skipping = core::mem::replace(&mut self.is_skipping, false);
            return match n_open {
                0 => Cut::End,
                _ if was_skipping => Cut::End,
                _ if n_open > MAX_LINE_BYTES => Cut::TooLong,
                _ => Cut::Line(without_return(&self.buffer[begin..])),
            };
        }
        if n_open > MAX_LINE_BYTES {
            self.begin = self.searched;
            if !core::mem::replace(&mut self.is_skipping, true) {
                return Cut::TooLong;
            }
        }
        Cut::Nothing
    }
}

fn without_return(line: &[u8]) -> &[u8] {
    line.strip_suffix(b"\r").unwrap_or(line)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    /// What comes out of bytes written in pieces, each read before the next is written.
    fn cut_of(pieces: &[&[u8]]) -> Vec<Option<Vec<u8>>> {
        let (source, mut sink) = std::io::pipe().expect("a pipe");
        let (mut lines, mut all) = (LineReader::new(source), Vec::new());
        let mut take = |lines: &mut LineReader<_>| {
            loop {
                match lines.cut() {
                    Cut::Line(line) => all.push(Some(line.to_vec())),
                    Cut::TooLong => all.push(None),
                    Cut::Nothing | Cut::End => break,
                }
            }
        };
        for piece in pieces {
            sink.write_all(piece).expect("written");
            assert!(lines.fill(1000).expect("read"));
            take(&mut lines);
        }
        drop(sink);
        while lines.fill(1000).expect("read") {
            take(&mut lines);
        }
        take(&mut lines);
        assert_eq!(lines.cut(), Cut::End);
        all
    }

    fn text(line: &str) -> Option<Vec<u8>> {
        Some(line.as_bytes().to_vec())
    }

    #[test]
    fn lines_come_whole_however_they_are_cut() {
        assert_eq!(cut_of(&[b"a\nb", b"c\r\n\nd"]), [text("a"), text("bc"), text(""), text("d")]);
        assert_eq!(cut_of(&[]), []);
    }

    #[test]
    fn a_line_that_is_too_long_is_told_once_and_takes_no_room() {
        let long = vec![b'x'; 3 * CHUNK_BYTES];
        let pieces: Vec<&[u8]> = long.chunks(5000).chain([&b"\nshort\n"[..]]).collect();
        assert_eq!(cut_of(&pieces), [None, text("short")]);
        let (longest, longer) = (vec![b'y'; MAX_LINE_BYTES], vec![b'z'; MAX_LINE_BYTES + 1]);
        let pieces = [&longest[..], b"\n", &longer[..], b"\n", b"end"];
        assert_eq!(cut_of(&pieces), [Some(longest.clone()), None, text("end")]);
        assert_eq!(cut_of(&[&longer]), [None]);
    }
}
