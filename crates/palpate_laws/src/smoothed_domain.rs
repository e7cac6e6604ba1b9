//! Smoothed domains: parts of a mesh of tetrahedra with one deformation gradient.

use crate::elastic_law::inner;
use crate::{ElementMaterial, LameParameters, RelaxedStress, StressTangent};
use glam::{DMat3, DVec3};

/// Stabilization α at Poisson's ratio 0, and how much it falls with the ratio. With the least squares of both, cantilevers with three cells across
/// deviate by less than 3 % from converged solutions.
const STABILIZATION: f64 = 0.44;
const STABILIZATION_PER_RATIO: f64 = 0.32;
/// Volume ratio of a tetrahedron below which the volume stiffness around it is not in full force.
const UPRIGHT: f64 = 0.1;

/// A smoothed domain of a mesh of four-node tetrahedra: its material, with the deformation gradient F = Σ_i x_i ⊗ b_i over its nodes.
///
/// # Method
///
/// A linear tetrahedron alone is far too stiff where it is bent or where the volume is nearly constant. Here the law acts on the mean deformation
/// gradient F_n of the tetrahedra around each node n, and a small part of the stiffness acts on the deviation of each tetrahedron e from it
/// (stabilized nodal integration: M. A. Puso and J. Solberg, Int. J. Numer. Methods Eng. 67 (2006) 841; averaged nodal deformation gradients: J.
/// Bonet, H. Marriott and O. Hassan, Commun. Numer. Methods Eng. 17 (2001) 551):
///
/// ```text
/// Σ_n V_n W(F_n) + ½ Σ_n Σ_e α μ (V_e/4) |F_e − F_n|²          (e: the tetrahedra around node n, V_n = Σ_e V_e/4)
///   = Σ_n [V_n W(F_n) − ½ α μ V_n |F_n|²] + Σ_e ½ α μ V_e |F_e|²
/// ```
///
/// The second form is evaluated: one domain of each node, with a negative part of |F|², and one of each tetrahedron, with the positive part. The
/// stabilization is zero for affine deformations and does not change with rotation. It is constant, convex, and no part of λ, so nothing locks as
/// ν approaches 1/2. α is 0.44 − 0.32 ν. The viscous stress acts in the tetrahedra.
///
/// The means can be upright while tetrahedra are inverted. A large λ would keep such folds. So near a tetrahedron that is nearly flat or inverted, λ
/// is at most μ ([`DomainMaterial::with_volume_share`]). The share counts as constant in the forces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DomainMaterial {
    /// Law, parameters, damping and relaxation.
    pub material: ElementMaterial,
    /// Coefficient s of the energy ½ s (|F|² − 3), J.
    pub gradient_j: f64,
}

impl DomainMaterial {
    /// The domain of a node: the law of `material` less the stabilization. Without the damper.
    #[must_use]
    pub fn of_node(material: ElementMaterial) -> Self {
        let gradient_j = -stabilization_j(&material);
        Self { material: ElementMaterial { viscous_js: LameParameters::default(), ..material }, gradient_j }
    }

    /// The domain of a tetrahedron of `material`: the stabilization and the damper.
    #[must_use]
    pub fn of_tetrahedron(material: ElementMaterial) -> Self {
        let ElementMaterial { law, viscous_js, .. } = material;
        let material_without_law = ElementMaterial { law, viscous_js, ..ElementMaterial::default() };
        Self { material: material_without_law, gradient_j: stabilization_j(&material) }
    }

    /// The share of the volume stiffness that is in force around a tetrahedron with the volume ratio `ratio`: 1 from a ratio of 0.1 on, 0 if it is
    /// inverted.
    #[must_use]
    pub fn volume_share(ratio: f64) -> f64 {
        let t = (ratio / UPRIGHT).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }

    /// The material with the share `share` of the part of λ that exceeds μ.
    #[must_use]
    pub fn with_volume_share(mut self, share: f64) -> Self {
        let LameParameters { mu, lambda } = self.material.parameters_j;
        self.material.parameters_j.lambda = lambda - (1.0 - share) * (lambda - mu).max(0.0);
        self
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.material.is_finite() && self.gradient_j.is_finite()
    }

