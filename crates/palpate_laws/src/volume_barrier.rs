//! A barrier against the inversion of cells.

use crate::symmetric;
use glam::{DMat3, DVec3};

/// The volume barrier of one tetrahedron between nodes of a hexahedral cell.
///
/// With e₁, e₂, e₃ the edges from one node to the other three, the volume ratio of the tetrahedron is
///
/// ```text
/// J = det(e₁, e₂, e₃) / det(E₁, E₂, E₃)          (E: the edges at rest)
/// ```
///
/// J is 1 at rest, 0 in a flat tetrahedron and negative in an inverted one. Volumes of tetrahedra are the standard test of the
/// validity of a hexahedron (O. V. Ushakova, SIAM J. Sci. Comput. 23 (2001) 1274). The energy is c g(J) with
///
/// ```text
/// g = 0 for J ≥ J₀;   3 t³ (1 + t²)^(−4/3) with t = J₀ − J below
/// ```
///
/// The force is exactly zero above the onset J₀, and its derivative is continuous. The energy grows without limit as
/// J falls, so an inverted tetrahedron is always restored. It steepens down to J = −0.5. Far below, it grows no
/// faster than a length, and the force is bounded for tetrahedra of any size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeBarrier {
    /// Scale of the energy c, J.
    energy_j: f64,
    /// 1/det(E₁, E₂, E₃), 1/m³; negative where the edges at rest are left-handed.
    per_m3: f64,
}

impl Default for VolumeBarrier {
    /// The barrier of a cube corner with edges of 1 m and an energy scale of 1 J.
    fn default() -> Self {
        Self { energy_j: 1.0, per_m3: 1.0 }
    }
}

impl VolumeBarrier {
    /// Onset J₀: the barrier acts at volume ratios below it.
    pub const ONSET: f64 = 0.4;
    /// Creates the barrier of a tetrahedron with the rest edges `rest_m` and the energy scale c = `energy_j`. `None`
    /// unless all values are finite, the scale is above zero and the edges span a volume.
    #[must_use]
    pub fn new(rest_m: [DVec3; 3], energy_j: f64) -> Option<Self> {
        let per_m3 = 1.0 / triple(rest_m);
        let ok = per_m3.is_finite() && energy_j.is_finite() && energy_j > 0.0;
        ok.then_some(Self { energy_j, per_m3 })
    }

    /// Volume ratio J of a tetrahedron with the edges `edges_m`.
    #[must_use]
    #[inline]
    pub fn ratio(&self, edges_m: [DVec3; 3]) -> f64 {
        self.per_m3 * triple(edges_m)
    }

    /// |1/det(E₁, E₂, E₃)|, 1/m³: the maximum change of J with the volume that the edges span.
    #[must_use]
    pub fn ratio_per_m3(&self) -> f64 {
        self.per_m3.abs()
    }

    /// Whether the barrier acts at the volume ratio `ratio`.
    #[must_use]
    #[inline]
    pub fn is_active(ratio: f64) -> bool {
        ratio < Self::ONSET
    }

    /// Energy at a volume ratio, J.
    #[must_use]
    pub fn energy_j(&self, ratio: f64) -> f64 {
        let t = Self::depth(ratio);
        let q = 1.0 + t * t;
        self.energy_j * 3.0 * t.powi(3) / (q * q.cbrt())
    }

    /// −∂(energy)/∂J at a volume ratio, J; never negative, and below 2 c.
    #[must_use]
    pub fn slope_j(&self, ratio: f64) -> f64 {
        let t = Self::depth(ratio);
        let (t2, q) = (t * t, 1.0 + t * t);
        self.energy_j * t2 * (9.0 + t2) / (q * q * q.cbrt())
    }

    /// ∂²(energy)/∂J² at a volume ratio, J; negative far below the onset.
    #[must_use]
    pub fn curvature_j(&self, ratio: f64) -> f64 {
        let t = Self::depth(ratio);
        let (t2, q) = (t * t, 1.0 + t * t);
        self.energy_j * 2.0 * t * (27.0 - 30.0 * t2 - t2 * t2) / (3.0 * q * q * q * q.cbrt())
    }

    /// Upper bounds of slope and curvature over all volume ratios of at least `lowest`, J.
    #[must_use]
    pub fn bounds_j(&self, lowest: f64) -> (f64, f64) {
        (self.slope_j(lowest.max(STEEPEST)), self.curvature_j(lowest.max(STIFFEST)))
    }

