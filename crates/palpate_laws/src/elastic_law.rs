//! Elastic laws of a continuum: the stress as a function of the deformation gradient.

use crate::LawError;
use crate::singular_values::{SingularValues, cofactor, rotation};
use crate::symmetric::positive_part;
use glam::{DMat3, DVec3};

/// An isotropic elastic law. F is the deformation gradient and P the first Piola stress, the derivative of the energy density W(F).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ElasticLaw {
    /// Linear elasticity in the rotated frame: W = μ |F − R|² + λ/2 tr²(RᵀF − 1), with R the rotation closest to F (M. Müller and
    /// M. Gross, Graphics Interface 2004; the energy is that of A. McAdams et al., ACM Trans. Graph. 30 (2011) 37). Tension and
    /// compression are alike. Where det F < 0, R is still a rotation, and the stress restores the element.
    CorotationalLinear,
    /// Compressible neo-Hookean solid: W = μ/2 (I₁ − 3) − μ ln J + λ/2 (ln J)², with I₁ = |F|² and J = det F (J. Bonet and R. D. Wood,
    /// Nonlinear Continuum Mechanics, section 6.4.3).
    ///
    /// With the singular values σ_i of F, ln J is the sum of ln σ_i. Below σ = 0.25 each logarithm continues with its slope and curvature, and
    /// its slope grows to a limit (the principle of G. Irving, J. Teran and R. Fedkiw, SCA 2004): W is finite for flat and inverted elements,
    /// whose last singular value is negative, and restores them.
    #[default]
    NeoHookean,
}

/// The Lamé parameters of a material: of a volume, in J, or of a unit volume, in Pa.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LameParameters {
    /// Shear modulus μ.
    pub mu: f64,
    /// First Lamé parameter λ.
    pub lambda: f64,
}

impl LameParameters {
    /// Maximum Poisson's ratio. The volume is then almost constant.
    pub const MAX_POISSONS_RATIO: f64 = 0.49;

    /// The parameters, Pa, of a material with Young's modulus `youngs_modulus_pa`: μ = E/(2(1 + ν)), λ = E ν/((1 + ν)(1 − 2ν)).
    ///
    /// # Errors
    /// [`LawError::YoungsModulus`] unless the modulus is finite and above 0; [`LawError::PoissonsRatio`] unless the ratio is from 0 to 0.49.
    pub fn new(youngs_modulus_pa: f64, poissons_ratio: f64) -> Result<Self, LawError> {
        let (e, nu) = (youngs_modulus_pa, poissons_ratio);
        if !(e.is_finite() && e > 0.0) {
            return Err(LawError::YoungsModulus(e));
        }
        if !(0.0..=Self::MAX_POISSONS_RATIO).contains(&nu) {
            return Err(LawError::PoissonsRatio(nu));
        }
        Ok(Self { mu: e / (2.0 * (1.0 + nu)), lambda: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)) })
    }

    /// Both parameters times `factor`.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { mu: factor * self.mu, lambda: factor * self.lambda }
    }

    /// Young's modulus μ (3λ + 2μ)/(λ + μ).
    #[must_use]
    pub fn youngs_modulus(self) -> f64 {
        self.mu * (3.0 * self.lambda + 2.0 * self.mu) / (self.lambda + self.mu)
    }

    /// Bulk modulus λ + 2μ/3.
    #[must_use]
    pub fn bulk(self) -> f64 {
        self.lambda + 2.0 / 3.0 * self.mu
    }
}

/// Derivative of the stress with respect to the deformation gradient: column c of δP is Σ_d `self[c][d]` · column d of δF.
pub type StressTangent = [[DMat3; 3]; 3];

/// Change of the columns of the stress by a node with the gradient `b`: with F = Σ_j x_j ⊗ b_j, δP's column c is `[c]` · δx_j.
#[must_use]
#[inline]
pub fn stress_change(tangent: &StressTangent, b: DVec3) -> [DMat3; 3] {
    tangent.map(|of| b.x * of[0] + b.y * of[1] + b.z * of[2])
}

/// Stiffness between a node with the gradient `b` and the node of a [`stress_change`].
#[must_use]
#[inline]
pub fn stress_block(change: &[DMat3; 3], b: DVec3) -> DMat3 {
    b.x * change[0] + b.y * change[1] + b.z * change[2]
}

/// Stretch below which the neo-Hookean logarithm continues with a limited slope, and the range over which it approaches the limit.
const FLAT: f64 = 0.25;
const TO_LIMIT: f64 = 0.25;
/// Minimum of the sum of two singular values in the derivative of a rotation, which is infinite where they cancel.
const MIN_SUM: f64 = 1e-2;
/// Difference between two stretches below which a difference quotient is a derivative.
const NEARLY_EQUAL: f64 = 1e-6;

