//! Which drives the slave has: the table `[slave.drive]` and its actuators.

use crate::{ConfigError, HomingConfig, OnFault};
use krait_ipc::message::MAX_ACTUATORS;
use krait_ipc::settings;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Kinds of drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveKind {
    /// Simulated, of the machine that the model is of.
    #[default]
    Sim,
    /// Feetech STS3215 servos on a serial bus.
    Sts3215,
    /// ROBOTIS Dynamixel XL330 servos on a serial bus.
    Xl330,
    /// CANopen drives of the profile CiA 402 on a CAN interface.
    Cia402,
}

/// Whether drives move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveMode {
    /// They move.
    #[default]
    Live,
    /// They are opened and read, never under power; what they would be told is logged.
    Dry,
}

/// What comes before the power goes, where somebody asks for that.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnDisable {
    /// The lines are relaxed: the actuators give way to their loads, a bounded way.
    #[default]
    Relax,
    /// Nothing: power is taken away at once.
    PowerOff,
}

settings! {
    /// The drives.
    #[derive(Clone, Debug, PartialEq)]
    pub struct DriveConfig in "slave.drive" {
        /// "sim": simulated; "sts3215": Feetech servos on a serial bus; "xl330": Dynamixel servos on one; "cia402": CANopen drives on a
        /// CAN interface. What follows is for a real bus, but for `on_disable`, `relax_n` and `disable_relax_...`.
        kind: DriveKind = DriveKind::Sim;
        /// "live": they move; "dry": the bus is opened and read, power stays off, and the log says what would be sent.
        mode: DriveMode = DriveMode::Live;
        /// The serial port, best by its lasting name in /dev/serial/by-id.
        port: Option<PathBuf> = None;
        /// "cia402": the CAN interface, as `ip link` names it.
        interface: Option<String> = None;
        /// Bit rate of the bus, bits/s. 1 000 000: the default of STS3215 (XL330: 57 600), and what CAN has at most. A CAN interface gets its own
        /// from `ip link`; this one says what a cycle takes.
        baud: u32 = 1_000_000, 9_600..=1_000_000;
        /// Period of the bus, ms: every actuator is told and asked once. 5 ms: three servos need 2.6 ms at 1 Mbaud and 1 ms in
        /// the USB adapter.
        period_ms: f64 = 5.0, 1.0..=50.0;
        /// How long the answers of one period are waited for, ms; less than `period_ms`.
        timeout_ms: f64 = 4.0, 0.5..=45.0;
        /// Answers of one actuator that are missing one after the other until it counts as lost. 3: noise takes one or two.
        lost_cycles: u32 = 3, 1..=20;
        /// Time without a sign of life of the slave after which the drives stop by themselves, and of the bus after which the slave
        /// does, ms. 100 ms: what is held until then is the newest wish, which the drives reach within a period, so that a hiccup
        /// of the machine moves nothing and is no fault.
        wish_ms: f64 = 100.0, 5.0..=1000.0;
        /// What a fault does: "hold": brake to rest and stay under power; "relax": the same, and where the failed one says that it has
        /// let go of its line, the others give way; "power_off": let go.
        on_fault: OnFault = OnFault::Hold;
        /// What `disable` does where a line is loaded: "relax": the actuators give way to their loads before power goes; "power_off":
        /// power goes at once. Simulated drives do the same.
        on_disable: OnDisable = OnDisable::Relax;
        /// "relax", of both: a line that carries less is let be, N. 2 N: below it a line of some N of tension is nearly slack.
        relax_n: f64 = 2.0, 0.1..=1000.0;
        /// `on_fault = "relax"`: how far each actuator gives way at most, m, at 2 mm/s at most. 1 mm: nobody asked for this motion,
        /// and a drive is broken.
        relax_m: f64 = 0.001, 1e-5..=0.02;
        /// `on_fault = "relax"`: after so long since the failure nothing moves any more, ms.
        relax_ms: f64 = 1000.0, 10.0..=10_000.0;
        /// `on_disable = "relax"`: how far each actuator gives way at most, m, at 2 mm/s at most. 6 mm: from its bend limit the snake
        /// of the paper goes back to small loads; it would spring there if power went at once.
        disable_relax_m: f64 = 0.006, 1e-5..=0.02;
        /// `on_disable = "relax"`: power is gone so long after `disable`, ms.
        disable_relax_ms: f64 = 4000.0, 10.0..=10_000.0;
        /// Largest speed of a servo or motor, counts/s. 3000: STS3215 at 7.4 V.
        speed_counts_per_s: f64 = 3000.0, 50.0..=1e8;
        /// "cia402": how often drives and this program tell each other that they live, ms.
        heartbeat_ms: u32 = 20, 1..=200;
        /// "cia402" and "xl330": without this program's heartbeat, or any word of it, for so long the drives stop by themselves, ms; at
        /// least 3 of `heartbeat_ms`, or of `period_ms`. An XL330 counts in steps of 20 ms. 100 ms: longer than a hiccup of the machine, and at 30 mm/s with a held target no motion at all.
        gives_up_ms: u32 = 100, 10..=2000;
        /// How far the loads of all actuators may be off by one common factor, as a standard deviation, part of it: 0.3 for servos whose
        /// gears nobody has measured. It is recorded; without it the lab shows their loads and concludes nothing from them.
        load_gain_sd: Option<f64> = None;
        /// The actuators, in the order of the lines or joints; each is a table `[[slave.drive.actuator]]`.
        actuator: Vec<ActuatorConfig> = Vec::new();
    }
}

