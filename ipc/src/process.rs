//! The processes of a chain.

/// A process of a chain; each publishes its health.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Process {
    /// Reads the operator's device.
    Master,
    /// Turns the operator's motion into motion of the snake.
    Resolve,
    /// Turns the setpoint into actuator positions.
    Compensate,
    /// Updates parameters from the measured shape.
    Estimate,
    /// Writes to the drives.
    Slave,
    /// Writes every channel to a file.
    Record,
}

impl Process {
    /// Every process, in the order of the chain.
    pub const ALL: [Self; 6] =
        [Self::Master, Self::Resolve, Self::Compensate, Self::Estimate, Self::Slave, Self::Record];

    /// The name under which the process publishes its health.
    pub fn name(self) -> &'static str {
        match self {
            Self::Master => "master",
            Self::Resolve => "resolve",
            Self::Compensate => "compensate",
            Self::Estimate => "estimate",
            Self::Slave => "slave",
            Self::Record => "record",
        }
    }
}
