//! Riddles on segments: four names of which one is right, none that the model has already, and data that can be made of every one.

use krait_lab_benchmark::generate::Difficulty;
use krait_lab_benchmark::segments::{SegmentKind, SegmentsQuiz};
use krait_model::effects::explanation;
use krait_model::model_file::ModelFile;
use std::collections::BTreeSet;

#[test]
fn every_riddle_has_one_right_choice_among_four_that_its_model_lacks() {
    for n_segments in [2, 3] {
        let mut asked = BTreeSet::new();
        for seed in 0..200 {
            let riddle = SegmentsQuiz::new(seed, n_segments, Difficulty::Medium);
            let right = riddle.choices.iter().filter(|name| riddle.kind.right().contains(name)).count();
            assert_eq!((riddle.choices.len(), right), (4, 1), "{riddle:?}");
            assert!(riddle.choices.iter().all(|name| explanation(name).is_some()), "{riddle:?}");
            assert_eq!(SegmentsQuiz::new(seed, n_segments, Difficulty::Medium).choices, riddle.choices);
            let model = ModelFile::parse(&riddle.recipe().model().expect("a model")).expect("a model file");
            let has = |name: &String| model.effects().iter().any(|own| own.setting().kind().name() == name);
            assert!(!riddle.choices.iter().any(has), "{riddle:?}");
            asked.insert(riddle.kind.name());
        }
        assert!(asked.len() > 10, "{asked:?}");
    }
}

#[test]
fn what_cannot_be_as_large_as_asked_for_is_as_large_as_it_can_be() {
    for (name, n_segments, least, most) in
        [("backlash-2", 2, 3.2, 4.8), ("inside", 2, 1.5, 3.5), ("static-friction-1", 3, 1.5, 3.5)]
    {
        let kind = SegmentKind::from_name(name, n_segments).expect("a kind");
        let riddle = SegmentsQuiz { kind, ..SegmentsQuiz::new(5, n_segments, Difficulty::Easy) };
        let answer = riddle.generate().expect("made").answer;
        let size = answer.effect_rms_deg / ((2.0 * n_segments as f64).sqrt() * riddle.recipe().sigma_rad.to_degrees());
        assert!((least..most).contains(&size), "{name}: {size}");
    }
}
