//! Takes a report recording apart line by line and says which line is wrong, because the file comes from outside.

use crate::recording::{MAGIC, StampedEvent, shown};
use crate::{Layout, MAX_DEVICES, MasterError, Plug, RawReport, RecordedEvent};

const MAGIC_STEM: &[u8] = b"krait-report-recording ";
const MAX_LINE_BYTES: usize = 200;

const CUT: &str = "the file was cut short: copy it again, or end its last whole line with a line feed and add the missing `end` line to use what there is";
const FOREIGN: &str = "give a file that `krait master --record-reports` wrote";
pub(crate) const DAMAGED: &str = "correct that line or record again";

/// The lines of a recording and where one stands.
pub(crate) struct Lines<'a> {
    file: &'a str,
    rest: &'a [u8],
    line: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self { file, rest: bytes, line: 0 }
    }

    /// What was not read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// The next line without its line feed.
    pub(crate) fn next(&mut self) -> Result<&'a [u8], MasterError> {
        self.line += 1;
        let Some(n_bytes) = self.rest.iter().take(MAX_LINE_BYTES + 1).position(|b| *b == b'\n') else {
            return Err(if self.rest.len() > MAX_LINE_BYTES {
                self.refuse("a line of at most 200 bytes", shown(self.rest), DAMAGED)
            } else {
                let found = if self.rest.is_empty() { "the end of the file".to_owned() } else { shown(self.rest) };
                self.refuse("a whole line, up to the line `end <number of reports>`", found, CUT)
            });
        };
        let line = &self.rest[..n_bytes];
        self.rest = &self.rest[n_bytes + 1..];
        Ok(line)
    }

    /// The first line, looked at without assuming that the file has lines at all.
    pub(crate) fn magic(&mut self) -> Result<(), MasterError> {
        self.line = 1;
        let n_bytes = self.rest.iter().position(|b| *b == b'\n').unwrap_or(self.rest.len());
        let line = &self.rest[..n_bytes];
        if line == MAGIC.as_bytes() {
            self.rest = self.rest.get(n_bytes + 1..).unwrap_or_default();
            return Ok(());
        }
        let remedy = if line.starts_with(MAGIC_STEM) { "read it with the krait that wrote it" } else { FOREIGN };
        Err(self.refuse(&format!("`{MAGIC}`"), shown(line), remedy))
    }

    pub(crate) fn device(&mut self) -> Result<(u16, u16), MasterError> {
        let line = self.next()?;
        text_after(line, "device ")
            .and_then(parse_vid_pid)
            .ok_or_else(|| self.refuse("`device <vid>:<pid>` in hexadecimal", shown(line), DAMAGED))
    }

    pub(crate) fn layout(&mut self) -> Result<Option<Layout>, MasterError> {
        match self.next()? {
            b"layout split" => Ok(Some(Layout::Split)),
            b"layout combined" => Ok(Some(Layout::Combined)),
            b"layout pose" => Ok(Some(Layout::Pose)),
            b"layout unknown" => Ok(None),
            line => Err(self.refuse(
                "`layout split`, `layout combined`, `layout pose` or `layout unknown`",
                shown(line),
                DAMAGED,
            )),
        }
    }

    /// A device beside the hand controller, behind `n_before` others.
    pub(crate) fn beside(&self, line: &[u8], n_before: usize) -> Result<(u16, u16), MasterError> {
        if n_before + 1 >= MAX_DEVICES {
            let expected = format!("at most {} lines `beside`", MAX_DEVICES - 1);
            return Err(self.refuse(&expected, "one more".to_owned(), DAMAGED));
        }
        text_after(line, "beside ")
            .and_then(parse_vid_pid)
            .ok_or_else(|| self.refuse("`beside <vid>:<pid>` in hexadecimal", shown(line), DAMAGED))
    }

    /// What came of the hand controller or of one of so many devices beside it.
    pub(crate) fn event(
        &self,
        line: &[u8],
        last_ns: Option<i64>,
        n_beside: usize,
    ) -> Result<StampedEvent, MasterError> {
        let parsed = std::str::from_utf8(line).ok().and_then(|text| text.split_once(' ')).and_then(|(stamp, rest)| {
            let is_digits = stamp.bytes().all(|b| b.is_ascii_digit());
            let (device, what) = match rest.split_once(':') {
                Some((number, what)) => (beside_number(number)?, what),
                None => (0, rest),
            };
            Some((stamp.parse::<i64>().ok().filter(|_| is_digits)?, device, event_of(what)?))
        });
        let Some((stamp_ns, device, event)) = parsed else {
            return Err(self.refuse("`stamp_ns hexbytes`, `note ...` or `end <number>`", shown(line), DAMAGED));
        };
        if device > n_beside {
            let expected = format!("a device that a line `beside` names, of which there are {n_beside}");
            return Err(self.refuse(&expected, format!("device {device}"), DAMAGED));
        }
        match last_ns {
            None if stamp_ns != 0 => Err(self.refuse("0 as the first stamp", format!("{stamp_ns} ns"), DAMAGED)),
            Some(last_ns) if stamp_ns < last_ns => {
                let expected = format!("a stamp of at least {last_ns} ns, as time never runs backwards");
                Err(self.refuse(&expected, format!("{stamp_ns} ns"), DAMAGED))
            }
            _ => Ok(StampedEvent { stamp_ns, device, event }),
        }
    }

    pub(crate) fn refuse(&self, expected: &str, found: String, remedy: &'static str) -> MasterError {
        MasterError::Recording {
            file: self.file.to_owned(),
            line: self.line,
            expected: expected.to_owned(),
            found,
            remedy,
        }
    }
}

