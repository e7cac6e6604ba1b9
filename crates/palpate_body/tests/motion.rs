//! Motion against closed forms: both integrators, gravity, momentum, energy, state.

use glam::DVec3;
use palpate_body::*;
use palpate_laws::{ForceLaw, SkinLaw};
use proptest::prelude::*;

const G: DVec3 = DVec3::new(0.0, 0.0, -9.81);

fn implicit(solver: LinearSolver) -> LinearlyImplicitEuler {
    LinearlyImplicitEuler { solver, ..LinearlyImplicitEuler::default() }
}

/// Both integrators, the implicit one with both solvers.
fn integrators() -> [Integrator; 3] {
    let exact = LinearlyImplicitEuler { tolerance: 1e-12, ..implicit(LinearSolver::ConjugateGradients) };
    [SemiImplicitEuler::default().into(), implicit(LinearSolver::Cholesky).into(), exact.into()]
}

/// Nodes of mass `m` at `at`, the first fixed, each joined to the next.
fn string(at: &[DVec3], m: f64, law: ForceLaw, b: f64) -> NetworkBuilder {
    let mut builder = NetworkBuilder::new();
    let nodes: Vec<usize> = at.iter().map(|&x| builder.node(x, m)).collect();
    nodes.windows(2).for_each(|pair| {
        builder.spring(pair[0], pair[1], law, b);
    });
    builder.fix([0])
}

fn linear(k: f64) -> ForceLaw {
    ForceLaw::Linear { stiffness_n_per_m: k }
}

fn body(network: Network) -> Body {
    Body::new(network, Surface::default()).unwrap()
}

/// A mass on a spring and a damper, displaced by `out`.
fn oscillator(k: f64, b: f64, m: f64, out: f64) -> Body {
    let mut body = body(string(&[DVec3::ZERO, DVec3::X], m, linear(k), b).build().unwrap());
    body.set_state(&[DVec3::ZERO, DVec3::X * (1.0 + out)], &[DVec3::ZERO; 2]).unwrap();
    body
}

