//! A gripper in a snake's model file: what is read is what was written, its own hash, its inverse, and refusals with line and key.

use krait_model::joints::JointInverseSettings;
use krait_model::model_file::{Machine, ModelFile, built_in, documented_defaults};
use krait_model::{Circumstances, KnownColumns};

const SHIPPED: &str = include_str!("../../../docs/gripper/snake.toml");

/// A snake whose gripper begins at line 4.
fn with(gripper: &str) -> String {
    format!("format = 1\n[machine]\nkind = \"snake\"\n{gripper}\n")
}

const GOOD: &str = "[gripper]\nwire_m_per_rad = 0.002\nrange_deg = [0, 60]\nmax_vel_deg_per_s = 90";

fn refused(text: &str) -> String {
    ModelFile::parse(text).unwrap_err().to_string()
}

#[test]
fn what_is_written_reads_back_as_the_same_gripper_with_the_same_hash() {
    for text in [SHIPPED.to_owned(), with(GOOD), with(&GOOD.replace("[0, 60]", "[-20.5, 33.25]"))] {
        let file = ModelFile::parse(&text).unwrap();
        for again in [file.to_toml(), file.to_documented_toml()] {
            let read = ModelFile::parse(&again).unwrap();
            assert_eq!(read, file, "{again}");
            assert_eq!(read.hash(), file.hash());
        }
        let chain = file.chain(KnownColumns::default()).unwrap().unwrap();
        assert_eq!(chain.hash(), file.hash(), "the chain that runs is the file's");
        assert_eq!(chain.gripper().unwrap().numbers(), file_gripper(&file).numbers());
    }
    assert!(documented_defaults().contains("# wire_m_per_rad = 0.002  # m of wire for one radian of the jaw"));
}

fn file_gripper(file: &ModelFile) -> &krait_model::gripper::Gripper {
    let Machine::Snake(snake) = file.machine() else { panic!("a snake") };
    snake.gripper().unwrap()
}

#[test]
fn every_number_and_effect_of_a_gripper_is_in_the_hash_and_a_file_without_one_has_none() {
    let mut hashes = vec![ModelFile::parse(&with("")).unwrap().hash()];
    for text in [
        GOOD.to_owned(),
        GOOD.replace("0.002", "0.003"),
        GOOD.replace("[0, 60]", "[0, 61]"),
        GOOD.replace("[0, 60]", "[-1, 60]"),
        GOOD.replace("90", "91"),
        format!("{GOOD}\n[[gripper.effect]]\nkind = \"backlash\"\nhalf_width = 1e-4"),
        format!("{GOOD}\n[[gripper.effect]]\nkind = \"backlash\"\nhalf_width = 2e-4"),
        format!("{GOOD}\n[[effect]]\nkind = \"backlash\"\nhalf_width_m = 1e-4"),
    ] {
        hashes.push(ModelFile::parse(&with(&text)).unwrap().hash());
    }
    for (k, hash) in hashes.iter().enumerate() {
        assert!(!hashes[..k].contains(hash), "number {k} is another one's");
    }
    for name in ["off", "naive", "estimated"] {
        let file = ModelFile::parse(built_in(name).unwrap()).unwrap();
        assert!(file.chain(KnownColumns::default()).unwrap().unwrap().gripper().is_none());
    }
}

#[test]
fn the_wires_command_takes_the_jaw_where_it_is_wanted_through_its_backlash() {
    let file = ModelFile::parse(SHIPPED).unwrap();
    let gripper = file_gripper(&file);
    assert_eq!(gripper.plausible().unwrap(), Ok(()));
    assert!((gripper.travel_m() - 0.002 * 60f64.to_radians()).abs() < 1e-15);
    let mut inverse = gripper.chain().compensator(JointInverseSettings::default()).unwrap();
    let mut forward = gripper.chain().predictor();
    let (mut n_exact, mut largest_m) = (0, 0.0_f64);
    for k in 0..8000 {
        let at = Circumstances::at(f64::from(k) * 1e-3);
        let wanted_rad = 0.5 - 0.5 * (f64::from(k) * 2e-3).cos();
        let u = inverse.step(&[wanted_rad], &at).u[0];
        let jaw_rad = forward.step(&[u], &at)[0];
        n_exact += u32::from((jaw_rad - wanted_rad).abs() < 1e-9);
        largest_m = largest_m.max((u - 0.002 * wanted_rad).abs());
    }
    assert!(n_exact > 7600, "{n_exact} of 8000 exact; the rest cross the backlash");
    assert!((1.5e-4..2.2e-4).contains(&largest_m), "the correction is the backlash and half a percent: {largest_m} m");
}

#[test]
fn what_is_wrong_is_refused_in_one_sentence_with_line_and_key() {
    let latency = format!("{GOOD}\n[[gripper.effect]]\nkind = \"latency\"\ndelay_s = 0.1");
    let of_snake = format!("{GOOD}\n[[gripper.effect]]\nkind = \"stiffness-scale\"");
    let learnt = format!(
        "{GOOD}\n[[gripper.effect]]\nkind = \"backlash\"\nhalf_width = {{ value = 1e-4, learn = {{ sd = 1e-5 }} }}"
    );
    let free = format!("{GOOD}\n[[gripper.effect]]\nkind = \"backlash\"\nhalf_width = \"free\"");
    for (text, words) in [
        (
            GOOD.replace("wire_m_per_rad = 0.002\n", ""),
            "line 4: `wire_m_per_rad` is missing in [gripper], expected m of wire",
        ),
        (GOOD.replace("0.002", "-0.002"), "line 5: parameter wire_m_per_rad is -0.002, expected 0.0001 to 0.02 m/rad"),
        (GOOD.replace("0.002", "nan"), "parameter wire_m_per_rad is NaN"),
        (GOOD.replace("[0, 60]", "[0, 60, 70]"), "line 6: `range_deg` has 3 values, expected 2"),
        (GOOD.replace("[0, 60]", "[5, 60]"), "line 6: parameter range_deg is 5, expected -180 to 0 deg"),
        (GOOD.replace("[0, 60]", "[0, 0.5]"), "parameter range_deg is 0.5, expected 1 to 180 deg"),
        (GOOD.replace("[0, 60]", "60"), "line 6: `range_deg` is of kind integer, expected an array of numbers"),
        (GOOD.replace("= 90", "= 0"), "line 7: parameter max_vel_deg_per_s is 0, expected 1 to 720 deg/s"),
        (
            GOOD.replace("max_vel", "max_val"),
            "line 7: unknown key `max_val_deg_per_s` in [gripper]; did you mean `max_vel_deg_per_s`",
        ),
        (latency, "line 8: effect latency cannot be compensated"),
        (of_snake, "stiffness-scale makes no sense for a machine of kind joints"),
        (learnt, "half_width is of the gripper's wire, which cannot be learnt"),
        (free, "a number (\"free\" is for the effects of a snake and of joints"),
    ] {
        let found = refused(&with(&text));
        assert!(found.contains(words) && !found.contains('\n'), "{words}: {found}");
    }
    let joints = format!("format = 1\n[machine]\nkind = \"joints\"\nn = 1\n{GOOD}\n");
    assert_eq!(
        refused(&joints),
        "line 5: [gripper] is for a machine of kind snake, and this one is of kind joints; remove it"
    );
}
