//! Why something does not move, is limited or was refused: a set of simultaneous reasons, each with a sentence.

/// One reason. Its number is its bit in [`Reasons`] and its index in a health message.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// No operator present.
    OperatorAbsent = 0,
    /// The clutch is pressed.
    Clutched = 1,
    /// The hand controller fell silent while deflected or was unplugged.
    DeviceLost = 2,
    /// The newest operator input is older than its limit, ms.
    InputStale = 3,
    /// The newest setpoint is older than its limit, ms.
    SetpointStale = 4,
    /// The newest command is older than its limit, ms.
    CommandStale = 5,
    /// The newest slave state is older than its limit, ms.
    StateStale = 6,
    /// The slave is not Enabled.
    SlaveNotEnabled = 7,
    /// The slave is not homed.
    SlaveNotHomed = 8,
    /// A number was NaN or infinite.
    NotFinite = 9,
    /// A number or enumeration was outside its range.
    OutOfRange = 10,
    /// A sample came twice or before its predecessor.
    OutOfOrder = 11,
    /// Samples are missing in the sequence.
    SamplesLost = 12,
    /// The bend would pass its limit, rad.
    BendLimit = 13,
    /// The bend rate would pass its limit, rad/s.
    BendRateLimit = 14,
    /// An actuator's stroke would pass its limit, m.
    StrokeLimit = 15,
    /// An actuator's rate would pass its limit, m/s.
    ActuatorRateLimit = 16,
    /// The load of a line or of a gripper's wire would pass its limit, N.
    ForceLimit = 17,
    /// A command was too far from the slave's setpoint, m.
    StepLimit = 18,
    /// The Jacobian is near singular; motion is damped.
    NearSingular = 19,
    /// A model update was refused.
    ModelUpdateRefused = 20,
    /// A model update is being blended in.
    ModelBlending = 21,
    /// The difference to the slave's setpoint at engagement is being eased out, m.
    EasingIn = 22,
    /// The drives do not follow their setpoint, m.
    FollowingError = 23,
    /// The recording stopped (disk full, file gone).
    RecordingStopped = 24,
    /// The recorder dropped messages.
    RecordingDropped = 25,
    /// The input has come to its end.
    InputEnded = 26,
    /// The measured shape is missing or too old, ms.
    ShapeStale = 27,
    /// A drive reported a failure.
    DriveFault = 28,
    /// A command took longer than its latency budget allows, us.
    LatencyBudget = 29,
    /// The model no longer explains the measured shape as it did: a sum of innovations passed its limit.
    ModelChanged = 30,
    /// The operator has not engaged since the last event that ended an engagement.
    NotEngaged = 31,
    /// No acceptable command came for longer than the limit, ms; that ended the engagement.
    ChainStalled = 32,
    /// A process of the chain began anew or was replaced; that ended the engagement.
    StageRestarted = 33,
    /// The model was exchanged for another; that ended the engagement.
    ModelExchanged = 34,
    /// A stop was asked for; that ended the engagement.
    StopAsked = 35,
    /// A limit of the lines' load is set, and the load of a line is not measured.
    LoadUnknown = 36,
    /// A command came later than the limit after the operator's input, ms, and was not executed.
    CommandLate = 37,
    /// An actuator's acceleration would pass its limit, m/s^2.
    ActuatorAccelerationLimit = 38,
    /// An actuator's jerk would pass its limit, m/s^3.
    ActuatorJerkLimit = 39,
    /// A message rests on another model than this process: two machines in one chain.
    OtherModel = 40,
    /// A joint is near its limit and was slowed, rad.
    JointLimit = 41,
    /// A joint's rate would pass its limit, rad/s.
    JointRateLimit = 42,
    /// The measured shape is farther from the model's prediction than it should be; value: root mean square, deg, or mm of joints that slide.
    ModelMismatch = 43,
    /// It is so far that nobody may go on with this model; value: as for [`Reason::ModelMismatch`].
    MismatchTrip = 44,
    /// No command of the model brings a joint where it was wanted.
    JointUnreachable = 45,
    /// The pose of the hand jumped faster than a hand moves.
    HandJumped = 46,
    /// A formula of the model has no finite value.
    FormulaFault = 47,
    /// The actuators give way to their lines' loads, because their power is about to go or one has let go of its line; value: the
    /// largest load, N.
    Relaxing = 48,
    /// A drive sent an emergency that stops nothing.
    DriveEmergency = 49,
}

