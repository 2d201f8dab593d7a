//! Tests of the gate: no sequence of targets and instants makes a write beyond the limits, and every target is reached.

use super::*;
use krait_ipc::message::lines;

const LIMITS: GateLimits = GateLimits {
    rate_m_per_s: [RATE_M_PER_S; MAX_ACTUATORS],
    acceleration_m_per_s2: [ACCELERATION_M_PER_S2; MAX_ACTUATORS],
    jerk_m_per_s3: 40e3,
    deceleration_m_per_s2: 1.0,
};
const RATE_M_PER_S: f64 = 30e-3;
const ACCELERATION_M_PER_S2: f64 = 20.0;

/// Numbers that look random and are the same everywhere.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn go(gate: &mut Gate, target_m: Actuators, now_ns: i64) -> f64 {
    let write = gate.toward(target_m, STILL, now_ns, &mut Findings::default());
    let step_m = largest(minus(write.q_m, gate.q_m()));
    gate.commit(&write, now_ns);
    step_m
}

#[test]
fn whatever_is_asked_whenever_no_write_passes_rate_acceleration_or_jerk() {
    let mut numbers = Numbers(12);
    let (mut gate, mut now_ns) = (Gate::new(LIMITS), 1_000_000_000);
    gate.written_at(now_ns);
    let (mut n_limited, mut n_braked) = (0, 0);
    for k in 0..200_000 {
        let gap_ms = match k % 50 {
            0 => 100.0 * numbers.next(),
            1..=9 => 0.02 * numbers.next(),
            _ => 2.0 * numbers.next(),
        };
        now_ns += (gap_ms * 1e6) as i64 + 1;
        let elapsed_ns = now_ns - gate.written_ns();
        let (before, is_rested) = (gate, elapsed_ns > REST_NS);
        if k % 97 < 20 {
            let Some(write) = gate.brake(now_ns) else { continue };
            gate.commit(&write, now_ns);
            n_braked += 1;
        } else {
            let scale_m = if k % 1000 < 500 { 5e-3 } else { 20e-6 };
            let target_m = core::array::from_fn(|i| if i == 2 { 0.0 } else { scale_m * (numbers.next() - 0.5) });
            let mut findings = Findings::default();
            let write = gate.toward(target_m, STILL, now_ns, &mut findings);
            gate.commit(&write, now_ns);
            n_limited += u32::from(!findings.reasons().is_empty());
        }
        let credit_s = elapsed_ns.min(PERIOD_NS) as f64 * 1e-9;
        let step_m = largest(minus(gate.q_m, before.q_m));
        assert!(step_m <= RATE_M_PER_S * credit_s + 1e-15, "{k}: {step_m} m in {credit_s} s");
        let (v0, a0) = if is_rested { (STILL, STILL) } else { (before.velocity_m_per_s, before.acceleration_m_per_s2) };
        let acceleration = largest(minus(gate.velocity_m_per_s, v0)) / credit_s;
        let is_at_rate = largest(gate.velocity_m_per_s) >= RATE_M_PER_S * (1.0 - 1e-6);
        assert!(acceleration <= ACCELERATION_M_PER_S2 * 1.001 + 1e-3, "{k}: {acceleration} m/s2");
        let jerk = largest(minus(gate.acceleration_m_per_s2, a0)) / credit_s;
        assert!(jerk <= LIMITS.jerk_m_per_s3 * 1.001 + 1.0 || is_at_rate, "{k}: {jerk} m/s3");
    }
    assert!(n_limited > 10_000 && n_braked > 1000, "{n_limited} limited, {n_braked} braked");
}

#[test]
fn a_target_is_reached_exactly_without_swinging_past_it() {
    for (limits, n_ms) in [
        (LIMITS, 80),
        (GateLimits { acceleration_m_per_s2: [1.0; 12], jerk_m_per_s3: 1e3, ..LIMITS }, 200),
        (GateLimits { acceleration_m_per_s2: [1.0; 12], jerk_m_per_s3: 1e6, ..LIMITS }, 200),
    ] {
        let (mut gate, target_m) = (Gate::new(limits), lines([-1e-3, 0.5e-3, 0.5e-3]));
        let mut past_m: f64 = 0.0;
        for ms in 1..=n_ms {
            go(&mut gate, target_m, ms * 1_000_000);
            past_m = past_m.max(gate.q_m()[1] - target_m[1]);
            assert!((gate.q_m()[0] + 2.0 * gate.q_m()[1]).abs() < 1e-15, "the direction stays");
        }
        assert_eq!(gate.q_m(), target_m, "{limits:?}");
        assert!(past_m < 5e-6, "{past_m} m past it: {limits:?}");
    }
}

