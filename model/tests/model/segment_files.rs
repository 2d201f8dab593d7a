//! Model files of kind segments: what is read is what was written, and every kind of bad input is refused with line and key.

use krait_model::effects::{EffectKind, SegmentEffect};
use krait_model::model_file::{Machine, ModelFile, assumed, documented_defaults};
use krait_model::segments::{Bends, SEGMENT_EFFECTS, SegmentParameters, SegmentStatus, SegmentsParameters};

const TWO: &str = include_str!("../../../docs/segments/two.toml");

/// Lines of the machine from line 4, and of a first segment whose lines are around it.
fn machine(lines: &str) -> String {
    format!("format = 1\n[machine]\nkind = \"segments\"\n{lines}\n[[machine.segment]]\nazimuth_deg = [0, 120, 240]\n")
}

/// Two segments; the second one's lines begin at line 7.
fn second(lines: &str) -> String {
    machine("").replace("\"\n\n", "\"\n") + "[[machine.segment]]\n" + lines + "\n"
}

/// Two segments with effects, whose lines begin at line 9.
fn with_effects(lines: &str) -> String {
    second("azimuth_deg = [60, 180, 300]") + "[[effect]]\n" + lines + "\n"
}

fn refused(text: &str) -> String {
    ModelFile::parse(text).unwrap_err().to_string()
}

#[test]
fn the_shipped_file_is_two_segments_of_the_papers_dimensions() {
    let file = ModelFile::parse(TWO).unwrap();
    let Machine::Segments(machine) = file.machine() else { panic!("segments") };
    assert_eq!((machine.segments.len(), machine.low_n, machine.high_n), (2, -60.0, 40.0));
    let of_table = |deg: [f64; 3]| SegmentParameters::of_table_i(&deg.map(f64::to_radians));
    assert_eq!(machine.segments, [of_table([0.0, 120.0, 240.0]), of_table([60.0, 180.0, 300.0])]);
    let chain = file.segment_chain().unwrap().unwrap();
    assert_eq!((chain.machine().n(), chain.machine().n_lines(), chain.eta()), (2, 6, 1.22));
    let mut bends = Bends::zeros();
    (bends[0], bends[3]) = (0.5, 0.4);
    let command = *chain.compensator().step(&bends);
    assert!(matches!(command.status, SegmentStatus::Good(_)), "{:?}", command.status);
    assert!(file.joint_chain(Default::default()).unwrap().is_none());
    assert!(file.chain(Default::default()).unwrap().is_none() && file.first_open().is_none());
}

#[test]
fn what_is_written_reads_back_as_the_same_machine_with_the_same_hash() {
    let mut texts = vec![
        TWO.to_owned(),
        machine("low_n = -inf\nhigh_n = -1.0\npreload_n = -5\nlines = \"rigid\""),
        second("azimuth_deg = [10.1, 99.7, -33.333333]\nr_m = [0.0015, 0.0016, 0.0017]\nl_m = 0.03\ne_pa = 6e10"),
    ];
    texts.extend(SEGMENT_EFFECTS.map(|kind| with_effects(&format!("kind = \"{}\"", kind.name()))));
    let of_first = SegmentEffect::all().filter(|effect| effect.segment == 0);
    texts.extend(of_first.map(|effect| with_effects(&format!("kind = \"{}\"", effect.definition().name))));
    for text in texts {
        let file = ModelFile::parse(&text).unwrap();
        for again in [file.to_toml(), file.to_documented_toml()] {
            let read = ModelFile::parse(&again).unwrap();
            assert_eq!(read, file, "{again}");
            assert_eq!(read.hash(), file.hash());
            assert_eq!(assumed(&again), [], "every value is written");
        }
    }
}

#[test]
fn a_machine_that_a_program_made_is_what_its_file_says() {
    let mut rad = -6.2_f64;
    while rad < 4.0 {
        let segments = vec![SegmentParameters::of_table_i(&[rad, rad + 1.234_567, rad + 2.2])];
        let machine = Machine::Segments(SegmentsParameters { segments, ..Default::default() });
        let file = ModelFile::new(machine, Vec::new(), Vec::new()).unwrap();
        assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file);
        rad += 0.017_3;
    }
}

