//! `krait lab generate`: data with a hidden effect, and the answer sealed in a file of its own.

use crate::cli_lab_data::GenerateArgs;
use crate::commands::overwrite::refuse_existing;
use crate::print;
use anyhow::{Context, bail};
use krait_ipc::{clock, input};
use krait_lab_benchmark::generate::{Kind, Recipe, Sealed, base_model, generate, pick};
use serde_json::json;
use std::path::Path;
use std::process::ExitCode;

/// Makes and writes the data.
pub fn run(args: &GenerateArgs) -> anyhow::Result<ExitCode> {
    if args.list {
        print::out(&list())?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(out) = &args.out else { bail!("--out is missing: name the file to write the data to") };
    refuse_existing_data(out, [args.answer.as_deref(), args.truth.as_deref()], args.force)?;
    let seed = args.seed.unwrap_or(clock::wall_ns() as u64);
    let recipe = Recipe {
        hidden: hidden(args, seed)?,
        motion: args.trajectory,
        noise: args.noise,
        sigma_rad: args.sigma_deg.to_radians(),
        load_sigma_n: args.load_sigma_n,
        seconds: args.seconds,
        rate_hz: args.rate,
        every: usize::from(args.every),
        seed,
        perturbation: args.perturb,
    };
    let made = generate(&recipe)?;
    let n_rows = made.measurements.n_rows();
    if let Some(truth) = &args.truth {
        let text = toml::to_string(&made.truth).context("the plant has no form in TOML")?;
        std::fs::write(truth, text).with_context(|| format!("{} could not be written", truth.display()))?;
    }
    let sealed = made.seal(out, args.answer.as_deref())?;
    if args.json {
        print::json(&json!({
            "data": sealed.data, "model": sealed.model, "answer": sealed.answer, "hashes": sealed.hashes,
            "answer_sha256": sealed.answer_sha256, "data_sha256": sealed.data_sha256, "rows": n_rows,
        }))?;
    } else {
        print::out(&text(&sealed, n_rows))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses to go on where generated data would overwrite something.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_existing_data(out: &Path, others: [Option<&Path>; 2], force: bool) -> anyhow::Result<()> {
    for file in others.into_iter().flatten().chain([out]) {
        refuse_existing(file, force)?;
    }
    // A base model of an earlier set of data is the same; any other is somebody's work.
    let base = out.with_file_name("base.toml");
    if base.exists() && !input::text(&base, input::CONFIG_BYTES).is_ok_and(|text| text == base_model()) {
        refuse_existing(&base, force)?;
    }
    Ok(())
}

fn text(sealed: &Sealed, n_rows: usize) -> String {
    format!(
        "{n_rows} rows in {data}; base model in {model}\nAnswer in {answer}, SHA-256 {hash} (also in {hashes})\n\
         Next: krait lab diagnose --model {model} --data {data}\n",
        data = sealed.data.display(),
        model = sealed.model.display(),
        answer = sealed.answer.display(),
        hash = sealed.answer_sha256,
        hashes = sealed.hashes.display(),
    )
}

/// What is hidden, with its sizes.
fn hidden(args: &GenerateArgs, seed: u64) -> anyhow::Result<Vec<(&'static Kind, f64)>> {
    let kinds = match args.kind.as_deref() {
        None => pick(seed, false),
        Some("none") => Vec::new(),
        Some(names) => names.split('+').map(kind).collect::<anyhow::Result<Vec<_>>>()?,
    };
    let size = |k: usize| if args.size.len() == 1 { args.size.first() } else { args.size.get(k) };
    if args.size.len() > 1 && args.size.len() != kinds.len() {
        bail!("--size has {} values, expected one for all or {}, one for each kind", args.size.len(), kinds.len());
    }
    let names: std::collections::BTreeSet<&str> = kinds.iter().map(|kind| kind.name).collect();
    if names.len() != kinds.len() {
        bail!("--kind names a kind twice; name each once");
    }
    Ok(kinds.into_iter().enumerate().filter_map(|(k, kind)| Some((kind, *size(k)?))).collect())
}

fn kind(name: &str) -> anyhow::Result<&'static Kind> {
    if let Some(kind) = Kind::from_name(name) {
        return Ok(kind);
    }
    let nearest = krait_model::nearest_name(name, Kind::all().map(|kind| kind.name)).unwrap_or_default();
    bail!("--kind {name:?} is not one of those that can be hidden; did you mean {nearest}? (--list shows all)")
}

fn list() -> String {
    let width = Kind::all().map(|kind| kind.name.len()).max().unwrap_or(0);
    let line = |kind: &Kind| format!("  {:width$}  {} ({})\n", kind.name, kind.about, kind.right.join(", "));
    format!("What can be hidden, and the effects that count as right:\n{}", Kind::all().map(line).collect::<String>())
}
