//! Who engages: a hand by itself, a recording or a script only if that was asked for on the command line.

/// How long a recording or script is present without being engaged before it lets go, ns: an edge counts for half a second.
const UNANSWERED_NS: i64 = 600_000_000;
/// How long it lets go for, ns: longer than any late sample.
const LET_GO_NS: i64 = 100_000_000;

/// Whether what the source says about presence counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Engage {
    /// Never: a recording or script that nobody has asked to engage.
    #[default]
    Never,
    /// As the source says it: a live hand, or a recording or script that was asked to.
    Once,
    /// And again, after whatever ended the engagement: for demonstrations and measurements on a simulated machine only.
    Again,
}

/// Applies [`Engage`] to presence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grip {
    engage: Engage,
    is_engaged: bool,
    in_vain_since_ns: Option<i64>,
    let_go_ns: Option<i64>,
}

impl Grip {
    pub(crate) fn new(engage: Engage) -> Self {
        Self { engage, is_engaged: false, in_vain_since_ns: None, let_go_ns: None }
    }

    /// What the slave says.
    pub(crate) fn note_engaged(&mut self, is_engaged: bool) {
        self.is_engaged = is_engaged;
    }

    /// Whether the operator counts as present, given that the source says so.
    pub(crate) fn holds(&mut self, is_present: bool, now_ns: i64) -> bool {
        match self.engage {
            Engage::Never => false,
            Engage::Once => is_present,
            Engage::Again => is_present && !self.lets_go(now_ns),
        }
    }

    fn lets_go(&mut self, now_ns: i64) -> bool {
        if let Some(since_ns) = self.let_go_ns {
            if now_ns.saturating_sub(since_ns) < LET_GO_NS {
                return true;
            }
            (self.let_go_ns, self.in_vain_since_ns) = (None, None);
        }
        if self.is_engaged {
            self.in_vain_since_ns = None;
            return false;
        }
        let since_ns = *self.in_vain_since_ns.get_or_insert(now_ns);
        if now_ns.saturating_sub(since_ns) < UNANSWERED_NS {
            return false;
        }
        self.let_go_ns = Some(now_ns);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn presence_counts_only_where_that_was_asked_for() {
        assert!(!Grip::new(Engage::Never).holds(true, 0));
        assert!(Grip::new(Engage::Once).holds(true, 0) && !Grip::new(Engage::Once).holds(false, 0));
    }

    #[test]
    fn again_lets_go_and_takes_hold_anew_as_long_as_the_slave_is_not_engaged() {
        let mut grip = Grip::new(Engage::Again);
        grip.note_engaged(true);
        assert!((0..2000).all(|ms| grip.holds(true, ms * MS)));
        grip.note_engaged(false);
        let held: Vec<bool> = (2000..4000).map(|ms| grip.holds(true, ms * MS)).collect();
        let n_edges = held.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        assert!(held[..600].iter().all(|held| *held) && !held[600] && !held[699] && held[700]);
        assert_eq!(n_edges, 2, "once in 700 ms");
    }
}
