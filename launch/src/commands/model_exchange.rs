//! `krait model exchange FILE`: a chain that runs goes on with another model; the operator must take hold anew.

use crate::cli::Common;
use crate::cli_model::ExchangeArgs;
use crate::in_force::{Compensation, ModelInForce};
use crate::{commands, print};
use anyhow::{Context, bail};
use core::time::Duration;
use krait_ipc::message::{ModelAnswer, ModelRequest};
use krait_ipc::{Bus, ReadOptions, clock};
use serde::Serialize;
use std::process::ExitCode;

/// The name under which this command joins an instance.
pub const NAME: &str = "model";

/// Three processes and a recorder end and begin within this, ns; a recorder may have seconds of samples to write.
const PATIENCE_NS: i64 = 60_000_000_000;
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// What was done, as `--json` prints it.
#[derive(Serialize)]
struct Done {
    model: String,
    hash: String,
    took_s: f64,
}

/// Asks the supervisor, and waits until the stages run with the model.
pub fn run(common: &Common, args: &ExchangeArgs) -> anyhow::Result<ExitCode> {
    let path = std::path::absolute(&args.model)?;
    let model = ModelInForce::load(Some(&path), Compensation::default())?;
    let bus = Bus::open(&common.instance, NAME)?;
    commands::refuse_without(&bus, "launch", "model exchange")?;
    let (hash, asked_ns) = (model.machine.hash(), clock::monotonic_ns());
    let text = path.to_str().context("the model file's path is no text")?;
    let Some(request) = ModelRequest::new(1, asked_ns, hash.0, text) else {
        bail!("the path {text} is too long to be asked for, expected at most 240 bytes; move the file")
    };
    let mut answers = bus.reader::<ModelAnswer>(ReadOptions::observing())?;
    // What a writer says goes with the writer: it stays until the answer is there.
    let mut writer = commands::writer_by::<ModelRequest>(&bus, asked_ns + PATIENCE_NS)?;
    writer.send(&request)?;
    while clock::monotonic_ns() < asked_ns + PATIENCE_NS {
        while let Some(answer) = answers.take()? {
            match answer.refusal() {
                _ if !answer.is_to(&request) => {}
                Some(why) => bail!("the chain goes on with its own model: {why}"),
                None => return told(&path.display().to_string(), &hash.to_string(), asked_ns, args.json),
            }
        }
        std::thread::sleep(LOOK_EVERY);
    }
    bail!(
        "the supervisor did not answer within {} s; only a chain of `krait run` takes another model",
        PATIENCE_NS / 1_000_000_000
    )
}

fn told(model: &str, hash: &str, asked_ns: i64, is_json: bool) -> anyhow::Result<ExitCode> {
    let took_s = (clock::monotonic_ns() - asked_ns) as f64 * 1e-9;
    if is_json {
        print::json(&Done { model: model.to_owned(), hash: hash.to_owned(), took_s })?;
    } else {
        print::out(&format!("The chain runs with {model} (model {hash}); let go and take hold anew to follow.\n"))?;
    }
    Ok(ExitCode::SUCCESS)
}