    /// Stress times the volume at the deformation gradient `f`, J. `rate_per_s`, the rate of the gradient, is evaluated only with a damper. The
    /// force on node i is minus the stress times b_i.
    #[must_use]
    #[inline]
    pub fn stress_j(&self, f: &DMat3, rate_per_s: impl FnOnce() -> DMat3, relaxed: &RelaxedStress) -> DMat3 {
        let mut stress_j = self.gradient_j * *f;
        if self.material.is_elastic() {
            stress_j += self.material.elastic_stress_j(f, relaxed);
        }
        if self.material.is_damped() {
            stress_j += *f * self.material.viscous_j(f, &rate_per_s());
        }
        stress_j
    }

    /// Energy, J. Of single domains it may be negative; the sum over a mesh is not.
    #[must_use]
    pub fn energy_j(&self, f: &DMat3, relaxed: &RelaxedStress) -> f64 {
        let of_law =
            if self.material.is_elastic() { self.material.elastic_energy_j(f, relaxed) } else { 0.0 };
        of_law + 0.5 * self.gradient_j * (inner(f, f) - 3.0)
    }

    /// Power that the damper dissipates, W.
    #[must_use]
    pub fn dissipated_w(&self, f: &DMat3, rate_per_s: &DMat3) -> f64 {
        if self.material.is_damped() { self.material.dissipated_w(f, rate_per_s) } else { 0.0 }
    }

    /// Derivative of the stress at constant relaxed stress, J. With `clamped`, the part of the law is positive semidefinite, and so is the sum over
    /// a mesh.
    #[must_use]
    pub fn tangent_j(&self, f: &DMat3, relaxed: &RelaxedStress, clamped: bool) -> StressTangent {
        let mut tangent = if self.material.is_elastic() {
            self.material.elastic_tangent_j(f, relaxed, clamped)
        } else {
            [[DMat3::ZERO; 3]; 3]
        };
        for (c, blocks) in tangent.iter_mut().enumerate() {
            blocks[c] += DMat3::from_diagonal(DVec3::splat(self.gradient_j));
        }
        tangent
    }

    /// Derivative of the stress by the rate of the deformation gradient, J s; `None` without a damper.
    #[must_use]
    pub fn viscous_tangent_js(&self, f: &DMat3) -> Option<StressTangent> {
        self.material.is_damped().then(|| self.material.viscous_tangent_js(f))
    }

    /// Upper bounds of the eigenvalues of both derivatives of the stress, J and J s. With a node's gradient b_i, a node has at most the share
    /// |b_i| Σ_j |b_j| of them: |Σ_j b_j ⊗ x_j|² ≤ Σ_j |b_j| · Σ_i |b_i| |x_i|².
    #[must_use]
    pub fn bounds_j(&self, f: &DMat3) -> (f64, f64) {
        let law = if self.material.is_elastic() {
            self.material.law.stiffness_bound(f, self.material.parameters_j)
        } else {
            0.0
        };
        let viscous = if self.material.is_damped() { self.material.viscous_bound_js(f) } else { 0.0 };
        ((law + self.gradient_j).max(0.0), viscous)
    }

    /// Advances the relaxed stress by `h` seconds at the constant deformation gradient `f`. Returns the largest part that had not relaxed, over
    /// the shear modulus: a strain.
    pub fn relax(&self, f: &DMat3, relaxed: &mut RelaxedStress, h: f64) -> f64 {
        if self.material.relaxes() { self.material.relax(f, relaxed, h) } else { 0.0 }
    }
}

/// α μ V of the relaxed material, J.
fn stabilization_j(material: &ElementMaterial) -> f64 {
    let LameParameters { mu, lambda } = material.parameters_j;
    // ν = λ/(2 (λ + μ)).
    let ratio = if mu > 0.0 { 0.5 * lambda / (lambda + mu) } else { 0.0 };
    (STABILIZATION - STABILIZATION_PER_RATIO * ratio) * material.relaxed_mu_j()
}

/// Gradient Σ_i x_i ⊗ b_i of `values` at the nodes of a domain with `gradients_per_m`.
#[must_use]
#[inline]
pub fn domain_gradient(gradients_per_m: &[DVec3], values: impl Iterator<Item = DVec3>) -> DMat3 {
    let mut f = DMat3::ZERO;
    for (x, b) in values.zip(gradients_per_m) {
        f.x_axis += b.x * x;
        f.y_axis += b.y * x;
        f.z_axis += b.z * x;
    }
    f
}

#[cfg(test)]
mod tests;
