//! Every decoder and every reader of a file against input that was broken on purpose: it is read or refused, and nothing else.
//!
//! Each input follows from its reader's name and its number, so that a failure can be repeated: `FUZZ_ONLY=mcap FUZZ_FROM=17`.
//! By default some hundred inputs each; `FUZZ_SECONDS=600` goes on for that time with each reader (`.ci/long`).

#![allow(clippy::expect_used, clippy::panic, clippy::print_stderr, reason = "a panic is how a test fails")]

use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use core::time::Duration;
use krait_calibrate::photo;
use krait_ipc::clock;
use krait_lab::init::propose;
use krait_lab::read::{ColumnMap, Expected, read};
use krait_master::{HidRecording as Reports, HidReport, PosePacket, Profile, Script};
use krait_model::model_file::ModelFile;
use krait_model::{KnownColumns, MachineParameters, Snake};
use krait_record::{Recording, recover};
use krait_replay::{Beginning, InputChoice, Trajectory, TrajectoryLimits};
use krait_schema::Channel;
use krait_shape::ShapeLine;
use krait_sim::{JointsTruth, Truth};
use krait_tests::{Ended, TempFolder, instance_name};
use std::alloc::{GlobalAlloc, Layout as Memory, System};
use std::fs;
use std::path::{Path, PathBuf};

#[path = "fuzz/peers.rs"]
mod peers;

struct Counting;

static N_BYTES: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);
/// When the input that is being read was begun, ns; 0 between two.
static BEGUN_NS: AtomicU64 = AtomicU64::new(0);

#[allow(unsafe_code)]
// SAFETY: every call is handed to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Memory) -> *mut u8 {
        let now = N_BYTES.fetch_add(layout.size(), Relaxed) + layout.size();
        PEAK.fetch_max(now, Relaxed);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Memory) {
        N_BYTES.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What one input may take.
const MOST_BYTES: usize = 256 << 20;
/// An input that is not done by then hangs, on however busy a machine, ns.
const HANGS_NS: u64 = 120_000_000_000;

/// A small generator whose numbers are the same everywhere (splitmix64).
struct Dice(u64);

impl Dice {
    fn of(name: &str, number: u64) -> Self {
        let hash =
            name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        Self(hash ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// What breaks numbers in text.
const WORDS: [&str; 14] = [
    "nan",
    "inf",
    "-inf",
    "1e999",
    "-0",
    "1e-320",
    "99999999999999999999",
    "0x10",
    ",,",
    "\n\n",
    "\0",
    "\u{feff}",
    "[[",
    "= ",
];
/// What breaks lengths and counts.
const NUMBERS: [u64; 8] = [0, 1, 0x7f, 0xffff, 0x7fff_ffff, 0xffff_ffff, i64::MAX as u64, u64::MAX];

/// A seed with one to eight things broken.
fn broken(seed: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=dice.below(8) {
        let at = dice.below(bytes.len());
        let length = dice.below(64).min(bytes.len() - at);
        match dice.below(9) {
            0 if at < bytes.len() => bytes[at] ^= 1 << dice.below(8),
            1 if at < bytes.len() => bytes[at] = dice.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at..at + length)),
            4 => {
                let piece = bytes[at..at + length].to_vec();
                let to = dice.below(bytes.len());
                bytes.splice(to..to, piece);
            }
            5 => drop(bytes.splice(at..at, WORDS[dice.below(WORDS.len())].bytes())),
            6 => drop(bytes.splice(at..at + length, WORDS[dice.below(WORDS.len())].bytes())),
            7 => {
                let number = NUMBERS[dice.below(NUMBERS.len())].to_le_bytes();
                let end = (at + 8).min(bytes.len());
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            _ => {
                let times = dice.below(200);
                let piece = bytes[at..at + length].to_vec();
                bytes.extend(piece.iter().cycle().take(piece.len() * times));
            }
        }
    }
    bytes
}

/// What a reader does with bytes.
type Reading<'a> = Box<dyn Fn(&[u8]) + 'a>;

/// A reader, what it reads when nothing is broken, and how many broken inputs it gets by default.
struct Reader<'a> {
    name: &'static str,
    seeds: Vec<Vec<u8>>,
    n_inputs: u64,
    read: Reading<'a>,
}

fn shipped(path: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)).expect("shipped")
}

