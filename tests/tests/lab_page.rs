//! The lab's page from a comparison to the last bar: two hidden effects, added one after the other, each with a bar of its own.

#![allow(clippy::expect_used, clippy::panic, reason = "a panic is how a test fails")]

use core::time::Duration;
use krait_tests::{
    Browser, BrowserPage, Console, Ended, Krait, Scrolls, TempFolder, bar_values, bars, choose, instance_name, press,
    wait_until,
};
use rustix::process::{Pid, Signal, kill_process};

const PATIENCE: Duration = Duration::from_secs(240);

/// The lab's page with what a diagnosis has found.
struct Diagnosed {
    folder: TempFolder,
    data: String,
    /// The page is served as long as this lives.
    server: Krait,
    page: BrowserPage,
}

/// Makes data in which this is hidden, and has them compared and diagnosed in the page.
fn diagnosed(browser: &Browser, name: &str, hidden: &[&str]) -> Diagnosed {
    let (folder, instance) = (TempFolder::new(name), instance_name(name));
    let data = folder.file("data.csv");
    let made = Ended::of(&[&["lab", "generate", "--seed", "5", "--out", &data], hidden].concat(), PATIENCE);
    assert_eq!(made.code, Some(0), "{}", made.stderr);
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &folder.path().display().to_string()]);
    let mut page = browser.page(&Console::of(&mut server).address, 1280, 800);
    page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=lab]').click()");
    // What a job says while it is at work, line by line.
    page.value("window.stages = new Set(); new MutationObserver(() => { const said = document.querySelector('#lab .job-says')?.textContent; if (said) stages.add(said.replace(/^[0-9]+ s +/, '')); }).observe(document.getElementById('lab'), { subtree: true, childList: true, characterData: true }); 0");
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    bars(&mut page, 1, 2);
    Diagnosed { folder, data, server, page }
}

#[test]
fn the_bars_grow_while_effects_are_added_and_no_model_is_overwritten() {
    let Some(browser) = Browser::start() else { return };
    let hidden = ["--kind", "backlash+plane-offset", "--size", "2.5,2.5", "--seconds", "60", "--rate", "25"];
    let Diagnosed { folder: _folder, server: _server, mut page, data } = diagnosed(&browser, "lab-page", &hidden);
    let first = page.text("#lab .work .alone");
    press(&mut page, &first);
    press(&mut page, &first);
    bars(&mut page, 2, 0);
    press(&mut page, "Diagnose again with it");
    bars(&mut page, 2, 1);
    let second = page.text("#lab .work .alone");
    assert!(second.starts_with("Add ") && second != first, "{second}");
    press(&mut page, &second);
    press(&mut page, &second);
    bars(&mut page, 3, 0);
    press(&mut page, "Fit all values again");
    bars(&mut page, 4, 0);
    let shown = bar_values(&mut page);
    assert!(shown[3] <= 1.02 * shown[2], "a fit of all values leaves no more: {shown:?}");
    let table = page.value("document.querySelectorAll('#lab .work .values tr').length").as_u64();
    assert!(table >= Some(2), "the values of both effects: {table:?}");
    page.keep("fitted");
    // The same again from the beginning: the model that is there stays, and the bars are those of the base.
    page.value(
        "(select => { select.value = 'base.toml'; select.dispatchEvent(new Event('change')); })(\
         [...document.querySelectorAll('#lab select')].find(s => [...s.options].some(o => o.value === 'base.toml')))",
    );
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    bars(&mut page, 1, 2);
    press(&mut page, &first);
    press(&mut page, &first);
    bars(&mut page, 2, 0);
    let models =
        page.value("[...document.querySelectorAll('#lab option')].map(o => o.value).filter(v => v.endsWith('.toml'))");
    let effect = first.trim_start_matches("Add ");
    for name in [format!("base-{effect}.toml"), format!("base-{effect}-2.toml")] {
        assert!(models.as_array().is_some_and(|all| all.iter().any(|own| *own == name.as_str())), "{name}: {models}");
    }
    a_job_is_cancelled(&mut page, &data);
}

