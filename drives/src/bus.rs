//! What one kind of hardware must be able to do: a bus with its actuators, in raw units, told and asked once a period.

use krait_ipc::message::MAX_ACTUATORS;

/// One number per actuator; what stands behind the last has no meaning.
pub type PerActuator<T> = [T; MAX_ACTUATORS];

/// A bus with its actuators, opened, identified and configured. Every method may wait, none longer than a period.
pub trait ActuatorBus: Send + 'static {
    /// How many actuators there are, 1 to 12; never changes.
    fn n_actuators(&self) -> usize;

    /// Tells all actuators where to go; those under power go. Nobody acknowledges it.
    ///
    /// # Errors
    /// [`BusGone`] when the bus itself cannot be used any more.
    fn tell(&mut self, goals: &Goals) -> Result<(), BusGone>;

    /// Switches the power of all actuators; [`Seen::is_powered`] and not [`Seen::is_unguarded`] say when it has come. Under power they stay at `goals`.
    ///
    /// # Errors
    /// As [`ActuatorBus::tell`].
    fn switch(&mut self, on: bool, goals: &Goals) -> Result<(), BusGone>;

    /// Asks all actuators. One that does not answer, or answers nonsense, or what belongs to an earlier question, has not
    /// answered; the rest of it is then as it was before. After a failure the bus is quiet again.
    ///
    /// # Errors
    /// As [`ActuatorBus::tell`].
    fn ask(&mut self, seen: &mut Seen) -> Result<(), BusGone>;

    /// After the bus was gone, when power is switched anew and before anything else is told: opens it again, where it can be, and
    /// looks whether the same actuators are on it. Nothing moves.
    ///
    /// # Errors
    /// [`BusGone`] where it is still gone, or others are there.
    fn come_back(&mut self) -> Result<(), BusGone> {
        Ok(())
    }

    /// Power is switched anew on a bus that was not gone: who was silent is looked for again. Nothing moves, nothing is waited for.
    fn look_again(&mut self) {}
}

/// Where actuators shall go.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Goals {
    /// Encoder counts.
    pub counts: PerActuator<i32>,
    /// How fast, counts/s; at least 1.
    pub counts_per_s: PerActuator<f64>,
}

/// What actuators said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Whether each answered the newest question.
    pub has_answered: PerActuator<bool>,
    /// Whether each is being identified and configured, so that no answer is expected of it.
    pub is_busy: PerActuator<bool>,
    /// When each was measured last, CLOCK_MONOTONIC, nanoseconds.
    pub sampled_ns: PerActuator<i64>,
    /// Encoder counts.
    pub counts: PerActuator<i32>,
    /// The goal that each has understood, counts.
    pub goal_counts: PerActuator<i32>,
    /// Whether each is under power.
    pub is_powered: PerActuator<bool>,
    /// Whether each says, in its newest answer, that a limit or a watchdog of its own is not as it was told: nothing may begin to move.
    pub is_unguarded: PerActuator<bool>,
    /// Whether each says, in its newest answer, that nothing holds its line: its motor has no torque.
    pub has_let_go: PerActuator<bool>,
    /// What each complains of.
    pub trouble: PerActuator<Trouble>,
    /// Code of the newest emergency that each sent and has not taken back since power was switched; 0: none.
    pub emergency_code: PerActuator<u16>,
    /// Current of the motor, in the direction in which it drives the encoder, A.
    pub current_a: PerActuator<f64>,
    /// Torque of the motor, in the direction in which it drives the encoder, N m; NaN: not measured.
    pub torque_nm: PerActuator<f64>,
    /// How often each has said that it started anew.
    pub n_boots: PerActuator<u32>,
    /// Temperature, degrees Celsius; NaN: not told.
    pub temperature_celsius: PerActuator<f64>,
    /// Supply, V; NaN: not told.
    pub supply_v: PerActuator<f64>,
}

/// What an actuator complains of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Trouble {
    /// Nothing.
    #[default]
    None,
    /// It was overloaded and has let go.
    Limp,
    /// Something else that is wrong with it.
    Tripped {
        /// Its own number for it.
        code: u16,
        /// What that means.
        meaning: &'static str,
    },
    /// Hardware has switched it off: an emergency stop, a safe-torque-off or an enable input.
    HardwareStop {
        /// Its own number for it; 0: it told none.
        code: u16,
    },
}

/// The bus cannot be used any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct BusGone {
    /// What happened.
    pub what: &'static str,
}