fn block(n: usize, k: f64, damping_ratio: f64) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: k, damping_ratio, mass_kg: 1.0 };
    let block = Block::new([n; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// Steps so long that each is a Newton step towards rest.
fn to_rest(body: &mut Body, steps: usize) {
    let newton = LinearlyImplicitEuler { tick_s: 1e4, ..implicit(LinearSolver::Cholesky) };
    body.advance(None, steps, newton).unwrap();
}

#[test]
fn implicit_oscillator_follows_the_discrete_closed_form() {
    let (k, b, m, h) = (80.0, 0.3, 0.05, 1e-3 / 3.0);
    let mut body = oscillator(k, b, m, 0.02);
    let settings = LinearlyImplicitEuler { substeps: 3, ..implicit(LinearSolver::Cholesky) };
    let (mut q, mut v) = (0.02, 0.0);
    for _ in 0..500 {
        body.advance(None, 1, settings).unwrap();
        for _ in 0..3 {
            v += h * (-k * q - b * v - h * k * v) / (m + h * b + h * h * k);
            q += h * v;
        }
        assert!((body.positions_m()[1].x - 1.0 - q).abs() < 1e-13);
        assert!((body.velocities_m_per_s()[1].x - v).abs() < 1e-12);
    }
}

#[test]
fn both_integrators_are_of_first_order() {
    // Against the closed form of a damped oscillator after 0.1 s.
    let (k, b, m): (f64, f64, f64) = (80.0, 0.4, 0.05);
    let (rate, omega) = (b / (2.0 * m), (k / m - (b / (2.0 * m)).powi(2)).sqrt());
    let t: f64 = 0.1;
    let exact = 0.02 * (-rate * t).exp() * ((omega * t).cos() + rate / omega * (omega * t).sin());
    let error = |integrator: Integrator| {
        let mut body = oscillator(k, b, m, 0.02);
        body.advance(None, 100, integrator).unwrap();
        (body.positions_m()[1].x - 1.0 - exact).abs()
    };
    let semi = |n| SemiImplicitEuler { min_substeps: n, ..SemiImplicitEuler::default() }.into();
    let whole = |n| LinearlyImplicitEuler { substeps: n, ..implicit(LinearSolver::Cholesky) }.into();
    for (coarse, fine) in [(error(semi(8)), error(semi(16))), (error(whole(8)), error(whole(16)))] {
        assert!((1.9..2.1).contains(&(coarse / fine)), "{coarse} m, then {fine} m");
    }
}

#[test]
fn both_linear_solvers_agree_and_are_reported() {
    let run = |integrator: Integrator| {
        let mut body = block(5, 400.0, 0.3);
        let node = 2 + 5 * (2 + 5 * 4);
        let at = body.positions_m()[node];
        let mut tool = ToolContact::hold(&body, node, at).unwrap();
        let path: Vec<ToolPoint> = (0..=60)
            .map(|i| ToolPoint::at_rest(at - DVec3::Z * 0.008 * (f64::from(i) / 60.0) + DVec3::X * 0.002))
            .collect();
        let report = body.advance(Some((&mut tool, &path)), 60, integrator).unwrap();
        (body, report, tool)
    };
    let [_, cholesky, gradients] = integrators().map(run);
    assert_eq!(cholesky.1.solved_by, SolvedBy::Cholesky);
    assert!(matches!(gradients.1.solved_by, SolvedBy::ConjugateGradients { iterations: 1..=200 }));
    for (a, b) in cholesky.0.positions_m().iter().zip(gradients.0.positions_m()) {
        assert!((*a - *b).length() < 1e-10);
    }
    // The driven node is at its prescribed position.
    assert!(
        (cholesky.2.displayed_force_n(&cholesky.0) - gradients.2.displayed_force_n(&gradients.0)).length()
            < 1e-6
    );
    assert_eq!(Integrator::default(), SemiImplicitEuler::default().into());
}

#[test]
fn one_implicit_step_is_stable_where_explicit_steps_are_rejected() {
    let mut body = block(4, 1e10, 0.2);
    body.set_gravity(G).unwrap();
    assert!(matches!(body.advance(None, 1, SemiImplicitEuler::default()), Err(BodyError::Substeps { .. })));
    let long = LinearlyImplicitEuler { ticks_per_step: 50, ..implicit(LinearSolver::Cholesky) };
    let report = body.advance(None, 500, long).unwrap();
    assert_eq!((report.ticks, report.substeps, report.clamped), (500, 1, 0));
    let sunk = body.positions_m().iter().zip(body.network().rest_m()).map(|(x, r)| (*x - *r).length());
    assert!(sunk.fold(0.0, f64::max) < 1e-5);
}

#[test]
fn last_step_spans_the_remaining_ticks() {
    let long = LinearlyImplicitEuler { ticks_per_step: 20, ..implicit(LinearSolver::Cholesky) };
    let mut seen = Vec::new();
    block(3, 100.0, 0.5).advance_observed(None, 50, long, |tick, _| seen.push(tick)).unwrap();
    assert_eq!(seen, [20, 40, 50]);
}

#[test]
fn hanging_chain_stretches_by_the_weight_below() {
    let (k, m, n) = (40.0, 0.02, 6);
    let rest: Vec<DVec3> = (0..n).map(|i| DVec3::Z * -0.1 * f64::from(i)).collect();
    for law in [
        linear(k),
        ForceLaw::Skin(SkinLaw { compliance_m_per_n: 1.0 / k, hardening_per_n: 0.1 }),
        ForceLaw::Exponential { stiffness_n_per_m: k, rate_per_m: 25.0 },
    ] {
        let mut body = body(string(&rest, m, law, 0.5).build().unwrap());
        body.set_gravity(G).unwrap();
        to_rest(&mut body, 60);
        for i in 1..n as usize {
            let below = m * 9.81 * (n as usize - i) as f64;
            let length = (body.positions_m()[i - 1] - body.positions_m()[i]).length();
            let tension = law.at(length - 0.1).force_n;
            assert!((tension / below - 1.0).abs() < 1e-9, "{law:?}, spring {i}: {tension} N, not {below} N");
        }
        let weight = body.network().mass_kg().iter().sum::<f64>() * 9.81;
        let hook = body.internal_force_on_n(0);
        assert!((hook + DVec3::Z * (weight - m * 9.81)).length() < 1e-9, "{hook}");
    }
}

#[test]
fn slack_chain_hangs_in_the_discrete_catenary() {
    // Stiff links of 0.1 m between hooks 0.8 m apart. The horizontal tension H is constant, the slope increases by m
    // g/H at each mass, and each link is stretched by its tension. H is found by bisection.
    let (links, k, m, span) = (10, 5e3, 0.01, 0.8);
    let shape = |h: f64| -> Vec<DVec3> {
        let mut at = vec![DVec3::ZERO];
        for i in 0..links {
            let slope = m * 9.81 / h * (f64::from(i) - 0.5 * f64::from(links - 1));
            let tension = h * slope.hypot(1.0);
            let along = DVec3::new(1.0, 0.0, slope).normalize();
            at.push(at[i as usize] + along * (0.1 + tension / k));
        }
        at
    };
    let (mut low, mut high) = (1e-3, 10.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if shape(middle)[links as usize].x < span { low = middle } else { high = middle }
    }
    let expected = shape(low);
    // Start from a polygon with the links at rest: an arc between the hooks.
    let mut builder = NetworkBuilder::new();
    let angle = |i: i32| (f64::from(i) / f64::from(links) - 0.5) * 1.9;
    let arc: Vec<DVec3> = (0..=links).map(|i| DVec3::new(angle(i).sin(), 0.0, -angle(i).cos())).collect();
    let scale = 0.1 / arc[0].distance(arc[1]);
    let stretch = span / (scale * arc[0].distance(arc[links as usize]));
    let nodes: Vec<usize> =
        (0..=links).map(|i| builder.node(scale * (arc[i as usize] - arc[0]), m)).collect();
    nodes.windows(2).for_each(|pair| {
        builder.spring(pair[0], pair[1], linear(k), 0.5);
    });
    let mut body = body(builder.fix([0, links as usize]).build().unwrap());
    // The end is at its hook.
    let x: Vec<DVec3> = body.positions_m().iter().map(|x| DVec3::new(x.x * stretch, 0.0, x.z)).collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
    body.set_gravity(G).unwrap();
    body.advance(None, 4000, LinearlyImplicitEuler { ticks_per_step: 5, ..implicit(LinearSolver::Cholesky) })
        .unwrap();
    to_rest(&mut body, 40);
    for (x, expected) in body.positions_m().iter().zip(&expected) {
        assert!((*x - *expected).length() < 1e-8, "{x}, not {expected}");
    }
    // The continuous catenary, as far as ten links approximate it: y = a cosh(x/a).
    let a = low / (m * 9.81 / 0.1);
    let sag = a * ((0.5 * span / a).cosh() - 1.0);
    let deepest = body.positions_m().iter().map(|x| -x.z).fold(0.0, f64::max);
    assert!((deepest / sag - 1.0).abs() < 0.03, "{deepest} m, catenary {sag} m");
}

#[test]
fn pulse_travels_at_the_wave_speed() {
    // c = l sqrt(k/m) for waves long compared with a link. This one is 16 links wide, hence at most 0.1 % slower.
    let (k, m, l, n) = (400.0_f64, 0.01, 0.05, 400);
    let rest: Vec<DVec3> = (0..n).map(|i| DVec3::X * (l * f64::from(i))).collect();
    let mut body = body(string(&rest, m, linear(k), 0.0).fix([n as usize - 1]).build().unwrap());
    let c = l * (k / m).sqrt();
    let (start, width) = (100.0 * l, 16.0 * l);
    let shape = |x: f64| 1e-4 * (-((x - start) / width).powi(2)).exp();
    let slope = |x: f64| -2.0 * (x - start) / (width * width) * shape(x);
    let x: Vec<DVec3> = rest.iter().map(|r| *r + DVec3::X * shape(r.x)).collect();
    // u(x - c t): moves to the right.
    let v: Vec<DVec3> = rest.iter().map(|r| -c * slope(r.x) * DVec3::X).collect();
    let v: Vec<DVec3> = v
        .iter()
        .enumerate()
        .map(|(i, v)| if i == 0 || i + 1 == n as usize { DVec3::ZERO } else { *v })
        .collect();
    body.set_state(&x, &v).unwrap();
    let ticks = 1000;
    body.advance(None, ticks, SemiImplicitEuler::default()).unwrap();
    let (mut sum, mut moment) = (0.0, 0.0);
    for (x, r) in body.positions_m().iter().zip(&rest) {
        let u = (x.x - r.x).powi(2);
        (sum, moment) = (sum + u, moment + u * r.x);
    }
    let speed = (moment / sum - start) / (ticks as f64 * 1e-3);
    assert!((speed / c - 1.0).abs() < 2e-3, "{speed} m/s, not {c} m/s");
}

#[test]
fn free_body_keeps_linear_and_angular_momentum() {
    let lattice = Lattice::new([4, 3, 3], 0.05).unwrap().allow_unconstrained();
    let network = lattice.uniform(300.0, 0.4, 0.02, |_| false).unwrap();
    let momenta = |body: &Body| {
        let m = body.network().mass_kg();
        let each = body.positions_m().iter().zip(body.velocities_m_per_s()).zip(m);
        each.fold((DVec3::ZERO, DVec3::ZERO), |(p, l), ((x, v), m)| (p + *m * *v, l + *m * x.cross(*v)))
    };
    for (integrator, spin_kept) in [(integrators()[0], true), (integrators()[1], false)] {
        let mut body = body(network.clone());
        // Stretched, spinning and drifting.
        let x: Vec<DVec3> =
            network.rest_m().iter().map(|r| DVec3::new(1.2 * r.x, r.y + 0.2 * r.x, r.z)).collect();
        let v: Vec<DVec3> =
            x.iter().map(|x| DVec3::new(0.3, -0.1, 0.2) + DVec3::new(1.0, 2.0, -3.0).cross(*x)).collect();
        body.set_state(&x, &v).unwrap();
        let (p, l) = momenta(&body);
        body.advance(None, 500, integrator).unwrap();
        let (p_now, l_now) = momenta(&body);
        assert!((p_now - p).length() < 1e-12 * p.length().max(1.0), "{integrator:?}");
        // A linearised step rotates the springs' axes late.
        assert!(
            (l_now - l).length() < if spin_kept { 1e-12 } else { 0.03 } * l.length(),
            "{integrator:?}: {l} to {l_now}"
        );
    }
}

/// A bent lattice, released, with dampers of at least `b`.
fn bent(n: [usize; 3], seed: &[f64], k: f64, b: f64) -> Body {
    let lattice = Lattice::new(n, 0.05).unwrap();
    let network = lattice.uniform(k, b, 0.02, |[i, ..]| i == 0).unwrap();
    let mut body = body(network.clone());
    let moved = |i: usize, axis: usize| seed[(3 * i + axis) % seed.len()];
    let x: Vec<DVec3> = (0..network.node_count())
        .map(|i| {
            let out = 0.01 * DVec3::new(moved(i, 0), moved(i, 1), moved(i, 2));
            network.rest_m()[i] + if network.is_fixed(i) { DVec3::ZERO } else { out }
        })
        .collect();
    let v: Vec<DVec3> =
        (0..x.len()).map(|i| 0.3 * DVec3::new(moved(i, 2), moved(i, 0), moved(i, 1))).collect();
    body.set_state(&x, &v).unwrap();
    body
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Guaranteed by semi-implicit Euler where every damper has b ≥ k h; see its documentation.
    #[test]
    fn released_body_never_gains_energy(
        n in prop::array::uniform3(2usize..=3),
        seed in prop::collection::vec(-1.0..1.0f64, 17),
        k in 50.0..500.0f64,
        ratio in 1.0..6.0f64,
    ) {
        for integrator in [integrators()[0], integrators()[1]] {
            let mut body = bent(n, &seed, k, ratio * k * 0.25e-3);
            let mut last = body.energy().total_j();
            for _ in 0..100 {
                body.advance(None, 1, integrator).unwrap();
                let now = body.energy().total_j();
                prop_assert!(now <= last * (1.0 + 1e-9) + 1e-15, "{now} J after {last} J, {integrator:?}");
                last = now;
            }
        }
    }
}

#[test]
fn energy_balance_closes_and_integrator_share_vanishes_with_the_step() {
    let share = |integrator: Integrator| {
        let mut body = block(3, 200.0, 0.5);
        body.set_gravity(G).unwrap();
        body.start_energy_accounting();
        let node = 1 + 3 * (1 + 3 * 2);
        let at = body.positions_m()[node];
        let mut tool = ToolContact::hold(&body, node, at).unwrap();
        let place = |i: i32| {
            let t = f64::from(i) * 1e-3;
            at + DVec3::new(0.002 * (20.0 * t).sin(), 0.0, -0.006 * (1.0 - (12.0 * t).cos()))
        };
        let path: Vec<ToolPoint> = (0..=200)
            .map(|i| ToolPoint { position_m: place(i), velocity_m_per_s: (place(i) - place(i - 1)) / 1e-3 })
            .collect();
        body.advance(Some((&mut tool, &path)), 200, integrator).unwrap();
        let balance = body.energy_balance().unwrap();
        let through = balance.work_in_j.abs() + balance.damping_loss_j;
        assert!(balance.damping_loss_j > 0.0);
        let sum = balance.stored_j + balance.damping_loss_j + balance.integrator_j;
        assert!((sum - balance.work_in_j).abs() < 1e-12 * through);
        balance.integrator_j.abs() / through
    };
    let semi = |n| share(SemiImplicitEuler { min_substeps: n, ..SemiImplicitEuler::default() }.into());
    let whole = |n| share(LinearlyImplicitEuler { substeps: n, ..implicit(LinearSolver::Cholesky) }.into());
    for (coarse, fine) in [(semi(32), semi(128)), (whole(64), whole(256))] {
        assert!(fine < 1e-3, "{fine}");
        assert!(fine < 0.4 * coarse, "{coarse}, then {fine}");
    }
}

#[test]
fn constant_load_stores_half_of_its_work() {
    // A spring under a constant force F comes to rest at F/k with any damper: the work is F^2/k, and half of it is
    // stored.
    for integrator in [integrators()[0], integrators()[1]] {
        let (k, force) = (80.0, 0.4);
        let mut body = oscillator(k, 1.5, 0.05, 0.0);
        body.start_energy_accounting();
        body.set_loads(&[DVec3::ZERO, DVec3::X * force]).unwrap();
        body.advance(None, 3000, integrator).unwrap();
        let (balance, whole) = (body.energy_balance().unwrap(), force * force / k);
        assert!(
            (balance.work_in_j / whole - 1.0).abs() < 1e-6 && (balance.stored_j / whole - 0.5).abs() < 1e-6
        );
        // The remainder is the implicit step's own damping.
        assert!((balance.damping_loss_j / whole - 0.5).abs() < 0.03, "{balance:?}, {integrator:?}");
    }
}

#[test]
fn energy_matches_closed_forms() {
    let mut body = oscillator(80.0, 0.0, 0.05, 0.02);
    body.set_gravity(G).unwrap();
    let up = [DVec3::ZERO, DVec3::new(1.02, 0.0, 0.0) + DVec3::Z * 0.0];
    body.set_state(&up, &[DVec3::ZERO, DVec3::Y * 3.0]).unwrap();
    let energy = body.energy();
    assert!((energy.kinetic_j - 0.5 * 0.05 * 9.0).abs() < 1e-15);
    assert!((energy.elastic_j - 0.5 * 80.0 * 0.02 * 0.02).abs() < 1e-15);
    assert_eq!(energy.gravitational_j, 0.0);
    body.set_state(&[DVec3::ZERO, DVec3::new(1.0, 0.0, 0.1)], &[DVec3::ZERO; 2]).unwrap();
    assert!((body.energy().gravitational_j - 0.05 * 9.81 * 0.1).abs() < 1e-15);
}

#[test]
fn restored_state_leads_to_identical_bits() {
    for integrator in integrators() {
        let mut body = block(4, 300.0, 0.3);
        body.set_gravity(G).unwrap();
        body.advance(None, 37, integrator).unwrap();
        let state = body.state();
        let text = serde_json::to_string(&state).unwrap();
        body.advance(None, 64, integrator).unwrap();
        let once = body.state();
        // Into another body of the same network, through text.
        let mut other = block(4, 300.0, 0.3);
        other.set_gravity(G).unwrap();
        other.advance(None, 5, integrator).unwrap();
        let read: BodyState = serde_json::from_str(&text).unwrap();
        assert_eq!(read, state);
        other.restore(&read).unwrap();
        other.advance(None, 64, integrator).unwrap();
        assert_eq!(other.state(), once, "{integrator:?}");
    }
    let mut small = block(3, 300.0, 0.3);
    assert!(matches!(small.restore(&block(4, 300.0, 0.3).state()), Err(BodyError::Length { .. })));
}

#[test]
fn body_at_rest_becomes_settled() {
    let mut body = block(4, 400.0, 0.6);
    assert!(!body.is_settled(), "not settled before the first step");
    body.set_gravity(G).unwrap();
    body.advance(None, 150, SemiImplicitEuler::default()).unwrap();
    assert!(!body.is_settled(), "still sinking");
    body.advance(None, 4000, SemiImplicitEuler::default()).unwrap();
    assert!(body.is_settled());
    body.set_gravity(-G).unwrap();
    assert!(!body.is_settled());
}

#[test]
fn buckling_body_uses_and_reports_the_clamped_tangent() {
    let mut body = block(4, 200.0, 0.3);
    // Compressed to half of its height, exactly straight.
    let x: Vec<DVec3> =
        body.network().rest_m().iter().map(|x| DVec3::new(x.x, x.y, 0.5 * (x.z + 0.05) - 0.05)).collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
    let long = LinearlyImplicitEuler { ticks_per_step: 50, ..implicit(LinearSolver::Cholesky) };
    let mut with_gradients = body.clone();
    let report = body.advance(None, 100, long).unwrap();
    assert!(report.clamped > 0 && body.positions_m().iter().all(|x| x.is_finite()));
    let gradients = LinearlyImplicitEuler { solver: LinearSolver::ConjugateGradients, ..long };
    assert!(with_gradients.advance(None, 100, gradients).unwrap().clamped > 0);
}

#[test]
fn stretched_nonlinear_body_gets_more_substeps() {
    let lattice = Lattice::new([3, 3, 3], 0.02).unwrap();
    let network = lattice.uniform(200.0, 0.0, 0.01, |[.., k]| k == 0).unwrap();
    let mut body = body(network);
    let top: Vec<usize> = (18..27).collect();
    let at = |body: &Body, node: usize| body.positions_m()[node];
    let ties = top.iter().map(|&node| Tie::grasp(BodyPoint::node(node), at(&body, node)).unwrap());
    body.set_ties(ties.collect()).unwrap();
    for (index, &node) in top.iter().enumerate() {
        body.move_tie(index, at(&body, node) + DVec3::Z * 0.16).unwrap();
    }
    body.advance(None, 2000, SemiImplicitEuler { min_substeps: 1, ..SemiImplicitEuler::default() }).unwrap();
    assert!(body.positions_m().iter().all(|x| x.is_finite() && x.z < 0.3));
}

#[test]
fn switching_gravity_off_does_no_work() {
    let mut body = block(3, 300.0, 0.6);
    body.set_gravity(G).unwrap();
    body.advance(None, 300, SemiImplicitEuler::default()).unwrap();
    body.start_energy_accounting();
    body.set_gravity(DVec3::ZERO).unwrap();
    let balance = body.energy_balance().unwrap();
    assert!(balance.stored_j.abs() < 1e-15 && balance.integrator_j.abs() < 1e-15, "{balance:?}");
}

#[test]
fn rejects_invalid_settings_and_keeps_the_state() {
    let mut body = block(3, 100.0, 0.5);
    assert!(body.set_gravity(DVec3::NAN).is_err());
    body.set_gravity(G).unwrap();
    body.advance(None, 10, SemiImplicitEuler::default()).unwrap();
    let before = body.state();
    let good = LinearlyImplicitEuler::default();
    for bad in [
        LinearlyImplicitEuler { tick_s: 0.0, ..good },
        LinearlyImplicitEuler { tick_s: f64::NAN, ..good },
        LinearlyImplicitEuler { substeps: 0, ..good },
        LinearlyImplicitEuler { ticks_per_step: 0, ..good },
        LinearlyImplicitEuler { substeps: 2, ticks_per_step: 2, ..good },
        LinearlyImplicitEuler { tolerance: 0.0, ..good },
        LinearlyImplicitEuler { tolerance: f64::NAN, ..good },
    ] {
        assert!(matches!(body.advance(None, 1, bad), Err(BodyError::Parameter { .. })), "{bad:?}");
    }
    assert_eq!(body.state(), before);
}
