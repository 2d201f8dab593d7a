//! A recording as the settings of a chain: the configuration, the simulated snake and the model file that it embeds.

use crate::commands::process::{BUILT_IN_ATTACHMENT, TRUTH_ATTACHMENT};
use crate::config::Config;
use crate::device::{DEVICE_KEY, SERIAL_KEY};
use crate::old_settings;
use anyhow::{Context, bail};
use krait_bridge::CompensateConfig;
use krait_model::ModelHash;
use krait_model::model_file::ModelFile;
use krait_record::{CONFIG_ATTACHMENT, MODEL_ATTACHMENT, Recording, attachment};
use krait_slave::OnDisable;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The name that most chains have, so that none of it means a name of one's own.
const USUAL_INSTANCE: &str = "main";

/// The instance of a replay: as given, or one of its own, so that it never meets a chain that runs.
pub fn instance_of(given: &str, what: &str) -> String {
    if given == USUAL_INSTANCE { format!("{what}-{}", std::process::id()) } else { given.to_owned() }
}

/// What the parts of a recording are known to lack, a sentence each.
pub fn missing(parts: &[Recording]) -> Vec<String> {
    parts.iter().flat_map(|part| &part.contents().missing).map(ToString::to_string).collect()
}

/// The configuration that a recording was made with; the files that it names are not there.
///
/// # Errors
/// One sentence: the recording embeds no configuration, or one of another version.
pub fn settings_of(recording: &Recording) -> anyhow::Result<Config> {
    let text = attachment(recording, CONFIG_ATTACHMENT)
        .context("it holds no attachment krait.toml, so nobody knows with what settings its steps were made")?;
    let text = old_settings::taken_over(text)?.unwrap_or_else(|| text.to_owned());
    let mut config = Config::parse(&text).context("its attachment krait.toml is of another version")?;
    if !text.contains("mismatch_trip_floors") {
        // Made before shape and model were compared: nothing of it was judged.
        let never = CompensateConfig::NO_MISMATCH_FLOORS;
        let own = &mut config.compensate;
        (own.mismatch_warn_floors, own.mismatch_trip_floors, own.mismatch_wide_floors) = (never, never, never);
    }
    if !text.contains("on_disable") {
        // Made before lines were relaxed: power went at once.
        config.slave.drive.on_disable = OnDisable::PowerOff;
    }
    if !text.contains("disable_relax_m") {
        // Made when a disable went no further than a fault.
        let drive = &mut config.slave.drive;
        (drive.disable_relax_m, drive.disable_relax_ms) = (drive.relax_m, drive.relax_ms);
    }
    Ok(config)
}

/// The configuration that a recording was made with. The files that it names are written into `folder`.
///
/// # Errors
/// One sentence: the recording embeds no configuration, or one of another version, or a file cannot be written.
pub fn config_of(recording: &Recording, folder: &Path) -> anyhow::Result<Config> {
    let mut config = settings_of(recording)?;
    config.slave.truth = unpacked(recording, TRUTH_ATTACHMENT, folder, config.slave.truth.is_some())?;
    config.model = unpacked(recording, MODEL_ATTACHMENT, folder, config.model.is_some())?;
    config.record = krait_record::RecordConfig::default();
    // What was driven then is not driven now because somebody opens a recording.
    config.slave.drive = krait_slave::DriveConfig::default();
    config.check().context("its attachment krait.toml")?;
    Ok(config)
}

/// The same for one pass: a demo changes the model from pass to pass, and the commands say which it was.
///
/// # Errors
/// One sentence: the recording embeds no such model, or it cannot be written into `folder`.
pub fn config_of_pass(
    recording: &Recording,
    config: &Config,
    model: Option<ModelHash>,
    folder: &Path,
) -> anyhow::Result<Config> {
    let mut config = config.clone();
    let Some(hash) = model else { return Ok(config) };
    let path = folder.join(format!("{hash}.toml"));
    std::fs::write(&path, model_text(recording, hash)?)
        .with_context(|| format!("{} could not be written", path.display()))?;
    config.model = Some(path);
    Ok(config)
}

/// The text of the model file with a hash that a recording embeds.
///
/// # Errors
/// One sentence: it embeds no such file.
pub fn model_text(recording: &Recording, hash: ModelHash) -> anyhow::Result<String> {
    let is_model = |name: &str| name == MODEL_ATTACHMENT || name.starts_with(BUILT_IN_ATTACHMENT);
    let attachments = recording.contents().attachments.iter().filter(|attachment| is_model(&attachment.name));
    let mut texts = attachments.map(|attachment| String::from_utf8_lossy(&attachment.data).into_owned());
    match texts.find(|text| ModelFile::parse(text).is_ok_and(|file| file.hash() == hash)) {
        Some(text) => Ok(text),
        None => bail!("its messages rest on the model {hash}, and it embeds no such model file"),
    }
}

/// Version and git revision that made a recording.
pub fn made_with(recording: &Recording) -> String {
    format!("{} ({})", word(recording, "krait_version"), word(recording, "git_revision"))
}

/// What a recording says about its run and the operator's device.
pub fn about(recording: &Recording) -> BTreeMap<&'static str, String> {
    let said = |key| (key, word(recording, key).to_owned());
    BTreeMap::from([
        said("run_id"),
        said("host"),
        said(DEVICE_KEY),
        said(SERIAL_KEY),
        ("recorded_with", made_with(recording)),
    ])
}

/// The operator's device and its serial number.
pub fn device_of(recording: &Recording) -> [String; 2] {
    [DEVICE_KEY, SERIAL_KEY].map(|key| word(recording, key).to_owned())
}

/// A value of the metadata record `krait`; `unknown` where it has none.
fn word<'a>(recording: &'a Recording, key: &str) -> &'a str {
    let about = recording.contents().metadata.get("krait");
    about.and_then(|about| about.get(key)).map_or("unknown", String::as_str)
}

/// Version and git revision of this program.
pub fn this_program() -> String {
    let about = krait_record::About::run("none", &std::collections::BTreeMap::new(), Vec::new());
    let word = |key: &str| about.metadata.get(key).map_or("unknown", String::as_str);
    format!("{} ({})", word("krait_version"), word("git_revision"))
}

fn unpacked(recording: &Recording, name: &str, folder: &Path, is_named: bool) -> anyhow::Result<Option<PathBuf>> {
    if !is_named {
        return Ok(None);
    }
    let text = attachment(recording, name)
        .with_context(|| format!("its configuration names a file that it should embed as {name} and does not"))?;
    let path = folder.join(name);
    std::fs::write(&path, text).with_context(|| format!("{} could not be written", path.display()))?;
    Ok(Some(path))
}
