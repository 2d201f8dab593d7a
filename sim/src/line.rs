//! One actuation line: from the actuator through the cone and the holder to the end disk, with play and friction that
//! remember.
//!
//! Problem: given the position p where the drive's play ends, the position y of the line's end at the disk, and the place
//! s where the line stood in the cone before, find the load τ that the line pushes the disk with.
//!
//! ```text
//! actuator q~ --play h-- p ==cone, compliance c_c, load τ~== s ==holder and snake, compliance c_d(y), load τ== y
//!
//! play      p  = clamp(p_before, q~ - h, q~ + h)
//! holder    s  = y + c_d τ,  c_d = c_h + c' (L + y): the piece inside the snake is as long as the bend makes it
//! cone      p  = s + c_c τ~
//! friction  lo(τ) <= τ~ <= hi(τ);  s moves in push direction only at hi, in pull direction only at lo
//!           hi(τ) = max(g x, x / g), x = τ + f_s;   lo(τ) = -hi(-τ);   g = e^(2 μ φ)
//! ```
//!
//! where: the capstan factor g enlarges a load that the actuator works against and shrinks one that pushes the actuator
//! back (physics.md section 4, item 1); f_s is the rubbing of the bent-in wire, which also holds an unloaded line. Both
//! oppose the motion, in push and in pull; the sign that decides between g and 1/g is that of the force that really
//! travels round the bend, τ ± f_s, which keeps the band free of jumps at τ = 0.
//!
//! Solution: while the line slips in push direction, p - y = c_d τ + c_c hi(τ) is a rising broken line in τ with three
//! pieces, inverted in closed form: τ_push. In pull direction its mirror image: τ_pull >= τ_push. While it sticks, s stays:
//! τ_stick = (s - y) / c_d. Whichever branch it is on, τ = clamp(τ_stick, τ_push, τ_pull). This is continuous and falls
//! with y, so that the equilibrium of the snake on its lines is a convex problem (see `plant`).

use crate::cone::{N_POINTS, SpreadCone};

/// Compliance of a piece of line, m/N, by the sign of its load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Compliance {
    pub(crate) pushed_m_per_n: f64,
    pub(crate) pulled_m_per_n: f64,
}

impl Compliance {
    pub(crate) fn at(self, load_or_length: f64) -> f64 {
        if load_or_length < 0.0 { self.pulled_m_per_n } else { self.pushed_m_per_n }
    }

    fn mirrored(self) -> Self {
        Self { pushed_m_per_n: self.pulled_m_per_n, pulled_m_per_n: self.pushed_m_per_n }
    }
}

/// The piece of line inside the snake: compliance per metre, 1/N, and its length at the straight pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inside {
    pub(crate) per_metre: Compliance,
    pub(crate) length_m: f64,
}

/// The constants of a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) half_play_m: f64,
    pub(crate) holder: Compliance,
    pub(crate) inside: Inside,
    pub(crate) cone: Compliance,
    /// g = e^(2 μ φ) >= 1.
    pub(crate) capstan: f64,
    /// f_s >= 0.
    pub(crate) static_friction_n: f64,
    /// Takes the place of `cone`, `capstan` and `static_friction_n` where friction is spread along the cone.
    pub(crate) spread: Option<SpreadCone>,
}

/// What a line remembers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Memory {
    /// p: where the play ended last.
    pub(crate) play_m: f64,
    /// s: where the line stood in the cone last.
    pub(crate) slip_m: f64,
    /// The same for each point of a cone along which friction is spread.
    pub(crate) points_m: [f64; N_POINTS],
}

/// The load of a line for a position of its end at the disk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    /// τ: pushes the disk.
    pub(crate) disk_n: f64,
    /// τ~: pushes against the actuator; of the last state that was settled where friction is spread along the cone.
    pub(crate) actuator_n: f64,
    /// -dτ/dy > 0.
    pub(crate) stiffness_n_per_m: f64,
    /// s of this state.
    pub(crate) slip_m: f64,
}

impl Line {
    /// The play operator, wider by `more_m` on each side.
    pub(crate) fn play(&self, before_m: f64, q_tilde_m: f64, more_m: f64) -> f64 {
        let half_m = self.half_play_m + more_m;
        before_m.max(q_tilde_m - half_m).min(q_tilde_m + half_m)
    }

