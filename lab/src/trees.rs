//! Boosted regression trees: how much of a target some columns explain without any law. Small ones, for a hint and no more.

/// Splits below the root of a tree, and its leaves.
const DEPTH: usize = 3;
const LEAVES: usize = 1 << DEPTH;
/// Values of a column are told apart by so many steps.
const BINS: usize = 24;
/// Trees, and what each of them may take of the rest.
const ROUNDS: usize = 80;
const SHRINKAGE: f64 = 0.15;
/// A leaf holds at least so many rows.
const FEWEST_IN_LEAF: f64 = 15.0;

/// Columns, each value as the number of its step.
pub(crate) struct Binned {
    columns: Vec<Vec<u8>>,
}

impl Binned {
    /// Steps that hold equally many rows.
    pub(crate) fn new(columns: &[Vec<f64>]) -> Self {
        let binned = |column: &Vec<f64>| {
            let mut sorted = column.clone();
            sorted.sort_by(f64::total_cmp);
            let edges: Vec<f64> = (1..BINS).map(|k| sorted[k * (sorted.len().max(1) - 1) / BINS]).collect();
            column.iter().map(|value| edges.partition_point(|edge| edge < value) as u8).collect()
        };
        Self { columns: columns.iter().filter(|column| !column.is_empty()).map(binned).collect() }
    }
}

/// A split of one leaf: rows whose step in this column is larger go right.
#[derive(Clone, Copy, Default)]
struct Split {
    column: usize,
    last_left: u8,
    is_made: bool,
}

#[derive(Clone, Default)]
struct Tree {
    /// Of the root, of its two parts, and so on.
    splits: [Split; LEAVES],
    leaves: [f64; LEAVES],
}

impl Tree {
    /// The place of a row after so many splits.
    fn place(&self, binned: &Binned, row: usize, depth: usize) -> usize {
        (0..depth).fold(1, |node, _| {
            let split = self.splits[node];
            2 * node + usize::from(split.is_made && binned.columns[split.column][row] > split.last_left)
        })
    }

    fn value(&self, binned: &Binned, row: usize) -> f64 {
        self.leaves[self.place(binned, row, DEPTH) - LEAVES]
    }

    /// The tree that takes most of what is left of these rows.
    fn grown(binned: &Binned, rows: &[usize], left: &[f64]) -> Self {
        let mut tree = Self::default();
        let mut nodes = vec![1_usize; rows.len()];
        for level in 0..DEPTH {
            let (first, n) = (1 << level, 1 << level);
            let mut best = vec![(0.0, Split::default()); n];
            for (column, steps) in binned.columns.iter().enumerate() {
                let mut sums = vec![[(0.0, 0.0); BINS]; n];
                for ((&row, node), left) in rows.iter().zip(&nodes).zip(left) {
                    let own = &mut sums[node - first][usize::from(steps[row])];
                    *own = (own.0 + left, own.1 + 1.0);
                }
                for (own, best) in sums.iter().zip(&mut best) {
                    let (whole, count) = own.iter().fold((0.0, 0.0), |sum, bin| (sum.0 + bin.0, sum.1 + bin.1));
                    let (mut sum, mut n_left) = (0.0, 0.0);
                    for (step, bin) in own.iter().enumerate().take(BINS - 1) {
                        (sum, n_left) = (sum + bin.0, n_left + bin.1);
                        let n_right = count - n_left;
                        if n_left < FEWEST_IN_LEAF || n_right < FEWEST_IN_LEAF {
                            continue;
                        }
                        let gain = sum * sum / n_left + (whole - sum).powi(2) / n_right - whole * whole / count;
                        if gain > best.0 {
                            *best = (gain, Split { column, last_left: step as u8, is_made: true });
                        }
                    }
                }
            }
            best.into_iter().enumerate().for_each(|(k, (_, split))| tree.splits[first + k] = split);
            for (node, &row) in nodes.iter_mut().zip(rows) {
                *node = tree.place(binned, row, level + 1);
            }
        }
        let mut sums = [(0.0, 0.0); LEAVES];
        for (node, left) in nodes.iter().zip(left) {
            let own = &mut sums[node - LEAVES];
            *own = (own.0 + left, own.1 + 1.0);
        }
        tree.leaves = sums.map(|(sum, n)| if n > 0.0 { sum / n } else { 0.0 });
        tree
    }
}

/// What trees that are fitted to the target in `known` rows say of the `asked` rows.
pub(crate) fn predicted(binned: &Binned, target: &[f64], known: &[usize], asked: &[usize]) -> Vec<f64> {
    let mean = known.iter().map(|row| target[*row]).sum::<f64>() / known.len().max(1) as f64;
    let mut left: Vec<f64> = known.iter().map(|row| target[*row] - mean).collect();
    let mut said = vec![mean; asked.len()];
    for _ in 0..ROUNDS {
        let tree = Tree::grown(binned, known, &left);
        known.iter().zip(&mut left).for_each(|(row, left)| *left -= SHRINKAGE * tree.value(binned, *row));
        asked.iter().zip(&mut said).for_each(|(row, said)| *said += SHRINKAGE * tree.value(binned, *row));
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_in_one_column_is_learnt_beside_one_that_says_nothing() {
        let n = 600;
        let columns = [
            (0..n).map(|k| f64::from(k * 7919 % 601)).collect::<Vec<f64>>(),
            (0..n).map(|k| f64::from(k * 104_729 % 599)).collect(),
        ];
        let target: Vec<f64> = columns[0].iter().map(|x| if *x > 300.0 { 1.0 } else { -1.0 }).collect();
        let binned = Binned::new(&columns);
        let (known, asked): (Vec<usize>, Vec<usize>) = (0..n as usize).partition(|row| row % 3 != 0);
        let said = predicted(&binned, &target, &known, &asked);
        let square: f64 = asked.iter().zip(&said).map(|(row, said)| (target[*row] - said).powi(2)).sum();
        assert!(square < 0.05 * asked.len() as f64, "{square}");
        let noise: Vec<f64> = (0..n).map(|k| f64::from(k * 7561 % 593) / 593.0 - 0.5).collect();
        let said = predicted(&binned, &noise, &known, &asked);
        let (left, whole) = asked.iter().zip(&said).fold((0.0, 0.0), |(left, whole), (row, said)| {
            (left + (noise[*row] - said).powi(2), whole + noise[*row].powi(2))
        });
        assert!(left > 0.8 * whole, "noise cannot be learnt: {left} of {whole} left");
    }
}
