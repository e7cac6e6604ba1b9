//! Why a local model is not taken.

use thiserror::Error;

/// What is wrong with a local model, a sample history or their settings.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum LocalModelError {
    /// A number in the model is not finite. The model in use goes on speaking.
    #[error("the local model's {what} is not finite")]
    NotFinite {
        /// Which part.
        what: &'static str,
    },
    /// The reduced order is larger than the loop has room for.
    #[error("the local model has order {order}; there is room for {capacity}")]
    Order {
        /// The model's order.
        order: usize,
        /// The order for which buffers were made.
        capacity: usize,
    },
    /// A near field has more of something than the loop has room for.
    #[error("the local model has {found} {what}; there is room for {room}")]
    Room {
        /// Of what.
        what: &'static str,
        /// How many it has.
        found: usize,
        /// How many there is room for.
        room: usize,
    },
    /// A near field names a node that it does not have.
    #[error("{what} of the local model names a node that it does not have")]
    Index {
        /// What names it.
        what: &'static str,
    },
    /// A part of the model has not the size that its order asks for.
    #[error("the local model's {what} has {found} entries; order {order} needs at least {needed}")]
    Size {
        /// Which part.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries needed.
        needed: usize,
        /// The model's order.
        order: usize,
    },
    /// A factor of the implicit step has a pivot that is not positive.
    #[error("pivot {index} of the local model's implicit step is {pivot}; it must be above 0")]
    Pivot {
        /// Its index.
        index: usize,
        /// Its value.
        pivot: f64,
    },
    /// The model was built at a sample that lies after the newest one: it belongs to another run.
    #[error("the local model is of sample {model}, but the newest sample is {newest}")]
    FromTheFuture {
        /// Sample of the model.
        model: u64,
        /// The newest sample.
        newest: u64,
    },
    /// The samples since the model was built are no longer all there to be replayed.
    #[error(
        "the local model is of sample {model}; the oldest sample kept is {oldest}, so it cannot catch up"
    )]
    TooOld {
        /// Sample of the model.
        model: u64,
        /// The oldest sample that is kept.
        oldest: u64,
    },
    /// The model is not newer than the one that speaks.
    #[error("the local model is of sample {model}, no newer than the one in use, of sample {active}")]
    NotNewer {
        /// Sample of the model.
        model: u64,
        /// Sample of the model in use.
        active: u64,
    },
    /// The model is of an earlier build of the body than the one that speaks.
    #[error("the local model is of epoch {model} of its body, the one in use of epoch {active}")]
    OldEpoch {
        /// Epoch of the model.
        model: u64,
        /// Epoch of the model in use.
        active: u64,
    },
    /// The model's implicit step was made for another tick.
    #[error("the local model steps by {found} s; the loop ticks every {needed} s")]
    Step {
        /// The model's step, s.
        found: f64,
        /// The loop's tick, s.
        needed: f64,
    },
    /// No scheme has this name.
    #[error(
        "there is no such scheme; there are hold, low_pass, tangent, neighbourhood, krylov_linear, near_field_exact"
    )]
    UnknownScheme,
    /// A setting is outside what is allowed.
    #[error("{what} is {value}; it must be {allowed}")]
    Setting {
        /// The setting with its unit.
        what: &'static str,
        /// The value given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
}
