//! krait-schema: the public form of every message: protobuf types, their descriptors and topics, and the bytes of a sample.
//!
//! Purpose: recordings, pages and other programs speak one format, and nobody needs the recorder to read or write it.
//!
//! Terms: a *sample* is one message of one channel; a *mirror* is the protobuf type of a message in shared memory.
//!
//! Frames and units: those of `krait_ipc::message`; every field carries its unit in its name, also in protobuf.

#![forbid(unsafe_code)]

mod channel;
mod convert;
/// Types generated from `proto/`, where every message is documented.
#[allow(missing_docs, clippy::all, reason = "generated from proto/, where every message is documented")]
pub mod generated {
    pub mod krait {
        include!(concat!(env!("OUT_DIR"), "/krait.rs"));
    }
    pub mod foxglove {
        include!(concat!(env!("OUT_DIR"), "/foxglove.rs"));
    }
    pub mod google {
        pub mod protobuf {
            include!(concat!(env!("OUT_DIR"), "/google.protobuf.rs"));
        }
    }
}
mod proto {
    pub(crate) use crate::generated::krait::*;
}
mod source;
mod status;
mod view;

pub use channel::{Channel, Sample, Schema, decode, encode};
pub use source::SampleSource;
pub use status::{ChannelCounts, RecorderStatus};
pub use view::View;
