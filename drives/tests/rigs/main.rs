//! Tests of the drives on emulated buses, one module a subject. They are one program: to build one for each file took minutes; `timing` is alone, because a neighbour would disturb it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod can_drive;
mod can_no_allocation;
mod can_rig;
mod cycles;
mod disable_relax;
mod drive;
mod ends;
mod guards;
mod no_allocation;
mod open;
mod relax;
#[path = "../rig/mod.rs"]
mod rig;
mod serial_no_allocation;
mod wire;
mod xl330;
