//! The page's words: the state that is shown, and what holds the motion back, worst first.

use krait_ipc::Reason;
use krait_ipc::message::{DeviceState, OperatingState, Phase, SlaveState};
use serde::Serialize;

/// How much a reason matters; the order is that of the list on the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Something failed.
    Fault,
    /// Something needs attention.
    Warn,
    /// It holds still because it shall.
    Hold,
    /// Good to know.
    Info,
}

/// A reason in the page's words.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Words {
    /// How much it matters.
    pub level: Level,
    /// One short sentence of at most 32 characters: it has one line of the banner at every width, readable at two metres.
    pub say: &'static str,
    /// What to do about it; empty where there is nothing to do.
    pub todo: &'static str,
    /// The banner's sentence while this limits the motion; at most 48 characters.
    pub banner: &'static str,
}

/// What the page says about a reason.
pub fn words_of(reason: Reason) -> Words {
    use Level::{Fault, Hold, Info, Warn};
    let words = |level, say, todo, banner| Words { level, say, todo, banner };
    match reason {
        Reason::OperatorAbsent => words(Hold, "No operator is present.", "", ""),
        Reason::Clutched => words(Hold, "The clutch is pressed.", "Release it to go on from here.", ""),
        Reason::SlaveNotEnabled => {
            words(Hold, "The drives may not move.", "Enable or resume when the field is clear.", "")
        }
        Reason::SlaveNotHomed => words(Hold, "The drives have no zero yet.", "Home them, or wait until they have.", ""),
        Reason::InputEnded => words(Hold, "The input has come to its end.", "Start another one, or end the run.", ""),
        Reason::EasingIn => words(Info, "The motion eases in.", "It begins where the drives are.", ""),
        Reason::ModelBlending => words(Info, "The model changes smoothly.", "", ""),
        Reason::BendLimit => {
            words(Warn, "Largest bend reached.", "Steer back to go on.", "Largest bend reached \u{2013} steer back.")
        }
        Reason::JointRateLimit => {
            words(Warn, "A joint is at its fastest.", "It follows more slowly.", "Faster than a joint may move.")
        }
        Reason::BendRateLimit => {
            words(Warn, "Fastest bending reached.", "The snake follows more slowly.", "Faster than the snake may bend.")
        }
        Reason::StrokeLimit => words(
            Warn,
            "An actuator is at its end.",
            "Steer back to go on.",
            "End of an actuator\u{2019}s stroke \u{2013} steer back.",
        ),
        Reason::ActuatorRateLimit => words(
            Warn,
            "An actuator is at its fastest.",
            "The snake follows more slowly.",
            "Faster than an actuator may move.",
        ),
        Reason::ForceLimit => words(
            Warn,
            "A line is at its largest load.",
            "Steer back to unload it.",
            "Largest load of a line \u{2013} steer back.",
        ),
        Reason::NearSingular => words(
            Warn,
            "It can hardly move that way.",
            "Steer in another direction.",
            "It can hardly move in that direction.",
        ),
        Reason::HandJumped => words(Warn, "The hand\u{2019}s pose jumped.", "Let go, then take hold anew.", ""),
        Reason::FormulaFault => words(Warn, "A formula has no value.", "Mend the model file.", ""),
        Reason::DeviceLost => words(Warn, "The hand controller is lost.", "Check its plug.", ""),
        Reason::ShapeStale => words(
            Warn,
            "The camera\u{2019}s shape is missing.",
            "Only the command is drawn.",
            "The measured shape is missing.",
        ),
        Reason::LatencyBudget => words(Warn, "A command came late.", "See Latency.", ""),
        Reason::SamplesLost => words(Warn, "Messages were lost.", "See Latency.", ""),
        Reason::ModelChanged => {
            words(Warn, "The snake has changed.", "The model no longer explains it; diagnose a recording.", "")
        }
        Reason::ModelUpdateRefused => words(Warn, "A model update was refused.", "It was out of bounds.", ""),
        Reason::RecordingStopped => words(Warn, "The recording stopped.", "The motion is not affected.", ""),
        Reason::RecordingDropped => words(Warn, "The recording has gaps.", "The motion is not affected.", ""),
        Reason::DriveFault => words(Fault, "The drives are in fault.", "Clear the fault, then enable.", ""),
        Reason::FollowingError => words(Fault, "The drives do not follow.", "Check the actuators.", ""),
        Reason::CommandStale => words(Fault, "Commands stopped coming.", "The drives hold by themselves.", ""),
        Reason::StateStale => words(Fault, "The drives do not report.", "Look at the robot.", ""),
        Reason::InputStale => words(Fault, "The hand\u{2019}s input is too old.", "See Latency.", ""),
        Reason::SetpointStale => words(Fault, "The setpoint is too old.", "See Latency.", ""),
        Reason::StepLimit => words(Fault, "A command leapt.", "It was refused; see Latency.", ""),
        Reason::NotEngaged => words(Hold, "Let go, then take hold anew.", "Nothing moves before that.", ""),
        Reason::ChainStalled => words(Warn, "Nothing reached the drives.", "Let go, then take hold anew.", ""),
        Reason::StageRestarted => words(Warn, "A process began anew.", "Let go, then take hold anew.", ""),
        Reason::ModelExchanged => words(Info, "The model was exchanged.", "Let go, then take hold anew.", ""),
        Reason::StopAsked => words(Hold, "A stop was asked for.", "Resume when the field is clear.", ""),
        Reason::Relaxing => words(Warn, "The lines are being relaxed.", "Keep clear; a stop ends it.", ""),
        Reason::DriveEmergency => {
            words(Warn, "A drive sent an emergency.", "It goes on; the log says which and why.", "")
        }
        Reason::LoadUnknown => words(Warn, "A line\u{2019}s load is not measured.", "Its limit cannot be kept.", ""),
        Reason::CommandLate => words(Warn, "A command came too late.", "It was not executed; see Latency.", ""),
        Reason::ActuatorAccelerationLimit => {
            words(Info, "The acceleration is limited.", "The motion is softened to its largest acceleration.", "")
        }
        Reason::ActuatorJerkLimit => {
            words(Info, "The jerk is limited.", "The motion is softened to its largest jerk.", "")
        }
        Reason::JointLimit => words(
            Warn,
            "A joint is at its range\u{2019}s end.",
            "Steer back to go on.",
            "End of a joint\u{2019}s range \u{2013} steer back.",
        ),
        Reason::JointUnreachable => words(
            Warn,
            "A joint cannot get there.",
            "By the model; it gets the nearest one.",
            "A joint cannot reach that \u{2013} steer back.",
        ),
        Reason::ModelMismatch => {
            words(Warn, "The shape is off the model.", "It is measured; look at camera and model.", "")
        }
        Reason::MismatchTrip => {
            words(Fault, "The shape is far off the model.", "Look at camera and model; start anew.", "")
        }
        Reason::OtherModel => {
            words(Fault, "Processes mean two machines.", "Start all with one model; see Latency.", "")
        }
        Reason::NotFinite => words(Fault, "A message lacked a number.", "It was refused; see Latency.", ""),
        Reason::OutOfRange => words(Fault, "A message was out of range.", "It was refused; see Latency.", ""),
        Reason::OutOfOrder => words(Fault, "A message was out of order.", "It was refused; see Latency.", ""),
    }
}