/// Cancel ends the job's process, the page says so, and the same job can be begun again.
fn a_job_is_cancelled(page: &mut BrowserPage, data: &str) {
    let at_work = || processes_with(&["lab", "diagnose", data]);
    press(page, "Diagnose again with it");
    assert!(wait_until(PATIENCE, || at_work() > 0), "its process");
    stop(&["lab", "diagnose", data]);
    nothing_changes_what_it_was_ordered_for(page);
    press(page, "Cancel");
    page.wait_for("it is said", "document.querySelector('#lab h1').textContent === 'Cancelled.'");
    assert_eq!(
        page.value("fetch('/lab/job').then(job => job.json()).then(job => job.stage)"),
        serde_json::json!("cancelled")
    );
    assert!(wait_until(PATIENCE, || at_work() == 0), "its process has ended");
    press(page, "Again");
    press(page, "Diagnose");
    bars(page, 2, 1);
    a_job_is_found_again_after_a_reload(page, data);
    assert!(wait_until(PATIENCE, || at_work() == 0), "its process has ended");
}

/// The lists are shut while a job is at work; what comes all the same, by a script or a file, is refused in a sentence.
fn nothing_changes_what_it_was_ordered_for(page: &mut BrowserPage) {
    let choices = "[...document.querySelectorAll('#lab .rail select')].map(own => [own.value, own.disabled])";
    let ordered = page.value(choices);
    let all = ordered.as_array().expect("lists");
    assert!(all.len() == 3 && all.iter().all(|own| own[1] == true), "{ordered}");
    choose(page, "Model", "base.toml");
    drop_file(page, "late.csv", "time_s\n0\n");
    page.wait_for("refused", "document.querySelector('#lab .work .waits').textContent.startsWith('This waits: ')");
    page.value("[...document.querySelectorAll('#lab .steps button')].at(0).click()");
    assert_eq!(page.value(choices), ordered, "what was chosen stays");
    let shelf = page.value("fetch('/lab').then(answer => answer.json())");
    assert!(!shelf["data"].to_string().contains("late.csv"), "{shelf}");
}

/// A page that was loaded anew shows the job that runs, also where the console does not answer for a moment, and can cancel it.
fn a_job_is_found_again_after_a_reload(page: &mut BrowserPage, data: &str) {
    let order = serde_json::json!({ "verb": "diagnose", "model": "base.toml", "data": "data.csv" }).to_string();
    let body = serde_json::json!(order);
    page.value(&format!("fetch('/lab/job', {{ method: 'POST', body: {body} }}).then(() => 0)"));
    assert!(wait_until(PATIENCE, || processes_with(&["lab", "diagnose", data]) > 0), "its process");
    stop(&["lab", "diagnose", data]);
    page.value("document.documentElement.id = 'before'; setTimeout(() => location.reload(), 0); 0");
    page.wait_for(
        "another page",
        "document.documentElement.id === '' && document.querySelectorAll('#stop').length === 1",
    );
    page.value("document.querySelector('[data-go=lab]').click()");
    page.wait_for("the job", "document.querySelector('#lab h1')?.textContent === 'krait lab diagnose is at work.'");
    page.value("window.fetched = window.fetch; window.fetch = () => Promise.reject(new TypeError('nobody')); 0");
    let is_silent = "document.querySelector('#lab .job-says').textContent.includes('does not answer')";
    page.wait_for("the console is silent", is_silent);
    page.value("window.fetch = window.fetched; 0");
    page.wait_for("it answers again", &format!("!{is_silent}"));
    press(page, "Cancel");
    page.wait_for("it is said", "document.querySelector('#lab h1').textContent === 'Cancelled.'");
    press(page, "Go on");
    page.wait_for("it asks", "document.querySelector('#lab h1').textContent.startsWith('How far is ')");
}

/// Stops processes, so that a job is at work for as long as the test looks, however fast the machine is.
fn stop(words: &[&str]) {
    for process in pids_with(words) {
        kill_process(process, Signal::STOP).expect("stopped");
    }
}

/// How many processes have all of these words on their command line.
fn processes_with(words: &[&str]) -> usize {
    pids_with(words).len()
}