#[test]
fn the_hash_covers_every_number_of_machine_segments_and_lines() {
    let base = ModelFile::parse(TWO).unwrap();
    let mut hashes = vec![base.hash()];
    for (old, new) in [
        ("preload_n = 0.0", "preload_n = 0.1"),
        ("low_n = -60.0", "low_n = -61.0"),
        ("high_n = 40.0", "high_n = inf"),
        ("preload_n = 0.0", "phi_rad = 0.7"),
        ("preload_n = 0.0", "strain_limit = 0.03"),
        ("preload_n = 0.0", "transition_m = 1e-5"),
        ("preload_n = 0.0", "lines = \"rigid\""),
        ("[0, 120, 240]", "[0, 120, 241]"),
        ("[60, 180, 300]", "[60, 180, 300, 0]"),
        ("r_m = 0.001684\n\n[[machine", "r_m = [0.001684, 0.001684, 0.0016]\n\n[[machine"),
        ("[60, 180, 300]", "[60, 180, 300]\ne_pa = 55e9"),
        ("[60, 180, 300]", "[60, 180, 300]\nd_outer_m = 0.00067"),
        ("[60, 180, 300]", "[60, 180, 300]\nd_inner_m = 0.00051"),
        ("[60, 180, 300]", "[60, 180, 300]\nl_d_m = 0.5"),
        ("[60, 180, 300]", "[60, 180, 300]\nl_c_m = 0.06"),
        ("eta = 1.22", "eta = 1.23"),
    ] {
        assert!(TWO.contains(old), "{old}");
        hashes.push(ModelFile::parse(&TWO.replacen(old, new, 1)).unwrap_or_else(|e| panic!("{new}: {e}")).hash());
    }
    let commented = ModelFile::parse(&TWO.replace("# N, the push", "# something else")).unwrap();
    assert_eq!(commented.hash(), base.hash());
    let n = hashes.len();
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), n);
}

#[test]
fn what_the_file_leaves_out_is_said_for_the_whole_and_for_each_segment() {
    let found = assumed(&second("azimuth_deg = [60, 180, 300]\nl_m = 0.03"));
    let at = |place: &str| found.iter().filter(|own| own.place == place).map(|own| own.key).collect::<Vec<_>>();
    assert_eq!(at("machine"), ["phi_rad", "preload_n", "low_n", "high_n", "strain_limit", "transition_m"]);
    let all = ["r_m", "l_m", "e_pa", "d_outer_m", "d_inner_m", "l_d_m", "l_c_m"];
    assert_eq!(at("segment 1"), all);
    assert_eq!(at("segment 2"), all.into_iter().filter(|key| *key != "l_m").collect::<Vec<_>>());
    assert_eq!(found.iter().find(|own| own.key == "low_n").unwrap().value, f64::NEG_INFINITY);
}

#[test]
fn unknown_keys_and_words_name_their_place_and_the_nearest_known_one() {
    for (text, expected) in [
        (machine("hihg_n = 1"), "line 4: unknown key `hihg_n` in [machine]; did you mean `high_n`?"),
        (machine("r_m = 0.002"), "line 4: unknown key `r_m` in [machine]"),
        (machine("lines = \"rigit\""), "line 4: `lines` is \"rigit\", which is not known; did you mean \"rigid\"?"),
        (
            second("azimut_deg = [0]"),
            "line 7: unknown key `azimut_deg` in [[machine.segment]] number 2; did you mean `azimuth_deg`?",
        ),
        (
            with_effects("kind = \"backlsh\""),
            "line 9: `kind` is \"backlsh\", which is not known; did you mean \"backlash\"?",
        ),
        (
            "format = 1\n[machine]\nkind = \"segment\"\n".to_owned(),
            "line 3: `kind` is \"segment\", which is not known; did you mean \"segments\"?",
        ),
    ] {
        assert!(refused(&text).starts_with(expected), "{}", refused(&text));
    }
}

