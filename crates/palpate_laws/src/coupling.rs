//! A tool that gives way: a proxy without mass behind a stiff coupling whose force saturates.

use crate::{Answer, Effort, LawError, Row, Sweeps, solve_rows};
use glam::{DMat3, DVec3};

/// What draws a tool's proxy, which is what the body meets, to where the device is: a spring as long as its force is
/// below the largest, and from there on that force and no more, however far the device has gone. A virtual coupling (J. E.
/// Colgate, M. C. Stanley, J. M. Brown, Proc. IROS 1995) without mass and damper, implicit in time.
///
/// So a hand that goes deeper than a body can leaves the proxy behind on the surface, and no body is dragged through itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// k, N/m: below saturation the proxy stays F/k behind the device.
    pub stiffness_n_per_m: f64,
    /// The force at which it saturates, N.
    pub most_n: f64,
}

/// The proxy in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProxyStep {
    /// What draws it.
    pub coupling: Coupling,
    /// From where it would be at the end of the step if it moved as the device does, for which the rows' gaps are, to the
    /// device, m; less, if it is not to go as far in one step.
    pub short_m: DVec3,
}

/// What a tool does in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolMove {
    /// Where it begins and ends, m; behind a coupling, if it moves as its device does.
    pub from_m: DVec3,
    /// See `from_m`.
    pub to_m: DVec3,
    /// What draws it elsewhere.
    pub proxy: Option<ProxyStep>,
}

impl ToolMove {
    /// That of a tool behind `coupling`, if there is one, whose proxy is at `proxy_m` and whose device goes from one place to
    /// another; `radius_m` is `None` for a tool that holds.
    #[must_use]
    pub fn new(
        coupling: Option<Coupling>,
        device_m: (DVec3, DVec3),
        proxy_m: DVec3,
        radius_m: Option<f64>,
    ) -> Self {
        let Some(coupling) = coupling else {
            return Self { from_m: device_m.0, to_m: device_m.1, proxy: None };
        };
        let behind_m = device_m.0 - proxy_m;
        let proxy = Some(ProxyStep { coupling, short_m: coupling.short_m(behind_m, radius_m) });
        Self { from_m: proxy_m, to_m: device_m.1 - behind_m, proxy }
    }

    /// How far its coupling draws it if nothing is in the way, m.
    #[must_use]
    pub fn short_m(&self) -> DVec3 {
        self.proxy.map_or(DVec3::ZERO, |proxy| proxy.short_m)
    }
}

/// How often a coupling that gives way is looked at again in a step.
const LOOKS: usize = 8;
/// Most sweeps over the rows then.
const ROUGHLY: usize = 20;
/// The share of the largest force by which it may be exceeded.
const BEYOND: f64 = 1e-2;

impl Coupling {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// [`LawError::Stiffness`] and [`LawError::CouplingForce`] for what is not finite and above 0.
    pub fn validate(&self) -> Result<(), LawError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !positive(self.stiffness_n_per_m) {
            return Err(LawError::Stiffness(self.stiffness_n_per_m));
        }
        if positive(self.most_n) { Ok(()) } else { Err(LawError::CouplingForce(self.most_n)) }
    }

    /// How far behind the device the proxy is when the force saturates, m.
    #[must_use]
    pub fn stretch_m(&self) -> f64 {
        self.most_n / self.stiffness_n_per_m
    }

    /// `force_n`, but no more than the largest.
    #[must_use]
    pub fn limit(&self, force_n: DVec3) -> DVec3 {
        force_n.clamp_length_max(self.most_n)
    }

    /// How far the proxy, `behind_m` the device, may go towards it in one step beside the device's own motion: anywhere for
    /// a tool that holds (`radius_m` is `None`), half its radius for one that touches, so that it passes nothing unseen.
    #[must_use]
    pub fn short_m(&self, behind_m: DVec3, radius_m: Option<f64>) -> DVec3 {
        match radius_m {
            None => behind_m,
            Some(radius_m) => behind_m.clamp_length_max(self.stretch_m().max(0.5 * radius_m)),
        }
    }
}

