//! A body's energy, and where it comes from and goes.

use glam::DVec3;

/// The energy that a body holds, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of the motion of its nodes.
    pub kinetic_j: f64,
    /// Of its springs and of the volume barriers of its cells.
    pub elastic_j: f64,
    /// Of its height, zero at rest: −Σ m g·(x − x_rest).
    pub gravitational_j: f64,
}

/// What happened to a body's energy since [`Body::open_books`], J.
///
/// ```text
/// work in = stored + damped + rubbed + integrator
/// ```
///
/// Work, energy and what the dampers take are each computed from forces and motions; the integrator's share is what is
/// left. It vanishes with the length of the steps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyBalance {
    /// Done on the body by what drives it, by its loads and by threads that stretch: what they store is not the body's.
    pub work_in_j: f64,
    /// Energy now minus that when the books were opened, with what the compliance in series with contacts holds.
    pub stored_j: f64,
    /// Taken by the dampers; never negative.
    pub damping_loss_j: f64,
    /// Taken by friction and impacts.
    pub friction_loss_j: f64,
    /// Taken by the integrator; negative where it gives.
    pub integrator_j: f64,
}

impl Energy {
    /// The sum.
    #[must_use]
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }
}

/// The books in the making.
#[derive(Clone, Debug)]
pub(crate) struct EnergyLedger {
    pub(crate) initial_j: f64,
    pub(crate) work_in_j: f64,
    pub(crate) damping_loss_j: f64,
    pub(crate) friction_loss_j: f64,
    /// In the compliance in series with contacts, after the first step and now.
    pub(crate) contact_j: Option<(f64, f64)>,
    /// Positions and velocities at the beginning of the step.
    pub(crate) x: Vec<DVec3>,
    pub(crate) v: Vec<DVec3>,
}
