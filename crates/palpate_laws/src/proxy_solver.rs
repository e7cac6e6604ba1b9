//! The constraint solver with tools behind virtual couplings.

use crate::{
    ConstraintRow, ImpulseResponse, ProxyStep, SolverLimits, SolverReport, solve_projected_gauss_seidel,
};
use glam::{DMat3, DVec3};

/// Maximum number of iterations for the yield of a coupling in one step.
const MAX_PLASTIC_ITERATIONS: usize = 8;
/// Maximum number of sweeps in each of them.
const COARSE_ITERATIONS: usize = 20;
/// Relative tolerance of the force limit.
const FORCE_TOLERANCE: f64 = 1e-2;

/// State of a tool's proxy in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyState {
    proxy: ProxyStep,
    /// Displacement of the proxy relative to the device's motion, divided by the step length, m/s.
    velocity_m_per_s: DVec3,
    /// Change of that velocity per impulse on the proxy, 1/kg.
    per_kg: f64,
    /// Largest inverse effective mass of its rows, 1/kg.
    lightest_per_kg: f64,
}

impl ProxyState {
    /// Initial state of a proxy.
    #[must_use]
    pub fn new(proxy: ProxyStep) -> Self {
        Self { proxy, velocity_m_per_s: DVec3::ZERO, per_kg: 0.0, lightest_per_kg: 0.0 }
    }

    /// Displacement of the proxy relative to the device's motion in a step of length `h` (s), m.
    #[must_use]
    pub fn displacement_m(&self, h: f64) -> DVec3 {
        self.velocity_m_per_s * h
    }
}

/// Response of rows that includes the motion of the proxies.
struct WithProxies<'a, A, F> {
    rows: &'a mut A,
    tools: &'a mut [ProxyState],
    tool_of: F,
}

impl<A: ImpulseResponse, F: Fn(usize) -> Option<usize>> WithProxies<'_, A, F> {
    fn tool(&mut self, row: usize) -> Option<&mut ProxyState> {
        self.tools.get_mut((self.tool_of)(row)?)
    }
}

impl<A: ImpulseResponse, F: Fn(usize) -> Option<usize>> ImpulseResponse for WithProxies<'_, A, F> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        let tool = (self.tool_of)(row).and_then(|tool| self.tools.get(tool));
        self.rows.velocity_m_per_s(row) - tool.map_or(DVec3::ZERO, |tool| tool.velocity_m_per_s)
    }

    fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
        self.rows.apply_impulse(row, impulse_ns);
        if let Some(tool) = self.tool(row) {
            tool.velocity_m_per_s -= tool.per_kg * impulse_ns;
        }
    }
}

/// [`solve_projected_gauss_seidel`] with zero initial impulses and one tool behind a coupling; `is_tools` selects its
/// rows. Also returns the proxy's displacement relative to the device's motion, m. See [`solve_with_proxies`].
pub fn solve_with_proxy(
    rows: &mut [ConstraintRow],
    response: &mut impl ImpulseResponse,
    is_tools: impl Fn(usize) -> bool,
    proxy: ProxyStep,
    h: f64,
    effort: SolverLimits,
) -> (SolverReport, DVec3) {
    let mut tools = [ProxyState::new(proxy)];
    let report = solve_with_proxies(rows, response, &mut tools, |row| is_tools(row).then_some(0), h, effort);
    let [tool] = tools;
    (report, tool.displacement_m(h))
}

