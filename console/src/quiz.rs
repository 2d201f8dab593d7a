//! Riddles for learners, in a folder of the lab: asked, looked at, guessed and solved by the commands of the command line.
//!
//! The sealed answer stays a file that no route reads; `krait lab check` says what is hidden only once the guess is right or
//! somebody gives up.

use krait_ipc::clock;
use std::path::{Path, PathBuf};

/// Riddles that the folder may hold; one has about 1 MB.
const MOST_RIDDLES: usize = 200;
/// Numbers of riddles are below this one: a teacher says them aloud.
const MOST_SEED: u64 = 1_000_000;
/// Difficulties, as the command has them.
const LEVELS: [&str; 3] = ["easy", "medium", "hard"];

/// The riddles of a lab's folder; reports of what was looked at lie in the lab's folder itself.
pub(crate) struct Riddles {
    lab: PathBuf,
}

impl Riddles {
    /// Of a lab's folder, which may not be there yet.
    pub(crate) fn new(lab: PathBuf) -> Self {
        Self { lab }
    }

    fn folder(&self) -> PathBuf {
        self.lab.join("quiz")
    }

    fn names(&self) -> Vec<String> {
        let Ok(files) = std::fs::read_dir(self.folder()) else { return Vec::new() };
        let names = files.flatten().filter_map(|entry| entry.file_name().into_string().ok());
        names.filter(|name| name.ends_with(".csv")).collect()
    }

    fn path(&self, riddle: &str) -> Result<PathBuf, String> {
        let is_listed = self.names().iter().any(|name| name == riddle);
        is_listed
            .then(|| self.folder().join(riddle))
            .ok_or_else(|| format!("There is no riddle {riddle:?}; begin anew."))
    }

    /// Makes the riddle of a number, or of one from the clock; the same one every time.
    pub(crate) fn ask(&self, level: &str, seed: Option<u64>) -> Result<Vec<String>, String> {
        if !LEVELS.contains(&level) {
            return Err(format!("The difficulty {level:?} is none of {}.", LEVELS.join(", ")));
        }
        let seed = seed.unwrap_or((clock::wall_ns() as u64 / 1000) % MOST_SEED);
        if seed >= MOST_SEED {
            return Err(format!("The riddle's number {seed} is too large; take one below {MOST_SEED}."));
        }
        let (name, names) = (format!("riddle-{level}-{seed}.csv"), self.names());
        if names.len() >= MOST_RIDDLES && !names.contains(&name) {
            let folder = self.folder();
            return Err(format!("{MOST_RIDDLES} riddles lie in {}; delete those that nobody needs.", folder.display()));
        }
        let made = std::fs::create_dir_all(self.folder());
        made.map_err(|error| format!("{} could not be made: {error}.", self.folder().display()))?;
        let (out, seed) = (text(&self.folder().join(name)), seed.to_string());
        Ok(words(&["lab", "quiz", "--json", "--force", "--level", level, "--seed", &seed, "--out", &out]))
    }

    /// What the base model leaves of a riddle's data.
    pub(crate) fn look(&self, riddle: &str) -> Result<Vec<String>, String> {
        self.with_report("compare", "look", riddle, &["--curves"])
    }

    /// Judges a guess; without one the answer is told.
    pub(crate) fn check(&self, riddle: &str, guess: Option<&str>) -> Result<Vec<String>, String> {
        let data = text(&self.path(riddle)?);
        let mut command = words(&["lab", "check", "--json", "--data", &data]);
        match guess {
            // One word, so that no guess is taken for an option.
            Some(guess) if guess.len() <= 60 => command.push(format!("--guess={guess}")),
            Some(guess) => return Err(format!("The guess has {} letters; no effect's name has so many.", guess.len())),
            None => command.push("--give-up".to_owned()),
        }
        Ok(command)
    }

    /// How the lab finds what is hidden.
    pub(crate) fn solve(&self, riddle: &str) -> Result<Vec<String>, String> {
        self.with_report("diagnose", "solve", riddle, &[])
    }

    fn with_report(&self, verb: &str, report: &str, riddle: &str, more: &[&str]) -> Result<Vec<String>, String> {
        let (data, model) = (text(&self.path(riddle)?), text(&self.folder().join("base.toml")));
        let report = text(&self.lab.join(format!("{report}.html")));
        let mut command = words(&["lab", verb, "--json", "--model", &model, "--data", &data, "--report", &report]);
        command.extend(words(more));
        Ok(command)
    }
}

fn text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn words(all: &[&str]) -> Vec<String> {
    all.iter().map(|&word| word.to_owned()).collect()
}