impl Reason {
    /// Every reason, in the order of its bit.
    pub const ALL: [Self; 50] = [
        Self::OperatorAbsent,
        Self::Clutched,
        Self::DeviceLost,
        Self::InputStale,
        Self::SetpointStale,
        Self::CommandStale,
        Self::StateStale,
        Self::SlaveNotEnabled,
        Self::SlaveNotHomed,
        Self::NotFinite,
        Self::OutOfRange,
        Self::OutOfOrder,
        Self::SamplesLost,
        Self::BendLimit,
        Self::BendRateLimit,
        Self::StrokeLimit,
        Self::ActuatorRateLimit,
        Self::ForceLimit,
        Self::StepLimit,
        Self::NearSingular,
        Self::ModelUpdateRefused,
        Self::ModelBlending,
        Self::EasingIn,
        Self::FollowingError,
        Self::RecordingStopped,
        Self::RecordingDropped,
        Self::InputEnded,
        Self::ShapeStale,
        Self::DriveFault,
        Self::LatencyBudget,
        Self::ModelChanged,
        Self::NotEngaged,
        Self::ChainStalled,
        Self::StageRestarted,
        Self::ModelExchanged,
        Self::StopAsked,
        Self::LoadUnknown,
        Self::CommandLate,
        Self::ActuatorAccelerationLimit,
        Self::ActuatorJerkLimit,
        Self::OtherModel,
        Self::JointLimit,
        Self::JointRateLimit,
        Self::ModelMismatch,
        Self::MismatchTrip,
        Self::JointUnreachable,
        Self::HandJumped,
        Self::FormulaFault,
        Self::Relaxing,
        Self::DriveEmergency,
    ];

    /// The reason in words that a surgeon understands.
    pub fn sentence(self) -> &'static str {
        match self {
            Self::OperatorAbsent => "the snake holds still because no operator is present",
            Self::Clutched => "the snake holds still because the clutch is pressed",
            Self::DeviceLost => "the snake holds still because the hand controller was lost",
            Self::InputStale => "the operator's input is too old to be trusted",
            Self::SetpointStale => "the setpoint is too old to be trusted",
            Self::CommandStale => "the actuator command is too old to be trusted, so the drives stopped by themselves",
            Self::StateStale => "the actuators have not reported for too long",
            Self::SlaveNotEnabled => "the actuators are not enabled",
            Self::SlaveNotHomed => "the actuators have not found their zero yet",
            Self::NotFinite => "a message held a number that is not finite and was refused",
            Self::OutOfRange => "a message held a value outside its range and was refused",
            Self::OutOfOrder => "a message came out of order and was refused",
            Self::SamplesLost => "messages were lost on the way",
            Self::BendLimit => "the snake is at the largest bend that is allowed",
            Self::BendRateLimit => "the motion was slowed to the fastest bending that is allowed",
            Self::StrokeLimit => "an actuator is at the end of its stroke",
            Self::ActuatorRateLimit => "the motion was slowed to an actuator's fastest speed",
            Self::ForceLimit => "a line, or the wire of a gripper, carries the largest load that is allowed",
            Self::StepLimit => "a command was too far from where the actuators are and was refused",
            Self::NearSingular => "the motion was damped because the snake can hardly move in that direction",
            Self::ModelUpdateRefused => "a model update was refused because it was out of bounds",
            Self::ModelBlending => "the model is being changed smoothly",
            Self::EasingIn => "the command is being eased in from where the actuators are",
            Self::FollowingError => "the drives do not follow their setpoint",
            Self::RecordingStopped => "the recording stopped; the motion is not affected",
            Self::RecordingDropped => "the recorder dropped messages; the motion is not affected",
            Self::InputEnded => "the input has come to its end",
            Self::ShapeStale => "the measured shape is missing or too old",
            Self::DriveFault => "a drive failed, so nothing may move until the fault is cleared",
            Self::LatencyBudget => "a command took longer from the hand to the actuators than its budget allows",
            Self::ModelChanged => "something about the snake has changed, and the model no longer explains its shape",
            Self::NotEngaged => "the snake holds still until the operator lets go and takes hold anew",
            Self::ChainStalled => "the way from the hand to the actuators stood still for too long",
            Self::StageRestarted => "a process between the hand and the actuators began anew",
            Self::ModelExchanged => "the model was exchanged for another",
            Self::StopAsked => "a stop was asked for",
            Self::LoadUnknown => "the load of a line is not measured although it is limited",
            Self::CommandLate => "an actuator command came too late after the hand's motion and was not executed",
            Self::ActuatorAccelerationLimit => "the motion was softened to an actuator's largest acceleration",
            Self::ActuatorJerkLimit => "the motion was softened to an actuator's largest jerk",
            Self::OtherModel => "two processes of the chain do not mean the same machine, and a message was refused",
            Self::JointLimit => "a joint is at the end of the range that is allowed",
            Self::JointRateLimit => "the motion was slowed to the fastest joint that is allowed",
            Self::ModelMismatch => "the measured shape is farther from what the model predicts than it should be",
            Self::MismatchTrip => {
                "the snake holds still because its measured shape is far from what the model predicts: look at the camera and \
                 the model, then start the chain anew"
            }
            Self::JointUnreachable => {
                "by its model no command brings a joint where it was wanted; it gets the nearest one"
            }
            Self::HandJumped => {
                "the snake holds still because the hand's pose jumped: let go, look at its tracker, and take hold anew"
            }
            Self::FormulaFault => {
                "the snake holds still because a formula of the model has no finite value here: mend the model file"
            }
            Self::Relaxing => {
                "the lines are being relaxed: the actuators slowly give way to their loads; a stop ends it"
            }
            Self::DriveEmergency => {
                "a drive sent an emergency that stops nothing: look whether it is sound; the slave's log says which drive and why"
            }
        }
    }
}

