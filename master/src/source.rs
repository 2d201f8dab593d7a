//! Where reports come from: one small trait for the live device, a recording and a script, so that the process loop knows
//! none of them.

use crate::given_back_source::GivenBackSource;
use crate::lights::Lights;
use crate::{
    BrowserSource, GuidePlan, GuideSource, HidRecording, HidSource, JoinedSource, Layout, MasterConfig, MasterCore,
    MasterError, PoseSource, Profile, RawReport, RecordingSource, Script, ScriptSample, ScriptSource,
};
use krait_ipc::message::{DriveWish, Marker};
use krait_ipc::{Bus, clock};
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;
use std::net::SocketAddr;

/// What a source has to say.
#[derive(Clone, Copy, Debug)]
pub enum SourceEvent {
    /// A report, and when it was in hand, CLOCK_MONOTONIC, ns.
    HidReport {
        /// Which of the hand's devices sent it: 0 the hand controller, 1 the first beside it.
        device: usize,
        /// When it was in hand; of a recording when it was due.
        stamp_ns: i64,
        /// Its bytes.
        report: RawReport,
    },
    /// A packet of a pose sender, and when it was in hand, CLOCK_MONOTONIC, ns.
    Packet {
        /// When it was in hand; of a recording when it was due.
        stamp_ns: i64,
        /// Who sent it.
        sender: SocketAddr,
        /// Its bytes.
        packet: RawReport,
    },
    /// What a script or a guide asks for at this instant.
    Script(ScriptSample),
    /// What a guide marks at this instant; its number is the process's to give.
    Mark(Marker),
    /// What a page's drive pad said, and when it was in hand, CLOCK_MONOTONIC, ns.
    Pad {
        /// When it was in hand.
        stamp_ns: i64,
        /// What it said.
        wish: DriveWish,
    },
    /// Reports were thrown away unread because newer ones pressed on.
    Drained(u64),
    /// One of the hand's devices is gone or there again, and when that was seen, CLOCK_MONOTONIC, ns.
    Plug {
        /// Which of the hand's devices: 0 the hand controller, 1 the first beside it.
        device: usize,
        /// When it was seen.
        stamp_ns: i64,
        /// Gone, or there again.
        plug: Plug,
    },
    /// The device's user has given it back by its key: it is taken again only by another start.
    GivenBack,
    /// The recording or script begins again.
    Restarted,
    /// The recording or script is at its end.
    Ended,
}

/// What becomes of a device's plug.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plug {
    /// The device is gone.
    Out,
    /// It is there again.
    In,
}

/// A source of reports. All instants are CLOCK_MONOTONIC, ns.
pub trait ReportSource {
    /// Begins to play. A live device needs no beginning and ignores it.
    fn start(&mut self, now_ns: i64);

    /// Sleeps until the deadline, or until there is something to tell, or until a signal comes.
    fn wait_until(&mut self, deadline_ns: i64);

    /// The next event that is due, or `None` when there is no more at this instant.
    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent>;

    /// Vendor and product of the device whose reports these are; `None` for a script.
    fn vid_pid(&self) -> Option<(u16, u16)>;

    /// Has the device show something on its lights, if it has any; nobody waits for it.
    fn show(&mut self, _lights: Lights) {}

    /// Vendor and product of each device beside it.
    fn beside(&self) -> Vec<(u16, u16)> {
        Vec::new()
    }

    /// How those reports are laid out, where it is known.
    fn layout(&self) -> Option<Layout> {
        self.vid_pid().and_then(|(vendor_id, product_id)| crate::devices::layout_of(vendor_id, product_id))
    }
}

/// Which source the master shall read.
#[derive(Clone, Debug)]
pub enum SourceChoice {
    /// The live device that the configuration names.
    Hid,
    /// None: the user of the live device has given it back, and this master was started again after that.
    GivenBack,
    /// The drive pad of the console's pages.
    Browser,
    /// A pose sender, on the address that the configuration names.
    Pose,
    /// A recording of reports.
    Recording {
        /// The reports.
        recording: HidRecording,
        /// Whether it begins again after its end.
        looping: bool,
    },
    /// The guide of an experiment.
    Guide(GuidePlan),
    /// A script of wanted motion.
    Script {
        /// The script.
        script: Script,
        /// Whether it begins again after its end.
        looping: bool,
    },
}

impl SourceChoice {
    /// Opens the source.
    ///
    /// # Errors
    /// For a live device as [`HidSource::open`], [`HidSource::open_profile`] or [`HidSource::open_spacenavd`], with others beside it
    /// as [`JoinedSource::open`]; for pages as [`BrowserSource::open`], for poses as [`PoseSource::open`]; the others cannot fail any
    /// more.
    pub fn open(self, bus: &Bus, config: &MasterConfig) -> Result<Box<dyn ReportSource>, MasterError> {
        Ok(match self {
            Self::Hid if !config.beside.is_empty() => Box::new(JoinedSource::open(config)?),
            Self::Hid => Box::new(match (&config.profile, &config.spacenavd) {
                (Some(path), _) => HidSource::open_profile(Profile::of_device(path, config.node.as_deref())?)?,
                (None, Some(socket)) => HidSource::open_spacenavd(socket)?,
                (None, None) => HidSource::open(&config.device)?,
            }),
            Self::GivenBack => Box::new(GivenBackSource::default()),
            Self::Browser => Box::new(BrowserSource::open(bus)?),
            Self::Pose => Box::new(PoseSource::open(&config.pose)?),
            Self::Recording { recording, looping } => Box::new(RecordingSource::new(recording, looping)),
            Self::Guide(plan) => Box::new(GuideSource::open(bus, plan)?),
            Self::Script { script, looping } => Box::new(ScriptSource::new(script, looping)),
        })
    }

    /// Whether this source waits for a start; a live hand does not.
    pub(crate) fn has_beginning(&self) -> bool {
        !matches!(self, Self::Hid | Self::GivenBack | Self::Browser | Self::Pose)
    }

    /// The core that knows what this source tells.
    ///
    /// # Errors
    /// As [`MasterCore::new`].
    pub(crate) fn core(&self, config: &MasterConfig) -> Result<MasterCore, MasterError> {
        match self {
            Self::Browser => MasterCore::with_pad(config),
            Self::Pose => MasterCore::with_pose(config),
            Self::Recording { recording, .. } if recording.header().layout == Some(Layout::Pose) => {
                MasterCore::with_pose(config)
            }
            Self::Hid | Self::GivenBack | Self::Guide(_) | Self::Recording { .. } | Self::Script { .. } => {
                MasterCore::new(config)
            }
        }
    }
}

/// Sleeps until an instant or until a signal comes. Absolute, so that lateness of one sleep never adds to the next.
pub(crate) fn sleep_until(deadline_ns: i64) {
    let request =
        Timespec { tv_sec: deadline_ns.div_euclid(1_000_000_000), tv_nsec: deadline_ns.rem_euclid(1_000_000_000) };
    if let Err(error) = clock_nanosleep_absolute(ClockId::Monotonic, &request)
        && error != rustix::io::Errno::INTR
    {
        // No clock to sleep on: give the core away, the loop asks the time again.
        tracing::trace!(%error, now_ns = clock::monotonic_ns(), "clock_nanosleep failed");
        std::thread::yield_now();
    }
}