#[test]
fn a_burst_moves_no_further_than_its_time() {
    let mut gate = Gate::new(LIMITS);
    for ms in 1..=50 {
        go(&mut gate, lines([f64::from(ms) * 10e-6, 0.0, 0.0]), i64::from(ms) * 1_000_000);
    }
    let before_m = gate.q_m()[0];
    // 45 commands of 45 ms at once, a microsecond apart.
    for k in 1..=45 {
        go(&mut gate, lines([(50.0 + f64::from(k)) * 10e-6, 0.0, 0.0]), 95_000_000 + i64::from(k) * 1000);
    }
    let moved_m = gate.q_m()[0] - before_m;
    assert!(moved_m <= 30e-3 * (1e-3 + 45e-6) + 1e-9, "{moved_m} m");
}

#[test]
fn a_stop_slows_down_steadily_and_keeps_the_direction() {
    let mut gate = Gate::new(LIMITS);
    for ms in 1..=20 {
        let way = f64::from(ms) * 10e-6;
        go(&mut gate, lines([way, -0.5 * way, -0.5 * way]), i64::from(ms) * 1_000_000);
    }
    let (mut n_steps, mut speed) = (0, 10e-3);
    let mut now_ns = 20_000_000;
    loop {
        now_ns += 1_000_000;
        let Some(write) = gate.brake(now_ns) else { break };
        let before_m = gate.q_m();
        gate.commit(&write, now_ns);
        let step_m = minus(gate.q_m(), before_m);
        assert!((step_m[1] + 0.5 * step_m[0]).abs() < 1e-15);
        assert!(step_m[0] / 1e-3 < speed && step_m[0] >= 0.0);
        (speed, n_steps) = (step_m[0] / 1e-3, n_steps + 1);
        assert!(n_steps < 20, "it ends");
    }
    assert!(n_steps >= 9, "10 mm/s at 1 m/s2 take 10 ms, not {n_steps}");
    assert!(gate.is_still());
}

#[test]
fn drives_that_were_not_written_for_long_do_not_go_on_where_they_left_off() {
    let mut gate = Gate::new(LIMITS);
    for ms in 1..=20 {
        go(&mut gate, lines([f64::from(ms) * 20e-6, 0.0, 0.0]), i64::from(ms) * 1_000_000);
    }
    assert!(!gate.is_still());
    assert!(gate.brake(500_000_000).is_none() && gate.is_still());
}

#[test]
fn an_actuator_with_limits_of_its_own_never_passes_them_and_all_slow_down_with_it_by_one_factor() {
    let (mut limits, target_m) = (LIMITS, lines([-1e-3, 0.5e-3, 0.5e-3]));
    (limits.rate_m_per_s[1], limits.acceleration_m_per_s2[1]) = (6e-3, 2.0);
    let (mut gate, mut fastest_m_per_s, mut n_reasons) = (Gate::new(limits), STILL, 0);
    for ms in 1..=200 {
        let mut findings = Findings::default();
        let write = gate.toward(target_m, STILL, ms * 1_000_000, &mut findings);
        let change_m_per_s = minus(write.velocity_m_per_s, gate.velocity_m_per_s);
        assert!(change_m_per_s[1].abs() <= 2.0 * 1e-3 + 1e-12, "{ms} ms: {change_m_per_s:?}");
        n_reasons += u32::from(findings.reasons().contains(Reason::ActuatorRateLimit));
        gate.commit(&write, ms * 1_000_000);
        assert!((gate.q_m()[0] + 2.0 * gate.q_m()[1]).abs() < 1e-15, "the direction stays");
        fastest_m_per_s = core::array::from_fn(|k| gate.velocity_m_per_s[k].abs().max(fastest_m_per_s[k]));
    }
    assert_eq!(gate.q_m(), target_m);
    assert!(
        (fastest_m_per_s[1] - 6e-3).abs() < 1e-9 && (fastest_m_per_s[0] - 12e-3).abs() < 1e-9,
        "{fastest_m_per_s:?}"
    );
    assert!(n_reasons > 10, "{n_reasons}");
}

#[test]
fn a_stop_brakes_all_by_one_factor_and_none_harder_than_the_stop_whatever_their_own_accelerations() {
    let mut limits = LIMITS;
    limits.acceleration_m_per_s2[1] = LIMITS.deceleration_m_per_s2;
    let mut gate = Gate::new(limits);
    for ms in 1..=60 {
        let way = f64::from(ms) * 10e-6;
        go(&mut gate, lines([0.5 * way, way, -0.5 * way]), i64::from(ms) * 1_000_000);
    }
    let (mut now_ns, mut n_steps) = (60_000_000, 0);
    loop {
        now_ns += 1_000_000;
        let before = gate;
        let Some(write) = gate.brake(now_ns) else { break };
        gate.commit(&write, now_ns);
        let change_m_per_s = minus(gate.velocity_m_per_s, before.velocity_m_per_s);
        assert!(largest(change_m_per_s) <= LIMITS.deceleration_m_per_s2 * 1e-3 + 1e-12, "{change_m_per_s:?}");
        assert!((gate.velocity_m_per_s[1] - 2.0 * gate.velocity_m_per_s[0]).abs() < 1e-6, "the direction stays");
        n_steps += 1;
        assert!(n_steps < 40, "it ends");
    }
    assert!(n_steps >= 8, "{n_steps}");
}
