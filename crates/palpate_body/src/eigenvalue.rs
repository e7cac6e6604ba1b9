//! The largest eigenvalue of a symmetric 3 × 3 matrix.

use glam::{DMat3, DVec3};

/// Largest eigenvalue of a symmetric matrix, by the trigonometric solution of its characteristic cubic
/// (O. K. Smith, Communications of the ACM 4 (1961) 168).
pub(crate) fn largest_eigenvalue(a: &DMat3) -> f64 {
    let mean = (a.x_axis.x + a.y_axis.y + a.z_axis.z) / 3.0;
    let shifted = *a - DMat3::from_diagonal(DVec3::splat(mean));
    let spread = (shifted.to_cols_array().iter().map(|v| v * v).sum::<f64>() / 6.0).sqrt();
    if spread == 0.0 {
        return mean;
    }
    let half_det = ((shifted * (1.0 / spread)).determinant() / 2.0).clamp(-1.0, 1.0);
    mean + 2.0 * spread * (half_det.acos() / 3.0).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_eigenvalue_matches_closed_forms() {
        assert_eq!(largest_eigenvalue(&DMat3::from_diagonal(DVec3::splat(3.0))), 3.0);
        let diagonal = DMat3::from_diagonal(DVec3::new(1.0, -4.0, 2.5));
        assert!((largest_eigenvalue(&diagonal) - 2.5).abs() < 1e-14);
        let u = DVec3::new(1.0, 2.0, -2.0) / 3.0;
        let rank_one = DMat3::from_cols(u * u.x, u * u.y, u * u.z) * 7.0;
        assert!((largest_eigenvalue(&rank_one) - 7.0).abs() < 1e-13);
    }
}
