//! Properties of the reductions over random lattices: random sizes, springs, dampers, masses, fixed and driven nodes.

use faer::{Mat, MatRef, Side, c64};
use palpate_body::{Body, Lattice, Link, Network, Surface};
use palpate_laws::Spring;
use palpate_reduce::*;
use proptest::prelude::*;

/// A lattice fixed at one face, with springs, dampers and masses that vary tenfold, and up to two driven nodes.
#[derive(Clone, Debug)]
struct Case {
    network: Network,
    axes: usize,
    driven: Vec<usize>,
}

impl Case {
    fn system(&self) -> SecondOrderSystem {
        let body = Body::new(self.network.clone(), Surface::default()).unwrap();
        SecondOrderSystem::of_body(&body, &self.driven, self.axes).unwrap()
    }
}

prop_compose! {
    fn nodes()(axes in 1usize..=3)(
        axes in Just(axes),
        // Two nodes along every axis make a lattice rigid; three along the last leave free nodes to drive.
        n in [2usize..=4, 2usize..=3, 2usize..=3],
    ) -> (usize, [usize; 3]) {
        let mut nodes = [1; 3];
        nodes[..axes].copy_from_slice(&n[..axes]);
        nodes[axes - 1] += 1;
        (axes, nodes)
    }
}

fn case() -> impl Strategy<Value = Case> {
    nodes().prop_flat_map(|(axes, nodes)| {
        let lattice = Lattice::new(nodes, 0.01).unwrap();
        let network = lattice.uniform(100.0, 1.0, 0.01, |ijk| ijk[axes - 1] == 0).unwrap();
        let (links, count) = (network.links().len(), network.node_count());
        let tenfold = |n| prop::collection::vec(-0.5..0.5f64, n);
        (
            Just((network, axes)),
            tenfold(links),
            tenfold(links),
            tenfold(count),
            any::<[prop::sample::Index; 2]>(),
        )
            .prop_map(|((network, axes), k, b, m, driven)| {
                let vary = |typical: f64, power: f64| typical * 10f64.powf(power);
                let links = network.links().iter().enumerate().map(|(i, link)| {
                    let rest_m = network.rest_m()[link.a].distance(network.rest_m()[link.b]);
                    let spring = Spring::linear(vary(100.0, k[i]), rest_m, vary(0.5, b[i])).unwrap();
                    Link { spring, ..*link }
                });
                let fixed = (0..network.node_count()).map(|i| network.is_fixed(i)).collect();
                let masses = m.iter().map(|&power| vary(0.01, power)).collect();
                let mut driven: Vec<usize> =
                    driven.iter().map(|i| network.free()[i.index(network.free().len())]).collect();
                driven.dedup();
                // At least one free node is not driven.
                driven.truncate(network.free().len() - 1);
                let network =
                    Network::new(network.rest_m().to_vec(), masses, fixed, links.collect()).unwrap();
                Case { network, axes, driven }
            })
    })
}

fn is_symmetric_positive_definite(m: &Mat<f64>) -> bool {
    let symmetric = (0..m.nrows()).all(|i| (0..i).all(|j| m[(i, j)] == m[(j, i)]));
    symmetric && m.llt(Side::Lower).is_ok()
}

/// Frequencies in the range of the system's poles.
fn frequencies() -> Vec<c64> {
    [0.0, 3.0, 40.0, 100.0, 300.0, 2e3].map(|omega| c64::new(0.0, omega)).to_vec()
}

