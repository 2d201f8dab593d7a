//! Options of which machine moves and who measures it: the same for every command that runs a chain of its own.

use crate::cli::{ShapeKind, SlaveKind};
use crate::config::Config;
use anyhow::ensure;
use clap::Args;
use krait_slave::{DriveKind, ShapeSource};
use std::path::{Path, PathBuf, absolute};

/// Which machine, and who measures it.
#[derive(Clone, Debug, Args)]
pub struct MachineArgs {
    /// The drives; by default those of the configuration's table `[slave.drive]`, which are simulated without one.
    #[arg(long, value_enum)]
    slave: Option<SlaveKind>,
    /// Truth of the simulated snake (TOML).
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Who measures the shape: the drive's own camera, or another program through `krait shape`.
    #[arg(long, value_enum, value_name = "WHO")]
    shape: Option<ShapeKind>,
}

impl MachineArgs {
    /// The truth that is named, if any.
    pub fn truth(&self) -> Option<&Path> {
        self.truth.as_deref()
    }

    /// Whether drives or whoever measures are named, which takes a chain.
    pub fn names_a_chain(&self) -> bool {
        self.slave.is_some() || self.shape.is_some()
    }

    /// Puts them in place of what the configuration says. Returns whether the drives are real.
    ///
    /// # Errors
    /// One sentence: a truth for real drives.
    pub fn apply(&self, config: &mut Config) -> anyhow::Result<bool> {
        if let Some(slave) = self.slave {
            config.slave.drive.kind = slave.kind();
        }
        let is_real = config.slave.drive.kind != DriveKind::Sim;
        if let Some(truth) = &self.truth {
            ensure!(!is_real, "--truth is for simulated drives, and these are real; leave it out");
            config.slave.truth = Some(absolute(truth)?);
        }
        config.slave.shape = match self.shape {
            Some(ShapeKind::Camera) => ShapeSource::Camera,
            Some(ShapeKind::External) => ShapeSource::External,
            None => config.slave.shape,
        };
        Ok(is_real)
    }
}
