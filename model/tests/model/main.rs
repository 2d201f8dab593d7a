//! Tests of the model, one module a subject. They are one program: to build one for each file took minutes; `instruction_count` is alone, because it runs itself under a counter.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod actuator_loads;
#[path = "../../../tests/support/allocations.rs"]
mod allocations;
mod alpha;
mod built_in;
mod chain_allocation;
mod chain_memory;
mod chain_properties;
mod chain_round_trip;
mod chain_tangents;
mod chains;
mod change;
mod common;
mod compensation;
mod continuity;
mod distributed_capstan;
mod dual;
mod equilibrium;
mod estimation;
mod golden_numbers;
mod gripper;
mod inside_extension;
mod joint_inverse;
mod joints;
mod loads;
mod model_files;
mod plausible;
mod properties;
mod segment_files;
mod segment_tangents;
mod segments;
mod segments_golden;
