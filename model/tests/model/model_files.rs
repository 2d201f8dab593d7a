//! Model files: what is read is what was written, and every kind of bad input is refused with line and key.

use krait_model::effects::EffectKind;
use krait_model::joints::JointEffect;
use krait_model::model_file::{FileEffect, Known, Machine, ModelFile, Origin, assumed, documented_defaults};
use krait_model::{ChainSettings, ChainStatus, Circumstances, EffectSetting, KnownColumns};
use nalgebra::Vector2;

const FULL: &str = r#"format = 1
[machine]
kind = "snake"
r_m = 0.0016

[[effect]]
kind = "cone-friction"
mu = { value = 0.18, se = 0.01, from = "run.csv", date = "2026-05-01" }

[[effect]]
kind = "formula"
name = "shelf"
hook = "eps"
formula = "a * tanh(bend / b) * cos(delta - d0)"
params = { a = { value = 1e-4, unit = "m", se = 2e-5 }, b = { value = 0.2, unit = "rad" }, d0 = 0.0 }

[[history]]
effect = "cone-friction"
data = "run.csv"
data_sha256 = "00"
heldout_rms_deg = { before = 2.31, after = 0.64, noise_floor = 0.31 }
"#;

fn refused(text: &str) -> String {
    ModelFile::parse(text).unwrap_err().to_string()
}

/// A snake with one effect whose lines begin at line 5.
fn with_effect(lines: &str) -> String {
    format!("format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\n{lines}\n")
}

#[test]
fn a_file_keeps_its_values_origins_and_history() {
    let file = ModelFile::parse(FULL).unwrap();
    let Machine::Snake(snake) = file.machine() else { panic!("a snake") };
    assert_eq!((snake.parameters.r_m, snake.parameters.l_m), (0.0016, 0.026));
    let [cone, shelf] = file.effects() else { panic!("two effects") };
    assert_eq!(cone.setting().value("mu"), Some(0.18));
    let origin = cone.origin("mu").unwrap();
    assert_eq!(
        (origin.se, origin.from.as_deref(), origin.date.as_deref()),
        (Some(0.01), Some("run.csv"), Some("2026-05-01"))
    );
    assert_eq!((shelf.setting().value("b"), shelf.setting().value("d0")), (Some(0.2), Some(0.0)));
    assert_eq!(shelf.origin("a").unwrap().se, Some(2e-5));
    assert_eq!(file.history()[0].heldout_rms.noise_floor, Some(0.31));
}

#[test]
fn what_is_written_reads_back_as_the_same_with_and_without_documentation() {
    let mut texts = vec![
        FULL.to_owned(),
        "format = 1\n[machine]\nkind = \"joints\"\nn = 2\ngain = [[1, 0.1], [0, 2]]\noffset = [0.0, 0.5]\n".to_owned(),
    ];
    for kind in EffectKind::ALL.into_iter().filter(|kind| *kind != EffectKind::Formula) {
        texts.push(with_effect(&format!("kind = \"{}\"", kind.name())));
    }
    for text in texts {
        let file = ModelFile::parse(&text).unwrap();
        assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file, "{}", file.to_toml());
        assert_eq!(ModelFile::parse(&file.to_documented_toml()).unwrap(), file);
    }
}

#[test]
fn the_documented_defaults_name_every_effect_and_every_parameter() {
    let text = documented_defaults();
    for kind in EffectKind::ALL {
        assert!(text.contains(kind.name()), "{}", kind.name());
        for parameter in kind.definition().parameters {
            assert!(text.contains(&format!("\n# {} = {:?}", parameter.name, parameter.default)), "{}", parameter.name);
        }
    }
    for effect in JointEffect::ALL {
        assert!(text.contains(&format!("\n# kind = \"{}\"", effect.name())), "{}", effect.name());
        for parameter in effect.definition().parameters {
            assert!(text.contains(&format!("\n# {} = {:?}", parameter.name, parameter.default)), "{}", parameter.name);
        }
    }
    let file = ModelFile::parse(&text).unwrap();
    assert_eq!(
        (file.effects().len(), assumed(&text)),
        (0, Vec::new()),
        "the machine is written out, the effects are comments"
    );
    let uncommented =
        text.replace("\n# [[effect]]", "\n[[effect]]").replace("\n# kind = \"backlash\"", "\nkind = \"backlash\"");
    assert!(ModelFile::parse(&uncommented).is_err(), "and they are effects without their `#`");
}

