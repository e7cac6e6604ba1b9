//! The material of an element, and its stress at a deformation gradient.

use crate::elastic_law::{inner, outer, stretch2_bound};
use crate::{ElasticLaw, LameParameters, Relaxation, RelaxedStress, StressState, StressTangent};
use glam::{DMat3, DVec3};

/// The material of an element: its law, and the parameters times the element's volume.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ElementMaterial {
    /// Elastic law.
    pub law: ElasticLaw,
    /// Lamé parameters times the volume that is filled with the material, J.
    pub parameters_j: LameParameters,
    /// Parameters of the viscous stress times the volume, J s: that of a linear material in the rate of the Green strain. Stiffness-proportional
    /// (Rayleigh) damping β has β times `parameters_j`.
    pub viscous_js: LameParameters,
    /// Stress relaxation. The stiffness of hourglass modes, and of the deviation of tetrahedra from their domains, is that of the relaxed
    /// material.
    pub relaxation: Relaxation,
}

impl ElementMaterial {
    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let is_finite = |of: LameParameters| of.mu.is_finite() && of.lambda.is_finite();
        is_finite(self.parameters_j) && is_finite(self.viscous_js) && self.relaxation.is_finite()
    }

    /// Whether the material has a damper.
    #[must_use]
    #[inline]
    pub fn is_damped(&self) -> bool {
        self.viscous_js != LameParameters::default()
    }

    /// Whether the material has stiffness.
    #[must_use]
    #[inline]
    pub fn is_elastic(&self) -> bool {
        self.parameters_j != LameParameters::default()
    }

    /// Whether the stress relaxes.
    #[must_use]
    #[inline]
    pub fn relaxes(&self) -> bool {
        !self.relaxation.is_none()
    }

    /// μ of the relaxed material, J.
    #[must_use]
    #[inline]
    pub fn relaxed_mu_j(&self) -> f64 {
        self.parameters_j.mu * (1.0 - self.relaxation.share())
    }

    /// Stress and strain at the deformation gradient `f`, of a material in the volume `volume_m3`, without the damper.
    #[must_use]
    pub fn stress_state(&self, f: &DMat3, relaxed: &RelaxedStress, volume_m3: f64) -> StressState {
        StressState::new(f, &(self.elastic_stress_j(f, relaxed) * volume_m3.recip()))
    }

    /// First Piola stress of the law less its relaxed part, times the volume, J.
    #[inline]
    pub(crate) fn elastic_stress_j(&self, f: &DMat3, relaxed: &RelaxedStress) -> DMat3 {
        let stress_j = self.law.stress(f, self.parameters_j);
        if self.relaxes() { stress_j - *f * self.relaxed_j(relaxed) } else { stress_j }
    }

    /// Derivative of [`ElementMaterial::elastic_stress_j`] at constant H. With `clamped` it is positive semidefinite.
    pub(crate) fn elastic_tangent_j(
        &self,
        f: &DMat3,
        relaxed: &RelaxedStress,
        clamped: bool,
    ) -> StressTangent {
        let mut tangent = self.law.tangent(f, self.parameters_j, clamped);
        if self.relaxes() && !clamped {
            let relaxed = self.relaxed_j(relaxed);
            for (c, blocks) in tangent.iter_mut().enumerate() {
                for (d, block) in blocks.iter_mut().enumerate() {
                    *block -= DMat3::from_diagonal(DVec3::splat(relaxed.col(c)[d]));
                }
            }
        }
        tangent
    }

    /// Elastic energy, J.
    pub(crate) fn elastic_energy_j(&self, f: &DMat3, relaxed: &RelaxedStress) -> f64 {
        let of_relaxation = if self.relaxes() { self.relaxed_energy_j(f, relaxed) } else { 0.0 };
        self.law.energy(f, self.parameters_j) + of_relaxation
    }

    /// Advances H of a material that relaxes by `h` seconds at the constant deformation gradient `f`. Returns the largest |S − H|/μ before: a
    /// strain.
    pub(crate) fn relax(&self, f: &DMat3, relaxed: &mut RelaxedStress, h: f64) -> f64 {
        let stress = self.relaxing_j(f);
        let mut largest2 = 0.0_f64;
        for (index, term) in self.relaxation.terms() {
            let share = -(-h / term.time_s).exp_m1();
            let mut off2 = 0.0;
            for (to, stress) in relaxed[index].iter_mut().zip(stress) {
                off2 += (stress - *to) * (stress - *to);
                *to += share * (stress - *to);
            }
            largest2 = largest2.max(off2);
        }
        largest2.sqrt() / self.parameters_j.mu
    }

    /// The part of the second Piola stress that relaxes, times the volume, J.
    fn relaxing_j(&self, f: &DMat3) -> [f64; 6] {
        let mu = self.parameters_j.mu;
        let stress = self.law.second_stress(f, LameParameters { mu, lambda: -2.0 / 3.0 * mu });
        [stress.x_axis.x, stress.y_axis.y, stress.z_axis.z, stress.x_axis.y, stress.y_axis.z, stress.z_axis.x]
    }

    /// Σ g H, J.
    #[inline]
    fn relaxed_j(&self, relaxed: &RelaxedStress) -> DMat3 {
        let mut sum = [0.0; 6];
        for (index, term) in self.relaxation.terms() {
            sum.iter_mut().zip(&relaxed[index]).for_each(|(to, h)| *to += term.share * h);
        }
        symmetric_matrix(&sum)
    }

    /// Change of the stored energy by relaxation at the deformation gradient `f`, J: −Σ g (H:E − H:H/(4μ)) with the Green strain E.
    fn relaxed_energy_j(&self, f: &DMat3, relaxed: &RelaxedStress) -> f64 {
        let strain = (f.transpose() * *f - DMat3::IDENTITY) * 0.5;
        let of_term = |(index, term): (usize, crate::PronyTerm)| {
            let h = symmetric_matrix(&relaxed[index]);
            term.share * (inner(&h, &h) / (4.0 * self.parameters_j.mu) - inner(&h, &strain))
        };
        self.relaxation.terms().map(of_term).sum()
    }

    /// Second Piola stress of the damper times the volume, J.
    #[inline]
    pub(crate) fn viscous_j(&self, f: &DMat3, rate_per_s: &DMat3) -> DMat3 {
        let half = f.transpose() * *rate_per_s;
        let LameParameters { mu, lambda } = self.viscous_js;
        let trace = half.x_axis.x + half.y_axis.y + half.z_axis.z;
        mu * (half + half.transpose()) + DMat3::from_diagonal(DVec3::splat(lambda * trace))
    }

    /// Power that the damper dissipates, W.
    pub(crate) fn dissipated_w(&self, f: &DMat3, rate_per_s: &DMat3) -> f64 {
        inner(&(f.transpose() * *rate_per_s), &self.viscous_j(f, rate_per_s))
    }

    /// Derivative of the stress with respect to the rate of the deformation gradient, J s. It is positive semidefinite.
    pub(crate) fn viscous_tangent_js(&self, f: &DMat3) -> StressTangent {
        let LameParameters { mu, lambda } = self.viscous_js;
        let across = *f * f.transpose();
        std::array::from_fn(|c| {
            std::array::from_fn(|d| {
                let shear = if c == d { mu * across } else { DMat3::ZERO };
                shear + mu * outer(f.col(d), f.col(c)) + lambda * outer(f.col(c), f.col(d))
            })
        })
    }

    /// Upper bound of the eigenvalues of [`ElementMaterial::viscous_tangent_js`], J s.
    pub(crate) fn viscous_bound_js(&self, f: &DMat3) -> f64 {
        stretch2_bound(f) * (2.0 * self.viscous_js.mu + 3.0 * self.viscous_js.lambda)
    }
}

/// The symmetric matrix of xx, yy, zz, xy, yz, zx.
fn symmetric_matrix(&[xx, yy, zz, xy, yz, zx]: &[f64; 6]) -> DMat3 {
    DMat3::from_cols(DVec3::new(xx, xy, zx), DVec3::new(xy, yy, yz), DVec3::new(zx, yz, zz))
}
