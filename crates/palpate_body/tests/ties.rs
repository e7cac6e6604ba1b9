//! Grasps, threads and sutures: positions, forces, tearing and energy.

use glam::DVec3;
use palpate_body::*;

const G: f64 = 9.81;

fn integrators(substeps: usize) -> [Integrator; 2] {
    let semi = SemiImplicitEuler { min_substeps: substeps, ..SemiImplicitEuler::default() };
    let solver = LinearSolver::Cholesky;
    [semi.into(), LinearlyImplicitEuler { substeps, solver, ..LinearlyImplicitEuler::default() }.into()]
}

fn block(n: usize) -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 200.0, damping_ratio: 0.6, mass_kg: 0.5 };
    let block = Block::new([n; 3], DVec3::splat(0.06)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// A place on a triangle of the top of a block of 4 nodes a side.
fn on_the_top() -> BodyPoint {
    let node = |i: usize, j: usize| i + 4 * (j + 4 * 3);
    BodyPoint::new(vec![(node(1, 1), 0.5), (node(2, 1), 0.3), (node(1, 2), 0.2)]).unwrap()
}

fn place(body: &Body, point: &BodyPoint) -> DVec3 {
    point.nodes().iter().map(|&(node, w)| w * body.positions_m()[node]).sum()
}

/// Free masses without springs.
fn masses(at: &[(DVec3, f64)]) -> Body {
    let mut builder = NetworkBuilder::new();
    for &(x, m) in at {
        builder.node(x, m);
    }
    Body::new(builder.allow_unconstrained().build().unwrap(), Surface::default()).unwrap()
}

#[test]
fn grasped_point_follows_its_anchor() {
    for integrator in integrators(4) {
        let mut body = block(4);
        let start = place(&body, &on_the_top());
        body.set_ties(vec![Tie::grasp(on_the_top(), start).unwrap()]).unwrap();
        for tick in 1..=200 {
            let t = f64::from(tick) * 1e-3;
            let to = start + DVec3::new(0.004 * (9.0 * t).sin(), 0.0, 0.006 * (1.0 - (11.0 * t).cos()));
            body.move_tie(0, to).unwrap();
            body.advance(None, 1, integrator).unwrap();
            assert!((place(&body, &on_the_top()) - to).length() < 1e-12, "tick {tick}, {integrator:?}");
        }
    }
}

#[test]
fn grasp_at_rest_balances_the_internal_force() {
    for integrator in integrators(4) {
        let mut body = block(4);
        let start = place(&body, &on_the_top());
        body.set_ties(vec![Tie::grasp(on_the_top(), start).unwrap()]).unwrap();
        body.move_tie(0, start + DVec3::new(0.002, 0.0, 0.005)).unwrap();
        // There in half a second, then to rest.
        body.advance(None, 500, integrator).unwrap();
        body.advance(None, 1500, integrator).unwrap();
        let tie = &body.ties()[0];
        let pull = tie.force_n();
        let ground: DVec3 = (0..16).map(|node| body.internal_force_on_n(node)).sum();
        assert!(pull.z > 0.3, "{pull}");
        // The ground bears the force of the hand, and the hand gets the opposite of what it gives.
        assert!((ground - pull).length() < 1e-6 * pull.length(), "{ground}, {pull}");
        assert!((tie.displayed_force_n(&body) + pull).length() < 1e-6 * pull.length());
    }
}

#[test]
fn energy_balance_closes_with_a_moving_grasp() {
    for integrator in integrators(160) {
        let mut body = block(3);
        let node = 1 + 3 * (1 + 3 * 2);
        let start = body.positions_m()[node];
        body.set_ties(vec![Tie::grasp(BodyPoint::node(node), start).unwrap()]).unwrap();
        body.start_energy_accounting();
        for tick in 1..=250 {
            let t = f64::from(tick) * 1e-3;
            body.move_tie(0, start + DVec3::Z * 0.005 * (1.0 - (20.0 * t).cos())).unwrap();
            body.advance(None, 1, integrator).unwrap();
        }
        let balance = body.energy_balance().unwrap();
        assert!(balance.work_in_j > 0.0 && balance.friction_loss_j == 0.0);
        let through = balance.work_in_j.abs() + balance.damping_loss_j;
        assert!(balance.integrator_j.abs() < 1e-3 * through, "{balance:?}, {integrator:?}");
    }
}

#[test]
fn mass_on_a_thread_is_a_pendulum() {
    let length = 0.4;
    for integrator in integrators(10) {
        let angle = 0.05_f64;
        let at = length * DVec3::new(angle.sin(), 0.0, -angle.cos());
        let mut body = masses(&[(at, 0.1)]);
        body.set_gravity(DVec3::Z * -G).unwrap();
        body.set_ties(vec![Tie::thread_to(BodyPoint::node(0), DVec3::ZERO, length).unwrap()]).unwrap();
        let (mut crossings, mut last) = (Vec::new(), at.x);
        for tick in 1..=2600 {
            body.advance(None, 1, integrator).unwrap();
            let x = body.positions_m()[0];
            assert!(x.length() < length * (1.0 + 1e-5), "{}", x.length());
            if last > 0.0 && x.x <= 0.0 {
                crossings.push(f64::from(tick) * 1e-3);
            }
            last = x.x;
        }
        let period = crossings[1] - crossings[0];
        let expected = std::f64::consts::TAU * (length / G).sqrt() * (1.0 + angle * angle / 16.0);
        assert!((period / expected - 1.0).abs() < 2e-3, "{period} s, not {expected} s, {integrator:?}");
        let tension = body.ties()[0].force_n();
        assert!(tension.z > 0.0 && (tension.length() / (0.1 * G) - 1.0).abs() < 0.02, "{tension}");
    }
}

#[test]
fn slack_thread_has_no_force_and_no_thread_pushes() {
    let mut body = masses(&[(DVec3::X * 0.1, 0.1), (DVec3::ZERO, 0.3)]);
    body.set_ties(vec![Tie::thread(BodyPoint::node(0), BodyPoint::node(1), 0.15).unwrap()]).unwrap();
    // Thrown apart at 1 m/s: free motion for 0.05 m, then both move together.
    body.set_state(body.positions_m().to_vec().as_slice(), &[DVec3::X, DVec3::ZERO]).unwrap();
    body.advance(None, 40, SemiImplicitEuler::default()).unwrap();
    assert_eq!(body.ties()[0].force_n(), DVec3::ZERO);
    assert!((body.velocities_m_per_s()[0].x - 1.0).abs() < 1e-12);
    body.advance(None, 40, SemiImplicitEuler::default()).unwrap();
    for v in body.velocities_m_per_s() {
        assert!((v.x - 0.25).abs() < 1e-9, "{v}: momentum is shared by 0.1 kg and 0.3 kg");
    }
    let apart = body.positions_m()[0].x - body.positions_m()[1].x;
    assert!((apart - 0.15).abs() < 1e-9, "{apart}");
    // Pushed together, the thread is slack again.
    body.set_loads(&[DVec3::X * -1.0, DVec3::ZERO]).unwrap();
    body.advance(None, 5, SemiImplicitEuler::default()).unwrap();
    assert_eq!(body.ties()[0].force_n(), DVec3::ZERO);
}

#[test]
fn suture_closes_holds_and_tears_at_its_limit() {
    let limit = 2.0;
    let torn_at = |force: f64| {
        let mut body = masses(&[(DVec3::X * 0.01, 0.1), (DVec3::ZERO, 0.1)]);
        let suture = Tie::suture(BodyPoint::node(0), BodyPoint::node(1), f64::INFINITY).unwrap();
        body.set_ties(vec![suture]).unwrap();
        body.advance(None, 30, SemiImplicitEuler::default()).unwrap();
        let [a, b] = body.positions_m() else { unreachable!() };
        assert!((*a - *b).length() < 1e-12, "drawn together at 1 m/s");
        // The forces on both ends are opposite.
        let total: DVec3 = body.velocities_m_per_s().iter().sum();
        assert!(total.length() < 1e-12);
        body.set_ties(vec![Tie::suture(BodyPoint::node(0), BodyPoint::node(1), limit).unwrap()]).unwrap();
        body.set_loads(&[DVec3::X * force, DVec3::X * -force]).unwrap();
        let report = body.advance(None, 10, SemiImplicitEuler::default()).unwrap();
        let tie = &body.ties()[0];
        assert_eq!(report.torn, usize::from(tie.is_torn()));
        assert!(tie.is_torn() || (tie.force_n() + DVec3::X * force).length() < 1e-9, "{}", tie.force_n());
        tie.is_torn()
    };
    assert!(!torn_at(0.99 * limit) && torn_at(1.01 * limit));
}

#[test]
fn thread_tears_at_its_limit_and_then_has_no_force() {
    let limit = 2.0;
    for (force, is_torn) in [(0.99 * limit, false), (1.01 * limit, true)] {
        let mut body = masses(&[(DVec3::X * 0.01, 0.1), (DVec3::ZERO, 0.1)]);
        let thread = Tie::thread(BodyPoint::node(0), BodyPoint::node(1), 0.01).unwrap();
        body.set_ties(vec![thread.with_tear_limit(limit).unwrap()]).unwrap();
        body.set_loads(&[DVec3::X * force, DVec3::X * -force]).unwrap();
        let report = body.advance(None, 10, SemiImplicitEuler::default()).unwrap();
        let tie = &body.ties()[0];
        assert_eq!((tie.is_torn(), report.torn), (is_torn, usize::from(is_torn)));
        assert_eq!(tie.torn_at_n().map(|at| (at / force - 1.0).abs() < 1e-9), is_torn.then_some(true));
        let pull = if is_torn { 0.0 } else { force };
        assert!((tie.force_n() + DVec3::X * pull).length() < 1e-9, "{}", tie.force_n());
    }
    let thread = Tie::thread(BodyPoint::node(0), BodyPoint::node(1), 0.01).unwrap();
    assert!(thread.with_tear_limit(0.0).is_err());
}

#[test]
fn closing_suture_does_not_tear_at_any_step() {
    for substeps in [1, 4, 40] {
        for integrator in integrators(substeps) {
            let mut body = masses(&[(DVec3::X * 1e-3, 0.008), (DVec3::ZERO, 0.008)]);
            body.set_ties(vec![Tie::suture(BodyPoint::node(0), BodyPoint::node(1), 5.0).unwrap()]).unwrap();
            body.advance(None, 20, integrator).unwrap();
            assert!(!body.ties()[0].is_torn(), "{integrator:?}");
            let [a, b] = body.positions_m() else { unreachable!() };
            assert!((*a - *b).length() < 1e-9);
        }
    }
}

#[test]
fn drive_of_a_node_does_the_work_of_its_thread() {
    for integrator in integrators(8) {
        let mut body = masses(&[(DVec3::Z * 0.1, 0.02), (DVec3::ZERO, 0.1)]);
        body.set_gravity(DVec3::Z * -G).unwrap();
        body.set_ties(vec![Tie::thread(BodyPoint::node(0), BodyPoint::node(1), 0.1).unwrap()]).unwrap();
        let at = body.positions_m()[0];
        let mut hand = ToolContact::hold(&body, 0, at).unwrap();
        body.start_energy_accounting();
        let path: Vec<ToolPoint> = (0..=500)
            .map(|i| {
                let v = if i == 0 { DVec3::ZERO } else { DVec3::Z * 0.5 };
                ToolPoint { position_m: at + DVec3::Z * (0.5e-3 * f64::from(i)), velocity_m_per_s: v }
            })
            .collect();
        body.advance(Some((&mut hand, &path)), 500, integrator).unwrap();
        let [a, b] = body.positions_m() else { unreachable!() };
        assert!((a.distance(*b) - 0.1).abs() < 1e-9, "{}", a.distance(*b));
        let balance = body.energy_balance().unwrap();
        // Both masses are 0.25 m higher and 0.5 m/s faster; the impact of the thread at the start is lost.
        let stored = 0.12 * (G * 0.25 + 0.5 * 0.25);
        assert!((balance.stored_j / stored - 1.0).abs() < 1e-6, "{balance:?}");
        let lost = 0.5 * 0.1 * 0.25;
        assert!(
            (balance.integrator_j + balance.friction_loss_j - lost).abs() < 0.02 * stored,
            "{balance:?}, {integrator:?}"
        );
    }
}

/// Two masses of 0.1 kg and 0.3 kg, 0.1 m apart, on a thread of 0.1 m and `k` N/m.
fn on_a_spring(k: f64) -> Body {
    let mut body = masses(&[(DVec3::X * 0.1, 0.1), (DVec3::ZERO, 0.3)]);
    let thread = Tie::thread(BodyPoint::node(0), BodyPoint::node(1), 0.1).unwrap();
    body.set_ties(vec![thread.with_stiffness(k).unwrap()]).unwrap();
    body
}

#[test]
fn elastic_thread_is_a_spring_that_only_pulls() {
    let (k, substeps) = (400.0, 4);
    for integrator in integrators(substeps) {
        let mut body = on_a_spring(k);
        body.set_state(body.positions_m().to_vec().as_slice(), &[DVec3::X * 0.5, DVec3::ZERO]).unwrap();
        // The same by hand: implicit Euler for e'' = -T/m, T = max(0, k e), with the reduced mass.
        let (h, reduced_kg) = (1e-3 / substeps as f64, 0.1 * 0.3 / 0.4);
        let (mut e, mut v, mut pulls, mut slack) = (0.0_f64, 0.5_f64, 0, 0);
        for tick in 1..=120 {
            body.advance(None, 1, integrator).unwrap();
            let mut tension_n = 0.0;
            for _ in 0..substeps {
                let pull_n = k * (e + h * v) / (1.0 + k * h * h / reduced_kg);
                tension_n = pull_n.max(0.0);
                v -= h * tension_n / reduced_kg;
                e += h * v;
            }
            let apart = body.positions_m()[0].x - body.positions_m()[1].x;
            let pull = -body.ties()[0].force_n();
            assert!(
                (apart - 0.1 - e).abs() < 1e-9,
                "tick {tick}: {} m, not {e} m, {integrator:?}",
                apart - 0.1
            );
            assert!((pull - DVec3::X * tension_n).length() < 1e-6, "tick {tick}: {pull}, not {tension_n} N");
            // The force belongs to the length at the end of the step.
            assert!((tension_n - k * (apart - 0.1).max(0.0)).abs() < 1e-6, "tick {tick}");
            if tension_n > 0.0 { pulls += 1 } else { slack += 1 }
        }
        assert!(pulls > 30 && slack > 30, "{pulls} and {slack}");
    }
}

#[test]
fn elastic_thread_at_rest_is_longer_by_force_over_stiffness() {
    for (k, integrator) in [(20.0, 0), (5e4, 1)] {
        let integrator = integrators(4)[integrator];
        let mut body = block(4);
        let start = place(&body, &on_the_top());
        let anchor = start + DVec3::new(0.0, 0.0, 0.05);
        let thread = Tie::thread_to(on_the_top(), anchor, 0.03).unwrap().with_stiffness(k).unwrap();
        body.set_ties(vec![thread]).unwrap();
        body.advance(None, 1500, integrator).unwrap();
        let apart = place(&body, &on_the_top()).distance(anchor);
        let tension_n = body.ties()[0].force_n().length();
        assert!(
            tension_n > 0.05 && (tension_n / (k * (apart - 0.03)) - 1.0).abs() < 1e-4,
            "{tension_n} N, {apart} m"
        );
        // The internal force of the body.
        let pull = body.ties()[0].displayed_force_n(&body);
        assert!((pull.length() / tension_n - 1.0).abs() < 1e-3, "{pull}, {tension_n} N");
    }
}

#[test]
fn very_stiff_thread_matches_the_inextensible_one() {
    for integrator in integrators(4) {
        let ends = [1e9, f64::INFINITY].map(|k| {
            let mut body = on_a_spring(k);
            body.set_loads(&[DVec3::X * 2.0, DVec3::ZERO]).unwrap();
            body.advance(None, 100, integrator).unwrap();
            (body.positions_m()[0], body.ties()[0].force_n())
        });
        let ((a, pull_a), (b, pull_b)) = (ends[0], ends[1]);
        assert!(a.distance(b) < 1e-8 && pull_a.distance(pull_b) < 1e-4, "{ends:?}");
        // 2 N accelerate both; three quarters of it pass through the thread.
        assert!((pull_b + DVec3::X * 1.5).length() < 1e-6, "{pull_b}");
    }
}

#[test]
fn energy_balance_counts_elastic_threads_as_work() {
    let mut body = on_a_spring(400.0);
    body.set_state(body.positions_m().to_vec().as_slice(), &[DVec3::X * 0.5, DVec3::ZERO]).unwrap();
    body.start_energy_accounting();
    // Until the thread is longest.
    let quarter = 0.5 * std::f64::consts::PI * (0.075_f64 / 400.0).sqrt();
    body.advance(None, (1e3 * quarter).round() as usize, integrators(20)[0]).unwrap();
    let balance = body.energy_balance().unwrap();
    let apart = body.positions_m()[0].x - body.positions_m()[1].x - 0.1;
    let in_the_thread = 0.5 * 400.0 * apart * apart;
    assert!((balance.work_in_j / -in_the_thread - 1.0).abs() < 0.02, "{balance:?}, {in_the_thread} J");
    assert_eq!(balance.friction_loss_j, 0.0);
    assert!(balance.integrator_j.abs() < 1e-9, "{balance:?}");
}

#[test]
fn ties_are_part_of_the_state() {
    let mut body = masses(&[(DVec3::X * 0.01, 0.1), (DVec3::ZERO, 0.1)]);
    let suture = |limit| Tie::suture(BodyPoint::node(0), BodyPoint::node(1), limit).unwrap();
    let thread = Tie::thread_to(BodyPoint::node(1), DVec3::ZERO, 1.0).unwrap();
    let grasp = Tie::grasp(BodyPoint::node(0), DVec3::X * 0.01).unwrap();
    let spring = thread.clone().with_stiffness(50.0).unwrap();
    for ties in [vec![suture(f64::INFINITY), thread.clone(), grasp, spring], vec![suture(0.5), thread]] {
        body.set_ties(ties.clone()).unwrap();
        let text = serde_json::to_string(&body.state()).unwrap();
        assert_eq!(serde_json::from_str::<BodyState>(&text).unwrap().ties, ties);
    }
    let whole = body.state();
    body.set_loads(&[DVec3::X * 3.0, DVec3::ZERO]).unwrap();
    body.advance(None, 20, SemiImplicitEuler::default()).unwrap();
    assert!(body.ties()[0].is_torn());
    let torn: BodyState = serde_json::from_str(&serde_json::to_string(&body.state()).unwrap()).unwrap();
    body.restore(&whole).unwrap();
    assert!(!body.ties()[0].is_torn());
    body.restore(&torn).unwrap();
    assert!(body.ties()[0].is_torn());
}

#[test]
fn rejects_invalid_ties() {
    let node = BodyPoint::node;
    for bad in
        [vec![], vec![(0, 0.5)], vec![(0, f64::NAN)], vec![(0, 0.5), (0, 0.5)], vec![(0, 1.0 / 33.0); 33]]
    {
        assert!(BodyPoint::new(bad).is_err());
    }
    assert!(
        Tie::suture(node(0), node(1), 1.0).unwrap().with_stiffness(5.0).is_err(),
        "a suture has no length"
    );
    for bad in [0.0, -1.0, f64::NAN] {
        assert!(Tie::thread(node(0), node(1), 0.1).unwrap().with_stiffness(bad).is_err());
        assert!(Tie::thread(node(0), node(1), bad).is_err() && Tie::suture(node(0), node(1), bad).is_err());
        assert!(Tie::thread_to(node(0), DVec3::ZERO, bad).is_err());
    }
    assert!(Tie::grasp(node(0), DVec3::NAN).is_err());
    let mut body = block(3);
    body.set_ties(vec![Tie::suture(node(20), node(21), 1.0).unwrap()]).unwrap();
    assert!(body.move_tie(0, DVec3::X).is_err(), "a suture has no anchor");
    assert!(body.move_tie(1, DVec3::X).is_err(), "there is no such tie");
    let rejected = body.set_ties(vec![Tie::grasp(node(27), DVec3::ZERO).unwrap()]);
    assert_eq!(rejected, Err(BodyError::InvalidNode { node: 27, reason: "there is no such node" }));
    // A fixed point cannot be moved, and the step stays finite.
    body.set_ties(vec![Tie::grasp(node(0), DVec3::Z).unwrap()]).unwrap();
    body.advance(None, 5, SemiImplicitEuler::default()).unwrap();
    assert_eq!(body.positions_m()[0], body.network().rest_m()[0]);
}