/// A file of the folder with these bytes.
fn file_in(folder: &TempFolder, name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(folder.file(name));
    fs::write(&path, bytes).expect("written");
    path
}

fn readers(folder: &TempFolder) -> Vec<Reader<'_>> {
    let snake = Snake::new(&MachineParameters::default()).expect("the default machine");
    let script = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0,0,0\n1,0.01,0,0\n2.5,0,0.01,0\n".as_bytes();
    let reports: Vec<u8> = shipped("master/recordings/default.krr")
        .split_inclusive(|b| *b == b'\n')
        .take(200)
        .flatten()
        .copied()
        .collect();
    let table: Vec<u8> =
        shipped("docs/lab-tutorial/hidden.csv").split_inclusive(|b| *b == b'\n').take(300).flatten().copied().collect();
    let recording = folder.file("seed.mcap");
    let instance = instance_name("fuzz");
    let run = ["run", "--engage=again", "--instance", &instance, "--recording", &recording, "--seconds", "1"];
    let ended = Ended::of(&run, Duration::from_secs(240));
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.stderr);
    let whole = Recording::open(Path::new(&recording)).expect("readable");
    let mut payloads = Vec::new();
    for recorded in whole.samples().expect("samples").step_by(97).take(40) {
        let mut bytes = Vec::new();
        krait_schema::encode(&recorded.expect("readable").sample, &mut bytes).expect("encoded");
        payloads.push(bytes);
    }
    let tables = |names: &[&str]| names.iter().map(|name| shipped(&format!("lab/tests/data/formats/{name}"))).collect();
    let look = |name: &'static str| -> Reading<'_> {
        Box::new(move |bytes| drop(propose(&file_in(folder, name, bytes), &ColumnMap::default())))
    };
    let mut readers = vec![
        Reader { name: "bag", seeds: tables(&["jaw.mcap", "rates.mcap"]), n_inputs: 100, read: look("fuzz.bag") },
        Reader {
            name: "parquet",
            seeds: tables(&["jaw.parquet", "other.parquet"]),
            n_inputs: 200,
            read: look("fuzz.parquet"),
        },
        Reader { name: "matlab", seeds: tables(&["jaw.mat", "struct.mat"]), n_inputs: 200, read: look("fuzz.mat") },
        Reader {
            name: "mcap",
            seeds: vec![fs::read(&recording).expect("there")],
            n_inputs: 60,
            read: Box::new(move |bytes| {
                let (path, out) = (file_in(folder, "fuzz.mcap", bytes), folder.file("saved.mcap"));
                if let Ok(recording) = Recording::open(&path) {
                    let n_samples = recording.samples().map_or(0, Iterator::count);
                    assert!(n_samples < 10_000_000);
                    let choice = InputChoice { path: path.clone(), pass: 1, range_s: 0.0..f64::INFINITY };
                    drop(Beginning::read(&choice));
                }
                drop(recover(&path, Path::new(&out)));
                drop(fs::remove_file(out));
            }),
        },
        Reader {
            name: "payload",
            seeds: payloads,
            n_inputs: 5000,
            read: Box::new(|bytes| {
                Channel::ALL.into_iter().for_each(|channel| drop(krait_schema::decode(channel, bytes)))
            }),
        },
        Reader {
            name: "report",
            seeds: vec![vec![1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], vec![3, 1], vec![2, 0, 1, 0, 1, 0, 1]],
            n_inputs: 5000,
            read: Box::new(|bytes| {
                core::hint::black_box(HidReport::decode(bytes).is_ok());
            }),
        },
        Reader {
            name: "krr",
            seeds: vec![reports],
            n_inputs: 300,
            read: Box::new(|bytes| drop(Reports::parse("fuzz", bytes))),
        },
        Reader {
            name: "script",
            seeds: vec![script.to_vec()],
            n_inputs: 1000,
            read: Box::new(|bytes| drop(Script::parse("fuzz", bytes))),
        },
        Reader {
            name: "trajectory",
            seeds: vec![
                shipped("tests/recordings/flick.csv"),
                b"time_s,bend_x_rad,bend_y_rad\n0,0,0\n1,0.2,0\n2,0,0.1\n".to_vec(),
            ],
            n_inputs: 300,
            read: Box::new(move |bytes| {
                let limits = TrajectoryLimits::Snake { snake: &snake, max_bend_rad: 1.3, max_bend_vel_rad_per_s: 2.0 };
                drop(Trajectory::parse("fuzz", bytes, &limits));
            }),
        },
        Reader {
            name: "truth",
            seeds: vec![shipped("sim/truth/default.toml")],
            n_inputs: 300,
            read: Box::new(|bytes| drop(Truth::parse(&String::from_utf8_lossy(bytes), "fuzz"))),
        },
        Reader {
            name: "joints-truth",
            seeds: vec![shipped("sim/truth/wrist.toml")],
            n_inputs: 300,
            read: Box::new(|bytes| drop(JointsTruth::parse(&String::from_utf8_lossy(bytes), "fuzz", 3))),
        },
        Reader {
            name: "model",
            seeds: vec![
                krait_model::model_file::documented_defaults().into_bytes(),
                shipped("docs/lab-tutorial/base.toml"),
                shipped("docs/joints/wrist.toml"),
                shipped("docs/segments/two.toml"),
                shipped("docs/segments/learn.toml"),
            ],
            n_inputs: 300,
            read: Box::new(|bytes| {
                if let Ok(file) = ModelFile::parse(&String::from_utf8_lossy(bytes)) {
                    drop(file.chain(KnownColumns::default()));
                    drop(file.segment_chain().map(|chain| chain.map(|chain| chain.compensator())));
                }
            }),
        },
        Reader {
            name: "table",
            seeds: vec![
                table,
                b"\xef\xbb\xbfStamp [ns];Motor (deg);Jaw [mrad];note\r\n1763809215000000000;1,5;26,2;\"a;b\"\r\n1763809215020000000;1,6;27,9;\r\n".to_vec(),
                b"t\tu1_deg\ty1_deg\ttrial\n0\t0.5\t0.4\tup\n20\t0.6\t0.5\tup\n".to_vec(),
            ],
            n_inputs: 300,
            read: Box::new(move |bytes| {
                let path = file_in(folder, "fuzz.csv", bytes);
                drop(read(&path, &ColumnMap::default(), Expected::Snake));
                drop(propose(&path, &ColumnMap::default()));
            }),
        },
        Reader {
            name: "map",
            seeds: vec![b"format = 1\n[columns]\ntime_s = { column = \"Stamp\", unit = \"ns\" }\nu1_rad = { column = \"Motor\" }\n".to_vec()],
            n_inputs: 200,
            read: Box::new(move |bytes| {
                let path = file_in(folder, "fuzz.map.toml", bytes);
                drop(ColumnMap::from_file(&path));
            }),
        },
        Reader {
            name: "pose",
            seeds: vec![[1.0, 0.5, 10.0, -5.0, 80.0, 1.0, 0.0, 0.0, 0.0_f64].iter().flat_map(|v| v.to_le_bytes()).collect()],
            n_inputs: 5000,
            read: Box::new(|bytes| {
                core::hint::black_box(PosePacket::decode(bytes, 1e-3).is_ok());
            }),
        },
        Reader {
            name: "profile",
            seeds: vec![
                shipped("master/profiles/extreme-3d-pro.toml"),
                shipped("master/profiles/xbox-360.toml"),
                // As somebody's own: with a device.
                [b"id = \"0627:0001\"\n", &shipped("master/profiles/mouse.toml")[..]].concat(),
                [b"id = \"0627:0001\"\n", &shipped("master/profiles/keyboard.toml")[..]].concat(),
            ],
            n_inputs: 1000,
            read: Box::new(|bytes| drop(Profile::parse("fuzz", &String::from_utf8_lossy(bytes)))),
        },
        Reader {
            name: "shape",
            seeds: vec![
                br#"{"krait_shapes": 1, "clock": "own", "offset_ns": 12, "source": "a"}"#.to_vec(),
                br#"{"exposure_ns": 81, "sent_ns": 90, "frame": 1, "bend_rad": [0.31, -0.12], "covariance_rad2": [2.7e-5, 0.0, 2.7e-5]}"#.to_vec(),
                br#"{"exposure_ns": 81, "frame": 4, "joints_rad": [0.10, -0.42], "variances_rad2": [1e-6, 4e-6]}"#.to_vec(),
            ],
            n_inputs: 5000,
            read: Box::new(|bytes| drop(ShapeLine::parse(bytes))),
        },
        Reader {
            name: "clicks",
            seeds: vec![clicks()],
            n_inputs: 500,
            read: Box::new(move |bytes| {
                let path = file_in(folder, "fuzz.clicks.csv", bytes);
                if let Ok(clicks) = photo::read(&path) {
                    drop(photo::bends(&clicks, 0.5));
                }
            }),
        },
    ];
    readers.extend(peers::readers(folder));
    readers
}

