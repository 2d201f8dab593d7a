//! Tests of the commands that need no chain, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod calibrate;
mod lab_clock;
mod lab_effects;
mod lab_init;
mod lab_joints;
mod lab_quiz;
mod lab_tutorial;
mod model;
mod page;
mod paper;
mod segments;