#[test]
fn machines_that_cannot_be_are_refused_in_one_sentence_with_their_line() {
    let four = machine("") + &"[[machine.segment]]\nazimuth_deg = [0, 120, 240]\n".repeat(3);
    let around = |n: usize| (0..n).map(|k| (k * 360 / n).to_string()).collect::<Vec<_>>().join(", ");
    for (text, expected) in [
        ("format = 1\n[machine]\nkind = \"segments\"\n".to_owned(), ["line 2", "0 segments, expected 1 to 3"]),
        (four, ["line 5", "4 segments, expected 1 to 3"]),
        (
            machine("segment = 3").split("\n[[").next().unwrap().to_owned(),
            ["line 4", "`segment` is of kind integer, expected tables"],
        ),
        (machine("phi_rad = 4"), ["line 4", "phi_rad is 4, expected 0 to 3.14"]),
        (machine("preload_n = -201"), ["line 4", "preload_n is -201, expected -200 to 200 N"]),
        (machine("low_n = 5\nhigh_n = 2"), ["line 4", "low_n is 5, expected -inf to 2 N"]),
        (machine("low_n = nan"), ["line 4", "low_n is NaN, expected -inf to 200 N"]),
        (machine("high_n = -inf"), ["line 4", "high_n is -inf, expected -200 to inf N"]),
        (machine("strain_limit = 0.5"), ["line 4", "strain_limit is 0.5, expected 0.001 to 0.08"]),
        (machine("transition_m = 0"), ["line 4", "transition_m is 0"]),
        (machine("high_n = \"none\""), ["line 4", "`high_n` is of kind string, expected a number"]),
        (machine("phi_rad = { value = 0.7, se = 0.1 }"), ["line 4", "`phi_rad` is of kind table, expected a number"]),
        (
            second("l_m = 0.02"),
            ["line 6", "`azimuth_deg` is missing in [[machine.segment]] number 2, expected the azimuths"],
        ),
        (second("azimuth_deg = 60"), ["line 7", "`azimuth_deg` is of kind integer, expected an array of numbers"]),
        (second("azimuth_deg = [60, inf, 0]"), ["line 7", "`azimuth_deg` is inf, expected a finite number"]),
        (second("azimuth_deg = [60, \"x\", 0]"), ["line 7", "of kind string, expected a finite number"]),
        (second("azimuth_deg = [60, 400, 0]"), ["line 7", "segment 2: azimuth_deg is 400, expected -360 to 360 deg"]),
        (second("azimuth_deg = []"), ["line 7", "segment 2: its 0 lines lie in one plane"]),
        (second("azimuth_deg = [60, 240]"), ["line 7", "segment 2: its 2 lines lie in one plane"]),
        (second(&format!("azimuth_deg = [{}]", around(10))), ["line 2", "13 lines in all, expected 3 to 12"]),
        (machine("").replace("0, 120, 240", "0, 90"), ["line 2", "2 lines in all, expected 3 to 12"]),
        (second("azimuth_deg = [0, 90, 200]\nr_m = [0.001, 0.001]"), ["line 8", "`r_m` has 2 values, expected 3"]),
        (
            second("azimuth_deg = [0, 90, 200]\nr_m = \"wide\""),
            ["line 8", "`r_m` is of kind string, expected an array of numbers"],
        ),
        (
            second("azimuth_deg = [0, 90, 200]\nr_m = 0.1"),
            ["line 8", "segment 2: r_m is 0.1, expected 0.0003 to 0.02 m"],
        ),
        (second("azimuth_deg = [0, 90, 200]\nr_m = 0.015"), ["line 4", "segment 1: l_m is 0.026, expected 0.04"]),
        (second("azimuth_deg = [0, 90, 200]\nl_m = nan"), ["line 8", "segment 2: l_m is NaN"]),
        (second("azimuth_deg = [0, 90, 200]\ne_pa = -1"), ["line 8", "segment 2: e_pa is -1"]),
        (second("azimuth_deg = [0, 90, 200]\nd_outer_m = 1"), ["line 8", "segment 2: d_outer_m is 1"]),
        (second("azimuth_deg = [0, 90, 200]\nd_inner_m = 0.00066"), ["line 8", "segment 2: d_inner_m is 0.00066"]),
        (second("azimuth_deg = [0, 90, 200]\nl_d_m = 0"), ["line 8", "segment 2: l_d_m is 0"]),
        (second("azimuth_deg = [0, 90, 200]\nl_c_m = 11"), ["line 8", "segment 2: l_c_m is 11"]),
    ] {
        let said = refused(&text);
        assert!(said.starts_with(&format!("{}:", expected[0])) && said.contains(expected[1]), "{text}\n{said}");
        assert!(!said.contains('\n') && said.len() < 250, "{said}");
    }
}

