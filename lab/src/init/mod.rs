//! A first proposal for a file of which nothing is known: which machine it is of, which column is what, and a model file.

mod force;
mod given;
mod joints;
mod name;
mod role;
mod segments;
mod snake;
mod time;
mod wrap;

use crate::machine::machine_of;
use crate::read::{ColumnMap, Look, Looked, Mapping, ReadError, Unit, look, read};
use crate::{LabError, TipFrame};
use krait_model::model_file::{ModelFile, ModelFileError};
use name::{Name, NamedUnit};
use role::Guess;
use snake::TIP;
use std::path::{Path, PathBuf};

/// Changes of a label, relative to the rows, from which on it is no trial's.
const MOST_CHANGES: f64 = 0.05;

/// What was seen in a file and what follows from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Whether ranges are those of all rows; in a very long file they are those of the first ones.
    pub is_whole: bool,
    /// Every column of the file, in its order.
    pub columns: Vec<SeenColumn>,
    /// `joints`, `snake`, `segments` or `force`.
    pub kind: &'static str,
    /// The machine in a sentence.
    pub machine: String,
    /// How the file is written: `columns separated by semicolons, decimal comma`.
    pub dialect: String,
    /// Rows, and those of them with a measurement.
    pub rows: usize,
    /// Rows with every output measured.
    pub scored_rows: usize,
    /// From the first row to the last of each trial, s.
    pub seconds: f64,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// How each joint's measurement follows its command, each segment's bend its lines, a sentence each; none of a snake.
    pub pairs: Vec<String>,
    /// What was guessed or looks odd, a sentence each.
    pub cautions: Vec<String>,
    /// The mapping.
    pub map: ColumnMap,
    /// Text of the model file.
    pub model: String,
}

/// A column of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenColumn {
    /// The file's name for it.
    pub name: String,
    /// The lab's name for it; `None` for one that is kept beside.
    pub stands_for: Option<String>,
    /// Its unit in the file; empty where the name has none.
    pub unit: String,
    /// Least and largest value in the file.
    pub range: Option<(f64, f64)>,
    /// Why.
    pub why: String,
}

/// No proposal can be made.
#[derive(Debug, thiserror::Error)]
pub enum InitError {
    /// The file is refused.
    #[error(transparent)]
    Data(#[from] ReadError),
    /// The measurements are none of the machine that was recognised.
    #[error(transparent)]
    Lab(#[from] LabError),
    /// Its columns make no machine.
    #[error("{}: {reason}", path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The model that follows is none.
    #[error("{}: the model that follows from the columns is refused: {source}; name the columns with --map", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ModelFileError,
    },
}

/// A column with what its name says.
#[derive(Clone, Debug)]
struct Column {
    looked: Looked,
    words: Name,
    guess: Guess,
    /// A turn after which it began anew in the file.
    wraps: Option<f64>,
}

impl Column {
    fn of(looked: Looked) -> Self {
        let words = Name::of(&looked.name);
        Self { guess: Guess::of(&words), words, looked, wraps: None }
    }

