//! The eight-node hexahedron with one integration point and hourglass stiffness.

use crate::elastic_law::{outer, stretch2_bound};
use crate::symmetric::eigenvectors;
use crate::{ElementMaterial, RelaxedStress, StressTangent, stress_block, stress_change};
use glam::{DMat3, DVec3};

/// Number of corners.
const CORNERS: usize = 8;
/// Modes of the corners by number, besides the mean: those linear in the coordinates, and the four hourglass modes.
const MODES: usize = 7;
const HOURGLASSES: [usize; 4] = [3, 5, 6, 7];
/// Factor of the hourglass stiffness: with 10/9 of the energy of a fully integrated element, bending and bonded blocks of 16 cells deviate
/// from converged solutions by less than 1 %.
const HOURGLASS: f64 = 10.0 / 9.0;
/// Relative difference below which two shapes are the same.
const SAME_SHAPE: f64 = 1e-10;

/// The shape at rest of an eight-node hexahedron. Corner c lies towards +ξ where bit 0 of c is set, +η with bit 1, +ζ with bit 2.
///
/// # Method
///
/// The values of the eight corners are the sum of eight modes h_m(c) = ±1: the mean, three linear modes ξ, η, ζ, and four hourglass modes ξη,
/// ξζ, ηζ, ξηζ. With x̂_m = Σ_c h_m(c) x_c, the mean deformation gradient over the element is F = Σ_m x̂_m ⊗ c_m, with the exact integral of the
/// gradient (D. P. Flanagan and T. Belytschko, Int. J. Numer. Methods Eng. 17 (1981) 679). The energy is
///
/// ```text
/// V W(F) + ½ Σ_m k_m |q_m|²          (m: the hourglass modes, X̂: at rest)
/// ```
///
/// with q_m = x̂_m − F X̂_m in the second term. It is zero for every affine deformation, and does not change with rotation. k_m is 10/9 of the stiffness of the mode in a
/// fully integrated element whose energy density is ½ μ |∇u|². It has no part in λ, so the element does not lock as ν approaches 1/2. The damper of an hourglass
/// acts on the rate of Fᵀq_m, which does not change with rotation either.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HexahedronShape {
    /// c_m, 1/m.
    gradient_per_m: [DVec3; MODES],
    /// X̂_m of the hourglass modes, m; zero for a parallelepiped.
    rest_m: [DVec3; HOURGLASSES.len()],
    /// k_m/(μ V), 1/m².
    hourglass_per_m2: [f64; HOURGLASSES.len()],
    /// Volume, m³.
    volume_m3: f64,
    /// Bounds of the eigenvalues of Σ_c b_c ⊗ b_c, with the gradient b_c of corner c, and of the hourglass stiffness over μ V, 1/m².
    gradient_bound_per_m2: f64,
    hourglass_bound_per_m2: f64,
}

impl Default for HexahedronShape {
    /// A cube with sides of 1 m.
    fn default() -> Self {
        let corners =
            std::array::from_fn(|c| DVec3::from_array([0, 1, 2].map(|axis| (c >> axis & 1) as f64)));
        Self::new(&corners).unwrap_or(Self {
            gradient_per_m: [DVec3::ZERO; MODES],
            rest_m: [DVec3::ZERO; HOURGLASSES.len()],
            hourglass_per_m2: [0.0; HOURGLASSES.len()],
            volume_m3: 0.0,
            gradient_bound_per_m2: 0.0,
            hourglass_bound_per_m2: 0.0,
        })
    }
}

/// Stiffness or damping between the corners of a hexahedron in 3 × 3 blocks, by rows.
pub type HexahedronBlocks = [[DMat3; CORNERS]; CORNERS];

