//! Semi-implicit Euler and its stable step.

use crate::BodyError;
use crate::eigenvalue::largest_eigenvalue;
use crate::error::{check, check_positive};
use crate::network::NetworkState;
use glam::DMat3;

/// Semi-implicit (symplectic) Euler: v ← v + h M⁻¹F(x, v), then x ← x + h v, with n equal substeps h in each
/// tick.
///
/// # Stability
///
/// For M ẍ + B ẋ + K x = 0 the step is stable if 4M − 2hB − h²K is positive definite, hence if 2h β + h² κ < 4 with
/// the largest eigenvalues β of M⁻¹B and κ of M⁻¹K. In a network both are bounded, node by node, by twice the largest
/// eigenvalue of Σ_e k_e u uᵀ / m_i over the links of node i (because (a − b)² ≤ 2a² + 2b²), including the geometric
/// stiffness of stretched links. The bounds are computed at the beginning of a model step; `stability_margin` allows
/// for changes during the step.
///
/// Volume barriers add their own bound, over those that act now or may act within the tick, each with its maximum
/// stiffness there. If barriers need more than `max_substeps`, the step takes `max_substeps`; the force of a barrier
/// is bounded.
///
/// # Energy
///
/// For a mode with damping 2ζω, a step adds an energy of about h²ω²(v² − ω²x²)/2, and the damper dissipates 2hζω v².
/// If every damper has b ≥ k h, a free body never gains energy. With weaker dampers the energy fluctuates within a
/// period, without drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SemiImplicitEuler {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Minimum number of substeps per tick.
    pub min_substeps: usize,
    /// Maximum number of substeps per tick; a step that needs more is rejected.
    pub max_substeps: usize,
    /// Fraction of the stable step that is used, above 0 and at most 1.
    pub stability_margin: f64,
}

impl Default for SemiImplicitEuler {
    /// Ticks of 1 ms, 4 to 1000 substeps, 0.9 of the stable step.
    fn default() -> Self {
        Self { tick_s: 1e-3, min_substeps: 4, max_substeps: 1000, stability_margin: 0.9 }
    }
}

impl SemiImplicitEuler {
    /// Maximum stable substep in a state, s.
    pub(crate) fn stable_step_at(state: NetworkState<'_>) -> f64 {
        Rates::of_springs(state).stable_step_s(barrier_rate(state, 0.0))
    }

    /// Bounds in a state. Elements that need more than `max_substeps` there, but not at rest, need `max_substeps`: their forces are bounded.
    pub(crate) fn rates(&self, state: NetworkState<'_>) -> Rates {
        let rates = Rates::of_springs(state);
        let NetworkState { network, .. } = state;
        let fits = |rates: Rates| self.needed(rates, 0.0) <= self.max_substeps as f64;
        if !network.has_elements() || fits(rates) {
            return rates;
        }
        let at_rest = Rates::of_springs(NetworkState { x: network.rest_m(), ..state });
        if !fits(at_rest) {
            return rates;
        }
        let shortest_s = self.tick_s / (self.stability_margin * (self.max_substeps as f64 - 0.5));
        Rates { beta: 0.0, kappa: 4.0 / (shortest_s * shortest_s) }
    }

    /// Number of substeps per tick in a state.
    pub(crate) fn substeps_at(&self, state: NetworkState<'_>) -> Result<usize, BodyError> {
        let rates = self.rates(state);
        let springs = self.spring_substeps(rates)?;
        Ok(self.barrier_substeps(rates, barrier_rate(state, self.tick_s)).max(springs))
    }

    /// Number of substeps per tick without volume barriers.
    pub(crate) fn spring_substeps(&self, rates: Rates) -> Result<usize, BodyError> {
        check_positive("tick, s", self.tick_s)?;
        let margin = self.stability_margin;
        check("stability margin", margin, margin > 0.0 && margin <= 1.0, "above 0 and at most 1")?;
        let (min, max) = (self.min_substeps, self.max_substeps);
        check(
            "least substeps in a tick",
            min as f64,
            (1..=max).contains(&min),
            "at least 1 and at most the most",
        )?;
        let needed = self.needed(rates, 0.0);
        if needed.is_nan() || needed > max as f64 {
            return Err(BodyError::Substeps { needed, allowed: max });
        }
        Ok(min.max(needed as usize))
    }

    /// Number of substeps per tick with volume barriers; at most `max_substeps`.
    pub(crate) fn barrier_substeps(&self, rates: Rates, barriers_per_s2: f64) -> usize {
        let needed = self.needed(rates, barriers_per_s2);
        if needed < self.max_substeps as f64 { needed as usize } else { self.max_substeps }
    }

    fn needed(&self, rates: Rates, barriers_per_s2: f64) -> f64 {
        (self.tick_s / (self.stability_margin * rates.stable_step_s(barriers_per_s2))).ceil()
    }
}

/// Bound over all volume barriers that act now or may act within `ahead_s`, 1/s².
fn barrier_rate(state: NetworkState<'_>, ahead_s: f64) -> f64 {
    let NetworkState { network, x, v, .. } = state;
    crate::cells::rate_bound(network.barriers().all_tetrahedra(), network, (x, v), ahead_s)
}

/// Upper bounds of the largest eigenvalues of springs, dampers and elements over the free nodes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rates {
    /// Bound for M⁻¹B, 1/s.
    beta: f64,
    /// Bound for M⁻¹K, 1/s².
    kappa: f64,
}

impl Rates {
    /// Bounds in a state.
    pub(crate) fn of_springs(state: NetworkState<'_>) -> Self {
        let NetworkState { network, x, .. } = state;
        let (mut beta, mut kappa) = (0.0_f64, 0.0_f64);
        let of_elements = network.element_bounds(x);
        for &node in network.free() {
            let (mut k, mut b) = (DMat3::ZERO, DMat3::ZERO);
            for &link in network.incident_links(node) {
                let link = &network.links()[link];
                let tangent = link.spring.tangent(x[link.b] - x[link.a], true);
                k += tangent.stiffness;
                b += tangent.damping;
            }
            let (of_k, of_b) = of_elements.get(node).copied().unwrap_or_default();
            let per_kg = 1.0 / network.mass_kg()[node];
            let drag = network.drag_ns_per_m().get(node).copied().unwrap_or_default();
            beta = beta.max(per_kg * (2.0 * largest_eigenvalue(&b) + of_b + drag));
            kappa = kappa.max(per_kg * (2.0 * largest_eigenvalue(&k) + of_k));
        }
        Self { beta, kappa }
    }

    /// Maximum stable substep, s, with volume barriers whose largest eigenvalue of M⁻¹K is at most `barriers_per_s2`.
    fn stable_step_s(self, barriers_per_s2: f64) -> f64 {
        let (beta, kappa) = (self.beta, self.kappa + barriers_per_s2);
        if kappa == 0.0 {
            return if beta == 0.0 { f64::INFINITY } else { 2.0 / beta };
        }
        ((beta * beta + 4.0 * kappa).sqrt() - beta) / kappa
    }
}
