//! The command line of the benchmark: `krait bench`, and the processes that it starts.

use clap::{Args, Subcommand, ValueEnum};
use krait_ipc::Cores;
use std::path::PathBuf;

/// Options of `krait bench`.
#[derive(Clone, Debug, Args)]
pub struct BenchArgs {
    /// Samples a second, 100 to 8000.
    #[arg(long, value_name = "HZ", default_value_t = 1000)]
    pub rate: u32,
    /// Measured time per chain over all rounds, s.
    #[arg(long, default_value_t = 10.0)]
    pub seconds: f64,
    /// Rounds; in each every chain has its turn, so that drift of the machine hits all alike.
    #[arg(long, default_value_t = 5)]
    pub rounds: u32,
    /// Bytes in a message of the relays; krait's own messages have their own sizes.
    #[arg(long, value_name = "BYTES", default_value_t = 176)]
    pub payload: usize,
    /// How every process waits for the next message, polling only with a core of its own per process; by default the relays
    /// are blocking, and krait's chain is what the configuration says.
    #[arg(long, value_enum)]
    pub wait: Option<WaitKind>,
    /// Cores for the four processes of every chain, in turn, or `one` or `any`; by default `any` for the relays, and for
    /// krait's chain what the configuration says.
    #[arg(long, value_name = "CORE,...")]
    pub cores: Option<Cores>,
    /// SCHED_FIFO priority of the last of the four processes, 1 to 99, each one before it one less; 0: time sharing.
    #[arg(long, default_value_t = 0)]
    pub priority: u8,
    /// Keep every core busy with other work meanwhile.
    #[arg(long)]
    pub load: bool,
    /// The chains to measure, in this order; by default the eight standard ones.
    #[arg(long, value_delimiter = ',', value_parser = krait_bench::ChainKind::from_name, value_name = "NAME,...")]
    pub chains: Vec<krait_bench::ChainKind>,
    /// Keep the cores of relays and krait's chain from sleeping, as `[realtime] keep_awake = true` does for the chain.
    #[arg(long)]
    pub keep_awake: bool,
    /// Measure instead how the latency of krait's chain grows with the number of chains on this machine (1 to 8), with the
    /// rate (250 to 8000 Hz) and with the readers of every channel (1 to 16).
    #[arg(long, conflicts_with_all = ["chains", "check", "rate", "payload"])]
    pub growth: bool,
    /// Check krait's latency against the multiples of the floor in the budget; exit code 1 if it is not kept.
    #[arg(long)]
    pub check: bool,
    /// Folder for raw samples, figures and picture; by default measurements/DATE.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the figures as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// How a process waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum WaitKind {
    /// Sleep until woken.
    Blocking,
    /// Sleep, but wake once shortly before the next message is due; relays, which cannot, are blocking.
    Ahead,
    /// Look again and again without sleeping.
    Polling,
}

/// Processes that `krait bench` and `krait fault` start.
#[derive(Clone, Debug, Subcommand)]
pub enum YardstickVerb {
    /// One process of a relay.
    Stage(YardstickArgs),
    /// Reads every channel of an instance as a console does.
    Observe,
    /// Keeps a core busy.
    Burn,
    /// Plays one scene of `krait fault`.
    Scene(SceneArgs),
}

/// Options of `krait fault`.
#[derive(Clone, Debug, Args)]
pub struct FaultArgs {
    /// The faults to try.
    #[arg(value_enum, value_name = "NAME", required_unless_present = "all", conflicts_with = "all")]
    pub faults: Vec<crate::fault::Fault>,
    /// Try every fault.
    #[arg(long)]
    pub all: bool,
    /// How often each is tried, from the second time on at a random moment and, where it is a stall, for a random time.
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub repeat: u64,
    /// Print the outcomes as JSON on standard output.
    #[arg(long)]
    pub json: bool,
}

/// Options of one scene of `krait fault`.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// How long it waits before it strikes, s.
    #[arg(long, default_value_t = 0.0)]
    pub wait_s: f64,
    /// How long a process is stopped, s.
    #[arg(long, default_value_t = 0.3)]
    pub stall_s: f64,
    /// The fault.
    #[arg(long, value_enum)]
    pub fault: crate::fault::Fault,
    /// Where its files are.
    #[arg(long)]
    pub folder: PathBuf,
}

/// Options of one process of a relay.
#[derive(Clone, Debug, Args)]
pub struct YardstickArgs {
    /// What messages travel over.
    #[arg(long, value_parser = krait_bench::ChainKind::from_name)]
    pub chain: krait_bench::ChainKind,
    /// Which of the four.
    #[arg(long, value_parser = krait_bench::Role::from_name)]
    pub role: krait_bench::Role,
    /// Folder of the round.
    #[arg(long)]
    pub folder: PathBuf,
    /// How the round's files in /dev/shm begin.
    #[arg(long)]
    pub prefix: String,
}
