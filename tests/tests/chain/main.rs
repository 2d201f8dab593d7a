//! The whole chain as real processes, scene by scene, where no time of its own is measured: one program, so that two scenes, which wait for
//! most of their time, run beside each other.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod calibrate_chain;
mod change;
mod exchange;
mod experiment;
mod no_jump;
mod orders;
mod pose_hand;
mod priority;
mod recording;
mod relaxing;
mod replay_orders;
mod restart;
mod shape;
mod two_chains;