    /// The load with which the line pushes the disk when its end there is at `end_m`.
    pub(crate) fn load(&self, memory: Memory, end_m: f64) -> Load {
        let squeeze = memory.play_m - end_m;
        let holder = self.holder_at(end_m);
        if let Some(spread) = &self.spread {
            let felt = spread.felt(&memory.points_m, holder, end_m, memory.play_m);
            let stiffness_n_per_m = self.lengthened(felt.load_n) / felt.give_m_per_n;
            let actuator_n = spread.actuator_n(&memory.points_m, memory.play_m);
            return Load { disk_n: felt.load_n, actuator_n, stiffness_n_per_m, slip_m: memory.slip_m };
        }
        let stick = (memory.slip_m - end_m) / holder.at(memory.slip_m - end_m);
        let (push, push_slope) = slip(squeeze, holder, self.cone, self.capstan, self.static_friction_n);
        if stick < push {
            return self.slipped(push, push_slope, self.friction_high(push), end_m);
        }
        let (mirrored, pull_slope) =
            slip(-squeeze, holder.mirrored(), self.cone.mirrored(), self.capstan, self.static_friction_n);
        if stick > -mirrored {
            return self.slipped(-mirrored, pull_slope, -self.friction_high(mirrored), end_m);
        }
        let cone_m = memory.play_m - memory.slip_m;
        Load {
            disk_n: stick,
            actuator_n: cone_m / self.cone.at(cone_m),
            stiffness_n_per_m: self.lengthened(stick) / holder.at(memory.slip_m - end_m),
            slip_m: memory.slip_m,
        }
    }

    /// What the line remembers once its end has come to rest here.
    pub(crate) fn settled(&self, memory: Memory, end_m: f64) -> Memory {
        match &self.spread {
            Some(spread) => {
                let points_m = spread.settled(&memory.points_m, self.holder_at(end_m), end_m, memory.play_m);
                Memory { points_m, ..memory }
            }
            None => Memory { slip_m: self.load(memory, end_m).slip_m, ..memory },
        }
    }

    /// Friction at the spacer disks now makes the capstan this, the cone's included where it is at one place.
    pub(crate) fn rub_at_disks(&mut self, disks: f64, cone: f64) {
        match &mut self.spread {
            Some(spread) => spread.set_first_capstan(disks),
            None => self.capstan = disks * cone,
        }
    }

    fn slipped(&self, disk_n: f64, slope_m_per_n: f64, actuator_n: f64, end_m: f64) -> Load {
        let slip_m = end_m + self.holder_at(end_m).at(disk_n) * disk_n;
        Load { disk_n, actuator_n, stiffness_n_per_m: self.lengthened(disk_n) / slope_m_per_n, slip_m }
    }

    /// Holder and snake together, with the line's end at this place.
    fn holder_at(&self, end_m: f64) -> Compliance {
        let Inside { per_metre, length_m } = self.inside;
        Compliance {
            pushed_m_per_n: self.holder.pushed_m_per_n + per_metre.pushed_m_per_n * (length_m + end_m),
            pulled_m_per_n: self.holder.pulled_m_per_n + per_metre.pulled_m_per_n * (length_m + end_m),
        }
    }

    /// By how much more than one the squeeze falls for each metre of the end: the piece inside becomes longer, and gives more.
    fn lengthened(&self, disk_n: f64) -> f64 {
        1.0 + self.inside.per_metre.at(disk_n) * disk_n
    }

    /// hi(τ).
    fn friction_high(&self, disk_n: f64) -> f64 {
        let x = disk_n + self.static_friction_n;
        (x * self.capstan).max(x / self.capstan)
    }
}

