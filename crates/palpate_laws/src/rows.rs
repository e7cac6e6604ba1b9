//! Rows: points that have to obey laws, and the impulses that make them.

use crate::{Coulomb, SeriesCompliance};
use glam::{DMat3, DVec3};

/// What a row, a point Σ w_i x_i or the difference of two, has to obey.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstraintLaw {
    /// A surface that pushes and rubs; the gap is along its normal.
    Unilateral {
        /// Its normal and friction.
        coulomb: Coulomb,
        /// What is in series with it along the normal, where under an impulse the gap that is left is −δ_s(λ_n/h), and across it, m/N, where what
        /// is left is minus that times λ_t/h.
        series: Option<(SeriesCompliance, f64)>,
    },
    /// No gap is left.
    Bilateral,
    /// No gap is left along a unit direction, by pulling against it only.
    Tension {
        /// The direction in which the row must not go farther.
        along: DVec3,
        /// How it stretches: 1/(k h²) of a spring of k N/m in a step of h s, 1/kg, so that what is left of the gap at the end of the
        /// step is the impulse over k h; 0 for one that does not.
        compliance_per_kg: f64,
    },
}

/// One row of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstraintRow {
    /// What it has to obey.
    pub law: ConstraintLaw,
    /// How far it would be beyond the law, or short of it, if it did not move in the step, m.
    pub gap_m: DVec3,
    /// H A⁻¹ Hᵀ of the row with itself: what an impulse on it does to its own velocity, 1/kg.
    pub inv_effective_mass_per_kg: DMat3,
    /// λ, what the law gives it, N s.
    pub impulse_ns: DVec3,
}

/// What impulses on rows do to the velocities of all rows.
pub trait ImpulseResponse {
    /// Velocity of row `row` now, m/s.
    fn velocity_m_per_s(&self, row: usize) -> DVec3;

    /// Adds what an impulse `impulse_ns` on row `row` does to the velocities.
    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3);
}

/// How much is done to find the impulses of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverLimits {
    /// Most sweeps over all rows.
    pub max_iterations: usize,
    /// Change of an impulse, relative to the largest, below which a sweep was the last.
    pub tolerance: f64,
}

/// How the impulses of rows were found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SolverReport {
    /// Sweeps over all rows.
    pub iterations: usize,
    /// Whether the last changed nothing to speak of.
    pub converged: bool,
}

/// How fast what is inside of what it should not be in is pushed out, and what is apart is drawn together.
pub const MAX_CORRECTION_SPEED_M_PER_S: f64 = 1.0;
/// Less than that of a gap is rounding and needs no care.
pub const GAP_TOLERANCE_M: f64 = 1e-6;

/// How far a row moves in the step because of a change, m, below which a sweep was the last too, after so many sweeps:
/// impulses that share a load that one of them could bear are not determined, and need not be.
const STALL_DISPLACEMENT_M: f64 = 1e-9;
const STALL_CHECK_ITERATIONS: usize = 50;

impl ConstraintLaw {
    /// The impulse of a row with answer `w` whose velocity without it, the gap over the length of the step added, is
    /// `free`.
    fn impulse(self, w: DMat3, free: DVec3, (before, h): (DVec3, f64)) -> DVec3 {
        match self {
            Self::Unilateral { coulomb, series: None } => coulomb.impulse(w, free),
            Self::Unilateral { coulomb, series: Some((series, tangential)) } => {
                in_series(coulomb, (&series, tangential), (w, free), (before, h))
            }
            Self::Bilateral => -(w.inverse() * free),
            Self::Tension { along, compliance_per_kg } => {
                -along * (free.dot(along).max(0.0) / (along.dot(w * along) + compliance_per_kg))
            }
        }
    }
}

/// Newton steps for the force of a contact in series with a compliance, and the relative change that ends them.
const NEWTON_STEPS: usize = 40;
const NEWTON_TOLERANCE: f64 = 1e-12;

/// The impulse of a contact that leaves the gap −δ_s(λ_n/h): by Newton's method on the force, held between 0 and what either the row or the
/// compliance alone would give.
fn in_series(
    coulomb: Coulomb,
    (series, tangential_m_per_n): (&SeriesCompliance, f64),
    (w, free): (DMat3, DVec3),
    (before, h): (DVec3, f64),
) -> DVec3 {
    let n = coulomb.normal();
    let approach = -free.dot(n);
    if approach.is_nan() || approach <= 0.0 {
        return coulomb.impulse(w, free);
    }
    if let Some(per_kg) = isotropic(w) {
        return in_series_with_a_mass(coulomb, (series, tangential_m_per_n), (per_kg, free, approach), h);
    }
    let (mut low, mut high) = (0.0, series.force_n(approach * h));
    let own = n.dot(w * n);
    if own > 0.0 {
        high = high.min(approach / own / h);
    }
    // Across the normal it is a spring whose stretch of the step before is in the gap.
    let across =
        (DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z)) * (tangential_m_per_n / (h * h));
    let guess = before.dot(n) / h;
    let mut force = if guess > 0.0 && guess <= high { guess } else { 0.5 * high };
    let mut impulse = DVec3::ZERO;
    for _ in 0..NEWTON_STEPS {
        let (delta, slope) = (series.approach_m(force), series.slope_m_per_n(force));
        let along = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        let w = w + across + along * (slope / (h * h));
        impulse = coulomb.impulse(w, free + n * ((delta - slope * force) / h));
        let next = impulse.dot(n) / h;
        if (next - force).abs() <= NEWTON_TOLERANCE * force {
            break;
        }
        // A compliance that stiffens with force is concave: the tangent falls short of the force, never beyond it.
        if next > force {
            low = force;
        } else {
            high = force;
        }
        let is_between = next > low && next < high;
        force = if is_between { next } else { 0.5 * (low + high) };
    }
    impulse
}

