//! Force laws: the tension of a spring as a function of its extension.

use crate::{LawError, SkinLaw, Tension};

/// Tension φ(e) of a spring at extension e (length minus rest length). All laws are odd and smooth at e = 0.
///
/// Nonlinear laws stiffen up to [`ForceLaw::GUARD`] times their stiffness at rest and continue linearly from there,
/// with continuous φ and φ'. They are finite everywhere, and their stiffness is bounded.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ForceLaw {
    /// φ(e) = k e.
    Linear {
        /// Stiffness k, N/m.
        stiffness_n_per_m: f64,
    },
    /// φ(e) = e / (c − h |e|), measured on skin: equation 5 of the seed paper.
    Skin(SkinLaw),
    /// φ(e) = (k/a) sgn(e) (exp(a |e|) − 1), with φ' = k exp(a |e|): stiffening of soft tissue (Y. C. Fung, Am. J.
    /// Physiol. 213 (1967) 1532).
    Exponential {
        /// Stiffness at rest k, N/m.
        stiffness_n_per_m: f64,
        /// Rate of stiffening a, 1/m.
        rate_per_m: f64,
    },
}

impl ForceLaw {
    /// Ratio of the maximum stiffness of a law to its stiffness at rest.
    pub const GUARD: f64 = 100.0;

    /// Tension φ and stiffness φ' at extension `extension_m`, m.
    #[must_use]
    #[inline]
    pub fn at(self, extension_m: f64) -> Tension {
        match self {
            // The hot path: evaluated for every spring in every substep.
            Self::Linear { stiffness_n_per_m } => {
                Tension { force_n: stiffness_n_per_m * extension_m, stiffness_n_per_m }
            }
            _ => self.guarded(extension_m),
        }
    }

    fn guarded(self, extension_m: f64) -> Tension {
        let (size, limit) = (extension_m.abs(), self.guard_m());
        // NaN stays NaN.
        let mut tension = self.unguarded(if size > limit { limit } else { size });
        if size > limit {
            tension.force_n += tension.stiffness_n_per_m * (size - limit);
        }
        Tension { force_n: tension.force_n.copysign(extension_m), ..tension }
    }

    /// Stored energy ∫₀ᵉ φ at extension `extension_m`, J.
    #[must_use]
    pub fn energy_j(self, extension_m: f64) -> f64 {
        let (size, limit) = (extension_m.abs(), self.guard_m());
        let inside = self.unguarded_energy(size.min(limit));
        if size <= limit {
            return inside;
        }
        let Tension { force_n, stiffness_n_per_m } = self.unguarded(limit);
        let over = size - limit;
        inside + over * (force_n + 0.5 * stiffness_n_per_m * over)
    }

    /// Stiffness at rest φ'(0), N/m.
    #[must_use]
    pub fn stiffness_at_rest_n_per_m(self) -> f64 {
        match self {
            Self::Linear { stiffness_n_per_m } | Self::Exponential { stiffness_n_per_m, .. } => {
                stiffness_n_per_m
            }
            Self::Skin(skin) => 1.0 / skin.compliance_m_per_n,
        }
    }

    /// Whether φ' is constant.
    #[must_use]
    pub fn is_linear(self) -> bool {
        matches!(self, Self::Linear { .. })
    }

    /// Extension from which the law is linear, m; infinite for a linear law.
    #[must_use]
    pub fn guard_m(self) -> f64 {
        match self {
            Self::Linear { .. } => f64::INFINITY,
            // φ'/φ'(0) = 1/(1 − h e/c)².
            Self::Skin(skin) => (1.0 - Self::GUARD.sqrt().recip()) * skin.limit_m(),
            Self::Exponential { rate_per_m, .. } => Self::GUARD.ln() / rate_per_m,
        }
    }

