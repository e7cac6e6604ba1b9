//! The measured force law of skin.

use crate::Tension;

/// Force f(x) = x / (c − h x) at indentation x, with compliance c at first touch and a singularity at c/h.
///
/// Equation 5 of the seed paper, from D. d'Aulignac, C. Laugier and M. C. Çavuşoğlu, IROS'99, pp. 727–732: with x in
/// millimetres and f in newtons c = 5.4398 and h = 0.1418.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinLaw {
    /// Compliance c at first touch, m/N.
    pub compliance_m_per_n: f64,
    /// Hardening h, 1/N.
    pub hardening_per_n: f64,
}

impl SkinLaw {
    /// Values measured on the thigh.
    pub const THIGH: Self = Self { compliance_m_per_n: 5.4398e-3, hardening_per_n: 0.1418 };

    /// Indentation at which the force is singular, m: 38.4 mm for [`SkinLaw::THIGH`].
    #[must_use]
    pub fn limit_m(self) -> f64 {
        self.compliance_m_per_n / self.hardening_per_n
    }

    /// f and f' at indentation `x_m`, m; `None` from the singularity on.
    #[must_use]
    pub fn at(self, x_m: f64) -> Option<Tension> {
        let rest = self.compliance_m_per_n - self.hardening_per_n * x_m;
        (rest > 0.0).then(|| Tension {
            force_n: x_m / rest,
            stiffness_n_per_m: self.compliance_m_per_n / (rest * rest),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thigh_law_matches_the_paper_in_millimetres() {
        let at = SkinLaw::THIGH.at(0.010).unwrap();
        assert!((at.force_n - 10.0 / (5.4398 - 1.418)).abs() < 1e-12);
        let h = 1e-8;
        let force = |x| SkinLaw::THIGH.at(x).unwrap().force_n;
        let slope = (force(0.010 + h) - force(0.010 - h)) / (2.0 * h);
        assert!((slope / at.stiffness_n_per_m - 1.0).abs() < 1e-7);
    }

    #[test]
    fn law_is_undefined_from_its_singularity_on() {
        let limit = SkinLaw::THIGH.limit_m();
        assert!((limit - 0.038362).abs() < 1e-6);
        assert!(SkinLaw::THIGH.at(0.999 * limit).is_some());
        assert_eq!(SkinLaw::THIGH.at(1.001 * limit), None);
        assert_eq!(SkinLaw::THIGH.at(f64::NAN), None);
    }
}
