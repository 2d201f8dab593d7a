//! Doctor's findings on the page, while a chain moves and a job of the lab is at work: neither ends, and the job gives its answer. Beside
//! them the numbers of Latency; and a job yields to every other process, ends where it is cancelled, and makes room for the next.
//! Skipped aloud where there is no Chromium.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{
    Browser, BrowserPage, Console, Ended, Krait, TempFolder, instance_name, is_moving, kill_until_back, processes_of,
    stat_number, wait_for, wait_until,
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

/// The session and the nice value of a process.
fn session_and_nice_of(process: Pid) -> (i32, i32) {
    let number = |field| stat_number(process.as_raw_nonzero().get().cast_unsigned(), field) as i32;
    (number(6), number(19))
}

/// The nice value of a process's session, where this kernel groups sessions.
fn nice_of_session(process: Pid) -> Option<i32> {
    let said = std::fs::read_to_string(format!("/proc/{}/autogroup", process.as_raw_nonzero())).ok()?;
    said.rsplit_once("nice ")?.1.trim().parse().ok()
}

/// The tiles of Latency, its hops and its processes have numbers while a chain runs.
fn latency_shows_numbers(page: &mut BrowserPage) {
    let of = |what: &str, form: &str, n: usize| {
        format!(
            "(all => all.length === {n} && all.every(own => {form}.test(own.textContent)))([...document.querySelectorAll('#latency {what}')])"
        )
    };
    // Median, p99, late, lost, robot to this picture, pages open.
    page.wait_for("the tiles", &of(".tiles b", "/^[0-9\u{202f}.]+( µs| ms)?$/", 6));
    // Each hop and the whole way: median, p99 and worst, each with its budget.
    let n_hops = krait_ipc::message::N_HOPS + 1;
    page.wait_for("the hops", &of(".hops td.n b", "/^[0-9.]+ (µs|ms|s)$/", 3 * n_hops));
    page.wait_for("their budgets", &of(".hops td.n em", "/^[0-9.]+ (µs|ms|s)$/", 3 * n_hops));
    page.wait_for("their histograms", &of(".histogram path.bins[d^=M]", "/^$/", n_hops));
    page.wait_for("the last minute", &of(".history path.p50[d^=M]", "/^$/", 1));
    let rows = "[...document.querySelectorAll('#latency .procs tbody tr:not(:has(.why-so))')].map(row => [...row.children].map(cell => cell.textContent))";
    let is_whole = format!(
        "(rows => rows.length >= 8 && rows.every(row => /^[0-9]+$/.test(row[1]) && / %$/.test(row[2]) && / MB$/.test(row[3])))({rows})"
    );
    page.wait_for("the processes", &is_whole);
}

