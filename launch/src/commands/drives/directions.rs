//! Which way each actuator pulls, judged from what the loads answered to small moves.
//!
//! Problem: a motor's own load always resists its motion, so the load's sign says nothing of how the line is wound.
//!
//! Intuition: a line pulls and cannot push. Where an actuator pulls, its load grows; the other way it falls, or stays where the line
//! is slack. That is the only difference between the two ways, so a line that also pushes tells none.
//!
//! Failure: whatever does not fit is refused: nothing is guessed from a majority.

use anyhow::{bail, ensure};
use krait_ipc::message::Actuators;

/// The load of the way that does not pull may grow by this part of the other's.
const QUIET_PART: f64 = 0.5;
/// An encoder shall go by between these parts of what was told.
const FOLLOWS: core::ops::RangeInclusive<f64> = 0.5..=1.5;

/// One actuator's moves one way and back; the others held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    /// How far it was told to go, m, push positive by the configured sign.
    pub(super) way_m: f64,
    /// Loads before, and at the end of the way, by the configured signs.
    pub(super) before: Actuators,
    /// See `before`.
    pub(super) after: Actuators,
    /// What each encoder went by, m.
    pub(super) went_m: Actuators,
    /// What its own had left to go when it was back, m.
    pub(super) left_m: f64,
}

impl Sweep {
    /// By how much the size of the `j`-th load grew.
    pub(super) fn growth(&self, j: usize) -> f64 {
        self.after[j].abs() - self.before[j].abs()
    }

    /// That for a millimetre of the way.
    pub(super) fn growth_per_mm(&self, j: usize) -> f64 {
        self.growth(j) / (self.way_m.abs() * 1e3)
    }

    /// Whether the `k`-th encoder, its own, followed.
    pub(super) fn has_followed(&self, k: usize) -> bool {
        FOLLOWS.contains(&(self.went_m[k] / self.way_m))
    }
}

/// One actuator with its moves both ways.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    /// As a person knows it: number from 1, and id on the bus.
    pub(super) name: String,
    /// Push first by the configured sign, then pull.
    pub(super) sweeps: [Sweep; 2],
    /// Growth of its load that is no noise.
    pub(super) clear: f64,
    /// Unit of its load.
    pub(super) unit: &'static str,
}

/// The way in which the `k`-th of `answers` pulls: 1 or -1 by the configured sign, -1 where that is right.
///
/// # Errors
/// One sentence where the answers contradict themselves or say nothing.
pub(super) fn pull_way(k: usize, answer: &Answer) -> anyhow::Result<f64> {
    let Answer { name, sweeps, clear, unit } = answer;
    for sweep in sweeps {
        followed(k, name, sweep)?;
    }
    let [up, down] = sweeps.map(|sweep| sweep.growth(k));
    let [up_per_mm, down_per_mm] = sweeps.map(|sweep| sweep.growth_per_mm(k));
    let found = format!("found {up_per_mm:+.3} and {down_per_mm:+.3} {unit}/mm");
    ensure!(
        up.max(down) > *clear,
        "{name}: its load grows neither way, expected more than {clear:.3} {unit} where its line is pulled, {found}; \
         is its line fastened, and are all lines under tension? tighten them and calibrate again"
    );
    ensure!(
        up.min(down) <= *clear,
        "{name}: its load grows both ways, expected one, where its line is pulled, {found}; a line that also pushes, or is \
         stuck, does not tell its direction: put all lines under tension and calibrate again"
    );
    ensure!(
        up.min(down) < QUIET_PART * up.max(down),
        "{name}: its two answers are within noise of each other, expected one to be at least twice the other, {found}; keep the \
         machine still and calibrate again"
    );
    let sweep = if up > down { sweeps[0] } else { sweeps[1] };
    let load = sweep.after[k];
    ensure!(
        load * sweep.way_m > 0.0,
        "{name}: its load grows but drives the other way than it was moved, expected the direction of the move, found \
         {load:+.3} {unit} after {:+.3} mm; the motor or the load's direction is reversed in the drive: mend that first",
        sweep.way_m * 1e3
    );
    Ok(sweep.way_m.signum())
}

/// Whether an encoder followed, alone, and came back.
fn followed(k: usize, name: &str, sweep: &Sweep) -> anyhow::Result<()> {
    let (told_mm, went_mm) = (sweep.way_m * 1e3, sweep.went_m[k] * 1e3);
    if !sweep.has_followed(k) {
        let other = sweep.went_m.iter().position(|went_m| FOLLOWS.contains(&(went_m.abs() / sweep.way_m.abs())));
        let what = match other {
            Some(j) if j != k => format!(", and the encoder of actuator {} moved instead; are ids exchanged?", j + 1),
            _ if went_mm * told_mm < 0.0 => ", the other way; is the motor reversed in the drive?".to_owned(),
            _ => "; is its encoder fast on the shaft, and can the shaft turn?".to_owned(),
        };
        bail!("{name}: its encoder does not follow, expected {told_mm:+.3} mm, found {went_mm:+.3} mm{what}");
    }
    let left_mm = sweep.left_m * 1e3;
    ensure!(
        left_mm.abs() < 0.5 * told_mm.abs(),
        "{name}: it did not come back, expected where it began, found {left_mm:+.3} mm from there; does its line slip or jam?"
    );
    Ok(())
}