fn pids_with(words: &[&str]) -> Vec<Pid> {
    let processes = std::fs::read_dir("/proc").expect("processes").flatten();
    let has_all = |process: &std::fs::DirEntry| {
        let line = std::fs::read_to_string(process.path().join("cmdline")).unwrap_or_default();
        words.iter().all(|word| line.split('\0').any(|own| own == *word))
    };
    let pids = processes.filter(has_all).filter_map(|process| process.file_name().to_str()?.parse().ok());
    pids.filter_map(Pid::from_raw).collect()
}

/// Beside each effect that was found stands what it alone adds over the position, as the answer has it: a line through all of its points,
/// within the picture, as high as the numbers below say.
fn the_sketches_are_the_answers(page: &mut BrowserPage, answer: &serde_json::Value) {
    let drawn = page.value(
        "[...document.querySelectorAll('#lab .effect .sketch')].map(sketch => ({
            points: sketch.querySelector('polyline').getAttribute('points').split(' ').map(point => point.split(',').map(Number)),
            box: sketch.querySelector('svg').getAttribute('viewBox').split(' ').map(Number),
            width: sketch.getBoundingClientRect().width, says: sketch.querySelector('figcaption').textContent,
        }))",
    );
    let drawn = drawn.as_array().expect("sketches");
    let effects = answer["effects"].as_array().expect("effects");
    assert!(effects.len() == 2 && drawn.len() == 2, "{drawn:?}");
    for (sketch, effect) in drawn.iter().zip(effects) {
        let numbers = |key: &str| -> Vec<f64> {
            let values = effect["sketch"][key].as_array().expect("values");
            values.iter().map(|own| own.as_f64().expect("a number")).collect()
        };
        let (position, change) = (numbers("position"), numbers("change"));
        let ends =
            |values: &[f64]| values.iter().fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
        let (low, high) = ends(&change);
        let says = sketch["says"].as_str().expect("a sentence");
        assert!(says.starts_with(&format!("It alone adds {low:.2} to {high:.2}\u{b0} ")), "{says}: {low} to {high}");
        let points = sketch["points"].as_array().expect("points");
        assert!(
            points.len() == position.len() && points.len() > 20 && sketch["width"].as_f64() > Some(100.0),
            "{sketch}"
        );
        let places =
            |axis: usize| -> Vec<f64> { points.iter().map(|point| point[axis].as_f64().expect("a place")).collect() };
        for axis in 0..2 {
            let most = sketch["box"][axis + 2].as_f64().expect("a size");
            assert!(places(axis).iter().all(|place| (0.0..=most).contains(place)), "{axis}: {sketch}");
        }
        // The highest of the values is drawn highest, the rightmost position rightmost.
        let at_most =
            |values: &[f64]| (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).expect("values");
        let (x, y) = (places(0), places(1));
        assert!(y.iter().all(|own| *own >= y[at_most(&change)] - 0.11), "{sketch}");
        assert!(x.iter().all(|own| *own <= x[at_most(&position)] + 0.11), "{sketch}");
        assert!(high - low > 0.01, "an effect that does something");
    }
}

