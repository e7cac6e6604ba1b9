//! Stress and strain at a point of a body.

use crate::symmetric::eigenvectors;
use glam::DMat3;

/// Stress and strain at a point of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressState {
    /// Cauchy stress σ, Pa, with axes of the world: the force on a unit of present area. Tension is positive.
    pub cauchy_pa: DMat3,
    /// Green–Lagrange strain E = (FᵀF − 1)/2, with axes of the shape at rest.
    pub green_strain: DMat3,
    /// Ratio of the present volume to that at rest, det F.
    pub volume_ratio: f64,
}

impl Default for StressState {
    /// No stress and no strain.
    fn default() -> Self {
        Self { cauchy_pa: DMat3::ZERO, green_strain: DMat3::ZERO, volume_ratio: 1.0 }
    }
}

/// Volume ratio below which the Cauchy stress has the area of this ratio: that of a flat element is infinite.
const MIN_RATIO: f64 = 0.01;

impl StressState {
    /// The state at the deformation gradient `f` with the first Piola stress `piola_pa`, Pa.
    #[must_use]
    pub fn new(f: &DMat3, piola_pa: &DMat3) -> Self {
        let volume_ratio = f.determinant();
        let cauchy = *piola_pa * f.transpose() * volume_ratio.max(MIN_RATIO).recip();
        Self {
            cauchy_pa: (cauchy + cauchy.transpose()) * 0.5,
            green_strain: (f.transpose() * *f - DMat3::IDENTITY) * 0.5,
            volume_ratio,
        }
    }

    /// Mean of `states` with weights; the default without any.
    #[must_use]
    pub fn mean(states: impl Iterator<Item = (f64, Self)>) -> Self {
        let mut sum = Self { volume_ratio: 0.0, ..Self::default() };
        let mut total = 0.0;
        for (weight, state) in states {
            sum.cauchy_pa += weight * state.cauchy_pa;
            sum.green_strain += weight * state.green_strain;
            sum.volume_ratio += weight * state.volume_ratio;
            total += weight;
        }
        if total == 0.0 {
            return Self::default();
        }
        Self {
            cauchy_pa: sum.cauchy_pa * total.recip(),
            green_strain: sum.green_strain * total.recip(),
            volume_ratio: sum.volume_ratio / total,
        }
    }

    /// Pressure −tr σ/3, Pa.
    #[must_use]
    pub fn pressure_pa(&self) -> f64 {
        -trace(&self.cauchy_pa) / 3.0
    }

    /// Von Mises stress √(3/2 s:s), Pa, with the deviator s = σ + p 1.
    #[must_use]
    pub fn von_mises_pa(&self) -> f64 {
        let deviator = self.cauchy_pa + DMat3::IDENTITY * self.pressure_pa();
        let square: f64 = deviator.to_cols_array().iter().map(|s| s * s).sum();
        (1.5 * square).sqrt()
    }

    /// Principal stresses, Pa, descending.
    #[must_use]
    pub fn principal_stresses_pa(&self) -> [f64; 3] {
        descending(&self.cauchy_pa)
    }

    /// Principal Green–Lagrange strains, descending.
    #[must_use]
    pub fn principal_strains(&self) -> [f64; 3] {
        descending(&self.green_strain)
    }
}

fn trace(of: &DMat3) -> f64 {
    of.x_axis.x + of.y_axis.y + of.z_axis.z
}

/// Eigenvalues of a symmetric matrix, descending.
fn descending(of: &DMat3) -> [f64; 3] {
    let (mut values, _) = eigenvectors(of.to_cols_array_2d());
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn uniaxial_stress_has_its_invariants_in_every_frame() {
        let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7));
        // 3 kPa along x, with a strain of 10 % and 4 % of contraction.
        let f = turn * DMat3::from_diagonal(DVec3::new(1.1, 0.96, 0.96));
        let piola = turn * DMat3::from_diagonal(DVec3::new(3000.0 * 0.96 * 0.96, 0.0, 0.0));
        let state = StressState::new(&f, &piola);
        assert!((state.von_mises_pa() - 3000.0).abs() < 1e-9);
        assert!((state.pressure_pa() + 1000.0).abs() < 1e-9);
        for (found, expected) in state.principal_stresses_pa().into_iter().zip([3000.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-9, "{found}");
        }
        for (found, expected) in state.principal_strains().into_iter().zip([0.105, -0.0392, -0.0392]) {
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
        assert!((state.volume_ratio - 1.1 * 0.96 * 0.96).abs() < 1e-12);
        let mean = StressState::mean([(1.0, state), (3.0, StressState::default())].into_iter());
        assert!((mean.von_mises_pa() - 750.0).abs() < 1e-9);
    }

    #[test]
    fn shear_and_pressure_are_separate() {
        let shear = DMat3::from_cols(DVec3::Y * 500.0, DVec3::X * 500.0, DVec3::ZERO);
        let state = StressState { cauchy_pa: shear - DMat3::IDENTITY * 200.0, ..StressState::default() };
        assert!((state.von_mises_pa() - 3.0_f64.sqrt() * 500.0).abs() < 1e-9);
        assert!((state.pressure_pa() - 200.0).abs() < 1e-12);
        for (found, expected) in state.principal_stresses_pa().into_iter().zip([300.0, -200.0, -700.0]) {
            assert!((found - expected).abs() < 1e-9, "{found}");
        }
    }
}
