//! When a fault strikes, and for how long: the same for the first play of every fault, then random but repeatable.

/// When it strikes after the snake has begun to move, and how long a stall lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrikeTime {
    /// How long it waits before it strikes, s.
    pub wait_s: f64,
    /// How long a process is stopped, s.
    pub stall_s: f64,
}

/// How long a process is stopped the first time, s.
const STALL_S: f64 = 0.3;
/// Shortest and longest stall, s: shorter than the watchdog too; from 2 s on the supervisor kills what it takes for hung.
const SHORTEST_S: f64 = 0.015;
const LONGEST_S: f64 = 12.0;

impl StrikeTime {
    /// The moment of the n-th play of a fault, from 0: within two seconds, stalls short and long alike.
    pub fn of(n: u64) -> Self {
        if n == 0 {
            return Self { wait_s: 0.0, stall_s: STALL_S };
        }
        let stall_s = SHORTEST_S * (LONGEST_S / SHORTEST_S).powf(fraction(2 * n + 1));
        Self { wait_s: 2.0 * fraction(2 * n), stall_s }
    }
}

/// A number from 0 to 1 (SplitMix64).
fn fraction(n: u64) -> f64 {
    let mut z = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_moment_is_fixed_and_the_others_spread_over_their_range() {
        assert_eq!(StrikeTime::of(0), StrikeTime { wait_s: 0.0, stall_s: 0.3 });
        assert_eq!(StrikeTime::of(7), StrikeTime::of(7));
        let all: Vec<StrikeTime> = (1..=1000).map(StrikeTime::of).collect();
        assert!(all.iter().all(|m| (0.0..2.0).contains(&m.wait_s) && (SHORTEST_S..LONGEST_S).contains(&m.stall_s)));
        let early = all.iter().filter(|m| m.wait_s < 1.0).count();
        let short = all.iter().filter(|m| m.stall_s < 1.0).count();
        assert!((400..600).contains(&early) && (550..700).contains(&short), "{early} early, {short} short");
    }
}
