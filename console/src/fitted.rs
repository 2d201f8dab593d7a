//! The lines of a glance that a terminal has room for: where it has too few rows, the state, what holds the motion back and the error
//! stay longest.

/// Columns of a terminal of the usual size; a line that is as long would wrap on some.
const COLUMNS: usize = 79;

/// How much a line matters, the most first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum GlanceWeight {
    /// What the chain does.
    State,
    /// What became of a key, or the mark that is being written.
    Keys,
    /// What holds the motion back most.
    Reason,
    /// How far the machine is from where it shall be.
    Error,
    /// What else holds the motion back.
    FurtherReason,
    /// Everything else of the chain.
    Rest,
    /// What stands around the glance.
    Frame,
}

/// A line of a glance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GlanceLine {
    /// How much it matters.
    pub weight: GlanceWeight,
    /// What it says.
    pub text: String,
    /// How many reasons it stands for.
    pub n_reasons: usize,
}

impl GlanceLine {
    /// A line that stands for no reason.
    pub fn new(weight: GlanceWeight, text: String) -> Self {
        Self { weight, text, n_reasons: 0 }
    }
}

/// As many lines as there are rows, those that matter most, in their own order and none as long as a row. Reasons that there is no room
/// for are counted.
pub fn fitted(lines: Vec<GlanceLine>, [n_rows, n_columns]: [usize; 2]) -> Vec<String> {
    let mut places: Vec<usize> = (0..lines.len()).collect();
    places.sort_by_key(|place| (lines[*place].weight, *place));
    let left_out = places.split_off(n_rows.min(places.len()));
    let n_more: usize = left_out.iter().map(|place| lines[*place].n_reasons).sum();
    places.sort_unstable();
    let more = places.iter().copied().rfind(|place| lines[*place].n_reasons > 0 && n_more > 0);
    let more = more.or(places.first().copied().filter(|_| n_more > 0));
    let longest = COLUMNS.min(n_columns.saturating_sub(1));
    let text = |place: usize| {
        let end = match more == Some(place) {
            true if lines[place].n_reasons > 0 => format!(" (and {n_more} more)"),
            true => format!(" ({n_more} reasons)"),
            false => String::new(),
        };
        let n_own = longest.saturating_sub(end.chars().count());
        let own: String = lines[place].text.chars().take(n_own).collect();
        (own + &end).chars().take(longest).collect()
    };
    places.into_iter().map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use GlanceWeight::{Error, Frame, FurtherReason, Keys, Reason, Rest, State};

    fn lines() -> Vec<GlanceLine> {
        let all = [(Frame, "head"), (State, "state"), (Rest, "operator"), (Error, "error"), (Rest, "latency")];
        let mut lines: Vec<_> =
            all.into_iter().map(|(weight, text)| GlanceLine::new(weight, text.to_owned())).collect();
        for (weight, text, n_reasons) in
            [(Reason, "worst", 1), (FurtherReason, "second", 1), (FurtherReason, "and 4 more", 4)]
        {
            lines.push(GlanceLine { weight, text: text.to_owned(), n_reasons });
        }
        lines.push(GlanceLine::new(Frame, "help".to_owned()));
        lines
    }

    #[test]
    fn with_room_all_is_shown_and_without_the_state_the_worst_reason_and_the_error_stay() {
        let shown = |n_rows| fitted(lines(), [n_rows, 80]);
        let all = ["head", "state", "operator", "error", "latency", "worst", "second", "and 4 more", "help"];
        assert_eq!(shown(usize::MAX), all);
        assert_eq!(shown(9), all);
        assert_eq!(shown(6), ["state", "operator", "error", "worst", "second", "and 4 more"]);
        assert_eq!(shown(4), ["state", "error", "worst", "second (and 4 more)"]);
        assert_eq!(shown(3), ["state", "error", "worst (and 5 more)"]);
        assert_eq!(shown(2), ["state", "worst (and 5 more)"]);
        assert_eq!(shown(1), ["state (6 reasons)"]);
        assert_eq!(shown(0), [""; 0]);
    }

    #[test]
    fn what_became_of_a_key_goes_before_the_error_and_no_line_is_as_long_as_a_row() {
        let mut lines = lines();
        lines.push(GlanceLine::new(Keys, "stop asked for".to_owned()));
        assert_eq!(fitted(lines.clone(), [3, 80]), ["state", "worst (and 5 more)", "stop asked for"]);
        let narrow = fitted(lines, [3, 12]);
        assert!(narrow.iter().all(|line| line.chars().count() < 12), "{narrow:?}");
        let long = vec![GlanceLine::new(State, "x".repeat(200))];
        assert_eq!(fitted(long.clone(), [1, usize::MAX])[0].len(), COLUMNS);
        assert_eq!(fitted(long, [1, 1]), [""]);
    }
}
