//! What the tests of every procedure share: noise, a user who answers from a bench, and counting over seeds.

#![allow(
    dead_code,
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "each test uses a part; a panic is how a test fails"
)]

pub mod pictures;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::cell::RefCell;
use std::io::{BufReader, Read};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Seeds of each procedure.
pub const N_SEEDS: u64 = 100;

/// Standard normal numbers.
pub struct Noise(ChaCha8Rng);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn next(&mut self) -> f64 {
        let mut uniform = || (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let (a, b) = (uniform(), uniform());
        (-2.0 * (1.0 - a).ln()).sqrt() * (core::f64::consts::TAU * b).cos()
    }
}

/// A user: each answer is asked for when the dialogue reads it.
pub struct User<F>(F);

impl<F: FnMut() -> Option<String>> User<F> {
    pub fn new(answer: F) -> BufReader<Self> {
        BufReader::with_capacity(256, Self(answer))
    }
}

impl<F: FnMut() -> Option<String>> Read for User<F> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let Some(answer) = (self.0)() else { return Ok(0) };
        let line = format!("{answer}\n");
        buffer[..line.len()].copy_from_slice(line.as_bytes());
        Ok(line.len())
    }
}

/// A bench that both the robot and the user look at.
pub fn shared<T>(bench: T) -> Rc<RefCell<T>> {
    Rc::new(RefCell::new(bench))
}

/// A file of this test's own, which goes with it and takes what was moved aside along.
pub struct Fresh(PathBuf);

impl Deref for Fresh {
    type Target = Path;
    fn deref(&self) -> &Path {
        &self.0
    }
}

impl AsRef<Path> for Fresh {
    fn as_ref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Fresh {
    fn drop(&mut self) {
        // What was never made need not go.
        let _none_is_fine = std::fs::remove_file(&self.0);
        let mut aside = self.0.clone().into_os_string();
        aside.push(".cut");
        let _none_is_fine = std::fs::remove_file(aside);
    }
}

/// A file of this test's own that does not exist yet; in memory where there is such a place, for each reading is synced.
pub fn fresh(name: &str) -> Fresh {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory } else { Path::new(env!("CARGO_TARGET_TMPDIR")) };
    let path = folder.join(format!("krait-calibrate-{name}-{}.csv", std::process::id()));
    if path.exists() {
        std::fs::remove_file(&path).unwrap();
    }
    Fresh(path)
}

/// Values with their standard errors over seeds, against the truth: of 100, at least 90 within two standard errors and a
/// spread of 0.75 to 1.25 of the mean stated error; of fewer, what so few can tell.
pub fn honest(name: &str, found: &[(f64, f64)], truth: f64) {
    let n = found.len() as f64;
    let within = found.iter().filter(|(value, se)| (value - truth).abs() <= 2.0 * se).count();
    let mean = found.iter().map(|f| f.0).sum::<f64>() / n;
    let spread = (found.iter().map(|f| (f.0 - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
    let stated = found.iter().map(|f| f.1).sum::<f64>() / n;
    println!(
        "{name}: mean {mean:.6e} of {truth:.6e}, {within} of {n} within 2 se, spread {:.2} of the stated {stated:.2e}",
        spread / stated
    );
    let (part, apart) = if n >= 100.0 { (0.9, 0.25) } else { (0.8, 0.4) };
    assert!(within as f64 >= part * n, "{name}: {within} of {n} within two standard errors");
    assert!((spread / stated - 1.0).abs() <= apart, "{name}: spread {spread:e}, stated {stated:e}");
}