/// Velocities of rows relative to a proxy that answers to what the tool's rows give.
struct WithProxy<'a, A, F> {
    rows: &'a mut A,
    is_tools: F,
    /// What the proxy moves beside the device's motion over the length of the step, m/s.
    velocity_m_per_s: DVec3,
    per_kg: f64,
}

impl<A: Answer, F: Fn(usize) -> bool> Answer for WithProxy<'_, A, F> {
    fn velocity_m_per_s(&self, row: usize) -> DVec3 {
        let proxy = if (self.is_tools)(row) { self.velocity_m_per_s } else { DVec3::ZERO };
        self.rows.velocity_m_per_s(row) - proxy
    }

    fn push(&mut self, row: usize, impulse_ns: DVec3) {
        self.rows.push(row, impulse_ns);
        if (self.is_tools)(row) {
            self.velocity_m_per_s -= self.per_kg * impulse_ns;
        }
    }
}

/// As [`solve_rows`], from no impulses, with the tool, whose rows are those that `is_tools` tells, behind a coupling. Returns also how far the
/// proxy goes in this step beside the device's own motion, m.
///
/// The proxy has no mass: the impulses Λ of its rows are those of the coupling, and it ends Λ/(h k) short of the device.
/// Where |Λ|/h would be more than the largest force, the coupling gives way along Λ, like a perfectly plastic slider, as
/// far as it takes for the force to be the largest.
pub fn solve_with_proxy(
    rows: &mut [Row],
    answer: &mut impl Answer,
    is_tools: impl Fn(usize) -> bool,
    proxy: ProxyStep,
    h: f64,
    effort: Effort,
) -> (Sweeps, DVec3) {
    let Coupling { stiffness_n_per_m, most_n } = proxy.coupling;
    let per_kg = 1.0 / (stiffness_n_per_m * h * h);
    let mut lightest = 0.0_f64;
    for (_, row) in rows.iter_mut().enumerate().filter(|(index, _)| is_tools(*index)) {
        let own = row.own_per_kg.x_axis.x.min(row.own_per_kg.y_axis.y).min(row.own_per_kg.z_axis.z);
        lightest = lightest.max(own);
        row.own_per_kg += DMat3::from_diagonal(DVec3::splat(per_kg));
    }
    // At first to where the coupling would be saturated if the proxy stayed; so that in the end its force is towards the
    // device.
    let goal = proxy.short_m.clamp_length_max(proxy.coupling.stretch_m());
    let answer = WithProxy { rows: answer, is_tools, velocity_m_per_s: goal / h, per_kg };
    let mut pull = Pull { rows, answer, h, effort, sweeps: Sweeps::default() };
    let force = pull.force_n(DVec3::ZERO);
    let beyond = force.length() - most_n;
    if beyond > BEYOND * most_n {
        // At first as far as needed if all rows that give something shared it equally.
        let first = beyond * (per_kg + lightest / pull.giving().max(1) as f64) * h * h;
        let search = Search { little: (0.0, beyond), before: None, much: None };
        pull.give_way(force.normalize(), search, first, most_n);
    } else if beyond < -BEYOND * most_n && goal != proxy.short_m {
        // There is room for more, perhaps for all.
        let more = proxy.short_m - goal;
        let beyond_all = pull.force_n(-more).length() - most_n;
        if beyond_all > BEYOND * most_n {
            let much = Some((more.length(), beyond));
            let search = Search { little: (0.0, beyond_all), before: None, much };
            pull.give_way(more.normalize(), search, 0.0, most_n);
        }
    }
    (pull.sweeps, pull.answer.velocity_m_per_s * h)
}

/// A coupling that pulls at rows.
struct Pull<'a, A, F> {
    rows: &'a mut [Row],
    answer: WithProxy<'a, A, F>,
    h: f64,
    effort: Effort,
    sweeps: Sweeps,
}