/// [`solve_projected_gauss_seidel`] with zero initial impulses and `tools` behind couplings. `tool_of` maps a row to
/// the index of its tool. [`ProxyState::displacement_m`] then holds each proxy's displacement.
///
/// A proxy has no mass. The sum Λ of its rows' impulses is the impulse of the coupling, and the proxy ends Λ/(h k)
/// away from the device. Where |Λ|/h would exceed the force limit, the coupling yields along Λ like a perfectly
/// plastic slider until the force is at the limit. Several tools are handled in turn, in at most three rounds.
pub fn solve_with_proxies(
    rows: &mut [ConstraintRow],
    response: &mut impl ImpulseResponse,
    tools: &mut [ProxyState],
    tool_of: impl Fn(usize) -> Option<usize>,
    h: f64,
    effort: SolverLimits,
) -> SolverReport {
    for tool in &mut *tools {
        // Start where the coupling would saturate if the proxy stayed: the final force then points towards the
        // device.
        let goal = tool.proxy.remaining_m.clamp_length_max(tool.proxy.coupling.stretch_m());
        tool.velocity_m_per_s = goal / h;
        (tool.per_kg, tool.lightest_per_kg) = (1.0 / (tool.proxy.coupling.stiffness_n_per_m * h * h), 0.0);
    }
    for (index, row) in rows.iter_mut().enumerate() {
        let Some(tool) = tool_of(index).and_then(|tool| tools.get_mut(tool)) else { continue };
        let own = row
            .inv_effective_mass_per_kg
            .x_axis
            .x
            .min(row.inv_effective_mass_per_kg.y_axis.y)
            .min(row.inv_effective_mass_per_kg.z_axis.z);
        tool.lightest_per_kg = tool.lightest_per_kg.max(own);
        row.inv_effective_mass_per_kg += DMat3::from_diagonal(DVec3::splat(tool.per_kg));
    }
    let rounds = if tools.len() > 1 { MAX_ROUNDS } else { 1 };
    let response = WithProxies { rows: response, tools, tool_of };
    let mut problem = CoupledProblem { rows, response, h, effort, report: SolverReport::default() };
    problem.solve();
    for round in 0..rounds {
        let mut is_done = true;
        for index in 0..problem.response.tools.len() {
            is_done &= problem.solve_plastic_flow(index, round == 0);
        }
        if is_done {
            break;
        }
    }
    problem.report
}

/// Maximum number of rounds over several tools.
const MAX_ROUNDS: usize = 3;

/// Constraint rows with the couplings of tools.
struct CoupledProblem<'a, A, F> {
    rows: &'a mut [ConstraintRow],
    response: WithProxies<'a, A, F>,
    h: f64,
    effort: SolverLimits,
    report: SolverReport,
}

impl<A: ImpulseResponse, F: Fn(usize) -> Option<usize>> CoupledProblem<'_, A, F> {
    fn solve(&mut self) {
        let now = solve_projected_gauss_seidel(self.rows, &mut self.response, self.h, self.effort);
        self.report =
            SolverReport { iterations: self.report.iterations + now.iterations, converged: now.converged };
    }

    /// Limits the force of the tool `index`. In the first round the tool also follows its device as far as the limit
    /// allows. Returns whether nothing had to change.
    fn solve_plastic_flow(&mut self, index: usize, is_first: bool) -> bool {
        let Some(&ProxyState { proxy, per_kg, lightest_per_kg, .. }) = self.response.tools.get(index) else {
            return true;
        };
        let (h, max_force_n) = (self.h, proxy.coupling.max_force_n);
        let goal = proxy.remaining_m.clamp_length_max(proxy.coupling.stretch_m());
        let force = self.force_n(index);
        let excess = force.length() - max_force_n;
        if excess > FORCE_TOLERANCE * max_force_n {
            // First estimate: all active rows share the yield equally.
            let first = excess * (per_kg + lightest_per_kg / self.active_rows(index).max(1) as f64) * h * h;
            let search = Search { too_little: (0.0, excess), previous: None, too_much: None };
            self.find_yield(index, force.normalize(), search, first);
            return false;
        }
        if is_first && excess < -FORCE_TOLERANCE * max_force_n && goal != proxy.remaining_m {
            // The limit allows more displacement, perhaps all of it.
            let more = proxy.remaining_m - goal;
            let excess_of_all = self.apply_yield(index, -more).length() - max_force_n;
            if excess_of_all > FORCE_TOLERANCE * max_force_n {
                let too_much = Some((more.length(), excess));
                let search = Search { too_little: (0.0, excess_of_all), previous: None, too_much };
                self.find_yield(index, more.normalize(), search, 0.0);
            }
            return false;
        }
        true
    }

    /// Moves a tool's goal back by `more`, m, and returns the resulting force of its rows, N.
    fn apply_yield(&mut self, index: usize, more: DVec3) -> DVec3 {
        if let Some(tool) = self.response.tools.get_mut(index) {
            tool.velocity_m_per_s -= more / self.h;
        }
        self.solve();
        self.force_n(index)
    }

    fn force_n(&self, index: usize) -> DVec3 {
        self.rows_of(index).map(|row| row.impulse_ns).sum::<DVec3>() / self.h
    }

    fn rows_of(&self, tool: usize) -> impl Iterator<Item = &ConstraintRow> {
        let rows = self.rows.iter().enumerate();
        rows.filter(move |(row, _)| (self.response.tool_of)(*row) == Some(tool)).map(|(_, row)| row)
    }

    /// Number of active rows of a tool.
    fn active_rows(&self, tool: usize) -> usize {
        self.rows_of(tool).filter(|row| row.impulse_ns != DVec3::ZERO).count()
    }

    /// Yields along `direction` until the force along it is at the limit.
    fn find_yield(&mut self, index: usize, direction: DVec3, mut search: Search, first: f64) {
        let Some(max_force_n) = self.response.tools.get(index).map(|tool| tool.proxy.coupling.max_force_n)
        else {
            return;
        };
        let mut yielded = 0.0;
        let max_iterations = self.effort.max_iterations;
        self.effort.max_iterations = max_iterations.min(COARSE_ITERATIONS);
        for iteration in 0..MAX_PLASTIC_ITERATIONS {
            // The last iteration uses the largest yield that is known to be too little.
            let give = if iteration + 1 < MAX_PLASTIC_ITERATIONS {
                search.guess(first)
            } else {
                search.too_little.0
            };
            let excess = self.apply_yield(index, (give - yielded) * direction).dot(direction) - max_force_n;
            yielded = give;
            if excess.abs() <= FORCE_TOLERANCE * max_force_n {
                break;
            }
            search.note(give, excess);
        }
        self.effort.max_iterations = max_iterations;
    }
}

