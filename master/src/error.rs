//! What can go wrong on the operator's side, each in one sentence: what, where, expected, found, what to do.

use krait_ipc::IpcError;
use std::path::PathBuf;

/// The master could not start, or could not go on.
#[derive(Debug, thiserror::Error)]
pub enum MasterError {
    /// A channel failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// A setting is out of its range.
    #[error(transparent)]
    Setting(#[from] krait_ipc::setting::SettingError),
    /// Two settings do not fit each other.
    #[error("[master] {field} = {found}: expected {expected}; correct it in the configuration")]
    Config {
        /// The setting.
        field: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// A setting of the pose sender does not fit.
    #[error("[master.pose] {field} = {found}: expected {expected}; correct it in the configuration")]
    Pose {
        /// The setting.
        field: &'static str,
        /// What was given.
        found: String,
        /// What is allowed.
        expected: &'static str,
    },
    /// The address for poses cannot be had.
    #[error(
        "poses cannot be listened for at {address}: {source}; name an address of this machine and a free port with `[master.pose] listen` or `krait run --listen`"
    )]
    Listen {
        /// The address, or that there is none.
        address: String,
        /// What the kernel said.
        source: std::io::Error,
    },
    /// A file could not be read or written.
    #[error("{} could not be {doing}: {source}; check that the path, its permissions and the disk are right", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// `read` or `written`.
        doing: &'static str,
        /// What the kernel said.
        source: std::io::Error,
    },
    /// A file is larger than krait reads into memory.
    #[error("{file} has more than {limit_bytes} bytes, the most that is read; give a shorter one")]
    TooLarge {
        /// The file.
        file: String,
        /// The limit, bytes.
        limit_bytes: u64,
    },
    /// A report recording is truncated, foreign or damaged.
    #[error("report recording {file}, line {line}: expected {expected}, found {found}; {remedy}")]
    Recording {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A script is wrong somewhere.
    #[error("script {file}, line {line}, column {column}: expected {expected}, found {found}; correct that field")]
    Script {
        /// The file.
        file: String,
        /// Line, from 1.
        line: usize,
        /// Column of the table, from 1.
        column: usize,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// The plan of an experiment is wrong somewhere.
    #[error("plan {file}: expected {expected}, found {found}; let `krait experiment` write it")]
    Plan {
        /// The file.
        file: String,
        /// What should be.
        expected: String,
        /// What is.
        found: String,
    },
    /// A profile is wrong somewhere, or its device is not as it says.
    #[error("profile {file}, {place}: expected {expected}, found {found}; correct it in the profile (docs/hands.md)")]
    Profile {
        /// The file, or the name of the profile.
        file: String,
        /// Where in it.
        place: String,
        /// What should stand there.
        expected: String,
        /// What stands there.
        found: String,
    },
    /// A profile of any mouse, keyboard or pedal, and nobody has said which one.
    #[error(
        "profile {}: expected the node of the device that shall be taken, found none; no mouse, keyboard or pedal is taken unasked: name yours with --node or `[master] node` (`krait devices` lists them)", profile.display()
    )]
    NoNode {
        /// The profile.
        profile: PathBuf,
    },
    /// Two devices of one hand say the same.
    #[error(
        "{what} of the hand comes from both {first} and {second}: expected one device for each axis and button; leave it out of the profile of one of them (docs/hands.md)"
    )]
    Claimed {
        /// The axis or button.
        what: String,
        /// One device.
        first: String,
        /// The other.
        second: String,
    },
    /// Two profiles of one hand are of one device.
    #[error(
        "the profiles {first} and {second} are of the same device {}: expected a device for each; name the other one's `node` in [master] or [[master.beside]] (`krait devices` lists them)",
        node.display()
    )]
    SameDevice {
        /// One profile.
        first: String,
        /// The other.
        second: String,
        /// The device's node.
        node: PathBuf,
    },
    /// A keyboard's keys are held down while it shall be taken.
    #[error(
        "hand controller {name} at {path} is not taken while {keys} is held down: whoever hears it now would never hear it let go; let go of all keys and start again"
    )]
    KeysHeld {
        /// Its name.
        name: String,
        /// Its node.
        path: String,
        /// The keys.
        keys: String,
    },
    /// No input device is that of the profile.
    #[error(
        "no hand controller of the profile was found: looked for {looked_for}, the input devices here are {present}; plug it in, or name yours in the profile"
    )]
    NoInput {
        /// What was looked for.
        looked_for: String,
        /// What is there.
        present: String,
    },
    /// An input device cannot be taken.
    #[error(
        "hand controller {name} at {path} cannot be taken ({source}); end another program that holds it, or plug it in again"
    )]
    Input {
        /// Its name.
        name: String,
        /// Its node.
        path: String,
        /// What the kernel said.
        source: std::io::Error,
    },
    /// A calibration did not find what a profile needs.
    #[error(
        "the calibration of {name} cannot be used: {found}; nothing is written: do it again, or give a profile of only the axes that shall be used with --profile"
    )]
    Calibration {
        /// The device.
        name: String,
        /// What is wrong with which axis.
        found: String,
    },
    /// spacenavd cannot be heard.
    #[error(
        "spacenavd cannot be heard at {}: {source}; start it (`sudo systemctl start spacenavd`), name its socket in `spacenavd` of [master], or leave that out to read the device without it",
        path.display()
    )]
    Spacenavd {
        /// Its socket.
        path: PathBuf,
        /// What the kernel said.
        source: std::io::Error,
    },
    /// No such device is plugged in.
    #[error(
        "no hand controller was found: looked for {looked_for}, the HID devices here are {present}; plug it in, or name yours in the setting `device` as \"vid:pid\""
    )]
    NoDevice {
        /// What was looked for.
        looked_for: String,
        /// What is there.
        present: String,
    },
    /// The device is there but may not be opened.
    #[error(
        "hand controller {name} at {path} may not be opened ({source}); put the line `{rule}` into {rules_file}, run `sudo udevadm control --reload && sudo udevadm trigger`, and plug it in again"
    )]
    Unreadable {
        /// Its name.
        name: String,
        /// Its node.
        path: String,
        /// What the kernel said.
        source: std::io::Error,
        /// The udev rule that allows it.
        rule: String,
        /// The file for that rule.
        rules_file: &'static str,
    },
    /// The device is another's.
    #[error(
        "hand controller {name} at {path} is read by another krait; end that chain or `krait devices`, or name another device in the setting `device` as \"vid:pid:serial\""
    )]
    HandInUse {
        /// Its name.
        name: String,
        /// Its node.
        path: String,
    },
    /// Any other failure of the HID system.
    #[error(
        "HID failed while {doing}: {source_text}; check that /sys and /dev are mounted, and plug the device in again"
    )]
    Hid {
        /// What was being done.
        doing: &'static str,
        /// What hidapi said.
        source_text: String,
    },
    /// A thread could not be started.
    #[error("the thread {name} could not be started: {source}; check the limit on processes (`ulimit -u`)")]
    Thread {
        /// The thread.
        name: &'static str,
        /// What the kernel said.
        source: std::io::Error,
    },
}
