//! The master's loop: wait, ask the source, publish at the tick and at once after a report. It decides nothing.

use crate::feedback::Feedback;
use crate::report_log::ReportLog;
use crate::ticker::Ticker;
use crate::{
    Engage, MasterConfig, MasterCore, MasterError, Plug, PoseRefusal, RawReport, RecordedEvent, ReportSource,
    SourceChoice, SourceEvent,
};
use krait_ipc::message::{DeviceState, Marker, MotionWish, OperatorInput, SlaveState};
use krait_ipc::{Bus, HealthReporter, Process, ReadOptions, Reader, Reason, Reasons, Writer, clock};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};

/// Reads a source and publishes [`OperatorInput`] on its channel until `stop` is set.
///
/// A report is published at once, and so is a loss, at most one of each between two ticks; the tick comes at `rate_hz` besides. A recording or script
/// begins when the slave is ready (or at once, see [`MasterConfig::start_when_ready`]); before that the inputs carry no
/// motion. After its end, and while a device is lost, inputs go on without motion.
///
/// # Errors
/// [`MasterError`] when a setting is out of range, the source cannot be opened, or a channel fails. A device that is unplugged
/// later is a state, not an error.
pub fn run(bus: &Bus, config: &MasterConfig, source: SourceChoice, stop: &AtomicBool) -> Result<(), MasterError> {
    // A live hand engages by its own presence; whatever is played must have been asked to.
    let is_played = source.has_beginning();
    let engage = if is_played { config.engage } else { Engage::Once };
    let held = MasterConfig { engage, ..config.clone() };
    let core = source.core(&held)?;
    let waits_for_slave = config.start_when_ready && is_played;
    let slave = if waits_for_slave { Some(bus.reader(ReadOptions::glancing())?) } else { None };
    let engaged = if config.engage == Engage::Again { Some(bus.reader(ReadOptions::glancing())?) } else { None };
    let feedback = if matches!(source, SourceChoice::Hid) {
        Some(Feedback::open(bus, config.rate_hz, config.load_limits)?)
    } else {
        None
    };
    let source = source.open(bus, config)?;
    let log = match &config.record_reports {
        Some(path) => Some(ReportLog::create(path, source.as_ref())?),
        None => None,
    };
    let (inputs, health) = (bus.writer()?, HealthReporter::open(bus, Process::Master)?);
    let marks = bus.writer_on(Marker::DEVICE_CHANNEL)?;
    let wishes = bus.reader(ReadOptions::glancing())?;
    let begun_ns = clock::monotonic_ns();
    let (device_ns, has_loss, has_log_dropped, told_refusals) = (None, false, false, 0);
    let mut master = Master {
        core,
        source,
        log,
        slave,
        engaged,
        wishes,
        begun_ns,
        is_played,
        inputs,
        marks,
        health,
        device_ns,
        has_loss,
        has_log_dropped,
        told_refusals,
        feedback,
    };
    master.run(config.period_ns(), stop)
}

struct Master {
    core: MasterCore,
    source: Box<dyn ReportSource>,
    log: Option<ReportLog>,
    // Present until the slave was ready and the source began.
    slave: Option<Reader<SlaveState>>,
    // Present if a source shall engage again.
    engaged: Option<Reader<SlaveState>>,
    wishes: Reader<MotionWish>,
    // A wish of before that is none to this process.
    begun_ns: i64,
    // Whether the source plays what was recorded: its reports say when they were due, and are in hand when they are told.
    is_played: bool,
    inputs: Writer<OperatorInput>,
    marks: Writer<Marker>,
    health: HealthReporter,
    // When the newest report that no input has carried yet was in hand.
    device_ns: Option<i64>,
    // Whether the device was lost since the last input: that is told at once, like a report.
    has_loss: bool,
    // Whether the log had no room for a report since the last input.
    has_log_dropped: bool,
    // Kinds of refused packets that were told of, a bit each.
    told_refusals: u32,
    // Present if the source is a live device, which may have lights.
    feedback: Option<Feedback>,
}

impl Master {
    fn run(&mut self, period_ns: i64, stop: &AtomicBool) -> Result<(), MasterError> {
        let begun_ns = clock::monotonic_ns();
        if self.slave.is_none() {
            self.source.start(begun_ns);
        }
        let mut ticker = Ticker::new(begun_ns, period_ns);
        self.health.publish(begun_ns)?;
        while !stop.load(Ordering::Relaxed) {
            self.source.wait_until(ticker.due_ns());
            let now_ns = clock::monotonic_ns();
            self.begin_when_ready(now_ns)?;
            self.take_events(now_ns)?;
            let n_before = ticker.n_ticks();
            if ticker.is_due(now_ns, self.device_ns.is_some(), self.has_loss) {
                self.publish(now_ns)?;
                self.health.publish_if_due(now_ns)?;
                self.show(ticker.n_ticks() - n_before)?;
            }
        }
        let (n_sent, counts) = (self.inputs.n_sent(), self.core.counts());
        tracing::info!(n_sent, n_ticks_skipped = ticker.n_skipped(), ?counts, "the master ends");
        for (refusal, n_packets) in self.core.refused_packets().filter(|(_, n_packets)| *n_packets > 0) {
            tracing::warn!(n_packets, "in all: {}", refusal.sentence());
        }
        self.health.publish(clock::monotonic_ns())?;
        Ok(())
    }

    fn show(&mut self, n_ticks: u64) -> Result<(), MasterError> {
        if let Some(feedback) = &mut self.feedback
            && let Some(lights) = feedback.on_ticks(n_ticks)?
        {
            self.source.show(lights);
        }
        Ok(())
    }

