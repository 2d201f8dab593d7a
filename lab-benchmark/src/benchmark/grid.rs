//! The grid of a benchmark: every kind, several sizes, noises and motions, each cell a recipe that follows from one seed.

use crate::force::{FORCE_KINDS, ForceKind, ForceRecipe, pick_force};
use crate::generate::{KINDS, Kind, Motion, NoiseKind, Recipe, pick, several};
use crate::joints::{JOINT_KINDS, JointKind, JointRecipe, pick_joints};
use crate::segments::{SegmentKind, SegmentsRecipe, pick_segments};

/// What a cell asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Nothing is hidden: is an effect claimed?
    None,
    /// One known effect: is it named?
    Single,
    /// Two known effects: are both named, and no third?
    Pair,
    /// An effect that no known one explains: is one claimed?
    Outside,
    /// Three to five known effects: are these named, and no other?
    Several,
    /// A known effect beside one that no known one explains: is it named, and is it said that a rest remains?
    Beside,
    /// One known effect in a plant whose dimensions are off by up to 5 %, with the geometry free in the model: is the effect named?
    OffBase,
    /// A one-way ramp, which tells nearly nothing: is the truth among the look-alikes?
    Poor,
}

impl Group {
    /// Every group.
    pub const ALL: [Self; 8] =
        [Self::None, Self::Single, Self::Pair, Self::Outside, Self::Poor, Self::Several, Self::Beside, Self::OffBase];

    /// The group of that word; `None` if there is none.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|group| group.word() == word)
    }

    /// Its word.
    pub fn word(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Single => "single",
            Self::Pair => "pair",
            Self::Outside => "outside",
            Self::Several => "several",
            Self::Beside => "beside",
            Self::OffBase => "off-base",
            Self::Poor => "poor",
        }
    }
}

/// One cell.
#[derive(Clone, Debug)]
pub struct GridCell {
    /// Its name, the same on every run: which cells are finished is known by it.
    pub id: String,
    /// What it asks.
    pub group: Group,
    /// How its data are made.
    pub task: Task,
}

/// How a cell's data are made.
#[derive(Clone, Debug)]
pub enum Task {
    /// Of a snake.
    Snake(Recipe),
    /// Of two joints.
    Joints(JointRecipe),
    /// Of a joint's torque.
    Force(ForceRecipe),
    /// Of two or three segments in series.
    Segments(SegmentsRecipe),
}

impl Task {
    /// Everything that is drawn follows from it.
    pub fn seed(&self) -> u64 {
        match self {
            Self::Snake(recipe) => recipe.seed,
            Self::Joints(recipe) => recipe.seed,
            Self::Force(recipe) => recipe.seed,
            Self::Segments(recipe) => recipe.seed,
        }
    }
}

/// Sizes of single effects, in units of the noise's length.
const SIZES: [f64; 3] = [1.0, 2.0, 4.0];
const NOISES: [NoiseKind; 8] = [
    NoiseKind::White,
    NoiseKind::Coloured(0.2),
    NoiseKind::Coloured(1.0),
    NoiseKind::Coloured(3.0),
    NoiseKind::Quantised,
    NoiseKind::Outliers,
    NoiseKind::Heteroscedastic,
    NoiseKind::Drift,
];
/// Pairs in each round.
const N_PAIRS: usize = 16;
/// Of a snake, longer lists, and known ones beside unknown ones.
const N_SEVERAL: usize = 6;
/// How far the dimensions of a plant are off, as a part of them, and how large the effect beside it is.
const OFF_BASE: f64 = 0.05;
const OFF_BASE_SIZE: f64 = 2.0;
/// Kinds under a one-way ramp.
const POOR: [&str; 4] = ["backlash", "cone", "delay", "encoder-zero"];

