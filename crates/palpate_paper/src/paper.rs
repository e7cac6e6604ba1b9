//! All of the seed paper: one row for every figure and every number.

mod page;
mod sections_2_4;
mod sections_5_6;

use clap::Args;
use palpate_lab::error::LabError;
use palpate_lab::output::{Output, write_files};
use palpate_lab::progress;
use serde::Serialize;
use std::path::Path;

/// All of it: a page with every figure and number of the paper beside ours
///
/// Runs all experiments with the parameters of the paper (where it states none, with the defaults of each command) and
/// writes a page, index.html, with one row for every figure and every number of the paper: what it says, what comes out
/// here, and where they differ why. The page needs no other file; it is light or dark as its reader's system is.
///
/// It goes to target/palpate/paper unless `--out` names another folder.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  palpate-lab paper\n  palpate-lab paper --out report --json")]
pub(crate) struct Paper {}

/// A figure or a number of the paper.
#[derive(Serialize)]
pub(crate) struct Row {
    /// Where it stands in the paper.
    pub(crate) place: &'static str,
    pub(crate) what: &'static str,
    pub(crate) paper: String,
    pub(crate) here: String,
    /// Why they differ, or what is to be known about it; empty where there is nothing.
    pub(crate) why: &'static str,
    /// The text of an SVG.
    #[serde(skip)]
    pub(crate) figure: Option<String>,
}

#[derive(Serialize)]
struct Report {
    page: String,
    rows: Vec<Row>,
}

type Section = fn() -> Result<Vec<Row>, LabError>;

/// The sections of the paper that have figures or numbers.
const SECTIONS: [(&str, Section); 7] = [
    ("section 2", sections_2_4::demonstration),
    ("section 3", sections_2_4::linear_approximation),
    ("section 4", sections_2_4::order_reduction),
    ("section 5", sections_5_6::local_models),
    ("section 5.1", sections_5_6::one_dimension),
    ("section 5.2", sections_5_6::scaling),
    ("section 6", sections_5_6::implementation),
];

fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

impl Paper {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        let bar = progress::bar(SECTIONS.len());
        let mut rows = Vec::new();
        for (name, section) in SECTIONS {
            bar.set_message(name);
            rows.extend(section()?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        let folder = output.folder().unwrap_or(Path::new("target/palpate/paper"));
        write_files(folder, &[("index.html", page::html(&rows))])?;
        let report = Report { page: folder.join("index.html").display().to_string(), rows };
        output.print(&report, |out| {
            for Row { place, what, paper, here, .. } in &report.rows {
                writeln!(out, "{place}: {what}\n    paper: {paper}\n    here:  {here}")?;
            }
            writeln!(out, "\n{} rows, with figures and reasons in {}", report.rows.len(), report.page)
        })
    }
}

impl Row {
    fn new(
        place: &'static str,
        what: &'static str,
        paper: impl Into<String>,
        here: impl Into<String>,
    ) -> Self {
        Self { place, what, paper: paper.into(), here: here.into(), why: "", figure: None }
    }

    fn why(self, why: &'static str) -> Self {
        Self { why, ..self }
    }

    fn figure(self, svg: String) -> Self {
        Self { figure: Some(svg), ..self }
    }
}