impl ElasticLaw {
    /// Energy density W, in units of the parameters.
    #[must_use]
    pub fn energy(self, f: &DMat3, of: LameParameters) -> f64 {
        match self {
            Self::CorotationalLinear => {
                let r = rotation(f);
                let trace = inner(f, &r) - 3.0;
                let strain = *f - r;
                of.mu * inner(&strain, &strain) + 0.5 * of.lambda * trace * trace
            }
            Self::NeoHookean => {
                let size2 = inner(f, f);
                let ln = logarithm_of_volume(f.determinant(), size2)
                    .unwrap_or_else(|| SingularValues::of(f).s.map(|s| logarithm(s).0).iter().sum());
                0.5 * of.mu * (size2 - 3.0) + ln * (0.5 * of.lambda * ln - of.mu)
            }
        }
    }

    /// First Piola stress P, in units of the parameters.
    #[must_use]
    #[inline]
    pub fn stress(self, f: &DMat3, of: LameParameters) -> DMat3 {
        match self {
            Self::CorotationalLinear => {
                let r = rotation(f);
                2.0 * of.mu * (*f - r) + of.lambda * (inner(f, &r) - 3.0) * r
            }
            Self::NeoHookean => {
                let cofactor = cofactor(f);
                let j = f.x_axis.dot(cofactor.x_axis);
                if let Some(ln) = logarithm_of_volume(j, inner(f, f)) {
                    return of.mu * *f + (of.lambda * ln - of.mu) / j * cofactor;
                }
                let SingularValues { u, s, v } = SingularValues::of(f);
                let logarithms = s.map(logarithm);
                let ln: f64 = logarithms.iter().map(|of| of.0).sum();
                let slopes = DVec3::from_array(logarithms.map(|of| of.1));
                of.mu * *f + u * DMat3::from_diagonal((of.lambda * ln - of.mu) * slopes) * v.transpose()
            }
        }
    }

    /// Second Piola stress F⁻¹P, in units of the parameters. Singular values below 0.25 count as 0.25 in the inverse.
    #[must_use]
    pub fn second_stress(self, f: &DMat3, of: LameParameters) -> DMat3 {
        let cofactor = cofactor(f);
        let j = f.x_axis.dot(cofactor.x_axis);
        if logarithm_of_volume(j, inner(f, f)).is_some() {
            // F⁻¹ = cof Fᵀ/J.
            return cofactor.transpose() * self.stress(f, of) * j.recip();
        }
        let SingularValues { u, s, v } = SingularValues::of(f);
        let stress = self.stress(f, of);
        let along = |i: usize| u.col(i).dot(stress * v.col(i)) / s[i].max(FLAT);
        v * DMat3::from_diagonal(DVec3::new(along(0), along(1), along(2))) * v.transpose()
    }

    /// Derivative of the stress, in units of the parameters. With `clamped`, its positive semidefinite part.
    ///
    /// The derivative is diagonal in the directions of the singular values except for three scalings (T. Kim and D. Eberle, Dynamic Deformables,
    /// SIGGRAPH courses 2020).
    #[must_use]
    pub fn tangent(self, f: &DMat3, of: LameParameters, clamped: bool) -> StressTangent {
        let SingularValues { u, s, v } = SingularValues::of(f);
        // The derivatives by two scalings, and of the rotations and shears about each direction.
        let (mut scalings, mut twists, mut flips) = ([[0.0; 3]; 3], [0.0; 3], [0.0; 3]);
        match self {
            Self::CorotationalLinear => {
                let pull = of.lambda * (s.iter().sum::<f64>() - 3.0) - 2.0 * of.mu;
                for i in 0..3 {
                    scalings[i] = [of.lambda; 3];
                    scalings[i][i] += 2.0 * of.mu;
                    flips[i] = 2.0 * of.mu;
                    twists[i] = 2.0 * of.mu + pull * over_sum(2.0, s[(i + 1) % 3] + s[(i + 2) % 3]);
                }
            }
            Self::NeoHookean => {
                let logarithms = s.map(logarithm);
                let pull = of.lambda * logarithms.iter().map(|of| of.0).sum::<f64>() - of.mu;
                for i in 0..3 {
                    let (_, slope, curvature) = logarithms[i];
                    for j in 0..3 {
                        let own = if i == j { of.mu + pull * curvature } else { 0.0 };
                        scalings[i][j] = of.lambda * slope * logarithms[j].1 + own;
                    }
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    let (a, b) = (logarithms[j].1, logarithms[k].1);
                    twists[i] = of.mu + pull * over_sum(a + b, s[j] + s[k]);
                    flips[i] = of.mu + pull * slope_of_slope(s[j], s[k]);
                }
            }
        }
        if clamped {
            scalings = positive_part(scalings);
            twists.iter_mut().chain(&mut flips).for_each(|value| *value = value.max(0.0));
        }
        let mut tangent = [[DMat3::ZERO; 3]; 3];
        let mut add = |value: f64, a: &DMat3, b: &DMat3| {
            for (c, blocks) in tangent.iter_mut().enumerate() {
                for (d, block) in blocks.iter_mut().enumerate() {
                    *block += outer(value * a.col(c), b.col(d));
                }
            }
        };
        let along = [0, 1, 2].map(|i| outer(u.col(i), v.col(i)));
        for i in 0..3 {
            for j in 0..3 {
                add(scalings[i][j], &along[i], &along[j]);
            }
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (jk, kj) = (outer(u.col(j), v.col(k)), outer(u.col(k), v.col(j)));
            let (twist, flip) = (jk - kj, jk + kj);
            add(0.5 * twists[i], &twist, &twist);
            add(0.5 * flips[i], &flip, &flip);
        }
        tangent
    }

