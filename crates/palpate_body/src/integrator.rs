//! How a body is stepped through time.

mod columns;
mod linearly_implicit;
mod semi_implicit;

pub(crate) use columns::Columns;
pub(crate) use linearly_implicit::Workspace;
pub use linearly_implicit::{LinearSolver, LinearlyImplicitEuler};
pub use semi_implicit::SemiImplicitEuler;

use crate::{Body, BodyError};

/// An integrator with its settings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Integrator {
    /// Cheap steps, as many as stability needs.
    SemiImplicitEuler(SemiImplicitEuler),
    /// Dear steps, stable whatever their length.
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

    /// Ticks that a step spans at most.
    #[must_use]
    pub fn ticks_per_step(&self) -> usize {
        match self {
            Self::SemiImplicitEuler(_) => 1,
            Self::LinearlyImplicitEuler(settings) => settings.ticks_per_step,
        }
    }

    /// Ticks that a step spans at most, and steps in each such span, at the state of `body`.
    ///
    /// # Errors
    /// [`BodyError::Parameter`] when a setting makes no sense, [`BodyError::Substeps`] when a stable step is too short.
    pub(crate) fn steps(&self, body: &Body) -> Result<(usize, usize), BodyError> {
        match self {
            Self::SemiImplicitEuler(settings) => Ok((1, settings.substeps(body)?)),
            Self::LinearlyImplicitEuler(_) => self.spring_steps(body),
        }
    }

    /// As [`Integrator::steps`], without volume barriers.
    ///
    /// # Errors
    /// As there.
    pub(crate) fn spring_steps(&self, body: &Body) -> Result<(usize, usize), BodyError> {
        match self {
            Self::SemiImplicitEuler(settings) => Ok((1, settings.spring_substeps(body)?)),
            Self::LinearlyImplicitEuler(settings) => {
                settings.validate()?;
                Ok((settings.ticks_per_step, settings.substeps))
            }
        }
    }
}

/// What solved for the steps of a model step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SolvedBy {
    /// Nothing had to be solved: semi-implicit Euler.
    #[default]
    Nothing,
    /// A sparse Cholesky factorisation at each step.
    Cholesky,
    /// Preconditioned conjugate gradients.
    ConjugateGradients {
        /// The most iterations that a step took.
        iterations: usize,
    },
}
