//! What the operator wants: velocity, presence and clutch from the state of the hand controller. Pure, allocates nothing.

use crate::presence::is_down;
use crate::{HoldButton, MasterConfig, Presence, PressButton, Response};
use krait_ipc::message::{DeviceState, OperatorInput};

/// The hand controller at one instant.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    /// x, y, z, rx, ry, rz, counts.
    pub axes: [i16; 6],
    /// Buttons, bit n = button n.
    pub buttons: u32,
    /// Whether the device can be trusted.
    pub device: DeviceState,
    /// Whether whatever has axes has spoken since it was plugged in again: axes of which nothing is known are not at rest.
    pub is_heard: bool,
}

/// What the operator asks for at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorMotion {
    /// Velocity of the tip in the view frame, m/s; zero without presence, with the clutch pressed, or at rest.
    pub tip_vel_in_view_m_per_s: [f64; 3],
    /// Angular velocity of the tip in the view frame, rad/s; zero likewise.
    pub tip_angular_vel_in_view_rad_per_s: [f64; 3],
    /// Bits as in [`OperatorInput::flags`].
    pub flags: u32,
}

/// Follows presence and clutch, and maps deflection to velocity.
///
/// The loss of the device drops presence. It comes back only by a deliberate act: a toggle must be pressed again; with
/// `hold` the cap must have been still once, so that a device which comes back deflected moves nothing.
#[derive(Clone, Copy, Debug)]
pub struct Operator {
    response: Response,
    presence: Presence,
    clutch: HoldButton,
    jaw_open: HoldButton,
    jaw_close: HoldButton,
    mark: PressButton,
    is_marked: bool,
    buttons: u32,
    is_toggled_on: bool,
    must_rest_first: bool,
}

impl Operator {
    /// The operator of a configuration that has passed its check; not present yet.
    pub fn new(config: &MasterConfig) -> Self {
        Self {
            response: Response::new(config),
            presence: config.presence,
            clutch: config.clutch,
            jaw_open: config.jaw_open,
            jaw_close: config.jaw_close,
            mark: config.mark,
            is_marked: false,
            buttons: 0,
            is_toggled_on: false,
            must_rest_first: false,
        }
    }

    /// Notes a button report. Each one counts, even when a newer one is already waiting: a press must not be missed. Returns
    /// the buttons that it says were pressed since the report before.
    pub fn on_buttons(&mut self, buttons: u32) -> u32 {
        let pressed = buttons & !core::mem::replace(&mut self.buttons, buttons);
        if let Presence::Toggle(button) = self.presence
            && is_down(pressed, button)
        {
            self.is_toggled_on = !self.is_toggled_on;
        }
        self.is_marked |= self.mark.is_in(pressed);
        pressed
    }

    /// The button that has set a mark since the last call, if one has.
    pub fn take_mark(&mut self) -> Option<u8> {
        match self.mark {
            PressButton::Press(button) if core::mem::take(&mut self.is_marked) => Some(button),
            _ => None,
        }
    }

    /// Drops presence because the device was lost. Buttons count as released: nobody saw what became of them.
    pub fn on_loss(&mut self) {
        self.is_toggled_on = false;
        self.buttons = 0;
        self.must_rest_first = true;
    }

    /// What the operator asks for now.
    ///
    /// # Real-time
    /// No allocation, no blocking.
    pub fn step(&mut self, hand: &Hand) -> OperatorMotion {
        let is_trusted = matches!(hand.device, DeviceState::Live | DeviceState::AtRest);
        let vel = self.response.tip_vel_in_view_m_per_s(hand.axes);
        let turn = self.response.tip_angular_vel_in_view_rad_per_s(hand.axes);
        // A button that is pressed while a device is silent was pressed by somebody who leaves that one alone.
        let is_known = hand.is_heard || hand.buttons != 0;
        if is_trusted && is_known && vel == [0.0; 3] && turn == [0.0; 3] {
            self.must_rest_first = false;
        }
        let is_present = is_trusted
            && match self.presence {
                Presence::Hold(button) => !self.must_rest_first && is_down(hand.buttons, button),
                Presence::Toggle(_) => self.is_toggled_on,
            };
        let is_clutched = self.clutch.is_in(hand.buttons);
        let moves = is_present && !is_clutched;
        let jaw =
            if moves { jaw_flags(self.jaw_open.is_in(hand.buttons), self.jaw_close.is_in(hand.buttons)) } else { 0 };
        OperatorMotion {
            tip_vel_in_view_m_per_s: if moves { vel } else { [0.0; 3] },
            tip_angular_vel_in_view_rad_per_s: if moves { turn } else { [0.0; 3] },
            flags: flags(is_present, is_clutched) | jaw,
        }
    }
}

/// The bits of [`OperatorInput::flags`] for a jaw that is asked to move.
pub(crate) fn jaw_flags(opens: bool, closes: bool) -> u32 {
    let opens = if opens { OperatorInput::JAW_OPENS } else { 0 };
    let closes = if closes { OperatorInput::JAW_CLOSES } else { 0 };
    opens | closes
}

/// The bits of [`OperatorInput::flags`] for presence and clutch.
pub(crate) fn flags(is_present: bool, is_clutched: bool) -> u32 {
    let present = if is_present { OperatorInput::OPERATOR_PRESENT } else { 0 };
    let clutched = if is_clutched { OperatorInput::CLUTCH } else { 0 };
    present | clutched
}

