//! Lines of comment before a table's heading: programs write `# ...` there, and some write the heading itself so.

use krait_ipc::input::without_mark;

/// A comment's mark.
const MARK: u8 = b'#';

/// What stands before the heading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Preamble {
    /// Bytes up to the heading's first name.
    pub n_bytes: usize,
    /// Lines before the heading's.
    pub n_lines: u64,
}

impl Preamble {
    /// What a file that begins with these bytes has before its heading. Where numbers follow the comments, the last comment is the
    /// heading, as NumPy's `savetxt` writes it.
    pub(super) fn of(start: &[u8]) -> Self {
        let mut here = Self { n_bytes: start.len() - without_mark(start).len(), n_lines: 0 };
        let mut last = None;
        while let Some(line) = line_at(start, here.n_bytes).filter(|line| line.first() == Some(&MARK)) {
            last = Some(here);
            here = Self { n_bytes: here.n_bytes + line.len(), n_lines: here.n_lines + 1 };
        }
        let Some(last) = last else { return Self::default() };
        let is_row = line_at(start, here.n_bytes).is_none_or(begins_with_number);
        let heading = line_at(start, last.n_bytes).unwrap_or_default();
        let n_marks = heading.iter().take_while(|byte| matches!(**byte, MARK | b' ')).count();
        if is_row { Self { n_bytes: last.n_bytes + n_marks, ..last } } else { here }
    }
}

/// The line that begins there, with its end; `None` behind the last.
fn line_at(text: &[u8], at: usize) -> Option<&[u8]> {
    text.get(at..)?.split_inclusive(|byte| *byte == b'\n').next()
}

fn begins_with_number(line: &[u8]) -> bool {
    let mut cells = line.split(|byte| matches!(byte, b',' | b';' | b'\t' | b' ' | b'\r' | b'\n'));
    let first = cells.find(|cell| !cell.is_empty()).and_then(|cell| std::str::from_utf8(cell).ok());
    first.is_some_and(|cell| cell.trim_matches('"').parse::<f64>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The heading, and the line that it stands in.
    fn heading(text: &str) -> (&str, u64) {
        let found = Preamble::of(text.as_bytes());
        (text[found.n_bytes..].lines().next().unwrap_or_default(), found.n_lines + 1)
    }

    #[test]
    fn comments_before_the_heading_are_passed_over() {
        assert_eq!(heading("time_s,u1\n0,1\n"), ("time_s,u1", 1));
        assert_eq!(heading("# made by hand\r\n#\r\ntime_s,u1\r\n0,1\r\n"), ("time_s,u1", 3));
        assert_eq!(heading("\u{feff}# a, b\ntime_s;u1\n"), ("time_s;u1", 2));
    }

    #[test]
    fn the_last_comment_before_numbers_is_the_heading() {
        assert_eq!(heading("# time_s,u1\n0.0,1\n"), ("time_s,u1", 1));
        assert_eq!(heading("# a run\n## time_s u1\n-1e3 1\n"), ("time_s u1", 2));
        assert_eq!(heading("# time_s,u1\n"), ("time_s,u1", 1));
        assert_eq!(heading(""), ("", 1));
    }
}