/// How a plug is written.
pub(crate) fn plug_word(plug: Plug) -> &'static str {
    match plug {
        Plug::Out => "unplugged",
        Plug::In => "plugged",
    }
}

fn event_of(what: &str) -> Option<RecordedEvent> {
    let plug = [Plug::Out, Plug::In].into_iter().find(|plug| plug_word(*plug) == what);
    plug.map(RecordedEvent::Plug).or_else(|| unhex(what).map(RecordedEvent::Report))
}

/// `046d:c626` to its two numbers.
pub(crate) fn parse_vid_pid(text: &str) -> Option<(u16, u16)> {
    let (vid, pid) = text.split_once(':')?;
    let number = |hex: &str| (hex.len() == 4).then(|| u16::from_str_radix(hex, 16).ok()).flatten();
    Some((number(vid)?, number(pid)?))
}

fn text_after<'a>(line: &'a [u8], prefix: &str) -> Option<&'a str> {
    std::str::from_utf8(line).ok()?.strip_prefix(prefix)
}

/// The number of a device beside the hand controller, 1 to 9.
fn beside_number(text: &str) -> Option<usize> {
    match text.as_bytes() {
        [digit @ b'1'..=b'9'] => Some(usize::from(digit - b'0')),
        _ => None,
    }
}

/// The text of a note line.
pub(crate) fn note(line: &[u8]) -> String {
    String::from_utf8_lossy(&line[b"note ".len()..]).into_owned()
}

fn unhex(hex: &str) -> Option<RawReport> {
    let n_bytes = hex.len() / 2;
    if !hex.len().is_multiple_of(2) || n_bytes == 0 || n_bytes > RawReport::MAX_BYTES {
        return None;
    }
    let mut bytes = [0_u8; RawReport::MAX_BYTES];
    for (byte, pair) in bytes.iter_mut().zip(hex.as_bytes().chunks_exact(2)) {
        *byte = (digit(pair[0])? << 4) | digit(pair[1])?;
    }
    Some(RawReport::clipped(&bytes[..n_bytes]))
}

fn digit(hex: u8) -> Option<u8> {
    match hex {
        b'0'..=b'9' => Some(hex - b'0'),
        b'a'..=b'f' => Some(hex - b'a' + 10),
        _ => None,
    }
}
