//! The smooth law of indentation: how far a rigid tool comes towards an elastic half-space under a force.

/// Contact of a rigid tool with the smooth surface of an elastic half-space (K. L. Johnson, Contact Mechanics, 1985, sections
/// 3.8 and 4.2), without friction.
///
/// A body of cells resolves the part that is coarser than a cell; [`SeriesCompliance`](crate::SeriesCompliance) is the rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indentation {
    /// Pressure distribution under the tool.
    pub pressure: Pressure,
    /// Radius of the tool, m: R of a ball, a of a flat punch.
    pub radius_m: f64,
    /// E* = E/(1 − ν²), Pa.
    pub modulus_pa: f64,
    /// Poisson's ratio ν of the half-space.
    pub poissons_ratio: f64,
}

/// Distribution of the pressure over the contact radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pressure {
    /// Hertz's pressure under a ball: p ∝ (1 − r²/a²)^½.
    Ball,
    /// Boussinesq's pressure under a rigid flat punch: p ∝ (1 − r²/a²)^−½.
    Punch,
}

impl Indentation {
    /// Approach δ(F), m, under a force of `force_n` ≥ 0, N.
    ///
    /// For a ball it is Hertz's a²/R up to δ = R, where the contact is as wide as the ball. Beyond that it continues
    /// with the slope of a punch of that radius. For a punch it is F/(2 a E*).
    #[must_use]
    pub fn approach_m(&self, force_n: f64) -> f64 {
        let stiffness = 2.0 * self.modulus_pa * self.radius_m;
        match self.pressure {
            Pressure::Punch => force_n / stiffness,
            Pressure::Ball => {
                let beyond = force_n - self.full_n();
                if beyond > 0.0 {
                    self.radius_m + beyond / stiffness
                } else {
                    let a = self.radius_of_contact_m(force_n);
                    a * a / self.radius_m
                }
            }
        }
    }

    /// Slope dδ/dF, m/N; unbounded for a ball as the force goes to zero.
    #[must_use]
    pub fn slope_m_per_n(&self, force_n: f64) -> f64 {
        1.0 / (2.0 * self.modulus_pa * self.radius_of_contact_m(force_n))
    }

    /// Force F(δ) at an approach of `approach_m`, N; 0 for an approach of 0 or less.
    #[must_use]
    pub fn force_n(&self, approach_m: f64) -> f64 {
        let (delta, stiffness) = (approach_m.max(0.0), 2.0 * self.modulus_pa * self.radius_m);
        match self.pressure {
            Pressure::Punch => stiffness * delta,
            Pressure::Ball if delta > self.radius_m => self.full_n() + stiffness * (delta - self.radius_m),
            Pressure::Ball => 4.0 / 3.0 * self.modulus_pa * (self.radius_m * delta).sqrt() * delta,
        }
    }

    /// Contact radius, m: Hertz's radius for a ball, at most the ball's radius; the radius of a punch.
    #[must_use]
    pub fn radius_of_contact_m(&self, force_n: f64) -> f64 {
        match self.pressure {
            Pressure::Punch => self.radius_m,
            Pressure::Ball => {
                (0.75 * force_n.max(0.0) * self.radius_m / self.modulus_pa).cbrt().min(self.radius_m)
            }
        }
    }

    /// Complementary energy ∫ δ dF from 0 to `force_n`, J. The half-space stores F δ minus this energy.
    #[must_use]
    pub fn complementary_energy_j(&self, force_n: f64) -> f64 {
        match self.pressure {
            Pressure::Punch => 0.5 * force_n * self.approach_m(force_n),
            Pressure::Ball => {
                let full = self.full_n();
                if force_n <= full {
                    0.6 * force_n * self.approach_m(force_n)
                } else {
                    let (low, high) = (self.radius_m, self.approach_m(force_n));
                    0.6 * full * low + 0.5 * (low + high) * (force_n - full)
                }
            }
        }
    }

    /// Pressure-weighted mean displacement of the surface divided by the force, m/N: the compliance of a grid that
    /// resolves the contact.
    #[must_use]
    pub fn resolved_m_per_n(&self, force_n: f64) -> f64 {
        // Under a ball u(r) = δ (1 − r²/2a²) and the mean of r² is 2a²/5.
        match self.pressure {
            Pressure::Punch => self.slope_m_per_n(force_n),
            Pressure::Ball => {
                let a = self.radius_of_contact_m(force_n);
                3.0 / (5.0 * self.modulus_pa * a)
            }
        }
    }

    /// Force at which the contact is as wide as the ball, N.
    pub(crate) fn full_n(&self) -> f64 {
        4.0 / 3.0 * self.modulus_pa * self.radius_m * self.radius_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BALL: Indentation =
        Indentation { pressure: Pressure::Ball, radius_m: 0.005, modulus_pa: 21e3, poissons_ratio: 0.25 };
    const PUNCH: Indentation = Indentation { pressure: Pressure::Punch, ..BALL };

    #[test]
    fn force_approach_slope_and_energy_are_consistent() {
        for law in [BALL, PUNCH] {
            let mut energy = 0.0;
            let step = 1e-5;
            for i in 0..200_000 {
                let f = (f64::from(i) + 0.5) * step;
                energy += law.approach_m(f) * step;
                if i % 10_000 == 5 {
                    assert!((law.force_n(law.approach_m(f)) / f - 1.0).abs() < 1e-12);
                    let e = 1e-6 * f;
                    let slope = (law.approach_m(f + e) - law.approach_m(f - e)) / (2.0 * e);
                    assert!((slope / law.slope_m_per_n(f) - 1.0).abs() < 1e-5, "{f}");
                }
            }
            assert!((law.complementary_energy_j(2.0) / energy - 1.0).abs() < 1e-5);
        }
        // Hertz.
        let f = 4.0 / 3.0 * 21e3 * 0.005_f64.sqrt() * 0.002_f64.powf(1.5);
        assert!((BALL.force_n(0.002) - f).abs() < 1e-12);
    }
}
