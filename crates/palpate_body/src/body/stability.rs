//! Stable step length of a body.

use super::Body;
use crate::{BodyError, SemiImplicitEuler};

impl SemiImplicitEuler {
    /// Maximum stable substep in the current state of `body`, s; see the bound in [`SemiImplicitEuler`].
    #[must_use]
    pub fn stable_step_s(body: &Body) -> f64 {
        Self::stable_step_at(body.network_state())
    }

    /// Number of substeps per tick in the current state of `body`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] for an invalid setting, [`BodyError::Substeps`] if springs need more than
    /// `max_substeps`.
    pub fn substeps(&self, body: &Body) -> Result<usize, BodyError> {
        self.substeps_at(body.network_state())
    }
}
