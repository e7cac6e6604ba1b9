//! Time integrators.

mod columns;
mod linearly_implicit;
mod semi_implicit;
mod solved_by;

pub(crate) use columns::Columns;
pub(crate) use linearly_implicit::Workspace;
pub use linearly_implicit::{LinearSolver, LinearlyImplicitEuler};
pub(crate) use semi_implicit::Rates;
pub use semi_implicit::SemiImplicitEuler;
pub use solved_by::SolvedBy;

use crate::BodyError;
use crate::network::NetworkState;

/// An integrator with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Integrator {
    /// Explicit steps, as many as stability needs.
    SemiImplicitEuler(SemiImplicitEuler),
    /// Implicit steps, stable at any length.
    LinearlyImplicitEuler(LinearlyImplicitEuler),
}

impl Default for Integrator {
    fn default() -> Self {
        Self::SemiImplicitEuler(SemiImplicitEuler::default())
    }
}

impl From<SemiImplicitEuler> for Integrator {
    fn from(settings: SemiImplicitEuler) -> Self {
        Self::SemiImplicitEuler(settings)
    }
}

impl From<LinearlyImplicitEuler> for Integrator {
    fn from(settings: LinearlyImplicitEuler) -> Self {
        Self::LinearlyImplicitEuler(settings)
    }
}

impl<T: Copy + Into<Self>> From<&T> for Integrator {
    fn from(settings: &T) -> Self {
        (*settings).into()
    }
}

impl Integrator {
    /// Length of a tick, s.
    #[must_use]
    pub fn tick_s(&self) -> f64 {
        match self {
            Self::SemiImplicitEuler(settings) => settings.tick_s,
            Self::LinearlyImplicitEuler(settings) => settings.tick_s,
        }
    }

    /// Maximum number of ticks that a step spans.
    #[must_use]
    pub fn ticks_per_step(&self) -> usize {
        match self {
            Self::SemiImplicitEuler(_) => 1,
            Self::LinearlyImplicitEuler(settings) => settings.ticks_per_step,
        }
    }

    /// Bounds of the rates of springs and dampers; `None` for an unconditionally stable integrator.
    pub(crate) fn spring_rates(&self, state: NetworkState<'_>) -> Option<Rates> {
        match self {
            Self::SemiImplicitEuler(settings) => Some(settings.rates(state)),
            Self::LinearlyImplicitEuler(_) => None,
        }
    }

    /// Number of steps in each span of ticks for springs with the bounds `rates`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] for an invalid setting, [`BodyError::Substeps`] if the stable step is too short.
    pub(crate) fn steps(&self, rates: Option<Rates>) -> Result<usize, BodyError> {
        match self {
            Self::SemiImplicitEuler(settings) => settings.spring_substeps(rates.unwrap_or_default()),
            Self::LinearlyImplicitEuler(settings) => {
                settings.validate()?;
                Ok(settings.substeps)
            }
        }
    }

    /// [`Integrator::steps`] with volume barriers whose largest eigenvalue of M⁻¹K is at most `barriers_per_s2`.
    pub(crate) fn steps_with_barriers(
        &self,
        steps: usize,
        rates: Option<Rates>,
        barriers_per_s2: f64,
    ) -> usize {
        match (self, rates) {
            (Self::SemiImplicitEuler(settings), Some(rates)) if barriers_per_s2 > 0.0 => {
                settings.barrier_substeps(rates, barriers_per_s2).max(steps)
            }
            _ => steps,
        }
    }
}
