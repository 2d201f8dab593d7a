//! krait-lab-benchmark: data with a hidden effect, and how often the lab finds it.
//!
//! Purpose: the lab is judged from outside. It depends on nothing here, so it cannot know what was hidden.
#![forbid(unsafe_code)]

pub mod benchmark;
pub mod force;
pub mod generate;
pub mod joints;
pub mod segments;
mod truth;

pub use truth::HiddenTruth;
