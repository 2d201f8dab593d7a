//! The page's files, embedded: nothing is read from the disk or fetched from a network, and no path reaches a file system.

/// A file of the page.
#[derive(Debug)]
pub struct Asset {
    /// Where a browser asks for it.
    pub path: &'static str,
    /// Its media type.
    pub media_type: &'static str,
    /// What is in it.
    pub body: &'static [u8],
}

macro_rules! assets {
    ($($path:literal, $media_type:literal, $file:literal;)*) => {
        &[$(Asset { path: $path, media_type: $media_type, body: include_bytes!(concat!("../web/", $file)) }),*]
    };
}

/// Every file of the page's origin.
pub const PAGE: &[Asset] = assets! {
    "/", "text/html; charset=utf-8", "index.html";
    "/css/tokens.css", "text/css; charset=utf-8", "css/tokens.css";
    "/css/frame.css", "text/css; charset=utf-8", "css/frame.css";
    "/css/pages.css", "text/css; charset=utf-8", "css/pages.css";
    "/css/pad.css", "text/css; charset=utf-8", "css/pad.css";
    "/css/joints.css", "text/css; charset=utf-8", "css/joints.css";
    "/css/library.css", "text/css; charset=utf-8", "css/library.css";
    "/css/narrow.css", "text/css; charset=utf-8", "css/narrow.css";
    "/icon.svg", "image/svg+xml", "icon.svg";
    "/js/main.js", "text/javascript; charset=utf-8", "js/main.js";
    "/js/shell.js", "text/javascript; charset=utf-8", "js/shell.js";
    "/js/states.js", "text/javascript; charset=utf-8", "js/states.js";
    "/js/operate.js", "text/javascript; charset=utf-8", "js/operate.js";
    "/js/joints.js", "text/javascript; charset=utf-8", "js/joints.js";
    "/js/commands.js", "text/javascript; charset=utf-8", "js/commands.js";
    "/js/pad.js", "text/javascript; charset=utf-8", "js/pad.js";
    "/js/hand.js", "text/javascript; charset=utf-8", "js/hand.js";
    "/js/exchange.js", "text/javascript; charset=utf-8", "js/exchange.js";
    "/js/recordings.js", "text/javascript; charset=utf-8", "js/recordings.js";
    "/js/lab.js", "text/javascript; charset=utf-8", "js/lab.js";
    "/js/columns.js", "text/javascript; charset=utf-8", "js/columns.js";
    "/js/quiz.js", "text/javascript; charset=utf-8", "js/quiz.js";
    "/js/verdict.js", "text/javascript; charset=utf-8", "js/verdict.js";
    "/js/work.js", "text/javascript; charset=utf-8", "js/work.js";
    "/js/pictures.js", "text/javascript; charset=utf-8", "js/pictures.js";
    "/js/latency.js", "text/javascript; charset=utf-8", "js/latency.js";
    "/js/format.js", "text/javascript; charset=utf-8", "js/format.js";
    "/js/worker.js", "text/javascript; charset=utf-8", "js/worker.js";
    "/js/link.js", "text/javascript; charset=utf-8", "js/link.js";
    "/js/snake.js", "text/javascript; charset=utf-8", "js/snake.js";
    "/js/solids.js", "text/javascript; charset=utf-8", "js/solids.js";
    "/js/scene.js", "text/javascript; charset=utf-8", "js/scene.js";
    "/js/curve.js", "text/javascript; charset=utf-8", "js/curve.js";
};
