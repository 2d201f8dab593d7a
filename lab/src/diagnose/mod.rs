//! Diagnosis: which effect is missing, how sure that is, and what these data cannot tell.
//!
//! 1. The noise floor and outliers, without any model of what is missing (`noise`).
//!    Columns that another order or unit explains far better are said instead of any effect (`columns`, `force_columns`).
//! 2. Screening of every candidate to first order, and one p-value for the whole search (`screen`, `sign_flip`).
//! 3. Singles and pairs refined by whole simulations, ranked by what they leave and by their number of parameters (`search`), and
//!    longer lists by a beam behind them (`lists`), their members exchanged or begun anew until that brings nothing; then other lists
//!    as a whole, to first order (`at_once`).
//!    Of many rows all of this is done on a part; what comes close there is fitted to more rows and ranked on them (`findings`).
//! 4. Acceptance: the sign-flip test, blocked cross-validation, and a contribution that matters (`accept`).
//! 5. Look-alikes and their probabilities by resampling blocks (`alternatives`); what a scale that is not named may hide in values
//!    (`omitted`); what is left (`structure`); the verdict.
//! 6. Where something is left, shapes that name no physics are put beside the effects (`beside`; a snake's are chosen together with
//!    effects, `mixture` and `fine_shapes`), and the search is begun anew; which effects stand there (`stand`).
//! 7. Where what is left follows the speed of the motion, the camera's clock is moved and all is begun anew (`clock`).
//!    Where one of several recordings lies beside the first one's, so are its bends (`own_camera`).
//! 8. Where it is asked for, all of it once more without a last part, which the model that comes out predicts (`locked`).
//! 9. Where something remains, what a fit without any law would leave is a hint at how much can be explained (`model_free`).

mod accept;
mod alternatives;
mod answer;
mod at_once;
mod beside;
mod calibration;
mod clock;
mod columns;
mod experiment;
mod families;
mod findings;
mod fine_shapes;
pub(crate) mod floor;
mod force_columns;
mod force_joints;
mod force_rest;
mod gate;
mod json;
mod lists;
mod locked;
mod mixture;
mod model_free;
mod omitted;
mod own_camera;
mod own_third;
mod periodic;
mod recordings;
mod rest;
mod rhythm;
pub mod screen;
pub mod search;
pub mod sign_flip;
mod size;
mod sketch;
mod stand;
pub mod structure;
mod variation;
mod verdict;
mod whole;
mod words;
mod working;

pub(crate) use accept::mean_and_error;
pub(crate) use alternatives::SAME;
pub(crate) use answer::columns_first;
pub use answer::{
    Calibration, CandidateAnswer, Diagnosis, FormulaTerm, FoundEffect, FoundParameter, LoadCell, Remaining, Verdict,
};
pub(crate) use calibration::number_name;
pub(crate) use clock::{Clocks, speeds};
pub use experiment::NextExperiment;
pub(crate) use experiment::{next, separate_joints};
pub(crate) use gate::{cautions, turns};
pub use locked::{LockedError, LockedPart};
pub(crate) use recordings::{FEWEST_RECORDINGS, disagreements};
pub(crate) use rest::{ERRORS, LEAST_SHARE, badness};
pub(crate) use rhythm::rhythm;
pub use size::titled;
pub use sketch::Sketch;
pub(crate) use structure::structure;
pub use structure::{GroupShare, Structure};
pub use variation::{DependsOn, ParameterVariation};
pub(crate) use whole::first_trials;
pub use whole::{DiagnoseOptions, diagnose};
pub use words::capital;
pub(crate) use words::of_what;
pub(crate) use words::{named, stand_and_take, sure};
pub(crate) use working::{sections, working_rows};
