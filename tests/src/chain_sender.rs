//! What a chain says without a chain: a slave's state, an operator's input, a setpoint, each as a test says.

use core::time::Duration;
use krait_ipc::message::{
    DeviceState, HopStamps, Message, OperatingState, OperatorInput, Phase, Setpoint, Shape, SlaveState,
};
use krait_ipc::{Bus, Reason, Writer, clock};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// What is said of a chain; of what is absent nothing is said.
#[derive(Clone, Copy, Default)]
pub struct ChainScene {
    /// What the drives do.
    pub state: Option<SlaveState>,
    /// What the operator does.
    pub input: Option<OperatorInput>,
    /// Where the snake shall be.
    pub setpoint: Option<Setpoint>,
    /// What the camera sees.
    pub shape: Option<Shape>,
}

impl ChainScene {
    /// Drives in a state, with flags and reasons.
    pub fn of(operating: OperatingState, flags: u32, reasons: &[Reason]) -> Self {
        let state = SlaveState {
            operating_state: operating as u32,
            desired_state: operating as u32,
            flags,
            n_actuators: 3,
            reasons: reasons.iter().fold(0, |bits, reason| bits | 1 << *reason as u32),
            ..SlaveState::default()
        };
        Self { state: Some(state), ..Self::default() }
    }

    /// The same with an operator whose input has these flags, and a setpoint of a straight snake that holds or follows.
    pub fn driven(self, flags: u32, device: DeviceState, phase: Phase) -> Self {
        let input = OperatorInput {
            sequence: 0,
            sample_ns: 0,
            stamps: HopStamps::default(),
            tip_vel_in_view_m_per_s: [0.0; 3],
            tip_angular_vel_in_view_rad_per_s: [0.0; 3],
            raw_axes: [0; 6],
            flags,
            buttons: 0,
            device_state: device as u32,
            scale_permille: 1000,
            n_reports: 0,
            n_drained: 0,
            n_refused: 0,
        };
        let setpoint = Setpoint { motion_scale: 1.0, phase: phase as u32, ..Setpoint::default() };
        Self { input: Some(input), setpoint: Some(setpoint), ..self }
    }
}

#[derive(Default)]
struct Told {
    scene: ChainScene,
    ends: bool,
}

/// Says a scene sixty times a second, until it is dropped.
pub struct ChainSender {
    told: Arc<Mutex<Told>>,
    thread: Option<JoinHandle<()>>,
}

impl ChainSender {
    /// Begins in an instance with a slave in FAULT, without flags and reasons.
    pub fn start(instance: &str) -> Self {
        let bus = Bus::open(instance, "slave").expect("bus");
        let told = Arc::new(Mutex::new(Told::default()));
        let own = Arc::clone(&told);
        let thread = std::thread::spawn(move || {
            let mut states = bus.writer::<SlaveState>().expect("the writer");
            let mut inputs = bus.writer::<OperatorInput>().expect("the writer");
            let mut setpoints = bus.writer::<Setpoint>().expect("the writer");
            let mut shapes = bus.writer::<Shape>().expect("the writer");
            for sequence in 1.. {
                let Told { scene, ends } = *own.lock().unwrap_or_else(PoisonError::into_inner);
                let sample_ns = clock::monotonic_ns();
                send(&mut states, scene.state.map(|state| SlaveState { sequence, sample_ns, ..state }));
                send(&mut inputs, scene.input.map(|input| OperatorInput { sequence, sample_ns, ..input }));
                send(&mut setpoints, scene.setpoint.map(|setpoint| Setpoint { sequence, sample_ns, ..setpoint }));
                let seen = |shape| Shape { sequence, sample_ns, available_ns: sample_ns, ..shape };
                send(&mut shapes, scene.shape.map(seen));
                if ends {
                    return;
                }
                std::thread::sleep(Duration::from_millis(16));
            }
        });
        let sender = Self { told, thread: Some(thread) };
        sender.say_fault(0, &[]);
        sender
    }

    /// From now on this is said.
    pub fn say(&self, scene: ChainScene) {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).scene = scene;
    }

    /// From now on the slave is in FAULT, with these flags and reasons, and nothing else is said.
    pub fn say_fault(&self, flags: u32, reasons: &[Reason]) {
        self.say(ChainScene::of(OperatingState::Fault, flags, reasons));
    }
}

fn send<M: Message>(writer: &mut Writer<M>, message: Option<M>) {
    if let Some(message) = message {
        writer.send(&message).expect("sent");
    }
}

impl Drop for ChainSender {
    fn drop(&mut self) {
        self.told.lock().unwrap_or_else(PoisonError::into_inner).ends = true;
        if let Some(thread) = self.thread.take() {
            thread.join().expect("it sent to the end");
        }
    }
}
