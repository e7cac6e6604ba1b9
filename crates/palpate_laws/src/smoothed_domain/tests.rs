use super::*;
use crate::{ElasticLaw, MAX_PRONY_TERMS, PronyTerm, Relaxation, stress_block, stress_change};
use glam::DQuat;

/// Gradients of five nodes whose sum is zero, with places at rest where F is 1.
fn nodes() -> ([DVec3; 5], [DVec3; 5]) {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|x| 0.01 * x);
    let gradients = [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z].map(|b| 100.0 * b);
    let [o, a, b, c] = corners;
    let [g_o, g_a, g_b, g_c] = gradients;
    // The last node shares the gradient of the one before it.
    ([o, a, b, c, c], [g_o, g_a, g_b, 0.3 * g_c, 0.7 * g_c])
}

fn material(law: ElasticLaw, nu: f64) -> ElementMaterial {
    let parameters_j = LameParameters::new(20e3, nu).unwrap().scaled(1e-6);
    let viscous_js = LameParameters { mu: 3e-3 * parameters_j.mu, lambda: 1e-3 * parameters_j.mu };
    let relaxation = Relaxation::new(&[PronyTerm { share: 0.4, time_s: 0.1 }]).unwrap();
    ElementMaterial { law, parameters_j, viscous_js, relaxation }
}

fn domains() -> impl Iterator<Item = DomainMaterial> {
    let laws = [ElasticLaw::CorotationalLinear, ElasticLaw::NeoHookean].into_iter();
    laws.flat_map(|law| [0.0, 0.25, 0.49].map(|nu| material(law, nu))).flat_map(|material| {
        [
            DomainMaterial::of_node(material),
            DomainMaterial::of_tetrahedron(material),
            DomainMaterial { material, gradient_j: 1e-3 },
        ]
    })
}

/// Places far from rest and velocities. With `size` above 1 the domain is inverted.
fn moved(size: f64) -> ([DVec3; 5], [DVec3; 5]) {
    let number = |i: usize, axis: usize| ((i * 13 + axis * 29 + 5) % 17) as f64 / 8.0 - 1.0;
    let vector = |i: usize| DVec3::new(number(i, 0), number(i, 1), number(i, 2));
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.5, -1.1, 2.0);
    let rest = nodes().0;
    (
        std::array::from_fn(|i| turn * rest[i] + size * 0.01 * vector(i)),
        std::array::from_fn(|i| 0.3 * vector(i + 3)),
    )
}

const RELAXED: RelaxedStress = {
    let mut relaxed = [[0.0; 6]; MAX_PRONY_TERMS];
    relaxed[0] = [2e-4, -1e-4, 1e-4, 3e-4, -2e-4, 1e-4];
    relaxed
};

fn gradient(values: &[DVec3; 5]) -> DMat3 {
    domain_gradient(&nodes().1, values.iter().copied())
}

fn forces(domain: &DomainMaterial, x: &[DVec3; 5], v: &[DVec3; 5]) -> [DVec3; 5] {
    let stress_j = domain.stress_j(&gradient(x), || gradient(v), &RELAXED);
    nodes().1.map(|b| -(stress_j * b))
}

#[test]
fn forces_are_the_derivatives_of_the_energy_and_have_no_torque() {
    let (h, still) = (1e-7, [DVec3::ZERO; 5]);
    for (domain, size) in domains().flat_map(|domain| [0.1, 0.4, 1.5].map(|size| (domain, size))) {
        let (x, v) = moved(size);
        let scale = 1e-6 * domain.bounds_j(&gradient(&x)).0.max(1e-3) * 100.0;
        let elastic = forces(&domain, &x, &still);
        for (i, axis) in (0..5).flat_map(|i| (0..3).map(move |axis| (i, axis))) {
            let energy = |by: f64| {
                let mut x = x;
                x[i][axis] += by;
                domain.energy_j(&gradient(&x), &RELAXED)
            };
            let slope = -(energy(h) - energy(-h)) / (2.0 * h);
            assert!((slope - elastic[i][axis]).abs() < scale, "{domain:?}: {slope}, {}", elastic[i]);
        }
        let forces = forces(&domain, &x, &v);
        let sum: DVec3 = forces.iter().sum();
        let torque: DVec3 = x.iter().zip(&forces).map(|(x, f)| x.cross(*f)).sum();
        assert!(sum.length() < 1e-6 * scale && torque.length() < 1e-6 * scale, "{sum}, {torque}");
        let power: f64 = v.iter().zip(&forces).zip(&elastic).map(|((v, f), e)| v.dot(*e - *f)).sum();
        let dissipated = domain.dissipated_w(&gradient(&x), &gradient(&v));
        assert!((power - dissipated).abs() < 1e-12 + 1e-12 * power, "{power} {dissipated}");
        assert!(dissipated >= 0.0);
    }
}

