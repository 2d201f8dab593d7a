//! Whether segments in series have changed: a watch for each, on what the model does not explain of its bend vector.
//!
//! Problem: as `krait_model::ChangeWatch` of a snake, which says how. The rate of false alarms that is asked for is shared evenly.
//! Lines of one segment pass another, so that a change of the machine can show in all: the watch that is farthest beyond its limit
//! is told, once, and then all of them learn anew.

use crate::estimate::MOVED_M;
use crate::pairing::Sighted;
use crate::step::{BridgeError, seconds_between};
use krait_model::segments::{Bends, BendsByLines, LineValues, MAX_SEGMENTS, SegmentSight, Segments};
use krait_model::{Change, ChangeParameters, ChangeWatch, Innovation};
use nalgebra::Vector2;

/// Change of a segment's bend vector below which its motion has no direction, rad: two steps of an encoder of 1 um on a line that is
/// 1.7 mm from the middle.
const DIRECTION_FROM_RAD: f64 = 1e-3;

/// The watches.
#[derive(Clone, Debug)]
pub(crate) struct SegmentWatch {
    n: usize,
    pinv: BendsByLines,
    fresh: ChangeWatch,
    watches: [ChangeWatch; MAX_SEGMENTS],
    compared: Option<Sighted<SegmentSight>>,
}

impl SegmentWatch {
    /// Watches that have learnt nothing yet.
    ///
    /// # Errors
    /// [`BridgeError::Watch`] for values out of range.
    pub fn new(machine: &Segments, false_alarms_per_hour: f64, learn_s: f64) -> Result<Self, BridgeError> {
        let false_alarms_per_hour = false_alarms_per_hour / machine.n() as f64;
        let fresh = ChangeWatch::new(ChangeParameters { false_alarms_per_hour, learn_s })?;
        Ok(Self { n: machine.n(), pinv: *machine.pinv(), fresh, watches: [fresh; MAX_SEGMENTS], compared: None })
    }

    /// Whether they have learnt what is normal.
    pub fn is_watching(&self) -> bool {
        self.watches[..self.n].iter().all(ChangeWatch::is_watching)
    }

    /// Takes what is not explained of all bend vectors at a shape, if the actuators have moved since the one before. A change comes
    /// with its segment, from 1.
    ///
    /// # Real-time
    /// No allocation.
    pub fn observe(&mut self, innovation: &Bends, seen: Sighted<SegmentSight>) -> Option<(u32, Change)> {
        let before = *self.compared.get_or_insert(seen);
        let lines_m = LineValues::from(seen.sight.u);
        let moved_m = lines_m - LineValues::from(before.sight.u);
        if moved_m.amax() < MOVED_M {
            return None;
        }
        self.compared = Some(seen);
        // Of the lines without the camera's noise; only its direction counts.
        let (bends_rad, motions_rad) = (self.pinv * lines_m, self.pinv * moved_m);
        let dt_s = seconds_between(before.stamp_ns, seen.stamp_ns);
        let mut found: Option<(u32, Change)> = None;
        for (segment, watch) in self.watches[..self.n].iter_mut().enumerate() {
            let of = |all: &Bends| Vector2::new(all[2 * segment], all[2 * segment + 1]);
            let motion_rad = Some(of(&motions_rad)).filter(|rad| rad.norm() >= DIRECTION_FROM_RAD);
            let own = Innovation {
                r: of(innovation),
                bend_rad: of(&bends_rad),
                motion_rad: motion_rad.unwrap_or_default(),
                dt_s,
            };
            let Some(change) = watch.observe(&own) else { continue };
            let beyond = |change: &Change| change.statistic / change.limit;
            if found.is_none_or(|(_, other)| beyond(&change) > beyond(&other)) {
                found = Some((segment as u32 + 1, change));
            }
        }
        if found.is_some() {
            self.watches = [self.fresh; MAX_SEGMENTS];
        }
        found
    }
}
