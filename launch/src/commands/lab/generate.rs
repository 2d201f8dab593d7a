//! `krait lab generate`: data with a hidden effect, and the answer sealed in a file of its own.

use crate::cli_lab_data::GenerateArgs;
use crate::commands::overwrite::{refuse_existing, refuse_same, write_whole};
use crate::print;
use anyhow::{Context, bail};
use krait_ipc::{clock, input};
use krait_lab_benchmark::generate::{Generated, Kind, Recipe, Sealed, base_model, generate, pick};
use krait_lab_benchmark::segments::{SegmentKind, SegmentsRecipe, pick_segments, segments};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::ExitCode;

/// Makes and writes the data.
pub fn run(args: &GenerateArgs) -> anyhow::Result<ExitCode> {
    if args.list {
        print::out(&list(args.segments))?;
        return Ok(ExitCode::SUCCESS);
    }
    let Some(out) = &args.out else { bail!("--out is missing: name the file to write the data to") };
    let seed = args.seed.unwrap_or(clock::wall_ns() as u64);
    if let Some(n) = args.segments {
        return of_segments(args, out, usize::from(n), seed);
    }
    refuse_existing_data(out, [args.answer.as_deref(), args.truth.as_deref()], &base_model(), args.force)?;
    let picked = || pick(seed, false);
    let recipe = Recipe {
        hidden: hidden(args, picked, Kind::from_name, &Kind::all().map(|kind| kind.name).collect::<Vec<_>>())?,
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
    write(args, out, generate(&recipe)?)
}

/// The same of segments in series.
fn of_segments(args: &GenerateArgs, out: &Path, n_segments: usize, seed: u64) -> anyhow::Result<ExitCode> {
    let all = SegmentKind::all(n_segments);
    let names: Vec<String> = all.iter().map(SegmentKind::name).collect();
    let picked = || pick_segments(seed, n_segments, 1);
    let find = |name: &str| SegmentKind::from_name(name, n_segments);
    let recipe = SegmentsRecipe {
        n_segments,
        hidden: hidden(args, picked, find, &names.iter().map(String::as_str).collect::<Vec<_>>())?,
        motion: args.trajectory,
        noise: args.noise,
        sigma_rad: args.sigma_deg.to_radians(),
        load_sigma_n: args.load_sigma_n,
        seconds: args.seconds,
        rate_hz: args.rate,
        every: usize::from(args.every),
        seed,
    };
    let is_beside = |(kind, _): &&(SegmentKind, f64)| !kind.is_of_machine();
    if let Some((kind, _)) = recipe.hidden.iter().find(is_beside).filter(|_| args.truth.is_some()) {
        bail!(
            "--truth: a truth file of segments cannot say {:?}, which is of the picture alone; leave --truth out",
            kind.name()
        );
    }
    refuse_existing_data(out, [args.answer.as_deref(), args.truth.as_deref()], &recipe.model()?, args.force)?;
    write(args, out, segments(&recipe)?)
}

/// Writes data, model, answer and, if wanted, truth.
fn write<T: Serialize>(args: &GenerateArgs, out: &Path, made: Generated<T>) -> anyhow::Result<ExitCode> {
    let n_rows = made.measurements.n_rows();
    if let Some(truth) = &args.truth {
        let text = toml::to_string(&made.truth).context("the plant has no form in TOML")?;
        write_whole(truth, text).with_context(|| format!("{} could not be written", truth.display()))?;
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

/// Refuses to go on where generated data would overwrite something; the other files are the answer and the truth.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_existing_data(out: &Path, others: [Option<&Path>; 2], model: &str, force: bool) -> anyhow::Result<()> {
    let base = out.with_file_name("base.toml");
    let named =
        [("--out", Some(out)), ("the base model", Some(&*base)), ("--answer", others[0]), ("--truth", others[1])];
    let named: Vec<(&str, &Path)> = named.into_iter().filter_map(|(name, path)| Some((name, path?))).collect();
    refuse_same(&named)?;
    for (file, own) in others.into_iter().zip(["json", "toml"]).chain([(Some(out), "csv")]) {
        file.map_or(Ok(()), |file| refuse_existing(file, own, force))?;
    }
    // A base model of an earlier set of data is the same; any other is somebody's work.
    if base.exists() && !input::text(&base, input::CONFIG_BYTES).is_ok_and(|text| text == model) {
        refuse_existing(&base, "toml", force)?;
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

/// What is hidden, with its sizes: what is named, or what the seed picks.
fn hidden<K>(
    args: &GenerateArgs,
    picked: impl FnOnce() -> Vec<K>,
    find: impl Fn(&str) -> Option<K>,
    names: &[&str],
) -> anyhow::Result<Vec<(K, f64)>> {
    let named: Vec<&str> = match args.kind.as_deref() {
        None | Some("none") => Vec::new(),
        Some(kinds) => kinds.split('+').collect(),
    };
    if named.iter().collect::<BTreeSet<_>>().len() != named.len() {
        bail!("--kind names a kind twice; name each once");
    }
    let found = |name: &&str| {
        find(name).with_context(|| {
            let nearest = krait_model::nearest_name(name, names.iter().copied()).unwrap_or_default();
            format!(
                "--kind {name:?} is not one of those that can be hidden; did you mean {nearest}? (--list shows all)"
            )
        })
    };
    let kinds = match args.kind {
        None => picked(),
        Some(_) => named.iter().map(found).collect::<anyhow::Result<Vec<_>>>()?,
    };
    let size = |k: usize| if args.size.len() == 1 { args.size.first() } else { args.size.get(k) };
    if args.size.len() > 1 && args.size.len() != kinds.len() {
        bail!("--size has {} values, expected one for all or {}, one for each kind", args.size.len(), kinds.len());
    }
    Ok(kinds.into_iter().enumerate().filter_map(|(k, kind)| Some((kind, *size(k)?))).collect())
}

fn list(segments: Option<u8>) -> String {
    let kinds: Vec<(String, &str, String)> = match segments {
        None => Kind::all().map(|kind| (kind.name.to_owned(), kind.about, kind.right.join(", "))).collect(),
        Some(n) => {
            let all = SegmentKind::all(usize::from(n));
            all.iter().map(|kind| (kind.name(), kind.about(), kind.right().join(", "))).collect()
        }
    };
    let width = kinds.iter().map(|(name, ..)| name.len()).max().unwrap_or(0);
    let line = |(name, about, right): &(String, &str, String)| format!("  {name:width$}  {about} ({right})\n");
    format!("What can be hidden, and the effects that count as right:\n{}", kinds.iter().map(line).collect::<String>())
}