    /// Forces on the far ends of the edges, N; zero for an inactive barrier. The force on the shared node is minus
    /// their sum.
    #[must_use]
    #[inline]
    pub fn forces_n(&self, edges_m: [DVec3; 3]) -> [DVec3; 3] {
        let ratio = self.ratio(edges_m);
        if !Self::is_active(ratio) {
            return [DVec3::ZERO; 3];
        }
        let slope = self.slope_j(ratio);
        self.gradient_per_m(edges_m).map(|gradient| slope * gradient)
    }

    /// ∂J/∂e₁, ∂J/∂e₂, ∂J/∂e₃, 1/m.
    #[must_use]
    #[inline]
    pub fn gradient_per_m(&self, [a, b, c]: [DVec3; 3]) -> [DVec3; 3] {
        [b.cross(c), c.cross(a), a.cross(b)].map(|area| self.per_m3 * area)
    }

    /// Second derivatives of the energy with respect to the edges, N/m: entry \[i\]\[j\] is ∂²/∂e_i∂e_j.
    ///
    /// With `clamped`, the positive semidefinite part of it.
    #[must_use]
    pub fn tangent(&self, edges_m: [DVec3; 3], clamped: bool) -> [[DMat3; 3]; 3] {
        let ratio = self.ratio(edges_m);
        let (slope, curvature) = (self.slope_j(ratio), self.curvature_j(ratio));
        let gradient = self.gradient_per_m(edges_m);
        let mut blocks = gradient.map(|g| gradient.map(|other| outer(curvature * g, other)));
        for (i, j, k) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            // ∂(e_j × e_k)/∂e_j = −[e_k]×, and its transpose.
            let across = cross_matrix(slope * self.per_m3 * edges_m[k]);
            blocks[i][j] += across;
            blocks[j][i] -= across;
        }
        if clamped { positive_part(&blocks) } else { blocks }
    }

    /// t: distance of a volume ratio below the onset.
    fn depth(ratio: f64) -> f64 {
        (Self::ONSET - ratio).max(0.0)
    }
}

/// Volume ratio with the maximum slope, where 27 − 30 t² − t⁴ = 0.
const STEEPEST: f64 = VolumeBarrier::ONSET - 0.935_151;
/// Volume ratio with the maximum curvature.
const STIFFEST: f64 = VolumeBarrier::ONSET - 0.342_113;

