//! Raw samples: what every figure is computed from, kept so that anyone can compute it again.

use crate::BenchError;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

/// Hops of every chain: four processes in a row.
pub const N_HOPS: usize = 3;
/// Words of one sample in a file between two processes.
const N_WORDS: usize = 2 + N_HOPS;

/// One message on its way through a chain.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RelaySample {
    /// Position in the source's sequence, from 1.
    pub sequence: u64,
    /// When the source had it, CLOCK_MONOTONIC, ns.
    pub source_ns: i64,
    /// When the process at the end of each hop had it, CLOCK_MONOTONIC, ns; the last is the end of the chain.
    pub arrived_ns: [i64; N_HOPS],
}

impl RelaySample {
    /// From the source to the end of the chain, ns.
    pub fn latency_ns(&self) -> i64 {
        self.arrived_ns[N_HOPS - 1] - self.source_ns
    }

    /// Of one hop, 0 to 2, ns.
    pub fn hop_ns(&self, hop: usize) -> i64 {
        let from_ns = if hop == 0 { self.source_ns } else { self.arrived_ns[hop - 1] };
        self.arrived_ns[hop] - from_ns
    }

    fn words(&self) -> [u64; N_WORDS] {
        let [a, b, c] = self.arrived_ns.map(i64::cast_unsigned);
        [self.sequence, self.source_ns.cast_unsigned(), a, b, c]
    }

    fn from_words([sequence, source, a, b, c]: [u64; N_WORDS]) -> Self {
        Self { sequence, source_ns: source.cast_signed(), arrived_ns: [a, b, c].map(u64::cast_signed) }
    }
}

/// Writes the samples of a sink for the process that started it.
///
/// # Errors
/// [`BenchError::File`].
pub(crate) fn write_samples(path: &Path, samples: &[RelaySample]) -> Result<(), BenchError> {
    let write = || {
        let mut out = BufWriter::new(File::create(path)?);
        for word in samples.iter().flat_map(RelaySample::words) {
            out.write_all(&word.to_le_bytes())?;
        }
        out.flush()
    };
    write().map_err(BenchError::file("written", path))
}

/// Reads what a sink has written.
///
/// # Errors
/// [`BenchError::File`].
pub fn read_samples(path: &Path) -> Result<Vec<RelaySample>, BenchError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| BufReader::new(file).read_to_end(&mut bytes))
        .map_err(BenchError::file("read", path))?;
    let word = |bytes: &[u8]| bytes.try_into().map_or(0, u64::from_le_bytes);
    let rows = bytes.chunks_exact(N_WORDS * 8);
    Ok(rows.map(|row| RelaySample::from_words(core::array::from_fn(|i| word(&row[i * 8..i * 8 + 8])))).collect())
}

/// Writes all samples of a measurement as a table: chain, round, sequence, source stamp, and the latency of each hop, ns.
///
/// # Errors
/// [`BenchError::File`].
pub fn write_csv<'a>(
    path: &Path,
    comment: &str,
    rounds: impl IntoIterator<Item = (&'a str, usize, &'a [RelaySample])>,
) -> Result<(), BenchError> {
    let write = || {
        let mut out = BufWriter::new(File::create(path)?);
        for line in comment.lines() {
            writeln!(out, "# {line}")?;
        }
        writeln!(out, "chain,round,sequence,source_ns,hop_1_ns,hop_2_ns,hop_3_ns")?;
        for (chain, round, samples) in rounds {
            for sample in samples {
                let [a, b, c] = core::array::from_fn(|hop| sample.hop_ns(hop));
                writeln!(out, "{chain},{round},{},{},{a},{b},{c}", sample.sequence, sample.source_ns)?;
            }
        }
        out.flush()
    };
    write().map_err(BenchError::file("written", path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_survive_the_way_through_a_file_and_hops_add_up() {
        let sample = RelaySample { sequence: 7, source_ns: -5, arrived_ns: [10, 30, 100] };
        let path = std::env::temp_dir().join(format!("krait-bench-samples-{}", std::process::id()));
        write_samples(&path, &[sample, RelaySample::default()]).expect("written");
        assert_eq!(read_samples(&path).expect("read"), vec![sample, RelaySample::default()]);
        std::fs::remove_file(&path).expect("removed");
        assert_eq!((0..N_HOPS).map(|hop| sample.hop_ns(hop)).sum::<i64>(), sample.latency_ns());
    }
}
