//! Singular values and the rotation of a 3 × 3 matrix.

use crate::symmetric::rotation_angle;
use glam::{DMat3, DVec3};

/// The decomposition F = U diag(s) Vᵀ with the rotations U and V. The values descend in size; the last one is negative where det F is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SingularValues {
    pub(crate) u: DMat3,
    pub(crate) s: [f64; 3],
    pub(crate) v: DMat3,
}

/// Maximum number of sweeps; five or six are usual.
const MAX_SWEEPS: usize = 20;
/// Cosine between two columns that counts as zero.
const ORTHOGONAL: f64 = 1e-16;

impl SingularValues {
    /// Decomposes `f` by one-sided Jacobi rotations (M. R. Hestenes, J. SIAM 6 (1958) 51).
    pub(crate) fn of(f: &DMat3) -> Self {
        let (mut a, mut v) = ([f.x_axis, f.y_axis, f.z_axis], DVec3::AXES);
        for _ in 0..MAX_SWEEPS {
            let mut is_orthogonal = true;
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                let (pp, pq, qq) = (a[p].length_squared(), a[p].dot(a[q]), a[q].length_squared());
                // A matrix that is not finite is left as it is.
                if pq.is_nan() || pq.abs() <= ORTHOGONAL * (pp * qq).sqrt() {
                    continue;
                }
                is_orthogonal = false;
                let (c, s) = rotation_angle(pp, pq, qq);
                for columns in [&mut a, &mut v] {
                    (columns[p], columns[q]) =
                        (c * columns[p] - s * columns[q], s * columns[p] + c * columns[q]);
                }
            }
            if is_orthogonal {
                break;
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|i, j| a[*j].length_squared().total_cmp(&a[*i].length_squared()));
        let [i, j, _] = order;
        // The third directions follow from the other two: both matrices are rotations.
        let v = DMat3::from_cols(v[i], v[j], v[i].cross(v[j]));
        let first = a[i].try_normalize().unwrap_or(DVec3::X);
        let across = a[j] - a[j].dot(first) * first;
        let second = across.try_normalize().unwrap_or_else(|| first.any_orthonormal_vector());
        let third = first.cross(second);
        let s = [first.dot(*f * v.x_axis), second.dot(*f * v.y_axis), third.dot(*f * v.z_axis)];
        Self { u: DMat3::from_cols(first, second, third), s, v }
    }

    /// The rotation U Vᵀ, the closest one to the matrix.
    pub(crate) fn rotation(&self) -> DMat3 {
        self.u * self.v.transpose()
    }
}

/// The cofactor matrix, the derivative of the determinant.
#[inline]
pub(crate) fn cofactor(f: &DMat3) -> DMat3 {
    let [a, b, c] = [f.x_axis, f.y_axis, f.z_axis];
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

/// Determinant, relative to the cube of the norm, below which the iteration for the rotation is not used.
const FLAT: f64 = 1e-3;
/// Maximum number of iterations; six are usual.
const MAX_ITERATIONS: usize = 30;
/// Square of the last change after which the rotation is exact up to rounding: the iteration converges quadratically.
const CONVERGED: f64 = 1e-18;

/// The closest rotation to a matrix, that of its polar decomposition where the determinant is positive.
///
/// Newton's iteration with scaling (N. J. Higham, SIAM J. Sci. Stat. Comput. 7 (1986) 1160), or singular values where the matrix is nearly
/// singular or its determinant negative.
pub(crate) fn rotation(f: &DMat3) -> DMat3 {
    let norm2 = |m: &DMat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    let (mut r, size2) = (*f, norm2(f));
    let is_regular = f.determinant() > FLAT * size2 * size2.sqrt();
    if !is_regular {
        return SingularValues::of(f).rotation();
    }
    for _ in 0..MAX_ITERATIONS {
        let cofactor = cofactor(&r);
        let inverse_transposed = cofactor * r.x_axis.dot(cofactor.x_axis).recip();
        let scale = (norm2(&inverse_transposed) / norm2(&r)).sqrt().sqrt();
        let next = (r * scale + inverse_transposed * scale.recip()) * 0.5;
        let change2 = norm2(&(next - r));
        r = next;
        if change2.is_nan() || change2 <= CONVERGED {
            break;
        }
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn matrices() -> Vec<DMat3> {
        let turn = |seed: f64| {
            DMat3::from_quat(DQuat::from_euler(
                glam::EulerRot::XYZ,
                1.3 * seed,
                0.7 - seed,
                2.1 * seed * seed,
            ))
        };
        let values = [
            DVec3::ONE,
            DVec3::new(2.0, 2.0, 0.5),
            DVec3::new(3.0, 1.0, 1e-9),
            DVec3::new(1.0, 0.4, -0.3),
            DVec3::new(1.0, 1.0, -1.0),
            DVec3::new(5.0, 1e-7, 1e-7),
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::ZERO,
            DVec3::new(1e-12, 1e-12, 2e-12),
            DVec3::new(1e9, 3.0, 1e-3),
        ];
        let mixed =
            |i: usize, s: DVec3| turn(0.1 + i as f64) * DMat3::from_diagonal(s) * turn(2.0 - i as f64 / 3.0);
        values.iter().enumerate().map(|(i, s)| mixed(i, *s)).chain(values.map(DMat3::from_diagonal)).collect()
    }

    #[test]
    fn decomposition_has_rotations_and_gives_the_matrix() {
        for f in matrices() {
            let SingularValues { u, s, v } = SingularValues::of(&f);
            for rotation in [u, v] {
                let off = rotation * rotation.transpose() - DMat3::IDENTITY;
                assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-14), "{rotation}");
                assert!((rotation.determinant() - 1.0).abs() < 1e-14);
            }
            let off = u * DMat3::from_diagonal(DVec3::from_array(s)) * v.transpose() - f;
            let size = f.to_cols_array().iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            assert!(off.to_cols_array().iter().all(|v| v.abs() <= 1e-14 * size), "{off}");
            assert!(s[0] >= s[1] - 1e-14 * size && s[1] >= s[2].abs() - 1e-14 * size, "{s:?}");
        }
    }

    #[test]
    fn iteration_and_singular_values_give_the_same_rotation() {
        for f in matrices() {
            let off = rotation(&f) - SingularValues::of(&f).rotation();
            assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-11), "{f}: {off}");
        }
    }

    #[test]
    fn matrix_that_is_not_finite_ends() {
        for bad in [f64::NAN, f64::INFINITY] {
            let f = DMat3::from_diagonal(DVec3::new(1.0, bad, 1.0));
            let _ = (SingularValues::of(&f), rotation(&f));
        }
    }
}