fn relative_distance(a: &Mat<c64>, b: &Mat<c64>) -> f64 {
    (a - b).norm_l2() / a.norm_l2()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn balanced_truncations_are_stable_and_stay_below_their_bound(case in case(), share in 0.0..1.0f64) {
        let full = case.system().state_space().unwrap();
        let balancing = Balancing::new(full.clone()).unwrap();
        let hankel = balancing.hankel_singular_values();
        prop_assert!(hankel.windows(2).all(|pair| pair[0] >= pair[1]));
        // Smaller values are rounding.
        let max_order = hankel.iter().take_while(|s| **s > 1e-11 * hankel[0]).count();
        let order = 1 + (share * max_order as f64) as usize;
        prop_assume!(order <= max_order);
        let truncated = balancing.truncate(order).unwrap();
        prop_assert!(truncated.system.poles().unwrap().iter().all(|pole| pole.re < 0.0));
        let twice_tail = 2.0 * hankel[order..].iter().sum::<f64>();
        prop_assert_eq!(truncated.error_bound, twice_tail);
        let error = HInf::new(&full.minus(&truncated.system).unwrap(), 1e-6).unwrap().norm;
        prop_assert!(error <= twice_tail + 1e-9 * hankel[0], "error {error}, bound {twice_tail}");
        // No reduction to that order has an error below the first omitted Hankel singular value.
        if let Some(next) = hankel.get(order) {
            prop_assert!(error >= next * (1.0 - 1e-5) - 1e-9 * hankel[0], "error {error}, at least {next}");
        }
    }

    #[test]
    fn gramians_solve_their_equations(case in case()) {
        let gramians = Gramians::new(&case.system().state_space().unwrap()).unwrap();
        prop_assert!(gramians.controllability_residual < 1e-10 && gramians.observability_residual < 1e-10);
    }

    #[test]
    fn projections_keep_mass_damping_and_stiffness_positive_definite(
        case in case(),
        rings in 1usize..=2,
        columns in 1usize..=6,
        entries in prop::collection::vec(-1.0..1.0f64, 6 * 80),
    ) {
        let system = case.system();
        let n = system.unknowns();
        let columns = columns.min(n);
        let random = Mat::from_fn(n, columns, |i, j| entries[(6 * i + j) % entries.len()]);
        let near = system.neighbourhood(&case.network, rings).unwrap().to_dense();
        let projected = |v: MatRef<'_, f64>| system.project(v).unwrap();
        let models = [
            near,
            projected(system.krylov_basis(&[30.0, 200.0]).unwrap().as_ref()),
            projected(system.modal_basis(columns).unwrap().as_ref()),
            projected(random.as_ref()),
        ];
        for (i, model) in models.iter().enumerate() {
            for (name, m) in [("M", &model.mass), ("B", &model.damping), ("K", &model.stiffness)] {
                prop_assert!(is_symmetric_positive_definite(m), "{name} of model {i}: {m:?}");
            }
            if model.unknowns() > 0 {
                let poles = model.state_space().unwrap().poles().unwrap();
                prop_assert!(poles.iter().all(|pole| pole.re < 0.0), "model {i} is not stable");
            }
        }
    }

    #[test]
    fn reduction_to_full_order_preserves_the_response(case in case()) {
        let system = case.system();
        let all = system.project(system.modal_basis(system.unknowns()).unwrap().as_ref()).unwrap();
        let everywhere = system.neighbourhood(&case.network, case.network.node_count()).unwrap();
        let full = system.state_space().unwrap();
        let balancing = Balancing::new(full.clone()).unwrap();
        let hankel = balancing.hankel_singular_values();
        let max_order = hankel.iter().take_while(|s| **s > 1e-13 * hankel[0]).count();
        let balanced = balancing.truncate(max_order).unwrap().system;
        let s = frequencies();
        let exact = system.response(&s).unwrap();
        for (name, response, tolerance) in [
            ("all modes", all.response(&s), 1e-9),
            ("all modes in state space", all.state_space().unwrap().response(&s), 1e-9),
            ("all rings", everywhere.response(&s).unwrap(), 1e-12),
            ("dense", system.to_dense().response(&s), 1e-9),
            ("state space", full.response(&s), 1e-9),
            ("balanced", balanced.response(&s), 1e-8),
        ] {
            for (i, s) in s.iter().enumerate() {
                let error = relative_distance(&exact[i], &response[i]);
                prop_assert!(error < tolerance, "{name}: relative error {error} at {s}");
            }
        }
    }

    #[test]
    fn krylov_models_are_exact_at_zero_shift_and_infinity(case in case(), shift in 5.0..500.0f64) {
        let system = case.system();
        let v = system.krylov_basis(&[shift]).unwrap();
        let gram = v.transpose() * &v;
        prop_assert!((gram - Mat::<f64>::identity(v.ncols(), v.ncols())).norm_max() < 1e-12);
        let reduced = system.project(v.as_ref()).unwrap();
        let s = [c64::new(0.0, 0.0), c64::new(shift, 0.0)];
        for (full, reduced) in system.response(&s).unwrap().iter().zip(reduced.response(&s)) {
            prop_assert!(relative_distance(full, &reduced) < 1e-8);
        }
        let (full, reduced) = (system.state_space().unwrap(), reduced.state_space().unwrap());
        prop_assert!((&full.d - &reduced.d).norm_l2() < 1e-8 * full.d.norm_l2());
        prop_assert_eq!(&full.e, &reduced.e);
        let gain = system.static_stiffness().unwrap();
        prop_assert!((full.dc_gain().unwrap() - &gain).norm_l2() < 1e-9 * gain.norm_l2());
    }

    #[test]
    fn driven_as_one_gives_the_sum_of_forces(case in case()) {
        let system = case.system();
        let together = system.driven_as_one();
        let s = frequencies();
        for (each, sum) in system.response(&s).unwrap().iter().zip(together.response(&s).unwrap()) {
            for (i, j) in (0..case.axes).flat_map(|i| (0..case.axes).map(move |j| (i, j))) {
                let same = |at: usize, axis: usize| at % case.axes == axis;
                let expected: c64 = (0..system.inputs())
                    .flat_map(|r| (0..system.inputs()).map(move |c| (r, c)))
                    .filter(|&(r, c)| same(r, i) && same(c, j))
                    .map(|at| each[at])
                    .sum();
                prop_assert!((expected - sum[(i, j)]).norm() < 1e-9 * each.norm_l2());
            }
        }
    }
}