impl HexahedronShape {
    /// Creates the shape with the corners `rest_m` at rest, m. `None` unless the corners are finite and the Jacobian is positive at the 2 × 2 × 2
    /// Gauss points.
    #[must_use]
    pub fn new(rest_m: &[DVec3; CORNERS]) -> Option<Self> {
        const GAUSS: f64 = 0.577_350_269_189_625_8;
        let modes = to_modes(rest_m);
        // x(ξ) = Σ_m modes[m] ξ^m / 8.
        let jacobian = |[xi, eta, zeta]: [f64; 3]| {
            let [_, x, y, xy, z, xz, yz, xyz] = modes;
            DMat3::from_cols(
                x + eta * xy + zeta * xz + eta * zeta * xyz,
                y + xi * xy + zeta * yz + xi * zeta * xyz,
                z + xi * xz + eta * yz + xi * eta * xyz,
            ) * 0.125
        };
        let (mut volume_m3, mut gradients) = (0.0, [DVec3::ZERO; MODES]);
        for point in 0..CORNERS {
            let place = [0, 1, 2].map(|axis| if point >> axis & 1 == 1 { GAUSS } else { -GAUSS });
            let j = jacobian(place);
            let determinant = j.determinant();
            if !(determinant > 0.0 && determinant.is_finite()) {
                return None;
            }
            volume_m3 += determinant;
            // ∫ ∂N/∂x dV = ∫ cof(∂x/∂ξ) ∂N/∂ξ dξ, mode by mode: the shape function of corner c is Σ_m h_m(c) ξ^m / 8.
            let cofactor = crate::singular_values::cofactor(&j);
            for (mode, to) in (1..).zip(&mut gradients) {
                let slope = |axis: usize| {
                    let others = (0..3).filter(|other| *other != axis && mode >> other & 1 == 1);
                    if mode >> axis & 1 == 1 { others.map(|other| place[other]).product() } else { 0.0 }
                };
                *to += cofactor * (DVec3::new(slope(0), slope(1), slope(2)) * 0.125);
            }
        }
        let gradient_per_m = gradients.map(|sum| sum / volume_m3);
        let rest = HOURGLASSES.map(|mode| modes[mode]);
        let at_center = jacobian([0.0; 3]);
        if at_center.determinant() <= 0.0 {
            return None;
        }
        // The energy of a mode ξ^m in ½ μ |∇u|², integrated exactly over a parallelepiped.
        let inverse = at_center.inverse();
        let slope2 = [0, 1, 2].map(|axis| inverse.row(axis).length_squared());
        let hourglass_per_m2 = HOURGLASSES.map(|mode| {
            let axes = || (0..3).filter(|axis| mode >> axis & 1 == 1);
            let others = axes().count() as i32 - 1;
            HOURGLASS * axes().map(|axis| slope2[axis]).sum::<f64>() / 3.0_f64.powi(others) / 64.0
        });
        let mut shape = Self {
            gradient_per_m,
            rest_m: rest,
            hourglass_per_m2,
            volume_m3,
            gradient_bound_per_m2: 0.0,
            hourglass_bound_per_m2: 0.0,
        };
        shape.set_bounds();
        let finite = volume_m3.is_finite() && hourglass_per_m2.iter().all(|k| k.is_finite());
        (finite && gradient_per_m.iter().all(|c| c.is_finite())).then_some(shape)
    }

    fn set_bounds(&mut self) {
        let (gradients, hourglasses) = (self.corner_gradients_per_m(), self.corner_hourglasses());
        let sum: DMat3 = gradients.iter().map(|b| outer(*b, *b)).sum();
        self.gradient_bound_per_m2 = largest(sum.to_cols_array_2d());
        // The nonzero eigenvalues of Σ k γ ⊗ γ are those of the matrix √k_m √k_n γ_m·γ_n.
        let root = self.hourglass_per_m2.map(f64::sqrt);
        let product = |m: usize, n: usize| -> f64 {
            (0..CORNERS).map(|c| root[m] * hourglasses[c][m] * root[n] * hourglasses[c][n]).sum()
        };
        let products: [[f64; HOURGLASSES.len()]; HOURGLASSES.len()] =
            std::array::from_fn(|m| std::array::from_fn(|n| product(m, n)));
        self.hourglass_bound_per_m2 = largest(products);
    }

    /// The shape rotated by `rotation`.
    #[must_use]
    pub fn rotated(&self, rotation: DMat3) -> Self {
        Self {
            gradient_per_m: self.gradient_per_m.map(|c| rotation * c),
            rest_m: self.rest_m.map(|x| rotation * x),
            ..*self
        }
    }

