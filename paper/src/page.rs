//! The page: one self-contained XHTML document with every table and picture.

use crate::claims::{Claim, ClaimVerdict};
use crate::errors::PaperError;
use crate::{Paper, text};
use krait_report::Table;

/// The style of the page; no font or script is loaded from anywhere.
const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;color:#222;max-width:62rem;margin:2rem auto;padding:0 1rem}\
h1{font-size:1.6rem}h2{font-size:1.2rem;margin-top:2.2rem;border-bottom:1px solid #ddd}\
table{border-collapse:collapse;margin:.8rem 0;font-variant-numeric:tabular-nums}\
th,td{padding:.25rem .8rem;border-bottom:1px solid #e4e4e4;text-align:right;vertical-align:top}\
th:first-child,td:first-child{text-align:left}th{font-weight:600;color:#555}\
.words td,.words th{text-align:left}.words td:last-child{min-width:24rem}figure{margin:1.4rem 0}svg{max-width:100%;height:auto}\
figcaption,.note{color:#555;font-size:.92rem;max-width:48rem}\
.verdict{padding:.7rem 1rem;border-left:.4rem solid #009e73;background:#eef8f4}\
.verdict.fails{border-color:#d55e00;background:#fcf1ea}";

/// The page with the pictures in the order of the figures.
pub fn html(paper: &Paper, pictures: &[String]) -> String {
    let class = if paper.verdict.holds { "verdict" } else { "verdict fails" };
    let mut page = String::from("<h1>Actuation compensation for a snake-like robot, regenerated</h1>\n");
    page += &note(
        "K. Xu and N. Simaan, \"Actuation Compensation for Flexible Surgical Snake-like Robots with Redundant Remote \
         Actuation\", ICRA 2006, doi 10.1109/ROBOT.2006.1642340. The paper's raw data are not available, nor are the points of \
         its figures; of these we have the captions and the text: every curve here is ours, from the paper's equations and from a simulated bench whose plant shares no \
         code with the model that compensates it. Only what is called printed is the paper's.",
    );
    page += &format!("<p class=\"{class}\">{}</p>\n", escaped(&text::sentence(paper)));
    page += &section("What the paper claims", &claims(&paper.claims));
    for part in text::sections(paper) {
        let notes: String = part.notes.lines().map(note).collect();
        page += &section(&part.title, &(table(&part.table) + &notes));
    }
    page += "<h2>Figures</h2>\n";
    let captions = paper.figures.iter().map(|f| &f.caption).chain(paper.surfaces.iter().map(|s| &s.caption));
    for (caption, svg) in captions.zip(pictures) {
        page += &picture(svg, caption);
    }
    page += &section("Errors of the paper", &errors(&paper.errors));
    document("krait paper", &page)
}

/// A page of its own around a body.
pub fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html xmlns=\"http://www.w3.org/1999/xhtml\" lang=\"en\">\n<head><meta charset=\"utf-8\"/>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
         <title>{title}</title><style>{STYLE}</style></head>\n<body>\n{body}</body>\n</html>\n"
    )
}

/// A picture with what is said about it.
pub fn picture(svg: &str, caption: &str) -> String {
    format!("<figure>{svg}<figcaption>{}</figcaption></figure>\n", escaped(caption))
}

/// A heading with what stands under it.
pub fn section(title: &str, body: &str) -> String {
    format!("<h2>{}</h2>\n{body}", escaped(title))
}

/// A sentence in small print.
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{}</p>\n", escaped(text))
}

/// A table, its first row the header.
pub fn table(table: &Table) -> String {
    let mut html = String::from("<table>\n");
    for (k, row) in table.rows().iter().enumerate() {
        let tag = if k == 0 { "th" } else { "td" };
        let cells: String = row.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell))).collect();
        html += &format!("<tr>{cells}</tr>\n");
    }
    html + "</table>\n"
}

fn claims(claims: &[Claim]) -> String {
    let mut html = String::from(
        "<table class=\"words\">\n<tr><th>where</th><th>claim</th><th>as printed</th><th>corrected</th></tr>\n",
    );
    let verdict = |v: &ClaimVerdict| {
        let word = if v.holds { "holds" } else { "does not hold" };
        format!("<b>{word}</b>: {}", escaped(&v.found))
    };
    for c in claims {
        let [place, claim] = [c.place, c.claim].map(escaped);
        let [printed, corrected] = [&c.printed, &c.corrected].map(verdict);
        html += &format!("<tr><td>{place}</td><td>{claim}</td><td>{printed}</td><td>{corrected}</td></tr>\n");
    }
    html + "</table>\n"
}

fn errors(findings: &[PaperError]) -> String {
    let mut html = String::from(
        "<table class=\"words\">\n<tr><th>where</th><th>printed</th><th>correct</th><th>numbers</th></tr>\n",
    );
    for f in findings {
        let numbers: String = f
            .numbers
            .iter()
            .map(|n| format!("{}: <b>{}</b><br/>", escaped(n.what), escaped(&text::value(n))))
            .collect();
        let [place, printed, correct] = [f.place, f.printed, f.correct].map(escaped);
        html += &format!("<tr><td>{place}</td><td>{printed}</td><td>{correct}</td><td>{numbers}</td></tr>\n");
    }
    html + "</table>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
