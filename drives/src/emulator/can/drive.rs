//! One emulated CiA 402 drive: its states, the motion behind them, and what is wrong with it.

use super::objects::{
    CONSUMER, CONTROL, Objects, POSITION, PRODUCER, QUICK_STOP_RAMP, RPDO_ID, RPDO_MAP, STATUS, TARGET, TORQUE,
    TPDO_ID, TPDO_MAP,
};
use crate::cia402::steps::{
    ERROR_CODE, ERROR_REGISTER, HOME_OFFSET, HOMING_METHOD, METHOD_HERE, MODE, MODE_CSP, MODE_HOMING,
};
use crate::cia402::{
    FROM_DRIVE, Frame, HEARTBEAT, MASTER, OPERATIONAL, PRE_OPERATIONAL, SDO_FROM, SDO_TO, SYNC, State, TO_DRIVE, state,
};

/// Longest time that a step of the motion stands for, s: the axis does not leap after a pause.
const LONGEST_S: f64 = 0.02;
/// How fast an axis gains or loses speed, counts/s2: what a stop begins with is a speed that a mass can have.
const MOST_COUNTS_PER_S2: f64 = 1e8;
/// Frames that a frozen drive keeps.
const MOST_KEPT: usize = 4096;
/// Code of a lost heartbeat.
const NO_HEARTBEAT: u16 = 0x8130;

/// What is wrong with a drive; by default nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct CanFaults {
    /// It does nothing and keeps all frames for later, as a processor that hangs.
    pub is_frozen: bool,
    /// It works and nothing of it reaches the bus.
    pub is_silent: bool,
    /// It has no power at all.
    pub is_dead: bool,
    /// Its axis does not move.
    pub is_jammed: bool,
    /// It answers each SYNC twice.
    pub answers_twice: bool,
    /// Hardware keeps its power stage off, as an emergency stop does: without voltage, and it takes no step toward power.
    is_cut_off: bool,
}

/// A drive.
#[derive(Clone, Debug)]
pub struct CanDrive {
    id: u8,
    objects: Objects,
    /// What is wrong with it.
    pub faults: CanFaults,
    /// True place of the axis, counts of an encoder that never forgets.
    pub place: f64,
    /// Largest speed, counts/s.
    pub most_counts_per_s: f64,
    /// Torque for a count away from where it was made, parts of a thousand of the rated one: a spring.
    pub permille_per_count: f64,
    /// Part of the rated torque that its axis carries besides, in the direction in which that drives the encoder.
    pub load: f64,
    /// Number of targets that it was told.
    pub n_targets: u64,
    /// What the encoder reads at the true place 0.
    offset: f64,
    nmt: u8,
    status: u16,
    speed: f64,
    /// Received since the newest SYNC.
    told: Option<(u16, i32)>,
    target: i32,
    /// Control word of before: a reset is the rise of a bit.
    control: u16,
    error: u16,
    moved_ns: i64,
    beat_due_ns: i64,
    master_ns: Option<i64>,
    kept: Vec<Frame>,
}

impl CanDrive {
    /// Its rated torque, N m: object 6076.
    pub const RATED_NM: f64 = 0.1;

    /// A sound drive without configuration at a place.
    pub fn new(id: u8, place: f64) -> Self {
        Self {
            id,
            objects: Objects::new(0x0000_0555, 1, u32::from(id)),
            faults: CanFaults::default(),
            place,
            most_counts_per_s: 1e6,
            permille_per_count: 0.0,
            load: 0.0,
            n_targets: 0,
            offset: 0.0,
            nmt: PRE_OPERATIONAL,
            status: 0x40,
            speed: 0.0,
            told: None,
            target: 0,
            control: 0,
            error: 0,
            moved_ns: 0,
            beat_due_ns: 0,
            master_ns: None,
            kept: Vec::new(),
        }
    }

    /// Its number on the bus.
    pub fn id(&self) -> u8 {
        self.id
    }

    /// The value of an object; 0 where there is none.
    pub fn object(&self, index: u16, sub: u8) -> u32 {
        self.objects.get((index, sub))
    }

    /// Gives an object a value, as with its maker's tool.
    pub fn set_object(&mut self, index: u16, sub: u8, value: u32) {
        self.objects.put((index, sub), value);
    }

    /// Gives it an object of 4 bytes that it lacks and that nobody may write.
    pub fn add_object(&mut self, index: u16, sub: u8, value: u32) {
        self.objects.add((index, sub), value);
    }

    /// Takes an object away.
    pub fn remove_object(&mut self, index: u16, sub: u8) {
        self.objects.remove((index, sub));
    }

    /// What it is doing.
    pub fn state(&self) -> State {
        state(self.status)
    }

    /// What its encoder reads.
    pub fn counts(&self) -> i32 {
        (self.place + self.offset).round() as i32
    }

    /// The target that it holds.
    pub fn target(&self) -> i32 {
        self.target
    }

