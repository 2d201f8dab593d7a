//! A step of the chain costs at most 1.2 times the instructions of the same step written straight-line with hand-derived slopes.
//!
//! Counted by callgrind on this very test program, which runs itself; where valgrind is missing, or in a debug build, the test says
//! so and counts nothing.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a panic is how a test fails")]

mod straight;

use krait_model::{ChainCompensator, Circumstances};
use nalgebra::Vector2;
use std::hint::black_box;
use std::process::Command;
use straight::{StraightLine, four, four_by_hand, motion};

const N_STEPS: usize = 2000;
const WHAT: &str = "KRAIT_COUNTED_STEPS";

#[test]
fn the_two_steps_compute_the_same() {
    let (mut chain, mut straight) = (four().compensator().unwrap(), four_by_hand());
    for (k, b) in motion(20_000).into_iter().enumerate() {
        let at = Circumstances::at(k as f64 * 1e-3);
        let (ours, theirs) = (chain.step(b, &at), straight.step(b, &at));
        assert!((ours.q_tilde_m - theirs.q_tilde_m).norm() < 1e-12, "{k}: {ours:?} {theirs:?}");
        assert!((ours.tau_tilde_n - theirs.tau_tilde_n).norm() < 1e-6 && (ours.tau_n - theirs.tau_n).norm() < 1e-10);
        assert!((ours.alpha_m_per_rad - theirs.alpha_m_per_rad).norm() < 1e-12, "{k}");
        assert!((ours.j_tilde_rad_per_m - theirs.j_tilde_rad_per_m).norm() < 1e-9 * theirs.j_tilde_rad_per_m.norm());
    }
}

#[test]
fn a_step_costs_at_most_a_fifth_more_instructions_than_straight_line() {
    let inputs = motion(N_STEPS);
    match std::env::var(WHAT).as_deref() {
        Ok("chain") => return count_chain_steps(&mut four().compensator().unwrap(), &inputs),
        Ok("straight") => return count_straight_steps(&mut four_by_hand(), &inputs),
        _ => {}
    }
    if cfg!(debug_assertions) || Command::new("valgrind").arg("--version").output().is_err() {
        println!("SKIPPED: instruction counts need a release build and valgrind");
        return;
    }
    let (chain, straight) = (counted("chain"), counted("straight"));
    let ratio = chain as f64 / straight as f64;
    println!(
        "instructions per step: chain {}, straight-line {}, ratio {ratio:.3}",
        chain / N_STEPS as u64,
        straight / N_STEPS as u64
    );
    assert!(straight > 100 * N_STEPS as u64, "the straight-line steps were not counted");
    assert!(ratio <= 1.2, "{ratio}");
}

/// Instructions of one kind of step, by running this program under callgrind.
fn counted(what: &str) -> u64 {
    let out = std::env::temp_dir().join(format!("krait-callgrind-{what}-{}", std::process::id()));
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--collect-atstart=no"])
        .arg(format!("--toggle-collect=*count_{what}_steps*"))
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "a_step_costs_at_most_a_fifth_more_instructions_than_straight_line", "--test-threads=1"])
        .env(WHAT, what)
        .output()
        .unwrap();
    std::fs::remove_file(out).ok();
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    let line = said.lines().find(|line| line.contains("Collected :")).unwrap_or_else(|| panic!("no count in: {said}"));
    line.rsplit(' ').next().unwrap().parse().unwrap()
}

#[inline(never)]
fn count_chain_steps(chain: &mut ChainCompensator, inputs: &[Vector2<f64>]) {
    let mut time_s = 0.0;
    for b in inputs {
        time_s += 1e-3;
        black_box(chain.step(black_box(*b), &Circumstances::at(time_s)));
    }
}

#[inline(never)]
fn count_straight_steps(straight: &mut StraightLine, inputs: &[Vector2<f64>]) {
    let mut time_s = 0.0;
    for b in inputs {
        time_s += 1e-3;
        black_box(straight.step(black_box(*b), &Circumstances::at(time_s)));
    }
}
