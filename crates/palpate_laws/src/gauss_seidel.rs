//! The projected Gauss-Seidel solver for constraint rows.

use crate::{ConstraintLaw, ConstraintRow};
use glam::DVec3;

/// Response of the velocities of all rows to impulses on rows: the Delassus operator W = H A⁻¹ Hᵀ.
pub trait ImpulseResponse {
    /// Current velocity of row `row`, m/s.
    fn velocity_m_per_s(&self, row: usize) -> DVec3;

    /// Applies the impulse `impulse_ns`, N s, to row `row` and updates the velocities.
    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3);
}

/// Limits of the iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverLimits {
    /// Maximum number of sweeps over all rows.
    pub max_iterations: usize,
    /// Relative tolerance: the iteration ends when the largest change of an impulse is below this fraction of the
    /// largest impulse.
    pub tolerance: f64,
}

/// Result of the iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SolverReport {
    /// Number of sweeps over all rows.
    pub iterations: usize,
    /// Whether the last sweep was within the tolerance.
    pub converged: bool,
}

/// Displacement of a row, m, below which the iteration also ends, after this number of report. The impulses of
/// redundant rows are not unique and need not converge.
const STALL_DISPLACEMENT_M: f64 = 1e-9;
const STALL_CHECK_ITERATIONS: usize = 50;