#[test]
fn what_is_late_and_who_was_started_again_stand_on_the_latency_page() {
    let Some(browser) = Browser::start() else { return };
    let (instance, folder) = (instance_name("tiles"), TempFolder::new("tiles"));
    let config = folder.file("krait.toml");
    // Nothing is that fast.
    let budget =
        "p50_us = 0.1\np99_us = 0.1\nworst_us = 0.1\np50_floors = 2.0\np99_floors = 5.0\nworst_floors = 50.0\n";
    std::fs::write(&config, format!("[budget.end_to_end]\n{budget}")).expect("written");
    let run = ["run", "--engage=again", "--instance", &instance, "--config", &config, "--console", "--no-recording"];
    let mut krait = Krait::start(&run);
    let mut page = browser.page(&Console::of(&mut krait).address, 1280, 800);
    page.wait_for("the snake follows", "document.documentElement.dataset.shown === 'following'");
    page.value("document.querySelector('[data-go=latency]').click()");
    let tile = |name: &str, is: &str| {
        format!(
            "(tile => tile && {is})([...document.querySelectorAll('#latency .tiles > div')].find(tile => tile.textContent.startsWith('{name}')))"
        )
    };
    let is_over = "tile.classList.contains('over')";
    let n_late = "Number(tile.querySelector('b').textContent.replace(/\\D/g, ''))";
    page.wait_for("late samples are counted", &tile("Late samples", &format!("{is_over} && {n_late} > 100")));
    page.wait_for("the median is beyond its budget", &tile("Hand to drive, median", is_over));
    page.wait_for("nothing is lost", &tile("Lost samples", &format!("!{is_over} && {n_late} === 0")));
    page.wait_for(
        "the whole way is over",
        "(row => row.querySelector('.verdict').textContent === 'over')([...document.querySelectorAll('#latency .hops tbody tr')].at(-1))",
    );

    let restarts = |n: u32| {
        format!(
            "(row => row?.children[6].textContent === '{n}')([...document.querySelectorAll('#latency .procs tbody tr')].find(row => row.children[0].textContent === 'resolve'))"
        )
    };
    page.wait_for("resolve was never started again", &restarts(0));
    kill_until_back(&instance, "resolve", || ());
    page.wait_for("resolve was started again", &restarts(1));
    krait.signal(Signal::INT);
    krait.end(PATIENCE);
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
    // The robot's processes and the browser come first.
    let own = rustix::process::getpid();
    let wanted = (process.as_raw_nonzero().get(), (session_and_nice_of(own).1 + 15).min(19));
    assert!(wait_until(PATIENCE, || session_and_nice_of(process) == wanted), "{:?}", session_and_nice_of(process));
    assert!(
        nice_of_session(process).is_none() || wait_until(PATIENCE, || nice_of_session(process) == Some(15)),
        "{:?}",
        nice_of_session(process)
    );
    // Stopped, so that it is at work for as long as the test looks, however fast the machine is.
    kill_process(process, Signal::STOP).expect("stopped");

    page.value("document.querySelector('[data-go=latency]').click()");
    let found = "document.querySelectorAll('#latency .findings li').length > 2 && document.querySelector('#latency .findings').getAttribute('aria-busy') === 'false'";
    page.wait_for("doctor's findings", found);
    page.keep("doctor-beside-a-job");
    latency_shows_numbers(&mut page);
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
    // Five times a second: who asks too often is refused.
    let ended = format!(
        "(async () => {{ for (;;) {{ const job = await {script}; if (job.stage !== 'running') return job; await new Promise(done => setTimeout(done, 200)); }} }})()"
    );
    let done = page.value(&ended);
    assert!(done["id"] == job["id"] && done["stage"] == "done", "{done}");
    let class = done["answer"]["effects"][0]["class"].as_array().expect("an effect and what looks like it");
    assert!(class.contains(&json!("backlash")), "{}", done["answer"]["sentence"]);

    // Cancelled, its process is gone, and the next one begins.
    let begun = |page: &mut BrowserPage| {
        let job = page.value(&start);
        assert_eq!(job["stage"], "running", "{job}");
        let is_there =
            wait_until(PATIENCE, || job_on(&data).is_some_and(|own| kill_process(own, Signal::STOP).is_ok()));
        assert!(is_there, "the job's process");
        job["id"].clone()
    };
    let cancelled = begun(&mut page);
    page.value("fetch('/lab/cancel', { method: 'POST' }).then(() => 0)");
    assert!(wait_until(PATIENCE, || job_on(&data).is_none()), "its process is gone");
    let job = page.value(script);
    assert_eq!((&job["id"], &job["stage"]), (&cancelled, &json!("cancelled")), "{job}");
    let next = begun(&mut page);
    assert!(next.as_u64() > cancelled.as_u64(), "{next} behind {cancelled}");

    server.signal(Signal::TERM);
    server.end(PATIENCE);
    assert!(wait_until(PATIENCE, || job_on(&data).is_none()), "no job outlives its console");
    krait.signal(Signal::INT);
    let ended = krait.end(PATIENCE);
    assert!(ended.stdout.contains(" 0 lost"), "{ended:?}");
}
