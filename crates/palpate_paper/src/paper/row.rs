//! A row of the page: a figure or a number of the paper with the result here.

use serde::Serialize;

/// Figure or number of the paper.
#[derive(Serialize)]
pub(crate) struct Row {
    /// Place in the paper.
    pub(crate) place: &'static str,
    /// Subject.
    pub(crate) what: &'static str,
    /// Value of the paper.
    pub(crate) paper: String,
    /// Result here.
    pub(crate) here: String,
    /// Reason for a difference, or a remark; may be empty.
    pub(crate) why: &'static str,
    /// Text of an SVG figure.
    #[serde(skip)]
    pub(crate) figure: Option<String>,
}

impl Row {
    /// Row without a remark and a figure.
    pub(super) fn new(
        place: &'static str,
        what: &'static str,
        paper: impl Into<String>,
        here: impl Into<String>,
    ) -> Self {
        Self { place, what, paper: paper.into(), here: here.into(), why: "", figure: None }
    }

    /// Adds a remark.
    pub(super) fn why(self, why: &'static str) -> Self {
        Self { why, ..self }
    }

    /// Adds a figure.
    pub(super) fn figure(self, svg: String) -> Self {
        Self { figure: Some(svg), ..self }
    }
}

/// Formats a share as a percentage with two decimals.
pub(super) fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}
