//! One file per subcommand.

pub mod config;
pub mod demo;
pub mod devices;
pub mod paper;
pub mod process;
pub mod run;
pub mod verify;
