//! Tests of recordings, one module a subject. They are one program: to build one for each file took minutes; what counts memory or kills processes is alone.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "../common/mod.rs"]
mod common;
mod end_to_end;
mod files;
mod recover;
mod round_trip;
mod viewers;
