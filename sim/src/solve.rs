//! The small linear systems of every plant here: Newton's step from its energy's slopes.

/// Solves A x = b for a symmetric positive definite A by Cholesky's factors; `None` if A is not.
pub(crate) fn solve_symmetric<const N: usize>(a: &[[f64; N]; N], b: &[f64; N]) -> Option<[f64; N]> {
    let mut l = [[0.0_f64; N]; N];
    for row in 0..N {
        for column in 0..=row {
            let rest = a[row][column] - (0..column).map(|k| l[row][k] * l[column][k]).sum::<f64>();
            if row != column {
                l[row][column] = rest / l[column][column];
            } else if rest > 0.0 {
                l[row][row] = rest.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut x = [0.0; N];
    for row in 0..N {
        x[row] = (b[row] - (0..row).map(|k| l[row][k] * x[k]).sum::<f64>()) / l[row][row];
    }
    for row in (0..N).rev() {
        x[row] = (x[row] - (row + 1..N).map(|k| l[k][row] * x[k]).sum::<f64>()) / l[row][row];
    }
    Some(x)
}