settings! {
    /// One actuator of a bus.
    #[derive(Clone, Debug, PartialEq)]
    pub struct ActuatorConfig in "slave.drive.actuator" {
        /// Its number on the bus.
        id: u32 = 1, 0..=252;
        /// What its encoder reads where its line or joint is at zero; `krait drives --zero` finds it. Without it nothing moves.
        zero_count: Option<i32> = None;
        /// 1: counts grow where the line is pushed; -1: where it is pulled.
        sign: i32 = 1;
        /// Radius of the spool, to the middle of the line, m.
        spool_radius_m: f64 = 0.008, 1e-4..=0.2;
        /// Lead of the screw that pulls the line in place of a spool, m for a turn, 0.0001 to 0.1.
        lead_m: Option<f64> = None;
        /// "cia402": counts of the drive for a turn of its encoder.
        counts_per_turn: u32 = 4096, 4..=100_000_000;
        /// "cia402": whether its encoder keeps its count without power. One that does not has lost its zero then.
        is_absolute: bool = false;
        /// "cia402": maker and product by object 1018, as `krait drives` shows them; a drive that says another is not moved.
        vendor: Option<u32> = None;
        /// See `vendor`.
        product: Option<u32> = None;
        /// "cia402": rated torque of the motor, N m; 0: what the drive's object 6076 says.
        rated_torque_nm: f64 = 0.0, 0.0..=1000.0;
        /// Part of the torque that reaches the line.
        efficiency: f64 = 1.0, 0.01..=1.0;
        /// Turns of the encoder for one of the spool or screw.
        gear: f64 = 1.0, 0.01..=1000.0;
        /// Number of the lines that hold each other: those of a segment. Where one of them has let go, only those of its own group give
        /// way, and before `disable` a limit stops its own group only. Without the key all are one; a gripper's wire is nobody's.
        group: u32 = 1, 1..=12;
        /// Where its line is the wire of a gripper: m of wire for one radian of the jaw, as the model's `wire_m_per_rad`. Only the
        /// last actuator, behind the snake's lines: no line loads it, and it has a gate and a load limit of its own.
        jaw_m_per_rad: Option<f64> = None;
        /// How far it may go from zero, either way, m.
        travel_m: f64 = 0.006, 1e-4..=0.1;
        /// Largest torque, part of the servo's own, or of the drive's rated one (object 6072).
        torque_limit: f64 = 0.5, 0.01..=1.0;
        /// Its own limit of `rate_m_per_s` of [slave.limits], m/s, at most that of all; that is its limit where it has none of its own.
        rate_m_per_s: Option<f64> = None;
        /// The same of `acceleration_m_per_s2`, m/s2; at least `deceleration_m_per_s2`, so that a stop is the same for all.
        acceleration_m_per_s2: Option<f64> = None;
        /// Its own limit of load, pull or push, N, at most `pull_n` and `push_n` (of a jaw's wire `jaw_n`). Where loads are measured.
        load_n: Option<f64> = None;
        /// Torque per current, N m/A; then loads are estimated from the current, with tens of percent of error. 0: not measured.
        newton_metre_per_ampere: f64 = 0.0, 0.0..=100.0;
        /// "sts3215": how `krait drives --zero` finds its zero: { method = "stop_by_load", direction = "push" or "pull", load_n,
        /// rate_m_per_s, travel_limit_m, back_off_m }. Without it zero is where it stands.
        homing: Option<HomingConfig> = None;
    }
}