/// The cells of `n_rounds` rounds. More rounds only add cells.
pub fn grid(seed: u64, n_rounds: usize, seconds: f64) -> Vec<GridCell> {
    let mut cells = Vec::new();
    for round in 0..n_rounds {
        let mut cells_of_round = Vec::new();
        let mut add = |group: Group, hidden: Vec<(&'static Kind, f64)>, motion: Motion, noise: NoiseKind| {
            let own_seed = mixed(seed, round as u64, cells_of_round.len() as u64);
            let perturbation = if group == Group::OffBase { OFF_BASE } else { 0.0 };
            let recipe = Recipe { hidden, motion, noise, seed: own_seed, seconds, perturbation, ..Recipe::default() };
            cells_of_round.push(GridCell { id: id(group, &recipe), group, task: Task::Snake(recipe) });
        };
        for (k, noise) in NOISES.into_iter().enumerate() {
            for motion in [Motion::Rich, Motion::Teleop] {
                add(Group::None, Vec::new(), motion, noise);
            }
            let outside: Vec<&Kind> = KINDS.iter().filter(|kind| !kind.is_known()).collect();
            if let Some(&kind) = outside.get(k) {
                add(Group::Outside, vec![(kind, 2.0)], Motion::Rich, NoiseKind::White);
                add(Group::Outside, vec![(kind, 2.0)], Motion::Teleop, NoiseKind::White);
            }
        }
        for (k, kind) in KINDS.iter().filter(|kind| kind.is_known()).enumerate() {
            for (j, size) in SIZES.into_iter().enumerate() {
                let motion = if (k + j + round) % 2 == 0 { Motion::Rich } else { Motion::Teleop };
                let noise = if (k + round) % 3 == 2 { NoiseKind::Coloured(0.5) } else { NoiseKind::White };
                add(Group::Single, vec![(kind, size.min(kind.most_size))], motion, noise);
            }
        }
        for k in 0..N_PAIRS {
            let hidden = pick(mixed(seed ^ 0x5eed, round as u64, k as u64), true);
            let sizes: [f64; 2] = [2.5, 1.5];
            let hidden = hidden.into_iter().zip(sizes).map(|(kind, size)| (kind, size.min(kind.most_size))).collect();
            add(Group::Pair, hidden, if k % 2 == 0 { Motion::Rich } else { Motion::Teleop }, NoiseKind::White);
        }
        for k in 0..N_SEVERAL as u64 {
            let own = |salt: u64, n_known: usize, unknown: bool| {
                let kinds = several(mixed(seed ^ salt, round as u64, k), n_known, unknown);
                let sizes = [2.5, 1.5, 2.0, 1.2, 1.8];
                kinds
                    .into_iter()
                    .zip(sizes)
                    .map(|(kind, size): (_, f64)| (kind, size.min(kind.most_size)))
                    .collect::<Vec<_>>()
            };
            let motion = if k % 2 == 0 { Motion::Rich } else { Motion::Teleop };
            add(Group::Several, own(0x5e7e, 3 + (k % 3) as usize, false), motion, NoiseKind::White);
            add(Group::Beside, own(0xbe51, 1, true), motion, NoiseKind::White);
        }
        for kind in POOR.iter().filter_map(|name| Kind::from_name(name)) {
            add(Group::Poor, vec![(kind, 2.0)], Motion::Ramp, NoiseKind::White);
        }
        for (k, kind) in KINDS.iter().filter(|kind| kind.is_known() && !kind.is_of_scale()).enumerate() {
            let motion = if (k + round) % 2 == 0 { Motion::Rich } else { Motion::Teleop };
            add(Group::OffBase, vec![(kind, OFF_BASE_SIZE.min(kind.most_size))], motion, NoiseKind::White);
        }
        cells.append(&mut cells_of_round);
    }
    cells
}

fn id(group: Group, recipe: &Recipe) -> String {
    let hidden: Vec<String> = recipe.hidden.iter().map(|(kind, size)| format!("{}={size}", kind.name)).collect();
    let noise = recipe.noise.name();
    format!("{}/{}/{}/{noise}/{:016x}", group.word(), hidden.join("+"), recipe.motion.name(), recipe.seed)
}

