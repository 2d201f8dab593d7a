//! The compensations that the figures compare, from none to everything with the sign of each line's motion.

use krait_model::Snake;
use krait_model::oracle::{CompensationMode, Compensator, CompensatorParameters};
use nalgebra::{Vector2, Vector3};

/// What is added to q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VariantKind {
    /// Nothing.
    Off,
    /// Eqs. (15)-(17).
    Naive,
    /// Eq. (18) as printed: lambda, m, the same on every line.
    Printed { eta: f64, lambda_m: f64 },
    /// f_s, capstan and half of the play, m, with the sign of each line's load.
    LoadSign { eta: f64, half_width_m: f64 },
    /// The same with the sign of each line's motion.
    MotionSign { eta: f64, half_width_m: f64 },
}

/// One compensation under its names.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// Name for programs.
    pub key: &'static str,
    /// Name for people.
    pub label: &'static str,
    /// What it does.
    pub kind: VariantKind,
}

/// What the bench is, and what was estimated on it.
#[derive(Clone, Copy, Debug)]
pub struct KnownParameters {
    /// The bench's own eta and half-width of its play, m.
    pub truth: (f64, f64),
    /// eta and lambda, m, estimated from line 1 alone, as the paper does.
    pub line_1: (f64, f64),
    /// eta and half-width, m, estimated from contrasts of three lines.
    pub contrasts: (f64, f64),
}

/// eta and lambda, m, of Eq. (22).
pub const OF_EQ_22: (f64, f64) = (1.22, 0.178e-3);

/// Every compensation, in the order of the tables.
pub fn all(known: &KnownParameters) -> [Variant; 7] {
    let (t, l, c) = (known.truth, known.line_1, known.contrasts);
    let variant = |key, label, kind| Variant { key, label, kind };
    [
        variant("off", "off", VariantKind::Off),
        variant("naive", "naive, Eqs. (15)-(17)", VariantKind::Naive),
        variant(
            "printed_1.22_0.178",
            "as printed, Eq. (18) with Eq. (22)",
            VariantKind::Printed { eta: OF_EQ_22.0, lambda_m: OF_EQ_22.1 },
        ),
        variant("printed_own_line1", "as printed, own line 1", VariantKind::Printed { eta: l.0, lambda_m: l.1 }),
        variant("load_sign_1.22_0.089", "sign of the load", VariantKind::LoadSign { eta: t.0, half_width_m: t.1 }),
        variant("motion_sign_1.22_0.089", "sign of motion", VariantKind::MotionSign { eta: t.0, half_width_m: t.1 }),
        variant(
            "motion_sign_own",
            "sign of motion, own contrasts",
            VariantKind::MotionSign { eta: c.0, half_width_m: c.1 },
        ),
    ]
}

impl VariantKind {
    /// A compensation from the straight pose with every line in the middle of its play: bend vector, rad, to q~, m.
    pub fn commands(self, snake: &Snake) -> anyhow::Result<impl FnMut(Vector2<f64>) -> Vector3<f64>> {
        let snake = *snake;
        let parameters = match self {
            Self::MotionSign { eta, half_width_m } => CompensatorParameters {
                mode: CompensationMode::Estimated,
                eta,
                lambda_m: half_width_m,
                ..CompensatorParameters::default()
            },
            _ => CompensatorParameters::default(),
        };
        let mut compensator = Compensator::new(snake, parameters)?;
        Ok(move |b: Vector2<f64>| {
            let eps_m = match self {
                Self::Off => Vector3::zeros(),
                Self::Naive => snake.extension_naive(b).eps_m,
                Self::Printed { eta, lambda_m } => snake.extension_as_printed(b, eta, lambda_m).eps_m,
                Self::LoadSign { eta, half_width_m } => {
                    let signs = snake.tau_n(b).map(|t| if t == 0.0 { 0.0 } else { t.signum() });
                    snake.extension_with_signs(b, eta, half_width_m, &signs).eps_m
                }
                Self::MotionSign { .. } => compensator.step(b).eps_m,
            };
            snake.q(b) + eps_m
        })
    }
}
