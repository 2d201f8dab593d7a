//! The tutorials of the model lab: their commands print what their texts say.

use crate::page::{Folder, follow};
use std::fs;

#[test]
fn the_tutorial_s_commands_print_what_its_text_says() {
    let folder = Folder::new("snake");
    let n_commands = follow("lab-tutorial.md", &["lab-tutorial/base.toml", "lab-tutorial/hidden.csv"], &folder);
    assert_eq!(n_commands, 4);
    let page = fs::read_to_string(folder.0.join("why.html")).expect("the page of pictures");
    assert!(page.contains("Direction split") && page.contains("Travel since the last reversal"));
    let script = fs::read_to_string(folder.0.join("next.csv")).expect("the script");
    assert!(script.contains("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch"));
}

#[test]
fn the_jaw_s_commands_print_what_its_text_says() {
    let folder = Folder::new("jaw");
    let data = "../lab/tests/data/davinci-jaw";
    let files = [&format!("{data}/00.csv"), &format!("{data}/09.csv"), "jaw-tutorial/torque.toml"];
    let n_commands = follow("jaw-tutorial.md", &files, &folder);
    assert_eq!(n_commands, 8);
}
