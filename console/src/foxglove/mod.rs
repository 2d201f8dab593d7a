//! The Foxglove WebSocket protocol, read-only, for engineers' own viewers: whoever has the reading token sees every channel of
//! the chain as a recording has it, the tracking error and the bends in degrees. Nothing that a viewer says reaches the chain.
//!
//! The token stands in the address, since a viewer has no cookie of the page's; it reads and does nothing else.

mod feed;
mod figures;
mod socket;
mod wire;

pub(crate) use socket::{Viewers, added_to};

use crate::facts::Facts;
use crate::guard::Token;
use krait_record::Views;
use std::sync::Arc;

/// How viewers are served.
#[derive(Debug)]
pub struct FoxgloveSettings {
    /// What is drawn for viewers, as in a recording.
    pub views: Views,
    /// Origins of further pages that may read, as a browser writes them: `https://viewer.example`.
    pub origins: Vec<String>,
}

/// The machine of a chain that took another one's place, as viewers are served it.
pub(crate) type NewMachine = (Arc<Facts>, Views);

/// Path under which a token's holder reads.
pub(crate) fn path_of(token: &Token) -> String {
    format!("/foxglove/{}", token.digits())
}
