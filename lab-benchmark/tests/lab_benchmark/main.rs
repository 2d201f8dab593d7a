//! Tests of the generator and the benchmark, and what the lab answers on their data, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod benchmark;
mod beside;
mod camera_clock;
mod force;
mod generate;
mod joints;
mod loads;
mod locked;
mod segment_loads;
mod segments;
mod segments_quiz;
mod snake_lists;