/// The state that the banner shows: the first that holds, from top to bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// Nothing arrives from the robot.
    Stale,
    /// The machine's own emergency stop, or another hardware input, took the drives' power: a drive reports it.
    Emergency,
    /// The drives failed.
    Fault,
    /// Drive power is off.
    Disabled,
    /// The drives are finding their zero.
    Homing,
    /// Power was asked off; before, the drives give way to their lines' loads.
    Relaxing,
    /// Held still, power on.
    Paused,
    /// The hand controller is lost.
    Lost,
    /// The clutch is pressed.
    Clutched,
    /// Enabled; no operator.
    Ready,
    /// Enabled and an operator present, and yet held.
    Holding,
    /// Follows, shortened by a limit.
    Limited,
    /// Follows.
    Following,
}

impl Shown {
    /// Its name, and what it means; the page has the same words beside its shapes (`web/js/states.js`).
    const fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Stale => ("No picture", "Nothing arrives from the robot."),
            Self::Emergency => ("Emergency stop", "The machine\u{2019}s own stop cut the drives\u{2019} power."),
            Self::Fault => ("Fault", "The drives failed; nothing may move."),
            Self::Disabled => ("Disabled", "Drive power is off."),
            Self::Homing => ("Homing", "The drives are finding their zero. Keep clear."),
            Self::Relaxing => ("Relaxing", "The lines are relaxed, then power goes off."),
            Self::Paused => ("Paused", "Holding still, power on."),
            Self::Lost => ("Device lost", "Holding still: the operator\u{2019}s controls are lost."),
            Self::Clutched => ("Clutched", "Your hand is free; the snake holds still."),
            Self::Ready => ("Ready", "Holding still; no operator is present."),
            Self::Holding => ("Holding", "Holding still; the reasons stand below."),
            Self::Limited => ("Limited", "It follows, up to a limit."),
            Self::Following => ("Following", "The snake follows your hand."),
        }
    }

    /// Its name.
    pub const fn word(self) -> &'static str {
        self.words().0
    }

    /// What it means, in one sentence.
    pub const fn sentence(self) -> &'static str {
        self.words().1
    }
}

