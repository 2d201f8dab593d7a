//! Tests of the measurements: which states are rows, which shape stands where, what the CSV says.

use super::*;
use krait_ipc::message::HopStamps;

const MS: i64 = 1_000_000;

fn state(sequence: u64, sample_ns: i64, flags: u32) -> Sample {
    let x = sequence as f64;
    Sample::State(SlaveState {
        sequence,
        sample_ns,
        stamps: HopStamps::default(),
        command_sequence: 0,
        operating_state: 1,
        flags,
        setpoint_q_m: [0.0; 12],
        setpoint_bend_rad: [0.0; 2],
        setpoint_joints_rad: [0.0; 8],
        n_actuators: 3,
        n_joints: 0,
        measured_q_m: krait_ipc::message::lines([x * 1e-6, -x * 1e-6, 0.1 + 0.2]),
        measured_tau_n: krait_ipc::message::lines([f64::NAN; 3]),
        reasons: 0,
        n_commands: 0,
        n_refused: 0,
        ..SlaveState::default()
    })
}

fn shape(sample_ns: i64, bend_x_rad: f64) -> Sample {
    Sample::Shape(Shape::of_bend(1, sample_ns, sample_ns + 40 * MS, [bend_x_rad, 0.25]).with_sigma(0.007))
}

fn columns(samples: &[Sample]) -> Columns {
    let mut builder = Builder::default();
    samples.iter().for_each(|sample| builder.add(sample));
    builder.finish()
}

fn homed(n: i64) -> Vec<Sample> {
    (0..n).map(|i| state(i as u64 + 1, i * MS, SlaveState::IS_HOMED)).collect()
}

#[test]
fn a_shape_stands_in_the_row_nearest_to_its_exposure_and_every_row_stays() {
    let mut samples = homed(100);
    // Earlier in the file than its row, and later than it.
    samples.insert(0, shape(70 * MS + 400_000, 0.7));
    samples.push(shape(30 * MS - 400_000, 0.3));
    let found = columns(&samples);
    assert_eq!((found.n_rows(), found.n_shapes, found.n_shapes_left_out), (100, 2, 0));
    let with_shape: Vec<_> = (0..found.n_rows()).filter(|row| found.has_shape(*row)).collect();
    let seen: Vec<_> = with_shape.iter().map(|row| (found.time_s[*row], found.outputs[2 * row])).collect();
    assert_eq!(seen, [(0.03, 0.3), (0.07, 0.7)]);
}

#[test]
fn a_shape_that_saw_nothing_or_is_far_from_every_row_or_not_the_nearest_is_left_out_and_counted() {
    let mut samples = homed(10);
    samples.push(shape(5 * MS, f64::NAN));
    samples.push(shape(9 * MS + PAIRING_LIMIT_NS + 1, 1.0));
    samples.push(shape(4 * MS + 300_000, 2.0));
    samples.push(shape(4 * MS + 100_000, 3.0));
    samples.push(shape(4 * MS + 200_000, 4.0));
    let found = columns(&samples);
    assert_eq!((found.n_shapes, found.n_shapes_left_out), (1, 4));
    assert_eq!(found.outputs[8..10], [3.0, 0.25]);
    assert_eq!(columns(&[shape(0, 1.0)]).n_shapes_left_out, 1, "without rows there is no place");
}

#[test]
fn rows_begin_when_the_drives_know_their_zero_and_each_homing_or_new_slave_is_a_new_trial() {
    let (homed, busy) = (SlaveState::IS_HOMED, SlaveState::IS_HOMED | SlaveState::IS_BUSY);
    let samples = [
        state(1, 0, 0),
        state(2, MS, homed),
        state(3, 2 * MS, homed),
        state(4, 3 * MS, busy),
        state(5, 4 * MS, homed),
        state(1, 5 * MS, homed),
        state(2, 6 * MS, homed),
        state(3, 6 * MS, homed),
    ];
    let found = columns(&samples);
    let seen: Vec<_> = found.time_s.iter().copied().zip(found.trial.iter().copied()).collect();
    assert_eq!(seen, [(0.0, 1), (0.001, 1), (0.003, 2), (0.004, 3), (0.005, 3)]);
    assert_eq!(found.n_states_left_out, 3);
}

#[test]
fn parquet_gives_back_every_number_and_a_null_where_nothing_was_measured() {
    use ::parquet::file::reader::{FileReader, SerializedFileReader};
    use ::parquet::record::Field;
    let mut samples = homed(50);
    samples.push(shape(7 * MS, 0.1 + 0.7));
    let mut found = columns(&samples);
    found.tau_n[9..12].copy_from_slice(&[1.5, f64::NAN, -2.5]);
    let path = std::env::temp_dir().join(format!("krait-columns-{}.parquet", std::process::id()));
    write_parquet(&found, None, std::fs::File::create(&path).expect("made")).expect("written");
    let trials = found.trial.clone();
    let reader = SerializedFileReader::new(std::fs::File::open(&path).expect("there")).expect("opened");
    std::fs::remove_file(&path).expect("removed");
    let rows: Vec<_> = reader.get_row_iter(None).expect("rows").map(|row| row.expect("readable")).collect();
    assert_eq!(rows.len(), found.n_rows());
    for (row, k) in rows.iter().zip(0..) {
        let names: Vec<_> = row.get_column_iter().map(|(name, _)| name.as_str()).collect();
        let header = "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,tau1_n,tau2_n,tau3_n,trial";
        assert_eq!(names.join(","), header, "as in the CSV");
        let three = |of: &[f64]| of[3 * k..3 * k + 3].to_vec();
        let shape = [found.outputs[2 * k], found.outputs[2 * k + 1], found.sigma[k]].to_vec();
        let doubles = [vec![found.time_s[k]], three(&found.q_m), shape, three(&found.tau_n)].concat();
        for ((name, field), expected) in row.get_column_iter().zip(doubles) {
            match field {
                Field::Double(value) => assert_eq!(value.to_bits(), expected.to_bits(), "{name}"),
                Field::Null => assert!(expected.is_nan(), "{name}"),
                other => panic!("{name} is {other:?}"),
            }
        }
        assert!(
            matches!(row.get_column_iter().last(), Some((_, Field::Int(found))) if *found == trials[k].cast_signed())
        );
    }
}

