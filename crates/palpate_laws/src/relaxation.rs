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
    /// Share g of each term; 0 for no term.
    pub shares: [f64; MAX_PRONY_TERMS],
    /// Relaxation time τ of each term, s.
    pub times_s: [f64; MAX_PRONY_TERMS],
}

/// H of each term of an element: xx, yy, zz, xy, yz, zx.
pub type RelaxedStress = [[f64; 6]; MAX_PRONY_TERMS];

/// Maximum sum of the shares: a part of the stiffness remains.
const MAX_SHARE: f64 = 0.99;

impl Relaxation {
    /// No relaxation.
    pub const NONE: Self = Self { shares: [0.0; MAX_PRONY_TERMS], times_s: [0.0; MAX_PRONY_TERMS] };

    /// Creates the series of up to three `terms`.
    ///
    /// # Errors
    /// [`LawError::RelaxationTerms`] for more than three terms; [`LawError::RelaxedShare`] for a share of 0; otherwise as
    /// [`Relaxation::validate`].
    pub fn new(terms: &[PronyTerm]) -> Result<Self, LawError> {
        if terms.len() > MAX_PRONY_TERMS {
            return Err(LawError::RelaxationTerms(terms.len()));
        }
        let mut series = Self::NONE;
        for (i, term) in terms.iter().enumerate() {
            if term.share == 0.0 {
                return Err(LawError::RelaxedShare(0.0));
            }
            (series.shares[i], series.times_s[i]) = (term.share, term.time_s);
        }
        series.validate().map(|()| series)
    }

    /// Checks the terms.
    ///
    /// # Errors
    /// [`LawError::RelaxedShare`] unless every share is at least 0 and their sum at most 0.99; [`LawError::RelaxationTime`] unless the time of
    /// every term is finite and above 0.
    pub fn validate(&self) -> Result<(), LawError> {
        if let Some(bad) = self.shares.into_iter().find(|share| share.is_nan() || *share < 0.0) {
            return Err(LawError::RelaxedShare(bad));
        }
        if self.share() > MAX_SHARE {
            return Err(LawError::RelaxedShare(self.share()));
        }
        let bad = self.terms().find(|(_, term)| !(term.time_s.is_finite() && term.time_s > 0.0));
        bad.map_or(Ok(()), |(_, term)| Err(LawError::RelaxationTime(term.time_s)))
    }

    /// Terms with their indices.
    pub fn terms(&self) -> impl Iterator<Item = (usize, PronyTerm)> + '_ {
        let terms =
            self.shares.iter().zip(&self.times_s).map(|(&share, &time_s)| PronyTerm { share, time_s });
        terms.enumerate().filter(|(_, term)| term.share != 0.0)
    }

    /// Whether there are no terms.
    #[must_use]
    #[inline]
    pub fn is_none(&self) -> bool {
        self.shares == [0.0; MAX_PRONY_TERMS]
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.shares.iter().chain(&self.times_s).all(|value| value.is_finite())
    }

    /// Share Σ g of the shear modulus that relaxes.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.shares.iter().sum()
    }
}