/// One-dimensional search for the yield. It holds two points with too little yield and one with too much, each with
/// the excess force, N. It uses the secant method until the solution is bracketed, then the Illinois variant of
/// regula falsi.
struct Search {
    too_little: (f64, f64),
    previous: Option<(f64, f64)>,
    too_much: Option<(f64, f64)>,
}

impl Search {
    /// Next point; `first` at the beginning.
    fn guess(&self, first: f64) -> f64 {
        let (from, to) = match (self.too_much, self.previous) {
            (Some(too_much), _) => (self.too_little, too_much),
            (None, Some(before)) => (before, self.too_little),
            (None, None) => return first,
        };
        let guess = (from.0 * to.1 - to.0 * from.1) / (to.1 - from.1);
        if guess.is_finite() && guess > self.too_little.0 { guess } else { self.too_little.0 + first }
    }

    fn note(&mut self, give: f64, excess: f64) {
        // The function value at an end that is retained is halved.
        if excess > 0.0 {
            self.previous = Some(self.too_little);
            self.too_little = (give, excess);
            self.too_much = self.too_much.map(|(give, excess)| (give, 0.5 * excess));
        } else {
            if self.too_much.is_some() {
                self.too_little.1 *= 0.5;
            }
            self.too_much = Some((give, excess));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ConstraintLaw, VirtualCoupling};

    /// Uncoupled masses of 2 per kg.
    struct Apart(Vec<DVec3>);

    impl ImpulseResponse for Apart {
        fn velocity_m_per_s(&self, row: usize) -> DVec3 {
            self.0[row]
        }

        fn apply_impulse(&mut self, row: usize, impulse_ns: DVec3) {
            self.0[row] += 2.0 * impulse_ns;
        }
    }

    const H: f64 = 1e-3;

    fn held(gap: f64) -> ConstraintRow {
        let per_kg = DMat3::from_diagonal(DVec3::splat(2.0));
        ConstraintRow {
            law: ConstraintLaw::Bilateral,
            gap_m: DVec3::Z * gap,
            inv_effective_mass_per_kg: per_kg,
            impulse_ns: DVec3::ZERO,
        }
    }

    fn step(
        coupling: VirtualCoupling,
        short: f64,
        mut rows: Vec<ConstraintRow>,
    ) -> (Vec<ConstraintRow>, Vec<DVec3>, DVec3) {
        let mut masses = Apart(vec![DVec3::ZERO; rows.len()]);
        let proxy = ProxyStep { coupling, remaining_m: DVec3::Z * short };
        let (report, moved) = solve_with_proxy(
            &mut rows,
            &mut masses,
            |_| true,
            proxy,
            H,
            SolverLimits { max_iterations: 1000, tolerance: 1e-8 },
        );
        assert!(report.converged || rows.len() > 1);
        (rows, masses.0, moved)
    }

    #[test]
    fn coupling_below_its_limit_is_a_spring_and_closes_the_row() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 5000.0, max_force_n: 100.0 };
        // The device has moved 1 mm down; the gap of the row for a proxy that moved with it is +1 mm.
        let (rows, v, moved) = step(coupling, 0.0, vec![held(1e-3)]);
        let impulse = rows[0].impulse_ns.z;
        // h v + gap = moved, moved = -impulse / (h k), v = 2 impulse.
        let expected = -1e-3 / (2.0 * H + 1.0 / (H * 5000.0));
        assert!((impulse - expected).abs() < 1e-12 * expected.abs(), "{impulse} {expected}");
        assert!((moved.z + impulse / (H * 5000.0)).abs() < 1e-15);
        assert!((H * v[0].z + 1e-3 - moved.z).abs() < 1e-15);
    }

    #[test]
    fn saturated_coupling_ends_at_its_force_limit() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 0.3 };
        for rows in [vec![held(1e-3)], vec![held(1e-3), held(0.7e-3), held(-0.2e-3)]] {
            for short in [0.0, -1e-4, -5e-3, 2e-3] {
                let (rows, v, moved) = step(coupling, short, rows.clone());
                let force = rows.iter().map(|r| r.impulse_ns).sum::<DVec3>() / H;
                assert!((force.length() / 0.3 - 1.0).abs() < 5e-2, "{force} at {short}");
                for (row, v) in rows.iter().zip(v) {
                    assert!((v * H + row.gap_m - moved).length() < 2e-5, "the row is still closed");
                }
            }
        }
    }

    #[test]
    fn two_tools_on_one_mass_keep_their_own_force_limits() {
        // One row each on a shared mass; the second coupling saturates.
        struct Shared(DVec3);
        impl ImpulseResponse for Shared {
            fn velocity_m_per_s(&self, _: usize) -> DVec3 {
                self.0
            }
            fn apply_impulse(&mut self, _: usize, impulse_ns: DVec3) {
                self.0 += 2.0 * impulse_ns;
            }
        }
        let proxy = |max_force_n| ProxyStep {
            coupling: VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n },
            remaining_m: DVec3::ZERO,
        };
        let mut tools = [ProxyState::new(proxy(50.0)), ProxyState::new(proxy(0.5))];
        let mut rows = [held(0.4e-3), held(-0.4e-3)];
        let mut mass = Shared(DVec3::ZERO);
        let effort = SolverLimits { max_iterations: 1000, tolerance: 1e-10 };
        solve_with_proxies(&mut rows, &mut mass, &mut tools, Some, H, effort);
        let force = |row: usize| rows[row].impulse_ns.z / H;
        assert!((force(1) - 0.5).abs() < 0.01, "{}", force(1));
        // First tool: f h = -k h (gap + h v), v = 2 h (f + 0.5) of the shared mass.
        let expected = -20e3 * (0.4e-3 + 2.0 * H * H * force(1)) / (1.0 + 20e3 * 2.0 * H * H);
        assert!((force(0) / expected - 1.0).abs() < 1e-6, "{} {expected}", force(0));
    }

    #[test]
    fn proxy_without_rows_reaches_the_device() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 5.0 };
        let (_, _, moved) = step(coupling, 3e-3, vec![]);
        assert_eq!(moved, DVec3::Z * 3e-3);
        assert_eq!(coupling.stretch_m(), 0.25e-3);
        assert_eq!(coupling.remaining_m(DVec3::X, Some(0.01)), DVec3::X * 0.005);
        assert_eq!(coupling.remaining_m(DVec3::X, None), DVec3::X);
        assert_eq!(coupling.limit(DVec3::X * 7.0), DVec3::X * 5.0);
    }
}