#[test]
fn the_csv_has_a_unit_in_each_header_empty_cells_and_numbers_that_come_back_bit_for_bit() {
    let mut samples = homed(2);
    samples.push(shape(MS, 0.1 + 0.7));
    let mut found = columns(&samples);
    let text = |columns: &Columns| {
        let mut bytes = Vec::new();
        write_csv(columns, None, &mut bytes).expect("a Vec grows");
        String::from_utf8(bytes).expect("text")
    };
    let lines: Vec<_> = text(&found).lines().map(str::to_owned).collect();
    assert_eq!(lines[0], "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,trial");
    assert_eq!(lines[1], "0,0.000001,-0.000001,0.30000000000000004,,,,1");
    let cells: Vec<_> = lines[2].split(',').collect();
    assert_eq!(cells[4].parse::<f64>().expect("a number").to_bits(), (0.1_f64 + 0.7).to_bits());
    found.tau_n[..3].copy_from_slice(&[1.0, 2.0, f64::NAN]);
    assert!(
        text(&found)
            .starts_with("time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,tau1_n,tau2_n,tau3_n,trial\n")
    );
    assert!(text(&found).contains(",,,,1,2,,1\n"), "{}", text(&found));
}

#[test]
fn joints_have_as_many_columns_as_there_are_in_the_units_of_their_model() {
    let mut samples = homed(3);
    for sample in &mut samples {
        let Sample::State(state) = sample else { continue };
        (state.n_joints, state.n_actuators) = (2, 2);
    }
    samples.push(Sample::Shape(Shape::of_joints(1, MS, 2 * MS, &[0.5, -0.25])));
    let found = columns(&samples);
    assert_eq!((found.n_rows(), found.n_actuators, found.n_outputs()), (3, 2, 2));
    let units = ColumnUnits { u_unit: "rad".to_owned(), u_per_m: 200.0, y_unit: "mrad".to_owned(), y_per_si: 1000.0 };
    let mut bytes = Vec::new();
    write_csv(&found, Some(&units), &mut bytes).expect("a Vec grows");
    let text = String::from_utf8(bytes).expect("text");
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines[0], "time_s,u1_rad,u2_rad,y1_mrad,y2_mrad,trial");
    assert!(lines[1].ends_with(",,,1") && lines[2].ends_with(",500,-250,1"), "{text}");
    let u1_rad: f64 = lines[2].split(',').nth(1).expect("a cell").parse().expect("a number");
    assert!((u1_rad - 200.0 * 2e-6).abs() < 1e-12, "two micrometres of cable: {text}");
}

#[test]
fn the_wire_and_the_jaw_of_a_gripper_have_columns_of_their_own_and_the_lines_stay_three() {
    let mut samples = homed(3);
    for sample in &mut samples {
        let Sample::State(state) = sample else { continue };
        state.n_actuators = 4;
        (state.measured_q_m[3], state.measured_tau_n[3]) = (1e-3 * state.sequence as f64, -2.0);
    }
    samples.push(Sample::Shape(Shape::of_bend(1, MS, 2 * MS, [0.3, 0.25]).with_sigma(0.007).with_jaw(0.5, 0.007)));
    let found = columns(&samples);
    assert_eq!((found.n_rows(), found.n_actuators, found.q_m.len(), found.tau_n.len()), (3, 3, 9, 9));
    let jaw = found.jaw.as_ref().expect("a gripper");
    assert_eq!((&jaw.wire_m[..], &jaw.wire_n[..]), (&[1e-3, 2e-3, 3e-3][..], &[-2.0; 3][..]));
    assert!(jaw.jaw_rad[0].is_nan() && jaw.jaw_rad[1] == 0.5, "{jaw:?}");
    assert_eq!(found.q_m[3..6], columns(&homed(3)).q_m[3..6]);
    let mut bytes = Vec::new();
    write_csv(&found, None, &mut bytes).expect("a Vec grows");
    let text = String::from_utf8(bytes).expect("text");
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(
        lines[0],
        "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad,sigma_bend_rad,jaw_wire_m,jaw_wire_n,jaw_rad,trial"
    );
    assert!(lines[2].ends_with(",0.007,0.002,-2,0.5,1") && lines[1].ends_with(",,0.001,-2,,1"), "{text}");
    let jaw = found.of_jaw().expect("a gripper");
    assert_eq!((jaw.n_rows(), jaw.n_joints, jaw.n_shapes), (3, 1, 1));
    let mut bytes = Vec::new();
    write_csv(&jaw, None, &mut bytes).expect("a Vec grows");
    let text = String::from_utf8(bytes).expect("text");
    assert_eq!(text, "time_s,u1_m,y1_rad,tau1_n,trial\n0,0.001,,-2,1\n0.001,0.002,0.5,-2,1\n0.002,0.003,,-2,1\n");
    assert_eq!(columns(&homed(3)).of_jaw(), None, "a snake without a gripper");
}
