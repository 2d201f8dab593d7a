//! What every end-to-end test needs: the krait program, names of its own, and a look at what a run left behind.
//!
//! Purpose: a test starts the real program as a user would, under an instance name that no other test has.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

mod browser;
mod chain_sender;
mod http;
mod lab_room;
mod looks;
mod motion;
mod operate_room;
mod pad;
mod program;
mod relay;
mod rewrite;
mod riddle;
mod world;

pub use browser::{Browser, BrowserPage};
pub use chain_sender::{ChainScene, ChainSender};
pub use http::{Console, HttpAnswer, Live, answer_on, is_closed, next_of_kind};
pub use lab_room::{bar_values, bars, choose, press};
pub use looks::{SIZES, STOP_IS_FREE, Scrolls, canvas_points};
pub use motion::{
    allowed_m, assert_no_jump, assert_starts_at_setpoint, commands_in, is_moving, kill_until_back, samples_in,
    signal_process, states_in, step_m, wait_for, wait_for_motion,
};
pub use operate_room::{bars_shown, needs_shown, seen_in_operate_room, watch_operate_room};
pub use pad::{PadPage, pad_losses};
pub use program::{Ended, Krait, krait_program};
pub use relay::{CuttableWay, WayCut};
pub use rewrite::{rewrite, rewrite_some};
pub use riddle::{Riddle, hand, krait_json};
pub use world::{
    TempFolder, cpu_ticks, held_terminal, instance_name, pid_of, processes_of, real_drives, say_aloud, stat_number,
    wait_until,
};
