//! Tests of the lab, one module a subject. They are one program: to build one for each file took minutes.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod compare;
mod diagnose;
mod experiment;
mod force_columns;
mod force_joints;
mod held_frames;
mod init;
mod init_columns;
mod joint_beside;
mod joint_columns;
mod joint_long;
mod joint_order;
mod joint_starts;
mod joint_verdicts;
mod joints;
mod joints_apart;
mod model_free;
mod noise;
mod offered;
mod read_csv;
mod read_recording;
mod real;
mod recordings;
mod report;
mod report_json;
mod second_log;
mod segments;
mod tip;
mod uneven_joints;
mod verdict;