/// Two effects and something that the lab has no name for: what was found is added at once, in the order of the chain, and fitted together;
/// the rail shows the file that was written, and the page what is explained and what a fit without a model leaves.
#[test]
fn one_button_adds_all_that_was_found_and_the_rail_shows_what_was_written() {
    let Some(browser) = Browser::start() else { return };
    let hidden = ["--kind", "backlash+plane-offset+x_product", "--size", "6,6,2", "--seconds", "40", "--rate", "15"];
    let Diagnosed { folder, data, server: _server, mut page } = diagnosed(&browser, "add-all", &hidden);
    let stages = page.value("[...stages].filter(said => said)");
    let is_stage = |own: &serde_json::Value| own.as_str().is_some_and(|said| said.starts_with("Effects "));
    assert!(stages.as_array().is_some_and(|all| all.len() > 1 && all.iter().any(is_stage)), "its stages: {stages}");
    let answer = page.value("fetch('/lab/job').then(job => job.json())")["answer"].clone();
    the_sketches_are_the_answers(&mut page, &answer);
    let (share, free) = (answer["explained_share"].as_f64(), answer["model_free_rms"].as_f64());
    let (share, free) = share.zip(free).unwrap_or_else(|| panic!("both figures in {answer}"));
    let tiles =
        page.value("[...document.querySelectorAll('#lab .work .explained > div')].map(tile => tile.textContent)");
    for tile in [
        format!("explained{:.0} %of what there is", 100.0 * share),
        format!("a fit without a model{free:.2}°leaves this"),
    ] {
        assert!(
            tiles.as_array().expect("tiles").iter().any(|own| own.as_str().is_some_and(|own| own.starts_with(&tile))),
            "{tile}: {tiles}"
        );
    }
    page.keep_right_everywhere("found-all", Scrolls::Within);
    press(&mut page, "Add both and fit them together");
    bars(&mut page, 3, 0);
    page.wait_for(
        "it is told",
        "/^With .* and .*, fitted together, the error is /.test(document.querySelector('#lab h1').textContent)",
    );
    page.keep_right_everywhere("added-all", Scrolls::Within);
    let effects: Vec<&str> = answer["chain_order"]
        .as_array()
        .expect("an order")
        .iter()
        .filter_map(|place| answer["effects"][place.as_u64()? as usize]["effect"].as_str())
        .collect();
    let model = page.value("document.querySelector('#lab select[aria-label=Model]').value");
    let name = format!("base-{}.toml", effects.join("-"));
    assert_eq!(model, serde_json::json!(name), "the rail shows what was written");
    assert!(page.text("#lab .steps li:nth-child(3)").contains(&name), "and so does its step");
    let written = std::fs::read_to_string(folder.file(&name)).expect("the model that the rail shows");
    let places: Vec<_> =
        effects.iter().map(|own| written.find(&format!("kind = \"{own}\"")).expect("each effect")).collect();
    assert!(places.len() == 2 && places[0] < places[1], "in the order of the chain: {written}");
    let values = page.value("[...document.querySelectorAll('#lab .work .values th')].map(th => th.textContent)");
    let of_first = format!("{}.", effects[0]);
    let is_of_first = |own: &serde_json::Value| own.as_str().is_some_and(|own| own.starts_with(&of_first));
    assert!(values.as_array().is_some_and(|all| all.iter().any(is_of_first)), "both were fitted: {values}");
    let has_its_effect = |own: &serde_json::Value| own.as_str().is_some_and(|own| own.contains('.'));
    assert!(values.as_array().is_some_and(|all| all.iter().all(has_its_effect)), "each has its effect: {values}");
    let path = folder.file(&name);
    let own = Ended::of(&["lab", "compare", "--model", &path, "--data", &data, "--json"], PATIENCE).json();
    let (left, shown) = (own["error"]["rms"].as_f64().expect("a number"), bar_values(&mut page));
    assert!((shown[2] / left - 1.0).abs() < 0.1, "the last bar is of that model: {shown:?}, {left}");
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// A measurement with names of its own, dropped on the page: what nobody can guess is asked, what is wrong is refused with the
/// lab's own sentence, and what is kept goes on as the same measurement with the lab's names would.
#[test]
fn the_columns_of_a_dropped_csv_are_named_in_the_page_and_kept_beside_it() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("columns"), instance_name("columns"));
    let (made, lab) = (folder.file("made.csv"), folder.file("lab"));
    let generate = ["lab", "generate", "--kind", "backlash", "--size", "3", "--seconds", "40", "--rate", "25"];
    let ended = Ended::of(&[&generate[..], &["--seed", "5", "--out", &made]].concat(), PATIENCE);
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let text = renamed(&std::fs::read_to_string(&made).expect("data"));
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &lab]);
    let mut page = browser.page(&Console::of(&mut server).address, 1280, 800);
    page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=lab]').click()");
    page.wait_for("the lab", "document.querySelector('#lab .drop') !== null");
    drop_file(&mut page, "theirs (1).csv", &text);
    page.wait_for("the question", "document.querySelector('#lab h1').textContent === 'What are these columns?'");
    page.keep("columns-asked");
    let names = "[...document.querySelectorAll('#lab .columns tbody th')].map(th => th.textContent)";
    assert_eq!(
        page.value(names),
        serde_json::json!(["Zeit [ms]", "links [mm]", "rechts [mm]", "unten [mm]", "horizontal", "vertikal", "Datei"])
    );
    for (name, is) in [("Zeit [ms]", "time"), ("links [mm]", "q1"), ("rechts [mm]", "q2"), ("unten [mm]", "q3")] {
        choose(&mut page, &format!("What {name} is"), is);
    }
    press(&mut page, "Use these columns");
    page.wait_for(
        "the lab's sentence",
        "/theirs--1-.csv: no snake .* was recognised/.test(document.querySelector('#lab .complaint')?.textContent)",
    );
    let complaint = "document.querySelector('#lab .complaint')";
    assert!(page.text("#lab .complaint").starts_with("theirs--1-.csv"), "the name without its folders");
    assert_eq!(
        page.value(&format!("{complaint}.querySelector('.file').title")),
        serde_json::json!(format!("{lab}/theirs--1-.csv"))
    );
    assert!(
        !std::path::Path::new(&format!("{lab}/theirs--1-.map.toml")).exists(),
        "nothing is kept of what is refused"
    );
    for (name, is, unit) in [("horizontal", "bend_x", "deg"), ("vertikal", "bend_y", "deg")] {
        choose(&mut page, &format!("What {name} is"), is);
        choose(&mut page, &format!("Unit of {name}"), unit);
    }
    for theme in ["light", "dark"] {
        page.value(&format!(
            "if (document.documentElement.dataset.theme !== '{theme}') document.getElementById('theme').click()"
        ));
        page.keep(&format!("columns-{theme}"));
    }
    press(&mut page, "Use these columns");
    press(&mut page, "Compare");
    page.wait_for("the answer", "document.querySelector('#lab .work .tiles') !== null");
    page.keep("columns-compared");
    let shown = page.value("[...document.querySelectorAll('#lab .work .tiles b')].map(b => b.textContent)");
    let base = folder.file("base.toml");
    let own = Ended::of(&["lab", "compare", "--model", &base, "--data", &made, "--json"], PATIENCE).json();
    let (rms, rows) = (own["error"]["rms"].as_f64().expect("a number"), own["rows"].to_string());
    assert_eq!((&shown[0], &shown[3]), (&serde_json::json!(format!("{rms:.2}°")), &serde_json::json!(rows)));
    let shelf = page.value("fetch('/lab').then(answer => answer.json())");
    assert_eq!(shelf["models"], serde_json::json!(["base.toml", "theirs--1-.model.toml"]));
    assert_eq!(shelf["named"], serde_json::json!(["theirs--1-.csv"]));
    assert!(page.complaints.iter().all(|said| said.contains("WebSocket")), "{:?}", page.complaints);
}