impl DriveConfig {
    /// Checks every value and that the values fit each other.
    ///
    /// # Errors
    /// [`ConfigError`] names the first that does not.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.check_ranges()?;
        let refuse = |what: String| Err(ConfigError::Drives { what });
        if self.kind == DriveKind::Sim {
            return Ok(());
        }
        let (is_missing, sentence) = match self.kind {
            DriveKind::Cia402 => {
                (self.interface.is_none(), "interface is missing; name the CAN interface, such as can0")
            }
            _ => (self.port.is_none(), "port is missing; name the serial port"),
        };
        if is_missing {
            return refuse(format!("{sentence}, `krait drives` lists those that are there"));
        }
        self.check_kind()?;
        if self.timeout_ms >= self.period_ms {
            return refuse(format!(
                "timeout_ms = {}: expected less than period_ms {}",
                self.timeout_ms, self.period_ms
            ));
        }
        let n = self.actuator.len();
        if !(1..=MAX_ACTUATORS).contains(&n) {
            return refuse(format!(
                "{n} actuators, expected 1 to {MAX_ACTUATORS}; describe each in a table [[slave.drive.actuator]]"
            ));
        }
        for (k, actuator) in self.actuator.iter().enumerate() {
            actuator.check_ranges()?;
            actuator.check_jaw(k + 1, n)?;
            if actuator.sign.abs() != 1 {
                return refuse(format!("actuator {}: sign = {}, expected 1 or -1", k + 1, actuator.sign));
            }
            // Which way a line goes is for `sign` to say.
            if let Some(lead_m) = actuator.lead_m.filter(|lead_m| !(1e-4..=0.1).contains(lead_m)) {
                return refuse(format!("actuator {}: lead_m = {lead_m}, expected 0.0001 to 0.1 m for a turn", k + 1));
            }
            if self.kind == DriveKind::Cia402 {
                actuator.check_can(k + 1)?;
            }
            actuator.homing.map_or(Ok(()), |homing| homing.check())?;
            if let Some(first) = self.actuator[..k].iter().position(|other| other.id == actuator.id) {
                let id = actuator.id;
                return refuse(format!("actuators {} and {} both have id {id}; give each its own", first + 1, k + 1));
            }
        }
        let beat = match self.kind {
            DriveKind::Cia402 => Some(("heartbeat_ms", f64::from(self.heartbeat_ms))),
            DriveKind::Xl330 => Some(("period_ms", self.period_ms)),
            DriveKind::Sim | DriveKind::Sts3215 => None,
        };
        if let Some((key, beat_ms)) = beat.filter(|(_, beat_ms)| f64::from(self.gives_up_ms) < 3.0 * beat_ms) {
            let gives_up = self.gives_up_ms;
            return refuse(format!("gives_up_ms = {gives_up}: expected at least 3 times {key} {beat_ms}"));
        }
        self.check_load_gain()
    }
}

impl DriveConfig {
    /// A key that only drives of another kind read would be ignored, and somebody meant something by it.
    fn check_kind(&self) -> Result<(), ConfigError> {
        let (usual, plain) = (Self::default(), ActuatorConfig::default());
        let (serial, can) = (&["sts3215", "xl330"][..], &["cia402"][..]);
        let own = match self.kind {
            DriveKind::Sim => return Ok(()),
            DriveKind::Sts3215 => "sts3215",
            DriveKind::Xl330 => "xl330",
            DriveKind::Cia402 => "cia402",
        };
        // Keys that somebody set, with the kinds that read them.
        let mut set = Vec::new();
        let mut add = |key: &str, is_set: bool, kinds: &[&'static str]| {
            if is_set && !kinds.contains(&own) {
                set.push((key.to_owned(), kinds[0]));
            }
        };
        add("port", self.port.is_some(), serial);
        add("interface", self.interface.is_some(), can);
        add("heartbeat_ms", self.heartbeat_ms != usual.heartbeat_ms, can);
        add("gives_up_ms", self.gives_up_ms != usual.gives_up_ms, &["cia402", "xl330"]);
        for (k, actuator) in self.actuator.iter().enumerate() {
            let mut add = |key: &str, is_set, kinds| add(&format!("actuator {}: {key}", k + 1), is_set, kinds);
            let newton_metre_per_ampere = actuator.newton_metre_per_ampere != plain.newton_metre_per_ampere;
            add("newton_metre_per_ampere", newton_metre_per_ampere, serial);
            add("homing", actuator.homing.is_some(), serial);
            add("counts_per_turn", actuator.counts_per_turn != plain.counts_per_turn, can);
            add("is_absolute", actuator.is_absolute, can);
            add("vendor", actuator.vendor.is_some(), can);
            add("product", actuator.product.is_some(), can);
            add("rated_torque_nm", actuator.rated_torque_nm != plain.rated_torque_nm, can);
        }
        let Some((key, other)) = set.into_iter().next() else { return Ok(()) };
        Err(ConfigError::Drives {
            what: format!(
                "{key} is of drives of kind {other:?}, and these are {own:?}, which would ignore it; delete it, or correct kind"
            ),
        })
    }

