//! One file per subcommand.

pub mod config;
pub mod demo;
pub mod devices;
pub mod model;
pub mod paper;
pub mod process;
pub mod run;
pub mod verify;