/// What a state in FAULT says of the drives, by their own report; at most 48 characters.
pub fn fault_sentence(state: &SlaveState) -> String {
    match (state.failed_drive(), state.flags & SlaveState::OTHERS_HOLD != 0) {
        (Some(drive), true) if state.is_hardware_stopped() => {
            format!("Hardware cut drive {drive} off; the others hold.")
        }
        _ if state.is_hardware_stopped() => Shown::Emergency.sentence().to_owned(),
        (Some(drive), true) => format!("Drive {drive} failed; the others hold."),
        (Some(drive), false) => format!("Drive {drive} failed; the others do not hold."),
        (None, true) => "The drives failed and hold.".to_owned(),
        (None, false) => "The drives failed and do not hold.".to_owned(),
    }
}

/// What the state to be shown depends on.
#[derive(Clone, Copy, Debug)]
pub struct ShownState<'a> {
    /// The newest state that is fresh enough.
    pub state: Option<&'a SlaveState>,
    /// What is known of the hand controller.
    pub device: Option<DeviceState>,
    /// Whether an operator is present.
    pub is_present: bool,
    /// Whether the clutch is pressed.
    pub is_clutched: bool,
    /// Whether the newest setpoint follows, however old that is.
    pub phase: Option<Phase>,
    /// Whether a limit shortens the motion.
    pub is_limited: bool,
}