/// As [`in_series`], where an impulse does the same to the velocity in every direction, `per_kg`: then what is along the normal and what is
/// across it are apart.
fn in_series_with_a_mass(
    coulomb: Coulomb,
    (series, tangential_m_per_n): (&SeriesCompliance, f64),
    (per_kg, free, approach): (f64, DVec3, f64),
    h: f64,
) -> DVec3 {
    let n = coulomb.normal();
    let normal_ns = h * series.force_beside_n(approach * h, per_kg * h * h);
    let (slip, most) = (free + approach * n, coulomb.friction() * normal_ns);
    let across = per_kg + tangential_m_per_n / (h * h);
    let friction = if across > 0.0 { slip / across } else { most * slip.normalize_or_zero() };
    let length = friction.length();
    normal_ns * n - if length > most { most / length * friction } else { friction }
}

/// What an impulse does to the velocity in every direction, where that is the same.
fn isotropic(w: DMat3) -> Option<f64> {
    let own = w.x_axis.x;
    (w == DMat3::from_diagonal(DVec3::splat(own))).then_some(own)
}

/// Gives every row its impulse, so that at the end of a step of length `h`, s, each obeys its law, by projected
/// Gauss-Seidel (F. Jourdan, P. Alart, M. Jean, Comput. Methods Appl. Mech. Eng. 155 (1998) 31): row after row answers
/// exactly while the others stand, until nothing changes or as many sweeps are over as `effort` allows. Rows may begin with
/// impulses, for a guess; `answer` begins with the velocities that these give.
///
/// Where rows contradict each other their impulses grow and no sweep is the last; very unequal masses on threads converge
/// slowly.
pub fn solve_projected_gauss_seidel(
    rows: &mut [ConstraintRow],
    answer: &mut impl ImpulseResponse,
    h: f64,
    effort: SolverLimits,
) -> SolverReport {
    for count in 1..=effort.max_iterations {
        let (mut largest, mut change, mut moved) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (index, row) in rows.iter_mut().enumerate() {
            // A row of nothing but what is fixed cannot obey.
            let has_series = matches!(row.law, ConstraintLaw::Unilateral { series: Some(_), .. });
            if row.inv_effective_mass_per_kg.determinant() <= 0.0 && !has_series {
                continue;
            }
            // Velocity without this row's impulse; what is left of the gap may still be closed.
            let free = answer.velocity_m_per_s(index) - row.inv_effective_mass_per_kg * row.impulse_ns
                + row.gap_m / h;
            let impulse = row.law.impulse(row.inv_effective_mass_per_kg, free, (row.impulse_ns, h));
            let more = impulse - row.impulse_ns;
            if more != DVec3::ZERO {
                answer.apply_impulse(index, more);
            }
            row.impulse_ns = impulse;
            largest = largest.max(impulse.length());
            change = change.max(more.length());
            moved = moved.max(h * (row.inv_effective_mass_per_kg * more).length());
        }
        // A row that is alone is solved in one step.
        let is_settled = change <= effort.tolerance * largest || rows.len() == 1;
        if is_settled || count > STALL_CHECK_ITERATIONS && moved <= STALL_DISPLACEMENT_M {
            return SolverReport { iterations: count, converged: true };
        }
    }
    SolverReport { iterations: effort.max_iterations, converged: false }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Indentation, Pressure};

    /// Two points that answer to each other.
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

    fn within(sweeps: usize) -> SolverLimits {
        SolverLimits { max_iterations: sweeps, tolerance: 1e-8 }
    }

    fn row(law: ConstraintLaw, gap: f64) -> ConstraintRow {
        let own_per_kg = DMat3::from_diagonal(DVec3::splat(2.0));
        ConstraintRow {
            law,
            gap_m: DVec3::Z * gap,
            inv_effective_mass_per_kg: own_per_kg,
            impulse_ns: DVec3::ZERO,
        }
    }

    #[test]
    fn two_coupled_contacts_are_solved_as_one_problem() {
        let w = [[2.0, 1.0], [1.0, 2.0]];
        let up = ConstraintLaw::Unilateral { coulomb: Coulomb::new(DVec3::Z, 0.0).unwrap(), series: None };
        // Both press: [2 1; 1 2] λ = -[v + gap/h].
        let mut two = Two { v: [DVec3::Z * -3.0, DVec3::Z * -4.0], w };
        let mut rows = [row(up, 0.01), row(up, 0.01)];
        let sweeps = solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100));
        assert!(sweeps.converged && (2..40).contains(&sweeps.iterations));
        assert!(
            (rows[0].impulse_ns.z - 1.0 / 3.0).abs() < 1e-7
                && (rows[1].impulse_ns.z - 4.0 / 3.0).abs() < 1e-7
        );
        assert!(two.v.iter().all(|v| (v.z + 1.0).abs() < 1e-7), "the gap is closed and no more");
        // One push is enough for both: the other gives nothing.
        let mut two = Two { v: [DVec3::Z * -0.1, DVec3::Z * -4.0], w };
        let mut rows = [row(up, 0.0), row(up, 0.0)];
        assert!(solve_projected_gauss_seidel(&mut rows, &mut two, 0.01, within(100)).converged);
        assert_eq!(rows[0].impulse_ns, DVec3::ZERO);
        assert!((rows[1].impulse_ns.z - 2.0).abs() < 1e-7 && two.v[0].z > 0.0);
    }

    #[test]
    fn a_thread_pulls_only_and_a_grasp_does_both() {
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
    fn what_a_stretching_thread_leaves_of_the_gap_is_its_force_over_its_stiffness() {
        let (h, stiffness_n_per_m) = (0.01, 700.0);
        let spring =
            ConstraintLaw::Tension { along: DVec3::Z, compliance_per_kg: 1.0 / (stiffness_n_per_m * h * h) };
        // Two of them, joined by the body, one with a gap before and one that runs away.
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
        // Slack it does nothing, and gives nothing to what comes nearer.
        let mut two = Two { v: [-DVec3::Z, DVec3::Z], w: [[2.0, 0.0], [0.0, 2.0]] };
        let mut rows = [row(spring, 0.005), row(spring, -0.02)];
        solve_projected_gauss_seidel(&mut rows, &mut two, h, within(50));
        assert_eq!([rows[0].impulse_ns, rows[1].impulse_ns], [DVec3::ZERO; 2]);
    }

    #[test]
    fn a_contact_in_series_with_a_compliance_leaves_its_approach_as_the_gap() {
        let h = 2.5e-4;
        for friction in [0.0, 0.4, 2.0] {
            for (radius_m, share, depth, slide) in [
                (0.005, 0.8, 0.002, 0.0),
                (0.005, 1.0, 0.02, 0.01),
                (0.0002, 0.99, 0.015, 3.0),
                (0.02, 0.02, 1e-9, -0.2),
                (0.02, 0.0, 1e-3, 0.1),
            ] {
                let law = Indentation { pressure: Pressure::Ball, radius_m, modulus_pa: 21e3 };
                let series = SeriesCompliance::of_share(share, law).of_portion(0.7);
                let coulomb = Coulomb::new(DVec3::Z, friction).unwrap();
                let law = ConstraintLaw::Unilateral { coulomb, series: Some((series, 0.0)) };
                let mut two = Two { v: [DVec3::X * slide; 2], w: [[200.0, 80.0], [80.0, 150.0]] };
                let own = |w: f64| DMat3::from_diagonal(DVec3::splat(w));
                let mut rows = [row(law, -depth), row(law, -0.7 * depth)];
                (rows[0].inv_effective_mass_per_kg, rows[1].inv_effective_mass_per_kg) =
                    (own(200.0), own(150.0));
                let sweeps = solve_projected_gauss_seidel(
                    &mut rows,
                    &mut two,
                    h,
                    SolverLimits { max_iterations: 200, tolerance: 1e-12 },
                );
                assert!(sweeps.converged, "{sweeps:?}");
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
    fn a_fixed_surface_with_a_compliance_pushes_by_that_alone() {
        let law = Indentation { pressure: Pressure::Ball, radius_m: 0.005, modulus_pa: 21e3 };
        let series = SeriesCompliance::of_share(1.0, law);
        let coulomb = Coulomb::new(-DVec3::Z, 0.0).unwrap();
        let law = ConstraintLaw::Unilateral { coulomb, series: Some((series, 0.0)) };
        let mut fixed = Two { v: [DVec3::ZERO; 2], w: [[0.0; 2]; 2] };
        // A sum over no free nodes is −0.
        let own_per_kg = -DMat3::ZERO;
        let mut rows = [ConstraintRow {
            law,
            gap_m: DVec3::Z * 0.003,
            inv_effective_mass_per_kg: own_per_kg,
            impulse_ns: DVec3::ZERO,
        }];
        assert!(solve_projected_gauss_seidel(&mut rows, &mut fixed, 1e-3, within(20)).converged);
        let force_n = -rows[0].impulse_ns.z / 1e-3;
        assert!((force_n / series.force_n(0.003) - 1.0).abs() < 1e-9, "{force_n} N");
    }

    #[test]
    fn what_is_fixed_or_contradicts_itself_ends() {
        let mut two = Two { v: [DVec3::X, DVec3::X], w: [[1.0, 1.0], [1.0, 1.0]] };
        let own = |s: f64| DMat3::from_diagonal(DVec3::splat(s));
        // The same point asked to be at two places.
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
