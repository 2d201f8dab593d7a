//! Settings of recordings that were made before the machine stood in the model file: taken over where they say what a built-in
//! model says now, refused in one sentence where they do not.

use anyhow::{Context, bail};
use krait_model::MachineParameters;
use krait_model::oracle::{F_S_N, MU};
use toml::{Table, Value};

/// Keys of tables that are gone, or that a model file holds now.
const GONE: [(&str, &[&str]); 3] = [
    ("compensate", &["mode", "eta", "lambda_m", "transition_m", "eta_rate_per_s", "lambda_rate_m_per_s"]),
    ("estimate", &["memory_s"]),
    ("resolve", &["late_us"]),
];
/// What the model file takes the place of, and how to go on.
const ADVICE: &str =
    "write it into a model file, and replay the inputs with --config NEW.toml --replace compensate --model FILE";

/// The settings in today's keys; `None` for a text that is of today or no TOML at all.
///
/// # Errors
/// One sentence: the settings describe a machine or a compensation that no built-in model is.
pub fn taken_over(text: &str) -> anyhow::Result<Option<String>> {
    let Ok(mut root) = text.parse::<Table>() else { return Ok(None) };
    let is_old = root.contains_key("machine") || word(&root, "mode").is_some();
    if !is_old {
        return Ok(None);
    }
    if let Some(machine) = root.remove("machine") {
        check_machine(&machine)?;
    }
    for (key, usual) in [("eta", 1.0), ("lambda_m", 0.0), ("transition_m", 20e-6)] {
        let found = root.get("compensate").and_then(|own| own.get(key)).and_then(Value::as_float).unwrap_or(usual);
        if found != usual {
            bail!("[compensate] {key} = {found} stands in its settings, which the model file holds now: {ADVICE}");
        }
    }
    let mode = word(&root, "mode").map(str::to_owned);
    for (table, keys) in GONE {
        let Some(own) = root.get_mut(table).and_then(Value::as_table_mut) else { continue };
        for key in keys {
            own.remove(*key);
        }
    }
    match mode.as_deref() {
        Some("model") | None => {}
        Some(mode) => {
            root.remove("model");
            root.insert("compensation".to_owned(), Value::String(mode.to_owned()));
        }
    }
    toml::to_string(&root).context("its settings could not be written in today's keys").map(Some)
}

fn word<'a>(root: &'a Table, key: &str) -> Option<&'a str> {
    root.get("compensate")?.get(key)?.as_str()
}

fn check_machine(machine: &Value) -> anyhow::Result<()> {
    let usual = MachineParameters::default();
    let usual = [
        ("l_m", usual.l_m),
        ("r_m", usual.r_m),
        ("e_pa", usual.e_pa),
        ("d_outer_m", usual.d_outer_m),
        ("d_inner_m", usual.d_inner_m),
        ("l_d_m", usual.l_d_m),
        ("l_c_m", usual.l_c_m),
        ("phi_rad", usual.phi_rad),
        ("mu", MU),
        ("f_s_n", F_S_N),
    ];
    for (key, usual) in usual {
        let found = machine.get(key).and_then(Value::as_float).unwrap_or(usual);
        if found != usual {
            bail!("[machine] {key} = {found} stands in its settings, which the model file holds now: {ADVICE}");
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::in_force::Compensation;

    #[test]
    fn settings_of_the_version_before_become_todays_where_a_built_in_model_says_the_same() {
        let old = "[machine]\nl_m = 0.026\nmu = 0.1727\n[resolve]\nmax_bend_rad = 1.2\nlate_us = 0.0\n[compensate]\n\
                   mode = \"naive\"\neta = 1.0\nmax_load_n = 40.0\n[estimate]\nmemory_s = 60.0\n";
        let config = Config::parse(&taken_over(old).expect("usual").expect("old")).expect("today's");
        assert_eq!((config.compensation, config.model.is_none()), (Compensation::Naive, true));
        assert_eq!((config.resolve.max_bend_rad, config.compensate.max_load_n), (1.2, 40.0));
        assert_eq!(taken_over(&Config::default().to_toml().expect("toml")).expect("today's"), None);
    }

    #[test]
    fn another_machine_is_refused_with_the_way_to_go_on() {
        let error = taken_over("[machine]\nr_m = 0.0015\n").expect_err("another").to_string();
        assert!(error.starts_with("[machine] r_m = 0.0015") && error.contains("--model FILE"), "{error}");
    }
}
