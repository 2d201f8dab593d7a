//! Tests of the slave, one module a subject. They are one program: to build one for each file took minutes; `process` is alone, because it starts processes.

#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod core;
mod gripper;
mod no_allocation;
mod relaxing;
