//! Latency budgets: what a sample may take, per hop and end to end, in microseconds and as multiples of the machine's floor.
//!
//! The microseconds are watched while a chain runs; the multiples are checked by `krait bench`, which measures the floor.

use krait_bench::RatioLimits;
use krait_ipc::LatencyLimits;
use krait_ipc::message::{HopStamps, N_HOPS, SlaveState};
use krait_ipc::setting::{self, SettingError};
use krait_report::{LatencyLog, Quantiles};
use serde::{Deserialize, Serialize};

/// Longest latency that a budget can name, us (10 s).
const LONGEST_US: f64 = 10e6;
/// Largest multiple of the floor that a budget can name.
const MOST_FLOORS: f64 = 1e6;
/// Smallest of both: a budget of nothing is kept by nobody.
const LEAST: f64 = 1e-3;

/// What a stretch of the way may take. A table that is given has all six keys.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Allowance {
    /// Median, us.
    pub p50_us: f64,
    /// 99th percentile, us.
    pub p99_us: f64,
    /// Every single sample, us; one beyond it is counted as late while the chain runs.
    pub worst_us: f64,
    /// Median, in medians of the floor.
    pub p50_floors: f64,
    /// 99th percentile, in 99th percentiles of the floor.
    pub p99_floors: f64,
    /// Largest, in largest of the floor.
    pub worst_floors: f64,
}

/// The budget of a chain. The defaults hold on two shared cores under load: they are there to find what is broken, not to
/// praise a quiet machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Budget {
    /// From the report in hand to the drive written.
    pub end_to_end: Allowance,
    /// The master's own work.
    pub device_to_master: Allowance,
    /// Wake-up, transport and work of `resolve`.
    pub master_to_resolve: Allowance,
    /// Wake-up, transport and work of `compensate`.
    pub resolve_to_compensate: Allowance,
    /// Wake-up, transport and work of `slave`, to the end of the drive's write.
    pub compensate_to_slave: Allowance,
}

impl Default for Budget {
    /// The slave holds a motion whose commands are 50 ms old: a sample may take half of that at worst.
    fn default() -> Self {
        let hop = Allowance {
            p50_us: 150.0,
            p99_us: 3_000.0,
            worst_us: 20_000.0,
            p50_floors: 4.0,
            p99_floors: 10.0,
            worst_floors: 100.0,
        };
        Self {
            end_to_end: Allowance {
                p50_us: 300.0,
                p99_us: 5_000.0,
                worst_us: 25_000.0,
                p50_floors: 2.0,
                p99_floors: 5.0,
                worst_floors: 50.0,
            },
            device_to_master: hop,
            master_to_resolve: hop,
            resolve_to_compensate: hop,
            compensate_to_slave: hop,
        }
    }
}

impl Allowance {
    /// The limits as multiples of the floor.
    pub fn floors(&self) -> RatioLimits {
        RatioLimits { p50: self.p50_floors, p99: self.p99_floors, worst: self.worst_floors }
    }

    fn check(&self, table: &'static str, default: &Self) -> Result<(), SettingError> {
        let checks = [
            ("p50_us", self.p50_us, LONGEST_US, default.p50_us),
            ("p99_us", self.p99_us, LONGEST_US, default.p99_us),
            ("worst_us", self.worst_us, LONGEST_US, default.worst_us),
            ("p50_floors", self.p50_floors, MOST_FLOORS, default.p50_floors),
            ("p99_floors", self.p99_floors, MOST_FLOORS, default.p99_floors),
            ("worst_floors", self.worst_floors, MOST_FLOORS, default.worst_floors),
        ];
        checks
            .into_iter()
            .try_for_each(|(key, found, most, default)| setting::check((table, key), found, (LEAST, most), default))
    }
}

