//! A measurement whose columns have names of their own: `krait lab init` proposes what each stands for, and what somebody
//! agrees to is kept beside the file.
//!
//! A proposal lies in a folder of its own until it is kept, so that looking changes nothing. A model that is there already is
//! never overwritten: somebody may have put the machine's dimensions into it.

use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of proposals in the lab's folder.
const PROPOSALS: &str = ".proposals";
/// How the name of a mapping ends.
pub(crate) const MAP_ENDING: &str = ".map.toml";
const MODEL_ENDING: &str = ".model.toml";
/// Columns that a page may name, and letters of each.
const MOST_COLUMNS: usize = 64;
const MOST_LETTERS: usize = 200;
/// Models that a measurement may have been given.
const MOST_MODELS: usize = 100;

/// What was kept, by name in the lab's folder.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Kept {
    /// Which column is what.
    pub map: String,
    /// The model to begin with.
    pub model: String,
}

/// The mapping of a measurement, if it was kept.
pub(crate) fn map_of(data: &Path) -> Option<PathBuf> {
    Some(with_ending(data, MAP_ENDING)).filter(|map| map.is_file())
}

/// The command that looks at a measurement; `map` says what columns are where their names do not tell.
pub(crate) fn propose(data: &Path, map: &[String]) -> Result<Vec<String>, String> {
    let is_too_much = |text: &String| text.chars().count() > MOST_LETTERS || text.chars().any(char::is_control);
    if map.len() > MOST_COLUMNS || map.iter().any(is_too_much) {
        return Err(format!("At most {MOST_COLUMNS} columns can be named here, with {MOST_LETTERS} letters each."));
    }
    let [map_out, model_out] = proposal(data)?;
    if let Some(folder) = map_out.parent() {
        fs::create_dir_all(folder).map_err(|error| format!("{} could not be made: {error}.", folder.display()))?;
    }
    // A proposal that is refused leaves none of before.
    for file in [&map_out, &model_out] {
        let _none_is_fine = fs::remove_file(file);
    }
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let (data, map_out, model_out) = (text(data), text(&map_out), text(&model_out));
    let command = ["lab", "init", &data, "--json", "--map-out", &map_out, "--model-out", &model_out];
    // One word each, so that no name of a column is taken for an option.
    Ok(command.map(str::to_owned).into_iter().chain(map.iter().map(|own| format!("--map={own}"))).collect())
}

/// Keeps what was proposed last beside the measurement.
pub(crate) fn keep(data: &Path) -> Result<Kept, String> {
    let [map, model] = proposal(data)?;
    let read = |path: &Path| {
        fs::read_to_string(path).map_err(|_none| "Nothing was proposed for this measurement; begin anew.".to_owned())
    };
    let (map, model) = (read(&map)?, read(&model)?);
    let model_path = place_for(data, &model)?;
    let map_path = with_ending(data, MAP_ENDING);
    for (path, text) in [(&map_path, &map), (&model_path, &model)] {
        fs::write(path, text).map_err(|error| format!("{} could not be written: {error}.", path.display()))?;
    }
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Kept { map: name(&map_path), model: name(&model_path) })
}

/// Where a model can lie: a free name, or that of one with the same text.
fn place_for(data: &Path, model: &str) -> Result<PathBuf, String> {
    let numbered = |n: usize| match n {
        1 => with_ending(data, MODEL_ENDING),
        n => with_ending(data, &format!(".model-{n}.toml")),
    };
    let is_ours = |path: &PathBuf| !path.exists() || fs::read_to_string(path).is_ok_and(|text| text == model);
    (1..=MOST_MODELS)
        .map(numbered)
        .find(is_ours)
        .ok_or_else(|| format!("{MOST_MODELS} models of {} are there; delete those that nobody needs.", data.display()))
}

/// Where mapping and model of a measurement lie until they are kept.
fn proposal(data: &Path) -> Result<[PathBuf; 2], String> {
    let (Some(folder), Some(name)) = (data.parent(), data.file_name()) else {
        return Err(format!("{} is no measurement.", data.display()));
    };
    let inside = folder.join(PROPOSALS).join(name);
    Ok([with_ending(&inside, MAP_ENDING), with_ending(&inside, MODEL_ENDING)])
}

/// A file beside the measurement: its name with another ending.
fn with_ending(data: &Path, ending: &str) -> PathBuf {
    data.with_extension(ending.trim_start_matches('.'))
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a panic is how a test fails")]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_overwrites_a_mapping_and_never_a_model() {
        let folder = std::env::temp_dir().join(format!("krait-columns-{}", std::process::id()));
        let data = folder.join("run.csv");
        fs::create_dir_all(&folder).expect("a folder");
        assert!(keep(&data).expect_err("nothing there").contains("Nothing was proposed"));
        let kept = |map: &str, model: &str| {
            let command = propose(&data, &["u1_deg=--Motor:deg".to_owned()]).expect("a command");
            assert_eq!(command.last().map(String::as_str), Some("--map=u1_deg=--Motor:deg"));
            for (path, text) in proposal(&data).expect("places").iter().zip([map, model]) {
                fs::write(path, text).expect("written");
            }
            keep(&data).expect("kept").model
        };
        assert_eq!(kept("a", "one"), "run.model.toml");
        assert_eq!(kept("b", "one"), "run.model.toml");
        assert_eq!(kept("c", "two"), "run.model-2.toml");
        assert_eq!(fs::read_to_string(folder.join("run.model.toml")).expect("a model"), "one");
        assert_eq!(fs::read_to_string(map_of(&data).expect("a mapping")).expect("text"), "c");
        let _refused = propose(&data, &[]).expect("a command");
        assert!(keep(&data).is_err(), "what was refused leaves no proposal of before");
        fs::remove_dir_all(&folder).expect("removed");
    }

    #[test]
    fn what_no_column_is_called_is_refused() {
        let data = Path::new("/nowhere/run.csv");
        for map in [vec!["x".repeat(201)], vec!["u1=a\nb".to_owned()], vec![String::new(); 65]] {
            assert!(propose(data, &map).is_err_and(|why| why.contains("At most")));
        }
    }
}