#[test]
fn unknown_keys_and_words_name_their_line_and_the_nearest_known_one() {
    let cases = [
        (
            with_effect("kind = \"cone-friction\"\nmuu = 0.2"),
            "line 6: unknown key `muu` in [[effect]] number 1; did you mean `mu`?",
        ),
        (
            with_effect("kind = \"cone-fricton\""),
            "line 5: `kind` is \"cone-fricton\", which is not known; did you mean \"cone-friction\"?",
        ),
        (
            "format = 1\n[machine]\nkind = \"snake\"\nradius_m = 1.0\n".to_owned(),
            "line 4: unknown key `radius_m` in [machine]",
        ),
        (
            "format = 1\n[machin]\nkind = \"snake\"\n".to_owned(),
            "line 2: unknown key `machin` in the file; did you mean `machine`?",
        ),
        (
            "format = 1\n[machine]\nkind = \"snak\"\n".to_owned(),
            "line 3: `kind` is \"snak\", which is not known; did you mean \"snake\"?",
        ),
    ];
    for (text, expected) in cases {
        assert!(refused(&text).starts_with(expected), "{}", refused(&text));
    }
}

#[test]
fn values_that_cannot_be_are_refused_with_line_key_and_range() {
    let machine = |line: &str| format!("format = 1\n[machine]\nkind = \"snake\"\n{line}\n");
    let cases = [
        (machine("r_m = 0.0"), ["line 4", "r_m is 0"]),
        (machine("e_pa = -54e9"), ["line 4", "e_pa is -54000000000"]),
        (machine("l_m = nan"), ["line 4", "l_m is NaN"]),
        (machine("strain_limit = 0.5"), ["line 4", "strain_limit is 0.5"]),
        (machine("d_inner_m = 0.001"), ["line 4", "d_inner_m"]),
        (machine("l_m = \"long\""), ["line 4", "expected a finite number"]),
        (
            with_effect("kind = \"backlash\"\nhalf_width_m = 0.5"),
            ["line 6", "half_width_m is 0.5, expected 0 to 0.002 m"],
        ),
        (with_effect("kind = \"stiffness-scale\"\neta = -1"), ["line 6", "eta is -1"]),
        (with_effect("kind = \"stiffness-scale\"\neta = nan"), ["line 6", "eta is NaN"]),
        (with_effect("kind = \"backlash\"\nhalf_width_m = { value = 1e-4, se = -1.0 }"), ["line 6", "standard error"]),
        (
            with_effect("kind = \"backlash\"\n[[effect]]\nkind = \"backlash\""),
            ["line 6", "stands in the chain twice, at places 1 and 2"],
        ),
        ("format = 2\n".to_owned(), ["line 1", "`format` is 2"]),
        ("format = 1\n".to_owned(), ["line 1", "`machine` is missing"]),
        ("format = 1\n[machine]\nkind = \"joints\"\nn = 0\n".to_owned(), ["line 4", "1 to 16"]),
        (
            "format = 1\n[machine]\nkind = \"joints\"\nn = 2\ngain = [1.0]\n".to_owned(),
            ["line 5", "has 1 values, expected 2"],
        ),
        (
            "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n[[effect]]\nkind = \"twist\"\n".to_owned(),
            ["line 6", "makes no sense"],
        ),
        ("format = 1\n[machine\n".to_owned(), ["line 2", "correct the TOML"]),
    ];
    for (text, expected) in cases {
        let error = refused(&text);
        assert!(expected.iter().all(|part| error.contains(part)), "{error}\nfor {text}");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn formulas_that_cannot_be_are_refused_with_line_and_name() {
    let formula = |hook: &str, text: &str| {
        with_effect(&format!(
            "kind = \"formula\"\nname = \"f\"\nhook = \"{hook}\"\nformula = \"{text}\"\nparams = {{ a = 1.0 }}"
        ))
    };
    let long = (0..40).map(|k| k.to_string()).collect::<Vec<_>>().join(" + ");
    let cases = [
        (formula("eps", "a * bnd"), "uses \"bnd\""),
        (formula("eps", "a / bend"), "not finite at bend 0"),
        (formula("eps", "a * ln(bend)"), "not finite"),
        (formula("eps", "a * (bend"), "cannot be read"),
        (formula("eps", ""), "cannot be read"),
        (formula("eps", "system(1)"), "uses \"system\""),
        (formula("cmd", "a"), "hook cmd"),
        (formula("nowhere", "a"), "not known"),
        (formula("meas", "a * tau_i"), "not known at hook meas"),
        (formula("eps", &long), "at most 32"),
        (
            with_effect(
                "kind = \"formula\"\nname = \"f\"\nhook = \"eps\"\nformula = \"bend\"\nparams = { bend = 1.0 }",
            ),
            "rename it",
        ),
    ];
    for (text, expected) in cases {
        let error = refused(&text);
        assert!(error.starts_with("line ") && error.contains(expected), "{error}");
    }
}

#[test]
fn a_file_may_need_a_column_and_whoever_runs_it_without_is_told() {
    let file = ModelFile::parse(&with_effect("kind = \"stem-coupling\"")).unwrap();
    let error = file.chain(KnownColumns::default()).unwrap_err().to_string();
    assert!(error.contains("stem-coupling") && error.contains("stem_angle_rad"), "{error}");
    assert!(file.chain(KnownColumns { stem_angle: true, ..KnownColumns::default() }).unwrap().is_some());
}

#[test]
fn a_number_of_a_joint_may_depend_on_a_column_and_a_formula_may_read_one() {
    let joints = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n[[effect]]\n";
    let play = format!(
        "{joints}kind = \"backlash\"\njoint = 1\nhalf_width = 0.3\nby = {{ parameter = \"half_width\", column = \"sheath\", at = 10.0 }}\nslope = 0.02\n"
    );
    let formula = "[[effect]]\nkind = \"formula\"\nname = \"stretch\"\nhook = \"joint\"\nformula = \"k * load\"\nparams = { k = 0.5 }\ncolumns = { load = \"tau\" }\n";
    let file = ModelFile::parse(&format!("{play}{formula}")).unwrap();
    let again = ModelFile::parse(&file.to_toml()).unwrap();
    assert_eq!((again.hash(), again.to_toml()), (file.hash(), file.to_toml()));
    let other = ModelFile::parse(&format!("{}{formula}", play.replace("sheath", "other"))).unwrap();
    assert_ne!(other.hash(), file.hash());
    let refused = file.joint_chain(KnownColumns::default()).unwrap_err().to_string();
    assert_eq!(refused, "effect backlash needs the column sheath, which is not given; provide it or remove the effect");

    let chain = file.joint_chain(KnownColumns { named: true, ..KnownColumns::default() }).unwrap().unwrap();
    assert_eq!(chain.columns(), ["sheath", "tau"]);
    let mut predictor = chain.predictor();
    let mut y = |u: f64, sheath: f64, tau: f64| {
        let columns = [sheath, tau, f64::NAN, f64::NAN];
        predictor.step(&[u], &krait_model::Circumstances { columns, ..krait_model::Circumstances::at(0.0) })[0]
    };
    // Half-widths 0.3, 0.5, 0.5 (a gap is the row before) and none, never below it.
    assert_eq!([y(0.0, 10.0, 0.0), y(1.0, 20.0, 0.0)], [0.0, 0.5]);
    assert_eq!([y(2.0, f64::NAN, 4.0), y(2.0, -1e9, f64::NAN)], [3.5, 4.0]);

    for (from, to, wanted) in [
        ("parameter = \"half_width\"", "parameter = \"joint\"", "it has no such number"),
        ("column = \"sheath\"", "column = \" \"", "a column has a name"),
        ("slope = 0.02", "slopes = 0.02", "slopes"),
    ] {
        let refused = ModelFile::parse(&play.replace(from, to)).unwrap_err().to_string();
        assert!(refused.contains(wanted), "{refused}");
    }
    let snake =
        with_effect("kind = \"formula\"\nname = \"f\"\nhook = \"eps\"\nformula = \"a\"\ncolumns = { a = \"b\" }");
    assert!(refused_formula(&snake).contains("only formulas of joints can read"), "{}", refused_formula(&snake));
}

/// What a file with a wrong formula is refused with.
fn refused_formula(text: &str) -> String {
    ModelFile::parse(text).map_or_else(|refused| refused.to_string(), |_| String::new())
}

#[test]
fn a_bend_beyond_the_strain_of_the_material_is_limited_and_said() {
    let text = "format = 1\n[machine]\nkind = \"snake\"\nstrain_limit = 0.01\n";
    let chain = ModelFile::parse(text).unwrap().chain(KnownColumns::default()).unwrap().unwrap();
    // (0.33 mm / 26 mm) b is 1 % at 45.14 degrees.
    assert!((chain.max_bend_rad().to_degrees() - 45.14).abs() < 0.01);
    let command = chain.compensator().unwrap().step(Vector2::new(1.0, 0.5), &Circumstances::at(0.0));
    let ChainStatus::BeyondStrain { strain, limit } = command.status else { panic!("{:?}", command.status) };
    assert!((strain - 0.33 / 26.0 * 1.25_f64.sqrt()).abs() < 1e-12 && limit == 0.01);
    let limited = chain
        .compensator()
        .unwrap()
        .step(Vector2::new(1.0, 0.5) * (chain.max_bend_rad() / 1.25_f64.sqrt()), &Circumstances::at(0.0));
    assert!((limited.q_tilde_m - command.q_tilde_m).norm() < 1e-15);
}

#[test]
fn fitted_values_are_kept_with_their_origin() {
    let origin =
        Origin { parameter: "eta".into(), se: Some(0.02), from: Some("a.csv".into()), date: Some("2026-06-01".into()) };
    let setting = EffectSetting::new(EffectKind::StiffnessScale).with("eta", 1.3).unwrap();
    let effect = FileEffect::new(setting).with_origin(origin).unwrap();
    let file = ModelFile::new(Machine::Snake(Default::default()), vec![effect], vec![]).unwrap();
    let text = file.to_toml();
    assert!(text.contains(r#"eta = { value = 1.3, se = 0.02, from = "a.csv", date = "2026-06-01" }"#), "{text}");
    assert_eq!(ModelFile::parse(&text).unwrap(), file);
    assert_eq!(ChainSettings::default().transition_m, 20e-6);
}

/// A fit begins at a formula's own numbers and ends elsewhere: the file has the end, of every kind of machine.
#[test]
fn a_formula_is_written_with_the_values_that_it_has_and_not_with_those_it_began_at() {
    for (machine, hook) in [
        ("kind = \"snake\"\n", "meas"),
        ("kind = \"joints\"\nn = 1\n", "joint"),
        ("kind = \"force\"\nn = 1\nunit = \"Nm\"\n", "force"),
    ] {
        let text = format!(
            "format = 1\n[machine]\n{machine}[[effect]]\nkind = \"formula\"\nname = \"own\"\nhook = \"{hook}\"\n\
             formula = \"a * b\"\nparams = {{ a = 0.001, b = 2.0 }}\n"
        );
        let file = ModelFile::parse(&text).unwrap();
        let fitted = FileEffect::new(file.effects()[0].setting().clone().with("a", 0.004).unwrap());
        let file = ModelFile::new(file.machine().clone(), vec![fitted], vec![]).unwrap();
        let again = ModelFile::parse(&file.to_toml()).unwrap();
        let value = |name| again.effects()[0].setting().value(name);
        assert_eq!((value("a"), value("b"), &again), (Some(0.004), Some(2.0), &file), "{}", file.to_toml());
    }
}

#[test]
fn the_guide_holds_every_effect_with_its_equation_and_parameters() {
    let guide = include_str!("../../../docs/physics/effects.md");
    for kind in EffectKind::ALL {
        assert!(guide.contains(&format!("### `{}`", kind.name())), "{}", kind.name());
        if kind != EffectKind::Formula {
            assert!(guide.contains(kind.definition().equation), "{}", kind.name());
        }
        for p in kind.definition().parameters {
            let row =
                format!("| `{}` | {} | {:?} to {:?} | {:?} | {} |", p.name, p.unit, p.low, p.high, p.default, p.source);
            assert!(guide.contains(&row), "{}: {row}", kind.name());
        }
    }
}

#[test]
fn a_snake_s_geometry_is_held_or_free_or_known_with_a_standard_error() {
    let text = "format = 1\n[machine]\nkind = \"snake\"\nl_m = 0.03\nr_m = \"free\"\n\
                e_pa = { value = 5.1e10, se = 2e9, from = \"sheet\", date = \"2026-11-01\" }\n";
    let file = ModelFile::parse(text).unwrap();
    assert_eq!(
        (file.first_open(), ModelFile::parse(&file.to_toml()).unwrap()),
        (Some(("r_m", "[machine]")), file.clone())
    );
    let Machine::Snake(snake) = file.machine() else { panic!("a snake") };
    assert_eq!((snake.parameters.l_m, snake.parameters.r_m, snake.parameters.e_pa), (0.03, 1.684e-3, 5.1e10));
    assert!(matches!(snake.known("e_pa"), Known::Fitted { se, from: Some(from), .. } if *se == 2e9 && from == "sheet"));
    assert_eq!(snake.known("l_m"), &Known::Held);
    for (line, words) in [
        ("strain_limit = \"free\"", "a number"),
        ("r_m = \"open\"", "\"free\""),
        ("r_m = { value = 0.1, se = 1e-4 }", "0.0003 to 0.02"),
        ("r_m = { value = 0.0017, se = -1.0 }", "above zero"),
    ] {
        let refused = ModelFile::parse(&format!("format = 1\n[machine]\nkind = \"snake\"\n{line}\n")).unwrap_err();
        assert!(refused.to_string().contains(words), "{line}: {refused}");
    }
}

#[test]
fn a_value_of_a_snake_s_effect_may_be_left_to_every_fit() {
    let text =
        "format = 1\n[machine]\nkind = \"snake\"\n[[effect]]\nkind = \"camera-offset\"\noffset_x_rad = \"free\"\n";
    let file = ModelFile::parse(text).unwrap();
    assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file);
    assert_eq!(file.first_open(), Some(("offset_x_rad", "camera-offset")));
    let effect = &file.effects()[0];
    assert_eq!((effect.is_free("offset_x_rad"), effect.is_free("offset_y_rad")), (true, false));
    assert!(FileEffect::new(effect.setting().clone()).with_free("offset").is_err());
    let formula =
        "[[effect]]\nkind = \"formula\"\nname = \"own\"\nhook = \"meas\"\nformula = \"k\"\nparams = { k = \"free\" }\n";
    let snake = format!("format = 1\n[machine]\nkind = \"snake\"\n{formula}");
    let refused = ModelFile::parse(&snake).unwrap_err().to_string();
    assert!(refused.contains("expected a number"), "{refused}");
}

#[test]
fn a_value_of_an_effect_of_joints_may_be_left_to_every_fit_but_not_which_joint_it_is_of() {
    let joints = |effect: &str| format!("format = 1\n[machine]\nkind = \"joints\"\nn = 2\n[[effect]]\n{effect}");
    let held =
        "gain = [1.0, 1.0]\noffset = [0.0, 0.0]\n[[effect]]\nkind = \"backlash\"\njoint = 2\nhalf_width = \"free\"\n";
    let file = ModelFile::parse(&joints("").replace("[[effect]]\n", held)).unwrap();
    assert_eq!(ModelFile::parse(&file.to_toml()).unwrap(), file);
    assert_eq!(file.first_open(), Some(("half_width", "backlash")));
    let jaw = "format = 1\n[machine]\nkind = \"snake\"\n[gripper]\nwire_m_per_rad = 2e-3\nrange_deg = [0.0, 60.0]\n\
               max_vel_deg_per_s = 90.0\n[[gripper.effect]]\nkind = \"backlash\"\nhalf_width = \"free\"\n";
    let force = "format = 1\n[machine]\nkind = \"force\"\nn = 1\nunit = \"Nm\"\n[[effect]]\nkind = \"coulomb\"\ntorque = \"free\"\n";
    for text in [
        joints("kind = \"backlash\"\njoint = \"free\"\n"),
        joints("kind = \"cross-coupling\"\njoint = 1\nfrom = \"free\"\n"),
        jaw.to_owned(),
        force.to_owned(),
    ] {
        let refused = ModelFile::parse(&text).unwrap_err().to_string();
        assert!(refused.contains("for the effects of a snake and of joints"), "{refused}");
    }
}

#[test]
fn two_formulas_of_one_name_are_refused_of_every_machine() {
    for (machine, hook) in [
        ("kind = \"snake\"\n", "meas"),
        ("kind = \"joints\"\nn = 1\n", "joint"),
        ("kind = \"force\"\nn = 1\nunit = \"Nm\"\n", "force"),
    ] {
        let one = |name: &str| {
            format!(
                "[[effect]]\nkind = \"formula\"\nname = \"{name}\"\nhook = \"{hook}\"\nformula = \"a\"\nparams = {{ a = 0.1 }}\n"
            )
        };
        let file = |second: &str| format!("format = 1\n[machine]\n{machine}{}{}", one("own"), one(second));
        assert!(ModelFile::parse(&file("other")).is_ok());
        let refused = ModelFile::parse(&file("own")).unwrap_err().to_string();
        assert!(refused.contains("own stands in the chain twice, at places 1 and 2"), "{refused}");
    }
}
