//! `krait lab quiz` and `krait lab check`: a hidden effect, a learner's guess, the answer.

use super::generate::refuse_existing_data;
use crate::cli_lab_data::{CheckArgs, QuizArgs};
use crate::print;
use anyhow::{Context, bail, ensure};
use krait_ipc::{clock, input};
use krait_lab::diagnose::titled;
use krait_lab_benchmark::generate::{Answer, Judgement, Quiz, Sealed, base_model, is_unmodified};
use krait_lab_benchmark::segments::SegmentsQuiz;
use krait_model::effects::{Definition, EffectKind, Hook, SegmentEffect, explanation};
use krait_model::{meant_name, nearest_name};
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
            let choices: Vec<String> = riddle.choices.iter().copied().map(str::to_owned).collect();
            ("snake", choices, riddle.generate(seed)?.seal(&args.out, args.answer.as_deref())?)
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
        text += &in_words(name, titled(name, None));
    }
    text + &format!(
        "\nLook:  krait lab compare --model {model} --data {data} --report look.html\n\
         Guess: krait lab check --data {data} --guess NAME\n"
    )
}

/// A guess: what was said, the effect that it means, and what that is worth.
struct Guessed {
    said: String,
    effect: &'static str,
    worth: Judgement,
}

/// Judges a guess; a wrong one is exit code 1.
pub fn check(args: &CheckArgs) -> anyhow::Result<ExitCode> {
    let answer = opened(&args.data, args.answer.as_deref())?;
    let said: Vec<&str> =
        args.guess.as_deref().map_or_else(Vec::new, |guess| guess.split('+').map(str::trim).collect());
    let effects = said.iter().map(|name| effect_named(name)).collect::<anyhow::Result<Vec<_>>>()?;
    let (each, n_unnamed) = answer.weigh(&effects);
    let guessed: Vec<Guessed> = said
        .into_iter()
        .zip(effects.iter().zip(each))
        .map(|(said, (effect, worth))| Guessed { said: said.to_owned(), effect, worth })
        .collect();
    let judgement = args.guess.as_ref().map(|_| answer.judge(&effects));
    let is_told = args.give_up || judgement.is_some_and(|own| own != Judgement::Wrong);
    if args.json {
        print::json(&judged(&answer, &guessed, n_unnamed, judgement, is_told))?;
    } else {
        print::out(&verdict(&answer, &guessed, n_unnamed, judgement, is_told))?;
    }
    Ok(if judgement == Some(Judgement::Wrong) { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn word(judgement: Judgement) -> &'static str {
    match judgement {
        Judgement::Right => "right",
        Judgement::LookAlike => "look-alike",
        Judgement::Wrong => "wrong",
    }
}

/// The judgement; what is hidden and how large it is stand in it only where they may be told.
fn judged(
    answer: &Answer,
    guessed: &[Guessed],
    n_unnamed: usize,
    judgement: Option<Judgement>,
    is_told: bool,
) -> Value {
    let each = guessed.iter().map(|own| {
        let is_near = (own.worth == Judgement::Wrong).then(|| own.is_near(answer));
        json!({ "said": own.said, "effect": own.effect, "worth": word(own.worth), "is_near": is_near })
    });
    let mut all = json!({
        "judgement": judgement.map(word), "hidden": null, "guessed": each.collect::<Vec<_>>(),
        "n_hidden": answer.right.len(), "n_unnamed": judgement.map(|_| n_unnamed),
    });
    if is_told && let Value::Object(keys) = &mut all {
        let hidden: Vec<&String> = answer.right.iter().filter_map(|own| own.first()).collect();
        keys.insert("explanations".to_owned(), hidden.iter().map(|name| json!(explanation(name))).collect());
        keys.insert("titles".to_owned(), hidden.iter().map(|name| json!(title_of(answer, name))).collect());
        keys.insert("hidden".to_owned(), json!(hidden));
        keys.insert("effect_rms_deg".to_owned(), json!(answer.effect_rms_deg));
        keys.insert("noise_rms_deg".to_owned(), json!(answer.noise_rms_deg));
    }
    all
}

fn verdict(
    answer: &Answer,
    guessed: &[Guessed],
    n_unnamed: usize,
    judgement: Option<Judgement>,
    is_told: bool,
) -> String {
    let names = |is: fn(Judgement) -> bool| -> Vec<String> {
        guessed.iter().filter(|own| is(own.worth)).map(Guessed::in_words).collect()
    };
    let all = names(|_| true).join(" and ");
    let mut text = match judgement {
        Some(Judgement::Right) => format!("Right: it is {all}.\n"),
        Some(Judgement::LookAlike) => {
            format!("Right as far as anybody can tell: these data show {all} and what is hidden alike.\n")
        }
        Some(Judgement::Wrong) => format!("No, it is not {all}.\n"),
        None => String::new(),
    };
    if judgement == Some(Judgement::Wrong) {
        let (right, wrong) = (names(|own| own != Judgement::Wrong), names(|own| own == Judgement::Wrong));
        text += &print::paragraph(&how_far(&right, &wrong, answer.right.len(), n_unnamed));
        for own in guessed.iter().filter(|own| own.worth == Judgement::Wrong) {
            text += &print::paragraph(&own.nearness(answer));
        }
    }
    if !is_told {
        return text + "Guess again, or say --give-up. `krait lab diagnose` shows how the lab finds it.\n";
    }
    text += &format!(
        "Hidden: {}; it moves the picture by {:.2} deg (rms), beside a noise of {:.2} deg.\n",
        answer.kind, answer.effect_rms_deg, answer.noise_rms_deg
    );
    answer.right.iter().filter_map(|own| own.first()).for_each(|name| text += &in_words(name, title_of(answer, name)));
    text
}

/// How far a wrong guess was right.
fn how_far(right: &[String], wrong: &[String], n_hidden: usize, n_unnamed: usize) -> String {
    let effects = if n_hidden == 1 { "effect is" } else { "effects are" };
    let mut text = format!("{n_hidden} {effects} hidden, of which the guess names {}.", n_hidden - n_unnamed);
    for (names, is) in [(right, "right"), (wrong, "wrong")] {
        if !names.is_empty() {
            text += &format!(" {is}: {}.", names.join(", "));
        }
    }
    text
}

fn definition_of(effect: &str) -> Option<&'static Definition> {
    let of_one = || SegmentEffect::from_name(effect).map(SegmentEffect::definition);
    EffectKind::from_name(effect).map(EffectKind::definition).or_else(of_one)
}

/// Where an effect acts.
fn hook_of(effect: &str) -> Option<Hook> {
    definition_of(effect).map(|own| own.hook)
}

/// What people call a hidden effect, with its size where the plant says it as a parameter of the effect.
fn title_of(answer: &Answer, effect: &str) -> Option<String> {
    let known = answer.known.get(effect);
    let parameters = definition_of(effect).map_or(&[][..], |own| own.parameters);
    titled(effect, parameters.iter().find_map(|own| Some((own.name, own.unit, *known?.get(own.name)?))))
}

impl Guessed {
    /// Whether something that is hidden acts where a wrong guess does.
    fn is_near(&self, answer: &Answer) -> bool {
        let own = hook_of(self.effect);
        own.is_some() && answer.right.iter().filter_map(|names| names.first()).any(|name| hook_of(name) == own)
    }

    fn nearness(&self, answer: &Answer) -> String {
        let place = match hook_of(self.effect) {
            Some(Hook::Eps) => "the length of the lines",
            Some(Hook::Tau) => "loads and moments",
            Some(Hook::Geo) => "the way from the lines to the bend",
            Some(Hook::Meas) => "what the camera sees",
            Some(Hook::Enc) => "what the drives read",
            Some(Hook::Cmd) => "what a drive is told",
            Some(Hook::Joint) => "the position of a joint",
            Some(Hook::Force) => "the force of a joint",
            None => return String::new(),
        };
        let also = if self.is_near(answer) { "so does something that is hidden" } else { "nothing hidden does" };
        format!("{} acts on {place}, and {also}.", self.effect)
    }

    /// The effect, and what was said where that is another word.
    fn in_words(&self) -> String {
        if self.said == self.effect { self.said.clone() } else { format!("{} ({})", self.effect, self.said) }
    }
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

/// The effect of a snake or of a segment that a name says: its own, another word for it, or its title.
fn effect_named(said: &str) -> anyhow::Result<&'static str> {
    let effects = || {
        let of_one = SegmentEffect::all().map(|own| own.definition().name);
        EffectKind::ALL.iter().map(|kind| kind.name()).chain(of_one)
    };
    let known = ["none", "unknown"].into_iter().find(|known| *known == said);
    if let Some(effect) = known.or_else(|| meant_name(said, effects())) {
        return Ok(effect);
    }
    let nearest = nearest_name(said, effects()).unwrap_or_default();
    bail!("--guess {said:?} is no effect of a snake or of segments; did you mean {nearest}?")
}

fn in_words(name: &str, title: Option<String>) -> String {
    let words = title.zip(explanation(name)).map(|(title, own)| format!("{name}: {title}. {}", own.what));
    print::paragraph(&words.unwrap_or_else(|| name.to_owned()))
}
