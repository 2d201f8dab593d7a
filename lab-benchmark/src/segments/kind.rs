//! What can be hidden in segments: each kind with its law in the plant, of all segments or of one, and the names that count as right.

use super::plant::Plant;
use crate::generate::Random;
use core::f64::consts::TAU;
use krait_model::effects::SegmentEffect;

const SCALE: &[&str] = &["stiffness-scale", "inside-extension"];
const PLAY: &[&str] = &["backlash", "static-friction"];
const UNKNOWN: &[&str] = &["unknown"];

/// An effect that can be hidden in segments.
#[derive(Clone, Copy, Debug)]
pub struct SegmentKind {
    law: &'static Law,
    /// The segment whose own it is, from 0; `None` for all.
    segment: Option<usize>,
}

/// Whose an effect can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whose {
    AllOrOne,
    All,
    /// How the camera sees one.
    Seen,
    /// How it sees all of them.
    Picture,
}

#[derive(Debug)]
struct Law {
    name: &'static str,
    about: &'static str,
    whose: Whose,
    /// Effects of all segments that count as right, the first with the parameters that are known.
    right: &'static [&'static str],
    /// Where the search for the wanted size begins, and the largest amplitude.
    typical: f64,
    most: f64,
    apply: fn(&mut Plant, Option<usize>, f64, &Draw),
    known: fn(f64, &Draw) -> Vec<(&'static str, f64)>,
}

/// Sign, direction and place, drawn once for each hidden effect.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    sign: f64,
    angle_rad: f64,
    part: f64,
    seconds: f64,
}

impl Draw {
    pub(super) fn new(random: &mut Random, seconds: f64) -> Self {
        Self { sign: random.sign(), angle_rad: random.between(0.0, TAU), part: random.between(0.0, 1.0), seconds }
    }

    fn polar(&self, size: f64) -> [f64; 2] {
        [size * self.angle_rad.cos(), size * self.angle_rad.sin()]
    }
}

impl SegmentKind {
    /// Every kind of so many segments: those of all, then segment after segment, those that no effect of the lab explains last.
    pub fn all(n_segments: usize) -> Vec<Self> {
        let of = |segment: Option<usize>, whose: &'static [Whose]| {
            LAWS.iter().filter(move |law| whose.contains(&law.whose)).map(move |law| Self { law, segment })
        };
        let all = of(None, &[Whose::AllOrOne, Whose::All, Whose::Picture]);
        let each = (0..n_segments).flat_map(|k| of(Some(k), &[Whose::AllOrOne, Whose::Seen]));
        let (known, unknown): (Vec<Self>, Vec<Self>) = all.chain(each).partition(Self::is_known);
        known.into_iter().chain(unknown).collect()
    }

    /// The kind of that name: `backlash` of all segments, `backlash-2` of the second.
    pub fn from_name(name: &str, n_segments: usize) -> Option<Self> {
        Self::all(n_segments).into_iter().find(|kind| kind.name() == name)
    }

    /// Its name; those that no known effect explains begin with `x_`.
    pub fn name(&self) -> String {
        self.numbered(self.law.name)
    }

    /// One line for a table.
    pub fn about(&self) -> &'static str {
        self.law.about
    }

    /// Names of effects that count as right; one segment has not all that all have.
    pub fn right(&self) -> Vec<String> {
        let names = self.law.right.iter().map(|name| self.numbered(name));
        names.filter(|name| self.segment.is_none() || SegmentEffect::from_name(name).is_some()).collect()
    }

    fn numbered(&self, name: &str) -> String {
        self.segment.map_or_else(|| name.to_owned(), |segment| format!("{name}-{}", segment + 1))
    }

    /// Whether an effect of the lab explains it.
    pub fn is_known(&self) -> bool {
        self.law.right != UNKNOWN
    }

    /// Whether all segments of the machine have it: a model that has such an effect already cannot lack it.
    pub fn is_of_all(&self) -> bool {
        self.segment.is_none() && self.is_of_machine()
    }

    /// Whether the machine has it, not its picture alone: only then can a truth file tell of it.
    pub fn is_of_machine(&self) -> bool {
        matches!(self.law.whose, Whose::AllOrOne | Whose::All)
    }

    /// Whether one law, or two that look alike, are behind both: of two segments, what all have and what one has make the same.
    pub fn is_like(&self, other: &Self) -> bool {
        self.law.right.iter().any(|name| other.law.right.contains(name))
    }

    /// Where the search for the wanted size begins, and the largest amplitude.
    pub(super) fn typical_and_most(&self) -> (f64, f64) {
        (self.law.typical, self.law.most)
    }

    pub(super) fn hide(&self, plant: &mut Plant, amplitude: f64, draw: &Draw) {
        (self.law.apply)(plant, self.segment, amplitude, draw);
    }

    /// Parameters of the first right effect, by their names in a model file.
    pub(super) fn known(&self, amplitude: f64, draw: &Draw) -> Vec<(&'static str, f64)> {
        (self.law.known)(amplitude, draw)
    }
}

