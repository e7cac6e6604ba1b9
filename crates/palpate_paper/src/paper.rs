//! All of the seed paper: a row for every figure and every number.

mod page;
mod row;
mod sections_2_4;
mod sections_5_6;

use clap::Args;
use palpate_lab::error::LabError;
use palpate_lab::output::{Output, write_files};
use palpate_lab::progress;
use row::Row;
use serde::Serialize;
use std::path::Path;

/// All of the paper: a page with every figure and number and the result here
///
/// Runs all experiments with the parameters of the paper, or with the defaults of each command where the paper states none. Writes a
/// page, index.html, with a row for every figure and every number of the paper: its value, the result here, and the reason for a
/// difference. The page is a single file and follows the light or dark setting of the reader's system.
///
/// The folder is target/palpate/paper unless `--out` names another.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:\n  palpate-lab paper\n  palpate-lab paper --out report --json")]
pub(crate) struct Paper {}

#[derive(Serialize)]
struct Report {
    page: String,
    rows: Vec<Row>,
}

type Section = fn() -> Result<Vec<Row>, LabError>;

/// Sections of the paper with figures or numbers.
const SECTIONS: [(&str, Section); 7] = [
    ("section 2", sections_2_4::demonstration),
    ("section 3", sections_2_4::linear_approximation),
    ("section 4", sections_2_4::order_reduction),
    ("section 5", sections_5_6::local_models),
    ("section 5.1", sections_5_6::one_dimension),
    ("section 5.2", sections_5_6::scaling),
    ("section 6", sections_5_6::implementation),
];

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
