//! Messages of several topics as rows: those of the densest topic, with the others' values where they were measured.

use super::super::ReadError;
use super::super::grid::{Grid, GridCells, GridColumn, MOST_CELLS};
use super::Topic;
use std::path::Path;

/// Stamps of one topic that fall back further are of another run, ns.
const MOST_BACK_NS: i64 = 1_000_000_000;

/// The topics side by side.
pub(super) fn merged(path: &Path, topics: &[Topic]) -> Result<Grid, ReadError> {
    let unstamped = topics.iter().find(|topic| topic.times.iter().any(|(stamp, _)| stamp.is_none()));
    let time = |(stamp, log): &(Option<i64>, i64)| stamp.filter(|_| unstamped.is_none()).unwrap_or(*log);
    let mut rows: Vec<i64> = Vec::new();
    let mut densest = "";
    for topic in topics {
        let times: Vec<i64> = topic.times.iter().map(time).collect();
        in_order(path, topic, &times)?;
        if times.len() > rows.len() {
            (rows, densest) = (times, &topic.name);
        }
    }
    rows.sort_unstable();
    rows.dedup();
    let n_columns: usize = topics.iter().map(|topic| topic.columns.len()).sum();
    if rows.len().saturating_mul(n_columns + GridCells::WHOLE) > MOST_CELLS {
        let reason = format!(
            "its topics make {} rows of {n_columns} columns, expected at most {MOST_CELLS} numbers; cut the bag, or record fewer topics",
            rows.len()
        );
        return Err(ReadError::Unusable { path: path.to_owned(), reason });
    }
    // Beyond the rows' ends a message belongs to none of them.
    let reach = match rows.as_slice() {
        [first, .., last] => last.saturating_sub(*first) / (rows.len() as i64 - 1),
        _ => 0,
    };
    let mut notes = vec![match unstamped {
        None => "times are the stamps in the messages' headers".to_owned(),
        Some(topic) => format!("times are those of the log, as {} has no stamp in a header", topic.name),
    }];
    let whole = GridCells::Whole(rows.iter().copied().map(Some).collect());
    let mut columns = vec![GridColumn { name: "time [ns]".to_owned(), cells: whole, is_held: false }];
    for topic in topics {
        let places: Vec<Option<usize>> = topic.times.iter().map(|own| nearest(&rows, time(own), reach)).collect();
        let is_slower = topic.times.len() < rows.len();
        if is_slower {
            notes.push(format!(
                "{} has {} messages and {densest} {}: its cells are empty in between, and a command stands until the next",
                topic.name,
                topic.times.len(),
                rows.len()
            ));
        }
        for column in &topic.columns {
            let mut cells = vec![f64::NAN; rows.len()];
            for (place, value) in places.iter().zip(&column.values) {
                if let Some(cell) = place.and_then(|place| cells.get_mut(place)).filter(|_| !value.is_nan()) {
                    *cell = *value;
                }
            }
            let name = format!("{}/{}", topic.name, column.name);
            columns.push(GridColumn { name, cells: GridCells::Numbers(cells), is_held: is_slower });
        }
    }
    if columns.iter().any(|column| column.name.ends_with("position [rad]")) {
        notes.push(
            "positions of joints are taken for rad; those of a sliding joint are in m: say so with --map y1_m=NAME:m"
                .to_owned(),
        );
    }
    Ok(Grid { how: "a ROS 2 bag (MCAP, CDR)".to_owned(), columns, notes })
}

fn in_order(path: &Path, topic: &Topic, times: &[i64]) -> Result<(), ReadError> {
    let mut latest = i64::MIN;
    for &time in times {
        if time < latest.saturating_sub(MOST_BACK_NS) {
            let reason = format!(
                "the times of {} fall back from {latest} to {time} ns; give each run a bag of its own",
                topic.name
            );
            return Err(ReadError::Unusable { path: path.to_owned(), reason });
        }
        latest = latest.max(time);
    }
    Ok(())
}

/// The row that a time is nearest to, at most so far away.
fn nearest(rows: &[i64], time: i64, reach: i64) -> Option<usize> {
    let after = rows.partition_point(|row| *row < time);
    let distance = |place: usize| rows.get(place).map(|row| row.abs_diff(time));
    let place = match (after.checked_sub(1), distance(after)) {
        (Some(before), Some(far)) if distance(before).is_some_and(|near| near < far) => before,
        (Some(before), None) => before,
        _ => after,
    };
    (distance(place)? <= reach.unsigned_abs()).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_belongs_to_the_row_that_it_is_nearest_to() {
        let rows = [100, 200, 300];
        for (time, place) in [(0, Some(0)), (149, Some(0)), (151, Some(1)), (400, Some(2)), (401, None), (-1, None)] {
            assert_eq!(nearest(&rows, time, 100), place, "{time}");
        }
        assert_eq!(nearest(&[], 5, 100), None);
    }
}
