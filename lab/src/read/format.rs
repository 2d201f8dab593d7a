//! Which kind of file somebody gives, told by its first bytes and never by its name.

use super::grid::Grid;
use super::{ReadError, matlab, parquet, ros};
use krait_record::is_foreign;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

/// How an MCAP file begins.
const MCAP_MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// Bytes that tell.
const N_START: u64 = 128;

/// A reader of tables.
pub(super) type ReadGrid = fn(&Path, File) -> Result<Grid, ReadError>;

/// A kind of file.
pub(super) enum Format {
    Csv,
    Krait,
    Grid(ReadGrid),
}

/// A file and its kind.
pub(super) struct Found {
    pub file: File,
    pub format: Format,
}

/// How files begin that are refused, and what they are and what to do.
const REFUSED: [(&[u8], &str); 7] = [
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file, which MATLAB writes as version 7.3; save it with save('run.mat', '-v7')"),
    (b"MATLAB 7.3 MAT-file", "a MATLAB file of version 7.3; save it with save('run.mat', '-v7')"),
    (b"#ROSBAG V", "a bag of ROS 1; convert it to one of ROS 2 in MCAP"),
    (b"SQLite format 3\0", "a database of SQLite; a ROS 2 bag is converted to MCAP with `ros2 bag convert`"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd as a whole; unpack it with `zstd -d`"),
    (b"\x1f\x8b", "compressed with gzip as a whole; unpack it with `gunzip`"),
    (b"PK\x03\x04", "a zip archive or a workbook; unpack it, or save the sheet as CSV"),
];

impl Format {
    /// Opens a file and looks at how it begins.
    pub(super) fn of(path: &Path) -> Result<Found, ReadError> {
        let failed = |source| ReadError::Io { path: path.to_owned(), source };
        let mut file = super::open(path)?;
        let mut start = Vec::new();
        file.by_ref().take(N_START).read_to_end(&mut start).map_err(failed)?;
        file.rewind().map_err(failed)?;
        if let Some((_, what)) = REFUSED.iter().find(|(magic, _)| start.starts_with(magic)) {
            let reason = format!("this is {what}");
            return Err(ReadError::Unusable { path: path.to_owned(), reason });
        }
        let format = match () {
            () if start.starts_with(&MCAP_MAGIC) => match is_foreign(path)? {
                true => Self::Grid(ros::grid),
                false => Self::Krait,
            },
            () if start.starts_with(parquet::MAGIC) => Self::Grid(parquet::grid),
            () if matlab::is_level_5(&start) => Self::Grid(matlab::grid),
            () if matlab::is_level_4(&start) => {
                let reason = "this is a MATLAB file of level 4; save it with save('run.mat', '-v7')".to_owned();
                return Err(ReadError::Unusable { path: path.to_owned(), reason });
            }
            () => Self::Csv,
        };
        Ok(Found { file, format })
    }
}
