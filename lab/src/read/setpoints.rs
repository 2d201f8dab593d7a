//! Reads setpoints: tables of wanted positions in the dialects in which measurements are read.

use super::column_map::ColumnMap;
use super::format::{Format, Found};
use super::header::required;
use super::role::{Role, Wanted, named, time};
use super::{ReadError, csv};
use krait_ipc::input;
use std::path::Path;

/// A time and the wanted positions in each row.
#[derive(Clone, Debug, PartialEq)]
pub struct Setpoints {
    /// Rising, s; stamps since 1970 are counted from the first row.
    pub time_s: Vec<f64>,
    /// A column for each name that was asked for, as long as the times.
    pub columns: Vec<Vec<f64>>,
}

/// Reads a table of setpoints: a time, and the columns of these names, `y1_rad`, in the unit at their end; a file may have them in any other
/// unit of the same quantity. Each row must have a number in each of them. A column of a further joint or segment is refused; others are passed
/// over.
///
/// # Errors
/// [`ReadError`], one sentence with file, line and column.
pub fn setpoints(path: &Path, map: &ColumnMap, names: &[String]) -> Result<Setpoints, ReadError> {
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    let wanted: Vec<Wanted> = core::iter::once(time()).chain(names.iter().enumerate().map(named)).collect();
    let Found { file, format } = Format::of(path)?;
    let mut table = match format {
        Format::Krait => {
            let reason = "a recording of krait holds no table; `krait export` writes one of it".to_owned();
            return Err(ReadError::Unusable { path: path.to_owned(), reason });
        }
        Format::Csv => {
            input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
            csv::read(path, file, |at, names| required(path, at, names, map, &wanted)).map_err(without_trials)?
        }
        Format::Grid(grid) => {
            let plan = |at, names: &[String]| required(path, at, names, map, &wanted);
            grid(path, file)?.read(path, plan).map_err(without_trials)?
        }
    };
    let mut column = |role: Role| {
        let place = table.plan.place(role).unwrap_or_else(|| unreachable!("a heading without {role:?} is refused"));
        core::mem::take(&mut table.columns[place])
    };
    Ok(Setpoints { time_s: column(Role::Time), columns: (0..names.len()).map(|k| column(Role::Input(k))).collect() })
}

/// Setpoints are one run: what is said of several runs is no advice here.
fn without_trials(error: ReadError) -> ReadError {
    let ReadError::Time { path, at, column, found_s, before_s, how } = error else { return error };
    let reason = format!(
        "at{at}, column {column}, time {found_s} s is {how} {before_s} s of the row before; sort the rows and remove doubles"
    );
    ReadError::Unusable { path, reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(test: &str, text: &str, names: &[&str], map: &[&str]) -> Result<Setpoints, String> {
        let path = std::env::temp_dir().join(format!("krait-setpoints-{test}-{}.csv", std::process::id()));
        std::fs::write(&path, text).expect("written");
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let map = map.iter().map(|text| text.parse().expect("a mapping")).collect();
        let found = setpoints(&path, &map, &names).map_err(|error| error.to_string());
        std::fs::remove_file(&path).expect("removed");
        found
    }

    #[test]
    fn dialects_units_and_mappings_are_those_of_measurements() {
        let found =
            read("dialects", "Zeit [ms];y1 [deg];note\n0;90,0;a\n10;-45,5;b\n", &["y1_rad"], &["time_s=Zeit [ms]:ms"])
                .expect("read");
        assert_eq!(found.time_s, [0.0, 0.01]);
        assert_eq!(found.columns, [[90_f64.to_radians(), -45.5_f64.to_radians()]]);
        // A quantity that has no unit, and one in a unit that is nobody's.
        let found = read("dialects", "time_s,y1_mm,y2_foo\n5,1,2\n", &["y1_m", "y2_foo"], &[]).expect("read");
        assert_eq!(found.columns, [[0.001], [2.0]]);
        let found = read(
            "dialects",
            "stamp,a,b\n1750000000000000001,1,2\n1750000000010000001,1,2\n",
            &["y1_rad"],
            &["time_s=stamp:ns", "y1_rad=b"],
        );
        assert_eq!(found.expect("read").time_s, [0.0, 0.01]);
    }

    #[test]
    fn what_is_doubtful_is_refused() {
        for (text, words) in [
            ("time_s,y1_rad,y1_deg\n0,0,0\n", "both give y1_rad"),
            ("time_s,y1_rad,y1_rad\n0,0,0\n", "both give y1_rad"),
            ("time_s,y2_rad\n0,0\n", "column y1_rad is missing"),
            (
                "time_s,y1_rad,y2_rad\n0,0,0\n",
                "there is a column of y2, but the model is of a machine with y1_rad alone",
            ),
            ("time_s,y1_rad\n", "no rows"),
            ("time_s,y1_rad\n0,\n", "line 2, column y1_rad: \"\" is no finite number"),
            ("time_s,y1_rad\n0,0\n0,0\n", "sort the rows and remove doubles"),
            ("time_s,y1_rad\n0,0,0\n", "3 columns, the header has 2"),
        ] {
            let said = read("doubtful", text, &["y1_rad"], &[]).expect_err(text);
            assert!(said.contains(words), "{text:?}: {said}");
        }
    }
}
