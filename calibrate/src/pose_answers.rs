//! What is asked at a guided pose, and what was answered.

use crate::pose_reading::PoseReading;
use crate::{CalibrateError, Dialogue, Reply};
use std::io::{BufRead, Write};

/// What a pose was answered with.
pub(crate) enum Answer {
    /// A bend, deg, or NaN and the picture that shows it.
    Measured([f64; 2], Option<String>),
    Skip,
    Quit,
}

/// The bend vector, or its component in the plane of a picture from one side, deg.
pub(crate) fn typed<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    question: &str,
    picture_deg: Option<f64>,
) -> Result<Answer, CalibrateError> {
    let (words, n) = match picture_deg {
        None => ("b_x b_y".to_owned(), 2),
        Some(0.0) => ("b_x".to_owned(), 1),
        Some(plane_deg) => (format!("bend towards {plane_deg:.0} deg in the picture"), 1),
    };
    Ok(match dialogue.numbers(&format!("{question}: {words} deg?"), (n, n), (-180.0, 180.0))? {
        Reply::Numbers(bend) => Answer::Measured([bend[0], bend.get(1).copied().unwrap_or(f64::NAN)], None),
        Reply::Skip | Reply::Empty => Answer::Skip,
        Reply::Quit => Answer::Quit,
    })
}

/// The name under which the pose's pictures will be clicked, which no other pose has.
pub(crate) fn picture_of<R: BufRead, W: Write>(
    dialogue: &mut Dialogue<R, W>,
    question: &str,
    pose: u32,
    readings: &[PoseReading],
) -> Result<Answer, CalibrateError> {
    loop {
        let answer = dialogue.ask(&format!("{question}: photograph, name of the pictures? [pose-{pose}]"))?;
        let name = match answer.as_deref() {
            None | Some("q") => return Ok(Answer::Quit),
            Some("s") => return Ok(Answer::Skip),
            Some("") => format!("pose-{pose}"),
            Some(name) => name.to_owned(),
        };
        match readings.iter().find(|r| r.image.as_deref() == Some(name.as_str())) {
            Some(other) => dialogue.say(&format!("  {name:?} is of pose {} already, give another", other.pose))?,
            None => return Ok(Answer::Measured([f64::NAN; 2], Some(name))),
        }
    }
}
