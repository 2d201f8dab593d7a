//! `krait calibrate stem`: the stem's angle from a recording with load cells, as the lab reads recordings.

use super::calibrate::{DISTRIBUTED, cone_of, effect_of, inside_share_of, only_known, replaced, snake_of};
use super::overwrite::refuse_existing;
use super::today;
use crate::cli_calibrate::StemArgs;
use crate::print;
use anyhow::bail;
use krait_calibrate::stem::{BEND_SD_RAD, StemRow, StemSettings, stem};
use krait_calibrate::written;
use krait_lab::Measurements;
use krait_model::model_file::ModelFile;
use std::path::Path;
use std::process::ExitCode;

/// Fits, prints, and writes the file that is asked for.
pub fn run(args: &StemArgs) -> anyhow::Result<ExitCode> {
    if let Some(out) = &args.out {
        refuse_existing(out, "toml", args.force)?;
    }
    let model = &args.files.model;
    let session = args.files.session()?;
    let machine = snake_of(&session.file, model)?;
    only_known(&session.file, model)?;
    let (mu, mu_se) = mu_of(&session.file, model)?;
    let settings = StemSettings {
        machine,
        mu,
        mu_se,
        cone: cone_of(Some(&session.file)),
        inside_share: inside_share_of(Some(&session.file)),
        cell_sd_n: args.cell_sd_n,
        bend_sd_rad: args.bend_sd_deg.to_radians(),
        encoder_sd_m: args.encoder_sd_um * 1e-6,
    };
    let found = stem(&rows(&session.data)?, &settings)?;
    let mut text = found.sentences() + "\n";
    if let Some(out) = &args.out {
        let old = session.file.to_toml();
        replaced(out, &written(Some(&old), &found.calibrated(), &session.data.source, &today())?)?;
        text += &format!("written to {}\n", out.display());
    }
    print::out(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// mu of the cone with its standard error, 0 where the file states none.
fn mu_of(file: &ModelFile, model: &Path) -> anyhow::Result<(f64, f64)> {
    let cone = effect_of(file, "cone-friction").or_else(|| effect_of(file, DISTRIBUTED));
    let Some((cone, mu)) = cone.and_then(|effect| Some((effect, effect.setting().value("mu")?))) else {
        bail!(
            "the model file {} has no friction in the cone (effect cone-friction or distributed-capstan), expected its mu, since only 2 mu phi acts; run \
             `krait calibrate friction` first",
            model.display()
        )
    };
    Ok((mu, cone.origin("mu").and_then(|origin| origin.se).unwrap_or(0.0)))
}

/// The rows as the fit takes them; loads of drives' currents are shown by the lab and count nowhere.
fn rows(data: &Measurements) -> anyhow::Result<Vec<StemRow>> {
    let of = |k: usize| {
        let three = |values: &[f64]| [values[3 * k], values[3 * k + 1], values[3 * k + 2]];
        let bend_sd_rad = data.sigma.as_ref().map_or(f64::NAN, |sigma| sigma[k]);
        if data.is_scored(k) && bend_sd_rad.is_finite() && !BEND_SD_RAD.contains(&bend_sd_rad) {
            bail!(
                "{}, row {}: a bend with a standard deviation of {bend_sd_rad} rad, expected 1e-6 to 0.2 rad; a column \"weight\" \
                 says ratios only, leave it out",
                data.source,
                k + 1
            );
        }
        Ok(StemRow {
            trial: data.trial[k],
            q_tilde_m: three(&data.inputs),
            loads_n: data.counted_loads_n().map_or([f64::NAN; 3], three),
            bend_rad: [data.outputs[2 * k], data.outputs[2 * k + 1]],
            bend_sd_rad,
        })
    };
    (0..data.n_rows()).map(of).collect()
}
