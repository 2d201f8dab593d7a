//! Tests of the cores of the bridge, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod allocation;
#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod common;
mod compensate;
mod gripper;
mod joints;
mod learning;
mod let_go;
mod resolve;
mod segment_cores;
mod segment_learning;
mod segment_watch;
mod warm_up;
