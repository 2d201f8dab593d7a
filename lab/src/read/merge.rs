//! Two logs in one table: every row of the commands, and every measured row at its own time between them.

use crate::Measurements;

/// The commands at a time, between the rows beside it, and the row before; `None` where there are no such rows.
pub(super) fn commanded(commands: &Measurements, time_s: f64, u: &mut [f64]) -> Option<usize> {
    let after = commands.time_s.partition_point(|own| *own < time_s);
    let before = after.checked_sub(1)?;
    let (late, early) = (commands.time_s.get(after)?, commands.time_s[before]);
    let part = (time_s - early) / (late - early);
    for ((u, a), b) in u.iter_mut().zip(commands.input(before)).zip(commands.input(after)) {
        *u = a + part * (b - a);
    }
    Some(before)
}

/// The rows of both in the order of time; `rows` are those of `seen` that were measured, and `time_s` has their times by the commands'
/// clock. A measured row between no two commands is left out.
pub(crate) fn merged(
    commands: &Measurements,
    seen: &Measurements,
    rows: &[usize],
    time_s: impl Fn(usize) -> f64,
) -> Measurements {
    // A measured row stands for a command's of the same time.
    let mut order: Vec<(f64, Option<usize>, usize)> =
        commands.time_s.iter().enumerate().map(|(row, time_s)| (*time_s, None, row)).collect();
    let mut u = vec![0.0; commands.n_inputs];
    for &row in rows {
        let time_s = time_s(row);
        order.extend(commanded(commands, time_s, &mut u).map(|before| (time_s, Some(row), before)));
    }
    order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.is_none().cmp(&b.1.is_none())));
    order.dedup_by(|later, earlier| later.0 == earlier.0);
    let rows: Vec<usize> = order.iter().map(|(_, _, row)| *row).collect();
    // What stands beside the commands keeps its last value.
    let mut all = commands.select(&rows);
    all.time_s = order.iter().map(|(time_s, ..)| *time_s).collect();
    all.n_outputs = seen.n_outputs;
    all.outputs = vec![f64::NAN; rows.len() * seen.n_outputs];
    all.sigma = seen.sigma.as_ref().map(|_| vec![f64::NAN; rows.len()]);
    for (at, (time_s, row, _)) in order.iter().enumerate() {
        let Some(row) = *row else { continue };
        commanded(commands, *time_s, &mut u);
        all.inputs[at * u.len()..][..u.len()].copy_from_slice(&u);
        all.outputs[at * seen.n_outputs..][..seen.n_outputs].copy_from_slice(seen.output(row));
        if let (Some(all), Some(own)) = (&mut all.sigma, &seen.sigma) {
            all[at] = own[row];
        }
    }
    all
}