    /// An upper bound of the eigenvalues of the derivative of the stress, in units of the parameters.
    #[must_use]
    pub fn stiffness_bound(self, f: &DMat3, of: LameParameters) -> f64 {
        match self {
            Self::CorotationalLinear => {
                let linear = 2.0 * of.mu + 3.0 * of.lambda;
                let s = SingularValues::of(f).s;
                let pull = of.lambda * (s.iter().sum::<f64>() - 3.0) - 2.0 * of.mu;
                linear.max(2.0 * of.mu + pull * over_sum(2.0, s[1] + s[2]))
            }
            Self::NeoHookean => {
                let cofactor = cofactor(f);
                let j = f.x_axis.dot(cofactor.x_axis);
                if let Some(ln) = logarithm_of_volume(j, inner(f, f)) {
                    let (slope, curvature) = ((of.lambda * ln - of.mu) / j, of.lambda * (1.0 - ln) + of.mu);
                    return of.mu
                        + slope.abs() * stretch2_bound(f).sqrt()
                        + curvature.max(0.0) / (j * j) * inner(&cofactor, &cofactor);
                }
                let s = SingularValues::of(f).s;
                let logarithms = s.map(logarithm);
                let pull = of.lambda * logarithms.iter().map(|of| of.0).sum::<f64>() - of.mu;
                let slopes2: f64 = logarithms.iter().map(|of| of.1 * of.1).sum();
                let curvature = logarithms.iter().map(|of| (pull * of.2).max(0.0)).fold(0.0, f64::max);
                let mut most = of.lambda * slopes2 + curvature;
                for (j, k) in [(0, 1), (1, 2), (0, 2)] {
                    most = most.max(pull * slope_of_slope(s[j], s[k]));
                    most = most.max(pull * over_sum(logarithms[j].1 + logarithms[k].1, s[j] + s[k]));
                }
                of.mu + most
            }
        }
    }
}

/// ln J if no singular value is below [`FLAT`]: the smallest is at least 2 J/|F|², because the product of the others is at most half the sum of
/// their squares.
#[inline]
fn logarithm_of_volume(j: f64, size2: f64) -> Option<f64> {
    (2.0 * j >= FLAT * size2).then(|| j.ln())
}

/// ln σ with its continuation, and its first and second derivative.
fn logarithm(s: f64) -> (f64, f64, f64) {
    // NaN stays NaN.
    if s >= FLAT || s.is_nan() {
        return (s.ln(), s.recip(), -(s * s).recip());
    }
    let (depth, share) = (FLAT - s, TO_LIMIT / (TO_LIMIT + FLAT - s));
    let (slope, curvature) = (FLAT.recip(), FLAT.powi(-2));
    let beyond = TO_LIMIT * (depth - TO_LIMIT * (depth / TO_LIMIT).ln_1p());
    (
        FLAT.ln() - slope * depth - curvature * beyond,
        slope + curvature * depth * share,
        -curvature * share * share,
    )
}

/// The difference quotient of the slope of [`logarithm`] between two stretches.
fn slope_of_slope(a: f64, b: f64) -> f64 {
    if a >= FLAT && b >= FLAT {
        return -(a * b).recip();
    }
    if (a - b).abs() > NEARLY_EQUAL {
        (logarithm(a).1 - logarithm(b).1) / (a - b)
    } else {
        logarithm(0.5 * (a + b)).2
    }
}

/// value/sum for the derivative of a rotation, which is infinite where two singular values cancel.
fn over_sum(value: f64, sum: f64) -> f64 {
    value / sum.max(MIN_SUM)
}

/// An upper bound of the square of the largest singular value.
pub(crate) fn stretch2_bound(f: &DMat3) -> f64 {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    let (ab, bc, ca) = (a.dot(b).abs(), b.dot(c).abs(), c.dot(a).abs());
    (a.length_squared() + ab + ca).max(b.length_squared() + ab + bc).max(c.length_squared() + bc + ca)
}

/// Σ a_ij b_ij.
#[inline]
pub(crate) fn inner(a: &DMat3, b: &DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

#[inline]
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests;
