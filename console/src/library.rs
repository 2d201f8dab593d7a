//! Recordings and the lab over HTTP: lists, films, measurements that a page hands over, jobs. Only a page with the token.

mod dropped;
mod order;

use crate::columns;
use crate::doctor;
use crate::jobs::Jobs;
use crate::quiz::Riddles;
use crate::recordings::{Recordings, film_of};
use crate::server::{Shared, refuse};
use crate::whole_body::{LINES_S, MEASUREMENT_S, WholeBody};
use axum::Router;
use axum::extract::{DefaultBodyLimit, Path, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use order::Order;
use serde::Serialize;
use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;
use tokio::sync::Semaphore;

/// Bytes of a measurement that a page hands over.
const MOST_DATA_BYTES: usize = 64 * 1024 * 1024;
/// Bytes of a request for a job.
const MOST_ORDER_BYTES: usize = 16 * 1024;
/// The model that the lab begins with where the folder has none: the machine and nothing else.
const BASE_MODEL: &str = "base.toml";

/// The folder of the pictures of two recordings, in the lab's folder, and the names that these have.
const COMPARED: &str = "compared";
const COMPARED_PICTURES: [&str; 4] = ["tracking.svg", "bend.svg", "measured.svg", "latency.svg"];

/// What recordings and lab work with.
pub struct Library {
    recordings: Arc<Recordings>,
    folder: PathBuf,
    riddles: Riddles,
    base_model: String,
    instance: String,
    jobs: Jobs,
    // Reading a recording takes a core for a moment: one at a time.
    reader: Semaphore,
    program: PathBuf,
    doctors: Semaphore,
}

impl Library {
    /// Recordings, and the folder of measurements and models, which is made when it is needed first.
    pub fn new(
        recordings: Recordings,
        folder: PathBuf,
        base_model: String,
        program: PathBuf,
        instance: String,
    ) -> Self {
        let (recordings, riddles) = (Arc::new(recordings), Riddles::new(folder.clone()));
        let (jobs, reader, doctors) = (Jobs::new(program.clone()), Semaphore::new(1), Semaphore::new(1));
        Self { recordings, folder, riddles, base_model, instance, jobs, reader, program, doctors }
    }

    fn files(&self, ending: &str) -> Vec<String> {
        let Ok(files) = std::fs::read_dir(&self.folder) else { return Vec::new() };
        let names = files.flatten().filter_map(|entry| entry.file_name().into_string().ok());
        let mut names: Vec<String> = names.filter(|name| name.ends_with(ending)).collect();
        names.sort();
        names
    }

    fn models(&self) -> Vec<String> {
        let mut models = self.files(".toml");
        models.retain(|name| !name.ends_with(columns::MAP_ENDING));
        if !models.iter().any(|name| name == BASE_MODEL) {
            models.insert(0, BASE_MODEL.to_owned());
        }
        models
    }

    /// Models in which the word stands that makes an effect a formula; whether it can be offered the lab says.
    fn with_formulas(&self) -> Vec<String> {
        let has_one = |name: &String| {
            std::fs::read_to_string(self.folder.join(name)).is_ok_and(|text| text.contains("\"formula\""))
        };
        self.models().into_iter().filter(has_one).collect()
    }

    /// The option for the formulas of a model.
    fn effects(&self, name: Option<&str>) -> Result<Option<String>, String> {
        let Some(name) = name else { return Ok(None) };
        let is_listed = self.with_formulas().iter().any(|known| known == name);
        let path = is_listed
            .then(|| self.folder.join(name))
            .ok_or_else(|| format!("There is no model {name:?} with formulas in the list."))?;
        Ok(Some(format!("--effects={}", path.display())))
    }

    fn model(&self, name: &str) -> Result<PathBuf, String> {
        let path = self.folder.join(name);
        match self.models().iter().any(|known| known == name) {
            true if path.exists() => Ok(path),
            true => self.write(name, self.base_model.as_bytes()),
            false => Err(format!("There is no model {name:?} in the list.")),
        }
    }

    /// A measurement of the lab's own folder; one of krait's recordings has columns of known names.
    fn table(&self, name: &str) -> Result<PathBuf, String> {
        let is_listed = self.files(".csv").iter().any(|known| known == name);
        is_listed.then(|| self.folder.join(name)).ok_or_else(|| format!("There is no CSV {name:?} in the list."))
    }

    fn data(&self, name: &str) -> Result<PathBuf, String> {
        self.table(name)
            .ok()
            .or_else(|| self.recordings.path_of(name))
            .ok_or_else(|| format!("There is no measurement {name:?} in the list."))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, String> {
        let path = self.folder.join(name);
        let written = std::fs::create_dir_all(&self.folder).and_then(|()| std::fs::write(&path, bytes));
        written.map(|()| path).map_err(|error| unwritten(&self.folder, &error))
    }

    /// Where a new model goes; never over the model to begin with or a mapping.
    fn new_model(&self, name: &str) -> Result<PathBuf, String> {
        if !is_plain_name(name, ".toml") || name == BASE_MODEL || name.ends_with(columns::MAP_ENDING) {
            return Err(format!("{name:?} cannot be the new model's name; take letters and digits, ending in .toml."));
        }
        Ok(self.folder.join(name))
    }
}

/// What is said of a folder that takes no file.
fn unwritten(folder: &FilePath, error: &std::io::Error) -> String {
    format!("{} could not be written: {error}.", folder.display())
}

/// A name that a page may give to a file: no folder, nothing hidden, nothing that a shell or a page would read otherwise.
fn is_plain_name(name: &str, ending: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    name.len() <= 80
        && name.ends_with(ending)
        && name.len() > ending.len()
        && !name.starts_with(['.', '-'])
        && name.chars().all(allowed)
}

/// The routes; each asks for the token.
pub(crate) fn router(shared: &Arc<Shared>) -> Router<Arc<Shared>> {
    Router::new()
        .route("/recordings", get(recordings))
        .route("/recordings/{name}", get(film))
        .route("/lab", get(lab))
        .route("/lab/job", post(start).get(job).layer(DefaultBodyLimit::max(MOST_ORDER_BYTES)))
        .route("/lab/compared/{name}", get(compared))
        .route("/doctor", get(doctor))
        .route("/lab/cancel", post(cancel))
        .route("/lab/report/{verb}", get(report))
        .route("/lab/columns/{name}", post(keep_columns))
        .route("/lab/data/{name}", post(hand_over).layer(DefaultBodyLimit::max(MOST_DATA_BYTES)))
        .layer(from_fn_with_state(Arc::clone(shared), known_only))
}

async fn known_only(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    if shared.is_known(request.headers()) {
        next.run(request).await
    } else {
        refuse("this page has no token; open the address that the console printed")
    }
}

fn json<T: Serialize>(value: &T) -> Response {
    match serde_json::to_string(value) {
        Ok(text) => ([(header::CONTENT_TYPE, "application/json")], text).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
    }
}

/// Work on files, away from the thread that serves.
async fn reading<T: Send + 'static>(library: &Library, work: impl FnOnce() -> T + Send + 'static) -> Option<T> {
    let _turn = library.reader.acquire().await.ok()?;
    tokio::task::spawn_blocking(work).await.ok()
}

async fn recordings(State(shared): State<Arc<Shared>>) -> Response {
    let of = Arc::clone(&shared.library.recordings);
    match reading(&shared.library, move || of.list()).await {
        Some(list) => json(&list),
        None => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn film(State(shared): State<Arc<Shared>>, Path(name): Path<String>) -> Response {
    let Some(path) = shared.library.recordings.path_of(&name) else {
        return (StatusCode::NOT_FOUND, "there is no recording of this name in the list").into_response();
    };
    match reading(&shared.library, move || film_of(&path)).await {
        Some(Ok(film)) => json(&film),
        Some(Err(error)) => (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response(),
        None => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

#[derive(Serialize)]
struct Shelf {
    models: Vec<String>,
    data: Vec<String>,
    /// Models with formulas, which can be offered to a diagnosis.
    formulas: Vec<String>,
    /// Measurements whose columns somebody has named.
    named: Vec<String>,
    folder: String,
}

async fn lab(State(shared): State<Arc<Shared>>) -> Response {
    let library = &shared.library;
    let of = Arc::clone(&library.recordings);
    let Some(recordings) = reading(library, move || of.list()).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let mut data = library.files(".csv");
    let named = data.iter().filter(|name| columns::map_of(&library.folder.join(name)).is_some()).cloned().collect();
    data.extend(recordings.into_iter().map(|entry| entry.name));
    let (models, formulas) = (library.models(), library.with_formulas());
    json(&Shelf { models, data, formulas, named, folder: library.folder.display().to_string() })
}

async fn start(State(shared): State<Arc<Shared>>, WholeBody(body): WholeBody<LINES_S>) -> Response {
    let order: Order = match serde_json::from_slice(&body) {
        Ok(order) => order,
        Err(error) => {
            return (StatusCode::BAD_REQUEST, format!("This order is not understood: {error}.")).into_response();
        }
    };
    match order.arguments(&shared.library).and_then(|arguments| shared.library.jobs.start(&arguments)) {
        Ok(report) => json(&report),
        Err(why) => (StatusCode::CONFLICT, why).into_response(),
    }
}

async fn job(State(shared): State<Arc<Shared>>) -> Response {
    json(&shared.library.jobs.report())
}

async fn cancel(State(shared): State<Arc<Shared>>) -> Response {
    shared.library.jobs.cancel();
    json(&shared.library.jobs.report())
}

/// The page that a job has written: a sandboxed document, whose script can reach nothing of the console.
async fn report(State(shared): State<Arc<Shared>>, Path(verb): Path<String>) -> Response {
    if !["compare", "diagnose", "add", "fit", "look", "solve"].contains(&verb.as_str()) {
        return StatusCode::NOT_FOUND.into_response();
    }
    let path = shared.library.folder.join(format!("{verb}.html"));
    let page = reading(&shared.library, move || std::fs::read(FilePath::new(&path)).ok()).await;
    match page.flatten() {
        Some(page) => {
            let policy = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:";
            let headers =
                [(header::CONTENT_TYPE, "text/html; charset=utf-8"), (header::CONTENT_SECURITY_POLICY, policy)];
            (headers, page).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// A picture of the comparison of two recordings: a document that may do nothing.
async fn compared(State(shared): State<Arc<Shared>>, Path(name): Path<String>) -> Response {
    if !COMPARED_PICTURES.contains(&name.as_str()) {
        return StatusCode::NOT_FOUND.into_response();
    }
    let path = shared.library.folder.join(COMPARED).join(name);
    match reading(&shared.library, move || std::fs::read(path).ok()).await.flatten() {
        Some(picture) => {
            let policy = "sandbox; default-src 'none'; style-src 'unsafe-inline'";
            let headers = [(header::CONTENT_TYPE, "image/svg+xml"), (header::CONTENT_SECURITY_POLICY, policy)];
            (headers, picture).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// What this machine lacks for a punctual chain. No job: the lab's place stays free.
async fn doctor(State(shared): State<Arc<Shared>>) -> Response {
    let Ok(_turn) = shared.library.doctors.acquire().await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let program = shared.library.program.clone();
    match tokio::task::spawn_blocking(move || doctor::findings(&program)).await {
        Ok(Ok(findings)) => json(&findings),
        Ok(Err(why)) => (StatusCode::SERVICE_UNAVAILABLE, why).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn hand_over(
    State(shared): State<Arc<Shared>>,
    Path(name): Path<String>,
    WholeBody(body): WholeBody<MEASUREMENT_S>,
) -> Response {
    if !is_plain_name(&name, ".csv") {
        return (StatusCode::BAD_REQUEST, "A measurement's name has letters and digits only and ends in .csv.")
            .into_response();
    }
    let of = Arc::clone(&shared);
    match reading(&shared.library, move || dropped::take(&of.library.folder, &name, &body)).await {
        Some(Ok(taken)) => json(&taken),
        Some(Err(why)) => (StatusCode::INSUFFICIENT_STORAGE, why).into_response(),
        None => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn keep_columns(State(shared): State<Arc<Shared>>, Path(name): Path<String>) -> Response {
    let of = Arc::clone(&shared);
    match reading(&shared.library, move || columns::keep(&of.library.table(&name)?)).await {
        Some(Ok(kept)) => json(&kept),
        Some(Err(why)) => (StatusCode::CONFLICT, why).into_response(),
        None => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_file_in_this_folder_or_nothing() {
        for good in ["a.csv", "run-2_b.csv", "2026.11.csv"] {
            assert!(is_plain_name(good, ".csv"), "{good}");
        }
        for bad in
            ["../a.csv", "a/b.csv", ".csv", "-x.csv", ".hidden.csv", "a b.csv", "a.toml", "a\u{0}.csv", "a%2e.csv"]
        {
            assert!(!is_plain_name(bad, ".csv"), "{bad}");
        }
    }
}