#[test]
fn effects_that_segments_cannot_have_or_not_so_are_refused() {
    let list = SEGMENT_EFFECTS.map(EffectKind::name).join(", ");
    // A formula is one's own.
    let is_another = |kind: &EffectKind| !SEGMENT_EFFECTS.contains(kind) && *kind != EffectKind::Formula;
    for kind in EffectKind::ALL.into_iter().filter(is_another) {
        let said = refused(&with_effects(&format!("kind = \"{}\"", kind.name())));
        let name = kind.name();
        assert_eq!(
            said,
            format!(
                "line 9: effect {name} makes no sense for a machine of kind segments, expected one of {list}; remove it"
            )
        );
    }
    let cone_first = "kind = \"cone-friction\"\n[[effect]]\nkind = \"static-friction\"";
    for (effects, expected) in [
        (cone_first, "line 10: effect static-friction stands behind cone-friction"),
        ("kind = \"backlash\"\n[[effect]]\nkind = \"backlash\"", "line 10: effect backlash stands in the chain twice"),
        (
            "kind = \"backlash\"\nhalf_width_m = \"free\"",
            "line 10: `half_width_m` is of kind string, expected a number",
        ),
        (
            "kind = \"backlash\"\nhalf_width_m = { value = 1e-4, learn = { sd = -1e-5 } }",
            "line 10: effect backlash: half_width_m shall be learnt with sd = -0.00001, expected a standard deviation above zero",
        ),
        ("kind = \"cone-friction\"\nmu = -1", "line 10: effect cone-friction: mu is -1"),
        (
            "kind = \"backlash-3\"\nhalf_width_m = 1e-5",
            "line 8: effect backlash-3 is of segment 3, and the machine has 2; remove it, or name another segment",
        ),
        ("kind = \"backlash-2\"\nhalf_width_m = -1e-5", "line 10: effect backlash-2: half_width_m is -0.00001"),
        (
            "kind = \"backlash-2\"\nhalf_width_m = { value = 1e-5, learn = { sd = 1e-5 } }",
            "line 10: effect backlash-2: half_width_m is of one segment, which cannot be learnt while the machine moves",
        ),
        ("kind = \"backlash-4\"", "line 9: `kind` is \"backlash-4\", which is not known; did you mean \"backlash"),
    ] {
        let said = refused(&with_effects(effects));
        assert!(said.starts_with(expected), "{said}");
    }
}

#[test]
fn the_documented_defaults_show_segments_as_comments_that_are_a_machine() {
    let text = documented_defaults();
    let begin = text.find("# kind = \"segments\"").unwrap();
    let file = text[begin..].split("# Another kind of machine, any").next().unwrap();
    let file: String = file.lines().map(|line| line.strip_prefix("# ").unwrap_or("").to_owned() + "\n").collect();
    let file = ModelFile::parse(&format!("format = 1\n[machine]\n{file}")).unwrap();
    let Machine::Segments(machine) = file.machine() else { panic!("segments") };
    assert_eq!(machine.segments.len(), 2);
    assert_eq!(machine.segments[1].lines[2].azimuth_rad, 300_f64.to_radians());
}
