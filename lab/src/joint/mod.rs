//! Joints that nobody calibrated, with several effects at once.
//!
//! Each joint is fitted by itself. Everything linear (gain, offset, amplitudes) is solved for inside every fit; only nonlinear
//! parameters are searched, on logarithmic grids with two minima kept (`search`). A list of effects is kept as far as its members
//! pay on left-out blocks of time (`gate`); shapes that no effect makes compete with the effects, so that these do not imitate them.
//! Nothing is claimed unless sign flips of blocks say so (`first`).

mod add;
mod answer;
mod beside;
mod clock;
mod clock_rate;
mod columns;
mod decide;
mod first;
mod floor;
mod following;
mod gate;
mod kind;
mod numbers;
mod own;
mod proposals;
mod refine;
mod search;
mod shapes;
mod signal;
mod simulate;
mod solve;
mod starts;
mod still;
mod terms;

pub(crate) use add::add;
pub(crate) use beside::{middle, varying_number_of};
pub(crate) use clock::diagnose;
pub(crate) use numbers::calibrated;
pub(crate) use own::{Ground, OF_MACHINE, Start, Together, told};
pub(crate) use signal::Number;
pub(crate) use starts::{Starts, has_starts, with_starts};
pub(crate) use still::{check_effect, check_gains, hides_gain};
