//! Riddles for learners: one effect is hidden, a few names stand to choose from, and a guess is judged.

use super::random::{Purpose, Random};
use super::{Answer, GenerateError, Generated, KINDS, Kind, Recipe, generate};

/// Names to choose from.
const N_CHOICES: usize = 4;

/// How hard a riddle is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difficulty {
    /// The effect is four times the noise: a look at the pictures shows it.
    Easy,
    /// Twice the noise.
    Medium,
    /// As large as the noise.
    Hard,
}

impl Difficulty {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Easy, Self::Medium, Self::Hard];

    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Easy => "easy",
            Self::Medium => "medium",
            Self::Hard => "hard",
        }
    }

    /// Size of the hidden effect, in units of the noise's length.
    pub(crate) fn size(self) -> f64 {
        match self {
            Self::Easy => 4.0,
            Self::Medium => 2.0,
            Self::Hard => 1.0,
        }
    }
}

/// Part of the largest size that an effect can have, where that is less than the riddle's.
pub(crate) const OF_LARGEST: f64 = 0.95;

/// What is hidden, how large, and the names to choose from, in the order of the alphabet.
#[derive(Clone, Debug)]
pub struct Quiz {
    /// What is hidden.
    pub kind: &'static Kind,
    /// Its size, in units of the noise's length.
    pub size: f64,
    /// Effects of the catalogue, of which one is right; no two look alike.
    pub choices: Vec<&'static str>,
}

impl Quiz {
    /// The quiz of a seed; the same one every time.
    pub fn new(seed: u64, level: Difficulty) -> Self {
        let mut random = Random::new(seed, Purpose::Kind);
        let known: Vec<&Kind> = KINDS.iter().filter(|kind| kind.is_known()).collect();
        let kind = known[random.below(known.len())];
        let mut asked = vec![kind];
        while asked.len() < N_CHOICES {
            let other = known[random.below(known.len())];
            if asked.iter().all(|own| !other.is_like(own)) {
                asked.push(other);
            }
        }
        let mut choices: Vec<&str> = asked.iter().map(|kind| kind.right[0]).collect();
        choices.sort_unstable();
        Self { kind, size: level.size().min(kind.most_size), choices }
    }

    /// The data of a seed. What cannot be as large as asked for is nearly as large as it can be.
    ///
    /// # Errors
    /// [`GenerateError`].
    pub fn generate(&self, seed: u64) -> Result<Generated, GenerateError> {
        let of_size = |size: f64| generate(&Recipe { hidden: vec![(self.kind, size)], seed, ..Recipe::default() });
        match of_size(self.size) {
            Err(GenerateError::TooLarge { found, .. }) => of_size(OF_LARGEST * found),
            made => made,
        }
    }
}

/// What a guess is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Judgement {
    /// It names what is hidden.
    Right,
    /// It names what nobody could tell from it on these data.
    LookAlike,
    /// Neither.
    Wrong,
}

impl Answer {
    /// Judges the names that somebody guesses; each hidden effect must be named once, in any order.
    pub fn judge(&self, guess: &[&str]) -> Judgement {
        let (each, n_left) = self.weigh(guess);
        if n_left > 0 || each.contains(&Judgement::Wrong) {
            return Judgement::Wrong;
        }
        if each.contains(&Judgement::LookAlike) { Judgement::LookAlike } else { Judgement::Right }
    }

    /// What each name of a guess is worth, and how many hidden effects none of them names.
    pub fn weigh(&self, guess: &[&str]) -> (Vec<Judgement>, usize) {
        let mut left: Vec<&Vec<String>> = self.right.iter().collect();
        let mut each = vec![Judgement::Wrong; guess.len()];
        // What is named exactly is not left to a name that only looks like it.
        for worth in [Judgement::Right, Judgement::LookAlike] {
            for (name, own) in guess.iter().zip(&mut each).filter(|(_, own)| **own == Judgement::Wrong) {
                let n_names = if worth == Judgement::Right { 1 } else { usize::MAX };
                let place = left.iter().position(|right| right.iter().take(n_names).any(|known| known == name));
                if let Some(place) = place {
                    left.remove(place);
                    *own = worth;
                }
            }
        }
        (each, left.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_riddle_has_one_right_choice_among_four_and_many_are_asked() {
        let mut asked = BTreeSet::new();
        for seed in 0..200 {
            let riddle = Quiz::new(seed, Difficulty::Medium);
            let right = riddle.choices.iter().filter(|name| riddle.kind.right.contains(name)).count();
            assert_eq!((riddle.choices.len(), right), (N_CHOICES, 1), "{riddle:?}");
            assert_eq!(Quiz::new(seed, Difficulty::Medium).choices, riddle.choices);
            asked.insert(riddle.kind.name);
        }
        assert!(asked.len() > 20, "{asked:?}");
    }

    #[test]
    fn an_effect_that_cannot_be_as_large_is_asked_for_all_the_same() {
        let riddle = Quiz::new(113, Difficulty::Easy);
        let made = generate(&Recipe { hidden: vec![(riddle.kind, riddle.size)], seed: 113, ..Recipe::default() });
        assert!(matches!(made, Err(GenerateError::TooLarge { .. })), "the seed asks for more than there is");
        assert_eq!(riddle.generate(113).expect("made").answer.judge(&[riddle.kind.right[0]]), Judgement::Right);
    }

    #[test]
    fn a_guess_is_right_alike_or_wrong_and_each_hidden_effect_must_be_named() {
        let kind = |name| KINDS.iter().find(|kind| kind.name == name).expect("a kind");
        let recipe = Recipe { hidden: vec![(kind("backlash"), 2.0)], seconds: 30.0, ..Recipe::default() };
        let answer = generate(&recipe).expect("made").answer;
        assert_eq!(answer.judge(&["backlash"]), Judgement::Right);
        assert_eq!(answer.judge(&["static-friction"]), Judgement::LookAlike);
        for wrong in [&["creep"][..], &[], &["backlash", "creep"], &["backlash", "backlash"]] {
            assert_eq!(answer.judge(wrong), Judgement::Wrong, "{wrong:?}");
        }
        let two = Answer { right: vec![vec!["creep".to_owned()], answer.right[0].clone()], ..answer };
        assert_eq!(two.judge(&["backlash", "creep"]), Judgement::Right);
        assert_eq!(two.judge(&["creep"]), Judgement::Wrong);
        let (right, alike, wrong) = (Judgement::Right, Judgement::LookAlike, Judgement::Wrong);
        assert_eq!(two.weigh(&["creep", "twist"]), (vec![right, wrong], 1));
        assert_eq!(two.weigh(&["static-friction", "creep"]), (vec![alike, right], 0));
        assert_eq!(two.weigh(&["static-friction", "backlash"]), (vec![wrong, right], 1), "the exact name counts");
    }
}
