//! How often the watch for changes is wrong, counted on many hours of motion without a change, and how soon it is right.

use crate::common::Noise;
use core::f64::consts::TAU;
use krait_model::{Change, ChangeKind, ChangeParameters, ChangeWatch, Innovation};
use nalgebra::Vector2;

const PERIOD_S: f64 = 1.0 / 60.0;
const LEARN_S: f64 = 30.0;

/// Innovations of a snake that goes round and round, with noise that is partly slow.
struct Source {
    noise: Noise,
    slow: Vector2<f64>,
    /// Share of the variance that is slow, and its correlation time, s.
    share: f64,
    time_s: f64,
    n: u64,
}

impl Source {
    fn new(seed: u64, share: f64, time_s: f64) -> Self {
        Self { noise: Noise::new(seed), slow: Vector2::zeros(), share, time_s, n: 0 }
    }

    fn pair(&mut self) -> Vector2<f64> {
        Vector2::new(self.noise.next(), self.noise.next())
    }

    /// The next one, with something added that may depend on the bend and on the motion.
    fn next(&mut self, added: impl Fn(Vector2<f64>, Vector2<f64>) -> Vector2<f64>) -> Innovation {
        self.n += 1;
        if self.share > 0.0 {
            let keep = (-PERIOD_S / self.time_s).exp();
            self.slow = self.slow * keep + self.pair() * (1.0 - keep * keep).sqrt();
        }
        let r = self.pair() * (1.0 - self.share).sqrt() + self.slow * self.share.sqrt();
        // An ellipse that opens and closes: all planes, both directions.
        let t = self.n as f64 * PERIOD_S;
        let bend = |t: f64| Vector2::new((TAU * 0.11 * t).sin(), (TAU * 0.17 * t).cos()) * 0.8;
        let (bend_rad, motion_rad) = (bend(t), bend(t) - bend(t - PERIOD_S));
        Innovation { r: r + added(bend_rad, motion_rad), bend_rad, motion_rad, dt_s: PERIOD_S }
    }
}

fn watch(per_hour: f64) -> ChangeWatch {
    ChangeWatch::new(ChangeParameters { false_alarms_per_hour: per_hour, learn_s: LEARN_S }).unwrap()
}

/// Hours of motion that were watched, and the alarms in them, though nothing changed.
fn false_alarms(per_hour: f64, hours: f64, share: f64, time_s: f64) -> (f64, f64) {
    let mut source = Source::new(7, share, time_s);
    let mut watch = watch(per_hour);
    let (mut n_watched, mut n_alarms) = (0.0, 0.0);
    while n_watched < hours * 3600.0 / PERIOD_S {
        n_watched += f64::from(u8::from(watch.is_watching()));
        if watch.observe(&source.next(|_, _| Vector2::zeros())).is_some() {
            n_alarms += 1.0;
        }
    }
    (n_watched * PERIOD_S / 3600.0, n_alarms)
}

/// Counts follow Poisson's law: three standard deviations each way.
fn is_within(n_alarms: f64, low: f64, high: f64) -> bool {
    n_alarms > low - 3.0 * low.sqrt() && n_alarms < high + 3.0 * high.sqrt()
}

#[test]
fn false_alarms_come_at_most_as_often_as_was_asked_for_and_not_much_less_often() {
    for (per_hour, hours) in [(10.0, 30.0), (1.0, 40.0)] {
        let (watched_h, n_alarms) = false_alarms(per_hour, hours, 0.0, 1.0);
        println!("white: {n_alarms} alarms in {watched_h:.0} h, {per_hour} per hour asked for");
        assert!(is_within(n_alarms, 0.5 * per_hour * watched_h, per_hour * watched_h), "{n_alarms}");
    }
}

#[test]
fn a_camera_with_coloured_noise_gives_no_more_false_alarms() {
    // Without whitening the first of these alarms every second.
    for (share, time_s) in [(1.0, 0.15), (0.5, 0.2), (0.5, 1.0), (0.5, 3.0)] {
        let (watched_h, n_alarms) = false_alarms(10.0, 12.0, share, time_s);
        println!("{share} slow, {time_s} s: {n_alarms} alarms in {watched_h:.0} h, 10 per hour asked for");
        assert!(is_within(n_alarms, 1.0 * watched_h, 10.0 * watched_h), "{share} {time_s}: {n_alarms}");
    }
}

