//! Reading a file that somebody names: a regular file of a bounded size, or one sentence that says what it is instead.
//!
//! A named pipe would hang its reader, a device never ends, and a file of gigabytes fills the memory; none of them is what
//! was meant.

use rustix::fs::{FileType, Mode, OFlags, fstat, open};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Most bytes of a configuration, a model file or a truth file: a hundred times the longest that anybody wrote by hand.
pub const CONFIG_BYTES: u64 = 1 << 20;
/// Most bytes of a table of measurements.
pub const TABLE_BYTES: u64 = 1 << 30;
/// For files that are read piece by piece, in memory that does not grow with them.
pub const ANY_BYTES: u64 = u64::MAX;

/// Opens a regular file of at most `max_bytes` bytes.
///
/// # Errors
/// What the kernel said, or what the file is instead ([`io::ErrorKind::InvalidInput`]), or its size
/// ([`io::ErrorKind::FileTooLarge`]).
pub fn regular(path: &Path, max_bytes: u64) -> io::Result<File> {
    // Without NONBLOCK, opening a named pipe waits for its writer; a regular file is read the same with it.
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::NOCTTY | OFlags::CLOEXEC;
    let file = open(path, flags, Mode::empty())?;
    match FileType::from_raw_mode(fstat(&file)?.st_mode) {
        FileType::RegularFile => {}
        other => return Err(io::Error::new(io::ErrorKind::InvalidInput, refusal(other))),
    }
    let file = File::from(file);
    check_size(&file, max_bytes)?;
    Ok(file)
}

/// Looks whether an open file has at most `max_bytes` bytes.
///
/// # Errors
/// Its size ([`io::ErrorKind::FileTooLarge`]).
pub fn check_size(file: &File, max_bytes: u64) -> io::Result<()> {
    let n_bytes = file.metadata()?.len();
    if n_bytes > max_bytes { Err(too_large(n_bytes, max_bytes)) } else { Ok(()) }
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`regular`].
pub fn bytes(path: &Path, max_bytes: u64) -> io::Result<Vec<u8>> {
    bytes_from(&mut regular(path, max_bytes)?, max_bytes)
}

/// The text of a regular file.
///
/// # Errors
/// As [`regular`]; also when it is no UTF-8.
pub fn text(path: &Path, max_bytes: u64) -> io::Result<String> {
    text_from(&mut regular(path, max_bytes)?, max_bytes)
}

/// The text of a stream that ends.
///
/// # Errors
/// As [`text`].
pub fn text_from(source: &mut impl Read, max_bytes: u64) -> io::Result<String> {
    String::from_utf8(bytes_from(source, max_bytes)?).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        io::Error::new(io::ErrorKind::InvalidData, format!("byte {at} is no UTF-8 text"))
    })
}

/// What stands behind the mark with which some programs begin a text of UTF-8.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text)
}

/// A file may grow while it is read, and a stream says its length to nobody.
fn bytes_from(source: &mut impl Read, max_bytes: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    source.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    let n_bytes = bytes.len() as u64;
    if n_bytes > max_bytes { Err(too_large(n_bytes, max_bytes)) } else { Ok(bytes) }
}

fn too_large(n_bytes: u64, max_bytes: u64) -> io::Error {
    let text = format!("it has {n_bytes} bytes or more, expected at most {max_bytes}");
    io::Error::new(io::ErrorKind::FileTooLarge, text)
}

fn refusal(found: FileType) -> String {
    let found = match found {
        FileType::Directory => "a directory",
        FileType::Fifo => "a named pipe",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        FileType::Socket => "a socket",
        _ => "something else",
    };
    format!("it is {found}, expected a regular file")
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, mkfifoat};

    struct Folder(std::path::PathBuf);

    impl Folder {
        fn new(what: &str) -> Self {
            let path = std::env::temp_dir().join(format!("krait-test-input-{what}-{}", std::process::id()));
            std::fs::create_dir_all(&path).expect("made");
            Self(path)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _kept_if_it_cannot_be_removed = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn what_is_no_regular_file_is_refused_at_once_with_what_it_is() {
        let folder = Folder::new("kinds");
        let pipe = folder.0.join("pipe");
        mkfifoat(CWD, &pipe, Mode::RUSR | Mode::WUSR).expect("made");
        for (path, what) in
            [(pipe.as_path(), "a named pipe"), (&folder.0, "a directory"), (Path::new("/dev/zero"), "a device")]
        {
            let error = text(path, CONFIG_BYTES).expect_err(what).to_string();
            assert_eq!(error, format!("it is {what}, expected a regular file"));
        }
    }

    #[test]
    fn a_large_file_is_refused_before_it_is_read_and_one_of_the_largest_size_is_not() {
        let folder = Folder::new("sizes");
        let path = folder.0.join("file");
        let file = File::create(&path).expect("made");
        file.set_len(2 << 30).expect("sparse");
        let error = text(&path, CONFIG_BYTES).expect_err("large").to_string();
        assert_eq!(error, "it has 2147483648 bytes or more, expected at most 1048576");
        std::fs::write(&path, "abcd").expect("written");
        assert_eq!(text(&path, 4).expect("just right"), "abcd");
        assert!(text(&path, 3).is_err());
        std::fs::write(&path, [b'a', 0xff]).expect("written");
        assert!(text(&path, 4).expect_err("no text").to_string().contains("byte 1 is no UTF-8"));
    }
}
