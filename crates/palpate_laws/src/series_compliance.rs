//! The compliance in series with a contact row: the share of the smooth law that a grid of cells lacks.

use crate::{Indentation, Pressure};

/// Softening of compressed springs: a lattice deflects by the additional fraction s u/(h² + (r R)²)^½ of its linear
/// deflection u. Measured with balls of half a cell to ten cells of radius, and with punches of two to five.
#[derive(Clone, Copy)]
struct Softening {
    s: f64,
    r: f64,
}
const BALL_SOFTENING: Softening = Softening { s: 0.33, r: 1.0 / 3.0 };
const PUNCH_SOFTENING: Softening = Softening { s: 0.27, r: 0.5 };

/// Compliance in series with a contact row: the share of a smooth law of indentation that the grid does not resolve.
///
/// δ_s(F) = κ δ(F/p) with κ ≤ 1, for a row that bears the portion p of the contact's force. It is a function of the
/// force and adds no state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeriesCompliance {
    /// Share κ of the law, above 0.
    pub share: f64,
    /// Distance by which the contact leads the tool, m, where the grid deflects by more than the law.
    pub lead_m: f64,
    /// Share of the law's energy that the compliance stores: κ where κ does not depend on the force, less where the
    /// grid's part grows with the force.
    pub held: f64,
    /// Law δ(F) of the whole contact.
    pub law: Indentation,
    /// Portion of the contact's force that the row bears under the law's pressure distribution, above 0; 1 for a
    /// contact of one row.
    pub portion: f64,
}

impl SeriesCompliance {
    /// Creates a compliance with the share κ = `share` of `law` at every force.
    #[must_use]
    pub fn of_share(share: f64, law: Indentation) -> Self {
        Self { share, lead_m: 0.0, held: share, law, portion: 1.0 }
    }

    /// The same compliance for a row that bears `portion` of the contact's force.
    #[must_use]
    pub fn of_portion(self, portion: f64) -> Self {
        Self { portion, ..self }
    }

    /// Compliance that a grid of cells lacks: δ_s = δ − C_g F, minus the softening of springs with cells of
    /// `softening_m`. `grid_m_per_n` is the linear compliance C_g of the grid, m/N. `force_n` is the force, N, and `averaged_n` its
    /// average over some milliseconds.
    #[must_use]
    pub fn missing(
        law: Indentation,
        (grid_m_per_n, softening_m): (f64, Option<f64>),
        (force_n, averaged_n): (f64, f64),
    ) -> Self {
        let ratio = |part: f64, of: f64| if of > 0.0 { part / of } else { 0.0 };
        let base = (1.0 - ratio(grid_m_per_n * force_n, law.approach_m(force_n))).clamp(0.0, 1.0);
        let (eased_m, grid_m) = (law.approach_m(averaged_n), grid_m_per_n * averaged_n);
        // A grid that does not resolve a punch's rim may deflect too much in proportion.
        let (Softening { s, r }, grid_m) = match law.pressure {
            Pressure::Ball => (BALL_SOFTENING, grid_m),
            Pressure::Punch => (PUNCH_SOFTENING, grid_m.min(eased_m)),
        };
        let softening = |cell_m: f64| s * grid_m * grid_m / cell_m.hypot(r * law.radius_m);
        let softer_m = softening_m.map_or(0.0, softening).min(MAX_LEAD * eased_m);
        // The softening reduces the compliance as far as possible; the rest shifts the tool.
        let share = (base - ratio(softer_m, eased_m)).max(MIN_SHARE);
        let lead_m = (softer_m - (base - share) * eased_m).max(0.0);
        // ∫ F dδ_s with δ_s = δ − C_g F − c F², in parts of ∫ F dδ.
        let whole = match law.pressure {
            Pressure::Ball => 2.5,
            Pressure::Punch => 2.0,
        };
        let held = (1.0 - whole * (0.5 * (1.0 - base) + 2.0 / 3.0 * (base - share))).max(0.0);
        Self { share, lead_m, held, law, portion: 1.0 }
    }

    /// Fraction of an existing gap that the compliance takes up, from 0 at its minimum share to 1. The position
    /// update cannot close the gap of a soft compliance, which gives way before the nodes do.
    #[must_use]
    pub fn gap_uptake(&self) -> f64 {
        ((self.share - MIN_SHARE) / (SOFT_SHARE - MIN_SHARE)).clamp(0.0, 1.0)
    }

