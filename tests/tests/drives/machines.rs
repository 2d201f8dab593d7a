//! Machines that are no snake on real drives: two segments on six lines in two groups, and joints.

use super::*;

/// A machine, the hand that moves all of it, and its servos.
struct Machine {
    model: &'static str,
    script: &'static str,
    n: u8,
    /// Which servo is unplugged in motion, from 1.
    broken: u8,
}

const SEGMENTS: Machine = Machine {
    model: concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/segments/two.toml"),
    script: concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/segments/tip.csv"),
    n: 6,
    broken: 5,
};

const JOINTS: Machine = Machine {
    model: concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.toml"),
    script: concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/joints/wrist.csv"),
    n: 3,
    broken: 2,
};

/// Way after which a servo counts as moved, counts.
const MOVED: f64 = 8.0;

impl Machine {
    fn emulator(&self) -> Emulator {
        let servos = (1..=self.n).map(|id| Servo::of(ServoMake::Sts3215, id, ZERO)).collect();
        Emulator::start(ServoWire::new(servos)).expect("a pseudo-terminal")
    }

    /// A chain under which every servo has moved.
    fn in_motion(&self, instance: &str, config: &str, emulator: &Emulator) -> Krait {
        // A machine that stands still for some hundredths of a second ends the engagement, as it must; then the hand begins anew.
        for _ in 0..5 {
            let run = ["run", "--engage", "--instance", instance, "--config", config, "--no-recording"];
            let hand = ["--master", "script", "--input", self.script, "--model", self.model];
            let krait = Krait::start(&[&run[..], &hand].concat());
            let mut moved = vec![false; self.n.into()];
            let all_move = || {
                for (moved, servo) in moved.iter_mut().zip(&emulator.wire().servos) {
                    *moved |= (servo.place - ZERO).abs() > MOVED;
                }
                moved.iter().all(|moved| *moved)
            };
            if wait_until(Duration::from_secs(20), all_move) {
                return krait;
            }
            krait.signal(Signal::INT);
            krait.end(PATIENCE);
            emulator.wire().servos.iter_mut().for_each(|servo| servo.place = ZERO);
        }
        panic!("they have not all moved in any of five runs: {:?}", emulator.wire().servos);
    }

    /// All follow; one is unplugged, and the others hold under power, whoever they hold against.
    fn follows_and_holds(&self, groups: &[(u8, u8)]) {
        let (instance, folder, emulator) = (instance_name("machine"), TempFolder::new("machine"), self.emulator());
        let config = configuration_of(ServoMake::Sts3215, &folder, &emulator, self.n, ["", "", ""]);
        let mut text = std::fs::read_to_string(&config).expect("written");
        for (id, group) in groups {
            text = text.replace(&format!("id = {id}\n"), &format!("id = {id}\ngroup = {group}\n"));
        }
        std::fs::write(&config, text).expect("written");
        let krait = self.in_motion(&instance, &config, &emulator);
        let broken = usize::from(self.broken) - 1;
        emulator.wire().servos[broken].faults.is_silent = true;
        let shown = || Ended::of(&["state", "--instance", &instance], PATIENCE).stdout;
        let words = format!("Drive {} failed; the others hold.", self.broken);
        assert!(wait_until(PATIENCE, || shown().contains(&words)), "{words} {}", shown());
        // Braked by then, with room for a machine under load.
        std::thread::sleep(Duration::from_millis(500));
        let places = || {
            let wire = emulator.wire();
            let others = wire.servos.iter().enumerate().filter(|(k, _)| *k != broken);
            others.map(|(_, servo)| servo.place).collect::<Vec<_>>()
        };
        let held = places();
        emulator.wire().servos[broken].faults.is_silent = false;
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(places(), held, "nothing resumes by itself");
        assert!(emulator.wire().servos.iter().all(Servo::is_powered), "under power");
        krait.signal(Signal::INT);
        let ended = krait.end(PATIENCE);
        let says = ended.stderr.contains(&format!("the run ended in FAULT: {words}"));
        assert!(ended.code == Some(1) && says, "a run whose drive was lost is no success: {}", ended.stderr);
        assert!(emulator.wire().servos.iter().all(|servo| !servo.is_powered()), "the end of the chain takes the power");
    }
}

#[test]
fn two_segments_on_six_servos_in_two_groups_follow_and_one_that_is_unplugged_stops_both_groups() {
    SEGMENTS.follows_and_holds(&[(4, 2), (5, 2), (6, 2)]);
}

#[test]
fn joints_follow_on_servos_and_one_that_is_unplugged_stops_the_others() {
    JOINTS.follows_and_holds(&[]);
}
