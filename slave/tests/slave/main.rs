//! Tests of the slave, one module a subject. They are one program: to build one for each file took minutes; `process` is alone, because it starts processes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod core;
mod gripper;
mod no_allocation;
mod relaxing;
