//! Reads what a light told: when it was on and off, as a person who looks at it counts.

/// A light's changes over a stretch of time: (instant ns, is on).
#[derive(Debug, Default)]
pub struct Code(Vec<(i64, bool)>);

impl Code {
    /// From what it was switched to, repetitions left out, within a stretch of time; before it the light was as last switched.
    pub fn within(switched: &[(i64, bool)], from_ns: i64, to_ns: i64) -> Self {
        let before = switched.iter().rfind(|(at_ns, _)| *at_ns <= from_ns).map(|(_, is_on)| (from_ns, *is_on));
        let later = switched.iter().filter(|(at_ns, _)| (from_ns + 1..to_ns).contains(at_ns)).copied();
        let mut changes: Vec<(i64, bool)> = before.into_iter().chain(later).collect();
        changes.dedup_by_key(|(_, is_on)| *is_on);
        changes.push((to_ns, false));
        Self(changes)
    }

    /// How long it was on or off, ms.
    fn stretches(&self) -> Vec<(bool, i64)> {
        self.0.windows(2).map(|pair| (pair[0].1, (pair[1].0 - pair[0].0) / 1_000_000)).collect()
    }

    /// The same without the first and the last, which are cut.
    fn whole_stretches(&self) -> Vec<(bool, i64)> {
        let all = self.stretches();
        all.get(1..all.len().saturating_sub(1)).unwrap_or_default().to_vec()
    }

    /// Dark, but for winks of an eighth of the darkness between them at most.
    pub fn is_wink(&self) -> bool {
        let whole = self.whole_stretches();
        let longest_on = whole.iter().filter(|(is_on, _)| *is_on).map(|(_, ms)| *ms).max();
        let shortest_off = whole.iter().filter(|(is_on, _)| !*is_on).map(|(_, ms)| *ms).min();
        longest_on.zip(shortest_off).is_some_and(|(on, off)| on * 8 <= off)
    }

    /// On all the time.
    pub fn is_steady(&self) -> bool {
        self.0.len() == 2 && self.0[0].1
    }

    /// Off all the time.
    pub fn is_dark(&self) -> bool {
        self.0.len() == 2 && !self.0[0].1
    }

    /// Two gaps, and on for longer before and behind them than they take.
    pub fn is_two_gaps(&self) -> bool {
        let all = self.stretches();
        let is_pair = |five: &[(bool, i64)]| match five {
            [(true, before), (false, a), (true, between), (false, b), (true, after)] => {
                a + between + b < *before.min(after)
            }
            _ => false,
        };
        all.windows(5).any(is_pair) && all.iter().all(|(is_on, ms)| *is_on || *ms < 400)
    }

    /// On and off in turn, equally long within the pause between two looks of whoever switches it, and again and again.
    pub fn is_fast(&self) -> bool {
        let whole = self.whole_stretches();
        whole.len() >= 5 && whole.iter().all(|(_, ms)| (50..=250).contains(ms))
    }

    /// How many flashes each whole code has that counts something: one 0 where it is dark all the time, one 4 where it is on.
    pub fn flashes(&self) -> Vec<usize> {
        if self.is_dark() || self.is_steady() {
            return vec![if self.is_dark() { 0 } else { 4 }];
        }
        let (mut codes, mut n_on, mut is_whole) = (Vec::new(), 0, false);
        for (is_on, ms) in self.stretches() {
            match (is_on, ms) {
                (true, 50..=250) => n_on += 1,
                (true, _) => is_whole = false,
                // The pause between two codes; those between flashes are an eighth of a second.
                (false, 500..) => {
                    codes.extend((is_whole && n_on > 0).then_some(n_on));
                    (n_on, is_whole) = (0, true);
                }
                (false, _) => {}
            }
        }
        codes
    }

    /// The stretches as one word.
    pub fn word(&self) -> String {
        let words: Vec<String> = self
            .stretches()
            .into_iter()
            .take(12)
            .map(|(is_on, ms)| format!("{}{ms}", if is_on { '+' } else { '-' }))
            .collect();
        words.concat()
    }
}
