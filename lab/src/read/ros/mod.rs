//! ROS 2 bags in MCAP: joints, poses and plain numbers of several topics, each at its own rate, as one table.

mod cdr;
mod merge;
mod messages;

use super::ReadError;
use super::grid::{Grid, MOST_CELLS, MOST_COLUMNS};
use krait_record::{ForeignTopic, foreign_messages};
use messages::{Kind, Values};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

/// What the times of a message weigh, in numbers.
const TIMES: usize = 3;
/// Topics of other types that a sentence names.
const MOST_NAMED: usize = 3;

/// A topic that is read.
struct Topic {
    name: String,
    kind: Kind,
    /// Header's stamp, if there is one, and log time of each message, ns.
    times: Vec<(Option<i64>, i64)>,
    columns: Vec<Column>,
}

/// A value of every message of a topic; NaN where a message lacks it.
struct Column {
    name: String,
    values: Vec<f64>,
}

/// Reads every message of the known types.
pub(super) fn grid(path: &Path, _file: File) -> Result<Grid, ReadError> {
    let unusable = |reason: String| ReadError::Unusable { path: path.to_owned(), reason };
    let mut topics: BTreeMap<u16, Topic> = BTreeMap::new();
    let mut others: BTreeMap<String, String> = BTreeMap::new();
    let (mut n_cells, mut n_columns) = (0, 0);
    foreign_messages(path, |channel, topic, log_ns, payload| {
        let Some(kind) = Kind::of(&topic.schema).filter(|_| topic.encoding == "cdr") else {
            other(&mut others, topic);
            return Ok(());
        };
        let own = topics.entry(channel).or_insert_with(|| Topic::new(topic.name.clone(), kind));
        let number = own.times.len() + 1;
        let wrong = |what: String| unusable(format!("message {number} of {}: {what}; record it again", own.name));
        let log_ns =
            i64::try_from(log_ns).map_err(|_error| wrong(format!("its log time {log_ns} is no time in ns")))?;
        let values = own.kind.decode(payload).map_err(wrong)?;
        let n_new = own.n_new(&values);
        let before = own.weight();
        n_columns += n_new;
        n_cells += (own.times.len() + 1) * (own.columns.len() + n_new + TIMES) - before;
        // Before it is taken: a column that begins late is filled up to there.
        match () {
            () if n_columns > MOST_COLUMNS => {
                Err(unusable(format!("its topics hold more than {MOST_COLUMNS} values; record fewer topics")))
            }
            () if n_cells > MOST_CELLS => Err(unusable(format!(
                "its messages hold more than {MOST_CELLS} values; cut the bag, or record fewer topics"
            ))),
            () => {
                own.push(values, log_ns);
                Ok(())
            }
        }
    })?;
    let topics: Vec<Topic> = topics.into_values().filter(|topic| !topic.columns.is_empty()).collect();
    if topics.is_empty() {
        let found = if others.is_empty() { "no message".to_owned() } else { named(&others) };
        return Err(unusable(format!("it holds {found}, expected topics of the types {}", Kind::all())));
    }
    let mut grid = merge::merged(path, &topics)?;
    if !others.is_empty() {
        grid.notes.push(format!("left out, as their types are not read: {}", named(&others)));
    }
    Ok(grid)
}

fn other(others: &mut BTreeMap<String, String>, topic: &ForeignTopic) {
    if others.len() < MOST_COLUMNS && !others.contains_key(&topic.name) {
        others.insert(topic.name.clone(), topic.schema.clone());
    }
}

fn named(others: &BTreeMap<String, String>) -> String {
    let first: Vec<String> =
        others.iter().take(MOST_NAMED).map(|(name, schema)| format!("{name} ({schema})")).collect();
    let more = match others.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!("{}{more}", first.join(", "))
}

impl Topic {
    fn new(name: String, kind: Kind) -> Self {
        Self { name, kind, times: Vec::new(), columns: Vec::new() }
    }

    /// What it holds weighs, in numbers.
    fn weight(&self) -> usize {
        self.times.len() * (self.columns.len() + TIMES)
    }

    /// How many columns a message is the first to have.
    fn n_new(&self, values: &Values) -> usize {
        let is_known = |k: usize, name: &String| {
            self.columns.get(k).is_some_and(|column| column.name == *name)
                || self.columns.iter().any(|column| column.name == *name)
        };
        values.cells.iter().enumerate().filter(|(k, (name, _))| !is_known(*k, name)).count()
    }

    /// Takes a message.
    fn push(&mut self, values: Values, log_ns: i64) {
        // A stamp of zero was never set.
        self.times.push((values.stamp_ns.filter(|stamp| *stamp != 0), log_ns));
        for (k, (name, value)) in values.cells.into_iter().enumerate() {
            let n_missing = self.times.len() - 1;
            let is_own = self.columns.get(k).is_some_and(|column| column.name == name);
            let place = if is_own { Some(k) } else { self.columns.iter().position(|column| column.name == name) };
            match place.and_then(|place| self.columns.get_mut(place)) {
                Some(column) => {
                    column.values.resize(n_missing, f64::NAN);
                    column.values.push(value);
                }
                None => {
                    let mut values = vec![f64::NAN; n_missing];
                    values.push(value);
                    self.columns.push(Column { name, values });
                }
            }
        }
    }
}
