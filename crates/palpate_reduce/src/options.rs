//! Options of local models.

use crate::ReduceError;
use palpate_body::Body;

/// Maximum reduced order for which a loop allocates buffers.
pub(crate) const MAX_ORDER: usize = 4096;
/// Maximum number of nodes of a support set.
const MAX_SUPPORT_NODES: usize = 96;
/// Columns of the basis for each node of a support set of more than [`BuilderOptions::support_nodes`] nodes.
const ORDER_PER_NODE: usize = 3;

/// How the loop integrates the ticks of a near field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LocalIntegrator {
    /// Explicit with the body's substeps where a tick takes at most four, linearly implicit with two substeps otherwise.
    #[default]
    Auto,
    /// Semi-implicit Euler with the body's substeps; linearly implicit where that takes more than 64 substeps a tick.
    Explicit,
    /// Linearly implicit Euler.
    Implicit {
        /// Substeps in a tick, 1 to 64.
        substeps: u32,
    },
}

/// Options of a [`LocalModelBuilder`](crate::LocalModelBuilder).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuilderOptions {
    /// Length of a tick of the loop, s.
    pub tick_s: f64,
    /// Rings of nodes around the tool that move in [`Scheme::Neighbourhood`](palpate_local::Scheme::Neighbourhood), 1 to 8.
    pub rings: usize,
    /// σ₀, 1/s: K is regularised by σ₀² M. A network with null directions requires it, for example a plane lattice in space.
    pub regularisation_per_s: f64,
    /// Real frequencies at which the bases of `KrylovLinear` and `NearFieldExact` match the response of the body, Hz.
    pub shifts_hz: [Option<f64>; 4],
    /// Relative length below which the independent part of a new basis column is dropped, above 0 and below 1.
    pub basis_tolerance: f64,
    /// Maximum number of basis columns, 1 to 4096.
    pub order_limit: usize,
    /// Maximum number of nodes of the support set of `NearFieldExact`, 3 to 96.
    pub support_nodes: usize,
    /// Capacity for nodes of the support set where the tool touches more than [`Self::support_nodes`], up to 96; a smaller number than
    /// that has no effect. The basis then has up to three columns for each node, if that is more than [`Self::order_limit`].
    pub max_support_nodes: usize,
    /// Horizon of a local model, s: the support set contains what the tool can reach within it. 0.001 to 10.
    pub horizon_s: f64,
    /// Integrator of the ticks of `NearFieldExact`.
    pub integrator: LocalIntegrator,
}

impl Default for BuilderOptions {
    /// Ticks of 1 ms, one ring, σ₀ of 2π · 0.01 s⁻¹, one shift at 20 Hz, tolerance 1e-9, order 48, 9 support nodes, a horizon of 0.1 s, and
    /// the integrator selected by its cost.
    fn default() -> Self {
        Self {
            tick_s: 1e-3,
            rings: 1,
            regularisation_per_s: 0.01 * std::f64::consts::TAU,
            shifts_hz: [Some(20.0), None, None, None],
            basis_tolerance: 1e-9,
            order_limit: 48,
            support_nodes: 9,
            max_support_nodes: 9,
            horizon_s: 0.1,
            integrator: LocalIntegrator::Auto,
        }
    }
}

impl BuilderOptions {
    /// Speed that a tool at rest may reach within the horizon, m/s. The support set has what it then reaches.
    pub const REACH_SPEED_M_PER_S: f64 = 0.2;

    /// The defaults for `body`. If cells carry its surface, a surface point has eight nodes: the support set then has up to 27
    /// nodes, those of eight cells, or 64 under a large tool, and the basis up to 96 columns, or 192.
    #[must_use]
    pub fn of(body: &Body) -> Self {
        let is_embedded = body.surface().points.iter().any(|point| point.nodes().len() > 1);
        if is_embedded {
            Self { support_nodes: 27, max_support_nodes: 64, order_limit: 96, ..Self::default() }
        } else {
            Self::default()
        }
    }

    /// Maximum number of nodes of any support set.
    pub(crate) fn max_nodes(&self) -> usize {
        self.max_support_nodes.max(self.support_nodes)
    }

    /// Maximum number of basis columns for a support set of `nodes` nodes.
    pub(crate) fn order_for(&self, nodes: usize) -> usize {
        if nodes > self.support_nodes {
            self.order_limit.max(ORDER_PER_NODE * nodes)
        } else {
            self.order_limit
        }
    }

    /// Checks the ranges of all options.
    pub(crate) fn validate(&self) -> Result<(), ReduceError> {
        let Self {
            tick_s,
            rings,
            regularisation_per_s,
            basis_tolerance,
            order_limit,
            support_nodes,
            max_support_nodes,
            ..
        } = *self;
        let bad_shift = self.shifts_hz.into_iter().flatten().find(|hz| !(hz.is_finite() && *hz > 0.0));
        let substeps = match self.integrator {
            LocalIntegrator::Implicit { substeps } => substeps,
            LocalIntegrator::Auto | LocalIntegrator::Explicit => 1,
        };
        validate_horizon(self.horizon_s)?;
        for (what, value, ok, allowed) in [
            ("tick, s", tick_s, tick_s.is_finite() && tick_s > 0.0, "finite and above 0"),
            ("rings of nodes", rings as f64, (1..=8).contains(&rings), "1 to 8"),
            (
                "regularisation, 1/s",
                regularisation_per_s,
                regularisation_per_s.is_finite() && regularisation_per_s >= 0.0,
                "finite and at least 0",
            ),
            ("substeps of a tick", f64::from(substeps), (1..=64).contains(&substeps), "1 to 64"),
            ("shift, Hz", bad_shift.unwrap_or(1.0), bad_shift.is_none(), "finite and above 0"),
            (
                "tolerance of the basis",
                basis_tolerance,
                basis_tolerance > 0.0 && basis_tolerance < 1.0,
                "above 0 and below 1",
            ),
            ("order limit", order_limit as f64, (1..=MAX_ORDER).contains(&order_limit), "1 to 4096"),
            (
                "nodes of the support set",
                support_nodes as f64,
                (3..=MAX_SUPPORT_NODES).contains(&support_nodes),
                "3 to 96",
            ),
            (
                "nodes of the support set under a large tool",
                max_support_nodes as f64,
                max_support_nodes <= MAX_SUPPORT_NODES,
                "at most 96",
            ),
        ] {
            if !ok {
                return Err(ReduceError::Option { what, value, allowed });
            }
        }
        Ok(())
    }
}

/// Checks a horizon, s.
pub(crate) fn validate_horizon(horizon_s: f64) -> Result<(), ReduceError> {
    let (what, allowed) = ("horizon of a local model, s", "0.001 to 10");
    let ok = (1e-3..=10.0).contains(&horizon_s);
    if ok { Ok(()) } else { Err(ReduceError::Option { what, value: horizon_s, allowed }) }
}