/// Solves `squeeze = c_d τ + c_c hi(τ)` for τ; returns τ and the slope of the right side there, m/N.
fn slip(squeeze_m: f64, holder: Compliance, cone: Compliance, capstan: f64, friction_n: f64) -> (f64, f64) {
    let at_no_cone_load_m = -holder.pulled_m_per_n * friction_n;
    let at_no_disk_load_m = cone.pushed_m_per_n * capstan * friction_n;
    if squeeze_m <= at_no_cone_load_m {
        let slope = holder.pulled_m_per_n + cone.pulled_m_per_n / capstan;
        (-friction_n + (squeeze_m - at_no_cone_load_m) / slope, slope)
    } else if squeeze_m <= at_no_disk_load_m {
        let slope = holder.pulled_m_per_n + cone.pushed_m_per_n * capstan;
        ((squeeze_m - at_no_disk_load_m) / slope, slope)
    } else {
        let slope = holder.pushed_m_per_n + cone.pushed_m_per_n * capstan;
        ((squeeze_m - at_no_disk_load_m) / slope, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> Line {
        let holder = Compliance { pushed_m_per_n: 5e-5, pulled_m_per_n: 6e-5 };
        let cone = Compliance { pushed_m_per_n: 7e-6, pulled_m_per_n: 8e-6 };
        let per_metre = Compliance { pushed_m_per_n: 1.2e-4, pulled_m_per_n: 1.3e-4 };
        let inside = Inside { per_metre, length_m: 0.026 };
        Line { half_play_m: 1e-4, holder, inside, cone, capstan: 1.28, static_friction_n: 2.0, spread: None }
    }

    #[test]
    fn slipping_loads_satisfy_the_equations_of_the_line_on_every_piece() {
        let line = line();
        let mut pieces = std::collections::BTreeSet::new();
        for k in -400..=400_i32 {
            let squeeze = f64::from(k) * 1e-6;
            let (tau, slope) = slip(squeeze, line.holder, line.cone, line.capstan, line.static_friction_n);
            let cone = line.friction_high(tau);
            let back = line.holder.at(tau) * tau + line.cone.at(cone) * cone;
            assert!((back - squeeze).abs() < 1e-15, "{squeeze} m comes back as {back} m");
            pieces.insert((slope * 1e9) as i64);
        }
        assert_eq!(pieces.len(), 3, "the sweep meets all three pieces");
    }

    #[test]
    fn the_actuator_load_stays_within_the_friction_band_and_a_sticking_line_stays_put() {
        let line = line();
        let memory = Memory { play_m: 1.2e-3, slip_m: 1.0e-3, ..Memory::default() };
        let mut n_stuck = 0;
        for k in -2000..=2000_i32 {
            let load = line.load(memory, f64::from(k) * 1e-6);
            let (high, low) = (line.friction_high(load.disk_n), -line.friction_high(-load.disk_n));
            assert!(load.actuator_n <= high + 1e-9 && load.actuator_n >= low - 1e-9);
            if load.actuator_n < high - 1e-9 && load.actuator_n > low + 1e-9 {
                assert_eq!(load.slip_m, memory.slip_m);
                n_stuck += 1;
            }
        }
        assert!(n_stuck > 10, "the sweep passes through sticking");
    }

    #[test]
    fn the_load_falls_with_the_position_of_the_disk_as_its_stiffness_says() {
        let line = line();
        let memory = Memory { play_m: 0.3e-3, slip_m: 0.25e-3, ..Memory::default() };
        for k in -100..=100_i32 {
            let (y, dy) = (f64::from(k) * 1.01e-5, 1e-9);
            let (here, there) = (line.load(memory, y), line.load(memory, y + dy));
            let secant = (here.disk_n - there.disk_n) / dy;
            let (low, high) = (
                here.stiffness_n_per_m.min(there.stiffness_n_per_m),
                here.stiffness_n_per_m.max(there.stiffness_n_per_m),
            );
            assert!(secant > low * (1.0 - 1e-4) && secant < high * (1.0 + 1e-4), "{low} {secant} {high}");
        }
    }

    #[test]
    fn play_swallows_its_full_width_after_a_reversal() {
        let line = line();
        let forward = line.play(0.0, 1e-3, 0.0);
        assert_eq!(forward, 1e-3 - 1e-4);
        assert_eq!(line.play(forward, 1e-3 - 1.9e-4, 0.0), forward, "still inside the gap");
        assert!(line.play(forward, 1e-3 - 2.1e-4, 0.0) < forward, "through the gap");
        assert_eq!(line.play(forward, 1e-3 - 2.1e-4, 0.5e-4), forward, "a wider gap");
    }
}