impl ShownState<'_> {
    /// The state to be shown.
    pub fn shown(&self) -> Shown {
        let Some(state) = self.state else { return Shown::Stale };
        match state.operating() {
            Some(OperatingState::Fault) if state.is_hardware_stopped() => return Shown::Emergency,
            None | Some(OperatingState::Fault) => return Shown::Fault,
            Some(OperatingState::Disabled) => return Shown::Disabled,
            _ if state.flags & SlaveState::IS_BUSY != 0 => return Shown::Homing,
            Some(OperatingState::Paused) if state.is_letting_go() => return Shown::Relaxing,
            Some(OperatingState::Paused) => return Shown::Paused,
            Some(OperatingState::Enabled) => {}
        }
        match self.phase {
            _ if self.device == Some(DeviceState::Lost) => Shown::Lost,
            _ if self.is_clutched => Shown::Clutched,
            _ if !self.is_present => Shown::Ready,
            // What the stages before last said of following stays where they hang; the slave knows whether anything moves.
            _ if !state.is_engaged() => Shown::Holding,
            Some(Phase::Following) if self.is_limited => Shown::Limited,
            Some(Phase::Following) => Shown::Following,
            Some(Phase::Holding) | None => Shown::Holding,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reason_has_words_of_its_own_that_fit_and_a_level_whose_mark_the_page_has() {
        let marks = include_str!("../web/js/states.js").split_once("export const MARKS").expect("marks").1;
        for reason in Reason::ALL {
            let Words { level, say, todo, banner } = words_of(reason);
            assert!(say != reason.sentence(), "{reason:?} has the chain's sentence and no words of its own");
            let is_sentence = |text: &str| {
                text.starts_with(|first: char| first.is_uppercase())
                    && text.ends_with(['.', '!'])
                    && !text.contains("  ")
            };
            assert!(is_sentence(say) && say.chars().count() <= 32, "{reason:?}: {say}");
            assert!(todo.is_empty() || is_sentence(todo) && todo.chars().count() <= 56, "{reason:?}: {todo}");
            assert!(banner.is_empty() || is_sentence(banner) && banner.chars().count() <= 48, "{reason:?}: {banner}");
            let name = serde_json::to_value(level).expect("a word");
            let name = name.as_str().expect("a word");
            assert!(marks.contains(&format!("\n  {name}: mark(")), "{reason:?}: states.js has no mark for {name}");
            let n_alike = Reason::ALL.iter().filter(|other| words_of(**other).say == say).count();
            assert_eq!(n_alike, 1, "{reason:?}: two reasons that say the same: {say}");
        }
    }

    #[test]
    fn the_page_has_the_same_words_for_a_state() {
        use Shown::{
            Clutched, Disabled, Emergency, Fault, Following, Holding, Homing, Limited, Lost, Paused, Ready, Relaxing,
            Stale,
        };
        let page = include_str!("../web/js/states.js");
        for state in [
            Stale, Emergency, Fault, Disabled, Homing, Relaxing, Paused, Lost, Clutched, Ready, Holding, Limited,
            Following,
        ] {
            // On the page the reasons stand beside the state, in a terminal below it.
            let say = state.sentence().replace("stand below", "stand on the right");
            assert!(say.chars().count() <= 48, "{say}");
            let both = format!("word: '{}', say: '{say}'", state.word());
            assert!(page.contains(&both), "states.js lacks {both}");
        }
    }

    #[test]
    fn a_fault_names_the_drive_and_an_emergency_stop_is_no_fault() {
        let fault =
            |flags| SlaveState { operating_state: OperatingState::Fault as u32, flags, ..SlaveState::default() };
        let shown = |state: &SlaveState| {
            let all = ShownState {
                state: Some(state),
                device: None,
                is_present: true,
                is_clutched: false,
                phase: Some(Phase::Following),
                is_limited: false,
            };
            all.shown()
        };
        let second = SlaveState::failed_drive_flags(2);
        let (failed, stopped) = (fault(second | SlaveState::OTHERS_HOLD), fault(second | SlaveState::HARDWARE_STOP));
        assert_eq!((shown(&failed), shown(&stopped)), (Shown::Fault, Shown::Emergency));
        assert_eq!(fault_sentence(&failed), "Drive 2 failed; the others hold.");
        assert_eq!(fault_sentence(&stopped), Shown::Emergency.sentence());
        let alone = fault(stopped.flags | SlaveState::OTHERS_HOLD);
        assert_eq!(fault_sentence(&alone), "Hardware cut drive 2 off; the others hold.");
        let mut enabled = stopped;
        enabled.operating_state = OperatingState::Enabled as u32;
        assert_eq!(shown(&enabled), Shown::Holding, "the setpoint says that it follows, and the drives do not");
        enabled.flags |= SlaveState::ENGAGED;
        assert_eq!(shown(&enabled), Shown::Following, "the flag of the stop counts in FAULT only");
        for flags in [0, SlaveState::OTHERS_HOLD, SlaveState::failed_drive_flags(12)] {
            let sentence = fault_sentence(&fault(flags));
            assert!(sentence.chars().count() <= 48, "{sentence}");
        }
    }

    #[test]
    fn paused_on_the_way_to_disabled_is_relaxing_until_the_power_has_gone() {
        let shown = |operating: OperatingState, desired: OperatingState| {
            let state = SlaveState {
                operating_state: operating as u32,
                desired_state: desired as u32,
                ..SlaveState::default()
            };
            let all = ShownState {
                state: Some(&state),
                device: None,
                is_present: true,
                is_clutched: false,
                phase: None,
                is_limited: false,
            };
            all.shown()
        };
        use OperatingState::{Disabled, Fault, Paused};
        assert_eq!(shown(Paused, Disabled), Shown::Relaxing);
        assert_eq!(shown(Paused, Paused), Shown::Paused);
        assert_eq!((shown(Disabled, Disabled), shown(Fault, Disabled)), (Shown::Disabled, Shown::Fault));
    }

    #[test]
    fn silence_is_never_shown_as_good_news() {
        let nothing = ShownState {
            state: None,
            device: None,
            is_present: true,
            is_clutched: false,
            phase: Some(Phase::Following),
            is_limited: false,
        };
        assert_eq!(nothing.shown(), Shown::Stale);
    }
}