/// The cells of `n_rounds` rounds of joints. More rounds only add cells.
pub fn joint_grid(seed: u64, n_rounds: usize, seconds: f64) -> Vec<GridCell> {
    let mut cells = Vec::new();
    for round in 0..n_rounds {
        let mut n = 0;
        let mut add = |group: Group, hidden: Vec<(&'static JointKind, f64)>, noise: NoiseKind, every: usize| {
            n += 1;
            let own_seed = mixed(seed ^ 0x0070_1275, round as u64, n);
            let recipe = JointRecipe {
                hidden,
                is_teleop: n % 2 == 0,
                noise,
                every,
                seed: own_seed,
                seconds,
                ..JointRecipe::default()
            };
            let names: Vec<String> =
                recipe.hidden.iter().map(|(kind, size)| format!("{}={size:.2}", kind.name)).collect();
            let id = format!("joints/{}/{}/{}/{every}/{own_seed:016x}", group.word(), names.join("+"), noise.name());
            cells.push(GridCell { id, group, task: Task::Joints(recipe) });
        };
        let size =
            |k: u64, low: f64, high: f64| low * (high / low).powf((mixed(seed, round as u64, k) % 997) as f64 / 997.0);
        for noise in NOISES {
            add(Group::None, Vec::new(), noise, 1);
            add(Group::None, Vec::new(), noise, 1);
        }
        for (k, kind) in JOINT_KINDS.iter().enumerate() {
            let (group, low, high) =
                if kind.is_known() { (Group::Single, 1.0, 6.0) } else { (Group::Outside, 1.0, 6.0) };
            let noise = if (k + round) % 3 == 2 { NoiseKind::Coloured(0.5) } else { NoiseKind::White };
            add(group, vec![(kind, size(k as u64, low, high))], noise, if k % 4 == 3 { 5 } else { 1 });
            if !kind.is_known() {
                add(group, vec![(kind, size(k as u64 + 100, low, high))], noise, 1);
            }
        }
        for k in 0..N_PAIRS as u64 {
            let picked = |n_known: usize, unknown: bool, salt: u64| {
                let kinds = pick_joints(mixed(seed ^ salt, round as u64, k), n_known, unknown);
                let own =
                    |(i, kind): (usize, &'static JointKind)| (kind, size(1000 * salt + 10 * k + i as u64, 1.2, 5.0));
                kinds.into_iter().enumerate().map(own).collect::<Vec<_>>()
            };
            let noise = if k % 4 == 3 { NoiseKind::Coloured(0.2) } else { NoiseKind::White };
            add(Group::Pair, picked(2, false, 1), noise, 1);
            add(Group::Several, picked(3 + (k % 3) as usize, false, 2), noise, 1);
            add(Group::Beside, picked(1, true, 3), noise, 1);
        }
    }
    cells
}

/// The cells of `n_rounds` rounds of a joint's torque. More rounds only add cells.
pub fn force_grid(seed: u64, n_rounds: usize, seconds: f64) -> Vec<GridCell> {
    let mut cells = Vec::new();
    for round in 0..n_rounds {
        let mut n = 0;
        let mut add = |group: Group, kinds: Vec<&'static ForceKind>, noise: NoiseKind, (low, high): (f64, f64)| {
            n += 1;
            let own_seed = mixed(seed ^ 0x0f0_12ce, round as u64, n);
            let size = |k: usize| {
                let part = (mixed(own_seed, k as u64, 1) % 997) as f64 / 997.0;
                low * (high / low).powf(part)
            };
            let recipe = ForceRecipe {
                hidden: kinds.into_iter().enumerate().map(|(k, kind)| (kind, size(k))).collect(),
                sweeps: n % 2 == 0,
                has_load: n % 3 == 0,
                noise,
                seed: own_seed,
                seconds,
                ..ForceRecipe::default()
            };
            let names: Vec<String> =
                recipe.hidden.iter().map(|(kind, size)| format!("{}={size:.2}", kind.name)).collect();
            let id = format!("force/{}/{}/{}/{own_seed:016x}", group.word(), names.join("+"), noise.name());
            cells.push(GridCell { id, group, task: Task::Force(recipe) });
        };
        for noise in NOISES {
            add(Group::None, Vec::new(), noise, (1.0, 1.0));
            add(Group::None, Vec::new(), noise, (1.0, 1.0));
        }
        // Friction of the loaded gear is a second effect beside its load.
        for (k, kind) in FORCE_KINDS.iter().filter(|kind| !kind.needs_load).enumerate() {
            let group = if kind.is_known() { Group::Single } else { Group::Outside };
            let noise = if (k + round) % 3 == 2 { NoiseKind::Coloured(0.2) } else { NoiseKind::White };
            add(group, vec![kind], noise, (0.5, 6.0));
            add(group, vec![kind], NoiseKind::White, (0.5, 6.0));
        }
        for k in 0..N_PAIRS as u64 {
            let picked = |n_known: usize, unknown: bool, salt: u64| {
                pick_force(mixed(seed ^ salt, round as u64, k), n_known, unknown)
            };
            let noise = if k % 4 == 3 { NoiseKind::Coloured(0.2) } else { NoiseKind::White };
            add(Group::Pair, picked(2, false, 1), noise, (1.0, 6.0));
            add(Group::Several, picked(3 + (k % 3) as usize, false, 2), noise, (1.0, 6.0));
            add(Group::Beside, picked(1, true, 3), noise, (1.0, 6.0));
        }
    }
    cells
}

