//! A foot pedal on the kernel's input system beside a SpaceMouse, both through one core: what it tells is presence and clutch of the hand.

use super::*;
use krait_ipc::message::{DeviceState, OperatorInput};

const PEDAL: &str = "name = \"Pedal\"\nid = \"05f3:00ff\"\n[[button]]\nof = 0\nfrom = \"BTN_TRIGGER\"\n[[button]]\nof = 1\nfrom = \"BTN_THUMB\"\n";
const TRIGGER: u16 = 0x120;
const THUMB: u16 = 0x121;
const MS: i64 = 1_000_000;

struct Bench {
    core: MasterCore,
    now_ns: i64,
}

impl Bench {
    /// Hands on what the pedal has told, if it is there, pushes the cap, and gives the next input.
    fn next(&mut self, mut pedal: Option<&mut EvdevPort<Node>>) -> OperatorInput {
        self.now_ns += 8 * MS;
        while let Some(bytes) = pedal.as_deref_mut().and_then(read_bytes) {
            self.core.on_report_of(1, &bytes, self.now_ns).expect("a report");
        }
        let cap = HidReport::Translation([200, 0, 0]).encode();
        self.core.on_report_of(0, cap.as_bytes(), self.now_ns).expect("a report");
        self.core.on_tick(self.now_ns)
    }
}

fn moves(input: &OperatorInput) -> bool {
    input.tip_vel_in_view_m_per_s != [0.0; 3]
}

#[test]
fn a_pedal_is_presence_and_clutch_and_one_that_is_down_when_it_comes_back_counts_from_its_next_press() {
    let profile = Profile::parse("pedal.toml", PEDAL).expect("a profile");
    let config = MasterConfig { engage: Engage::Once, presence: Presence::Toggle(0), ..MasterConfig::default() };
    let mut bench = Bench { core: MasterCore::new(&config).expect("a configuration"), now_ns: 0 };
    let (mut foot, _, mut pedal) = opened(&profile);
    let does = |foot: &mut PipeWriter, events: &[(u16, u16, i32)]| {
        foot.write_all(&bytes_of(&[events, &[SYN]].concat())).expect("written");
    };
    assert!(!moves(&bench.next(Some(&mut pedal))));
    does(&mut foot, &[(1, TRIGGER, 1)]);
    assert!(moves(&bench.next(Some(&mut pedal))));
    does(&mut foot, &[(1, THUMB, 1)]);
    let clutched = bench.next(Some(&mut pedal));
    assert!(clutched.clutch_pressed() && clutched.operator_present() && !moves(&clutched));
    does(&mut foot, &[(1, THUMB, 0)]);
    assert!(moves(&bench.next(Some(&mut pedal))));

    // Pulled out while it is down, and plugged in again while it is down.
    drop(foot);
    let gone = pedal.read(&mut [0; RawReport::MAX_BYTES], Duration::ZERO);
    assert!(matches!(gone, Err(ReadFailure::Gone(_))), "{gone:?}");
    bench.core.on_unplugged_of(1);
    let lost = bench.next(None);
    assert_eq!((lost.device(), lost.flags), (Some(DeviceState::Lost), 0));
    let (mut foot, mut pedal) = pedal_of(&profile);
    bench.core.on_plugged_of(1);
    assert!(!moves(&bench.next(Some(&mut pedal))), "it is down, and nobody has pressed it");
    does(&mut foot, &[(1, THUMB, 1)]);
    does(&mut foot, &[(1, THUMB, 0)]);
    assert!(!bench.next(Some(&mut pedal)).operator_present(), "another button of it was pressed");
    does(&mut foot, &[(1, TRIGGER, 0)]);
    assert!(!moves(&bench.next(Some(&mut pedal))));
    does(&mut foot, &[(1, TRIGGER, 1)]);
    assert!(moves(&bench.next(Some(&mut pedal))));
}

/// A pedal whose trigger is down when it is opened.
fn pedal_of(profile: &Profile) -> (PipeWriter, EvdevPort<Node>) {
    let (pipe, writer) = pipe().expect("a pipe");
    let now = Arc::new(Mutex::new((0, vec![TRIGGER])));
    let node = Node { pipe, now, lights: Arc::default(), effects: Arc::default() };
    let decoder = EvdevDecoder::new(profile, &node).expect("a decoder");
    (writer, EvdevPort::new(node, decoder, &Profile { lights: Vec::new(), ..profile.clone() }))
}
