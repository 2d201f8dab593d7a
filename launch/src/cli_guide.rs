//! Options of how a guide leads a machine and waits at its stops: the same for experiments and calibrations.

use anyhow::ensure;
use clap::Args;
use krait_master::GuidePlan;

/// How fast, and how long at rest.
#[derive(Clone, Debug, Args)]
pub struct GuideArgs {
    /// How fast the snake bends between poses, deg/s, at small bends.
    #[arg(long, value_name = "DEG", default_value_t = 30.0)]
    pub speed_deg_per_s: f64,
    /// For so long the actuators must rest before a pose is measured, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.3)]
    pub settle_s: f64,
    /// So long each pose is measured, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.5)]
    pub measure_s: f64,
    /// Actuators that stay within so much count as at rest, micrometres.
    #[arg(long, value_name = "UM", default_value_t = 5.0)]
    pub rest_um: f64,
    /// How long a pose may take beyond its way, to arrive and to come to rest, s.
    #[arg(long, value_name = "SECONDS", default_value_t = 15.0)]
    pub patience_s: f64,
}

impl GuideArgs {
    /// A plan without a leg, for a snake of a length, seen by a camera rolled so much.
    ///
    /// # Errors
    /// One sentence: an option that is out of its range.
    pub fn plan(&self, l_m: f64, view_roll_rad: f64) -> anyhow::Result<GuidePlan> {
        ensure!(
            (1.0..=100.0).contains(&self.speed_deg_per_s),
            "--speed-deg-per-s {}: expected 1 to 100",
            self.speed_deg_per_s
        );
        for (option, value, most) in [
            ("--settle-s", self.settle_s, 60.0),
            ("--measure-s", self.measure_s, 600.0),
            ("--patience-s", self.patience_s, 600.0),
            ("--rest-um", self.rest_um, 1000.0),
        ] {
            ensure!((0.05..=most).contains(&value), "{option} {value}: expected 0.05 to {most}");
        }
        Ok(GuidePlan {
            view_roll_rad,
            // At small bends the tip moves by half of the length for one radian.
            speed_m_per_s: self.speed_deg_per_s.to_radians() * 0.5 * l_m,
            rest_m: self.rest_um * 1e-6,
            settle_s: self.settle_s,
            measure_s: self.measure_s,
            patience_s: self.patience_s,
            awaits_orders: false,
            leg: Vec::new(),
        })
    }
}