#[test]
fn tangents_are_the_derivatives_of_the_forces_and_below_their_bounds() {
    let (h, still) = (1e-8, [DVec3::ZERO; 5]);
    for (domain, size) in domains().flat_map(|domain| [0.1, 0.4, 1.5].map(|size| (domain, size))) {
        let (x, v) = moved(size);
        let f = gradient(&x);
        let tangent = domain.tangent_j(&f, &RELAXED, false);
        let viscous = domain.viscous_tangent_js(&f);
        let gradients = nodes().1;
        let (k_bound, b_bound) = domain.bounds_j(&f);
        let scale = (k_bound + domain.gradient_j.abs()) * 1e4;
        for (j, axis) in (0..5).flat_map(|j| (0..3).map(move |axis| (j, axis))) {
            let at = |by: f64, mut x: [DVec3; 5]| {
                x[j][axis] += by;
                x
            };
            let (up, down) = (forces(&domain, &at(h, x), &still), forces(&domain, &at(-h, x), &still));
            let (faster, slower) = (forces(&domain, &x, &at(1.0, v)), forces(&domain, &x, &at(-1.0, v)));
            for i in 0..5 {
                let block = |of: &StressTangent| {
                    stress_block(&stress_change(of, gradients[j]), gradients[i]).col(axis)
                };
                let column = (down[i] - up[i]) / (2.0 * h);
                assert!((column - block(&tangent)).length() < 2e-6 * scale, "{domain:?} {size}");
                let column = (slower[i] - faster[i]) / 2.0;
                let of_viscous = viscous.as_ref().map_or(DVec3::ZERO, block);
                assert!((column - of_viscous).length() < 1e-10 * (1e4 * b_bound + 1.0), "{domain:?} {size}");
            }
        }
        // Forms of the tangents are below the bounds, node by node.
        let sum: f64 = gradients.iter().map(|b| b.length()).sum();
        let nodes: f64 = gradients.iter().zip(&v).map(|(b, v)| b.length() * sum * v.length_squared()).sum();
        let form = |of: &StressTangent| -> f64 {
            let pairs = (0..5).flat_map(|i| (0..5).map(move |j| (i, j)));
            let block = |(i, j): (usize, usize)| {
                v[i].dot(stress_block(&stress_change(of, gradients[j]), gradients[i]) * v[j])
            };
            pairs.map(block).sum()
        };
        assert!(viscous.as_ref().map_or(0.0, form) <= b_bound * nodes * (1.0 + 1e-12));
        let unrelaxed = domain.tangent_j(&f, &[[0.0; 6]; MAX_PRONY_TERMS], false);
        assert!(form(&unrelaxed) <= k_bound * nodes * (1.0 + 1e-12), "{domain:?} {size}");
        let clamped = domain.tangent_j(&f, &RELAXED, true);
        assert!(form(&clamped) >= domain.gradient_j.min(0.0) * nodes, "{domain:?} {size}");
    }
}

#[test]
fn domains_of_a_node_and_of_its_tetrahedra_balance() {
    let material = material(ElasticLaw::NeoHookean, 0.45);
    let (of_node, of_tetrahedron) =
        (DomainMaterial::of_node(material), DomainMaterial::of_tetrahedron(material));
    assert_eq!(of_node.gradient_j, -of_tetrahedron.gradient_j);
    // The relaxed modulus.
    let expected = (0.44 - 0.32 * 0.45) * 0.6 * material.parameters_j.mu;
    assert!((of_tetrahedron.gradient_j / expected - 1.0).abs() < 1e-12);
    assert!(!of_node.material.is_damped() && !of_tetrahedron.material.is_elastic());
    assert!(of_node.is_finite() && !DomainMaterial { gradient_j: f64::NAN, ..of_node }.is_finite());
    let mu = material.parameters_j.mu;
    assert_eq!(of_node.with_volume_share(0.0).material.parameters_j, LameParameters { mu, lambda: mu });
    assert_eq!(of_tetrahedron.with_volume_share(0.0), of_tetrahedron);
    assert_eq!(of_node.with_volume_share(1.0), of_node);
    assert_eq!([-1.0, 0.0, 0.05, 0.1, 2.0].map(DomainMaterial::volume_share), [0.0, 0.0, 0.5, 1.0, 1.0]);
    let mut relaxed = RelaxedStress::default();
    let stretched = DMat3::from_diagonal(DVec3::new(1.1, 1.0, 1.0));
    assert!(of_node.relax(&stretched, &mut relaxed, 10.0) > 0.05 && relaxed[0][0] > 0.0);
    assert!(of_node.relax(&stretched, &mut relaxed, 10.0) < 1e-12);
    assert_eq!(of_tetrahedron.relax(&stretched, &mut relaxed, 1.0), 0.0);
}
