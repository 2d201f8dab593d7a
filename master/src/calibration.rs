//! Finds rest, range and noise of each absolute axis of a hand from what it tells while nobody touches it and while all of it is moved.
//!
//! noise = 1.5 s + 1 count,   s = (largest - smallest value at rest) / 2
//!
//! where: s is what was seen in a few seconds; half more and a count are for what the next hours bring. Rest is the middle of
//! the values at rest, the range is from the smallest to the largest value of all.

use crate::evdev_names::axis_name;
use crate::{AxisFrom, AxisPlace, InputChange, MasterError, Profile, ProfileAxis, ProfileButton, WatchedAxis};

/// What of an axis' range, as the kernel tells it, must at least have been moved through.
const LEAST_PART: f64 = 0.5;
/// Buttons of a hand.
const N_BUTTONS: u8 = 32;

/// What the hand is asked to do meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// It comes to rest; nothing counts.
    Settling,
    /// Nobody touches it.
    Rest,
    /// All of it is moved and pressed.
    Range,
}

/// A calibration under way. Pure: it is told what the device tells.
#[derive(Debug)]
pub struct HandCalibration {
    profile: Profile,
    axes: Vec<Followed>,
    has_buttons: bool,
    phase: Phase,
}

#[derive(Debug)]
struct Followed {
    code: u16,
    told: Option<[i32; 2]>,
    now: Option<i32>,
    rest: Option<[i32; 2]>,
    range: Option<[i32; 2]>,
}

impl HandCalibration {
    /// For the absolute axes of a profile, whose device is as `watched` says; its others have nothing to be found out. Buttons are those of the profile or, if it has none, those
    /// that are pressed while all is moved, in that order.
    pub fn new(profile: Profile, watched: &[WatchedAxis]) -> Self {
        let axes = profile.axes.iter().filter_map(ProfileAxis::place).map(|axis| {
            let of_it = watched.iter().find(|watched| watched.code == axis.code);
            Followed {
                code: axis.code,
                told: of_it.and_then(|watched| watched.range),
                now: of_it.and_then(|watched| watched.value),
                rest: None,
                range: None,
            }
        });
        Self { axes: axes.collect(), has_buttons: !profile.buttons.is_empty(), profile, phase: Phase::Settling }
    }

    /// The hand comes to rest; nothing counts.
    pub fn settles(&mut self) {
        self.begin(Phase::Settling);
    }

    /// From now on nobody touches the hand.
    pub fn rests(&mut self) {
        self.begin(Phase::Rest);
    }

    /// From now on all of the hand is moved to its ends, and its buttons are pressed.
    pub fn moves(&mut self) {
        self.begin(Phase::Range);
    }

    fn begin(&mut self, phase: Phase) {
        self.phase = phase;
        self.axes.iter_mut().for_each(|axis| axis.count(phase));
    }

    /// Takes what the device tells.
    pub fn take(&mut self, change: InputChange) {
        match change {
            InputChange::Axis(code, value) => {
                if let Some(axis) = self.axes.iter_mut().find(|axis| axis.code == code) {
                    axis.now = Some(value);
                    axis.count(self.phase);
                }
            }
            InputChange::Button(code, true) if self.phase == Phase::Range && !self.has_buttons => {
                let is_taken = self.profile.keys().chain(self.profile.release).any(|known| known == code);
                let buttons = &mut self.profile.buttons;
                if let Ok(button) = u8::try_from(buttons.len())
                    && button < N_BUTTONS
                    && !is_taken
                {
                    buttons.push(ProfileButton { button, code });
                }
            }
            InputChange::Button(..) => {}
        }
    }

    /// The profile with rest, range and noise of every axis.
    ///
    /// # Errors
    /// [`MasterError::Calibration`], which names every axis that cannot be used, and why.
    pub fn finish(mut self) -> Result<Profile, MasterError> {
        let mut refused: Vec<String> = Vec::new();
        let places = self.profile.axes.iter_mut().filter(|axis| axis.place().is_some());
        for (axis, followed) in places.zip(&self.axes) {
            match followed.measured() {
                Ok((range, rest, noise)) => {
                    let (range, rest, noise) = (Some(range), Some(rest), Some(noise));
                    axis.from = AxisFrom::Place(AxisPlace { code: followed.code, range, rest, noise });
                }
                Err(why) => refused.push(format!("{} {why}", axis_name(followed.code))),
            }
        }
        if self.axes.is_empty() {
            refused.push("it has no axis that a hand could have (ABS_X to ABS_RZ)".to_owned());
        }
        if refused.is_empty() {
            Ok(self.profile)
        } else {
            Err(MasterError::Calibration { name: self.profile.name, found: refused.join(", ") })
        }
    }
}

impl Followed {
    fn count(&mut self, phase: Phase) {
        let (Some(now), Some(seen)) = (self.now, self.seen(phase)) else { return };
        *seen = Some(seen.map_or([now; 2], |[low, high]| [low.min(now), high.max(now)]));
    }

    fn seen(&mut self, phase: Phase) -> Option<&mut Option<[i32; 2]>> {
        match phase {
            Phase::Settling => None,
            Phase::Rest => Some(&mut self.rest),
            Phase::Range => Some(&mut self.range),
        }
    }

