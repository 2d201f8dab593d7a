//! The guide of an experiment as a source: looks at setpoint and state at every tick and says what its guide asks for.

use crate::guide::Guide;
use crate::guide_order::GuideOrder;
use crate::guide_plan::GuidePlan;
use crate::source::sleep_until;
use crate::{MasterError, ReportSource, SourceEvent};
use krait_ipc::message::{MARKER_TEXT_MAX, Marker, Message, Setpoint, SlaveState};
use krait_ipc::{Bus, ExperimentMark, ReadOptions, Reader};

/// Plays a plan from an instant on.
pub struct GuideSource {
    guide: Guide,
    setpoints: Reader<Setpoint>,
    states: Reader<SlaveState>,
    /// Present if the plan awaits orders.
    orders: Option<Reader<Marker>>,
    setpoint: Option<Setpoint>,
    state: Option<SlaveState>,
    is_begun: bool,
    told_ns: Option<i64>,
    mark: Option<Marker>,
    is_over: bool,
    is_end_told: bool,
}

impl GuideSource {
    /// A guide that waits for its start.
    ///
    /// # Errors
    /// [`MasterError::Ipc`] where a channel cannot be read.
    pub fn open(bus: &Bus, plan: GuidePlan) -> Result<Self, MasterError> {
        let awaited = plan.awaits_orders;
        let orders = awaited.then(|| bus.reader_on(Marker::GUIDE_CHANNEL, ReadOptions::observing())).transpose()?;
        Ok(Self {
            guide: Guide::new(plan),
            orders,
            setpoints: bus.reader(ReadOptions::glancing())?,
            states: bus.reader(ReadOptions::glancing())?,
            setpoint: None,
            state: None,
            is_begun: false,
            told_ns: None,
            mark: None,
            is_over: false,
            is_end_told: false,
        })
    }
}

impl ReportSource for GuideSource {
    fn start(&mut self, _now_ns: i64) {
        self.is_begun = true;
    }

    fn wait_until(&mut self, deadline_ns: i64) {
        sleep_until(deadline_ns);
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        if let Some(mark) = self.mark.take() {
            return Some(SourceEvent::Mark(mark));
        }
        if self.is_over {
            let is_first = !std::mem::replace(&mut self.is_end_told, true);
            return is_first.then_some(SourceEvent::Ended);
        }
        if !self.is_begun || self.told_ns == Some(now_ns) {
            return None;
        }
        self.told_ns = Some(now_ns);
        newest(&mut self.setpoints, &mut self.setpoint);
        newest(&mut self.states, &mut self.state);
        while let Some(order) = self.orders.as_mut().and_then(next_order) {
            order.into_iter().for_each(|order| self.guide.order(order));
        }
        let step = self.guide.step(now_ns, self.setpoint.as_ref(), self.state.as_ref());
        self.mark = step.mark.and_then(|mark| marker(&mark, now_ns));
        self.is_over = step.sample.is_none();
        step.sample.map(SourceEvent::Script)
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        None
    }
}

/// What cannot be read leaves what is known to grow old, and the guide holds.
fn newest<M: Message>(reader: &mut Reader<M>, known: &mut Option<M>) {
    match reader.take_newest() {
        Ok(Some(message)) => *known = Some(*message),
        Ok(None) => {}
        Err(error) => tracing::error!(%error, "the guide cannot read a channel"),
    }
}

/// The next message of orders, if there is one: an order, or none in what is no order.
fn next_order(orders: &mut Reader<Marker>) -> Option<Option<GuideOrder>> {
    match orders.take() {
        Ok(mark) => mark.map(|mark| mark.text().and_then(GuideOrder::parse)),
        Err(error) => {
            tracing::error!(%error, "the guide cannot hear its orders");
            None
        }
    }
}

/// The mark as a message, cut to what one holds; the process numbers it.
fn marker(mark: &ExperimentMark, now_ns: i64) -> Option<Marker> {
    let mut text = mark.to_string();
    while text.len() > MARKER_TEXT_MAX {
        text.pop();
    }
    Marker::new(1, now_ns, &text).ok()
}
