//! Tests of the simulated machines, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod hidden;
mod plant;
mod segments;
