//! What `krait model check` says of segments: which lines end where, how far each bends, and from where on its lines are at a bound.

use krait_model::segments::{Bends, MAX_LINES, SegmentChain, Sharing};
use serde::Serialize;

/// Rays around the straight pose.
const N_RAYS: u32 = 72;
/// Steps along a ray.
const N_STEPS: u32 = 180;

/// One segment, as `--json` prints it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentEntry {
    /// Which, from 1.
    pub segment: usize,
    /// Lines that end at its disk, from 1.
    pub lines: Vec<usize>,
    /// Largest bend that the strain limit allows, degrees.
    pub max_bend_deg: f64,
    /// Where its lines first share their loads otherwise than preferred, because one is at a bound; null where none ever is.
    pub at_bound: Option<LineBound>,
    /// Where no loads within the bounds hold it any more; null where there always are some.
    pub not_held: Option<LineBound>,
}

/// A line at a bound, where this segment bends and the others are straight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineBound {
    /// Bend, degrees.
    pub bend_deg: f64,
    /// Plane of the bend, degrees.
    pub plane_deg: f64,
    /// The line, from 1.
    pub line: usize,
    /// Its bound, N, push positive.
    pub limit_n: f64,
}

/// The segments of a model from the base on.
pub fn described(chain: &SegmentChain) -> Vec<SegmentEntry> {
    let machine = chain.machine();
    let entry = |segment: usize| {
        let (at_bound, not_held) = first_bounds(chain, segment);
        SegmentEntry {
            segment: segment + 1,
            lines: (0..machine.n_lines()).filter(|&k| machine.segment_of(k) == segment).map(|k| k + 1).collect(),
            max_bend_deg: machine.max_bend_rad(segment).to_degrees(),
            at_bound,
            not_held,
        }
    };
    (0..machine.n()).map(entry).collect()
}

/// The smallest bends of one segment at which a line is at a bound, and at which nothing holds.
fn first_bounds(chain: &SegmentChain, segment: usize) -> (Option<LineBound>, Option<LineBound>) {
    let (machine, sharing) = (chain.machine(), chain.sharing());
    let most_rad = machine.max_bend_rad(segment).min(core::f64::consts::PI);
    let (mut at_bound, mut not_held) = (None, None);
    for step in 0..=N_STEPS {
        let bend_rad = most_rad * f64::from(step) / f64::from(N_STEPS);
        for ray in 0..N_RAYS {
            let plane_rad = core::f64::consts::TAU * f64::from(ray) / f64::from(N_RAYS);
            let mut bends_rad = Bends::zeros();
            (bends_rad[2 * segment], bends_rad[2 * segment + 1]) =
                (bend_rad * plane_rad.cos(), bend_rad * plane_rad.sin());
            let moments_nm = chain.moments_nm(&bends_rad);
            let shared = machine.share_loads(&moments_nm, sharing, &[0; MAX_LINES]);
            let (bend_deg, plane_deg) = (bend_rad.to_degrees(), plane_rad.to_degrees());
            match shared.sharing {
                Sharing::Bounded { line_idx } => {
                    let bounds_n = if shared.active[line_idx] < 0 { &sharing.low_n } else { &sharing.high_n };
                    let found = LineBound { bend_deg, plane_deg, line: line_idx + 1, limit_n: bounds_n[line_idx] };
                    at_bound = at_bound.or(Some(found));
                }
                Sharing::Infeasible { line_idx, limit_n, .. } => {
                    not_held = not_held.or(Some(LineBound { bend_deg, plane_deg, line: line_idx + 1, limit_n }));
                }
                Sharing::Preferred | Sharing::Unsettled | Sharing::NotFinite => {}
            }
        }
        if not_held.is_some() {
            break;
        }
    }
    (at_bound, not_held)
}

/// The same in words, a line for each segment.
pub fn sentences(segments: &[SegmentEntry]) -> String {
    let mut text = String::new();
    for SegmentEntry { segment, lines, max_bend_deg, at_bound, not_held } in segments {
        let lines = lines.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
        text += &format!(
            "  segment {segment}, lines {lines}: bends up to {max_bend_deg:.1} deg stay within the strain limit\n"
        );
        let place = |own: &LineBound| format!("{:.1} deg in the plane {:.0} deg", own.bend_deg, own.plane_deg);
        if let Some(own) = at_bound {
            text += &format!(
                "    bent alone, line {} is the first at its bound of {} N: at {}\n",
                own.line,
                own.limit_n,
                place(own)
            );
        }
        if let Some(own) = not_held {
            text += &format!(
                "    bent alone, no loads within the bounds hold it from {} on: line {} would be beyond {} N\n",
                place(own),
                own.line,
                own.limit_n
            );
        }
    }
    text
}
