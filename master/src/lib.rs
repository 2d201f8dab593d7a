//! krait-master: from the operator's hand to `OperatorInput`.
//!
//! Purpose: read a hand controller and say, a thousand times a second and at once when it reports, what motion of the tip
//! the operator asks for, whether the operator is present, and whether the device can be trusted.
//!
//! Terms: a *report* is one HID input report as the device sent it; a *recording* is a file of reports with stamps; a
//! *source* is where reports come from; *counts* are the device's own numbers, -350..=350 for a full deflection.
//!
//! Frames and units: the device's axes are +X right, +Y towards the user, +Z down. The `view` frame of the message is x
//! right, y down, z away from the viewer. Velocities are m/s. Time is CLOCK_MONOTONIC in nanoseconds and always an argument,
//! except in the process loop and in the thread that reads the device.
//!
//! ```no_run
//! use krait_ipc::Bus;
//! use krait_master::{MasterConfig, HidRecording, SourceChoice, run};
//! use std::sync::atomic::AtomicBool;
//! let bus = Bus::open("main", "master")?;
//! let source = SourceChoice::Recording { recording: HidRecording::shipped()?, looping: false };
//! run(&bus, &MasterConfig::default(), source, &AtomicBool::new(false))?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis_map;
mod axis_scale;
mod beside;
mod browser_source;
mod calibration;
mod config;
mod core;
mod decode;
mod decoder;
mod device_state;
mod devices;
mod error;
mod evdev_decoder;
mod evdev_host;
mod evdev_ioctl;
mod evdev_names;
mod evdev_port;
mod feedback;
mod given_back_source;
mod grip;
mod guide;
mod guide_order;
mod guide_plan;
mod guide_source;
mod hand_devices;
mod hid;
mod hid_nodes;
mod hid_source;
mod input_watch;
mod joined_source;
mod lights;
mod live_motion;
mod meter;
mod operator;
mod pad;
mod piece_reader;
mod pose_config;
mod pose_hand;
mod pose_packet;
mod pose_source;
mod presence;
mod process;
mod profile;
mod profile_axis;
mod profile_signs;
mod profile_text;
mod raw_report;
mod recording;
mod recording_lines;
mod recording_source;
mod recording_writer;
mod report_log;
mod response;
mod rumble;
mod script;
mod script_source;
mod source;
mod spacenavd;
mod ticker;
mod udp_owner;
mod way_window;

pub use crate::core::MasterCore;
pub use axis_map::{AXIS_NAMES, AxisMap, SignedAxis};
pub use beside::{BesideConfig, JoinedHand};
pub use browser_source::BrowserSource;
pub use calibration::HandCalibration;
pub use config::MasterConfig;
pub use decode::{AXIS_LIMIT_COUNTS, AXIS_MARGIN_COUNTS, HidReport, Layout, Refusal, led_report};
pub use decoder::{Decoder, ReportCounts};
pub use device_state::DeviceMonitor;
pub use devices::{DeviceChoice, DeviceInfo, KNOWN_DEVICES, KnownDevice, list_devices};
pub use error::MasterError;
pub use evdev_host::{InputDevice, input_at, list_inputs, refuse_no_input};
pub use grip::Engage;
pub use guide::{Guide, GuideStep};
pub use guide_order::GuideOrder;
pub use guide_plan::{GuideLeg, GuidePlan};
pub use guide_source::GuideSource;
pub use hand_devices::MAX_DEVICES;
pub use hid::{RULES_FILE, chosen_device};
pub use hid_source::HidSource;
pub use input_watch::{InputChange, InputWatch, WatchedAxis, WatchedWay};
pub use joined_source::JoinedSource;
pub use lights::{LightRole, Lights};
pub use live_motion::LiveMotion;
pub use meter::LineLoadLimits;
pub use operator::{Hand, Operator, OperatorMotion};
pub use pad::{PadLease, PadRefusal};
pub use pose_config::PoseConfig;
pub use pose_hand::PoseHand;
pub use pose_packet::{PosePacket, PoseRefusal};
pub use pose_source::PoseSource;
pub use presence::{HoldButton, Presence, PressButton};
pub use process::run;
pub use profile::{Profile, ProfileButton, ProfileDevice};
pub use profile_axis::{AxisFrom, AxisPlace, ProfileAxis};
pub use raw_report::RawReport;
pub use recording::{HidRecording, RecordedEvent, RecordingHeader};
pub use recording_source::RecordingSource;
pub use recording_writer::HidRecordingWriter;
pub use response::Response;
pub use script::{Script, ScriptSample};
pub use script_source::ScriptSource;
pub use source::{Plug, ReportSource, SourceChoice, SourceEvent};
