//! A terminal that hands over each key at once and shows one picture after the other; as it was before, however that ends.

use anyhow::Context;
use rustix::termios::{InputModes, LocalModes, OptionalActions, Termios, tcgetattr, tcgetwinsize, tcsetattr};
use std::io::{IsTerminal, Write, stdin, stdout};

/// The other screen, without a cursor.
const ENTER: &str = "\x1b[?1049h\x1b[?25l";
const LEAVE: &str = "\x1b[?25h\x1b[?1049l";

/// A terminal in use.
pub struct Terminal {
    before: Termios,
}

impl Terminal {
    /// Takes the terminal, or nothing where standard input or output is none.
    ///
    /// # Errors
    /// One sentence for a terminal that refuses.
    pub fn take() -> anyhow::Result<Option<Self>> {
        if !(stdin().is_terminal() && stdout().is_terminal()) {
            return Ok(None);
        }
        let before = tcgetattr(stdin()).context("the terminal does not say how it is set")?;
        let mut by_key = before.clone();
        by_key.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
        // Ctrl-S would hold up the picture.
        by_key.input_modes.remove(InputModes::IXON);
        tcsetattr(stdin(), OptionalActions::Now, &by_key).context("the terminal cannot hand over single keys")?;
        let terminal = Self { before };
        write(ENTER).context("the terminal cannot be written to")?;
        Ok(Some(terminal))
    }

    /// Rows and columns as they are now; a terminal that does not say has as many as one likes.
    pub fn size(&self) -> [usize; 2] {
        let Ok(size) = tcgetwinsize(stdout()) else { return [usize::MAX; 2] };
        [size.ws_row, size.ws_col].map(|own| if own == 0 { usize::MAX } else { usize::from(own) })
    }

    /// Shows lines from the top; what was there before goes. No line may be as long as a row, and there may be as many as rows: the last
    /// one has no end of line, which would scroll.
    ///
    /// # Errors
    /// A terminal that has gone.
    pub fn show(&self, lines: &[String]) -> std::io::Result<()> {
        write(&format!("\x1b[H{}\x1b[K\x1b[J", lines.join("\x1b[K\r\n")))
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let written = write(LEAVE);
        let set = tcsetattr(stdin(), OptionalActions::Now, &self.before);
        if written.is_err() || set.is_err() {
            tracing::debug!("the terminal has gone");
        }
    }
}

fn write(text: &str) -> std::io::Result<()> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}
