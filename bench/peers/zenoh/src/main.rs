//! One process of krait bench's relay over Zenoh: source, relay-1, relay-2 or sink. The loops are krait-bench's; here are
//! the ways in and out. Peers on this machine, linked by unix sockets in the folder of the round: no scouting, no network.

use krait_bench::{BenchError, Inlet, ChainKind, Outlet, PATIENCE, Plan, Role, StageOptions, Ways, run_stage_over};
use krait_ipc::WaitMode;
use krait_ipc::clock::monotonic_ns;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

/// A publisher that finds no subscriber by then will not.
const MATCH_PATIENCE: Duration = Duration::from_secs(10);

fn main() -> ExitCode {
    match run(&std::env::args().collect::<Vec<_>>()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("krait-relay-zenoh: {sentence}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<(), String> {
    let role = Role::from_name(option(arguments, "--role")?)?;
    let (folder, prefix) = (PathBuf::from(option(arguments, "--folder")?), option(arguments, "--prefix")?.to_owned());
    let options = StageOptions { kind: ChainKind::Zenoh, role, folder, prefix };
    // What the kernel refuses has been told by `krait bench`, which asked for the same before it became this program.
    let mut tell = |_: &str| {};
    run_stage_over(&options, |plan| open(&options.folder, role, plan), &mut tell).map_err(|error| error.to_string())
}

/// The value after a name; what else `krait bench` gives is in the plan, which lies in the folder.
fn option<'a>(arguments: &'a [String], name: &str) -> Result<&'a str, String> {
    let pair = arguments.windows(2).find(|pair| pair[0] == name);
    pair.map(|pair| pair[1].as_str())
        .ok_or_else(|| format!("{name} is missing: this program is started by `krait bench`"))
}

/// The sink listens, and each process before it links itself to the next one.
fn open(folder: &Path, role: Role, plan: &Plan) -> Result<Ways, BenchError> {
    let session = zenoh::open(config(folder, role)?).wait().map_err(failed("opening a session"))?;
    let way_in = role.hop_in().map(|hop| inlet(&session, hop, plan)).transpose()?;
    let way_out = role.hop_out().map(|hop| outlet(&session, hop)).transpose()?;
    Ok(Ways { way_in, way_out })
}

fn config(folder: &Path, role: Role) -> Result<Config, BenchError> {
    let endpoint = |hop: Option<usize>| match hop {
        Some(hop) => format!("[\"unixsock-stream/{}\"]", folder.join(format!("hop-{hop}.sock")).display()),
        None => "[]".to_owned(),
    };
    let mut config = Config::default();
    for (key, value) in [
        ("mode", "\"peer\""),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("listen/endpoints", &endpoint(role.hop_in())),
        ("connect/endpoints", &endpoint(role.hop_out())),
    ] {
        config.insert_json5(key, value).map_err(failed("configuring the session"))?;
    }
    Ok(config)
}

struct In {
    subscriber: Subscriber<FifoChannelHandler<Sample>>,
    mode: WaitMode,
    _session: Session,
}

struct Out {
    publisher: Publisher<'static>,
    _session: Session,
}

fn inlet(session: &Session, hop: usize, plan: &Plan) -> Result<Box<dyn Inlet>, BenchError> {
    let subscriber = session.declare_subscriber(key(hop)).wait().map_err(failed("subscribing"))?;
    Ok(Box::new(In { subscriber, mode: plan.wait, _session: session.clone() }))
}

/// Express: a message leaves at once instead of waiting for more to share a frame with.
fn outlet(session: &Session, hop: usize) -> Result<Box<dyn Outlet>, BenchError> {
    let publisher = session.declare_publisher(key(hop)).express(true).wait().map_err(failed("publishing"))?;
    let give_up_ns = monotonic_ns() + MATCH_PATIENCE.as_nanos() as i64;
    while !publisher.matching_status().wait().map_err(failed("looking for the subscriber"))?.matching() {
        if monotonic_ns() > give_up_ns {
            return Err(failed("looking for the subscriber")("none was found within 10 s"));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    Ok(Box::new(Out { publisher, _session: session.clone() }))
}

impl Inlet for In {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
        let sample = match self.mode {
            WaitMode::Blocking | WaitMode::Ahead => self.subscriber.recv_timeout(PATIENCE).map_err(failed("receiving"))?,
            WaitMode::Polling => self.poll()?,
        };
        let Some(sample) = sample else { return Ok(false) };
        let bytes = sample.payload().to_bytes();
        if bytes.len() != message.len() {
            return Err(failed("receiving")(format!("{} bytes, expected {}", bytes.len(), message.len())));
        }
        message.copy_from_slice(&bytes);
        Ok(true)
    }
}

impl In {
    fn poll(&self) -> Result<Option<Sample>, BenchError> {
        let give_up_ns = monotonic_ns() + PATIENCE.as_nanos() as i64;
        while monotonic_ns() < give_up_ns {
            if let Some(sample) = self.subscriber.try_recv().map_err(failed("receiving"))? {
                return Ok(Some(sample));
            }
            core::hint::spin_loop();
        }
        Ok(None)
    }
}

impl Outlet for Out {
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
        self.publisher.put(message).wait().map_err(failed("publishing"))
    }
}

/// Nobody else is on these links, so a hop needs no name beyond its number.
fn key(hop: usize) -> String {
    format!("krait/bench/hop-{hop}")
}

fn failed<E: core::fmt::Debug>(doing: &'static str) -> impl FnOnce(E) -> BenchError {
    BenchError::transport("zenoh", doing)
}