    /// Deflection δ_s under a force, m.
    #[must_use]
    pub fn approach_m(&self, force_n: f64) -> f64 {
        self.share * self.law.approach_m(force_n.max(0.0) / self.portion)
    }

    /// Force at a deflection of `approach_m`, N.
    #[must_use]
    pub fn force_n(&self, approach_m: f64) -> f64 {
        self.portion * self.law.force_n(approach_m / self.share)
    }

    /// Force F under which this compliance and a linear one of `other_m_per_n` in series deflect by `approach_m`
    /// together, N: δ_s(F) + C F.
    #[must_use]
    pub fn force_beside_n(&self, approach_m: f64, other_m_per_n: f64) -> f64 {
        let Indentation { pressure, radius_m, modulus_pa, .. } = self.law;
        let (share, other) = (self.share, other_m_per_n * self.portion);
        let (full_n, full_m) = match pressure {
            Pressure::Punch => (0.0, 0.0),
            Pressure::Ball => (self.law.full_n(), share * radius_m + other * self.law.full_n()),
        };
        if approach_m >= full_m {
            let slope = share / (2.0 * modulus_pa * radius_m) + other;
            return self.portion * (full_n + (approach_m - full_m) / slope);
        }
        // With the contact radius a, F ∝ a³ and δ ∝ a²: in units of the radius without the other compliance, ρ x³ +
        // x² = 1. Newton's method converges from above.
        let alone_m = approach_m / share;
        let per_m = 4.0 / 3.0 * modulus_pa * (alone_m * radius_m).sqrt();
        let rho = other * per_m / share;
        let mut x = if rho > FAR { rho.cbrt().recip() } else { 1.0 };
        for _ in 0..NEWTON_STEPS {
            let step = (x * x * (rho * x + 1.0) - 1.0) / (x * (3.0 * rho * x + 2.0));
            x -= step;
            // The next step would be about the square of this one.
            if step <= SETTLED * x {
                break;
            }
        }
        self.portion * per_m * alone_m * x * x * x
    }

    /// Slope dδ_s/dF, m/N.
    #[must_use]
    pub fn slope_m_per_n(&self, force_n: f64) -> f64 {
        self.share * self.law.slope_m_per_n(force_n / self.portion) / self.portion
    }

    /// Missing compliance across the normal, m/N: the same share of 1/(8 G a/(2 − ν)), the compliance of a contact of
    /// radius a in stick under a small force (R. D. Mindlin, J. Appl. Mech. 16 (1949) 259). Infinite without a contact.
    #[must_use]
    pub fn tangential_m_per_n(&self, force_n: f64) -> f64 {
        // 8 G/(2 − ν) = 4 E* (1 − ν)/(2 − ν).
        let Indentation { modulus_pa, poissons_ratio: nu, .. } = self.law;
        let across_pa = 4.0 * ((1.0 - nu) / (2.0 - nu)) * modulus_pa;
        self.share / (across_pa * self.law.radius_of_contact_m(force_n / self.portion) * self.portion)
    }

    /// [`Self::tangential_m_per_n`], but 0 without a contact: a new contact bears no tangential force yet.
    #[must_use]
    pub fn across_m_per_n(&self, force_n: f64) -> f64 {
        let compliance = self.tangential_m_per_n(force_n);
        if compliance.is_finite() { compliance } else { 0.0 }
    }

    /// Stored energy under `force_n`, J.
    #[must_use]
    pub fn energy_j(&self, force_n: f64) -> f64 {
        let whole_n = force_n.max(0.0) / self.portion;
        let stored = whole_n * self.law.approach_m(whole_n) - self.law.complementary_energy_j(whole_n);
        self.held * self.portion * stored
    }
}

/// Newton's method for the force in series with a linear compliance: maximum number of steps, relative step that ends
/// it, and the ρ from which the linear compliance gives the better start.
const NEWTON_STEPS: usize = 40;
const SETTLED: f64 = 1e-7;
const FAR: f64 = 8.0;
/// Minimum share of the smooth law in series with a row. It distributes the load over nearly redundant rows.
pub(crate) const MIN_SHARE: f64 = 0.05;
/// Share of the smooth law from which the compliance takes up all of a gap.
const SOFT_SHARE: f64 = 0.2;
/// Maximum share of the smooth law by which the contact may lead the tool.
const MAX_LEAD: f64 = 0.5;

