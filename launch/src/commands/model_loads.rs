//! Up to which bend a snake's lines stay within the pull and the push that the slave allows, and which line is first at its
//! limit: Eq. (10) with bounds, along rays over the workspace.

use krait_model::effects::EffectKind;
use krait_model::model_file::ModelFile;
use krait_model::{Chain, LoadBounds, LoadRequest, LoadStatus, ParameterError, Snake};
use krait_slave::Limits;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

/// Rays around the straight pose.
const N_RAYS: u32 = 72;
/// Steps along a ray.
const N_STEPS: u32 = 180;

/// Where a line is first at its limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LoadLimit {
    /// Bend, degrees.
    pub bend_deg: f64,
    /// Direction of the bend, degrees.
    pub direction_deg: f64,
    /// The line, from 1.
    pub line: usize,
    /// Load that it would need, N, push positive.
    pub load_n: f64,
    /// Whether a load that all lines share would bring each within its limit.
    pub a_preload_helps: bool,
}

/// The smallest bend up to `max_bend_rad` at which a line of the model's snake is at a limit; none: no line ever is.
///
/// The load is the elastic one times the model's stiffness scale; what friction adds on the way to the actuator is left out.
///
/// # Errors
/// [`ParameterError`] for limits that are none.
pub fn first_limit(
    model: &ModelFile,
    chain: &Chain,
    limits: &Limits,
    max_bend_rad: f64,
) -> Result<Option<LoadLimit>, ParameterError> {
    let bounds = LoadBounds::new(Vector3::repeat(-limits.pull_n), Vector3::repeat(limits.push_n))?;
    let scale = model.effects().iter().map(|effect| effect.setting()).find(|s| s.kind() == EffectKind::StiffnessScale);
    let eta = scale.and_then(|setting| setting.value("eta")).unwrap_or(1.0);
    let request = LoadRequest { eta, ..LoadRequest::default() };
    let snake = Snake::new(chain.machine())?;
    for step in 1..=N_STEPS {
        let bend_rad = max_bend_rad * f64::from(step) / f64::from(N_STEPS);
        for ray in 0..N_RAYS {
            let direction_rad = core::f64::consts::TAU * f64::from(ray) / f64::from(N_RAYS);
            let (y, x) = direction_rad.sin_cos();
            let place = Vector2::new(x, y) * bend_rad;
            let (line_idx, a_preload_helps) = match snake.line_loads(place, &request, &bounds).status {
                LoadStatus::Preferred => continue,
                LoadStatus::Bounded { line_idx, .. } => (line_idx, true),
                LoadStatus::Infeasible { low_idx, .. } => (low_idx, false),
                LoadStatus::NotFinite => {
                    let (key, unit) = ("eta", "(no unit)");
                    return Err(ParameterError::OutOfRange { key, low: 0.0, high: f64::MAX, found: eta, unit });
                }
            };
            let load_n = snake.line_loads(place, &request, &LoadBounds::none()).tau_n[line_idx];
            let (bend_deg, direction_deg) = (bend_rad.to_degrees(), direction_rad.to_degrees());
            return Ok(Some(LoadLimit { bend_deg, direction_deg, line: line_idx + 1, load_n, a_preload_helps }));
        }
    }
    Ok(None)
}
