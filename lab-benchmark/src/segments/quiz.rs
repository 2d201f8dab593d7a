//! Riddles on segments in series: one effect of one segment, of all or of the picture is hidden, and a few names stand to choose from.

use super::{SegmentKind, SegmentsRecipe, segments};
use crate::generate::{Difficulty, GenerateError, Generated, OF_LARGEST, Purpose, Random};
use krait_sim::SegmentsTruth;

/// Names to choose from.
const N_CHOICES: usize = 4;

/// What is hidden, how large, and the names to choose from, in the order of the alphabet.
#[derive(Clone, Debug)]
pub struct SegmentsQuiz {
    /// What is hidden.
    pub kind: SegmentKind,
    /// Its size, in units of the noise's length.
    pub size: f64,
    /// Effects of the catalogue, of which one is right; no two look alike.
    pub choices: Vec<String>,
    /// Segments of the robot.
    pub n_segments: usize,
    /// Everything that is drawn follows from it.
    pub seed: u64,
}

impl SegmentsQuiz {
    /// The quiz of a seed on so many segments; the same one every time.
    pub fn new(seed: u64, n_segments: usize, level: Difficulty) -> Self {
        let mut random = Random::new(seed, Purpose::Kind);
        let known: Vec<SegmentKind> = SegmentKind::all(n_segments).into_iter().filter(SegmentKind::is_known).collect();
        let kind = known[random.below(known.len())];
        // The model of a riddle has friction and play, unless an effect of all segments is hidden: what it has cannot be what it lacks.
        let may_lack: Vec<SegmentKind> = known.into_iter().filter(|own| kind.is_of_all() || !own.is_of_all()).collect();
        let mut asked = vec![kind];
        while asked.len() < N_CHOICES {
            let other = may_lack[random.below(may_lack.len())];
            if asked.iter().all(|own| !other.is_like(own)) {
                asked.push(other);
            }
        }
        let mut choices: Vec<String> = asked.iter().filter_map(|kind| kind.right().into_iter().next()).collect();
        choices.sort_unstable();
        Self { kind, size: level.size(), choices, n_segments, seed }
    }

    /// What its data are made of.
    pub fn recipe(&self) -> SegmentsRecipe {
        let hidden = vec![(self.kind, self.size)];
        SegmentsRecipe { n_segments: self.n_segments, hidden, seed: self.seed, ..SegmentsRecipe::default() }
    }

    /// Its data. What cannot be as large as asked for is nearly as large as it can be.
    ///
    /// # Errors
    /// [`GenerateError`].
    pub fn generate(&self) -> Result<Generated<SegmentsTruth>, GenerateError> {
        match segments(&self.recipe()) {
            Err(GenerateError::TooLarge { found, .. }) => {
                segments(&Self { size: OF_LARGEST * found, ..self.clone() }.recipe())
            }
            made => made,
        }
    }
}
