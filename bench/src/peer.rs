//! Relays whose processes are programs of their own, because what they need is not linked into krait: where such a program
//! is looked for, what to do where there is none, and how a process of krait becomes one.

use crate::stage::{StageOptions, words_path};
use crate::{BenchError, ChainKind, Plan};
use krait_ipc::WaitMode;
use std::fs::File;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A program that is one process of a relay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Peer {
    program: &'static str,
    /// What makes it, in the folder of krait's source.
    install: &'static str,
}

impl Peer {
    /// The program of a chain, where it has one.
    pub(crate) fn of(kind: ChainKind) -> Option<Self> {
        match kind {
            ChainKind::CycloneDds => Some(Self {
                program: "krait-relay-cyclonedds",
                install: "sudo apt-get install build-essential cyclonedds-dev cyclonedds-tools && make -C bench/peers/cyclonedds install",
            }),
            ChainKind::Zenoh => {
                Some(Self { program: "krait-relay-zenoh", install: "cargo install --locked --path bench/peers/zenoh" })
            }
            _ => None,
        }
    }

    /// Beside the krait program, then on PATH.
    pub(crate) fn find(self) -> Option<PathBuf> {
        let krait = std::env::current_exe().ok();
        let beside = krait.as_deref().and_then(Path::parent).map(Path::to_owned);
        let path = std::env::var_os("PATH").unwrap_or_default();
        self.find_in(beside.into_iter().chain(std::env::split_paths(&path)))
    }

    fn find_in(self, folders: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
        let is_program =
            |path: &PathBuf| path.metadata().is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0);
        folders.into_iter().map(|folder| folder.join(self.program)).find(is_program)
    }

    /// The sentence for a machine that does not have it.
    pub(crate) fn missing(self) -> String {
        format!(
            "the program {} is neither beside krait nor on PATH; in the folder of krait's source: {}",
            self.program, self.install
        )
    }

    /// Turns this process into one of the relay. Priority and cores that it was given stay with it; what it says on standard
    /// error is kept in the folder of the round.
    pub(crate) fn become_it(self, options: &StageOptions, plan: &Plan) -> BenchError {
        let failed = |what: String| BenchError::Process { chain: options.kind.name(), role: options.role.name(), what };
        let Some(program) = self.find() else { return failed(format!("could not be started: {}", self.missing())) };
        let words = words_path(&options.folder, options.role);
        let file = match File::create(&words) {
            Ok(file) => file,
            Err(error) => return BenchError::file("made", &words)(error),
        };
        let error = Command::new(&program).args(arguments(options, plan)).stderr(file).exec();
        failed(format!("could not be started from {}: {error}", program.display()))
    }
}

/// Everything that the plan says, so that a program needs not read JSON.
fn arguments(options: &StageOptions, plan: &Plan) -> Vec<std::ffi::OsString> {
    let wait = if plan.wait == WaitMode::Polling { "polling" } else { "blocking" };
    let pairs = [
        ("--role", options.role.name().to_owned()),
        ("--prefix", options.prefix.clone()),
        ("--rate-hz", plan.rate_hz.to_string()),
        ("--payload-bytes", plan.payload_bytes.to_string()),
        ("--warm-up-s", plan.warm_up_s().to_string()),
        ("--round-s", plan.round_s().to_string()),
        ("--wait", wait.to_owned()),
        ("--lock-memory", plan.realtime.lock_memory.to_string()),
    ];
    let mut arguments = vec!["--folder".into(), options.folder.clone().into_os_string()];
    arguments.extend(pairs.into_iter().flat_map(|(name, value)| [name.into(), value.into()]));
    arguments
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_program_is_found_in_the_first_folder_that_can_run_it_and_its_absence_is_told_with_the_way_to_have_it() {
        let peer = Peer::of(ChainKind::Zenoh).expect("a program of its own");
        let root = std::env::temp_dir().join(format!("krait-bench-peers-{}", std::process::id()));
        let folders = ["none", "folder", "text", "program", "later"].map(|name| root.join(name));
        for folder in &folders[2..] {
            fs::create_dir_all(folder).expect("made");
            fs::write(folder.join(peer.program), "").expect("written");
        }
        fs::create_dir_all(folders[1].join(peer.program)).expect("made");
        for (folder, mode) in [(2, 0o644), (3, 0o755), (4, 0o755)] {
            let program = folders[folder].join(peer.program);
            fs::set_permissions(program, fs::Permissions::from_mode(mode)).expect("allowed");
        }
        let (found, not_found) = (peer.find_in(folders.clone()), peer.find_in(folders[..3].to_vec()));
        fs::remove_dir_all(&root).expect("removed");
        assert_eq!(found, Some(folders[3].join(peer.program)));
        assert_eq!(not_found, None, "neither a folder nor a file that cannot be run is a program");
        for word in ["krait-relay-zenoh", "PATH", "cargo install --locked --path bench/peers/zenoh"] {
            assert!(peer.missing().contains(word), "{}", peer.missing());
        }
    }

    #[test]
    fn the_way_to_have_each_program_names_a_folder_that_is_there() {
        for kind in ChainKind::ALL {
            let Some(peer) = Peer::of(kind) else { continue };
            let folder = peer.install.split(' ').find_map(|word| word.strip_prefix("bench/")).expect("a folder");
            assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder).is_dir(), "{folder}");
        }
        assert_eq!(Peer::of(ChainKind::FloorFutex), None);
    }
}
