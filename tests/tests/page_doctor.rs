//! Doctor's findings on the page, while a chain moves and a job of the lab is at work: neither ends, and the job gives its answer.
//! Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{
    Browser, Console, Ended, Krait, TempFolder, instance_name, is_moving, processes_of, wait_for, wait_until,
};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;

const PATIENCE: Duration = Duration::from_secs(240);

/// The process of a job of the lab: the one that has a file of its folder on its command line.
fn job_on(file: &str) -> Option<Pid> {
    let entries = std::fs::read_dir("/proc").expect("/proc").flatten();
    entries.into_iter().find_map(|entry| {
        let pid = entry.file_name().to_str()?.parse().ok()?;
        let line = std::fs::read(entry.path().join("cmdline")).ok()?;
        let words: Vec<&[u8]> = line.split(|byte| *byte == 0).collect();
        (words.contains(&b"diagnose".as_slice()) && words.contains(&file.as_bytes())).then(|| Pid::from_raw(pid))?
    })
}

#[test]
fn doctors_findings_are_shown_beside_a_job_and_a_chain_that_go_on() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("doctor"), TempFolder::new("doctor"));
    let (lab, recording) = (folder.file("lab"), folder.file("run.mcap"));
    let data = format!("{lab}/data.csv");
    std::fs::create_dir(&lab).expect("a folder");
    let hidden = ["--kind", "backlash", "--size", "3", "--seconds", "40", "--rate", "25", "--seed", "5"];
    let made = Ended::of(&[&["lab", "generate", "--out", &data], &hidden[..]].concat(), PATIENCE);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let krait = Krait::start(&["run", "--engage=again", "--instance", &instance, "--recording", &recording]);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let console = Console::of(&mut server);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    wait_for(&instance, "moving", is_moving);
    let chain = processes_of(&instance);

    let order = json!({ "verb": "diagnose", "model": "base.toml", "data": "data.csv" }).to_string();
    let start = format!("fetch('/lab/job', {{ method: 'POST', body: {} }}).then(job => job.json())", json!(order));
    let job = page.value(&start);
    assert_eq!(job["stage"], "running", "{job}");
    let mut process = None;
    assert!(
        wait_until(PATIENCE, || {
            process = job_on(&data);
            process.is_some()
        }),
        "the job's process"
    );
    let process = process.expect("found");
    // Stopped, so that it is at work for as long as the test looks, however fast the machine is.
    kill_process(process, Signal::STOP).expect("stopped");

    page.value("document.querySelector('[data-go=latency]').click()");
    let found = "document.querySelectorAll('#latency .findings li').length > 2 && document.querySelector('#latency .findings').getAttribute('aria-busy') === 'false'";
    page.wait_for("doctor's findings", found);
    page.keep("doctor-beside-a-job");
    page.value("document.querySelector('#latency .findings').replaceChildren(); document.querySelector('#latency .doctor .second').click(); 0");
    page.wait_for("and once more", found);
    let beside = page.value("fetch('/lab/job').then(job => job.json())");
    assert_eq!((&beside["id"], &beside["stage"]), (&job["id"], &json!("running")), "{beside}");
    assert_eq!(job_on(&data), Some(process), "its process lives");
    let second = page.value(&start.replace(".then(job => job.json())", ".then(job => job.status)"));
    assert_eq!(second, json!(409), "its place is not given away");
    assert_eq!(processes_of(&instance), chain, "the chain's processes are the same");
    let state = wait_for(&instance, "moving still", is_moving);
    assert_eq!(state.n_stops, 0, "nobody stopped it");

    kill_process(process, Signal::CONT).expect("goes on");
    let script = "fetch('/lab/job').then(job => job.json())";
    let ended = wait_until(PATIENCE, || page.value(script)["stage"] != "running");
    let done = page.value(script);
    assert!(ended && done["id"] == job["id"] && done["stage"] == "done", "{done}");
    let class = done["answer"]["effects"][0]["class"].as_array().expect("an effect and what looks like it");
    assert!(class.contains(&json!("backlash")), "{}", done["answer"]["sentence"]);
    server.signal(Signal::TERM);
    server.end(PATIENCE);
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
}
