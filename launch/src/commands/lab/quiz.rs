//! `krait lab quiz` and `krait lab check`: a hidden effect, a learner's guess, the answer.

use super::generate::refuse_existing_data;
use crate::cli_lab_data::{CheckArgs, QuizArgs};
use crate::print;
use anyhow::{Context, bail, ensure};
use krait_ipc::{clock, input};
use krait_lab_benchmark::generate::{Answer, Judgement, Quiz, Recipe, Sealed, base_model, generate, is_unmodified};
use krait_lab_benchmark::segments::SegmentsQuiz;
use krait_model::effects::{EffectKind, Explanation, SegmentEffect, explanation};
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;

/// Largest file of a quiz, bytes; one of 200 s has 1 MB.
const MAX_BYTES: u64 = 64 * 1024 * 1024;

/// Makes the data of a riddle and says how to solve it.
pub fn ask(args: &QuizArgs) -> anyhow::Result<ExitCode> {
    let seed = args.seed.unwrap_or(clock::wall_ns() as u64);
    let may_write = |model: &str| refuse_existing_data(&args.out, [args.answer.as_deref(), None], model, args.force);
    let (machine, choices, sealed) = match args.segments {
        None => {
            may_write(&base_model())?;
            let riddle = Quiz::new(seed, args.level);
            let recipe = Recipe { hidden: vec![(riddle.kind, riddle.size)], seed, ..Recipe::default() };
            let choices: Vec<String> = riddle.choices.iter().copied().map(str::to_owned).collect();
            ("snake", choices, generate(&recipe)?.seal(&args.out, args.answer.as_deref())?)
        }
        Some(n) => {
            let riddle = SegmentsQuiz::new(seed, usize::from(n), args.level);
            may_write(&riddle.recipe().model()?)?;
            let sealed = riddle.generate()?.seal(&args.out, args.answer.as_deref())?;
            ("robot of segments", riddle.choices, sealed)
        }
    };
    if args.json {
        print::json(&json!({
            "data": sealed.data, "model": sealed.model, "answer": sealed.answer, "hashes": sealed.hashes,
            "choices": choices, "explanations": choices.iter().map(|name| explanation(name)).collect::<Vec<_>>(),
        }))?;
    } else {
        print::out(&question(machine, &choices, &sealed))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn question(machine: &str, choices: &[String], sealed: &Sealed) -> String {
    let (model, data) = (sealed.model.display(), sealed.data.display());
    let mut text = format!("The model in {model} lacks one effect, which the {machine} in {data} has. Which one?\n\n");
    for name in choices {
        text += &in_words(name);
    }
    text + &format!(
        "\nLook:  krait lab compare --model {model} --data {data} --report look.html\n\
         Guess: krait lab check --data {data} --guess NAME\n"
    )
}

/// Judges a guess; a wrong one is exit code 1.
pub fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let answer = opened(&args.data, args.answer.as_deref())?;
    let guess: Vec<&str> =
        args.guess.as_deref().map_or_else(Vec::new, |guess| guess.split('+').map(str::trim).collect());
    for name in &guess {
        ensure_known(name)?;
    }
    let judgement = args.guess.as_ref().map(|_| answer.judge(&guess));
    let is_told = args.give_up || judgement.is_some_and(|own| own != Judgement::Wrong);
    let word = judgement.map(|own| match own {
        Judgement::Right => "right",
        Judgement::LookAlike => "look-alike",
        Judgement::Wrong => "wrong",
    });
    if args.json {
        print::json(&judged(&answer, word, is_told))?;
    } else {
        print::out(&verdict(args, &answer, judgement, is_told))?;
    }
    Ok(if judgement == Some(Judgement::Wrong) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The judgement; what is hidden and how large it is stand in it only where they may be told.
fn judged(answer: &Answer, word: Option<&str>, is_told: bool) -> Value {
    if !is_told {
        return json!({ "judgement": word, "hidden": null });
    }
    let hidden: Vec<&String> = answer.right.iter().filter_map(|own| own.first()).collect();
    let explanations: Vec<_> = hidden.iter().map(|name| explanation(name)).collect();
    json!({
        "judgement": word, "hidden": hidden, "explanations": explanations,
        "effect_rms_deg": answer.effect_rms_deg, "noise_rms_deg": answer.noise_rms_deg,
    })
}

fn verdict(args: &CheckArgs, answer: &Answer, judgement: Option<Judgement>, is_told: bool) -> String {
    let guess = args.guess.as_deref().unwrap_or("");
    let mut text = match judgement {
        Some(Judgement::Right) => format!("Right: it is {guess}.\n"),
        Some(Judgement::LookAlike) => {
            format!("Right as far as anybody can tell: these data show {guess} and what is hidden alike.\n")
        }
        Some(Judgement::Wrong) => format!("No, it is not {guess}.\n"),
        None => String::new(),
    };
    if !is_told {
        return text + "Guess again, or say --give-up. `krait lab diagnose` shows how the lab finds it.\n";
    }
    text += &format!(
        "Hidden: {}; it moves the picture by {:.2} deg (rms), beside a noise of {:.2} deg.\n",
        answer.kind, answer.effect_rms_deg, answer.noise_rms_deg
    );
    answer.right.iter().filter_map(|own| own.first()).for_each(|name| text += &in_words(name));
    text
}

/// The answer that belongs to the data, if neither was changed since they were made.
fn opened(data: &Path, answer: Option<&Path>) -> anyhow::Result<Answer> {
    let read = |path: &Path| input::text(path, MAX_BYTES).with_context(|| path.display().to_string());
    let answer = answer.map_or_else(|| data.with_extension("answer.json"), Path::to_owned);
    let hashes = data.with_extension("sha256");
    let (csv, text, listed) = (read(data)?, read(&answer)?, read(&hashes)?);
    ensure!(
        is_unmodified(&listed, [&csv, &text]),
        "{} or {} is not what {} lists: one of them was changed, or belongs to another riddle; make a new one",
        data.display(),
        answer.display(),
        hashes.display()
    );
    Answer::from_json(&text).with_context(|| format!("{} is no answer of krait lab quiz or generate", answer.display()))
}

fn ensure_known(name: &str) -> anyhow::Result<()> {
    let effects = || {
        let of_one = SegmentEffect::all().map(|own| own.definition().name);
        EffectKind::ALL.iter().map(|kind| kind.name()).chain(of_one)
    };
    if effects().chain(["none", "unknown"]).any(|known| known == name) {
        return Ok(());
    }
    let nearest = krait_model::nearest_name(name, effects()).unwrap_or_default();
    bail!("--guess {name:?} is no effect of a snake or of segments; did you mean {nearest}?")
}

fn in_words(name: &str) -> String {
    let said = |own: Explanation| format!("{name}: {}. {}", own.title, own.what);
    print::paragraph(&explanation(name).map_or_else(|| name.to_owned(), said))
}