/// An effect of one joint is added to that joint alone, with the column that its width depends on; what is said beside it stands there.
#[test]
fn an_effect_of_one_joint_is_added_to_it_with_the_column_that_it_depends_on() {
    let Some(browser) = Browser::start() else { return };
    let (folder, instance) = (TempFolder::new("beside"), instance_name("beside"));
    let joints = "format = 1\n[machine]\nkind = \"joints\"\nn = 2\nu_unit = \"deg\"\ny_unit = \"deg\"\n";
    std::fs::write(folder.file("wrist.toml"), joints).expect("written");
    std::fs::write(folder.file("wrist.csv"), wrist()).expect("written");
    let mut server = Krait::start(&["console", "--instance", &instance, "--lab", &folder.path().display().to_string()]);
    let console = Console::of(&mut server);
    let mut page = browser.page(&console.address, 1280, 800);
    page.wait_for("the page", "document.querySelectorAll('#stop').length === 1");
    page.value("document.querySelector('[data-go=lab]').click()");
    for file in ["wrist.toml", "wrist.csv"] {
        let select = format!(
            "[...document.querySelectorAll('#lab select')].find(s => [...s.options].some(o => o.value === '{file}'))"
        );
        page.wait_for(file, &format!("{select} !== undefined"));
        page.value(&format!("{select}.value = '{file}'; {select}.dispatchEvent(new Event('change')); 0"));
    }
    press(&mut page, "Compare");
    press(&mut page, "Diagnose");
    page.wait_for("the answer", "document.querySelector('#lab .work .aside') !== null");
    page.keep("beside");
    let beside = page.text("#lab .work .aside");
    assert!(beside.contains("half_width of backlash depends on the column sheath_deg"), "{beside}");
    let title = page.text("#lab .work .effect h3");
    assert!(title.starts_with("backlash: play: ") && title.ends_with(" in all (joint 2)"), "its size: {title}");
    press(&mut page, "Add backlash");
    press(&mut page, "Add backlash");
    bars(&mut page, 2, 0);
    let shown = bar_values(&mut page);
    let (model, data) = (folder.file("wrist-backlash.toml"), folder.file("wrist.csv"));
    let own = Ended::of(&["lab", "compare", "--model", &model, "--data", &data, "--json"], PATIENCE).json();
    let left = own["error"]["rms"].as_f64().expect("a number");
    assert!((shown[1] / left - 1.0).abs() < 0.1, "the bar is of both joints, as the comparison is: {shown:?}, {left}");
    press(&mut page, "Diagnose again with it");
    let written = std::fs::read_to_string(folder.file("wrist-backlash.toml")).expect("a model");
    for line in ["joint = 2.0", "by = { parameter = \"half_width\", column = \"sheath_deg\""] {
        assert_eq!(written.matches(line).count(), 1, "{written}");
    }
    page.wait_for("its answer", "document.querySelector('#lab h1').textContent === 'Nothing is missing.'");
    an_open_set_is_taken_to_the_last_bar(&mut page, &folder);
    the_report_opens_as_a_sandboxed_document_and_draws(&browser, &console, "add");
}

