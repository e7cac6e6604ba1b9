//! A row of the page: a figure or a number of the paper with the result here.

use serde::Serialize;

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

impl Row {
    pub(super) fn new(
        place: &'static str,
        what: &'static str,
        paper: impl Into<String>,
        here: impl Into<String>,
    ) -> Self {
        Self { place, what, paper: paper.into(), here: here.into(), why: "", figure: None }
    }

    pub(super) fn why(self, why: &'static str) -> Self {
        Self { why, ..self }
    }

    pub(super) fn figure(self, svg: String) -> Self {
        Self { figure: Some(svg), ..self }
    }
}

/// A share as a percentage with two decimals.
pub(super) fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