#[cfg(test)]
mod tests {
    use super::*;

    const PUSHED: [i16; 6] = [200, 0, 0, 0, 0, 0];

    fn operator(presence: Presence) -> Operator {
        Operator::new(&MasterConfig { presence, ..MasterConfig::default() })
    }

    fn is_moving(operator: &mut Operator, axes: [i16; 6], buttons: u32, device: DeviceState) -> bool {
        let motion = operator.step(&Hand { axes, buttons, device, is_heard: true });
        let is_moving = motion.tip_vel_in_view_m_per_s != [0.0; 3];
        assert!(!is_moving || motion.flags == OperatorInput::OPERATOR_PRESENT, "motion needs presence and no clutch");
        is_moving
    }

    #[test]
    fn nothing_moves_before_the_toggle_is_pressed_nor_after_it_is_pressed_again() {
        let mut op = operator(Presence::Toggle(0));
        assert!(!is_moving(&mut op, PUSHED, 0, DeviceState::Live));
        op.on_buttons(1);
        op.on_buttons(0);
        assert!(is_moving(&mut op, PUSHED, 0, DeviceState::Live));
        op.on_buttons(1);
        assert!(!is_moving(&mut op, PUSHED, 1, DeviceState::Live));
    }

    #[test]
    fn the_clutch_stops_the_snake_but_keeps_presence() {
        let mut op = operator(Presence::Toggle(0));
        op.on_buttons(1);
        let motion = op.step(&Hand { axes: PUSHED, buttons: 2, device: DeviceState::Live, is_heard: true });
        assert_eq!(motion.tip_vel_in_view_m_per_s, [0.0; 3]);
        assert_eq!(motion.flags, OperatorInput::OPERATOR_PRESENT | OperatorInput::CLUTCH);
    }

    #[test]
    fn a_lost_device_drops_presence_until_the_toggle_is_pressed_again() {
        let mut op = operator(Presence::Toggle(0));
        op.on_buttons(1);
        op.on_loss();
        assert!(!is_moving(&mut op, PUSHED, 1, DeviceState::Lost));
        assert!(!is_moving(&mut op, PUSHED, 1, DeviceState::Live), "coming back is not enough");
        op.on_buttons(1);
        assert!(is_moving(&mut op, PUSHED, 1, DeviceState::Live));
    }

    #[test]
    fn a_device_that_comes_back_deflected_moves_nothing_until_it_was_still() {
        let mut op = operator(Presence::Hold(3));
        assert!(is_moving(&mut op, PUSHED, 8, DeviceState::Live));
        op.on_loss();
        assert!(!is_moving(&mut op, PUSHED, 8, DeviceState::Live));
        assert!(!is_moving(&mut op, [0; 6], 8, DeviceState::AtRest));
        assert!(is_moving(&mut op, PUSHED, 8, DeviceState::Live));
    }

    #[test]
    fn each_press_of_the_mark_button_is_one_mark_and_moves_nothing() {
        let mut op = Operator::new(&MasterConfig { mark: PressButton::Press(5), ..MasterConfig::default() });
        assert_eq!(op.take_mark(), None);
        for _ in 0..2 {
            op.on_buttons(1 << 5);
            op.on_buttons(1 << 5);
            assert_eq!((op.take_mark(), op.take_mark()), (Some(5), None), "held is not pressed again");
            op.on_buttons(0);
            assert_eq!(op.take_mark(), None);
        }
        assert!(!is_moving(&mut op, PUSHED, 0, DeviceState::Live));
        let mut without = Operator::new(&MasterConfig { mark: PressButton::None, ..MasterConfig::default() });
        without.on_buttons(u32::MAX);
        assert_eq!(without.take_mark(), None);
    }

    #[test]
    fn the_jaw_is_asked_to_move_while_its_button_is_held_by_a_present_operator_and_the_clutch_is_up() {
        let mut op = Operator::new(&MasterConfig {
            jaw_open: HoldButton::Hold(4),
            jaw_close: HoldButton::Hold(5),
            ..MasterConfig::default()
        });
        let asked = |op: &mut Operator, buttons, device| {
            let flags = op.step(&Hand { axes: [0; 6], buttons, device, is_heard: true }).flags;
            flags & (OperatorInput::JAW_OPENS | OperatorInput::JAW_CLOSES)
        };
        assert_eq!(asked(&mut op, 1 << 4, DeviceState::Live), 0, "nobody is present");
        op.on_buttons(1);
        assert_eq!(asked(&mut op, 1 << 4, DeviceState::Live), OperatorInput::JAW_OPENS);
        assert_eq!(asked(&mut op, 1 << 5, DeviceState::AtRest), OperatorInput::JAW_CLOSES);
        assert_eq!(asked(&mut op, 1 << 5 | 1 << 1, DeviceState::Live), 0, "the clutch is pressed");
        assert_eq!(asked(&mut op, 1 << 5, DeviceState::Lost), 0, "the device is lost");
    }

    #[test]
    fn an_untrusted_device_never_means_presence() {
        for device in [DeviceState::Waiting, DeviceState::Lost, DeviceState::Ended] {
            assert!(!is_moving(&mut operator(Presence::Hold(3)), PUSHED, 8, device));
        }
    }
}