fn nothing(_: f64, _: &Draw) -> Vec<(&'static str, f64)> {
    Vec::new()
}

#[rustfmt::skip]
static LAWS: &[Law] = &[
    Law { name: "stiffness", about: "stiffer or softer", whose: Whose::AllOrOne, right: SCALE, typical: 0.1, most: 0.7,
        apply: |p, k, a, d| p.change(k, |own| own.load_scale *= 1.0 + d.sign * a),
        known: |a, d| vec![("eta", 1.0 + d.sign * a)] },
    Law { name: "backlash", about: "the actuators have play", whose: Whose::AllOrOne, right: PLAY, typical: 1e-4, most: 1.8e-3,
        apply: |p, k, a, _| p.change(k, |own| own.play_m += a),
        known: |a, _| vec![("half_width_m", 0.5 * a)] },
    Law { name: "static-friction", about: "the wire rubs in the cone, loaded or not", whose: Whose::AllOrOne, right: &["static-friction", "backlash"], typical: 2.0, most: 18.0,
        apply: |p, k, a, _| p.change(k, |own| own.f_s_n += a),
        known: |a, _| vec![("f_s_n", a)] },
    Law { name: "cone", about: "friction of the loaded line round the cone", whose: Whose::AllOrOne, right: &["cone-friction"], typical: 0.1, most: 0.8,
        apply: |p, k, a, _| p.change(k, |own| own.mu += a),
        known: |a, _| vec![("mu", a)] },
    Law { name: "inside", about: "lines give inside the segments too", whose: Whose::All, right: &["inside-extension", "stiffness-scale"], typical: 0.5, most: 1.5,
        apply: |p, k, a, _| p.change(k, |own| own.inside = a),
        known: |a, _| vec![("share", a)] },
    Law { name: "camera-scale", about: "the camera reads too much or too little", whose: Whose::Seen, right: &["camera-scale"], typical: 0.03, most: 0.2,
        apply: |p, k, a, d| p.see(k, |own| own.scale += d.sign * a),
        known: |a, d| vec![("relative", d.sign * a)] },
    Law { name: "camera-offset", about: "the camera's view is tilted", whose: Whose::Seen, right: &["camera-offset"], typical: 0.01, most: 0.4,
        apply: |p, k, a, d| p.see(k, |own| own.offset_rad = d.polar(a)),
        known: |a, d| { let [x, y] = d.polar(a); vec![("offset_x_rad", x), ("offset_y_rad", y)] } },
    Law { name: "delay", about: "the camera's clock is late", whose: Whose::Picture, right: &["latency"], typical: 0.05, most: 0.9,
        apply: |p, _, a, _| p.delay_s = a,
        known: |a, _| vec![("delay_s", a)] },
    Law { name: "x_push", about: "segment 2 is pushed aside where segment 1 bends to one side", whose: Whose::Picture, right: UNKNOWN, typical: 0.3, most: 5.0,
        apply: |p, _, a, _| p.push_per_rad = a, known: nothing },
    Law { name: "x_sway", about: "the whole view sways as on a chest that breathes", whose: Whose::Picture, right: UNKNOWN, typical: 0.01, most: 0.4,
        apply: |p, _, a, d| { p.sway_rad = d.polar(a); p.sway_hz = 0.15 + 0.25 * d.part; }, known: nothing },
    Law { name: "x_collision", about: "segment 1 is shifted from the middle on", whose: Whose::Picture, right: UNKNOWN, typical: 0.02, most: 0.4,
        apply: |p, _, a, d| { p.shift_rad = d.polar(a); p.shift_from_s = d.seconds * (0.3 + 0.4 * d.part); }, known: nothing },
];
