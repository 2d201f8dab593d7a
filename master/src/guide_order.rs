//! What a guide that awaits orders is told: one place after the other, by whoever leads a calibration, and the end.

use core::fmt;

/// What every order begins with.
const WORD: &str = "guide";
/// Farther from the base than any snake is long, m.
const FARTHEST_M: f64 = 0.5;

/// One order. Its text is that of a [`krait_ipc::message::Marker`] on [`krait_ipc::message::Marker::GUIDE_CHANNEL`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GuideOrder {
    /// Go there in a straight line, and say when the actuators rest.
    Go {
        /// The number under which that is said, from 1; one that was had before is not gone to again.
        number: u32,
        /// Where the end disk's centre goes, base frame, m.
        tip_pos_in_base_m: [f64; 3],
    },
    /// That was all.
    End,
}

impl GuideOrder {
    /// Reads the text of an order; `None` for anything else, and for a place that no snake reaches.
    pub fn parse(text: &str) -> Option<Self> {
        let rest = text.strip_prefix(WORD)?.strip_prefix(' ')?;
        let words: Vec<&str> = rest.split(' ').collect();
        match words[..] {
            ["ends"] => Some(Self::End),
            ["goes", number, x, y, z] => {
                let number = number.parse().ok().filter(|number| *number > 0)?;
                let tip_pos_in_base_m = [x.parse().ok()?, y.parse().ok()?, z.parse().ok()?];
                let is_place = tip_pos_in_base_m.iter().all(|x: &f64| x.abs() <= FARTHEST_M);
                is_place.then_some(Self::Go { number, tip_pos_in_base_m })
            }
            _ => None,
        }
    }
}

impl fmt::Display for GuideOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Go { number, tip_pos_in_base_m: [x, y, z] } => write!(f, "{WORD} goes {number} {x} {y} {z}"),
            Self::End => write!(f, "{WORD} ends"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_written_is_read_and_nothing_else_is() {
        let go = GuideOrder::Go { number: 17, tip_pos_in_base_m: [0.1 / 3.0, -1e-9, 0.026] };
        for order in [go, GuideOrder::End] {
            assert_eq!(GuideOrder::parse(&order.to_string()), Some(order));
        }
        for text in ["", "guide", "experiment ends", "guide goes 0 0 0 0", "guide goes 1 0 0", "guide goes 1 0 0 inf"] {
            assert_eq!(GuideOrder::parse(text), None, "{text}");
        }
        assert_eq!(GuideOrder::parse("guide goes 1 NaN 0 0"), None);
    }
}