/// Solves for the impulses of all rows by projected Gauss-Seidel (F. Jourdan, P. Alart, M. Jean, Comput. Methods
/// Appl. Mech. Eng. 155 (1998) 31).
///
/// At the end of a step of length `h`, s, each row satisfies its law. Each sweep solves row after row exactly while
/// the others are held, until the impulses converge or `effort` is used up. Rows may start with a guess of their
/// impulses; `response` starts with the resulting velocities.
///
/// Contradictory rows do not converge. Very unequal masses joined by threads converge slowly.
pub fn solve_projected_gauss_seidel(
    rows: &mut [ConstraintRow],
    response: &mut impl ImpulseResponse,
    h: f64,
    effort: SolverLimits,
) -> SolverReport {
    for count in 1..=effort.max_iterations {
        let (mut largest, mut change, mut moved) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (index, row) in rows.iter_mut().enumerate() {
            // A row of fixed nodes only cannot move.
            let has_series = matches!(row.law, ConstraintLaw::Unilateral { series: Some(_), .. });
            if row.inv_effective_mass_per_kg.determinant() <= 0.0 && !has_series {
                continue;
            }
            // Velocity without this row's impulse, including the gap that may still be closed.
            let free = response.velocity_m_per_s(index) - row.inv_effective_mass_per_kg * row.impulse_ns
                + row.gap_m / h;
            let impulse = row.law.impulse(row.inv_effective_mass_per_kg, free, (row.impulse_ns, h));
            let more = impulse - row.impulse_ns;
            if more != DVec3::ZERO {
                response.apply_impulse(index, more);
            }
            row.impulse_ns = impulse;
            largest = largest.max(impulse.length());
            change = change.max(more.length());
            moved = moved.max(h * (row.inv_effective_mass_per_kg * more).length());
        }
        // A single row is solved exactly.
        let is_converged = change <= effort.tolerance * largest || rows.len() == 1;
        if is_converged || count > STALL_CHECK_ITERATIONS && moved <= STALL_DISPLACEMENT_M {
            return SolverReport { iterations: count, converged: true };
        }
    }
    SolverReport { iterations: effort.max_iterations, converged: false }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Coulomb, Indentation, Pressure, SeriesCompliance};
    use glam::DMat3;

    /// Two coupled points.
    struct Two {
        v: [DVec3; 2],
        w: [[f64; 2]; 2],
    }

    impl ImpulseResponse for Two {
        fn velocity_m_per_s(&self, row: usize) -> DVec3 {
            self.v[row]
        }

        fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
            for other in 0..2 {
                self.v[other] += self.w[other][row] * impulse_ns;
            }
        }
    }

    fn within(max_iterations: usize) -> SolverLimits {
        SolverLimits { max_iterations, tolerance: 1e-8 }
    }

    fn row(law: ConstraintLaw, gap: f64) -> ConstraintRow {
        let per_kg = DMat3::from_diagonal(DVec3::splat(2.0));
        ConstraintRow {
            law,
            gap_m: DVec3::Z * gap,
            inv_effective_mass_per_kg: per_kg,
            impulse_ns: DVec3::ZERO,
        }
    }

    #[test]
    fn two_coupled_contacts_are_solved_as_one_problem() {
        let w = [[2.0, 1.0], [1.0, 2.0]];
        let up = ConstraintLaw::Unilateral { coulomb: Coulomb::new(DVec3::Z, 0.0).unwrap(), series: None };
        // Both contacts are active: [2 1; 1 2] λ = -[v + gap/h].
        let mut two = Two { v: [DVec3::Z * -3.0, DVec3::Z * -4.0], w };
        let mut rows = [row(up, 0.01), row(up, 0.01)];
        let report = solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100));
        assert!(report.converged && (2..40).contains(&report.iterations));
        assert!(
            (rows[0].impulse_ns.z - 1.0 / 3.0).abs() < 1e-7
                && (rows[1].impulse_ns.z - 4.0 / 3.0).abs() < 1e-7
        );
        assert!(two.v.iter().all(|v| (v.z + 1.0).abs() < 1e-7), "the gap is closed and no more");
        // One impulse separates both contacts; the other stays zero.
        let mut two = Two { v: [DVec3::Z * -0.1, DVec3::Z * -4.0], w };
        let mut rows = [row(up, 0.0), row(up, 0.0)];
        assert!(solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100)).converged);
        assert_eq!(rows[0].impulse_ns, DVec3::ZERO);
        assert!((rows[1].impulse_ns.z - 2.0).abs() < 1e-7 && two.v[0].z > 0.0);
    }

    #[test]
    fn thread_only_pulls_and_bilateral_row_does_both() {
        let w = [[2.0, 0.0], [0.0, 2.0]];
        let mut two = Two { v: [DVec3::X, -DVec3::X], w };
        let thread = ConstraintLaw::Tension { along: DVec3::X, compliance_per_kg: 0.0 };
        let mut rows = [row(thread, 0.0), row(thread, 0.0)];
        assert_eq!(solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100)).iterations, 2);
        assert_eq!((two.v, rows[1].impulse_ns), ([DVec3::ZERO, -DVec3::X], DVec3::ZERO));
        let mut rows = [row(ConstraintLaw::Bilateral, 0.0), row(ConstraintLaw::Bilateral, -0.01)];
        solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100));
        assert_eq!(two.v, [DVec3::ZERO, DVec3::Z]);
    }

    #[test]
    fn elastic_thread_leaves_a_gap_of_force_over_stiffness() {
        let (h, stiffness_n_per_m) = (0.01, 700.0);
        let spring =
            ConstraintLaw::Tension { along: DVec3::Z, compliance_per_kg: 1.0 / (stiffness_n_per_m * h * h) };
        // Two coupled threads, one with an initial gap and one whose end moves away.
        let mut two = Two { v: [DVec3::ZERO, DVec3::Z * 3.0], w: [[2.0, 1.0], [1.0, 2.0]] };
        let mut rows = [row(spring, 0.004), row(spring, 0.0)];
        assert!(solve_projected_gauss_seidel(&mut rows, &mut two, h, within(200)).converged);
        for (row, v) in rows.iter().zip(two.v) {
            let left_m = row.gap_m.z + h * v.z;
            let force_n = -row.impulse_ns.z / h;
            assert!(
                force_n > 0.1 && (force_n - stiffness_n_per_m * left_m).abs() < 1e-5 * force_n,
                "{row:?}"
            );
        }
        // A slack thread has no impulse, also while its ends approach.
        let mut two = Two { v: [-DVec3::Z, DVec3::Z], w: [[2.0, 0.0], [0.0, 2.0]] };
        let mut rows = [row(spring, 0.005), row(spring, -0.02)];
        solve_projected_gauss_seidel(&mut rows, &mut two, h, within(50));
        assert_eq!([rows[0].impulse_ns, rows[1].impulse_ns], [DVec3::ZERO; 2]);
    }

    #[test]
    fn contact_with_series_compliance_leaves_its_deflection_as_the_gap() {
        let h = 2.5e-4;
        for friction in [0.0, 0.4, 2.0] {
            for (radius_m, share, depth, slide) in [
                (0.005, 0.8, 0.002, 0.0),
                (0.005, 1.0, 0.02, 0.01),
                (0.0002, 0.99, 0.015, 3.0),
                (0.02, 0.02, 1e-9, -0.2),
                (0.02, 0.0, 1e-3, 0.1),
            ] {
                let law = Indentation {
                    pressure: Pressure::Ball,
                    radius_m,
                    modulus_pa: 21e3,
                    poissons_ratio: 0.25,
                };
                let series = SeriesCompliance::of_share(share, law).of_portion(0.7);
                let coulomb = Coulomb::new(DVec3::Z, friction).unwrap();
                let law = ConstraintLaw::Unilateral { coulomb, series: Some((series, 0.0)) };
                let mut two = Two { v: [DVec3::X * slide; 2], w: [[200.0, 80.0], [80.0, 150.0]] };
                let own = |w: f64| DMat3::from_diagonal(DVec3::splat(w));
                let mut rows = [row(law, -depth), row(law, -0.7 * depth)];
                (rows[0].inv_effective_mass_per_kg, rows[1].inv_effective_mass_per_kg) =
                    (own(200.0), own(150.0));
                let report = solve_projected_gauss_seidel(
                    &mut rows,
                    &mut two,
                    h,
                    SolverLimits { max_iterations: 200, tolerance: 1e-12 },
                );
                assert!(report.converged, "{report:?}");
                for (row, v) in rows.iter().zip(two.v) {
                    let left = row.gap_m.z + h * v.z;
                    let force = row.impulse_ns.z / h;
                    if force > 0.0 {
                        assert!((left + series.approach_m(force)).abs() < 1e-9 * depth, "{left} {force}");
                    } else {
                        assert!(left >= 0.0);
                    }
                    let across = row.impulse_ns.truncate().length();
                    assert!(across <= friction * row.impulse_ns.z * (1.0 + 1e-9), "{:?}", row.impulse_ns);
                    let slips = v.truncate().length() > 1e-6;
                    assert!(!slips || (across - friction * row.impulse_ns.z).abs() < 1e-9 * row.impulse_ns.z);
                }
            }
        }
    }

    #[test]
    fn fixed_surface_with_series_compliance_pushes_by_the_compliance_alone() {
        let law =
            Indentation { pressure: Pressure::Ball, radius_m: 0.005, modulus_pa: 21e3, poissons_ratio: 0.25 };
        let series = SeriesCompliance::of_share(1.0, law);
        let coulomb = Coulomb::new(-DVec3::Z, 0.0).unwrap();
        let law = ConstraintLaw::Unilateral { coulomb, series: Some((series, 0.0)) };
        let mut fixed = Two { v: [DVec3::ZERO; 2], w: [[0.0; 2]; 2] };
        // The sum over no free nodes is −0.
        let per_kg = -DMat3::ZERO;
        let mut rows = [ConstraintRow {
            law,
            gap_m: DVec3::Z * 0.003,
            inv_effective_mass_per_kg: per_kg,
            impulse_ns: DVec3::ZERO,
        }];
        assert!(solve_projected_gauss_seidel(&mut rows, &mut fixed, 1e-3, within(20)).converged);
        let force_n = -rows[0].impulse_ns.z / 1e-3;
        assert!((force_n / series.force_n(0.003) - 1.0).abs() < 1e-9, "{force_n} N");
    }

    #[test]
    fn fixed_row_converges_and_contradictory_rows_stop_at_the_limit() {
        let mut two = Two { v: [DVec3::X, DVec3::X], w: [[1.0, 1.0], [1.0, 1.0]] };
        let own = |s: f64| DMat3::from_diagonal(DVec3::splat(s));
        // The same point is constrained to two positions.
        let mut rows = [row(ConstraintLaw::Bilateral, 0.0), row(ConstraintLaw::Bilateral, 0.1)];
        rows.iter_mut().for_each(|row| row.inv_effective_mass_per_kg = own(1.0));
        assert_eq!(
            solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(50)),
            SolverReport { iterations: 50, converged: false }
        );
        let mut rows = [row(ConstraintLaw::Bilateral, 0.0)];
        rows[0].inv_effective_mass_per_kg = own(0.0);
        assert!(solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(50)).converged);
        assert_eq!(rows[0].impulse_ns, DVec3::ZERO);
    }
}