impl Budget {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] names the first value out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        let default = Self::default();
        self.end_to_end.check("budget.end_to_end", &default.end_to_end)?;
        let tables = [
            "budget.device_to_master",
            "budget.master_to_resolve",
            "budget.resolve_to_compensate",
            "budget.compensate_to_slave",
        ];
        let hops = self.hops().into_iter().zip(default.hops()).zip(tables);
        hops.into_iter().try_for_each(|((hop, default), table)| hop.check(table, &default))
    }

    /// The allowances of [`HopStamps::HOPS`].
    pub fn hops(&self) -> [Allowance; N_HOPS] {
        [self.device_to_master, self.master_to_resolve, self.resolve_to_compensate, self.compensate_to_slave]
    }

    /// What the slave counts as late.
    pub fn latency_limits(&self) -> LatencyLimits {
        let ns = |allowance: Allowance| (allowance.worst_us * 1e3) as i64;
        LatencyLimits { end_to_end_ns: ns(self.end_to_end), hops_ns: self.hops().map(ns) }
    }
}

/// Watches a running chain: histograms of every hop, and how many samples were late.
pub struct BudgetWatch {
    budget: Budget,
    log: LatencyLog,
    n_late: u64,
    n_late_hops: [u64; N_HOPS],
}

impl BudgetWatch {
    /// Watches nothing yet.
    ///
    /// # Errors
    /// As [`LatencyLog::new`].
    pub fn new(budget: Budget) -> anyhow::Result<Self> {
        Ok(Self { budget, log: LatencyLog::new()?, n_late: 0, n_late_hops: [0; N_HOPS] })
    }

    /// Takes a slave state; each command counts once.
    pub fn state(&mut self, state: &SlaveState) {
        if !self.log.state(state) {
            return;
        }
        let limits = self.budget.latency_limits();
        self.n_late += u64::from(state.stamps.end_to_end_ns() > limits.end_to_end_ns);
        for (hop, n_late) in self.n_late_hops.iter_mut().enumerate() {
            *n_late += u64::from(state.stamps.hop_ns(hop) > limits.hops_ns[hop]);
        }
    }

    /// Samples that were late end to end so far.
    pub fn n_late(&self) -> u64 {
        self.n_late
    }

    /// What has been seen so far, beside what is allowed.
    pub fn report(&self) -> BudgetReport {
        let found = self.log.report();
        let end_to_end = Kept::new("device", "slave", found.end_to_end, &self.budget.end_to_end, self.n_late);
        let hops = found.hops.iter().zip(self.budget.hops()).zip(self.n_late_hops);
        let hops: Vec<Kept> =
            hops.map(|((hop, allowed), n_late)| Kept::new(hop.from, hop.to, hop.quantiles, &allowed, n_late)).collect();
        // What nobody has measured was not kept.
        let is_kept = self.log.n_samples() > 0 && end_to_end.is_kept && hops.iter().all(|hop| hop.is_kept);
        BudgetReport { is_kept, n_samples: self.log.n_samples(), end_to_end, hops }
    }
}

/// Whether a chain kept its budget.
#[derive(Clone, Debug, Serialize)]
pub struct BudgetReport {
    /// Whether every limit was kept.
    pub is_kept: bool,
    /// Samples that were watched.
    pub n_samples: u64,
    /// From the report in hand to the drive written.
    pub end_to_end: Kept,
    /// Each hop.
    pub hops: Vec<Kept>,
}

/// One stretch of the way: what was found, what is allowed, microseconds.
#[derive(Clone, Debug, Serialize)]
pub struct Kept {
    /// Where the sample left.
    pub from: &'static str,
    /// Where it arrived.
    pub to: &'static str,
    /// Whether all three limits were kept.
    pub is_kept: bool,
    /// Found.
    pub found: Quantiles,
    /// Allowed: median.
    pub p50_us: f64,
    /// Allowed: 99th percentile.
    pub p99_us: f64,
    /// Allowed: every single sample.
    pub worst_us: f64,
    /// Samples beyond the last.
    pub n_late: u64,
}

