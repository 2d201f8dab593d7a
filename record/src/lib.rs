//! krait-record: every channel of krait in one MCAP file, and back.
//!
//! Purpose: a recording holds everything that a replay, a comparison or a post-mortem needs, opens in the public viewers
//! without an extension, and is made without ever waking or slowing a writer.
//!
//! Terms: a *sample* is one message of one channel; *dropped* samples were taken from shared memory and not written; *lost*
//! ones never reached the recorder; a *chunk* is what is compressed, indexed and handed to the file at once.
//!
//! Frames and units: those of `krait_ipc::message`; every field carries its unit in its name, also in the file. Log times
//! are wall-clock nanoseconds since 1970; stamps inside the messages stay CLOCK_MONOTONIC, and the metadata record `krait`
//! holds the offset between the two.
//!
//! Layout of a file: header (profile `krait`); metadata `krait` (who, where, with what); attachments (the configuration);
//! chunks with their message indexes; metadata `krait.end` (totals, why it ended); summary with all indexes. The file is
//! written append-only under its final name, so that what a killed recorder leaves behind is a prefix of a good file.
//!
//! ```no_run
//! use krait_record::Recording;
//! use krait_schema::Sample;
//! let recording = Recording::open("recordings/demo.mcap".as_ref())?;
//! for gap in &recording.contents().missing {
//!     eprintln!("{gap}");
//! }
//! for recorded in recording.samples()? {
//!     if let Sample::Command(command) = recorded?.sample {
//!         let _positions = command.q_tilde_m;
//!     }
//! }
//! # Ok::<(), krait_record::RecordingReadError>(())
//! ```

#![forbid(unsafe_code)]

mod about;
mod between;
mod chunk;
pub mod columns;
mod config;
mod contents;
mod disk;
mod drain;
mod error;
mod foreign;
mod framing;
mod parse;
mod parts;
mod passes;
mod reader;
mod recorder;
mod recover;
mod sink;
mod stream;
mod syncer;
mod tally;
mod views;
mod wall_clock;
mod writer;

pub use about::{About, Attachment, CONFIG_ATTACHMENT, MODEL_ATTACHMENT};
pub use between::samples_between;
pub use config::RecordConfig;
pub use contents::{ChannelContents, Contents, Missing};
pub use error::{RecordError, RecordingReadError};
pub use foreign::{ForeignTopic, foreign_messages, is_foreign};
pub use passes::{Pass, PassCounter, attachment, passes_of};
pub use reader::{Recorded, Recording, Samples};
pub use recorder::{RecordReport, run};
pub use recover::{RecoverError, Recovered, recover};
pub use sink::RecordingSink;
pub use stream::Stream;
pub use views::{Derived, DrawnMachine, Views};
pub use wall_clock::{WallClock, utc_text};
pub use writer::RecordingWriter;
