//! The constraint solver with tools behind virtual couplings.

use crate::{
    ConstraintRow, ImpulseResponse, ProxyStep, SolverLimits, SolverReport, solve_projected_gauss_seidel,
};
use glam::{DMat3, DVec3};

/// How often a coupling that gives way is looked at again in a step.
const MAX_PLASTIC_ITERATIONS: usize = 8;
/// Most sweeps over the rows then.
const COARSE_ITERATIONS: usize = 20;
/// The share of the largest force by which it may be exceeded.
const FORCE_TOLERANCE: f64 = 1e-2;

/// A tool behind a coupling in a step, and how far that draws it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyState {
    proxy: ProxyStep,
    /// What the proxy moves beside the device's motion over the length of the step, m/s.
    velocity_m_per_s: DVec3,
    /// What an impulse on the proxy does to that, 1/kg.
    per_kg: f64,
    /// H A⁻¹ Hᵀ of the lightest of its rows, 1/kg.
    lightest_per_kg: f64,
}

impl ProxyState {
    /// A tool behind that proxy.
    #[must_use]
    pub fn new(proxy: ProxyStep) -> Self {
        Self { proxy, velocity_m_per_s: DVec3::ZERO, per_kg: 0.0, lightest_per_kg: 0.0 }
    }

    /// How far it was drawn in a step of length `h`, s, beside the device's own motion, m.
    #[must_use]
    pub fn displacement_m(&self, h: f64) -> DVec3 {
        self.velocity_m_per_s * h
    }
}

/// Velocities of rows relative to proxies that answer to what their tools' rows give.
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

/// As [`solve_rows`], from no impulses, with a tool behind a coupling whose rows are those that `is_tools` tells. Returns also how
/// far the proxy goes in this step beside the device's own motion, m. See [`solve_with_proxies`].
pub fn solve_with_proxy(
    rows: &mut [ConstraintRow],
    answer: &mut impl ImpulseResponse,
    is_tools: impl Fn(usize) -> bool,
    proxy: ProxyStep,
    h: f64,
    effort: SolverLimits,
) -> (SolverReport, DVec3) {
    let mut tools = [ProxyState::new(proxy)];
    let sweeps = solve_with_proxies(rows, answer, &mut tools, |row| is_tools(row).then_some(0), h, effort);
    let [tool] = tools;
    (sweeps, tool.displacement_m(h))
}

/// As [`solve_rows`], from no impulses, with `tools` behind couplings; `tool_of` tells of each row whose it is, if it is one of
/// theirs. How far each goes in this step beside its device's own motion is [`DrawnTool::drawn_m`].
///
/// A proxy has no mass: the impulses Λ of its rows are those of the coupling, and it ends Λ/(h k) short of the device.
/// Where |Λ|/h would be more than the largest force, the coupling gives way along Λ, like a perfectly plastic slider, as
/// far as it takes for the force to be the largest. Several tools are looked at in turn, three times at most.
pub fn solve_with_proxies(
    rows: &mut [ConstraintRow],
    answer: &mut impl ImpulseResponse,
    tools: &mut [ProxyState],
    tool_of: impl Fn(usize) -> Option<usize>,
    h: f64,
    effort: SolverLimits,
) -> SolverReport {
    for tool in &mut *tools {
        // At first to where the coupling would be saturated if the proxy stayed; so that in the end its force is towards the
        // device.
        let goal = tool.proxy.short_m.clamp_length_max(tool.proxy.coupling.stretch_m());
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
    let answer = WithProxies { rows: answer, tools, tool_of };
    let mut pull = CoupledProblem { rows, answer, h, effort, sweeps: SolverReport::default() };
    pull.solve();
    for round in 0..rounds {
        let mut is_done = true;
        for index in 0..pull.answer.tools.len() {
            is_done &= pull.solve_plastic_flow(index, round == 0);
        }
        if is_done {
            break;
        }
    }
    pull.sweeps
}

/// How often several tools are looked at in turn.
const MAX_ROUNDS: usize = 3;

/// Couplings that pull at rows.
struct CoupledProblem<'a, A, F> {
    rows: &'a mut [ConstraintRow],
    answer: WithProxies<'a, A, F>,
    h: f64,
    effort: SolverLimits,
    sweeps: SolverReport,
}

