//! Balanced truncation of linear systems.

use crate::{Gramians, ReduceError, StateSpace};
use faer::Mat;

/// Balanced truncation of a system (square-root method: M. S. Tombs and I. Postlethwaite, Int. J. Control 46 (1987) 1319): the Gramians and
/// the Hankel singular values, from which it is truncated to any order.
#[derive(Clone, Debug)]
pub struct Balancing {
    system: StateSpace,
    gramians: Gramians,
    /// Z_oᵀ Z_c = U Σ Vᵀ.
    u: Mat<f64>,
    v: Mat<f64>,
    hankel: Vec<f64>,
}

/// A system reduced by balanced truncation.
#[derive(Clone, Debug)]
pub struct Truncated {
    /// Reduced system; D and E are those of the original.
    pub system: StateSpace,
    /// T, n × r: the reduced state x_r represents the state T x_r.
    pub states: Mat<f64>,
    /// Bound of the H∞ error, N/m: see [`Balancing::error_bound`].
    pub error_bound: f64,
}

impl Balancing {
    /// Computes the Gramians and the Hankel singular values of `system`.
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

    /// Hankel singular values, N/m, descending. Values beyond the list are zero to within rounding.
    #[must_use]
    pub fn hankel_singular_values(&self) -> &[f64] {
        &self.hankel
    }

    /// The Gramians.
    #[must_use]
    pub fn gramians(&self) -> &Gramians {
        &self.gramians
    }

    /// The full system.
    #[must_use]
    pub fn system(&self) -> &StateSpace {
        &self.system
    }

    /// Number of Hankel singular values above 1e-14 of the largest, which is about rounding: the maximum order of a truncation.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.hankel.iter().take_while(|&&s| s > 1e-14 * self.hankel[0]).count()
    }

    /// Bound of the H∞ error of the truncation to `order`, N/m: twice the sum of the remaining Hankel singular values (K. Glover,
    /// Int. J. Control 39 (1984) 1115).
    #[must_use]
    pub fn error_bound(&self, order: usize) -> f64 {
        2.0 * self.hankel.iter().skip(order).fold(0.0, |sum, value| sum + value)
    }

    /// Truncates the system to `order` states.
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

    /// Truncates the system to the minimum order whose error bound is at most `bound`, N/m. The order is at most [`Balancing::rank`], even if
    /// the error then exceeds the bound by rounding.
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
