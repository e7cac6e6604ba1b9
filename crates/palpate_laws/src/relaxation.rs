//! Stress relaxation of a material.

use crate::LawError;

/// Maximum number of terms of a Prony series.
pub const MAX_PRONY_TERMS: usize = 3;

/// A term of a Prony series.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PronyTerm {
    /// Share g of the instantaneous shear modulus that relaxes.
    pub share: f64,
    /// Relaxation time τ, s.
    pub time_s: f64,
}

/// Stress relaxation by a Prony series of up to three terms: G(t) = G₀ (1 − Σ g (1 − exp(−t/τ))), with the instantaneous shear modulus G₀. The bulk
/// modulus does not relax.
///
/// At finite strain it is quasi-linear (Y. C. Fung, Biomechanics, section 7.6): with the part S of the second Piola stress that has the
/// parameters μ and −2μ/3, which is deviatoric at small strain, the stress is that of the law less Σ g H, where τ Ḣ = S − H.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Relaxation {
    /// A share of 0 is no term.
    terms: [PronyTerm; MAX_PRONY_TERMS],
}

/// H of each term of an element: xx, yy, zz, xy, yz, zx.
pub type RelaxedStress = [[f64; 6]; MAX_PRONY_TERMS];

/// Maximum sum of the shares: a part of the stiffness remains.
const MAX_SHARE: f64 = 0.99;

impl Relaxation {
    /// No relaxation.
    pub const NONE: Self = Self { terms: [PronyTerm { share: 0.0, time_s: 0.0 }; MAX_PRONY_TERMS] };

    /// Creates the series of up to three `terms`.
    ///
    /// # Errors
    /// [`LawError::RelaxationTerms`] for more than three terms; [`LawError::RelaxedShare`] unless every share is above 0 and their sum at most
    /// 0.99; [`LawError::RelaxationTime`] unless every time is finite and above 0.
    pub fn new(terms: &[PronyTerm]) -> Result<Self, LawError> {
        let mut series = Self::NONE;
        if terms.len() > MAX_PRONY_TERMS {
            return Err(LawError::RelaxationTerms(terms.len()));
        }
        series.terms.iter_mut().zip(terms).for_each(|(to, from)| *to = *from);
        let sum: f64 = terms.iter().map(|term| term.share).sum();
        if let Some(bad) = terms.iter().map(|term| term.share).find(|share| share.is_nan() || *share <= 0.0) {
            return Err(LawError::RelaxedShare(bad));
        }
        if sum > MAX_SHARE {
            return Err(LawError::RelaxedShare(sum));
        }
        match terms.iter().find(|term| !(term.time_s.is_finite() && term.time_s > 0.0)) {
            Some(bad) => Err(LawError::RelaxationTime(bad.time_s)),
            None => Ok(series),
        }
    }

    /// Terms with their indices.
    pub fn terms(&self) -> impl Iterator<Item = (usize, PronyTerm)> + '_ {
        self.terms.iter().copied().enumerate().filter(|(_, term)| term.share != 0.0)
    }

    /// Whether there are no terms.
    #[must_use]
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.terms.iter().all(|term| term.share.is_finite() && term.time_s.is_finite())
    }

    /// Share Σ g of the shear modulus that relaxes.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.terms.iter().map(|term| term.share).sum()
    }
}