impl<A: ImpulseResponse, F: Fn(usize) -> Option<usize>> CoupledProblem<'_, A, F> {
    fn solve(&mut self) {
        let now = solve_projected_gauss_seidel(self.rows, &mut self.answer, self.h, self.effort);
        self.sweeps =
            SolverReport { iterations: self.sweeps.iterations + now.iterations, converged: now.converged };
    }

    /// Sees to it that the tool `index` gives its largest force at most, and follows its device as far as that allows if it is
    /// looked at for the first time. Whether that was so already.
    fn solve_plastic_flow(&mut self, index: usize, is_first: bool) -> bool {
        let Some(&ProxyState { proxy, per_kg, lightest_per_kg, .. }) = self.answer.tools.get(index) else {
            return true;
        };
        let (h, most_n) = (self.h, proxy.coupling.max_force_n);
        let goal = proxy.short_m.clamp_length_max(proxy.coupling.stretch_m());
        let force = self.force_n(index);
        let beyond = force.length() - most_n;
        if beyond > FORCE_TOLERANCE * most_n {
            // At first as far as needed if all rows that give something shared it equally.
            let first = beyond * (per_kg + lightest_per_kg / self.giving(index).max(1) as f64) * h * h;
            let search = Search { little: (0.0, beyond), before: None, much: None };
            self.give_way(index, force.normalize(), search, first);
            return false;
        }
        if is_first && beyond < -FORCE_TOLERANCE * most_n && goal != proxy.short_m {
            // There is room for more, perhaps for all.
            let more = proxy.short_m - goal;
            let beyond_all = self.give(index, -more).length() - most_n;
            if beyond_all > FORCE_TOLERANCE * most_n {
                let much = Some((more.length(), beyond));
                let search = Search { little: (0.0, beyond_all), before: None, much };
                self.give_way(index, more.normalize(), search, 0.0);
            }
            return false;
        }
        true
    }

    /// What the rows of a tool give, N, when it gives way by `more`, m.
    fn give(&mut self, index: usize, more: DVec3) -> DVec3 {
        if let Some(tool) = self.answer.tools.get_mut(index) {
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
        rows.filter(move |(row, _)| (self.answer.tool_of)(*row) == Some(tool)).map(|(_, row)| row)
    }

    /// How many of a tool's rows give something.
    fn giving(&self, tool: usize) -> usize {
        self.rows_of(tool).filter(|row| row.impulse_ns != DVec3::ZERO).count()
    }

    /// Lets a tool give way along `way` until the force along it is the largest.
    fn give_way(&mut self, index: usize, way: DVec3, mut search: Search, first: f64) {
        let Some(most_n) = self.answer.tools.get(index).map(|tool| tool.proxy.coupling.max_force_n) else {
            return;
        };
        let mut given = 0.0;
        let sweeps = self.effort.max_iterations;
        self.effort.max_iterations = sweeps.min(COARSE_ITERATIONS);
        for look in 0..MAX_PLASTIC_ITERATIONS {
            // In the end rather too little than nothing.
            let give = if look + 1 < MAX_PLASTIC_ITERATIONS { search.guess(first) } else { search.little.0 };
            let beyond = self.give(index, (give - given) * way).dot(way) - most_n;
            given = give;
            if beyond.abs() <= FORCE_TOLERANCE * most_n {
                break;
            }
            search.note(give, beyond);
        }
        self.effort.max_iterations = sweeps;
    }
}

/// How far a coupling has to give way: where that was too little, twice, and too much, each with what the force was beyond the
/// largest, N. By the secant while all was too little, then by the Illinois form of regula falsi.
struct Search {
    little: (f64, f64),
    before: Option<(f64, f64)>,
    much: Option<(f64, f64)>,
}

impl Search {
    /// Where to look next; `first` at first.
    fn guess(&self, first: f64) -> f64 {
        let (from, to) = match (self.much, self.before) {
            (Some(much), _) => (self.little, much),
            (None, Some(before)) => (before, self.little),
            (None, None) => return first,
        };
        let guess = (from.0 * to.1 - to.0 * from.1) / (to.1 - from.1);
        if guess.is_finite() && guess > self.little.0 { guess } else { self.little.0 + first }
    }

    fn note(&mut self, give: f64, beyond: f64) {
        // An end that stays counts half.
        if beyond > 0.0 {
            self.before = Some(self.little);
            self.little = (give, beyond);
            self.much = self.much.map(|(give, beyond)| (give, 0.5 * beyond));
        } else {
            if self.much.is_some() {
                self.little.1 *= 0.5;
            }
            self.much = Some((give, beyond));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ConstraintLaw, VirtualCoupling};

    /// Masses that know nothing of each other, 2 per kg.
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
        let own_per_kg = DMat3::from_diagonal(DVec3::splat(2.0));
        ConstraintRow {
            law: ConstraintLaw::Bilateral,
            gap_m: DVec3::Z * gap,
            inv_effective_mass_per_kg: own_per_kg,
            impulse_ns: DVec3::ZERO,
        }
    }

