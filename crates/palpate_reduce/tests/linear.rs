//! Gramians, norms and truncations of linear systems with closed forms.

use faer::{Mat, c64};
use palpate_body::{Body, Lattice, Surface};
use palpate_reduce::*;

/// A chain of masses, the last fixed, driven at the first.
fn chain(nodes: usize, k: f64, b: f64, m: f64) -> StateSpace {
    let lattice = Lattice::new([nodes, 1, 1], 1.0).unwrap();
    let body =
        Body::new(lattice.uniform(k, b, m, |[i, ..]| i == nodes - 1).unwrap(), Surface::default()).unwrap();
    SecondOrderSystem::of_body(&body, &[0], 1).unwrap().state_space().unwrap()
}

/// A first-order lag, 1/(s + a).
fn lag(a: f64) -> StateSpace {
    let one = |v: f64| Mat::from_fn(1, 1, |_, _| v);
    StateSpace { a: one(-a), b: one(1.0), c: one(1.0), d: one(0.0), e: one(0.0) }
}

#[test]
fn gramians_and_norm_of_first_order_lag_match_closed_form() {
    for a in [1e-3, 1.0, 250.0] {
        let gramians = Gramians::new(&lag(a)).unwrap();
        let square = |z: &Mat<f64>| (0..z.ncols()).map(|j| z[(0, j)].powi(2)).sum::<f64>();
        for z in [&gramians.controllability, &gramians.observability] {
            assert!((square(z) * 2.0 * a - 1.0).abs() < 1e-12);
        }
        let norm = HInf::new(&lag(a), 1e-6).unwrap();
        assert!((norm.norm * a - 1.0).abs() < 1e-9 && norm.omega.abs() < 1e-6 * a);
    }
}

#[test]
fn norm_of_resonance_matches_closed_form() {
    // w^2/(s^2 + 2 z w s + w^2): the peak is 1/(2 z sqrt(1 - z^2)) at w sqrt(1 - 2 z^2).
    let (w, z): (f64, f64) = (30.0, 0.05);
    let row = |values: [f64; 4]| Mat::from_fn(2, 2, |i, j| values[2 * i + j]);
    let system = StateSpace {
        a: row([0.0, 1.0, -w * w, -2.0 * z * w]),
        b: Mat::from_fn(2, 1, |i, _| if i == 1 { w * w } else { 0.0 }),
        c: Mat::from_fn(1, 2, |_, j| if j == 0 { 1.0 } else { 0.0 }),
        d: Mat::zeros(1, 1),
        e: Mat::zeros(1, 1),
    };
    let norm = HInf::new(&system, 1e-8).unwrap();
    assert!((norm.norm * 2.0 * z * (1.0 - z * z).sqrt() - 1.0).abs() < 1e-7);
    assert!((norm.omega - w * (1.0 - 2.0 * z * z).sqrt()).abs() < 1e-3 * w);
}

#[test]
fn norm_agrees_with_refined_frequency_grid() {
    for (nodes, b) in [(5, 0.02), (9, 0.3), (14, 2.0)] {
        let system = chain(nodes, 100.0, b, 0.01);
        let norm = HInf::new(&system, 1e-8).unwrap();
        let gain = |omega: f64| {
            let response = &system.proper_response(&[c64::new(0.0, omega)])[0];
            (response[(0, 0)] + system.d[(0, 0)]).norm()
        };
        let fastest = system.poles().unwrap().last().unwrap().norm();
        let grid = (0..20_000).map(|i| gain(2.0 * fastest * f64::from(i) / 20_000.0)).fold(0.0, f64::max);
        let grid = grid.max(system.d[(0, 0)].abs());
        assert!(
            (grid / norm.norm - 1.0).abs() < 1e-3 && grid <= norm.norm * (1.0 + 1e-7),
            "{grid}, {norm:?}"
        );
    }
}

#[test]
fn truncation_to_full_order_preserves_the_response() {
    let system = chain(5, 100.0, 0.5, 0.01);
    let balancing = Balancing::new(system.clone()).unwrap();
    let full = balancing.truncate(system.order()).unwrap();
    for omega in [0.0, 10.0, 100.0, 1000.0] {
        let s = [c64::new(0.0, omega)];
        let (a, b) = (&system.response(&s)[0], &full.system.response(&s)[0]);
        assert!((a - b).norm_l2() < 1e-9 * a.norm_l2(), "at {omega} rad/s");
    }
}

#[test]
fn unstable_system_has_neither_gramians_nor_norm() {
    assert!(matches!(Gramians::new(&lag(-1.0)), Err(ReduceError::Unstable)));
    assert!(matches!(HInf::new(&lag(-1.0), 1e-6), Err(ReduceError::Unstable)));
    for tolerance in [0.0, f64::NAN, 1.0] {
        assert!(matches!(HInf::new(&lag(1.0), tolerance), Err(ReduceError::Option { .. })));
    }
    // An undamped chain is not asymptotically stable.
    assert!(Gramians::new(&chain(4, 100.0, 0.0, 0.01)).is_err());
}

#[test]
fn rejects_fixed_or_missing_driven_nodes_and_invalid_axes() {
    let lattice = Lattice::new([4, 1, 1], 1.0).unwrap();
    let network = lattice.uniform(1.0, 0.1, 1.0, |[i, ..]| i == 3).unwrap();
    let body = Body::new(network, Surface::default()).unwrap();
    for (node, axes) in [(3, 1), (4, 1), (0, 0), (0, 4)] {
        assert!(matches!(SecondOrderSystem::of_body(&body, &[node], axes), Err(ReduceError::Option { .. })));
    }
}