fn triple([a, b, c]: [DVec3; 3]) -> f64 {
    a.dot(b.cross(c))
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The matrix of v ↦ a × v.
fn cross_matrix(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

/// The positive semidefinite part of a symmetric matrix of three edges.
fn positive_part(blocks: &[[DMat3; 3]; 3]) -> [[DMat3; 3]; 3] {
    let a: [[f64; 9]; 9] =
        std::array::from_fn(|r| std::array::from_fn(|c| blocks[r / 3][c / 3].col(c % 3)[r % 3]));
    let part = symmetric::positive_part(a);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| part[3 * i + r][3 * j + c])))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn barrier() -> VolumeBarrier {
        VolumeBarrier::new([DVec3::X * 0.02, DVec3::Y * 0.02, DVec3::Z * 0.02], 3e-3).unwrap()
    }

    /// Flattened, flat, turned inside out, mirrored, far inverted and stretched.
    fn places() -> [[DVec3; 3]; 5] {
        [
            [
                DVec3::new(0.021, 0.001, -0.003),
                DVec3::new(0.002, 0.018, 0.001),
                DVec3::new(0.004, -0.003, 0.005),
            ],
            [DVec3::new(0.02, 0.0, 0.0), DVec3::new(0.0, 0.02, 0.0), DVec3::new(0.01, -0.01, 0.0)],
            [DVec3::new(0.02, 0.003, 0.0), DVec3::new(0.0, 0.025, 0.002), DVec3::new(0.004, 0.002, -0.008)],
            [-DVec3::X * 0.02, DVec3::Y * 0.02, DVec3::Z * 0.02],
            [DVec3::new(-0.04, 0.01, 0.0), DVec3::new(0.01, 0.03, 0.01), DVec3::new(0.0, -0.01, 0.05)],
        ]
    }

    #[test]
    fn ratio_is_one_at_rest_zero_when_flat_and_minus_one_when_mirrored() {
        let [_, flat, _, mirrored, _] = places();
        let rest = [DVec3::X * 0.02, DVec3::Y * 0.02, DVec3::Z * 0.02];
        assert!((barrier().ratio(rest) - 1.0).abs() < 1e-15);
        assert!(barrier().ratio(flat).abs() < 1e-15);
        assert!((barrier().ratio(mirrored) + 1.0).abs() < 1e-15);
        // Left-handed edges have the same ratios.
        let left = VolumeBarrier::new(mirrored, 3e-3).unwrap();
        assert!((left.ratio(mirrored) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn energy_force_and_tangent_are_exactly_zero_from_the_onset_on() {
        for ratio in [VolumeBarrier::ONSET, 0.5, 1.0, 7.0] {
            assert_eq!(barrier().energy_j(ratio), 0.0);
            assert_eq!(barrier().slope_j(ratio), 0.0);
            assert_eq!(barrier().curvature_j(ratio), 0.0);
            let edges = [DVec3::X * 0.02, DVec3::Y * 0.02, DVec3::Z * (0.02 * (ratio + 1e-12))];
            assert_eq!(barrier().forces_n(edges), [DVec3::ZERO; 3]);
        }
    }

    #[test]
    fn slope_is_minus_the_derivative_of_the_energy_and_curvature_that_of_the_slope() {
        let h = 1e-6;
        for step in -200..=60 {
            let ratio = f64::from(step) * 0.025 + 0.003;
            let slope = (barrier().energy_j(ratio - h) - barrier().energy_j(ratio + h)) / (2.0 * h);
            let curvature = (barrier().slope_j(ratio - h) - barrier().slope_j(ratio + h)) / (2.0 * h);
            assert!((slope - barrier().slope_j(ratio)).abs() < 1e-11, "{ratio}");
            assert!((curvature - barrier().curvature_j(ratio)).abs() < 1e-8, "{ratio}");
            let (max_slope, max_curvature) = barrier().bounds_j(ratio - 0.05);
            assert!(barrier().slope_j(ratio) <= max_slope && barrier().curvature_j(ratio) <= max_curvature);
        }
    }

    #[test]
    fn forces_and_tangent_are_the_derivatives_of_the_energy() {
        let h = 1e-8;
        for edges in places() {
            let moved = |i: usize, axis: usize, by: f64| {
                let mut moved = edges;
                moved[i][axis] += by;
                moved
            };
            let energy = |edges| barrier().energy_j(barrier().ratio(edges));
            let (forces, tangent) = (barrier().forces_n(edges), barrier().tangent(edges, false));
            for (i, axis) in (0..3).flat_map(|i| (0..3).map(move |axis| (i, axis))) {
                let (up, down) = (moved(i, axis, h), moved(i, axis, -h));
                let force = -(energy(up) - energy(down)) / (2.0 * h);
                assert!((force - forces[i][axis]).abs() < 1e-6, "{force} N, not {} N", forces[i][axis]);
                let (up, down) = (barrier().forces_n(up), barrier().forces_n(down));
                for j in 0..3 {
                    let column = -(up[j] - down[j]) / (2.0 * h);
                    let exact = tangent[j][i].col(axis);
                    assert!((column - exact).length() < 1e-4, "{column} N/m, not {exact} N/m");
                }
            }
        }
    }

    #[test]
    fn the_clamped_tangent_is_positive_semidefinite_and_above_the_exact_one() {
        for edges in places() {
            let (exact, clamped) = (barrier().tangent(edges, false), barrier().tangent(edges, true));
            let form = |blocks: &[[DMat3; 3]; 3], d: [DVec3; 3]| -> f64 {
                (0..3)
                    .flat_map(|i| (0..3).map(move |j| (i, j)))
                    .map(|(i, j)| d[i].dot(blocks[i][j] * d[j]))
                    .sum()
            };
            let mut negative = 0;
            for seed in 0..200 {
                let number = |i: u32| f64::from((seed * 7919 + i * 104_729 + 13) % 1009) / 504.5 - 1.0;
                let d = [0, 3, 6].map(|i| DVec3::new(number(i), number(i + 1), number(i + 2)));
                let (exact, clamped) = (form(&exact, d), form(&clamped, d));
                assert!(clamped >= -1e-12 && clamped >= exact - 1e-9 * (1.0 + exact.abs()));
                negative += u32::from(exact < 0.0);
            }
            assert!(negative > 0, "the exact tangent of {edges:?} is not indefinite");
        }
    }

    #[test]
    fn flat_edges_or_non_positive_scale_give_no_barrier() {
        let rest = [DVec3::X, DVec3::Y, DVec3::Z];
        assert!(VolumeBarrier::new([DVec3::X, DVec3::Y, DVec3::X], 1.0).is_none());
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(VolumeBarrier::new(rest, scale).is_none());
        }
    }
}
