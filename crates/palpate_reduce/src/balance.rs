//! Balanced truncation.

use crate::{Gramians, ReduceError, StateSpace};
use faer::Mat;

/// A system with its Gramians factored and its Hankel singular values, ready to be truncated to any order.
#[derive(Clone, Debug)]
pub struct Balancing {
    system: StateSpace,
    gramians: Gramians,
    /// Z_oᵀ Z_c = U Σ Vᵀ.
    u: Mat<f64>,
    v: Mat<f64>,
    hankel: Vec<f64>,
}

/// A balanced truncation.
#[derive(Clone, Debug)]
pub struct Truncated {
    /// The reduced system; D and E are the original's.
    pub system: StateSpace,
    /// T, n × r: the reduced state x_r stands for the state T x_r.
    pub states: Mat<f64>,
    /// See [`Balancing::error_bound`], N/m.
    pub error_bound: f64,
}

impl Balancing {
    /// Balances `system` (square-root method: Tombs and Postlethwaite, Int. J. Control 46 (1987) 1319).
    ///
    /// # Errors
    /// As [`Gramians::new`].
    pub fn new(system: StateSpace) -> Result<Self, ReduceError> {
        let gramians = Gramians::new(&system)?;
        let product = gramians.observability.transpose() * &gramians.controllability;
        let svd = product.thin_svd().map_err(|_| ReduceError::Eigenvalues { order: product.ncols() })?;
        let hankel = svd.S().column_vector().iter().copied().collect();
        Ok(Self { u: svd.U().to_owned(), v: svd.V().to_owned(), system, gramians, hankel })
    }

    /// Hankel singular values, descending, N/m. Those beyond the list are zero to rounding.
    #[must_use]
    pub fn hankel_singular_values(&self) -> &[f64] {
        &self.hankel
    }

    /// The Gramians.
    #[must_use]
    pub fn gramians(&self) -> &Gramians {
        &self.gramians
    }

    /// The system that is balanced.
    #[must_use]
    pub fn system(&self) -> &StateSpace {
        &self.system
    }

    /// How many Hankel singular values are more than rounding, to 1e-14 of the largest: the states that are needed, and
    /// the largest order of a truncation.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.hankel.iter().take_while(|&&s| s > 1e-14 * self.hankel[0]).count()
    }

    /// Twice the sum of the Hankel singular values beyond the first `order`: a bound of the H∞ error of the truncation to
    /// that order, N/m.
    #[must_use]
    pub fn error_bound(&self, order: usize) -> f64 {
        2.0 * self.hankel.iter().skip(order).fold(0.0, |sum, value| sum + value)
    }

    /// The truncation to `order`.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `order` is zero or above [`Balancing::rank`].
    pub fn truncate(&self, order: usize) -> Result<Truncated, ReduceError> {
        if !(1..=self.rank()).contains(&order) {
            let (what, allowed) =
                ("order of the truncation", "at least 1 and at most the rank of the Gramians");
            return Err(ReduceError::Option { what, value: order as f64, allowed });
        }
        let scaled = |factor: &Mat<f64>, of: &Mat<f64>| {
            let product = factor * of.subcols(0, order);
            Mat::from_fn(product.nrows(), order, |i, j| product[(i, j)] / self.hankel[j].sqrt())
        };
        let t = scaled(&self.gramians.controllability, &self.v);
        let w = scaled(&self.gramians.observability, &self.u);
        let full = &self.system;
        let system = StateSpace {
            a: w.transpose() * (&full.a * &t),
            b: w.transpose() * &full.b,
            c: &full.c * &t,
            d: full.d.clone(),
            e: full.e.clone(),
        };
        Ok(Truncated { system, states: t, error_bound: self.error_bound(order) })
    }

    /// The truncation of least order whose error bound is at most `bound`, N/m; that of order [`Balancing::rank`] where
    /// rounding is more than the bound.
    ///
    /// # Errors
    /// [`ReduceError::Option`] when `bound` is not above zero.
    pub fn truncate_to_bound(&self, bound: f64) -> Result<Truncated, ReduceError> {
        if bound.is_nan() || bound <= 0.0 {
            return Err(ReduceError::Option { what: "error bound, N/m", value: bound, allowed: "above 0" });
        }
        let mut tail = 0.0;
        let kept = self.hankel.iter().rposition(|s| {
            tail += 2.0 * s;
            tail > bound
        });
        self.truncate(kept.map_or(1, |last| last + 1).min(self.rank()))
    }
}