    /// Whether the shape differs from another one by rounding only.
    #[must_use]
    pub fn is_nearly(&self, other: &Self) -> bool {
        let (c, x) = (self.gradient_per_m, self.rest_m);
        let size_per_m = c.iter().map(|c| c.length()).fold(0.0, f64::max);
        let is_near = |a: &DVec3, b: &DVec3, size: f64| a.distance(*b) <= SAME_SHAPE * size;
        c.iter().zip(&other.gradient_per_m).all(|(a, b)| is_near(a, b, size_per_m))
            && x.iter().zip(&other.rest_m).all(|(a, b)| is_near(a, b, size_per_m.recip()))
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.gradient_per_m.iter().chain(&self.rest_m).all(|v| v.is_finite())
            && self.hourglass_per_m2.iter().all(|k| k.is_finite())
    }

    /// Volume at rest, m³.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Gradient b_c of the mean deformation by each corner, 1/m: F = Σ_c x_c ⊗ b_c.
    #[must_use]
    pub fn corner_gradients_per_m(&self) -> [DVec3; CORNERS] {
        let mut modes = [DVec3::ZERO; CORNERS];
        modes[1..].copy_from_slice(&self.gradient_per_m);
        to_corners(&modes)
    }

    /// Coefficients γ_m(c) of the hourglass modes, corner by corner: x̂_m − F X̂_m = Σ_c γ_m(c) x_c.
    fn corner_hourglasses(&self) -> [[f64; HOURGLASSES.len()]; CORNERS] {
        let gradients = self.corner_gradients_per_m();
        std::array::from_fn(|c| {
            std::array::from_fn(|m| sign(HOURGLASSES[m], c) - self.rest_m[m].dot(gradients[c]))
        })
    }

    /// Mean deformation gradient F with the corners at `x_m`, m.
    #[must_use]
    pub fn deformation_gradient(&self, x_m: &[DVec3; CORNERS]) -> DMat3 {
        self.gradient(&to_modes(x_m))
    }

    #[inline]
    fn gradient(&self, modes: &[DVec3; CORNERS]) -> DMat3 {
        let mut f = DMat3::ZERO;
        for (x, c) in modes.iter().skip(1).zip(&self.gradient_per_m) {
            f.x_axis += c.x * *x;
            f.y_axis += c.y * *x;
            f.z_axis += c.z * *x;
        }
        f
    }

    /// x̂_m − F X̂_m of the hourglass modes.
    #[inline]
    fn hourglasses(&self, modes: &[DVec3; CORNERS], f: &DMat3) -> [DVec3; HOURGLASSES.len()] {
        std::array::from_fn(|m| modes[HOURGLASSES[m]] - *f * self.rest_m[m])
    }

    /// Advances H of a material that relaxes by `h` seconds at constant corners `x_m`, m. Returns the largest |S − H|/μ before: a strain.
    pub fn relax(
        &self,
        x_m: &[DVec3; CORNERS],
        material: &ElementMaterial,
        relaxed: &mut RelaxedStress,
        h: f64,
    ) -> f64 {
        material.relax(&self.deformation_gradient(x_m), relaxed, h)
    }

    /// Forces on the corners, N, with the corners at `x_m`, m, that move at `v_m_per_s`, and H of a material that relaxes.
    #[must_use]
    #[inline]
    pub fn forces_n(
        &self,
        x_m: &[DVec3; CORNERS],
        v_m_per_s: &[DVec3; CORNERS],
        material: &ElementMaterial,
        relaxed: &RelaxedStress,
    ) -> [DVec3; CORNERS] {
        let modes = to_modes(x_m);
        let f = self.gradient(&modes);
        // Then the forces over k_m/(μ V).
        let mut hourglasses = self.hourglasses(&modes, &f);
        let mut stress_j = material.elastic_stress_j(&f, relaxed);
        if material.is_damped() {
            let rates = to_modes(v_m_per_s);
            let rate = self.gradient(&rates);
            stress_j += f * material.viscous_j(&f, &rate);
            let of_rates = self.hourglasses(&rates, &rate);
            for ((q, q_dot), k) in hourglasses.iter_mut().zip(of_rates).zip(&self.hourglass_per_m2) {
                let w = material.viscous_js.mu * local_rate(&f, &rate, *q, q_dot);
                stress_j += outer(k * *q, w);
                *q = material.relaxed_mu_j() * *q + f * w;
            }
        } else {
            hourglasses.iter_mut().for_each(|q| *q *= material.relaxed_mu_j());
        }
        let mut on_modes = [DVec3::ZERO; CORNERS];
        for (m, force) in hourglasses.into_iter().enumerate() {
            let force = self.hourglass_per_m2[m] * force;
            stress_j -= outer(force, self.rest_m[m]);
            on_modes[HOURGLASSES[m]] = -force;
        }
        for (to, c) in on_modes.iter_mut().skip(1).zip(&self.gradient_per_m) {
            *to -= stress_j * *c;
        }
        to_corners(&on_modes)
    }

