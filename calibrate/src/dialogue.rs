//! Questions and answers over any pair of streams: a terminal, or a test.

use crate::CalibrateError;
use std::io::{BufRead, Read, Write};

/// Longest answer that is read, bytes.
const MAX_ANSWER: u64 = 1024;

/// Who asks and who answers.
#[derive(Debug)]
pub struct Dialogue<R, W> {
    input: R,
    output: W,
}

/// What was answered.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply {
    /// Numbers, as many as were asked for or fewer.
    Numbers(Vec<f64>),
    /// Nothing.
    Empty,
    /// `s`: leave this one out.
    Skip,
    /// `q`, or the end of the input.
    Quit,
}

impl<R: BufRead, W: Write> Dialogue<R, W> {
    /// A dialogue over two streams.
    pub fn new(input: R, output: W) -> Self {
        Self { input, output }
    }

    /// Says something, with a line's end.
    ///
    /// # Errors
    /// [`CalibrateError::Dialogue`].
    pub fn say(&mut self, text: &str) -> Result<(), CalibrateError> {
        writeln!(self.output, "{text}")?;
        Ok(self.output.flush()?)
    }

    /// The answer to a question; `None` at the end of the input.
    ///
    /// # Errors
    /// [`CalibrateError::Dialogue`].
    pub fn ask(&mut self, question: &str) -> Result<Option<String>, CalibrateError> {
        write!(self.output, "{question} ")?;
        self.output.flush()?;
        let mut answer = String::new();
        let n = self.input.by_ref().take(MAX_ANSWER).read_line(&mut answer)?;
        Ok((n > 0).then(|| answer.trim().to_owned()))
    }

    /// Asks until one of the words is answered; the first one counts for an empty answer. `None` at the end.
    ///
    /// # Errors
    /// [`CalibrateError::Dialogue`].
    pub fn word(&mut self, question: &str, words: &[&'static str]) -> Result<Option<&'static str>, CalibrateError> {
        loop {
            let Some(answer) = self.ask(question)? else { return Ok(None) };
            let first = words.first().copied().filter(|_| answer.is_empty());
            match first.or_else(|| words.iter().copied().find(|word| *word == answer)) {
                Some(word) => return Ok(Some(word)),
                None => self.say(&format!("  {answer:?} is not one of: {}", words.join(", ")))?,
            }
        }
    }

    /// Asks until `fewest` to `most` finite numbers within bounds are answered, or nothing, `s` or `q`.
    ///
    /// # Errors
    /// [`CalibrateError::Dialogue`].
    pub fn numbers(
        &mut self,
        question: &str,
        (fewest, most): (usize, usize),
        (low, high): (f64, f64),
    ) -> Result<Reply, CalibrateError> {
        loop {
            let Some(answer) = self.ask(question)? else { return Ok(Reply::Quit) };
            match answer.as_str() {
                "" => return Ok(Reply::Empty),
                "s" => return Ok(Reply::Skip),
                "q" => return Ok(Reply::Quit),
                _ => {}
            }
            let parsed: Result<Vec<f64>, _> = answer.split_whitespace().map(str::parse).collect();
            match parsed {
                Ok(numbers)
                    if (fewest..=most).contains(&numbers.len()) && numbers.iter().all(|n| (low..=high).contains(n)) =>
                {
                    return Ok(Reply::Numbers(numbers));
                }
                _ => {
                    let count = if fewest == most { format!("{most}") } else { format!("{fewest} to {most}") };
                    self.say(&format!(
                        "  {answer:?} cannot be used, expected {count} number(s) from {low} to {high}, or q to stop"
                    ))?;
                }
            }
        }
    }

    /// Whether the answer is `y`; anything else is no.
    ///
    /// # Errors
    /// [`CalibrateError::Dialogue`].
    pub fn yes(&mut self, question: &str) -> Result<bool, CalibrateError> {
        Ok(self.ask(question)?.is_some_and(|answer| answer == "y"))
    }
}