/// Seconds until a change of this kind is seen, and how it was called.
fn seen_after(share: f64, added: impl Fn(Vector2<f64>, Vector2<f64>) -> Vector2<f64>) -> (f64, ChangeKind) {
    let (mut source, mut watch) = (Source::new(3, share, 0.2), watch(1.0));
    while source.n < 7200 {
        assert_eq!(watch.observe(&source.next(|_, _| Vector2::zeros())), None, "nothing has changed yet");
    }
    let begun = source.n;
    loop {
        if let Some(Change { kind, statistic, limit }) = watch.observe(&source.next(&added)) {
            assert!(statistic > limit);
            return ((source.n - begun) as f64 * PERIOD_S, kind);
        }
        assert!(source.n - begun < 3600, "a minute and no alarm");
    }
}

#[test]
fn a_change_of_the_size_of_the_noise_is_seen_within_seconds_and_named_by_its_direction() {
    let unit = |v: Vector2<f64>| v.try_normalize(0.0).expect("a direction");
    let seen = [
        (seen_after(0.0, |_, _| Vector2::new(1.2, 0.0)), ChangeKind::AlongX),
        (seen_after(0.0, |_, _| Vector2::new(0.0, -1.2)), ChangeKind::AlongY),
        (seen_after(0.0, |bend, _| 1.2 * unit(bend)), ChangeKind::InPlane),
        (seen_after(0.0, |bend, _| 1.2 * unit(Vector2::new(-bend.y, bend.x))), ChangeKind::OutOfPlane),
        (seen_after(0.0, |_, motion| -1.2 * unit(motion)), ChangeKind::WithMotion),
        // The whitening takes what is slow out of a change as well; what goes with the motion is left.
        (seen_after(0.5, |_, motion| -2.0 * unit(motion)), ChangeKind::WithMotion),
    ];
    for ((seconds, kind), expected) in seen {
        println!("{expected:?}: called {kind:?} after {seconds:.2} s");
        assert!(seconds < 6.0, "{expected:?}: {seconds} s");
        assert_eq!(kind, expected, "after {seconds} s");
    }
    let noise = std::cell::RefCell::new(Noise::new(11));
    let wild = |_, _| {
        let mut noise = noise.borrow_mut();
        Vector2::new(noise.next(), noise.next()) * 1.5
    };
    assert_eq!(seen_after(0.0, wild).1, ChangeKind::Scatter);
}

#[test]
fn glitches_pauses_and_numbers_that_are_not_finite_are_no_change() {
    let (mut source, mut watch) = (Source::new(5, 0.0, 1.0), watch(1.0));
    for n in 0..20_000 {
        let mut seen = source.next(|_, _| if n % 500 == 499 { Vector2::new(60.0, -40.0) } else { Vector2::zeros() });
        match n % 1000 {
            10 => seen.r.x = f64::NAN,
            20 => seen.dt_s = 1e4,
            30 => seen.dt_s = -1.0,
            40 => (seen.bend_rad, seen.motion_rad) = (Vector2::zeros(), Vector2::zeros()),
            _ => {}
        }
        assert_eq!(watch.observe(&seen), None, "at {n}");
    }
    assert!(watch.is_watching());
}

#[test]
fn after_an_alarm_the_new_state_is_learnt_and_a_second_change_is_seen() {
    let (mut source, mut watch) = (Source::new(9, 0.0, 1.0), watch(1.0));
    let mut alarms = Vec::new();
    for n in 0..18_000u64 {
        let step = (n / 6000) as f64;
        if watch.observe(&source.next(|_, _| Vector2::new(0.0, 4.0 * step))).is_some() {
            alarms.push(n / 6000);
        }
    }
    assert_eq!(alarms, [1, 2]);
}

#[test]
fn settings_out_of_range_are_refused() {
    for (per_hour, learn_s, key) in [(0.0, 30.0, "false_alarms_per_hour"), (1.0, f64::NAN, "learn_s")] {
        let error = ChangeWatch::new(ChangeParameters { false_alarms_per_hour: per_hour, learn_s }).unwrap_err();
        assert!(error.to_string().contains(key), "{error}");
    }
}
