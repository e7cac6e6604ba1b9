//! Bodies on planes and spheres: unilateral contact with friction at the predicted times and angles.

use glam::DVec3;
use palpate_body::*;
use palpate_laws::ForceLaw;
use proptest::prelude::*;

const G: f64 = 9.81;

fn body(network: Network) -> Body {
    Body::new(network, Surface::default()).unwrap()
}

fn ground(friction: f64) -> Obstacle {
    Obstacle::plane(DVec3::ZERO, DVec3::Z, friction).unwrap()
}

fn fine(min_substeps: usize) -> Integrator {
    SemiImplicitEuler { min_substeps, ..SemiImplicitEuler::default() }.into()
}

fn implicit() -> Integrator {
    LinearlyImplicitEuler { solver: LinearSolver::Cholesky, ..LinearlyImplicitEuler::default() }.into()
}

/// A soft, unconstrained cube of `n` nodes a side, its lower face `height` above the ground.
fn cube(n: usize, edge: f64, height: f64) -> Body {
    let center = DVec3::Z * (0.5 * edge + height);
    let block =
        Block::new([n; 3], DVec3::splat(edge)).unwrap().centered_at(center).unwrap().allow_unconstrained();
    let tissue = Tissue { youngs_modulus_pa: 20e3, damping: Damping::Ratio(0.5), ..Tissue::default() };
    body(block.tissue(&tissue).unwrap().network)
}

fn point(m: f64) -> Body {
    let mut builder = NetworkBuilder::new();
    builder.node(DVec3::ZERO, m);
    body(builder.allow_unconstrained().build().unwrap())
}

#[test]
fn sliding_mass_decelerates_by_mu_g_and_stays_at_rest() {
    for integrator in [fine(4), implicit()] {
        let (mu, v0) = (0.3, 0.6);
        let mut body = point(0.2);
        body.set_gravity(DVec3::Z * -G).unwrap();
        body.set_obstacles(vec![ground(mu)]);
        body.set_state(&[DVec3::ZERO], &[DVec3::X * v0]).unwrap();
        body.start_energy_accounting();
        for tick in 1..=400 {
            let report = body.advance(None, 1, integrator).unwrap();
            assert_eq!(report.contacts, 1);
            let expected = (v0 - mu * G * f64::from(tick) * 1e-3).max(0.0);
            assert!((body.velocities_m_per_s()[0].x - expected).abs() < 1e-12, "tick {tick}, {integrator:?}");
            assert_eq!(body.positions_m()[0].z, 0.0);
        }
        assert!(body.is_settled());
        // Friction dissipates all of its energy.
        let balance = body.energy_balance().unwrap();
        assert!(
            (balance.friction_loss_j / (0.5 * 0.2 * v0 * v0) - 1.0).abs() < 1e-9
                && balance.integrator_j.abs() < 1e-12
        );
    }
}

#[test]
fn block_on_a_slope_slips_at_the_friction_angle() {
    for mu in [0.2, 0.5] {
        for (off, slips) in [(-0.1_f64, false), (0.1, true)] {
            let angle = f64::atan(mu) + off.to_radians();
            let mut body = cube(3, 0.03, 0.0);
            body.set_obstacles(vec![ground(mu)]);
            // Laid down level, then tilted slowly to just short of slipping, so that it does not oscillate.
            let mut mean = DVec3::ZERO;
            for (share, ticks) in [(0.0, 600), (0.5, 600), (0.9, 600), (1.0, 1000)] {
                let tilt = share * angle;
                body.set_gravity(G * DVec3::new(tilt.sin(), 0.0, -tilt.cos())).unwrap();
                let before = mean_velocity(&body);
                body.advance(None, ticks, fine(4)).unwrap();
                mean = mean_velocity(&body) - before;
            }
            // In the last second, if it slips: g (sin - mu cos), and more while a part of the soft block sticks.
            let sliding = G * (angle.sin() - mu * angle.cos());
            let ok = if slips { (0.9..1.5).contains(&(mean.x / sliding)) } else { mean.x.abs() < 1e-5 };
            assert!(ok, "mu {mu}, {off} degrees: {mean}, sliding {sliding}");
        }
    }
}