/// A jaw of a da Vinci instrument, measured by others: dropped, named, compared, diagnosed, and what is missing added. What the page says is
/// what the commands say.
fn an_open_set_is_taken_to_the_last_bar(page: &mut BrowserPage, folder: &TempFolder) {
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../lab/tests/data/davinci-jaw/00.csv");
    drop_file(page, "jaw.csv", &std::fs::read_to_string(shipped).expect("shipped"));
    page.wait_for("the proposal", "document.querySelector('#lab h1').textContent === 'Is this what the columns are?'");
    press(page, "Use these columns");
    press(page, "Compare");
    page.wait_for("the answer", "document.querySelector('#lab .work .tiles') !== null");
    let [model, data, map, out] =
        ["jaw.model.toml", "jaw.csv", "jaw.map.toml", "by-command.toml"].map(|name| folder.file(name));
    let lab = |words: &[&str]| {
        let files = ["--model", &model, "--data", &data, "--map-file", &map, "--json"];
        Ended::of(&[&["lab"][..], words, &files].concat(), PATIENCE).json()
    };
    let compared = lab(&["compare"]);
    let (rms, rows) = (compared["error"]["rms"].as_f64().expect("a number"), compared["rows"].to_string());
    let shown = page.value("[...document.querySelectorAll('#lab .work .tiles b')].map(b => b.textContent)");
    assert_eq!((&shown[0], &shown[3]), (&serde_json::json!(format!("{rms:.2}°")), &serde_json::json!(rows)));
    press(page, "Diagnose");
    page.wait_for("what is missing", "document.querySelector('#lab .work .alone') !== null");
    let add = page.text("#lab .work .alone");
    let job = page.value("fetch('/lab/job').then(job => job.json())");
    let (effect, joint) = (add.trim_start_matches("Add "), job["answer"]["effects"][0]["joint"].to_string());
    press(page, &add);
    press(page, &add);
    bars(page, 2, 0);
    page.keep("open-set");
    let added = lab(&["add", effect, "--set", &format!("joint={joint}"), "--out", &out]);
    let texts = page.value("[...document.querySelectorAll('#lab .fall text.value')].map(text => text.textContent)");
    let after = added["heldout_rms"]["after"].as_f64().expect("a number");
    assert_eq!(texts, serde_json::json!([format!("{rms:.2}°"), format!("{after:.2}°")]), "both bars");
    let floor = added["noise_floor"].as_f64().zip(added["noise_floor_relative_se"].as_f64());
    let is_noise = floor.is_some_and(|(floor, se)| after <= (1.04 + 2.0 * se) * floor);
    let said = page.text("#lab .work");
    assert_eq!(said.contains("own noise"), is_noise, "{after} {floor:?}: {said}");
    assert_eq!(said.contains("Something is left"), !is_noise, "{said}");
}

