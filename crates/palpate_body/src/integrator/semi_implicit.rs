//! Semi-implicit Euler and the step at which it stays stable.

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
/// For M ẍ + B ẋ + K x = 0 the step is stable when 4M − 2hB − h²K is positive definite, so when
/// 2h β + h² κ < 4 with β, κ the largest eigenvalues of M⁻¹B and M⁻¹K. For a network both are bounded, node by
/// node, by twice the largest eigenvalue of Σ_e k_e u uᵀ / m_i over the links of node i (because
/// (a − b)² ≤ 2a² + 2b²), the stretched links' geometric stiffness included. The estimate uses these bounds at
/// the state at which a model step begins, so a `stability_margin` is kept for what happens during the step.
///
/// Volume barriers add a bound of their own, of those that act now or will within the tick, each with the greatest stiffness
/// that it can have there. Where barriers need more than `max_substeps`, the step takes that many; a barrier's force is
/// bounded.
///
/// # Energy
///
/// Of a mode with damping 2ζω a step adds about h²ω²(v² − ω²x²)/2 of energy and the damper takes 2hζω v², so where every
/// damper has b ≥ k h a body left alone never gains energy; where dampers are weaker it goes up and down a little within a
/// swing, and not in the long run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SemiImplicitEuler {
    /// Length of a tick, s.
    pub tick_s: f64,
    /// Substeps in a tick when stability needs no more.
    pub min_substeps: usize,
    /// Substeps in a tick never exceed this; a step that would need more is refused.
    pub max_substeps: usize,
    /// The share of the stable step that is used, above 0 and at most 1.
    pub stability_margin: f64,
}

impl Default for SemiImplicitEuler {
    /// 1 ms, 4 to 1000 substeps, 0.9 of the stable step.
    fn default() -> Self {
        Self { tick_s: 1e-3, min_substeps: 4, max_substeps: 1000, stability_margin: 0.9 }
    }
}

impl SemiImplicitEuler {
    /// The largest stable substep at a state, s.
    pub(crate) fn stable_step_at(state: NetworkState<'_>) -> f64 {
        Rates::of_springs(state).stable_step_s(barrier_rate(state, 0.0))
    }

    /// Substeps in a tick at a state.
    pub(crate) fn substeps_at(&self, state: NetworkState<'_>) -> Result<usize, BodyError> {
        let rates = Rates::of_springs(state);
        let springs = self.spring_substeps(rates)?;
        Ok(self.barrier_substeps(rates, barrier_rate(state, self.tick_s)).max(springs))
    }

    /// Substeps in a tick without volume barriers.
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

    /// Substeps in a tick with volume barriers; at most `max_substeps`.
    pub(crate) fn barrier_substeps(&self, rates: Rates, barriers_per_s2: f64) -> usize {
        let needed = self.needed(rates, barriers_per_s2);
        if needed < self.max_substeps as f64 { needed as usize } else { self.max_substeps }
    }

    fn needed(&self, rates: Rates, barriers_per_s2: f64) -> f64 {
        (self.tick_s / (self.stability_margin * rates.stable_step_s(barriers_per_s2))).ceil()
    }
}

/// The bound of all volume barriers that act now or will within `ahead_s`, 1/s².
fn barrier_rate(state: NetworkState<'_>, ahead_s: f64) -> f64 {
    let NetworkState { network, x, v } = state;
    crate::cells::rate_bound(network.barriers().all_tetrahedra(), network, (x, v), ahead_s)
}

/// Upper bounds of the largest eigenvalues over the free nodes, of springs and dampers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rates {
    /// Of M⁻¹B, 1/s.
    beta: f64,
    /// Of M⁻¹K, 1/s².
    kappa: f64,
}

impl Rates {
    /// Those at a state.
    pub(crate) fn of_springs(NetworkState { network, x, .. }: NetworkState<'_>) -> Self {
        let (mut beta, mut kappa) = (0.0_f64, 0.0_f64);
        for &node in network.free() {
            let (mut k, mut b) = (DMat3::ZERO, DMat3::ZERO);
            for &link in network.incident_links(node) {
                let link = &network.links()[link];
                let tangent = link.spring.tangent(x[link.b] - x[link.a], true);
                k += tangent.stiffness;
                b += tangent.damping;
            }
            let per_mass = 2.0 / network.mass_kg()[node];
            beta = beta.max(per_mass * largest_eigenvalue(&b));
            kappa = kappa.max(per_mass * largest_eigenvalue(&k));
        }
        Self { beta, kappa }
    }

    /// The largest stable substep, s, with volume barriers whose largest eigenvalue of M⁻¹K is at most `barriers_per_s2`.
    fn stable_step_s(self, barriers_per_s2: f64) -> f64 {
        let (beta, kappa) = (self.beta, self.kappa + barriers_per_s2);
        if kappa == 0.0 {
            return if beta == 0.0 { f64::INFINITY } else { 2.0 / beta };
        }
        ((beta * beta + 4.0 * kappa).sqrt() - beta) / kappa
    }
}