/// Whether actuators agree: what loads a line further while another pulls must load it in the direction in which it pulls itself.
/// `ways` are their own answers ([`pull_way`]).
///
/// # Errors
/// One sentence that names two who do not.
pub(super) fn agree(answers: &[Answer], ways: &[f64]) -> anyhow::Result<()> {
    for (k, (mover, way)) in answers.iter().zip(ways).enumerate() {
        let pull = if *way > 0.0 { &mover.sweeps[0] } else { &mover.sweeps[1] };
        for (j, (held, own)) in answers.iter().zip(ways).enumerate().filter(|(j, _)| *j != k) {
            ensure!(
                pull.growth(j) <= held.clear || pull.after[j] * own > 0.0,
                "{} and {} contradict each other: the first one's pull loads the second where it pushes by its own answer, \
                 expected where it pulls, found {:+.3} {}; see how their lines run, and calibrate again",
                mover.name,
                held.name,
                pull.after[j],
                held.unit
            );
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_ipc::message::MAX_ACTUATORS;

    /// A move of the first actuator by a way, mm, in which loads go from and to somewhere, and its encoder goes so far, mm.
    fn sweep(way_mm: f64, loads: [(f64, f64); 2], went_mm: f64) -> Sweep {
        let mut sweep = Sweep {
            way_m: way_mm * 1e-3,
            before: [0.0; MAX_ACTUATORS],
            after: [0.0; MAX_ACTUATORS],
            went_m: [0.0; MAX_ACTUATORS],
            left_m: 0.0,
        };
        sweep.went_m[0] = went_mm * 1e-3;
        for (j, (before, after)) in loads.into_iter().enumerate() {
            (sweep.before[j], sweep.after[j]) = (before, after);
        }
        sweep
    }

    fn answer(name: &str, sweeps: [Sweep; 2]) -> Answer {
        Answer { name: name.to_owned(), sweeps, clear: 0.1, unit: "A" }
    }

    /// Own loads before, after a push of 0.4 mm and after a pull, by the configured sign.
    fn judged(rest: f64, pushed: f64, pulled: f64) -> Result<f64, String> {
        let other = (-1.0, -1.0);
        let sweeps = [sweep(0.4, [(rest, pushed), other], 0.39), sweep(-0.4, [(rest, pulled), other], -0.41)];
        pull_way(0, &answer("actuator 1 (id 7)", sweeps)).map_err(|error| error.to_string())
    }

    #[test]
    fn a_line_pulls_where_its_load_grows_whether_the_other_way_slackens_it_or_finds_it_slack() {
        assert_eq!(judged(-1.0, -0.4, -1.6), Ok(-1.0));
        assert_eq!(judged(0.0, 0.0, -0.5), Ok(-1.0));
        // By the wrong sign tension looks like push.
        assert_eq!(judged(1.0, 1.6, 0.4), Ok(1.0));
        assert_eq!(judged(0.0, 0.5, 0.0), Ok(1.0));
    }

    #[test]
    fn answers_that_contradict_themselves_are_refused_with_what_was_found() {
        for (loads, words) in [
            ((0.0, 0.8, -0.8), "grows both ways"),
            ((-1.0, -1.05, -0.95), "grows neither way"),
            ((0.0, 0.0, 0.0), "grows neither way"),
            ((0.0, 0.09, -0.12), "within noise of each other"),
            ((1.0, 0.4, 1.6), "drives the other way"),
        ] {
            let sentence = judged(loads.0, loads.1, loads.2).unwrap_err();
            assert!(sentence.starts_with("actuator 1 (id 7): ") && sentence.contains(words), "{sentence}");
            assert!(sentence.contains("expected") && sentence.contains("found"), "{sentence}");
        }
    }

    #[test]
    fn an_encoder_that_stays_turns_round_or_is_anothers_is_refused() {
        let loads = [(-1.0, -0.4), (-1.0, -1.0)];
        let good = sweep(-0.4, [(-1.0, -1.6), (-1.0, -1.0)], -0.4);
        let said = |bad: Sweep| pull_way(0, &answer("actuator 1 (id 7)", [bad, good])).unwrap_err().to_string();
        let stays = said(sweep(0.4, loads, 0.01));
        assert!(stays.contains("expected +0.400 mm, found +0.010 mm; is its encoder fast"), "{stays}");
        let turned = said(sweep(0.4, loads, -0.4));
        assert!(turned.contains("found -0.400 mm, the other way"), "{turned}");
        let mut exchanged = sweep(0.4, loads, 0.0);
        exchanged.went_m[1] = 0.4e-3;
        let sentence = said(exchanged);
        assert!(sentence.contains("actuator 2 moved instead"), "{sentence}");
        let sentence = said(Sweep { left_m: 0.3e-3, ..sweep(0.4, loads, 0.4) });
        assert!(sentence.contains("did not come back"), "{sentence}");
    }

    #[test]
    fn two_actuators_of_which_one_loads_the_other_where_it_pushes_contradict_each_other() {
        let pushed = sweep(0.4, [(-1.0, -0.4), (-1.0, -0.8)], 0.4);
        let pulling = |other: f64| sweep(-0.4, [(-1.0, -1.6), (other.signum(), other)], -0.4);
        let quiet = answer("actuator 2 (id 8)", [pushed; 2]);
        let all = |other: f64| [answer("actuator 1 (id 7)", [pushed, pulling(other)]), quiet.clone()];
        agree(&all(-1.3), &[-1.0, -1.0]).unwrap();
        agree(&all(1.3), &[-1.0, 1.0]).unwrap();
        let sentence = agree(&all(1.3), &[-1.0, -1.0]).unwrap_err().to_string();
        assert!(sentence.starts_with("actuator 1 (id 7) and actuator 2 (id 8) contradict"), "{sentence}");
    }
}