    /// Elastic energy, J.
    #[must_use]
    pub fn energy_j(
        &self,
        x_m: &[DVec3; CORNERS],
        material: &ElementMaterial,
        relaxed: &RelaxedStress,
    ) -> f64 {
        let modes = to_modes(x_m);
        let f = self.gradient(&modes);
        material.elastic_energy_j(&f, relaxed)
            + 0.5 * self.hourglass_squares(&modes, &f) * material.relaxed_mu_j()
    }

    /// Power that the damper dissipates, W.
    #[must_use]
    pub fn dissipated_w(
        &self,
        x_m: &[DVec3; CORNERS],
        v_m_per_s: &[DVec3; CORNERS],
        material: &ElementMaterial,
    ) -> f64 {
        if !material.is_damped() {
            return 0.0;
        }
        let (modes, rates) = (to_modes(x_m), to_modes(v_m_per_s));
        let (f, rate) = (self.gradient(&modes), self.gradient(&rates));
        let (q, q_dot) = (self.hourglasses(&modes, &f), self.hourglasses(&rates, &rate));
        let squares = q.iter().zip(q_dot).zip(&self.hourglass_per_m2);
        let squares = squares.map(|((q, q_dot), k)| k * local_rate(&f, &rate, *q, q_dot).length_squared());
        material.dissipated_w(&f, &rate) + material.viscous_js.mu * squares.sum::<f64>()
    }

    /// Σ k_m/(μ V) |x̂_m − F X̂_m|².
    fn hourglass_squares(&self, modes: &[DVec3; CORNERS], f: &DMat3) -> f64 {
        let q = self.hourglasses(modes, f);
        q.iter().zip(&self.hourglass_per_m2).map(|(q, k)| q.length_squared() * k).sum()
    }

    /// Stiffness, N/m, at constant H: entry \[i\]\[j\] is minus the derivative of the force on corner i by corner j. With `clamped` it is
    /// positive semidefinite.
    #[must_use]
    pub fn stiffness_n_per_m(
        &self,
        x_m: &[DVec3; CORNERS],
        material: &ElementMaterial,
        relaxed: &RelaxedStress,
        clamped: bool,
    ) -> HexahedronBlocks {
        let f = self.deformation_gradient(x_m);
        let tangent = material.elastic_tangent_j(&f, relaxed, clamped);
        self.blocks(&tangent, material.relaxed_mu_j())
    }

    /// Damping, N s/m: entry \[i\]\[j\] is minus the derivative of the force on corner i by the velocity of corner j.
    #[must_use]
    pub fn damping_ns_per_m(&self, x_m: &[DVec3; CORNERS], material: &ElementMaterial) -> HexahedronBlocks {
        let modes = to_modes(x_m);
        let f = self.gradient(&modes);
        let mut blocks = self.blocks(&material.viscous_tangent_js(&f), 0.0);
        let (gradients, coefficients) = (self.corner_gradients_per_m(), self.corner_hourglasses());
        let hourglasses = self.hourglasses(&modes, &f).into_iter().zip(&self.hourglass_per_m2);
        for (m, (q, k)) in hourglasses.enumerate() {
            let by_corner: [DMat3; CORNERS] =
                std::array::from_fn(|c| outer(gradients[c], q) + coefficients[c][m] * f.transpose());
            let b = material.viscous_js.mu * k;
            for (row, of_row) in blocks.iter_mut().zip(&by_corner) {
                let of_row = b * of_row.transpose();
                row.iter_mut().zip(&by_corner).for_each(|(block, of_column)| *block += of_row * *of_column);
            }
        }
        blocks
    }