    fn step(
        coupling: VirtualCoupling,
        short: f64,
        mut rows: Vec<ConstraintRow>,
    ) -> (Vec<ConstraintRow>, Vec<DVec3>, DVec3) {
        let mut masses = Apart(vec![DVec3::ZERO; rows.len()]);
        let proxy = ProxyStep { coupling, short_m: DVec3::Z * short };
        let (sweeps, moved) = solve_with_proxy(
            &mut rows,
            &mut masses,
            |_| true,
            proxy,
            H,
            SolverLimits { max_iterations: 1000, tolerance: 1e-8 },
        );
        assert!(sweeps.converged || rows.len() > 1);
        (rows, masses.0, moved)
    }

    #[test]
    fn below_saturation_it_is_a_spring_and_the_row_is_closed() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 5000.0, max_force_n: 100.0 };
        // The device has gone 1 mm down: the row's gap for a proxy that went with it is +1 mm.
        let (rows, v, moved) = step(coupling, 0.0, vec![held(1e-3)]);
        let impulse = rows[0].impulse_ns.z;
        // h v + gap = moved, moved = -impulse / (h k), v = 2 impulse.
        let expected = -1e-3 / (2.0 * H + 1.0 / (H * 5000.0));
        assert!((impulse - expected).abs() < 1e-12 * expected.abs(), "{impulse} {expected}");
        assert!((moved.z + impulse / (H * 5000.0)).abs() < 1e-15);
        assert!((H * v[0].z + 1e-3 - moved.z).abs() < 1e-15);
    }

    #[test]
    fn it_never_gives_more_than_its_largest_force_and_ends_where_that_is() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 0.3 };
        for rows in [vec![held(1e-3)], vec![held(1e-3), held(0.7e-3), held(-0.2e-3)]] {
            for short in [0.0, -1e-4, -5e-3, 2e-3] {
                let (rows, v, moved) = step(coupling, short, rows.clone());
                let force = rows.iter().map(|r| r.impulse_ns).sum::<DVec3>() / H;
                assert!((force.length() / 0.3 - 1.0).abs() < 5e-2, "{force} at {short}");
                for (row, v) in rows.iter().zip(v) {
                    assert!((v * H + row.gap_m - moved).length() < 2e-5, "the row is closed all the same");
                }
            }
        }
    }

    #[test]
    fn tools_that_pull_at_the_same_mass_from_two_sides_keep_their_own_limits() {
        // One row each, on one mass; the second coupling saturates.
        struct Shared(DVec3);
        impl ImpulseResponse for Shared {
            fn velocity_m_per_s(&self, _: usize) -> DVec3 {
                self.0
            }
            fn apply_impulse(&mut self, _: usize, impulse_ns: DVec3) {
                self.0 += 2.0 * impulse_ns;
            }
        }
        let proxy = |most_n| ProxyStep {
            coupling: VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: most_n },
            short_m: DVec3::ZERO,
        };
        let mut tools = [ProxyState::new(proxy(50.0)), ProxyState::new(proxy(0.5))];
        let mut rows = [held(0.4e-3), held(-0.4e-3)];
        let mut mass = Shared(DVec3::ZERO);
        let effort = SolverLimits { max_iterations: 1000, tolerance: 1e-10 };
        solve_with_proxies(&mut rows, &mut mass, &mut tools, Some, H, effort);
        let force = |row: usize| rows[row].impulse_ns.z / H;
        assert!((force(1) - 0.5).abs() < 0.01, "{}", force(1));
        // The first: f h = -k h (gap + h v), v = 2 h (f + 0.5) of the shared mass.
        let expected = -20e3 * (0.4e-3 + 2.0 * H * H * force(1)) / (1.0 + 20e3 * 2.0 * H * H);
        assert!((force(0) / expected - 1.0).abs() < 1e-6, "{} {expected}", force(0));
    }

    #[test]
    fn what_is_free_goes_to_the_device() {
        let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 5.0 };
        let (_, _, moved) = step(coupling, 3e-3, vec![]);
        assert_eq!(moved, DVec3::Z * 3e-3);
        assert_eq!(coupling.stretch_m(), 0.25e-3);
        assert_eq!(coupling.short_m(DVec3::X, Some(0.01)), DVec3::X * 0.005);
        assert_eq!(coupling.short_m(DVec3::X, None), DVec3::X);
        assert_eq!(coupling.limit(DVec3::X * 7.0), DVec3::X * 5.0);
    }
}