#[cfg(test)]
mod tests {
    use super::*;

    const BALL: Indentation =
        Indentation { pressure: Pressure::Ball, radius_m: 0.005, modulus_pa: 21e3, poissons_ratio: 0.25 };
    const PUNCH: Indentation = Indentation { pressure: Pressure::Punch, ..BALL };

    #[test]
    fn deflections_in_series_with_a_linear_compliance_add_up() {
        for law in [BALL, PUNCH] {
            for (share, portion) in [(1.0, 1.0), (0.3, 0.07), (0.05, 0.5)] {
                let series = SeriesCompliance::of_share(share, law).of_portion(portion);
                for approach in [1e-9, 1e-4, 0.002, 0.02] {
                    for other in [0.0, 1e-9, 1e-4, 0.01, 1.0, 1e6] {
                        let f = series.force_beside_n(approach, other);
                        let both = series.approach_m(f) + other * f;
                        assert!((both / approach - 1.0).abs() < 1e-13, "{law:?} {share} {approach} {other}");
                    }
                }
            }
        }
    }

    #[test]
    fn grid_compliance_and_softening_are_subtracted() {
        let law = BALL;
        let f = 0.3;
        let missing = SeriesCompliance::missing(law, (0.25 * law.approach_m(f) / f, Some(1e3)), (f, f));
        assert!((missing.share - 0.75).abs() < 1e-6);
        assert!((missing.approach_m(f) - 0.75 * law.approach_m(f)).abs() < 1e-8);
        // What springs soften by comes from the compliance, and where that is not enough from the tool's place.
        let delta = law.approach_m(f);
        let firm = SeriesCompliance::missing(law, (0.5 * delta / f, Some(0.01)), (f, f));
        let softer =
            BALL_SOFTENING.s * (0.5 * delta).powi(2) / 0.01_f64.hypot(BALL_SOFTENING.r * law.radius_m);
        assert!((firm.approach_m(f) - (0.5 * delta - softer)).abs() < 1e-12 && firm.lead_m == 0.0);
        let soft = SeriesCompliance::missing(law, (1.0, Some(0.01)), (f, f));
        assert!((soft.share, soft.lead_m) == (MIN_SHARE, MIN_SHARE * delta + MAX_LEAD * delta));
        // Elements do not soften.
        let stiff = SeriesCompliance::missing(law, (0.5 * delta / f, None), (f, f));
        assert!((stiff.approach_m(f) - 0.5 * delta).abs() < 1e-12 && stiff.lead_m == 0.0);
        // Its energy is the work along its way.
        let grid = (0.4 * delta / f, Some(0.01));
        let steps = 20_000_u32;
        let at = |i: usize| f * i as f64 / f64::from(steps);
        let approach = |n: f64| SeriesCompliance::missing(law, grid, (n, n)).approach_m(n);
        let work: f64 = (0..steps as usize)
            .map(|i| 0.5 * (at(i) + at(i + 1)) * (approach(at(i + 1)) - approach(at(i))))
            .sum();
        let held = SeriesCompliance::missing(law, grid, (f, f)).energy_j(f);
        assert!((held / work - 1.0).abs() < 1e-6, "{held} J, {work} J");
        // A force that has begun just now has not softened anything yet.
        let begun = SeriesCompliance::missing(law, (0.5 * delta / f, Some(0.01)), (f, 0.0));
        assert!((begun.approach_m(f) - 0.5 * delta).abs() < 1e-12 && begun.lead_m == 0.0);
        assert_eq!(SeriesCompliance::missing(law, (1.0, Some(0.01)), (0.0, 0.0)).share, 1.0);
        // A grid that resolves a ball's contact leaves the sagitta of the ball under the pressure, a fifth of the approach.
        let resolved = SeriesCompliance::missing(law, (law.resolved_m_per_n(f), Some(1e3)), (f, f));
        assert!((resolved.share - 0.2).abs() < 1e-6);
        // One that resolves a punch's leaves nothing.
        let punch = SeriesCompliance::missing(PUNCH, (PUNCH.resolved_m_per_n(f), Some(1e3)), (f, f));
        assert!(punch.share == MIN_SHARE && punch.lead_m > MIN_SHARE * PUNCH.approach_m(f));
    }
}
