//! Errors of local models, sample histories and their settings.

use thiserror::Error;

/// Error of a local model, a sample history or their settings.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LocalModelError {
    /// A part of the model has a number that is not finite.
    #[error("the local model's {what} is not finite")]
    NotFinite {
        /// Name of the part.
        what: &'static str,
    },
    /// The reduced order exceeds the capacity of the loop.
    #[error("the local model has order {order}; it must be at most {capacity}")]
    Order {
        /// Order of the model.
        order: usize,
        /// Order for which the buffers were allocated.
        capacity: usize,
    },
    /// A size of the near field exceeds the capacity of the loop.
    #[error("the local model has {found} {what}; it must have at most {capacity}")]
    Capacity {
        /// Name of the elements.
        what: &'static str,
        /// Number of elements in the model.
        found: usize,
        /// Number of elements for which the buffers were allocated.
        capacity: usize,
    },
    /// An index in the near field is out of range.
    #[error("{what} of the local model has an index that is out of range")]
    Index {
        /// Name of the element with the index.
        what: &'static str,
    },
    /// A part of the model is smaller than its order requires.
    #[error("the local model's {what} has {found} entries; order {order} requires at least {needed}")]
    Size {
        /// Name of the part.
        what: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of entries required.
        needed: usize,
        /// Order of the model.
        order: usize,
    },
    /// The second body of the model does not fit the first.
    #[error("the second body of the local model does not fit: {problem}")]
    SecondBody {
        /// What does not fit.
        problem: &'static str,
    },
    /// A pivot of the factor of the implicit step is not positive.
    #[error("pivot {index} of the local model's implicit step is {pivot}; it must be above 0")]
    Pivot {
        /// Index of the pivot.
        index: usize,
        /// Value of the pivot.
        pivot: f64,
    },
    /// The model was built at a sample after the newest one: it belongs to another run.
    #[error("the local model is of sample {model}, but the newest sample is {newest}")]
    FromTheFuture {
        /// Sequence number of the model's sample.
        model: u64,
        /// Sequence number of the newest sample.
        newest: u64,
    },
    /// Samples that must be replayed into the model are no longer in the history.
    #[error(
        "the local model is of sample {model} and the oldest sample kept is {oldest}; \
         build models faster or increase `HandOverSettings::history`"
    )]
    TooOld {
        /// Sequence number of the model's sample.
        model: u64,
        /// Sequence number of the oldest sample in the history.
        oldest: u64,
    },
    /// The model is not newer than the active one.
    #[error("the local model is of sample {model}; it must be newer than the active one, of sample {active}")]
    NotNewer {
        /// Sequence number of the model's sample.
        model: u64,
        /// Sequence number of the active model's sample.
        active: u64,
    },
    /// The model belongs to an earlier build of the body than the active one.
    #[error("the local model is of epoch {model} of its body; the active one is of epoch {active}")]
    OldEpoch {
        /// Epoch of the model.
        model: u64,
        /// Epoch of the active model.
        active: u64,
    },
    /// The model was built for a tick of another length.
    #[error("the local model has a tick of {found} s; it must be that of the loop, {needed} s")]
    Step {
        /// Tick of the model, s.
        found: f64,
        /// Tick of the loop, s.
        needed: f64,
    },
    /// The name is not that of a scheme.
    #[error(
        "there is no such scheme; it must be one of hold, low_pass, tangent, neighbourhood, krylov_linear, near_field_exact"
    )]
    UnknownScheme,
    /// A setting is outside its allowed range.
    #[error("{what} is {value}; it must be {allowed}")]
    Setting {
        /// Name of the setting with its unit.
        what: &'static str,
        /// Value of the setting.
        value: f64,
        /// Allowed range.
        allowed: &'static str,
    },
}
