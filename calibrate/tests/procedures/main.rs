//! Tests of the calibration procedures, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod common;
mod friction;
mod golden;
mod photo;
mod pictures;
mod play;
mod poses;
mod stem;
