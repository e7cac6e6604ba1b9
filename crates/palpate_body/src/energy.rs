//! Energy of a body and its balance.

use glam::DVec3;

/// Energy of a body, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic energy of the nodes.
    pub kinetic_j: f64,
    /// Elastic energy of springs, elements and volume barriers.
    pub elastic_j: f64,
    /// Potential energy −Σ m g·(x − x_rest); zero at rest.
    pub gravitational_j: f64,
}

/// Energy balance of a body since [`crate::Body::start_energy_accounting`], J.
///
/// ```text
/// work in = stored + damping loss + friction loss + integrator
/// ```
///
/// Work, stored energy and damping losses are computed from forces and motions; the integrator's share is the
/// remainder. It vanishes with the step length.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyBalance {
    /// Work on the body by drives, loads and elastic threads. The energy stored in elastic threads is not the body's.
    pub work_in_j: f64,
    /// Change of the stored energy, including the series compliance of contacts.
    pub stored_j: f64,
    /// Energy dissipated by dampers; never negative.
    pub damping_loss_j: f64,
    /// Energy dissipated by friction and impacts.
    pub friction_loss_j: f64,
    /// Energy removed by the integrator; negative where it adds energy.
    pub integrator_j: f64,
}

impl Energy {
    /// Total energy, J.
    #[must_use]
    pub fn total_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }
}

/// Running sums of the energy balance.
#[derive(Clone, Debug)]
pub(crate) struct EnergyLedger {
    pub(crate) initial_j: f64,
    pub(crate) work_in_j: f64,
    pub(crate) damping_loss_j: f64,
    pub(crate) friction_loss_j: f64,
    /// Energy in the series compliance of contacts, after the first step and now.
    pub(crate) contact_j: Option<(f64, f64)>,
    /// Positions and velocities at the beginning of the step.
    pub(crate) x: Vec<DVec3>,
    pub(crate) v: Vec<DVec3>,
}