fn mean_velocity(body: &Body) -> DVec3 {
    let m = body.network().mass_kg();
    let momentum: DVec3 = body.velocities_m_per_s().iter().zip(m).map(|(v, m)| *v * *m).sum();
    momentum / m.iter().sum::<f64>()
}

#[test]
fn dropped_dumbbell_lifts_off_at_the_predicted_time() {
    // Two masses on a vertical spring fall together. The lower one stops on impact, and the upper one oscillates on
    // the spring. The lower one lifts off when the spring pulls it up with its weight.
    let (m, k, l, drop) = (0.05, 60.0, 0.1, 0.2);
    let mut builder = NetworkBuilder::new();
    let low = builder.node(DVec3::Z * drop, m);
    let high = builder.node(DVec3::Z * (drop + l), m);
    builder.spring(low, high, ForceLaw::Linear { stiffness_n_per_m: k }, 0.0);
    let mut body = body(builder.allow_unconstrained().build().unwrap());
    body.set_gravity(DVec3::Z * -G).unwrap();
    body.set_obstacles(vec![ground(0.0)]);
    let touch_down = (2.0 * drop / G).sqrt();
    // Extension e of the spring: e'' = -(k/m) e - g from e = 0 at -v. It lifts off at e = m g/k.
    let omega = (k / m).sqrt();
    let (rest, v) = (-m * G / k, -(2.0 * G * drop).sqrt());
    let extension = |t: f64| rest - rest * (omega * t).cos() + v / omega * (omega * t).sin();
    let (mut early, mut late) = (std::f64::consts::PI / omega, 1.9 * std::f64::consts::PI / omega);
    for _ in 0..100 {
        let middle = 0.5 * (early + late);
        if extension(middle) < m * G / k { early = middle } else { late = middle }
    }
    let leaves = touch_down + early;
    let (mut down, mut up) = (None, None);
    for tick in 1..=600 {
        body.advance(None, 1, fine(50)).unwrap();
        let touching = !body.contacts().is_empty();
        if touching && down.is_none() {
            down = Some(f64::from(tick) * 1e-3);
        }
        if !touching && down.is_some() && up.is_none() {
            up = Some(f64::from(tick) * 1e-3);
        }
    }
    assert!((down.unwrap() - touch_down).abs() < 1.1e-3, "touched at {down:?}, {touch_down}");
    assert!((up.unwrap() - leaves).abs() < 1.1e-3, "left at {up:?}, {leaves}");
}

#[test]
fn body_on_a_sphere_rests_on_its_surface() {
    let mut body = cube(4, 0.03, 0.002);
    let ball = Obstacle::sphere(DVec3::new(0.002, -0.001, -0.05), 0.05, 0.4).unwrap();
    body.set_obstacles(vec![ball.clone(), ground(0.4)]);
    body.set_gravity(DVec3::Z * -G).unwrap();
    body.advance(None, 2000, fine(4)).unwrap();
    for x in body.positions_m() {
        assert!(ball.gap_m(*x).0 > -1e-6 && x.z > -1e-12, "{x}");
    }
    // The sphere bears the weight of the body.
    let weight = body.network().mass_kg().iter().sum::<f64>() * G;
    let carried: f64 = body.contacts().iter().map(|c| c.impulse_ns.z).sum::<f64>() / 0.25e-3;
    assert!((carried / weight - 1.0).abs() < 0.02, "{carried} N, not {weight} N");
}

