//! Friction by hanging weights, through the dialogue, on a simulated wire; and the paper's Table II as a self-test.

use crate::common::{N_SEEDS, Noise, User, fresh, honest};
use krait_calibrate::friction::{Direction, FrictionReading, FrictionSettings, friction, run};
use krait_calibrate::{CalibrateError, Dialogue};

const TABLE_II: [(f64, f64); 10] = [
    (0.0, 255.0),
    (100.0, 420.0),
    (200.0, 525.0),
    (300.0, 630.0),
    (400.0, 750.0),
    (500.0, 850.0),
    (700.0, 1150.0),
    (1000.0, 1500.0),
    (1500.0, 2150.0),
    (1800.0, 2600.0),
];

/// A wire round a bend of its own formulation: many small pieces, each with its share of the wrap, friction at the weight's end.
fn wire(mu: f64, f_s_g: f64, weight_g: f64, up: bool) -> f64 {
    let (wrap, n) = (2.0 * 41_f64.to_radians(), 20_000);
    let sign = if up { 1.0 } else { -1.0 };
    let mut load = weight_g + sign * f_s_g;
    for _ in 0..n {
        // Trapezoid rule of dT = sign mu T d(angle).
        let x = 0.5 * mu * wrap / f64::from(n);
        load *= (1.0 + sign * x) / (1.0 - sign * x);
    }
    load
}

/// What a user types for three rounds of weights, and then nothing.
fn answers(mu: f64, f_s_g: f64, scale_sd_g: f64, seed: u64) -> Vec<String> {
    let mut noise = Noise::new(seed);
    let mut lines = Vec::new();
    for (weight, _) in TABLE_II {
        for up in [true, false] {
            if up || weight >= 300.0 {
                let scale = wire(mu, f_s_g, weight + noise.next(), up) + scale_sd_g * noise.next();
                lines.extend(["1".to_owned(), format!("{weight}")]);
                lines.extend([if up { "up" } else { "down" }.to_owned(), format!("{scale:.3}")]);
            }
        }
    }
    lines.extend(["1".to_owned(), String::new()]);
    lines
}

fn typed(lines: &[String]) -> impl FnMut() -> Option<String> + use<> {
    let owned = lines.to_vec();
    let mut lines = owned.into_iter();
    move || lines.next()
}

#[test]
fn every_seed_states_its_own_error() {
    let (mu, f_s_g) = (0.1727, 199.8);
    let csv = fresh("friction-seeds");
    let (mut of_mu, mut of_f_s) = (Vec::new(), Vec::new());
    for seed in 0..N_SEEDS {
        let mut said = Vec::new();
        let mut dialogue = Dialogue::new(User::new(typed(&answers(mu, f_s_g, 25.0, seed))), &mut said);
        let found = run(&mut dialogue, &csv, &FrictionSettings::default()).unwrap();
        of_mu.push(found.mu());
        of_f_s.push(found.f_s_n());
        std::fs::remove_file(&csv).unwrap();
    }
    honest("mu", &of_mu, mu);
    honest("f_s", &of_f_s, f_s_g * 9.80665e-3);
    let se = of_mu.iter().map(|f| f.1).sum::<f64>() / of_mu.len() as f64;
    assert!(
        (se / 0.0067 - 1.0).abs() < 0.15,
        "17 readings with 25 g give mu to 0.0067, widened where they scatter: {se}"
    );
}

#[test]
fn table_ii_gives_the_papers_values() {
    let reading = |(weight_g, scale_g)| FrictionReading {
        line: 1,
        weight_g,
        direction: Direction::Up,
        scale_g,
        weight_sd_g: 0.0,
        scale_sd_g: 25.0,
        note: String::new(),
    };
    let readings: Vec<FrictionReading> = TABLE_II.into_iter().map(reading).collect();
    let found = friction(&readings, &FrictionSettings::default()).unwrap();
    assert!((found.mu().0 - 0.17267).abs() < 5e-6 && (found.f_s_n().0 - 1.92087).abs() < 5e-6, "{found:?}");
    assert!((found.mu().1 - 0.0091).abs() < 1e-4 && (found.f_s_n().1 - 0.1304).abs() < 1e-3, "{found:?}");
    assert!((found.fit.correlation(0, 1) + 0.827).abs() < 1e-3);
}

#[test]
fn what_was_read_is_kept_and_the_dialogue_goes_on_from_it() {
    let csv = fresh("friction-resumed");
    let lines = answers(0.1727, 199.8, 25.0, 1);
    let mut said = Vec::new();
    // The terminal closes in the middle of the tenth reading.
    let part = &lines[..38];
    let ended = run(&mut Dialogue::new(User::new(typed(part)), &mut said), &csv, &FrictionSettings::default());
    assert!(ended.is_ok() || matches!(ended, Err(CalibrateError::NotDetermined { .. })), "{ended:?}");
    assert_eq!(std::fs::read_to_string(&csv).unwrap().lines().count(), 1 + 9);
    let whole = run(
        &mut Dialogue::new(User::new(typed(&lines)), &mut said),
        &fresh("friction-whole"),
        &FrictionSettings::default(),
    );
    let resumed =
        run(&mut Dialogue::new(User::new(typed(&lines[36..])), &mut said), &csv, &FrictionSettings::default());
    assert_eq!(resumed.unwrap(), whole.unwrap());
}

#[test]
fn a_row_that_was_cut_off_is_left_out_and_kept_beside() {
    let csv = fresh("friction-cut");
    let lines = answers(0.1727, 199.8, 25.0, 1);
    let mut said = Vec::new();
    run(&mut Dialogue::new(User::new(typed(&lines)), &mut said), &csv, &FrictionSettings::default()).unwrap();
    let text = std::fs::read_to_string(&csv).unwrap();
    std::fs::write(&csv, &text[..text.len() - 9]).unwrap();
    let again = run(&mut Dialogue::new(User::new(typed(&[])), &mut said), &csv, &FrictionSettings::default()).unwrap();
    assert_eq!(again.fit.dof, 17 - 1 - 2);
    assert_eq!(std::fs::read_to_string(csv.with_extension("csv.cut")).unwrap().len(), text.len() - 9);
}

#[test]
fn readings_that_determine_nothing_say_what_is_missing() {
    let csv = fresh("friction-missing");
    let mut said = Vec::new();
    let lines = ["1", "500", "up", "850", "1", "500", "up", "860", "1", ""].map(str::to_owned);
    let refused = run(&mut Dialogue::new(User::new(typed(&lines)), &mut said), &csv, &FrictionSettings::default());
    let sentence = refused.unwrap_err().to_string();
    assert!(sentence.contains("not determined") && sentence.contains("without weight"), "{sentence}");
    assert!(sentence.contains("1000 to 1800 g") && !sentence.contains('\n'), "{sentence}");
}

#[test]
fn a_law_that_does_not_hold_is_refused() {
    let csv = fresh("friction-misfit");
    let mut said = Vec::new();
    // A wire whose way back rubs like the way there.
    let mut lines = Vec::new();
    for (weight, _) in TABLE_II {
        for word in ["up", "down"] {
            let scale = wire(0.17, 200.0, weight, true);
            lines.extend(["1".to_owned(), format!("{weight}"), word.to_owned(), format!("{scale:.1}")]);
        }
    }
    lines.extend(["1".to_owned(), String::new()]);
    let refused = run(&mut Dialogue::new(User::new(typed(&lines)), &mut said), &csv, &FrictionSettings::default());
    let sentence = refused.unwrap_err().to_string();
    assert!(sentence.contains("chi2") || sentence.contains("not determined"), "{sentence}");
}