/// The cells of `n_rounds` rounds of two and three segments. More rounds only add cells.
pub fn segments_grid(seed: u64, n_rounds: usize, seconds: f64) -> Vec<GridCell> {
    let mut cells = Vec::new();
    for round in 0..n_rounds {
        let mut n = 0;
        let mut add = |group: Group, n_segments: usize, hidden: Vec<(SegmentKind, f64)>, noise: NoiseKind| {
            n += 1;
            let motion = if n % 2 == 0 { Motion::Rich } else { Motion::Teleop };
            let own_seed = mixed(seed ^ 0x05e6_3e27, round as u64, n);
            let recipe = SegmentsRecipe {
                n_segments,
                hidden,
                motion,
                noise,
                seed: own_seed,
                seconds,
                ..SegmentsRecipe::default()
            };
            let names: Vec<String> =
                recipe.hidden.iter().map(|(kind, size)| format!("{}={size}", kind.name())).collect();
            let (word, hidden) = (group.word(), names.join("+"));
            let id =
                format!("segments/{word}/{n_segments}/{hidden}/{}/{}/{own_seed:016x}", motion.name(), noise.name());
            cells.push(GridCell { id, group, task: Task::Segments(recipe) });
        };
        for n_segments in [2, 3] {
            NOISES.into_iter().for_each(|noise| add(Group::None, n_segments, Vec::new(), noise));
            for (k, kind) in SegmentKind::all(n_segments).into_iter().enumerate() {
                let (group, sizes) =
                    if kind.is_known() { (Group::Single, &SIZES[..]) } else { (Group::Outside, &SIZES[1..]) };
                let noise = if (k + round) % 3 == 2 { NoiseKind::Coloured(0.5) } else { NoiseKind::White };
                sizes.iter().for_each(|size| add(group, n_segments, vec![(kind, *size)], noise));
            }
            for k in 0..N_PAIRS as u64 / 2 {
                let kinds = pick_segments(mixed(seed ^ 0x5eed, round as u64, k), n_segments, 2);
                add(Group::Pair, n_segments, kinds.into_iter().zip([2.5, 1.5]).collect(), NoiseKind::White);
            }
        }
    }
    cells
}

/// Spreads three numbers over all seeds (the finaliser of SplitMix64).
fn mixed(seed: u64, round: u64, k: u64) -> u64 {
    let mut x = seed ^ round.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ k.wrapping_mul(0xd1b5_4a32_d192_ed03);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn segments_have_nulls_singles_of_every_kind_and_pairs_of_two_and_of_three() {
        let (one, two) = (segments_grid(7, 1, 60.0), segments_grid(7, 2, 60.0));
        assert!(one.iter().zip(&two).all(|(a, b)| a.id == b.id) && two.len() == 2 * one.len());
        assert_eq!(two.iter().map(|cell| &cell.id).collect::<BTreeSet<_>>().len(), two.len());
        for n_segments in [2, 3] {
            let of = |group: Group| {
                let own = one.iter().filter(move |cell| cell.group == group);
                own.filter(|cell| matches!(&cell.task, Task::Segments(own) if own.n_segments == n_segments)).count()
            };
            let n_known = SegmentKind::all(n_segments).iter().filter(|kind| kind.is_known()).count();
            assert_eq!([Group::None, Group::Single, Group::Pair].map(of), [8, 3 * n_known, 8]);
        }
    }

    #[test]
    fn more_rounds_only_add_cells_and_every_cell_has_its_own_name_and_seed() {
        let (one, three) = (grid(7, 1, 200.0), grid(7, 3, 200.0));
        assert!(one.iter().zip(&three).all(|(a, b)| a.id == b.id));
        let ids: BTreeSet<&String> = three.iter().map(|cell| &cell.id).collect();
        assert_eq!(ids.len(), three.len());
        assert!(grid(8, 1, 200.0).iter().zip(&one).all(|(a, b)| a.id != b.id));
        for group in Group::ALL {
            assert!(one.iter().any(|cell| cell.group == group), "{group:?}");
        }
    }
}