impl Reason {
    /// Unit of the value and the limit that come with the reason; empty where both are counts or multiples, or none come.
    pub fn unit(self) -> &'static str {
        match self {
            Self::InputStale
            | Self::SetpointStale
            | Self::CommandStale
            | Self::StateStale
            | Self::ShapeStale
            | Self::ChainStalled
            | Self::CommandLate => "ms",
            Self::LatencyBudget => "us",
            Self::BendLimit | Self::JointLimit => "rad",
            // Degrees of a bend or of joints that turn, millimetres of joints that slide.
            Self::ModelMismatch | Self::MismatchTrip => "deg or mm",
            Self::BendRateLimit | Self::JointRateLimit => "rad/s",
            Self::StrokeLimit | Self::StepLimit | Self::EasingIn | Self::FollowingError => "m",
            Self::ActuatorRateLimit => "m/s",
            Self::ActuatorAccelerationLimit => "m/s^2",
            Self::ActuatorJerkLimit => "m/s^3",
            Self::ForceLimit | Self::Relaxing => "N",
            Self::LoadUnknown => "lines measured",
            _ => "",
        }
    }
}

/// A set of reasons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reasons(u64);

impl Reasons {
    /// No reason.
    pub const NONE: Self = Self(0);

    /// The set with the bits of a message; bits that no reason has are dropped.
    pub fn from_bits(bits: u64) -> Self {
        Self(bits & (u64::MAX >> (crate::message::N_REASONS_MAX - Reason::ALL.len())))
    }

    /// The bits, as messages carry them.
    pub fn bits(self) -> u64 {
        self.0
    }

    /// Adds a reason.
    pub fn insert(&mut self, reason: Reason) {
        self.0 |= 1 << reason as u32;
    }

    /// The set with one reason more.
    pub fn with(mut self, reason: Reason) -> Self {
        self.insert(reason);
        self
    }

    /// Adds a reason if a condition holds.
    pub fn insert_if(&mut self, reason: Reason, holds: bool) {
        if holds {
            self.insert(reason);
        }
    }

    /// Whether the set holds a reason.
    pub fn contains(self, reason: Reason) -> bool {
        self.0 & (1 << reason as u32) != 0
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Both sets together.
    pub fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The reasons in the set.
    pub fn iter(self) -> impl Iterator<Item = Reason> {
        Reason::ALL.into_iter().filter(move |r| self.contains(*r))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_has_its_own_bit_and_fits_a_health_message() {
        for (idx, reason) in Reason::ALL.into_iter().enumerate() {
            assert_eq!(reason as usize, idx);
        }
        assert!(Reason::ALL.len() <= crate::message::N_REASONS_MAX);
    }

    #[test]
    fn unknown_bits_are_dropped() {
        let set = Reasons::from_bits(u64::MAX);
        assert_eq!(set.iter().count(), Reason::ALL.len());
    }
}