    /// How many actuators, from the first, hold each other through one machine: all, or all but a gripper's.
    pub fn n_together(&self) -> usize {
        self.actuator.len() - usize::from(self.jaw_m_per_rad().is_some())
    }

    /// Who holds against an actuator, from 0, and would give way where it has let go: the others of its group.
    pub fn antagonists(&self, of: usize) -> [bool; MAX_ACTUATORS] {
        let (n, groups) = (self.n_together(), self.groups());
        core::array::from_fn(|k| k != of && k < n && of < n && groups[k] == groups[of])
    }

    /// Of each actuator the number of its group of antagonists; all are one where none is described.
    pub fn groups(&self) -> [u32; MAX_ACTUATORS] {
        let usual = ActuatorConfig::default().group;
        core::array::from_fn(|k| self.actuator.get(k).map_or(usual, |actuator| actuator.group))
    }

    /// Whether somebody has said which actuators hold each other.
    pub fn names_groups(&self) -> bool {
        self.groups() != Self::default().groups()
    }

    /// The wire of a gripper for one radian of its jaw, m, where the last actuator is that of a gripper.
    pub fn jaw_m_per_rad(&self) -> Option<f64> {
        self.actuator.last().and_then(|actuator| actuator.jaw_m_per_rad)
    }
}

impl ActuatorConfig {
    /// A gripper's wire comes behind lines; this is the `actuator`-th of `n`, from 1.
    fn check_jaw(&self, actuator: usize, n: usize) -> Result<(), ConfigError> {
        let Some(jaw_m_per_rad) = self.jaw_m_per_rad else { return Ok(()) };
        if self.group != Self::default().group {
            let what = format!(
                "actuator {actuator}: group = {}, and it moves a gripper's jaw, whose wire no line holds against; delete the key",
                self.group
            );
            return Err(ConfigError::Drives { what });
        }
        let what = if actuator < n || n == 1 {
            format!(
                "jaw_m_per_rad: expected at the last of several, behind the snake's lines, found at {actuator} of {n}"
            )
        } else if !(1e-4..=0.02).contains(&jaw_m_per_rad) {
            format!("jaw_m_per_rad = {jaw_m_per_rad}, expected 0.0001 to 0.02 m for one radian")
        } else {
            return Ok(());
        };
        Err(ConfigError::Drives { what: format!("actuator {actuator}: {what}") })
    }

