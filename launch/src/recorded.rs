//! A recording as the settings of a chain: the configuration, the simulated snake and the model file that it embeds.

use crate::commands::process::{CONFIG_ATTACHMENT, MODEL_ATTACHMENT, TRUTH_ATTACHMENT};
use crate::config::Config;
use crate::device::{DEVICE_KEY, SERIAL_KEY};
use anyhow::Context;
use krait_ipc::message::Compensation;
use krait_record::{Recording, attachment};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The name that most chains have, so that none of it means a name of one's own.
const USUAL_INSTANCE: &str = "main";

/// The instance of a replay: as given, or one of its own, so that it never meets a chain that runs.
pub fn instance_of(given: &str, what: &str) -> String {
    if given == USUAL_INSTANCE { format!("{what}-{}", std::process::id()) } else { given.to_owned() }
}

/// The configuration that a recording was made with. The files that it names are written into `folder`.
///
/// # Errors
/// One sentence: the recording embeds no configuration, or one of another version, or a file cannot be written.
pub fn config_of(recording: &Recording, folder: &Path) -> anyhow::Result<Config> {
    let text = attachment(recording, CONFIG_ATTACHMENT)
        .context("it holds no attachment krait.toml, so nobody knows with what settings its steps were made")?;
    let mut config = Config::parse(text).context("its attachment krait.toml is of another version")?;
    config.slave.truth = unpacked(recording, TRUTH_ATTACHMENT, folder, config.slave.truth.is_some())?;
    config.model = unpacked(recording, MODEL_ATTACHMENT, folder, config.model.is_some())?;
    config.record = krait_record::RecordConfig::default();
    config.check().context("its attachment krait.toml")?;
    Ok(config)
}

/// The same for one pass: a demo changes the mode from pass to pass, and the commands say which it was.
pub fn config_of_pass(config: &Config, compensation: Option<Compensation>) -> Config {
    let mut config = config.clone();
    if let Some(mode) = compensation {
        config.compensate.mode = mode;
    }
    config
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