impl<A: Answer, F: Fn(usize) -> bool> Pull<'_, A, F> {
    /// What the tool's rows give, N, when it gives way by `more`, m.
    fn force_n(&mut self, more: DVec3) -> DVec3 {
        self.answer.velocity_m_per_s -= more / self.h;
        let now = solve_rows(self.rows, &mut self.answer, self.h, self.effort);
        self.sweeps = Sweeps { count: self.sweeps.count + now.count, converged: now.converged };
        self.tools().map(|row| row.impulse_ns).sum::<DVec3>() / self.h
    }

    fn tools(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().enumerate().filter(|(index, _)| (self.answer.is_tools)(*index)).map(|(_, row)| row)
    }

    /// How many of them give something.
    fn giving(&self) -> usize {
        self.tools().filter(|row| row.impulse_ns != DVec3::ZERO).count()
    }

    /// Gives way along `way` until the force along it is the largest.
    fn give_way(&mut self, way: DVec3, mut search: Search, first: f64, most_n: f64) {
        let mut given = 0.0;
        self.effort.sweeps = self.effort.sweeps.min(ROUGHLY);
        for look in 0..LOOKS {
            // In the end rather too little than nothing.
            let give = if look + 1 < LOOKS { search.guess(first) } else { search.little.0 };
            let beyond = self.force_n((give - given) * way).dot(way) - most_n;
            given = give;
            if beyond.abs() <= BEYOND * most_n {
                break;
            }
            search.note(give, beyond);
        }
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
    use crate::RowLaw;

    /// Masses that know nothing of each other, 2 per kg.
    struct Apart(Vec<DVec3>);

    impl Answer for Apart {
        fn velocity_m_per_s(&self, row: usize) -> DVec3 {
            self.0[row]
        }

        fn push(&mut self, row: usize, impulse_ns: DVec3) {
            self.0[row] += 2.0 * impulse_ns;
        }
    }

    const H: f64 = 1e-3;

    fn held(gap: f64) -> Row {
        let own_per_kg = DMat3::from_diagonal(DVec3::splat(2.0));
        Row { law: RowLaw::TwoSided, gap_m: DVec3::Z * gap, own_per_kg, impulse_ns: DVec3::ZERO }
    }

    fn step(coupling: Coupling, short: f64, mut rows: Vec<Row>) -> (Vec<Row>, Vec<DVec3>, DVec3) {
        let mut masses = Apart(vec![DVec3::ZERO; rows.len()]);
        let proxy = ProxyStep { coupling, short_m: DVec3::Z * short };
        let (sweeps, moved) = solve_with_proxy(
            &mut rows,
            &mut masses,
            |_| true,
            proxy,
            H,
            Effort { sweeps: 1000, tolerance: 1e-8 },
        );
        assert!(sweeps.converged || rows.len() > 1);
        (rows, masses.0, moved)
    }

    #[test]
    fn below_saturation_it_is_a_spring_and_the_row_is_closed() {
        let coupling = Coupling { stiffness_n_per_m: 5000.0, most_n: 100.0 };
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
        let coupling = Coupling { stiffness_n_per_m: 20e3, most_n: 0.3 };
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
    fn what_is_free_goes_to_the_device() {
        let coupling = Coupling { stiffness_n_per_m: 20e3, most_n: 5.0 };
        let (_, _, moved) = step(coupling, 3e-3, vec![]);
        assert_eq!(moved, DVec3::Z * 3e-3);
        assert_eq!(coupling.stretch_m(), 0.25e-3);
        assert_eq!(coupling.short_m(DVec3::X, Some(0.01)), DVec3::X * 0.005);
        assert_eq!(coupling.short_m(DVec3::X, None), DVec3::X);
        assert_eq!(coupling.limit(DVec3::X * 7.0), DVec3::X * 5.0);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let soft = Coupling { stiffness_n_per_m: bad, most_n: 1.0 };
            assert!(matches!(soft.validate(), Err(LawError::Stiffness(_))));
            let weak = Coupling { stiffness_n_per_m: 1.0, most_n: bad };
            assert!(matches!(weak.validate(), Err(LawError::CouplingForce(_))));
        }
    }
}
