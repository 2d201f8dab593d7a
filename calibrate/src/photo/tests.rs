//! What two views of the end disk give for the bend vector, against the simulation of an independent bench (`golden/calibrate.json`).

use super::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

const GOLDEN: &str = include_str!("../../tests/golden/calibrate.json");
/// Standard deviation of the angle that each view shows, deg, and how many pairs of views are simulated: as on the bench.
const VIEW_SD_DEG: f64 = 0.5;
const N: usize = 4000;

fn standard_normal(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
    let (a, b) = (uniform(), uniform());
    (-2.0 * (1.0 - a).ln()).sqrt() * (core::f64::consts::TAU * b).cos()
}

fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt())
}

#[test]
fn two_views_give_bend_and_plane_as_the_bench_simulated() {
    let golden: serde_json::Value = serde_json::from_str(GOLDEN).expect("JSON");
    let rows = golden["two_views"]["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 12);
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for row in rows {
        let row: Vec<f64> = row.as_array().expect("a row").iter().filter_map(serde_json::Value::as_f64).collect();
        let (bend, delta) = (row[0].to_radians(), row[1].to_radians());
        let direction = Vector3::new(bend.sin() * delta.cos(), -bend.sin() * delta.sin(), bend.cos());
        let (mut bends_deg, mut deltas_deg) = (Vec::new(), Vec::new());
        for _ in 0..N {
            let mut view = |across: f64| {
                let angle = across.atan2(direction.z) + (VIEW_SD_DEG * standard_normal(&mut random)).to_radians();
                let normal = Vector2::new(angle.sin(), angle.cos());
                Apparent { normal, centre: normal }
            };
            let (front, side) = (view(direction.x), view(direction.y));
            let [edge, _] = estimates(&front, Some(&side));
            bends_deg.push(edge.norm().to_degrees() - row[0]);
            let apart = edge.y.atan2(edge.x) - delta;
            deltas_deg.push(apart.sin().atan2(apart.cos()).to_degrees());
        }
        let ((bias, bend_sd), (_, delta_sd)) = (mean_and_sd(&bends_deg), mean_and_sd(&deltas_deg));
        // Both are simulated: 1.1 % of each standard deviation, 0.008 deg of each mean, four times.
        assert!((bias - row[2]).abs() < 4.0 * 0.012, "{row:?}: bias {bias}");
        assert!((bend_sd / row[3] - 1.0).abs() < 0.065, "{row:?}: bend {bend_sd}");
        assert!((delta_sd / row[4] - 1.0).abs() < 0.065, "{row:?}: delta {delta_sd}");
        assert!((delta_sd * bend / row[5] - 1.0).abs() < 0.065, "{row:?}: across {delta_sd}");
    }
}