    fn begin_when_ready(&mut self, now_ns: i64) -> Result<(), MasterError> {
        if let Some(slave) = &mut self.slave {
            let is_ready = slave.take_newest()?.is_some_and(|state| state.is_ready());
            if is_ready {
                self.slave = None;
                self.source.start(now_ns);
            }
        }
        Ok(())
    }

    fn take_events(&mut self, now_ns: i64) -> Result<(), MasterError> {
        while let Some(event) = self.source.next_event(now_ns) {
            match event {
                SourceEvent::HidReport { device, stamp_ns, report } => {
                    self.take_report(device, stamp_ns, report, now_ns)?;
                }
                SourceEvent::Packet { stamp_ns, sender, packet } => self.take_packet(stamp_ns, sender, packet, now_ns),
                SourceEvent::Script(sample) => self.core.on_script(sample),
                SourceEvent::Mark(mark) => self.marks.send(&Marker { sequence: self.marks.n_sent() + 1, ..mark })?,
                SourceEvent::Pad { stamp_ns, wish } => {
                    // Counted as a report that is refused.
                    if self.core.on_pad(&wish, stamp_ns).is_ok() {
                        self.device_ns = Some(stamp_ns);
                    }
                }
                SourceEvent::Drained(n_reports) => self.core.on_drained(n_reports),
                SourceEvent::Plug { device, stamp_ns, plug } => {
                    self.record(device, stamp_ns, RecordedEvent::Plug(plug));
                    match plug {
                        Plug::Out => {
                            self.core.on_unplugged_of(device);
                            self.has_loss = true;
                        }
                        Plug::In => self.core.on_plugged_of(device),
                    }
                }
                SourceEvent::GivenBack => {
                    self.record(0, now_ns, RecordedEvent::Plug(Plug::Out));
                    self.core.on_given_back();
                    self.has_loss = true;
                }
                SourceEvent::Restarted => self.core.on_restarted(),
                SourceEvent::Ended => self.core.on_ended(),
            }
        }
        Ok(())
    }

    /// When a report was in hand.
    fn in_hand_ns(&self, stamp_ns: i64, now_ns: i64) -> i64 {
        if self.is_played { now_ns } else { stamp_ns }
    }

    fn take_report(&mut self, device: usize, stamp_ns: i64, report: RawReport, now_ns: i64) -> Result<(), MasterError> {
        self.record(device, stamp_ns, RecordedEvent::Report(report));
        // A refusal is counted by the core and travels in every input; there is no more to do about it here.
        if self.core.on_report_of(device, report.as_bytes(), stamp_ns).is_ok() {
            self.device_ns = Some(self.in_hand_ns(stamp_ns, now_ns));
            self.mark(stamp_ns)?;
        }
        Ok(())
    }

    /// Of a sender that is ignored nothing is recorded, so that a recording is one hand's.
    fn take_packet(&mut self, stamp_ns: i64, sender: SocketAddr, packet: RawReport, now_ns: i64) {
        let taken = self.core.on_packet(packet.as_bytes(), sender, stamp_ns);
        if taken != Err(PoseRefusal::AnotherSender) {
            self.record(0, stamp_ns, RecordedEvent::Report(packet));
        }
        match taken {
            Ok(()) => self.device_ns = Some(self.in_hand_ns(stamp_ns, now_ns)),
            Err(refusal) => {
                let bit = 1 << refusal as u32;
                if self.told_refusals & bit == 0 {
                    self.told_refusals |= bit;
                    tracing::warn!(%sender, "{}; further ones are only counted", refusal.sentence());
                }
            }
        }
    }

    fn record(&mut self, device: usize, stamp_ns: i64, event: RecordedEvent) {
        if let Some(log) = &self.log {
            self.has_log_dropped |= !log.push(device, stamp_ns, event);
        }
    }

    /// Publishes the mark that a report has set, if it has.
    fn mark(&mut self, stamp_ns: i64) -> Result<(), MasterError> {
        let Some(button) = self.core.take_mark() else { return Ok(()) };
        if let Ok(mark) = Marker::new(self.marks.n_sent() + 1, stamp_ns, &format!("button {button}")) {
            self.marks.send(&mark)?;
        }
        Ok(())
    }

    fn publish(&mut self, now_ns: i64) -> Result<(), MasterError> {
        if let Some(reader) = &mut self.engaged
            && let Some(state) = reader.take_newest()?
        {
            self.core.note_engaged(state.is_engaged());
        }
        while let Some(wish) = self.wishes.take()? {
            if wish.sample_ns >= self.begun_ns {
                self.core.on_wish(&wish);
            }
        }
        self.has_loss = false;
        let mut input = self.core.on_tick(now_ns);
        if let Some(device_ns) = self.device_ns.take() {
            input.stamps.device_ns = device_ns;
        }
        let mut reasons = reasons(&input);
        reasons.insert_if(Reason::RecordingDropped, std::mem::take(&mut self.has_log_dropped));
        self.health.set_now(reasons);
        let health = self.health.health_mut();
        (health.n_sent, health.n_refused) = (input.sequence, input.n_refused);
        input.stamps.input_sent_ns = clock::monotonic_ns();
        self.inputs.send(&input)?;
        Ok(())
    }
}

/// Why the operator's hand moves nothing, as far as the master knows.
fn reasons(input: &OperatorInput) -> Reasons {
    let mut reasons = Reasons::NONE;
    reasons.insert_if(Reason::OperatorAbsent, !input.operator_present());
    reasons.insert_if(Reason::Clutched, input.clutch_pressed());
    reasons.insert_if(Reason::HandJumped, input.flags & OperatorInput::HAND_JUMPED != 0);
    reasons.insert_if(Reason::DeviceLost, input.device() == Some(DeviceState::Lost));
    reasons.insert_if(Reason::InputEnded, input.device() == Some(DeviceState::Ended));
    reasons
}
