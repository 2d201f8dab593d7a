//! Measurements of segments in series: what `krait export` writes is read, and a table that is not of them is refused in one sentence.

use krait_lab::machine::machine_of;
use krait_lab::read::{ColumnMap, Expected, read};
use krait_lab::{Measurements, Quantity};
use krait_model::model_file::ModelFile;
use std::path::PathBuf;

fn file() -> ModelFile {
    ModelFile::parse(include_str!("../../../docs/segments/two.toml")).unwrap()
}

fn of_table(name: &str, header: &str) -> Result<Measurements, String> {
    let path: PathBuf = std::env::temp_dir().join(format!("krait-lab-segments-{}-{name}.csv", std::process::id()));
    let n = header.split(',').count();
    let row = |k: usize| format!("{}{}", 0.1 * k as f64, format!(",{}", 1e-5 * k as f64).repeat(n - 1));
    let rows: Vec<String> = (0..30).map(row).collect();
    std::fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    let file = file();
    let data = read(&path, &ColumnMap::default(), Expected::from(file.machine()));
    std::fs::remove_file(&path).unwrap();
    data.map_err(|error| error.to_string())
}

const LINES: &str = "time_s,u1_m,u2_m,u3_m,u4_m,u5_m,u6_m";

#[test]
fn an_exported_table_is_read_as_lines_and_bend_vectors() {
    let data = of_table("good", &format!("{LINES},y1_rad,y2_rad,y3_rad,y4_deg,note")).unwrap();
    assert!(data.loads_n.is_none());
    assert_eq!((data.quantity, data.n_inputs, data.n_outputs, data.n_rows()), (Quantity::Segments, 6, 4, 30));
    assert!(data.input(3).iter().all(|q| (q - 3e-5).abs() < 1e-12));
    assert!((data.output(3)[3] - 3e-5_f64.to_radians()).abs() < 1e-12 && (data.output(3)[0] - 3e-5).abs() < 1e-12);
    assert_eq!(data.names.output(2), "segment 2 bend x");
    let machine = machine_of(&file()).unwrap();
    assert_eq!((machine.kind(), machine.input_unit()), ("segments", "m"));
    assert_eq!(machine.predict(machine.effects(), &data).unwrap().len(), 120);
    let [x, y, z] = machine.tip_pos_m(&[0.0; 4]).unwrap();
    assert!(x.abs() < 1e-12 && y.abs() < 1e-12 && (z - 0.052).abs() < 1e-12);
}

const BENDS: &str = "y1_rad,y2_rad,y3_rad,y4_rad";

#[test]
fn loads_of_all_lines_are_read_and_the_model_has_one_for_each() {
    let data = of_table("loads", &format!("{LINES},{BENDS},tau1_n,tau2_n,tau3_mn,tau4_n,tau5_n,tau6_n")).unwrap();
    let loads_n = data.counted_loads_n().unwrap();
    assert_eq!(loads_n.len(), 6 * 30);
    assert!((loads_n[6 * 3] - 3e-5).abs() < 1e-12 && (loads_n[6 * 3 + 2] - 3e-8).abs() < 1e-15);
    let picked = data.select(&[3, 5]);
    assert_eq!(picked.loads_n.unwrap(), [&loads_n[18..24], &loads_n[30..36]].concat());
    let machine = machine_of(&file()).unwrap();
    let (bends, loads) = machine.predict_with_loads(machine.effects(), &data).unwrap();
    assert_eq!((bends.len(), loads.unwrap().len()), (120, 180));
    let rigid = include_str!("../../../docs/segments/two.toml")
        .replace("kind = \"segments\"", "kind = \"segments\"\nlines = \"rigid\"");
    let machine = machine_of(&ModelFile::parse(&rigid).unwrap()).unwrap();
    assert_eq!(machine.predict_with_loads(&[], &data).unwrap().1, None);
}

#[test]
fn loads_of_more_or_fewer_lines_than_the_machine_has_are_refused_in_one_sentence() {
    for (name, loads, found) in [
        ("one_load", "tau4_n", "there are loads of 1 line,"),
        ("five_loads", "tau1_n,tau2_n,tau3_n,tau4_n,tau5_n", "there are loads of 5 lines,"),
        ("seven_loads", "tau1_n,tau2_n,tau3_n,tau4_n,tau5_n,tau6_n,tau7_n", "there are loads of 7 lines,"),
    ] {
        let said = of_table(name, &format!("{LINES},{BENDS},{loads}")).unwrap_err();
        let expected = "line 1: there are loads of ";
        assert!(said.contains(expected) && said.contains(found) && !said.contains('\n'), "{name}: {said}");
        assert!(said.contains("expected those of all 6 lines, tau1_n to tau6_n, or none"), "{name}: {said}");
    }
}

#[test]
fn what_is_missing_or_of_another_machine_is_refused_in_one_sentence() {
    let short = LINES.strip_suffix(",u6_m").unwrap();
    for (name, header, expected) in [
        ("line", format!("{short},y1_rad,y2_rad,y3_rad,y4_rad"), "u6_m"),
        ("bend", format!("{LINES},y1_rad,y2_rad,y3_rad"), "y4_rad"),
        ("unit", format!("{LINES},y1_rad,y2_rad,y3_rad,y4_mm"), "\"y4_mm\" has the unknown unit \"mm\""),
        ("snake", "time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad".to_owned(), "are those of a snake"),
        (
            "more",
            format!("{LINES},u7_m,y1_rad,y2_rad,y3_rad,y4_rad,y5_rad,y6_rad"),
            "columns for 7 lines and 6 components of bend vectors",
        ),
    ] {
        let said = of_table(name, &header).unwrap_err();
        assert!(said.contains(expected) && !said.contains('\n'), "{name}: {said}");
    }
}
