//! The page around pictures and tables: head, style, the pictures' script, foot.

use super::html::{escape, table};
use super::{PageOrigin, Picture};
use crate::Measurements;
use crate::stage::stage;
use plotly::Plot;

/// How every page begins, by which it is known as one of krait's.
pub const BEGINS: &str =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta name=\"generator\" content=\"krait lab\">\n";

/// A page that grows section by section.
pub struct Page {
    text: String,
    foot: String,
    n_pictures: usize,
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222;\
background:#fff}h1{font-size:1.5rem}h2{font-size:1.2rem;margin-top:2.2rem;border-bottom:1px solid #ccc}\
table{border-collapse:collapse;margin:.8rem 0;font-variant-numeric:tabular-nums}\
th,td{text-align:left;padding:.2rem .7rem;border-bottom:1px solid #e3e3e3}\
.verdict{font-size:1.2rem;font-weight:600}.caution{color:#8a4b00}figure{margin:1rem 0}.picture{height:26rem}\
.turned th{writing-mode:vertical-rl;transform:rotate(180deg);font-weight:normal}\
.turned th:first-child{writing-mode:initial;transform:none}td{overflow-wrap:anywhere}\
footer{margin-top:3rem;color:#555;font-size:.85rem;overflow-wrap:anywhere}";

impl Page {
    /// A page without sections; the foot tells the data's name and hash where there are any.
    pub fn new(title: &str, origin: PageOrigin, data: &Measurements, seed: Option<u64>) -> Self {
        let mut rows = vec![
            vec!["command".to_owned(), origin.command.to_owned()],
            vec!["version".to_owned(), origin.version.to_owned()],
            vec!["data".to_owned(), data.source.clone()],
            vec!["SHA-256 of the data".to_owned(), data.sha256.clone()],
        ];
        rows.extend(seed.map(|seed| vec!["seed".to_owned(), seed.to_string()]));
        Self::with_foot(title, &rows)
    }

    /// A page with these rows at its foot.
    pub fn with_foot(title: &str, rows: &[Vec<String>]) -> Self {
        stage("Drawing the pictures");
        let title = escape(title);
        let text = format!(
            "{BEGINS}<meta charset=\"utf-8\">\n<title>{title}</title>\n\
             <style>{STYLE}</style>\n{}\n</head>\n<body>\n<h1>{title}</h1>\n",
            script()
        );
        Self { text, foot: table(&["origin", ""], rows), n_pictures: 0 }
    }

    /// Adds markup that is escaped already.
    pub fn push(&mut self, markup: String) {
        self.text += &markup;
    }

    /// Adds a heading and pictures.
    pub fn section(&mut self, heading: &str, pictures: Vec<Picture>) {
        self.text += &format!("<h2>{}</h2>\n", escape(heading));
        for picture in pictures {
            self.n_pictures += 1;
            self.text += &picture.markup(self.n_pictures);
        }
    }

    /// The whole page.
    pub fn finish(self) -> String {
        format!("{}<footer>\n{}</footer>\n</body>\n</html>\n", self.text, self.foot)
    }
}

/// The script that draws, without the one for formulas that follows it.
fn script() -> String {
    let both = Plot::offline_js_sources();
    let end = "</script>";
    both.find(end).and_then(|at| both.get(..at + end.len())).unwrap_or_default().to_owned()
}