/// A picture from the front: a grid of nine corners, and both edges of both disks.
fn clicks() -> Vec<u8> {
    let mut text = String::from("image,view,kind,x_mm,z_mm,u_px,v_px\n");
    for (x_mm, z_mm) in [-5, 0, 5].into_iter().flat_map(|x| [0, 10, 20].map(|z| (x, z))) {
        text += &format!("a,front,corner,{x_mm},{z_mm},{},{}\n", 1500 + 20 * x_mm, 1800 - 20 * z_mm);
    }
    for (kind, u_px, v_px) in [("base", 1440, 1800), ("base", 1560, 1800), ("end", 1540, 1240), ("end", 1640, 1310)] {
        text += &format!("a,front,{kind},,,{u_px},{v_px}\n");
    }
    text.into_bytes()
}

/// Ends the program when one input takes too long: a hang cannot be told in another way.
fn watch() {
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let begun_ns = BEGUN_NS.load(Relaxed);
            if begun_ns > 0 && (clock::monotonic_ns().unsigned_abs()).saturating_sub(begun_ns) > HANGS_NS {
                eprintln!("an input hangs; the line before names it");
                std::process::abort();
            }
        }
    });
}

#[test]
fn no_reader_panics_hangs_or_fills_the_memory() {
    let word = |name: &str| std::env::var(name).ok();
    let seconds: Option<u64> = word("FUZZ_SECONDS").map(|text| text.parse().expect("FUZZ_SECONDS is a number"));
    let from: u64 = word("FUZZ_FROM").map_or(0, |text| text.parse().expect("FUZZ_FROM is a number"));
    let folder = TempFolder::new("fuzz");
    watch();
    for reader in readers(&folder).iter().filter(|reader| word("FUZZ_ONLY").is_none_or(|only| only == reader.name)) {
        reader.seeds.iter().for_each(|seed| (reader.read)(seed));
        let begun_ns = clock::monotonic_ns();
        let mut largest = 0;
        let mut number = from;
        loop {
            let elapsed_s = (clock::monotonic_ns() - begun_ns) / 1_000_000_000;
            let is_over = seconds.map_or(number >= from + reader.n_inputs, |s| elapsed_s >= s.cast_signed());
            if is_over {
                break;
            }
            let mut dice = Dice::of(reader.name, number);
            let seed = &reader.seeds[dice.below(reader.seeds.len())];
            let input = broken(seed, &mut dice);
            let before = N_BYTES.load(Relaxed);
            PEAK.store(before, Relaxed);
            BEGUN_NS.store(clock::monotonic_ns().unsigned_abs(), Relaxed);
            let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| (reader.read)(&input)));
            BEGUN_NS.store(0, Relaxed);
            let held = PEAK.load(Relaxed).saturating_sub(before);
            largest = largest.max(held);
            assert!(done.is_ok(), "FUZZ_ONLY={} FUZZ_FROM={number} panics", reader.name);
            assert!(held < MOST_BYTES, "FUZZ_ONLY={} FUZZ_FROM={number} takes {held} bytes", reader.name);
            number += 1;
        }
        println!("{}: {} inputs, at most {} kB", reader.name, number - from, largest / 1024);
    }
}

#[test]
fn every_layout_of_reports_survives_every_short_report() {
    // Three bytes are all reports that say which they are, with one axis: few enough to try them all.
    for first in 0..=u8::MAX {
        for second in 0..=u8::MAX {
            for bytes in
                [vec![first], vec![first, second], vec![first, second, 0xff], vec![first, second, 0x7f, 0x80, 0, 1, 2]]
            {
                core::hint::black_box(HidReport::decode(&bytes).is_ok());
            }
        }
    }
}