    /// Its power goes and comes back: no configuration, and an encoder that begins at 0.
    pub fn power_loss(&mut self, out: &mut Vec<Frame>) {
        self.objects.forget();
        (self.status, self.nmt, self.speed, self.told, self.master_ns) = (0x40, PRE_OPERATIONAL, 0.0, None, None);
        (self.control, self.error, self.target, self.beat_due_ns) = (0, 0, 0, 0);
        self.offset = -self.place;
        self.kept.clear();
        self.faults = CanFaults::default();
        out.push(Frame::new(HEARTBEAT + u16::from(self.id), &[0]));
    }

    /// It fails with an error code.
    pub fn trip(&mut self, code: u16, out: &mut Vec<Frame>) {
        (self.status, self.error, self.speed) = (0x08, code, 0.0);
        self.emergency(code, out);
    }

    /// An emergency stop is pressed: its power is gone, and it tells the code, where it tells any.
    pub fn press_emergency_stop(&mut self, code: Option<u16>, out: &mut Vec<Frame>) {
        (self.status, self.speed, self.faults.is_cut_off) = (0x40, 0.0, true);
        if let Some(code) = code {
            self.emergency(code, out);
        }
    }

    /// The emergency stop is released; power comes only when it is asked for.
    pub fn release_emergency_stop(&mut self) {
        self.faults.is_cut_off = false;
    }

    fn emergency(&mut self, code: u16, out: &mut Vec<Frame>) {
        let [low, high] = code.to_le_bytes();
        self.say(SYNC, &[low, high, u8::from(code != 0), 0, 0, 0, 0, 0], out);
    }

    fn say(&mut self, function: u16, bytes: &[u8], out: &mut Vec<Frame>) {
        if !self.faults.is_silent {
            out.push(Frame::new(function + u16::from(self.id), bytes));
        }
    }

    /// Takes a frame from the bus.
    pub fn take(&mut self, frame: &Frame, now_ns: i64, out: &mut Vec<Frame>) {
        if self.faults.is_dead {
            return;
        }
        if self.faults.is_frozen {
            if self.kept.len() < MOST_KEPT {
                self.kept.push(*frame);
            }
            return;
        }
        let id = u16::from(self.id);
        match (frame.id(), frame.data()) {
            (0, [command, node]) if [0, self.id].contains(node) => self.manage(*command),
            (SYNC, _) if self.nmt == OPERATIONAL => self.sync(now_ns, out),
            (number, data) if number == SDO_TO + id => {
                if let Ok(question) = <[u8; 8]>::try_from(data) {
                    let answer = self.objects.answer(question);
                    self.say(SDO_FROM, &answer, out);
                }
            }
            (number, [c0, c1, p0, p1, p2, p3])
                if number == TO_DRIVE + id && self.nmt == OPERATIONAL && self.hears_targets() =>
            {
                self.n_targets += 1;
                self.told = Some((u16::from_le_bytes([*c0, *c1]), i32::from_le_bytes([*p0, *p1, *p2, *p3])));
            }
            (number, [_])
                if number == HEARTBEAT + u16::from(MASTER) && self.objects.get(CONSUMER) >> 16 == u32::from(MASTER) =>
            {
                self.master_ns = Some(now_ns);
            }
            _ => {}
        }
    }

    fn hears_targets(&self) -> bool {
        self.objects.get(RPDO_ID) == u32::from(TO_DRIVE) + u32::from(self.id)
            && self.objects.get((RPDO_MAP, 0)) == 2
            && self.objects.get((RPDO_MAP, 1)) == 0x6040_0010
            && self.objects.get((RPDO_MAP, 2)) == 0x607A_0020
    }

    fn answers_cyclically(&self) -> bool {
        self.objects.get(TPDO_ID) & 0x8000_07FF == u32::from(FROM_DRIVE) + u32::from(self.id)
            && self.objects.get((TPDO_MAP, 0)) == 3
    }

    fn manage(&mut self, command: u8) {
        self.nmt = match command {
            0x01 => OPERATIONAL,
            0x80 => PRE_OPERATIONAL,
            _ => self.nmt,
        };
    }

    /// Answers with what is, then takes what was told.
    fn sync(&mut self, now_ns: i64, out: &mut Vec<Frame>) {
        if self.answers_cyclically() {
            let ([s0, s1], [p0, p1, p2, p3]) = (self.status_word().to_le_bytes(), self.counts().to_le_bytes());
            let [t0, t1] = self.torque().to_le_bytes();
            for _ in 0..1 + u32::from(self.faults.answers_twice) {
                self.say(FROM_DRIVE, &[s0, s1, p0, p1, p2, p3, t0, t1], out);
            }
        }
        if let Some((control, target)) = self.told.take() {
            self.control(control);
            self.target = target;
        }
        self.go(now_ns);
    }

    fn torque(&self) -> i16 {
        (self.place * self.permille_per_count + 1e3 * self.load).clamp(-3000.0, 3000.0) as i16
    }

    fn mode(&self) -> u32 {
        self.objects.get(MODE)
    }

