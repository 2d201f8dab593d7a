//! krait-report: the figures of a recording or of a running chain, and how they are shown.
//!
//! Purpose: every command and page that states a figure takes it from here, so that the same file gives the same number.
//!
//! Terms: a *pass* is one run of a chain within a recording; a *spread* is root mean square, 95th percentile and largest
//! value; a *hop* goes from the moment that one stage has published to the moment that the next has.
//!
//! Frames and units: see `docs/NOTATION.md`. Angles are degrees here, latencies microseconds, and every name says so.
#![forbid(unsafe_code)]

mod compare;
mod figure;
mod joint_tracking;
mod latency;
mod pass_report;
mod plot;
mod spread;
mod surface;
mod table;
mod tracking;

pub use compare::{Apart, Mark, Series, Side, SideError};
pub use figure::{Curve, Figure, Sheet, Stroke, Surface};
pub use joint_tracking::{JointFigure, JointScore, Lanes, Tracked, joint_unit};
pub use krait_bench::Quantiles;
pub use latency::{HopReport, LatencyLog, LatencyReport};
pub use pass_report::{ChangeReport, LearntReport, PassLog, PassReport, PeakBend};
pub use plot::{PlotError, svg};
pub use spread::Spread;
pub use surface::surface_svg;
pub use table::Table;
pub use tracking::{SCORED_FROM_S, TOO_SHORT, Tracking, TrackingScore};