    fn name(&self) -> &str {
        &self.looked.name
    }
}

/// A column of the lab, its place in the file, its unit there, and why.
type Assigned = (String, usize, Option<Unit>, String);

struct Machine {
    kind: &'static str,
    sentence: String,
    columns: Vec<Assigned>,
    pairs: Vec<String>,
    cautions: Vec<String>,
    model: String,
}

/// Looks at a file, proposes machine, mapping and model, and reads the whole file with them.
///
/// # Errors
/// [`InitError`], one sentence.
pub fn propose(path: &Path, given: &ColumnMap) -> Result<Proposal, InitError> {
    let Look { at, how, is_whole, notes, columns } = look(path)?;
    let refused = |reason: String| InitError::Columns { path: path.to_owned(), reason };
    let mut columns: Vec<Column> = columns.into_iter().map(Column::of).collect();
    let given_time = given::apply(path, at, &mut columns, given)?;
    for own in &mut columns {
        own.wraps = wrap::unwrap(own);
    }
    let time = time::find(&columns, given_time).map_err(refused)?;
    if let Some(own) = columns.get_mut(time.place) {
        own.guess = Guess::Time;
    }
    let several = segments::find(&columns).map_err(refused)?.map(segments_of);
    let Machine { kind, sentence, columns: own, mut pairs, mut cautions, model } =
        match several.or_else(|| snake_of(&columns)).or_else(|| force_of(&columns)) {
            Some(machine) => machine,
            None => joints_of(&columns).map_err(refused)?,
        };
    if time.is_guess {
        let name = columns.get(time.place).map_or("", Column::name);
        cautions.insert(
            0,
            format!(
                "{name:?} names no unit: taken for {}, as that makes {:.4} rows a second",
                time.unit.suffix,
                1.0 / time.step_s
            ),
        );
    }
    for (column, turn) in columns.iter().filter_map(|column| Some((column, column.wraps?))) {
        cautions.push(format!(
            "{:?} jumps by a turn: taken for an encoder that begins anew after {turn:.6}; remove `wraps` from the mapping if it does not",
            column.name()
        ));
    }
    if kind == "joints" {
        cautions.extend(force::hint(&columns));
    }
    cautions.extend(notes);
    let mut assigned = vec![("time_s".to_owned(), time.place, Some(time.unit), time.why)];
    let trial = columns.iter().position(is_trial);
    assigned.extend(trial.map(|place| ("trial".to_owned(), place, None, "a label of trials".to_owned())));
    assigned.extend(own);
    let mapping = |(target, place, unit, _): &Assigned| {
        let column = columns.get(*place)?;
        Some(Mapping::new(target.clone(), column.name(), *unit, column.wraps))
    };
    let out = given.mappings.iter().filter(|own| own.takes_out()).cloned();
    let map: ColumnMap = assigned.iter().filter_map(mapping).chain(out).collect();
    let file = ModelFile::parse(&model).map_err(|source| InitError::Model { path: path.to_owned(), source })?;
    let data = read(path, &map, file.machine().into())?;
    let data = machine_of(&file)?.bends_of_tip(data)?;
    cautions.extend(data.tip_frames.iter().map(TipFrame::sentence));
    let follows = segments::follow(&file, &data);
    pairs.extend(follows.pairs);
    cautions.extend(follows.cautions);
    let scored = |row: &usize| data.is_scored(*row);
    Ok(Proposal {
        columns: columns
            .iter()
            .enumerate()
            .map(|(place, column)| seen(column, assigned.iter().find(|own| own.1 == place)))
            .collect(),
        is_whole,
        kind,
        machine: sentence,
        dialect: how,
        rows: data.n_rows(),
        scored_rows: (0..data.n_rows()).filter(scored).count(),
        seconds: data.duration_s(),
        rate_hz: time.step_s.recip(),
        pairs,
        cautions,
        map,
        model,
    })
}

/// The columns of a file alone, for whoever has to name them because nothing could be proposed.
///
/// # Errors
/// [`ReadError`] for a file that cannot be read.
pub fn columns(path: &Path) -> Result<Vec<SeenColumn>, ReadError> {
    let column = |looked: Looked| {
        let column = Column::of(looked);
        let is_time = column.guess == Guess::Time;
        SeenColumn { stands_for: is_time.then(|| "time_s".to_owned()), ..seen(&column, None) }
    };
    Ok(look(path)?.columns.into_iter().map(column).collect())
}

fn seen(column: &Column, assigned: Option<&Assigned>) -> SeenColumn {
    let why = match (&column.guess, assigned) {
        (_, Some((.., why))) => why.clone(),
        (Guess::Other(what), None) => (*what).to_owned(),
        _ if column.looked.n_texts > 0 => "text".to_owned(),
        (Guess::Time, None) => "named so".to_owned(),
        _ if !column.looked.moves() => "never changes".to_owned(),
        (Guess::Command(_), None) => "a spare command".to_owned(),
        (Guess::Measured(_), None) => "a spare position".to_owned(),
        _ => "unknown name".to_owned(),
    };
    let unit = assigned.and_then(|(_, _, unit, _)| unit.map(|unit| unit.suffix));
    SeenColumn {
        name: column.looked.name.clone(),
        stands_for: assigned.map(|(target, ..)| target.clone()),
        unit: unit.unwrap_or(column.words.unit.text()).to_owned(),
        range: column.looked.range(),
        why,
    }
}

/// A label that stays for a while.
fn is_trial(column: &Column) -> bool {
    let values = &column.looked.values;
    let changes = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let is_rare = column.looked.n_texts > 0 || changes as f64 <= MOST_CHANGES * values.len() as f64;
    column.guess == Guess::Trial && is_rare
}

fn segments_of(found: segments::Found) -> Machine {
    let (n, n_lines) = (found.n_segments, found.n_lines);
    let has_loads = found.columns.iter().any(|(target, ..)| target.starts_with("tau"));
    let loads = if has_loads { ", a load for each line" } else { "" };
    Machine {
        kind: "segments",
        sentence: format!(
            "segments, {n} in series on {n_lines} lines (lengths, a bend in two components for each segment{loads})"
        ),
        columns: found.columns,
        pairs: Vec::new(),
        cautions: found.cautions,
        model: segments::model(n, n_lines),
    }
}

fn snake_of(columns: &[Column]) -> Option<Machine> {
    let snake::Found { columns: found, guesses } = snake::find(columns)?;
    let has_loads = found.iter().any(|(target, ..)| target.starts_with("tau"));
    let loads = if has_loads { ", three loads" } else { "" };
    let shape = if found.iter().any(|(target, ..)| target == TIP[0]) {
        "a tip's position in a frame of its own"
    } else {
        "a bend in two components"
    };
    Some(Machine {
        kind: "snake",
        sentence: format!("snake (three lengths, {shape}{loads})"),
        columns: found.into_iter().map(|(target, place, unit, why)| (target, place, Some(unit), why)).collect(),
        pairs: Vec::new(),
        cautions: guesses,
        model: "# Proposed by `krait lab init`. The geometry is the documented default: put in your machine's,\n\
                # `krait model show --defaults` has every key with its meaning.\n\
                format = 1\n\n[machine]\nkind = \"snake\"\n"
            .to_owned(),
    })
}

fn force_of(columns: &[Column]) -> Option<Machine> {
    let force::Found { columns: assigned, n, unit, cautions } = force::find(columns)?;
    let several = if n == 1 { "joint" } else { "joints" };
    let unit = unit.word();
    Some(Machine {
        kind: "force",
        sentence: format!("force, {n} {several} (motion beside a torque or a current in {unit}, and no command)"),
        columns: assigned,
        pairs: Vec::new(),
        cautions,
        model: format!(
            "# Proposed by `krait lab init`. It has no effect yet: what the torque or current is made of is found by\n\
             # `krait lab diagnose`. The sensor's offset is solved for in every fit.\n\
             format = 1\n\n[machine]\nkind = \"force\"\nn = {n}\nunit = {unit:?}\n"
        ),
    })
}

fn joints_of(columns: &[Column]) -> Result<Machine, String> {
    let pairs = joints::pairs(columns);
    if pairs.is_empty() {
        return Err(no_pair(columns));
    }
    let n = pairs.len();
    let places = |side: fn(&joints::Pair) -> usize| pairs.iter().map(side).collect::<Vec<_>>();
    let u = joints::side(columns, &places(|pair| pair.u))?;
    let y = joints::side(columns, &places(|pair| pair.y))?;
    let mut cautions: Vec<String> = [&u.guess, &y.guess].into_iter().flatten().cloned().collect();
    let checked = joints::check(columns, &pairs)?;
    cautions.extend(checked.cautions);
    let unit_of = |place: usize, side: &joints::Side| match columns.get(place).map(|column| &column.words.unit) {
        Some(NamedUnit::Known(unit)) => Some(*unit),
        Some(NamedUnit::None | NamedUnit::Other(_)) => side.unnamed,
        _ => None,
    };
    let mut assigned = Vec::with_capacity(2 * n);
    for (k, pair) in pairs.into_iter().enumerate() {
        assigned.push((format!("u{}_{}", k + 1, u.unit), pair.u, unit_of(pair.u, &u), pair.why_u));
        assigned.push((format!("y{}_{}", k + 1, y.unit), pair.y, unit_of(pair.y, &y), pair.why_y));
    }
    let several = if n == 1 { "joint" } else { "joints" };
    Ok(Machine {
        kind: "joints",
        sentence: format!("joints, {n} {several} (a command beside a measurement)"),
        columns: assigned,
        pairs: checked.pairs,
        cautions,
        model: format!(
            "# Proposed by `krait lab init`. Nobody has calibrated it: gain and offset are left out, so every fit finds them.\n\
             format = 1\n\n[machine]\nkind = \"joints\"\nn = {n}\nu_unit = {:?}\ny_unit = {:?}\n",
            u.unit, y.unit
        ),
    })
}

fn no_pair(columns: &[Column]) -> String {
    let is_still = |column: &&Column| {
        matches!(column.guess, Guess::Command(_) | Guess::Measured(_))
            && column.looked.range().is_some()
            && !column.looked.moves()
    };
    let still: Vec<String> = columns.iter().filter(is_still).map(|column| format!("{:?}", column.name())).collect();
    if !still.is_empty() {
        return format!(
            "{} never change; no gain can be seen without motion: record a motion with reversals",
            still.join(", ")
        );
    }
    "no snake (three lengths and a bend or a tip's position), no segments (lengths and two or three bends), no joint (a command beside a measurement) and no force (a motion beside a torque or current) was recognised in the columns; name them, such as --map u1_deg=NAME --map y1_deg=NAME".to_owned()
}
