//! What became of every line, by name.

use krait_ipc::Reason;
use serde::Serialize;

/// Why a line was refused: nothing is published for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeRefusal {
    /// It is no line of the format.
    Malformed,
    /// It is longer than a line may be.
    TooLong,
    /// It came before a header that could be read.
    NoHeader,
    /// A number is not finite.
    NotFinite,
    /// A number is outside its range.
    OutOfRange,
    /// Its clock cannot be mapped.
    NoClock,
    /// Its exposure lies ahead of its arrival.
    Future,
    /// Its exposure is too long ago.
    Stale,
    /// Its exposure or its frame does not follow the one before.
    OutOfOrder,
}

impl ShapeRefusal {
    /// The reason under which the process's health counts it.
    pub fn reason(self) -> Reason {
        match self {
            Self::NotFinite => Reason::NotFinite,
            Self::Stale => Reason::ShapeStale,
            Self::OutOfOrder => Reason::OutOfOrder,
            Self::Malformed | Self::TooLong | Self::NoHeader | Self::NoClock | Self::OutOfRange | Self::Future => {
                Reason::OutOfRange
            }
        }
    }

    /// What was wrong, as a sentence goes on behind "line 7 was refused: ".
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Malformed => "it is no line of the format in docs/shapes.md",
            Self::TooLong => "it is longer than 4096 bytes",
            Self::NoHeader => "no header came before it; begin with {\"krait_shapes\": 1, \"clock\": ...}",
            Self::NotFinite => "it holds a number that is not finite",
            Self::OutOfRange => {
                "a bend or joint is beyond half a turn, a covariance is none, or a stamp is beyond all time"
            }
            Self::NoClock => {
                "its clock is the program's own, and neither \"offset_ns\" nor \"sent_ns\", for a second, says how that maps"
            }
            Self::Future => "its exposure lies in the future",
            Self::Stale => "its exposure is too long ago",
            Self::OutOfOrder => "its exposure or its frame does not follow the one before",
        }
    }
}

/// What was found besides about a shape that was published.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeFinding {
    /// It came late, but can still be used.
    Late,
    /// Frames are missing before it.
    Dropped,
    /// It cannot follow the one before at any speed of the machine.
    Outlying,
    /// It does not show the machine.
    Lost,
}

impl ShapeFinding {
    /// The reason under which the process's health counts it.
    pub fn reason(self) -> Reason {
        match self {
            Self::Late | Self::Lost => Reason::ShapeStale,
            Self::Dropped => Reason::SamplesLost,
            Self::Outlying => Reason::OutOfRange,
        }
    }
}

/// Lines since the start, by what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Lines read, headers included.
    pub lines: u64,
    /// Headers.
    pub headers: u64,
    /// Shapes published, those of the next three kinds included.
    pub published: u64,
    /// Published, but late.
    pub late: u64,
    /// Published as outlying, to be used by nobody.
    pub outlying: u64,
    /// Published as a lost view.
    pub lost_view: u64,
    /// Frames that are missing between those that came, by their own numbers.
    pub dropped: u64,
    /// Refused: no line of the format.
    pub malformed: u64,
    /// Refused: longer than a line may be.
    pub too_long: u64,
    /// Refused: before a header.
    pub no_header: u64,
    /// Refused: a number that is not finite.
    pub not_finite: u64,
    /// Refused: a number outside its range.
    pub out_of_range: u64,
    /// Refused: a clock that cannot be mapped.
    pub no_clock: u64,
    /// Refused: an exposure in the future.
    pub future: u64,
    /// Refused: an exposure too long ago.
    pub stale: u64,
    /// Refused: not after the one before.
    pub out_of_order: u64,
}

impl Counts {
    /// Counts a refused line.
    pub fn refuse(&mut self, refusal: ShapeRefusal) {
        *match refusal {
            ShapeRefusal::Malformed => &mut self.malformed,
            ShapeRefusal::TooLong => &mut self.too_long,
            ShapeRefusal::NoHeader => &mut self.no_header,
            ShapeRefusal::NotFinite => &mut self.not_finite,
            ShapeRefusal::OutOfRange => &mut self.out_of_range,
            ShapeRefusal::NoClock => &mut self.no_clock,
            ShapeRefusal::Future => &mut self.future,
            ShapeRefusal::Stale => &mut self.stale,
            ShapeRefusal::OutOfOrder => &mut self.out_of_order,
        } += 1;
    }

    /// Lines refused, whatever the reason.
    pub fn refused(&self) -> u64 {
        self.malformed
            + self.too_long
            + self.no_header
            + self.not_finite
            + self.out_of_range
            + self.no_clock
            + self.future
            + self.stale
            + self.out_of_order
    }

    /// Every count that is not zero, with its name.
    pub fn named(&self) -> Vec<(&'static str, u64)> {
        let all = [
            ("late", self.late),
            ("outlying", self.outlying),
            ("without the machine in view", self.lost_view),
            ("frames missing", self.dropped),
            ("refused as malformed", self.malformed),
            ("refused as too long", self.too_long),
            ("refused before a header", self.no_header),
            ("refused as not finite", self.not_finite),
            ("refused as out of range", self.out_of_range),
            ("refused without a clock", self.no_clock),
            ("refused as from the future", self.future),
            ("refused as stale", self.stale),
            ("refused as out of order", self.out_of_order),
        ];
        all.into_iter().filter(|(_, count)| *count > 0).collect()
    }
}
