//! One file per subcommand.

pub mod bench;
mod bench_growth;
pub mod compare;
pub mod config;
pub mod demo;
pub mod devices;
pub mod doctor;
pub mod export;
pub mod lab;
pub mod mark;
pub mod model;
pub mod paper;
pub mod process;
pub mod recover;
pub mod replay;
pub mod run;
pub mod verify;
pub mod yardstick;