    /// Range, rest and noise, or why there are none.
    fn measured(&self) -> Result<([i32; 2], i32, i32), String> {
        let (Some(rest_span), Some(range)) = (self.rest, self.range) else {
            return Err("was never moved: it has told nothing".to_owned());
        };
        // Values are any 32 bits that a device may tell.
        let wide = |[low, high]: [i32; 2]| i64::from(high) - i64::from(low);
        let range = [range[0].min(rest_span[0]), range[1].max(rest_span[1])];
        let rest = i64::midpoint(i64::from(rest_span[0]), i64::from(rest_span[1]));
        let noise = (wide(rest_span) * 3 + 3) / 4 + 1;
        let farthest = (i64::from(range[1]) - rest).max(rest - i64::from(range[0]));
        let restless = format!(
            "does not stay at rest: {} to {} untouched, {} to {} in all",
            rest_span[0], rest_span[1], range[0], range[1]
        );
        if self.told.is_some_and(|told| noise > wide(told) / 4) {
            return Err(restless);
        }
        if farthest <= noise && wide(range) <= wide(rest_span) + 2 {
            return Err("was never moved".to_owned());
        }
        if noise > wide(range) / 4 {
            return Err(restless);
        }
        if let Some(told) = self.told
            && (wide(range) as f64) < LEAST_PART * wide(told) as f64
        {
            let percent = 100.0 * wide(range) as f64 / wide(told) as f64;
            return Err(format!("was moved through {percent:.0} % of its range only ({} to {})", told[0], told[1]));
        }
        match (i32::try_from(rest), i32::try_from(noise)) {
            (Ok(rest), Ok(noise)) => Ok((range, rest, noise)),
            _ => Err("tells values beyond 32 bits".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PROFILE: &str = "name = \"Stick\"\nid = \"046d:c215\"\n[[axis]]\nof = \"x\"\nfrom = \"ABS_X\"\n[[axis]]\nof = \"rz\"\nfrom = \"ABS_THROTTLE\"\nsign = \"-\"\n";

    /// Values of ABS_X and ABS_THROTTLE at rest, while all is moved, and at rest again.
    fn calibrated(x: [&[i32]; 3], throttle: [&[i32]; 3]) -> Result<Profile, String> {
        let profile = Profile::parse("stick.toml", PROFILE).expect("a profile");
        let watched = |code| WatchedAxis { code, value: Some(512), range: Some([0, 1023]), noise: 0 };
        let mut calibration = HandCalibration::new(profile, &[watched(0), watched(6)]);
        for phase in 0..3 {
            // What comes while the hand settles does not count.
            calibration.settles();
            calibration.take(InputChange::Button(0x130, true));
            for (code, values) in [(0, x[phase]), (6, throttle[phase])] {
                values.first().into_iter().for_each(|first| calibration.take(InputChange::Axis(code, *first)));
            }
            if phase == 1 {
                calibration.moves()
            } else {
                calibration.rests()
            }
            for (code, values) in [(0, x[phase]), (6, throttle[phase])] {
                values.iter().for_each(|value| calibration.take(InputChange::Axis(code, *value)));
            }
            for button in [0x121, 0x120, 0x121] {
                calibration.take(InputChange::Button(button, true));
            }
        }
        calibration.finish().map_err(|error| error.to_string())
    }

    #[test]
    fn rest_range_noise_and_buttons_are_found_and_the_rest_of_the_profile_is_kept() {
        let profile = calibrated([&[500, 504], &[502, 20, 1001], &[508, 506]], [&[0], &[0, 1023, 0], &[0, 3]])
            .expect("a good calibration");
        // At rest 500 to 508 of either time: the middle, 3/4 of the way between them, rounded up, and 1.
        let x = profile.axes[0].place().expect("a place");
        assert_eq!((x.range, x.rest, x.noise), (Some([20, 1001]), Some(504), Some(7)));
        let throttle = profile.axes[1].place().expect("a place");
        assert_eq!((throttle.range, throttle.rest, throttle.noise), (Some([0, 1023]), Some(1), Some(4)));
        assert!(profile.axes[1].is_negated && profile.axes[1].axis_idx == 5, "where it belongs is the profile's");
        let buttons: Vec<(u8, u16)> = profile.buttons.iter().map(|button| (button.button, button.code)).collect();
        assert_eq!(buttons, [(0, 0x121), (1, 0x120)], "in the order of pressing, only while all is moved");
        assert_eq!(Profile::parse("written", &profile.to_text()).expect("readable"), profile);
    }

    #[test]
    fn an_axis_that_cannot_be_determined_is_named_and_the_others_do_not_save_it() {
        let good: [&[i32]; 3] = [&[512], &[0, 1023, 512], &[512]];
        for (throttle, words) in [
            ([&[512, 514][..], &[513, 512], &[512]], "ABS_THROTTLE was never moved,"),
            ([&[512], &[400, 600, 512], &[512]], "ABS_THROTTLE was moved through 20 % of its range only (0 to 1023)"),
            ([&[0], &[0, 1023], &[1023]], "ABS_THROTTLE does not stay at rest: 0 to 1023 untouched"),
        ] {
            let error = calibrated(good, throttle).expect_err("refused");
            let words = words.trim_end_matches(',');
            assert!(error.contains(words) && !error.contains("ABS_X "), "{error}");
            assert!(error.contains("Stick") && error.contains("nothing is written"), "{error}");
        }
        let ends = [i32::MIN, i32::MAX];
        assert!(calibrated(good, [&[0], &ends, &ends]).is_err(), "no value is too large to be refused");
        let profile = Profile::parse("stick.toml", PROFILE).expect("a profile");
        let silent = HandCalibration::new(profile, &[]).finish().expect_err("nothing was told").to_string();
        assert!(
            silent.contains("ABS_X was never moved") && silent.contains("ABS_THROTTLE was never moved"),
            "{silent}"
        );
    }
}
