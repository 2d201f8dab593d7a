//! Tests of the master, one module a subject. They are one program: to build one for each file took minutes; `end_to_end` and `shipped_recording` are alone: one starts processes, the other takes in the example.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod decode;
mod no_allocation;
mod recording_file;
mod script;
