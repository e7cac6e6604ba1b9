//! Physics of a body against closed forms.

use glam::{DQuat, DVec3};
use palpate_body::*;
use palpate_laws::{ForceLaw, SkinLaw, Spring};

const LATTICE: UniformLattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };

fn block(n: usize) -> Body {
    let block = Block::new([n; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&LATTICE).unwrap();
    Body::new(block.network, block.surface).unwrap()
}

/// N masses m on a line between two fixed ends, springs k of length ℓ.
fn chain(masses: usize, k: f64, m: f64, b: f64) -> Body {
    let n = masses + 2;
    let rest = (0..n).map(|i| DVec3::X * (0.1 * i as f64)).collect::<Vec<_>>();
    let links =
        (0..n - 1).map(|a| Link { a, b: a + 1, spring: Spring::linear(k, 0.1, b).unwrap() }).collect();
    let fixed = (0..n).map(|i| i == 0 || i == n - 1).collect();
    Body::new(Network::new(rest, vec![m; n], fixed, links).unwrap(), Surface::default()).unwrap()
}

#[test]
fn chain_frequencies_match_the_closed_form() {
    let (masses, k, m) = (7, 50.0, 0.02);
    let body = chain(masses, k, m, 0.0);
    // From the assembled tangent: K of the longitudinal motion is tridiagonal with eigenvectors
    // sin(n i pi/(N + 1)); the Rayleigh quotient must be the closed form, and the vector an eigenvector.
    let pattern = TangentPattern::new(&body);
    let mut tangent = pattern.zero();
    pattern.fill(&body, false, &mut tangent);
    let dense = tangent.stiffness().to_dense();
    for n in 1..=masses {
        let angle = n as f64 * std::f64::consts::PI / (masses + 1) as f64;
        let omega = 2.0 * (k / m).sqrt() * (angle / 2.0).sin();
        for row in 0..masses {
            let kv: f64 = (0..masses).map(|c| dense[(3 * row, 3 * c)] * (angle * (c + 1) as f64).sin()).sum();
            let expected = m * omega * omega * (angle * (row + 1) as f64).sin();
            assert!((kv - expected).abs() < 1e-10 * k, "mode {n}, mass {row}: {kv} N/m, not {expected}");
        }
    }
}

#[test]
fn chain_mode_follows_the_discrete_closed_form() {
    let (masses, k, m, n) = (7, 50.0, 0.02, 2);
    let mut body = chain(masses, k, m, 0.0);
    let angle = f64::from(n) * std::f64::consts::PI / (masses + 1) as f64;
    let (omega, amplitude) = (2.0 * (k / m).sqrt() * (angle / 2.0).sin(), 1e-3);
    let shape = |i: usize| (angle * i as f64).sin();
    let x: Vec<DVec3> = body
        .network()
        .rest_m()
        .iter()
        .enumerate()
        .map(|(i, x)| x + DVec3::X * amplitude * shape(i))
        .collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
    // Linear springs along the line are exactly linear, so each mode satisfies v += -h w^2 q, q += h v. Its solution
    // from (q0, 0) is q_j = q0 cos((j + 1/2) t)/cos(t/2) with cos t = 1 - (w h)^2/2.
    let integrator = SemiImplicitEuler::default();
    body.advance(None, 100, integrator).unwrap();
    let h = integrator.tick_s / 4.0;
    let t = (1.0 - (omega * h).powi(2) / 2.0).acos();
    let q = amplitude * (400.5 * t).cos() / (t / 2.0).cos();
    for i in 0..x.len() {
        let got = body.positions_m()[i].x - body.network().rest_m()[i].x;
        assert!((got - q * shape(i)).abs() < 1e-12, "node {i}: {got} m, not {} m", q * shape(i));
    }
}

#[test]
fn damped_oscillator_follows_the_discrete_closed_form() {
    let (k, m, b) = (100.0, 0.05, 0.3);
    let mut body = chain(1, k, m, b);
    let mut x = body.network().rest_m().to_vec();
    x[1].x += 5e-3;
    body.set_state(&x, &[DVec3::ZERO; 3]).unwrap();
    body.advance(None, 250, SemiImplicitEuler::default()).unwrap();
    let (mut q, mut v, h) = (5e-3, 0.0, 2.5e-4);
    for _ in 0..1000 {
        v += h * (-2.0 * k * q - 2.0 * b * v) / m;
        q += h * v;
    }
    assert!((body.positions_m()[1].x - 0.1 - q).abs() < 1e-12);
    assert!((body.velocities_m_per_s()[1].x - v).abs() < 1e-11);
}

#[test]
fn rigid_motion_gives_no_internal_force() {
    // Nothing is fixed, since fixed nodes have no velocity.
    let block =
        Block::new([5; 3], DVec3::splat(0.1)).unwrap().allow_unconstrained().uniform(&LATTICE).unwrap();
    let mut body = Body::new(block.network, block.surface).unwrap();
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    let shift = DVec3::new(0.3, -2.0, 0.7);
    // Rotation about an axis at 3 rad/s with translation: dampers must not react.
    let spin = DVec3::new(0.4, -3.0, 1.0);
    let x: Vec<DVec3> = body.network().rest_m().iter().map(|x| turn * *x + shift).collect();
    let v: Vec<DVec3> = x.iter().map(|x| spin.cross(*x) + DVec3::new(1.0, 0.0, -2.0)).collect();
    body.set_state(&x, &v).unwrap();
    let mut force = vec![DVec3::ZERO; x.len()];
    body.internal_forces_n(&mut force);
    let largest = force.iter().map(|f| f.length()).fold(0.0, f64::max);
    assert!(largest < 1e-12, "{largest} N");
}

#[test]
fn tangent_is_the_derivative_of_the_force_for_every_law() {
    for law in [
        ForceLaw::Linear { stiffness_n_per_m: 100.0 },
        // The guards are at a few millimetres, so that some springs are beyond them.
        ForceLaw::Skin(SkinLaw { compliance_m_per_n: 0.01, hardening_per_n: 1.0 }),
        ForceLaw::Exponential { stiffness_n_per_m: 100.0, rate_per_m: 600.0 },
    ] {
        let network = block(4).network().clone().edit().law_where(|_| true, |_| law).build().unwrap();
        let beyond = tangent_is_the_derivative(Body::new(network, Surface::default()).unwrap());
        assert!(law.is_linear() || beyond > 0, "{law:?}: no spring is beyond its guard");
    }
}

/// Bends `body`, compares tangent and forces, and returns how many springs were beyond their law's guard.
fn tangent_is_the_derivative(mut body: Body) -> usize {
    let bend = |x: &DVec3| {
        *x + DVec3::new(0.02 * (30.0 * x.z).sin(), -0.3 * x.x * (x.z + 0.05), -0.4 * (x.z + 0.05))
    };
    let x: Vec<DVec3> = body.network().rest_m().iter().map(bend).collect();
    let still = vec![DVec3::ZERO; x.len()];
    body.set_state(&x, &still).unwrap();
    let pattern = TangentPattern::new(&body);
    let mut tangent = pattern.zero();
    pattern.fill(&body, false, &mut tangent);
    let (k, b) = (tangent.stiffness().to_dense(), tangent.damping().to_dense());
    let free = body.network().free().to_vec();
    let scale = (0..k.nrows()).map(|i| k[(i, i)].abs()).fold(0.0, f64::max);
    let (mut plus, mut minus) = (still.clone(), still.clone());
    let h = 1e-7;
    for (f, &node) in free.iter().enumerate() {
        for axis in 0..3 {
            for (matrix, of_velocity) in [(&k, false), (&b, true)] {
                for (sign, force) in [(1.0, &mut plus), (-1.0, &mut minus)] {
                    let (mut xx, mut vv) = (x.clone(), still.clone());
                    let step = DVec3::AXES[axis] * (sign * h);
                    if of_velocity {
                        vv[node] += step;
                    } else {
                        xx[node] += step;
                    }
                    body.set_state(&xx, &vv).unwrap();
                    body.internal_forces_n(force);
                }
                for (g, &other) in free.iter().enumerate() {
                    let derivative = (plus[other] - minus[other]) / (2.0 * h);
                    for row in 0..3 {
                        let error = (matrix[(3 * g + row, 3 * f + axis)] + derivative[row]).abs();
                        assert!(error < 1e-6 * scale, "{error} at ({g}, {row}), ({f}, {axis})");
                    }
                }
            }
        }
    }
    let extension = |link: &Link| x[link.a].distance(x[link.b]) - link.spring.rest_length_m();
    body.network().links().iter().filter(|link| extension(link).abs() > link.spring.law().guard_m()).count()
}

#[test]
fn tangent_is_symmetric_and_clamped_tangent_positive_semidefinite() {
    let mut body = block(3);
    let x: Vec<DVec3> = body.network().rest_m().iter().map(|x| DVec3::new(x.x, x.y, 0.4 * x.z)).collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
    let pattern = TangentPattern::new(&body);
    let mut tangent = pattern.zero();
    let mut least = [0.0; 2];
    for clamped in [false, true] {
        pattern.fill(&body, clamped, &mut tangent);
        let k = tangent.stiffness().to_dense();
        for i in 0..k.nrows() {
            for j in 0..i {
                assert!((k[(i, j)] - k[(j, i)]).abs() < 1e-12);
            }
        }
        least[usize::from(clamped)] = k.self_adjoint_eigenvalues(faer::Side::Lower).unwrap()[0];
    }
    assert!(least[0] < 0.0, "squeezed to 0.4 the block buckles: {}", least[0]);
    assert!(least[1] > -1e-10, "{}", least[1]);
}

/// The true stability limit, by bisection on 4M − 2hB − h²K > 0 with the dense tangent.
fn true_stable_step(body: &Body) -> f64 {
    let pattern = TangentPattern::new(body);
    let mut tangent = pattern.zero();
    pattern.fill(body, false, &mut tangent);
    let (k, b) = (tangent.stiffness().to_dense(), tangent.damping().to_dense());
    let mass = |i: usize| body.network().mass_kg()[body.network().free()[i / 3]];
    let stable = |h: f64| {
        let a = faer::Mat::from_fn(k.nrows(), k.nrows(), |i, j| {
            let inertia = if i == j { 4.0 * mass(i) } else { 0.0 };
            inertia - 2.0 * h * b[(i, j)] - h * h * k[(i, j)]
        });
        a.self_adjoint_eigenvalues(faer::Side::Lower).unwrap()[0] > 0.0
    };
    let (mut low, mut high) = (1e-6, 1.0);
    for _ in 0..40 {
        let middle = f64::sqrt(low * high);
        if stable(middle) { low = middle } else { high = middle }
    }
    low
}

#[test]
fn stable_step_is_within_the_true_limit_and_close_to_it() {
    for n in [3, 5] {
        let body = block(n);
        let (estimate, limit) = (SemiImplicitEuler::stable_step_s(&body), true_stable_step(&body));
        assert!((0.6..=1.0).contains(&(estimate / limit)), "{n}: {estimate} s of {limit} s");
    }
}

/// The same for large blocks. There B = (b/k) K, so a single eigenvalue suffices, and power iteration finds it from
/// below.
#[test]
fn stable_step_is_within_the_true_limit_for_large_blocks() {
    for n in [10, 20, 40] {
        let body = block(n);
        let (network, m) = (body.network(), body.network().mass_kg()[0]);
        let axes: Vec<(usize, usize, DVec3)> = network
            .links()
            .iter()
            .map(|link| (link.a, link.b, (network.rest_m()[link.b] - network.rest_m()[link.a]).normalize()))
            .collect();
        // Neighbours move in opposite directions: close to the fastest mode.
        let mut d: Vec<DVec3> = (0..network.node_count())
            .map(|i| {
                let sign = if (i + i / n + i / (n * n)) % 2 == 0 { 1.0 } else { -1.0 };
                DVec3::new(sign, 0.7 * sign, 0.1 + (i as f64).sin())
            })
            .collect();
        let mut kappa = 0.0;
        for _ in 0..80 {
            let mut pushed = vec![DVec3::ZERO; d.len()];
            for &(a, b, u) in &axes {
                let f = LATTICE.stiffness_n_per_m * u * u.dot(d[a] - d[b]);
                pushed[a] += f;
                pushed[b] -= f;
            }
            (0..d.len()).filter(|&i| network.is_fixed(i)).for_each(|i| pushed[i] = DVec3::ZERO);
            let norm = pushed.iter().map(|p| p.length_squared()).sum::<f64>().sqrt();
            kappa = norm / m / d.iter().map(|d| d.length_squared()).sum::<f64>().sqrt();
            d = pushed.iter().map(|p| *p / norm).collect();
        }
        let beta = kappa * network.links()[0].spring.damping_ns_per_m() / LATTICE.stiffness_n_per_m;
        let limit = ((beta * beta + 4.0 * kappa).sqrt() - beta) / kappa;
        let estimate = SemiImplicitEuler::stable_step_s(&body);
        assert!((0.6..=1.0).contains(&(estimate / limit)), "{n}: {estimate} s of {limit} s");
    }
}

#[test]
fn rejects_a_step_with_too_many_substeps() {
    let mut body = block(5);
    let stable = SemiImplicitEuler::stable_step_s(&body);
    let one = |h| SemiImplicitEuler { tick_s: h, min_substeps: 1, max_substeps: 1, stability_margin: 1.0 };
    assert!(body.advance(None, 1, one(0.999 * stable)).is_ok());
    let rejected = body.advance(None, 1, one(1.01 * stable));
    assert_eq!(rejected, Err(BodyError::Substeps { needed: 2.0, allowed: 1 }));
}

#[test]
fn failed_step_leaves_the_body_unchanged() {
    let mut body = block(3);
    let integrator = SemiImplicitEuler::default();
    let node = 26;
    let p = body.positions_m()[node];
    let mut tool = ToolContact::hold(&body, node, p).unwrap();
    let before = body.positions_m().to_vec();
    let far = ToolPoint { position_m: p + DVec3::Z * 1e200, velocity_m_per_s: DVec3::Z * 1e250 };
    let path = [ToolPoint::at_rest(p), far, far];
    let error = body.advance(Some((&mut tool, &path)), 2, integrator).unwrap_err();
    assert!(matches!(error, BodyError::Diverged { .. }), "{error}");
    assert_eq!(body.positions_m(), before);
    let nan = [ToolPoint::at_rest(p), ToolPoint::at_rest(DVec3::NAN)];
    assert_eq!(body.advance(Some((&mut tool, &nan)), 1, integrator), Err(BodyError::Path { index: 1 }));
    let short = [ToolPoint::at_rest(p)];
    let error = body.advance(Some((&mut tool, &short)), 1, integrator).unwrap_err();
    assert_eq!(error, BodyError::PathLength { ticks: 1, points: 1 });
    assert_eq!(body.positions_m(), before);
}