/// The pictures that a job has written open under a policy that lets them reach nothing of the console, and are drawn all the same.
fn the_report_opens_as_a_sandboxed_document_and_draws(browser: &Browser, console: &Console, verb: &str) {
    let mut report = browser.page(&format!("{}/lab/report/{verb}", console.origin()), 1280, 800);
    report.wait_for("a picture is drawn", "document.querySelector('.js-plotly-plot .main-svg .trace path') !== null");
    assert_eq!(report.value("window.origin"), serde_json::json!("null"), "an origin of its own");
    let reached = report.value("fetch('/lab/job').then(() => 'reached', () => 'refused')");
    assert_eq!(reached, serde_json::json!("refused"), "it reaches nothing of the console");
    report.keep("report");
}

/// Two joints that follow their commands, the second with a play that grows with the angle of its sheath; made noise, not random.
fn wrist() -> String {
    let mut text = "time_s,u1_deg,u2_deg,y1_deg,y2_deg,sheath_deg\n".to_owned();
    let mut p = 0.0_f64;
    for k in 0..3000 {
        let t = f64::from(k) / 50.0;
        let (u1, u2) = (15.0 * (0.9 * t).sin(), 20.0 * (0.7 * t).sin() + 9.0 * (1.9 * t + 0.4).sin());
        let sheath = 45.0 + 45.0 * (0.11 * t + 1.0).sin();
        let play = 0.4 + 0.01 * sheath;
        p = p.clamp(u2 - play, u2 + play);
        let noise = |n: f64| 0.1 * ((f64::from(k) * n).sin() * 43_758.545_3).fract();
        text += &format!("{t},{u1},{u2},{},{},{sheath}\n", 1.1 * u1 + noise(12.9898), 0.9 * p + 2.0 + noise(78.233));
    }
    text
}

/// What no machine is recognised in is refused with the exit code of every refusal, its columns beside the sentence.
#[test]
fn a_table_without_a_machine_is_refused_with_its_columns() {
    let folder = TempFolder::new("refused");
    let data = folder.file("weather.csv");
    let rows: String = (0..200).map(|k| format!("{k},{},{}\n", k % 7, k % 11)).collect();
    std::fs::write(&data, format!("day,rain,wind\n{rows}")).expect("written");
    let ended = Ended::of(&["lab", "init", &data, "--json"], PATIENCE);
    let answer = ended.json();
    assert!(answer["refused"].as_str().is_some_and(|why| why.contains("weather.csv")), "{answer}");
    assert_eq!(answer["columns"].as_array().map(Vec::len), Some(3), "{answer}");
    assert_eq!(ended.code, Some(2), "{answer}");
}

/// The same rows with another program's names and units.
fn renamed(text: &str) -> String {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,q1_m,q2_m,q3_m,bend_x_rad,bend_y_rad"));
    let mut out = "Zeit [ms];links [mm];rechts [mm];unten [mm];horizontal;vertikal;Datei\n".to_owned();
    for line in lines {
        let values: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        for (k, value) in values.iter().enumerate() {
            out += &format!("{};", if k < 4 { value * 1000.0 } else { value.to_degrees() });
        }
        out += "7\n";
    }
    out
}

/// Drops a file on the lab.
fn drop_file(page: &mut BrowserPage, name: &str, text: &str) {
    page.value(&format!(
        "(files => {{ files.items.add(new File([{}], {})); \
         document.getElementById('lab').dispatchEvent(new DragEvent('drop', {{ dataTransfer: files, bubbles: true }})); }})(new DataTransfer())",
        serde_json::json!(text),
        serde_json::json!(name)
    ));
}