    /// What only a drive on CAN needs; it is the `actuator`-th, from 1.
    fn check_can(&self, actuator: usize) -> Result<(), ConfigError> {
        let refuse = |what: String| Err(ConfigError::Drives { what: format!("actuator {actuator}: {what}") });
        if !(1..=126).contains(&self.id) {
            return refuse(format!("id = {}, expected 1 to 126 (127 is krait)", self.id));
        }
        if self.vendor.is_none() || self.product.is_none() {
            return refuse("vendor or product is missing; `krait drives` shows those that are there".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sentence(text: &str) -> String {
        toml::from_str::<DriveConfig>(text).unwrap().check().unwrap_err().to_string()
    }

    #[test]
    fn what_does_not_fit_is_refused_in_one_sentence_with_its_table() {
        DriveConfig::default().check().unwrap();
        let bus = "kind = \"sts3215\"\nport = \"/dev/ttyUSB0\"\n";
        let dxl = bus.replace("sts3215", "xl330");
        let servo = "[[actuator]]\nid = 1\n";
        let can = "kind = \"cia402\"\ninterface = \"can0\"\n";
        let drive = "[[actuator]]\nid = 1\nvendor = 0x555\nproduct = 1\n";
        for (text, words) in [
            ("kind = \"sts3215\"".to_owned(), "port is missing"),
            (bus.to_owned(), "0 actuators"),
            (format!("{bus}timeout_ms = 5.0\n{servo}"), "timeout_ms = 5: expected less than period_ms 5"),
            (format!("{bus}{servo}sign = 0"), "sign = 0"),
            (format!("{bus}{servo}{servo}"), "actuators 1 and 2 both have id 1"),
            (format!("{bus}{servo}travel_m = 1.0"), "travel_m = 1"),
            (format!("{bus}{servo}group = 0"), "group = 0"),
            (format!("{bus}{servo}jaw_m_per_rad = 0.002\ngroup = 2"), "actuator 1: group = 2"),
            (
                format!("{bus}{servo}jaw_m_per_rad = 0.002"),
                "at the last of several, behind the snake's lines, found at 1 of 1",
            ),
            (format!("{bus}{servo}[[actuator]]\nid = 2\njaw_m_per_rad = 0.2"), "actuator 2: jaw_m_per_rad = 0.2"),
            ("kind = \"cia402\"".to_owned(), "interface is missing"),
            (format!("{can}{servo}"), "vendor or product is missing"),
            (format!("{can}{drive}lead_m = 2.0"), "actuator 1: lead_m = 2"),
            (format!("{bus}{servo}lead_m = -0.002"), "actuator 1: lead_m = -0.002"),
            (format!("{dxl}{servo}lead_m = nan"), "actuator 1: lead_m = NaN"),
            (format!("{can}gives_up_ms = 50\n{drive}"), "gives_up_ms = 50"),
            (format!("{can}{drive}").replace("id = 1\n", "id = 127\n"), "id = 127"),
            (format!("{bus}heartbeat_ms = 50\n{servo}"), "heartbeat_ms is of drives of kind \"cia402\""),
            (format!("{bus}gives_up_ms = 50\n{servo}"), "gives_up_ms is of drives of kind \"cia402\""),
            (
                format!("{dxl}gives_up_ms = 50\nperiod_ms = 20.0\n{servo}"),
                "gives_up_ms = 50: expected at least 3 times period_ms 20",
            ),
            (
                format!("{dxl}heartbeat_ms = 50\n{servo}"),
                "heartbeat_ms is of drives of kind \"cia402\", and these are \"xl330\"",
            ),
            (format!("{bus}{servo}vendor = 5"), "actuator 1: vendor is of drives of kind \"cia402\""),
            (format!("{bus}interface = \"can0\"\n{servo}"), "these are \"sts3215\", which would ignore it"),
            (format!("{can}port = \"/dev/ttyUSB0\"\n{drive}"), "port is of drives of kind \"sts3215\""),
            (format!("{can}{drive}newton_metre_per_ampere = 1.0"), "actuator 1: newton_metre_per_ampere is of drives"),
            (format!("{bus}{servo}id = 254").replace("id = 1\n", ""), "id = 254"),
        ] {
            let sentence = sentence(&text);
            assert!(sentence.contains("[slave.drive") && sentence.contains(words), "{sentence}");
        }
    }

    #[test]
    fn antagonists_are_the_others_of_a_group_all_where_none_is_named_and_never_a_jaw() {
        let of = |groups: &[u32], has_jaw: bool, k: usize| -> Vec<usize> {
            let last = groups.len() - 1;
            let actuator = |(k, group): (usize, &u32)| ActuatorConfig {
                group: *group,
                jaw_m_per_rad: (has_jaw && k == last).then_some(0.002),
                ..ActuatorConfig::default()
            };
            let actuator = groups.iter().enumerate().map(actuator).collect();
            let antagonists = DriveConfig { actuator, ..DriveConfig::default() }.antagonists(k);
            (0..12).filter(|k| antagonists[*k]).collect()
        };
        assert_eq!(of(&[1, 1, 1], false, 1), [0, 2]);
        assert_eq!(of(&[1, 1, 1, 2, 2, 2], false, 1), [0, 2]);
        assert_eq!(of(&[1, 1, 1, 2, 2, 2], false, 3), [4, 5]);
        // Two cables of each joint, in any order.
        assert_eq!(of(&[4, 9, 9, 4], false, 0), [3]);
        assert_eq!(of(&[1, 2], false, 1), [0; 0], "one that is alone has nobody");
        assert_eq!((of(&[1, 1, 1, 1], true, 0), of(&[1, 1, 1, 1], true, 3)), (vec![1, 2], vec![]));
        assert_eq!(of(&[1; 12], false, 11).len(), 11);
    }
}