    /// The state, and what a mode adds to it.
    fn status_word(&self) -> u16 {
        let is_behind = self.faults.is_jammed && self.counts().abs_diff(self.target) > 500;
        let homed = self.mode() == MODE_HOMING && self.control & 0x1F == 0x1F;
        let of_mode = if homed { 1 << 12 | 1 << 10 } else { u16::from(self.mode() == MODE_CSP) << 12 };
        let voltage = u16::from(!self.faults.is_cut_off) << 4;
        self.status | voltage | 1 << 9 | of_mode | u16::from(is_behind && self.state() == State::OperationEnabled) << 13
    }

    /// A control word, by the standard's table of transitions.
    fn control(&mut self, control: u16) {
        let rises = control & !core::mem::replace(&mut self.control, control);
        self.status = match (self.state(), control & 0x8F) {
            (State::SwitchOnDisabled, _) if self.faults.is_cut_off => 0x40,
            (State::Fault, _) if rises & 0x80 != 0 => {
                self.error = 0;
                0x40
            }
            (State::Fault, _) => 0x08,
            (_, 0x00) => 0x40,
            (State::SwitchOnDisabled | State::SwitchedOn | State::OperationEnabled, 0x06) => 0x21,
            (State::ReadyToSwitchOn | State::OperationEnabled, 0x07) => 0x23,
            (State::SwitchedOn | State::QuickStopActive, 0x0F) => 0x27,
            (State::OperationEnabled, 0x02) => 0x07,
            (State::ReadyToSwitchOn | State::SwitchedOn, 0x02) => 0x40,
            _ => self.status,
        };
        if self.mode() == MODE_HOMING
            && self.state() == State::OperationEnabled
            && rises & 0x10 != 0
            && self.objects.get(HOMING_METHOD) == METHOD_HERE
        {
            self.offset = f64::from(self.objects.get(HOME_OFFSET).cast_signed()) - self.place;
        }
    }

    /// Motion since the SYNC before.
    fn go(&mut self, now_ns: i64) {
        let elapsed_s = ((now_ns - self.moved_ns) as f64 * 1e-9).clamp(0.0, LONGEST_S);
        self.moved_ns = now_ns;
        match self.state() {
            State::OperationEnabled if !self.faults.is_jammed && self.mode() == MODE_CSP => {
                let way = f64::from(self.target) - self.place - self.offset;
                let most = self.most_counts_per_s * elapsed_s;
                let step = way.clamp(-most, most);
                self.place += step;
                if elapsed_s > 0.0 {
                    let most = MOST_COUNTS_PER_S2 * elapsed_s;
                    self.speed += (step / elapsed_s - self.speed).clamp(-most, most);
                }
            }
            State::QuickStopActive => {
                let lost = f64::from(self.objects.get(QUICK_STOP_RAMP)) * elapsed_s;
                let slower = (self.speed.abs() - lost).max(0.0).copysign(self.speed);
                self.place += 0.5 * (self.speed + slower) * elapsed_s;
                self.speed = slower;
            }
            _ => self.speed = 0.0,
        }
        self.show();
    }

    fn show(&mut self) {
        self.objects.put(POSITION, self.counts().cast_unsigned());
        self.objects.put(STATUS, u32::from(self.status_word()));
        self.objects.put(TORQUE, u32::from(self.torque().cast_unsigned()));
        self.objects.put(ERROR_CODE, u32::from(self.error));
        // Bit 0: any error.
        self.objects.put(ERROR_REGISTER, u32::from(self.error != 0));
        self.objects.put(CONTROL, u32::from(self.control));
        self.objects.put(TARGET, self.target.cast_unsigned());
    }

    /// Lets time pass: its heartbeat, the master's, what was kept while it was frozen.
    pub fn step(&mut self, now_ns: i64, out: &mut Vec<Frame>) {
        if self.faults.is_dead || self.faults.is_frozen {
            return;
        }
        for frame in core::mem::take(&mut self.kept) {
            self.take(&frame, now_ns, out);
        }
        self.show();
        let period_ns = i64::from(self.objects.get(PRODUCER)) * 1_000_000;
        if period_ns > 0 && now_ns >= self.beat_due_ns {
            self.beat_due_ns = now_ns + period_ns;
            let nmt = self.nmt;
            self.say(HEARTBEAT, &[nmt], out);
        }
        let patience_ns = i64::from(self.objects.get(CONSUMER) & 0xFFFF) * 1_000_000;
        if patience_ns > 0 && self.master_ns.is_some_and(|heard_ns| now_ns - heard_ns > patience_ns) {
            self.master_ns = None;
            if self.state() == State::OperationEnabled {
                self.status = 0x07;
            }
            self.emergency(NO_HEARTBEAT, out);
        }
        // A stop of its own goes on without any SYNC.
        if self.state() == State::QuickStopActive && now_ns - self.moved_ns > 1_000_000 {
            self.go(now_ns);
        }
    }
}
