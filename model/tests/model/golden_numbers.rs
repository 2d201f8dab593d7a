//! Every quantity of the golden file agrees: 1e-12 where no derivative is involved, 1e-9 elsewhere, relative to its scale.

use Alike::{Columns, Rows};
use krait_model::oracle::{ConeFrictionFit, Extension, F_S_N, MU, fit_cone_friction};
use krait_model::{MachineParameters, Psi, Snake};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/golden.json");
const EXACT: f64 = 1e-12;
const DERIVED: f64 = 1e-9;

struct Row {
    value: Value,
    psi: Psi,
}

/// Entries of a matrix that share a unit, so that a zero among them has a scale to be judged on.
enum Alike {
    /// All entries of a column; the matrix has so many columns.
    Columns(usize),
    /// All entries of a row; the matrix has so many columns.
    Rows(usize),
}

impl Row {
    /// Compares entry by entry. One that is analytically zero has no relative error: each is judged against itself or
    /// one thousandth of the largest entry alike, whichever is larger.
    fn agrees(&self, key: &str, found: &[f64], alike: Alike, tolerance: f64) {
        let expected = flat(&self.value[key]);
        assert_eq!(expected.len(), found.len(), "{key}");
        let group = |k: usize| match alike {
            Alike::Columns(n) => k % n,
            Alike::Rows(n) => k / n,
        };
        for (k, (e, f)) in expected.iter().zip(found).enumerate() {
            let peers = expected.iter().enumerate().filter(|(other, _)| group(*other) == group(k));
            let scale = peers.fold(0.0_f64, |m, (_, e)| m.max(e.abs()));
            assert!(scale > 0.0, "{key} entry {k} has nothing but zeros beside it");
            let allowed = tolerance * e.abs().max(1e-3 * scale);
            assert!((e - f).abs() <= allowed, "{key} entry {k} at {:?}: {e:e} {f:e}", self.psi);
        }
    }
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn golden() -> Value {
    serde_json::from_str(GOLDEN).unwrap()
}

fn rows() -> Vec<Row> {
    let rows = golden()["rows"].as_array().unwrap().clone();
    assert_eq!(rows.len(), 56);
    rows.into_iter()
        .map(|value| {
            let number = |key: &str| value[key].as_f64().unwrap();
            let psi = Psi { theta_l_rad: number("theta_l_rad"), delta_rad: number("delta_rad") };
            Row { value, psi }
        })
        .collect()
}

fn snake() -> Snake {
    Snake::new(&MachineParameters::default()).unwrap()
}

/// A matrix in the row order of the golden file.
fn by_rows<const R: usize, const C: usize>(m: &nalgebra::SMatrix<f64, R, C>) -> Vec<f64> {
    m.transpose().as_slice().to_vec()
}

#[test]
fn default_parameters_are_those_of_the_golden_file() {
    let file = &golden()["parameters"];
    let defaults = serde_json::to_value(MachineParameters::default()).unwrap();
    for (key, value) in defaults.as_object().unwrap() {
        let Some(value) = value.as_f64() else { continue };
        let expected = file[key].as_f64().unwrap();
        assert!((value / expected - 1.0).abs() < EXACT, "{key}: {expected} {value}");
    }
    for (key, value) in [("mu", MU), ("f_s_n", F_S_N)] {
        assert_eq!(file[key].as_f64(), Some(value), "{key}");
    }
    let s = snake();
    let derived = [
        ("area_m2", s.area_m2()),
        ("inertia_m4", s.inertia_m4()),
        ("k_d_n_per_m", s.k_d_n_per_m()),
        ("k_c_n_per_m", s.k_c_n_per_m()),
    ];
    for (key, found) in derived {
        let expected = file[key].as_f64().unwrap();
        assert!((found / expected - 1.0).abs() < EXACT, "{key}: {expected} {found}");
    }
}

#[test]
fn q_agrees_in_both_coordinates() {
    for row in rows() {
        row.agrees("q_m", snake().q_of_psi(row.psi).as_slice(), Columns(1), EXACT);
        row.agrees("q_m", snake().q(row.psi.bend()).as_slice(), Columns(1), EXACT);
    }
}

#[test]
fn pose_agrees() {
    let s = snake();
    for row in rows() {
        let bend = row.psi.bend();
        row.agrees("position_m", s.tip_pos_in_base_m(bend).as_slice(), Columns(1), EXACT);
        row.agrees("base_from_end", &by_rows(s.base_from_tip_rotation(bend).matrix()), Columns(3), EXACT);
        let pose = s.base_from_tip(bend);
        row.agrees("position_m", pose.translation.vector.as_slice(), Columns(1), EXACT);
        row.agrees("base_from_end", &by_rows(pose.rotation.to_rotation_matrix().matrix()), Columns(3), EXACT);
    }
}

#[test]
fn jacobians_of_the_kinematics_agree() {
    let s = snake();
    for row in rows() {
        row.agrees("j_q_psi", &by_rows(&s.j_q_psi(row.psi)), Columns(2), DERIVED);
        row.agrees("j_q_psi", &by_rows(&(s.j_q_bend() * row.psi.j_bend_psi())), Columns(2), DERIVED);
        row.agrees("j_psi_q_from_q1_q2", &by_rows(&s.j_psi_q12(row.psi).unwrap()), Rows(2), DERIVED);
        let j_x = s.j_x_psi(row.psi);
        row.agrees("j_v_psi_m_per_rad", &by_rows(&j_x.fixed_rows::<3>(0).into_owned()), Columns(2), DERIVED);
        row.agrees("j_w_psi", &by_rows(&j_x.fixed_rows::<3>(3).into_owned()), Columns(2), DERIVED);
    }
}

#[test]
fn energy_and_loads_agree() {
    let s = snake();
    for row in rows() {
        let bend = row.psi.bend();
        row.agrees("energy_j", &[s.energy_j(bend)], Columns(1), EXACT);
        row.agrees("tau_min_norm_n", s.tau_n(bend).as_slice(), Columns(1), DERIVED);
        // The derivative by delta is 1e-11 of that by theta_L at one degree: both are judged on the larger one's scale.
        row.agrees("grad_energy_nm", s.grad_energy_psi_nm(row.psi).as_slice(), Columns(1), DERIVED);
    }
}

#[test]
fn extension_and_alpha_agree() {
    let s = snake();
    for row in rows() {
        let naive = s.extension_naive(row.psi.bend());
        row.agrees("eps_naive_m", naive.eps_m.as_slice(), Columns(1), DERIVED);
        let Extension { eps_m, .. } = s.extension_as_printed(row.psi.bend(), 1.22, 0.1778e-3);
        row.agrees("eps_eta_1p22_lambda_0p1778mm_m", eps_m.as_slice(), Columns(1), DERIVED);
        row.agrees("alpha_m_per_rad", &by_rows(&s.alpha_psi(&naive, row.psi)), Columns(2), DERIVED);
    }
}

#[test]
fn corrected_jacobians_agree_in_both_forms() {
    let s = snake();
    for row in rows() {
        let alpha = s.alpha_psi(&s.extension_naive(row.psi.bend()), row.psi);
        row.agrees("j_tilde_from_q1_q2", &by_rows(&s.j_tilde_psi_q12(row.psi, &alpha).unwrap()), Rows(2), DERIVED);
        row.agrees("j_tilde_from_all_three", &by_rows(&s.j_tilde_psi(row.psi, &alpha).unwrap()), Rows(3), DERIVED);
    }
}

#[test]
fn table_2_fit_agrees() {
    let file = &golden()["table_2_fit"];
    let pairs: Vec<_> = flat(&file["tau_grams"]).into_iter().zip(flat(&file["tau_tilde_grams"])).collect();
    let phi_rad = MachineParameters::default().phi_rad;
    let ConeFrictionFit { slope, intercept, mu, f_s, residual_rms } = fit_cone_friction(&pairs, phi_rad).unwrap();
    let found = [("slope", slope), ("intercept_grams", intercept), ("mu", mu), ("f_s_grams", f_s)];
    for (key, found) in found {
        let expected = file[key].as_f64().unwrap();
        assert!((found / expected - 1.0).abs() < EXACT, "{key}: {expected} {found}");
    }
    assert!((residual_rms - 27.0).abs() < 0.5, "the reference text gives 27 g, found {residual_rms}");
}
