//! Any lines at any angles, and two or three segments: every golden number of the bench within 1e-5 of its scale.

use krait_model::effects::EffectKind;
use krait_model::segments::{
    Bends, LineValues, LinesByBends, LoadSharing, MAX_LINES, SegmentChain, SegmentParameters, Segments,
    SegmentsParameters,
};
use krait_model::{EffectSetting, MachineParameters, Snake};
use serde_json::Value;

const GOLDEN: &str = include_str!("../golden/segments.json");
/// Six digits are printed: 1e-5 of the value, or of a thousandth of the largest beside it.
const TOLERANCE: f64 = 1e-5;
const ETA: f64 = 1.22;

/// The bench's lines give g/K_c in the cone whichever way they move: a spring, longer by the capstan's factor.
fn segment(azimuths_rad: &[f64]) -> SegmentParameters {
    let capstan = (2.0 * 0.1727 * 41f64.to_radians()).exp();
    let segment = SegmentParameters::of_table_i(azimuths_rad);
    SegmentParameters { l_c_m: segment.l_c_m * capstan, ..segment }
}

fn golden(key: &str) -> Vec<Value> {
    serde_json::from_str::<Value>(GOLDEN).unwrap()[key].as_array().unwrap().clone()
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

/// Compares entry by entry; `floor` is what counts as nothing, in the golden number's unit.
fn agrees(row: &Value, key: &str, found: impl IntoIterator<Item = f64>, floor: f64) {
    let expected = flat(&row[key]);
    let scale = expected.iter().fold(floor, |most, e| most.max(e.abs()));
    let found: Vec<f64> = found.into_iter().collect();
    assert_eq!(expected.len(), found.len(), "{key}");
    for (k, (e, f)) in expected.iter().zip(&found).enumerate() {
        assert!((e - f).abs() <= TOLERANCE * e.abs().max(1e-3 * scale), "{key} entry {k}: {e:e} {f:e}");
    }
}

fn bends(poses_deg: &[(f64, f64)]) -> Bends {
    let mut bends = Bends::zeros();
    for (j, (bend, delta)) in poses_deg.iter().enumerate() {
        let (sin, cos) = delta.to_radians().sin_cos();
        (bends[2 * j], bends[2 * j + 1]) = (bend.to_radians() * cos, bend.to_radians() * sin);
    }
    bends
}

fn with_eta() -> Vec<EffectSetting> {
    vec![EffectSetting::new(EffectKind::StiffnessScale).with("eta", ETA).unwrap()]
}

fn block(matrix: &LinesByBends, n_lines: usize, n_bends: usize, scale: f64) -> Vec<f64> {
    (0..n_lines).flat_map(|k| (0..n_bends).map(move |i| (k, i))).map(|at| scale * matrix[at]).collect()
}

fn radians(value: &Value) -> Vec<f64> {
    flat(value).iter().map(|degrees| degrees.to_radians()).collect()
}

#[test]
fn lines_at_any_angles_and_radii() {
    let rows = golden("c_n_lines");
    assert_eq!(rows.len(), 4);
    for row in &rows {
        let azimuths = radians(&row["azimuth_deg"]);
        let n = azimuths.len();
        let mut segment = segment(&azimuths);
        for (line, radius_mm) in segment.lines.iter_mut().zip(flat(&row["radius_mm"])) {
            line.radius_m = 1e-3 * radius_mm;
        }
        let parameters = SegmentsParameters { segments: vec![segment], ..Default::default() };
        let machine = Segments::new(&parameters).unwrap();
        let b = bends(&[(45.0, 25.0)]);
        let moments = machine.grad_energy_nm(&b) * ETA;
        let tau = machine.least_loads_n(&moments);
        agrees(row, "J_mm", block(machine.j(), n, 2, 1e3), 0.0);
        agrees(row, "moment_nm", moments.iter().copied().take(2), 0.0);
        agrees(row, "tau_min_norm_n", tau.iter().copied().take(n), 0.0);
        // What the file prints to six digits of a micrometre is nothing where it is analytically nothing.
        agrees(row, "axial_give_um", [1e6 * machine.axial_give_m(&tau)[0]], 1.0);
        let projector = |k: usize, l: usize| {
            f64::from(u8::from(k == l)) - machine.j().row(k).dot(&machine.pinv().column(l).transpose())
        };
        agrees(row, "null_projector", (0..n * n).map(|at| projector(at / n, at % n)), 0.0);
        let ones = LineValues::from_fn(|k, _| if k < n { 1.0 } else { 0.0 });
        let common = machine.pinv() * ones;
        agrees(row, "J_pinv_times_ones_rad_per_m", common.iter().copied().take(2), 100.0);

        let chain = SegmentChain::new(&parameters, &with_eta()).unwrap();
        let mut compensator = chain.compensator();
        let command = compensator.step(&b);
        agrees(row, "q_tilde_mm", command.q_tilde_m.iter().map(|q| 1e3 * q).take(n), 0.0);
        // The bench's J~ leaves out what the snake gives along itself; it is nothing where the lines sum to zero.
        let springs = machine.frictionless_compliance_m_per_n(0);
        let alpha = machine.load_slopes(&[0; MAX_LINES]) * machine.hess_energy_nm(&b) * (ETA * springs);
        let gain = krait_model::segments::BendsByBends::identity() + machine.pinv() * alpha;
        let j_tilde = gain.try_inverse().unwrap() * machine.pinv();
        agrees(row, "j_tilde", (0..2).flat_map(|i| (0..n).map(move |k| (i, k))).map(|at| j_tilde[at]), 0.0);
        if tau.sum().abs() < 1e-9 {
            let own = compensator.j_tilde_rad_per_m();
            agrees(row, "j_tilde", (0..2).flat_map(|i| (0..n).map(move |k| (i, k))).map(|at| own[at]), 0.0);
        }

        for (key, low, high) in [("tau_bounded_m12_30", -12.0, 30.0), ("tau_pull_only_m1", -1e3, -1.0)] {
            let asked =
                LoadSharing { low_n: LineValues::repeat(low), high_n: LineValues::repeat(high), preload_n: 0.0 };
            let found = machine.share_loads(&moments, &asked, &[0; MAX_LINES]);
            assert!(found.sharing.holds(), "{key}: {:?}", found.sharing);
            agrees(row, key, found.tau_n.iter().copied().take(n), 0.0);
        }
    }
}

#[test]
fn two_and_three_segments() {
    let rows = golden("d_series");
    assert_eq!(rows.len(), 5);
    for row in &rows {
        let offsets = flat(&row["azimuth_of_line_1_deg"]);
        let azimuths = |offset: &f64| [0.0, 120.0, 240.0].map(|own| (own + offset).to_radians());
        let segments: Vec<_> = offsets.iter().map(|offset| segment(&azimuths(offset))).collect();
        let parameters = SegmentsParameters { segments, ..Default::default() };
        let chain = SegmentChain::new(&parameters, &with_eta()).unwrap();
        let machine = chain.machine();
        let (n, n_lines) = (machine.n_bends(), machine.n_lines());
        let poses: Vec<(f64, f64)> = flat(&row["bend_delta_deg"]).chunks(2).map(|pose| (pose[0], pose[1])).collect();
        let b = bends(&poses);
        let mut compensator = chain.compensator();
        let command = compensator.step(&b);
        agrees(row, "q_mm", command.q_m.iter().map(|q| 1e3 * q).take(n_lines), 0.0);
        let moments = machine.grad_energy_nm(&b) * ETA;
        agrees(row, "grad_nm", moments.iter().copied().take(n), 0.0);
        agrees(row, "tau_n", command.tau_n.iter().copied().take(n_lines), 0.0);
        let distal = |i: usize| (3..n_lines).map(|k| machine.j()[(k, i)] * command.tau_n[k]).sum::<f64>();
        agrees(row, "moment_of_distal_lines_on_segment_1_nm", [distal(0), distal(1)], 0.0);
        agrees(row, "q_tilde_mm", command.q_tilde_m.iter().map(|q| 1e3 * q).take(n_lines), 0.0);
        let pose = machine.base_from_tip(&b);
        agrees(row, "tip_mm", pose.translation.vector.iter().map(|x| 1e3 * x), 0.0);
        agrees(row, "tip_z_axis", (pose.rotation * nalgebra::Vector3::z()).iter().copied(), 1.0);
        agrees(row, "tip_x_axis", (pose.rotation * nalgebra::Vector3::x()).iter().copied(), 1.0);
        if !row["alpha_mm_per_rad"].is_null() {
            agrees(row, "alpha_mm_per_rad", block(&compensator.alpha_m_per_rad(), n_lines, n, 1e3), 0.0);
            let own = compensator.j_tilde_rad_per_m();
            agrees(row, "j_tilde", (0..n).flat_map(|i| (0..n_lines).map(move |k| (i, k))).map(|at| own[at]), 0.0);
        }
    }
}

/// Wires that go through the snake's lines and bend a short stage behind it go the way of a second segment's lines, and what the
/// stage is long besides: the bench's unit is two segments in series.
#[test]
fn a_wire_unit_behind_the_snake_is_a_short_second_segment() {
    let rows: Vec<Value> = serde_json::from_str(include_str!("../golden/wire_unit.json")).unwrap();
    assert_eq!(rows.len(), 3);
    for row in &rows {
        let stage_mm = row["stage_length_mm"].as_f64().unwrap();
        // A stage of 4 mm is shorter than any segment may be. Twice as long, both leave each line's way, which is its radius times the
        // bend, and double the platform's place.
        let mut snake = segment(&[0.0, 120.0, 240.0].map(f64::to_radians));
        snake.l_m *= 2.0;
        let stage = SegmentParameters { l_m: 2e-3 * stage_mm, ..snake.clone() };
        let parameters = SegmentsParameters { segments: vec![snake, stage], ..Default::default() };
        let machine = Segments::new(&parameters).unwrap();
        let pose = |key: &str| (row[key][0].as_f64().unwrap(), row[key][1].as_f64().unwrap());
        let (snake, stage) = (pose("snake_bend_delta_deg"), pose("stage_bend_delta_deg"));
        let q = machine.q_m(&bends(&[snake, stage]));
        agrees(row, "wire_travel_mm", (3..6).map(|k| 1e3 * q[k] + stage_mm), 0.0);
        // The snake's own lines lie beside the wires. The bench prints six digits of a millimetre where it is analytically nothing.
        agrees(row, "wire_travel_snake_part_mm", (0..3).map(|k| 1e3 * q[k]), 1.0);
        // A wire in the middle is as long as three around it on average, whatever bends.
        let middle_mm =
            1e3 * MachineParameters::default().l_m + stage_mm + (3..6).map(|k| 1e3 * q[k]).sum::<f64>() / 3.0;
        agrees(row, "gripper_wire_path_mm", [middle_mm], 0.0);
        let tip = machine.base_from_tip(&bends(&[snake, stage]));
        agrees(row, "platform_mm", tip.translation.vector.iter().map(|x| 0.5e3 * x), 0.0);
        agrees(row, "platform_z_axis", (tip.rotation * nalgebra::Vector3::z()).iter().copied(), 1.0);
    }
}

/// One segment with the paper's three lines is the single snake.
#[test]
fn one_segment_of_three_lines_is_the_snake() {
    let azimuths = [0.0, 120.0, 240.0].map(f64::to_radians);
    let segments = vec![SegmentParameters::of_table_i(&azimuths)];
    let machine = Segments::new(&SegmentsParameters { segments, ..Default::default() }).unwrap();
    let snake = Snake::new(&MachineParameters::default()).unwrap();
    for k in 0..200 {
        let (bend, delta) = (0.007 * f64::from(k), 0.3 * f64::from(k));
        let b = nalgebra::Vector2::new(bend * delta.cos(), bend * delta.sin());
        let mut all = Bends::zeros();
        (all[0], all[1]) = (b.x, b.y);
        assert!((machine.energy_j(&all) - snake.energy_j(b)).abs() < 1e-13);
        assert!((machine.grad_energy_nm(&all).fixed_rows::<2>(0) - snake.grad_energy_bend_nm(b)).amax() < 1e-13);
        assert!((machine.hess_energy_nm(&all).fixed_view::<2, 2>(0, 0) - snake.hess_energy_bend_nm(b)).amax() < 1e-12);
        assert!(
            (machine.least_loads_n(&machine.grad_energy_nm(&all)).fixed_rows::<3>(0) - snake.tau_n(b)).amax() < 1e-10
        );
        assert!((machine.q_m(&all).fixed_rows::<3>(0) - snake.q(b)).amax() < 1e-15);
        let (tip, j) = machine.tip(&all);
        assert!((tip - snake.tip_pos_in_base_m(b)).amax() < 1e-15);
        assert!((j.fixed_columns::<2>(0) - snake.j_x_bend(b)).amax() < 1e-14);
    }
}
