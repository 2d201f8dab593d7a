//! What a person has written or measured is not overwritten without being asked to.

use anyhow::bail;
use std::path::Path;

/// Refuses to go on when a file is already there, before any work is done for it.
///
/// # Errors
/// One sentence that names the file.
pub fn refuse_existing(path: &Path, force: bool) -> anyhow::Result<()> {
    if force || !path.exists() {
        return Ok(());
    }
    bail!("{} is already there; name another file, or say --force to overwrite it", path.display())
}