    /// The law with `factor` times its force.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        match self {
            Self::Linear { stiffness_n_per_m: k } => Self::Linear { stiffness_n_per_m: factor * k },
            Self::Exponential { stiffness_n_per_m: k, rate_per_m } => {
                Self::Exponential { stiffness_n_per_m: factor * k, rate_per_m }
            }
            Self::Skin(SkinLaw { compliance_m_per_n: c, hardening_per_n: h }) => {
                Self::Skin(SkinLaw { compliance_m_per_n: c / factor, hardening_per_n: h / factor })
            }
        }
    }

    /// Value at an extension between 0 and the guard.
    fn unguarded(self, e: f64) -> Tension {
        match self {
            Self::Linear { stiffness_n_per_m } => {
                Tension { force_n: stiffness_n_per_m * e, stiffness_n_per_m }
            }
            Self::Skin(skin) => {
                let rest = skin.compliance_m_per_n - skin.hardening_per_n * e;
                Tension { force_n: e / rest, stiffness_n_per_m: skin.compliance_m_per_n / (rest * rest) }
            }
            Self::Exponential { stiffness_n_per_m: k, rate_per_m: a } => {
                Tension { force_n: k / a * (a * e).exp_m1(), stiffness_n_per_m: k * (a * e).exp() }
            }
        }
    }

    fn unguarded_energy(self, e: f64) -> f64 {
        match self {
            Self::Linear { stiffness_n_per_m: k } => 0.5 * k * e * e,
            Self::Skin(SkinLaw { compliance_m_per_n: c, hardening_per_n: h }) => {
                // c/h² (−z − ln(1 − z)) with z = h e/c. The difference loses digits for small z; the series does not.
                let z = h * e / c;
                e * e / c * if z < 1e-2 { series(z, |n| 1.0 / n) } else { (-z - (-z).ln_1p()) / (z * z) }
            }
            Self::Exponential { stiffness_n_per_m: k, rate_per_m: a } => {
                let z = a * e;
                let factorial = |n: f64| (1..=n as u32).map(f64::from).product::<f64>().recip();
                k * e * e * if z < 1e-2 { series(z, factorial) } else { (z.exp_m1() - z) / (z * z) }
            }
        }
    }

    /// Checks the parameters.
    pub(crate) fn validate(self) -> Result<(), LawError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        match self {
            Self::Linear { stiffness_n_per_m: k } | Self::Exponential { stiffness_n_per_m: k, .. }
                if !positive(k) =>
            {
                Err(LawError::Stiffness(k))
            }
            Self::Exponential { rate_per_m: a, .. } if !positive(a) => Err(LawError::Rate(a)),
            Self::Skin(skin) if !positive(skin.compliance_m_per_n) => {
                Err(LawError::Compliance(skin.compliance_m_per_n))
            }
            Self::Skin(skin) if !positive(skin.hardening_per_n) => {
                Err(LawError::Hardening(skin.hardening_per_n))
            }
            _ => Ok(()),
        }
    }
}

