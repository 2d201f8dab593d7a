//! Hand controllers: whether this user may open what the kernel shows.

use super::Finding;
use std::fs;

/// Whether raw HID devices can be opened.
pub fn hidraw() -> Finding {
    const NAME: &str = "hidraw";
    let nodes: Vec<_> = fs::read_dir("/dev")
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("hidraw"))
        .map(|entry| entry.path())
        .collect();
    if nodes.is_empty() {
        let meaning = "no HID device is plugged in; recordings and scripts need none";
        return Finding::good(NAME, "no node".to_owned(), meaning);
    }
    let refused: Vec<String> = nodes
        .iter()
        .filter(|node| fs::File::options().read(true).write(true).open(node).is_err())
        .map(|node| node.display().to_string())
        .collect();
    if refused.is_empty() {
        return Finding::good(
            NAME,
            format!("{} nodes, all can be opened", nodes.len()),
            "a hand controller can be read",
        );
    }
    Finding::advice(
        NAME,
        format!("cannot be opened: {}", refused.join(", ")),
        "a hand controller among them cannot be read by this user",
        "krait devices (it prints the udev rule that is missing)".to_owned(),
    )
}
