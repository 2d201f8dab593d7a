//! The simulated snake along a path of encoder readings: what a camera and load cells without noise would see, row by row.

use super::GenerateError;
use krait_model::{Chain, ChainSettings, Circumstances, KnownColumns, MachineParameters};
use krait_sim::{SimulatedSnake, Truth};
use krait_slave::{Drive, lines};
use nalgebra::Vector2;

/// The plant's steps between two rows: finer than what a model sees.
pub(super) const FINE: i64 = 4;
/// The same while an amplitude is being sought.
pub(super) const COARSE: i64 = 1;

/// Encoder readings, m, that bring an elastic snake of the base model to these bend vectors.
pub(super) fn planned_m(
    machine: &MachineParameters,
    path_rad: &[[f64; 2]],
    period_s: f64,
) -> Result<Vec<[f64; 3]>, GenerateError> {
    let chain =
        Chain::new(machine, ChainSettings::default(), &[], KnownColumns { time: true, ..KnownColumns::default() })?;
    let mut compensator = chain.compensator()?;
    let step = |(k, bend): (usize, &[f64; 2])| {
        let command = compensator.step(Vector2::new(bend[0], bend[1]), &Circumstances::at(k as f64 * period_s));
        [command.q_tilde_m.x, command.q_tilde_m.y, command.q_tilde_m.z]
    };
    Ok(path_rad.iter().enumerate().map(step).collect())
}

/// What is seen of a snake of this truth, rad.
pub(super) fn seen_rad(
    truth: &Truth,
    readings_m: &[[f64; 3]],
    period_s: f64,
    n_steps: i64,
) -> Result<Vec<[f64; 2]>, GenerateError> {
    Ok(measured(truth, readings_m, period_s, n_steps)?.bend_rad)
}

/// What a snake of some truth would be measured at without noise, row by row.
pub(super) struct Measured {
    /// What the camera sees, rad.
    pub bend_rad: Vec<[f64; 2]>,
    /// Loads at the actuators, N, push positive.
    pub load_n: Vec<[f64; 3]>,
}

/// What is seen and weighed of a snake of this truth.
pub(super) fn measured(
    truth: &Truth,
    readings_m: &[[f64; 3]],
    period_s: f64,
    n_steps: i64,
) -> Result<Measured, GenerateError> {
    truth.check("the hidden effect").map_err(GenerateError::Truth)?;
    let mut snake = SimulatedSnake::new(truth);
    snake.set_power(0, true).map_err(GenerateError::Drive)?;
    let step_ns = (period_s * 1e9) as i64 / n_steps;
    let mut from = readings_m.first().copied().unwrap_or_default();
    let (mut seen, mut load_n) = (Vec::with_capacity(readings_m.len()), Vec::with_capacity(readings_m.len()));
    for (row, &to) in readings_m.iter().enumerate() {
        let mut shape = [0.0; 2];
        for k in 1..=n_steps {
            let stamp_ns = (row as i64 * n_steps + k) * step_ns;
            let part = k as f64 / n_steps as f64;
            let between = core::array::from_fn(|i| from[i] * (1.0 - part) + to[i] * part);
            snake.write(stamp_ns, lines(between)).map_err(GenerateError::Drive)?;
            shape = snake.seen_rad(stamp_ns);
        }
        seen.push(shape);
        load_n.push(snake.actuator_loads_n());
        from = to;
    }
    if snake.n_unsolved() > 0 {
        return Err(GenerateError::Unsolved { n: snake.n_unsolved() });
    }
    Ok(Measured { bend_rad: seen, load_n })
}

/// Root mean square length of the difference, rad.
pub(crate) fn apart_rad(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)).sum();
    (square / a.len().max(1) as f64).sqrt()
}