/// Σ_{n ≥ 2} c(n) z^(n − 2), with enough terms for z below 0.01.
fn series(z: f64, c: impl Fn(f64) -> f64) -> f64 {
    (2..=9).rev().fold(0.0, |sum, n| sum * z + c(f64::from(n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laws() -> [ForceLaw; 3] {
        [
            ForceLaw::Linear { stiffness_n_per_m: 200.0 },
            ForceLaw::Skin(SkinLaw::THIGH),
            ForceLaw::Exponential { stiffness_n_per_m: 200.0, rate_per_m: 50.0 },
        ]
    }

    #[test]
    fn stiffness_is_the_slope_of_force_and_force_that_of_energy() {
        for law in laws() {
            // Below, near and beyond the guards of the skin law (34.5 mm) and of the exponential law (92 mm).
            for e in [1e-5_f64, 1e-3, 0.01, 0.0344, 0.0347, 0.05, 0.0915, 0.0925, 0.2] {
                for e in [e, -e] {
                    let h = 1e-6 * e.abs();
                    let Tension { force_n, stiffness_n_per_m } = law.at(e);
                    let slope = (law.at(e + h).force_n - law.at(e - h).force_n) / (2.0 * h);
                    assert!((slope / stiffness_n_per_m - 1.0).abs() < 1e-4, "{law:?} at {e}");
                    let power = (law.energy_j(e + h) - law.energy_j(e - h)) / (2.0 * h);
                    assert!((power / force_n - 1.0).abs() < 1e-5, "{law:?} at {e}: {power}, {force_n}");
                }
            }
        }
    }

    #[test]
    fn laws_are_odd_and_continue_at_their_guard() {
        for law in laws() {
            assert_eq!(
                law.at(0.0),
                Tension { force_n: 0.0, stiffness_n_per_m: law.stiffness_at_rest_n_per_m() }
            );
            assert_eq!(law.at(0.03).force_n, -law.at(-0.03).force_n);
            assert_eq!(law.energy_j(0.03), law.energy_j(-0.03));
            let guard = law.guard_m();
            if guard.is_finite() {
                let [inside, outside] = [1.0 - 1e-9, 1.0 + 1e-9].map(|near| law.at(near * guard));
                assert!((outside.force_n / inside.force_n - 1.0).abs() < 1e-6);
                assert!((outside.stiffness_n_per_m / inside.stiffness_n_per_m - 1.0).abs() < 1e-6);
                let most = ForceLaw::GUARD * law.stiffness_at_rest_n_per_m();
                assert!(
                    (law.at(10.0).stiffness_n_per_m / most - 1.0).abs() < 1e-12
                        && law.at(1e6).force_n.is_finite()
                );
            }
        }
    }

    #[test]
    fn energy_of_small_extensions_keeps_its_digits() {
        // On both sides of the switch from the series to the closed form, and far below it.
        for law in laws() {
            let k = law.stiffness_at_rest_n_per_m();
            assert!((law.energy_j(1e-9) / (0.5 * k * 1e-18) - 1.0).abs() < 1e-6);
            for at in [0.99e-2, 1.01e-2] {
                let e = match law {
                    ForceLaw::Skin(skin) => at * skin.limit_m(),
                    ForceLaw::Exponential { rate_per_m, .. } => at / rate_per_m,
                    ForceLaw::Linear { .. } => at,
                };
                // Simpson's rule, with an error of the fifth order.
                let force = |x: f64| law.at(x).force_n;
                let n = 200;
                let step = e / f64::from(n);
                let simpson: f64 = (0..n)
                    .map(|i| {
                        let x = f64::from(i) * step;
                        step / 6.0 * (force(x) + 4.0 * force(x + 0.5 * step) + force(x + step))
                    })
                    .sum();
                assert!((law.energy_j(e) / simpson - 1.0).abs() < 1e-11, "{law:?}");
            }
        }
    }

    #[test]
    fn scaled_law_multiplies_force_and_stiffness() {
        for law in laws() {
            for e in [1e-3, 0.02, 0.3] {
                let (once, thrice) = (law.at(e), law.scaled(3.0).at(e));
                assert!((thrice.force_n / once.force_n - 3.0).abs() < 1e-12);
                assert!((thrice.stiffness_n_per_m / once.stiffness_n_per_m - 3.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn rejects_parameters_that_are_not_positive_and_finite() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let skin = |c, h| ForceLaw::Skin(SkinLaw { compliance_m_per_n: c, hardening_per_n: h });
            let exponential = |k, a| ForceLaw::Exponential { stiffness_n_per_m: k, rate_per_m: a };
            assert!(matches!(skin(bad, 0.1).validate(), Err(LawError::Compliance(_))));
            assert!(matches!(skin(0.1, bad).validate(), Err(LawError::Hardening(_))));
            assert!(matches!(exponential(bad, 1.0).validate(), Err(LawError::Stiffness(_))));
            assert!(matches!(exponential(1.0, bad).validate(), Err(LawError::Rate(_))));
        }
    }
}
