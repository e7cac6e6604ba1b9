//! The stable step of a body.

use super::Body;
use crate::{BodyError, SemiImplicitEuler};

impl SemiImplicitEuler {
    /// The largest stable substep h at the state of `body`, s, by the bound above.
    #[must_use]
    pub fn stable_step_s(body: &Body) -> f64 {
        Self::stable_step_at(body.network_state())
    }

    /// Substeps in a tick at the state of `body`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] when a setting makes no sense, [`BodyError::Substeps`] when springs need more than
    /// `max_substeps`.
    pub fn substeps(&self, body: &Body) -> Result<usize, BodyError> {
        self.substeps_at(body.network_state())
    }
}