impl Kept {
    fn new(from: &'static str, to: &'static str, found: Quantiles, allowed: &Allowance, n_late: u64) -> Self {
        let is_kept = n_late == 0 && found.p50 <= allowed.p50_us && found.p99 <= allowed.p99_us;
        let Allowance { p50_us, p99_us, worst_us, .. } = *allowed;
        Self { from, to, is_kept, found, p50_us, p99_us, worst_us, n_late }
    }
}

impl BudgetReport {
    /// One line per limit that was broken, or one line that all were kept.
    pub fn text(&self) -> String {
        if self.is_kept {
            return format!("Budget: kept by all {} samples\n", self.n_samples);
        }
        if self.n_samples == 0 {
            return "Budget: not measured, since nothing moved; engage the chain\n".to_owned();
        }
        let mut text = String::from("Budget: not kept\n");
        for way in core::iter::once(&self.end_to_end).chain(&self.hops).filter(|way| !way.is_kept) {
            text += &format!(
                "  {} -> {}: p50 {:.0} us ({:.0} allowed), p99 {:.0} us ({:.0}), {} of {} samples beyond {:.0} us\n",
                way.from,
                way.to,
                way.found.p50,
                way.p50_us,
                way.found.p99,
                way.p99_us,
                way.n_late,
                self.n_samples,
                way.worst_us
            );
        }
        text
    }
}

const _: () = assert!(HopStamps::HOPS.len() == N_HOPS);

#[cfg(test)]
mod tests {
    use super::*;

    fn state(command_sequence: u64, end_to_end_us: i64) -> SlaveState {
        let stamps = HopStamps {
            device_ns: 1000,
            input_sent_ns: 2000,
            setpoint_sent_ns: 3000,
            command_sent_ns: 4000,
            drive_written_ns: 1000 + end_to_end_us * 1000,
            ..HopStamps::default()
        };
        SlaveState {
            sequence: command_sequence,
            sample_ns: 0,
            stamps,
            command_sequence,
            operating_state: 1,
            flags: 7,
            setpoint_q_m: [0.0; 12],
            setpoint_bend_rad: [0.0; 2],
            setpoint_joints_rad: [0.0; 8],
            n_actuators: 3,
            n_joints: 0,
            measured_q_m: [0.0; 12],
            measured_tau_n: [0.0; 12],
            reasons: 0,
            n_commands: 0,
            n_refused: 0,
            ..SlaveState::default()
        }
    }

    #[test]
    fn one_late_sample_breaks_the_budget_and_is_counted_where_it_was_late() {
        let mut watch = BudgetWatch::new(Budget::default()).expect("histograms");
        for sequence in 1..=100 {
            watch.state(&state(sequence, 100));
        }
        assert!(watch.report().is_kept, "{}", watch.report().text());
        watch.state(&state(101, 30_000));
        watch.state(&state(101, 30_000));
        let report = watch.report();
        assert_eq!((report.is_kept, report.end_to_end.n_late, report.n_samples), (false, 1, 101));
        assert_eq!(report.hops.iter().map(|hop| hop.n_late).collect::<Vec<_>>(), [0, 0, 0, 1]);
        assert!(report.text().contains("compensate -> slave"), "{}", report.text());
    }

    #[test]
    fn a_slow_median_breaks_the_budget_though_no_sample_was_late() {
        let mut watch = BudgetWatch::new(Budget::default()).expect("histograms");
        for sequence in 1..=100 {
            watch.state(&state(sequence, 400));
        }
        let report = watch.report();
        assert_eq!((report.is_kept, report.end_to_end.n_late), (false, 0));
    }

    #[test]
    fn values_out_of_range_are_named_with_their_table() {
        let mut budget = Budget::default();
        budget.master_to_resolve.p99_us = -1.0;
        let error = budget.check().expect_err("negative").to_string();
        assert!(error.contains("[budget.master_to_resolve] p99_us = -1"), "{error}");
        budget = Budget::default();
        budget.end_to_end.worst_floors = f64::NAN;
        assert!(budget.check().is_err() && Budget::default().check().is_ok());
    }
}