#[test]
fn body_starting_inside_an_obstacle_is_pushed_out_slowly() {
    let mut body = point(0.1);
    body.set_state(&[DVec3::Z * -0.05], &[DVec3::ZERO]).unwrap();
    body.set_obstacles(vec![ground(0.2)]);
    let mut fastest = 0.0_f64;
    for _ in 0..60 {
        body.advance(None, 1, fine(4)).unwrap();
        fastest = fastest.max(body.velocities_m_per_s()[0].z);
    }
    // The body is out and at rest.
    let [x, v] = [body.positions_m()[0].z, body.velocities_m_per_s()[0].z];
    assert!((0.0..1e-9).contains(&x) && v.abs() < 1e-9 && fastest <= 1e-9, "{x} m, {v} m/s, {fastest} m/s");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn contacts_satisfy_signorini_and_coulomb_at_every_step(
        velocity in prop::array::uniform3(-1.0..1.0f64),
        spin in prop::array::uniform3(-10.0..10.0f64),
        ball in prop::array::uniform2(-0.02..0.02f64),
        mu in 0.0..1.0f64,
        stiff in any::<bool>(),
    ) {
        let mut body = cube(3, 0.03, 0.004);
        let sphere = Obstacle::sphere(DVec3::new(ball[0], ball[1], -0.0065), 0.01, mu).unwrap();
        let wall = Obstacle::plane(DVec3::X * 0.03, -DVec3::X, 0.5 * mu).unwrap();
        body.set_obstacles(vec![ground(mu), sphere, wall]);
        body.set_gravity(DVec3::Z * -G).unwrap();
        let x = body.positions_m().to_vec();
        let turn = |x: &DVec3| DVec3::from_array(velocity) - DVec3::Z + DVec3::from_array(spin).cross(*x - DVec3::Z * 0.02);
        body.set_state(&x, &x.iter().map(turn).collect::<Vec<_>>()).unwrap();
        body.start_energy_accounting();
        let integrator = if stiff { implicit() } else { fine(4) };
        for _ in 0..150 {
            body.advance(None, 1, integrator).unwrap();
            let largest = body.contacts().iter().map(|c| c.impulse_ns.length()).fold(0.0, f64::max);
            for c in body.contacts() {
                let normal = c.impulse_ns.dot(c.normal);
                let tangential = c.impulse_ns - normal * c.normal;
                let mu = body.obstacles()[c.obstacle].friction();
                prop_assert!(normal >= 0.0 && c.gap_m >= -1e-8, "{c:?}");
                prop_assert!(normal * c.gap_m.abs() <= 1e-8 * largest, "{c:?}");
                prop_assert!(tangential.length() <= mu * normal + 1e-9 * largest, "{c:?}");
                let slip = c.velocity_m_per_s - c.velocity_m_per_s.dot(c.normal) * c.normal;
                // In slip the friction is on the cone. The solver finds a displacement in the step to 1 nm, which is
                // 4 µm/s.
                prop_assert!(slip.length() < 5e-6 || tangential.length() > mu * normal - 1e-6 * largest, "{c:?}");
            }
            for x in body.positions_m() {
                prop_assert!(x.z > -1e-8 && 0.03 - x.x > -1e-8, "{x}");
            }
        }
        // Except for the error of a step along a sphere's tangent.
        prop_assert!(body.energy_balance().unwrap().friction_loss_j >= -1e-7);
    }
}

#[test]
fn rejects_invalid_obstacles() {
    for bad in [DVec3::ZERO, DVec3::Z * 2.0, DVec3::NAN] {
        assert!(Obstacle::plane(DVec3::ZERO, bad, 0.1).is_err());
    }
    assert!(Obstacle::plane(DVec3::NAN, DVec3::Z, 0.1).is_err());
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Obstacle::sphere(DVec3::ZERO, bad, 0.1).is_err());
    }
    for bad in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(
            Obstacle::sphere(DVec3::ZERO, 1.0, bad).is_err()
                && Obstacle::plane(DVec3::ZERO, DVec3::Z, bad).is_err()
        );
    }
}