    /// Blocks for a derivative of the stress, and the factor `mu` of the hourglass stiffness.
    fn blocks(&self, tangent: &StressTangent, mu: f64) -> HexahedronBlocks {
        let (gradients, hourglasses) = (self.corner_gradients_per_m(), self.corner_hourglasses());
        let mut blocks = [[DMat3::ZERO; CORNERS]; CORNERS];
        for j in 0..CORNERS {
            let b = gradients[j];
            let stress = stress_change(tangent, b);
            for i in 0..=j {
                let b = gradients[i];
                let hourglass: f64 = (0..HOURGLASSES.len())
                    .map(|m| self.hourglass_per_m2[m] * hourglasses[i][m] * hourglasses[j][m])
                    .sum();
                let block = stress_block(&stress, b) + DMat3::from_diagonal(DVec3::splat(mu * hourglass));
                blocks[i][j] = block;
                blocks[j][i] = block.transpose();
            }
        }
        blocks
    }

    /// Upper bounds of the largest eigenvalues of stiffness, N/m, and damping, N s/m.
    #[must_use]
    pub fn bounds(&self, x_m: &[DVec3; CORNERS], material: &ElementMaterial) -> (f64, f64) {
        let modes = to_modes(x_m);
        let (f, of) = (self.gradient(&modes), material.parameters_j);
        let bound = |gradient: f64, mu: f64| {
            let (of_gradient, of_hourglass) =
                (self.gradient_bound_per_m2 * gradient, self.hourglass_bound_per_m2 * mu);
            // The hourglass modes of a parallelepiped are orthogonal to its gradients.
            if self.rest_m == [DVec3::ZERO; HOURGLASSES.len()] {
                of_gradient.max(of_hourglass)
            } else {
                of_gradient + of_hourglass
            }
        };
        let stiffness = bound(material.law.stiffness_bound(&f, of), of.mu);
        if !material.is_damped() {
            return (stiffness, 0.0);
        }
        let (stretch2, of) = (stretch2_bound(&f), material.viscous_js);
        let squares = self.hourglass_squares(&modes, &f);
        let viscous = material.viscous_bound_js(&f);
        // |Σ_c (b_c ⊗ q + γ(c) Fᵀ) v_c|² ≤ 2 |q|² |Σ_c b_c ⊗ v_c|² + 2 |F|² |Σ_c γ(c) v_c|²; without q the factor is 1.
        let factor = if squares > 0.0 { 2.0 } else { 1.0 };
        (stiffness, bound(viscous + 2.0 * squares * of.mu, factor * stretch2 * of.mu))
    }
}

/// The rate of Fᵀq, which does not change with rotation, for an hourglass q.
#[inline]
fn local_rate(f: &DMat3, f_dot: &DMat3, q: DVec3, q_dot: DVec3) -> DVec3 {
    f_dot.transpose() * q + f.transpose() * q_dot
}

/// h_m(c), ±1.
fn sign(mode: usize, corner: usize) -> f64 {
    // Negative where an odd number of the mode's coordinates is.
    if (mode & !corner).count_ones() % 2 == 1 { -1.0 } else { 1.0 }
}

/// Σ_c h_m(c) x_c for every mode m.
#[inline]
fn to_modes(x: &[DVec3; CORNERS]) -> [DVec3; CORNERS] {
    let [a, b, c, d, e, f, g, h] = *x;
    let [a, b, c, d, e, f, g, h] = [a + b, b - a, c + d, d - c, e + f, f - e, g + h, h - g];
    let [a, b, c, d, e, f, g, h] = [a + c, b + d, c - a, d - b, e + g, f + h, g - e, h - f];
    [a + e, b + f, c + g, d + h, e - a, f - b, g - c, h - d]
}

/// Σ_m h_m(c) x_m for every corner c.
#[inline]
fn to_corners(x: &[DVec3; CORNERS]) -> [DVec3; CORNERS] {
    let [a, b, c, d, e, f, g, h] = *x;
    let [a, b, c, d, e, f, g, h] = [a - b, a + b, c - d, c + d, e - f, e + f, g - h, g + h];
    let [a, b, c, d, e, f, g, h] = [a - c, b - d, a + c, b + d, e - g, f - h, e + g, f + h];
    [a - e, b - f, c - g, d - h, a + e, b + f, c + g, d + h]
}

/// The largest eigenvalue of a symmetric matrix.
fn largest<const N: usize>(matrix: [[f64; N]; N]) -> f64 {
    eigenvectors(matrix).0.into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
