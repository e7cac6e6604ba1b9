//! Tetrahedral elements against closed forms and converged solutions; see `elements`.

use crate::element_bodies::*;
use crate::element_properties;
use glam::{DMat3, DVec3};
use palpate_body::*;

const TETRAHEDRA: Family = Family::Tetrahedra;

#[test]
fn bonded_cube_has_the_converged_stiffness() {
    let cases = [
        (LINEAR, 0.25, 1e-3, 2.085_219_4, 0.005),
        (LINEAR, 0.45, 1e-3, 2.345_365_2, 0.012),
        (LINEAR, 0.49, 1e-3, 2.439_204_0, 0.03),
        (ElasticLaw::NeoHookean, 0.25, 1e-2, 22.526_08, 0.005),
        (ElasticLaw::NeoHookean, 0.45, 1e-2, 25.805_21, 0.02),
    ];
    for (law, nu, down_m, reference_n, most) in cases {
        let error = bonded_cube(TETRAHEDRA, 10, &tissue(law, nu), down_m) / reference_n - 1.0;
        assert!(error.abs() < most, "{law:?} {nu}: {error}");
    }
}

#[test]
fn cantilever_bends_as_the_converged_solution() {
    for (nu, reference_m) in [(0.25, 1.275_759e-3), (0.45, 1.253_473e-3), (0.49, 1.246_259e-3)] {
        // So small that the deflection is linear.
        let of = |cells| {
            let load_n = 1e-6 * DVec3::Z;
            1e3 * end_deflection(TETRAHEDRA, cells, &tissue(LINEAR, nu), load_n, 1).z / reference_m - 1.0
        };
        // Three and five cells across.
        let errors = [16, 24].map(of);
        assert!(errors[0].abs() < 0.03 && errors[1].abs() < 0.02, "{nu}: {errors:?}");
    }
    let u = end_deflection(TETRAHEDRA, 16, &tissue(ElasticLaw::NeoHookean, 0.45), -0.054 * DVec3::Z, 8);
    let errors = [u.x / -0.016_215_93 - 1.0, u.z / -0.050_860_88 - 1.0];
    assert!(errors.iter().all(|error| error.abs() < 0.03), "{errors:?}");
}

#[test]
fn cantilever_vibrates_as_the_converged_solution() {
    for (nu, reference_hz) in [(0.25, 1.410_890_2), (0.45, 1.426_430_6), (0.49, 1.431_656_2)] {
        let (mut body, _) = cantilever(TETRAHEDRA, 16, &tissue(LINEAR, nu));
        let error = frequency_hz(&mut body, |x| DVec3::Z * (x.x + 0.05).powi(2)) / reference_hz - 1.0;
        assert!(error.abs() < 0.03, "{nu}: {error}");
    }
}

/// A network of a cube of 0.1 m with `cells` cells along each edge, whose inner nodes are moved at random by up to `share` of a cell. The
/// tissue of elements with a midpoint above 0.05 m is the second one.
fn distorted(cells: usize, share: f64, [below, above]: [Tissue; 2]) -> (NetworkBuilder, Vec<bool>) {
    let (mut network, mut random) = (NetworkBuilder::new(), Random(7));
    let (count, size) = (cells + 1, 0.1 / cells as f64);
    let mut is_inner = Vec::new();
    let mut rest = Vec::new();
    for (k, j, i) in (0..count).flat_map(|k| (0..count).flat_map(move |j| (0..count).map(move |i| (k, j, i))))
    {
        let inner = [i, j, k].iter().all(|i| (1..cells).contains(i));
        let at = size * DVec3::new(i as f64, j as f64, k as f64);
        let off = if inner { 2.0 * share * size * (random.vector() - 0.5) } else { DVec3::ZERO };
        rest.push(at + off);
        network.node(at + off, 0.0);
        is_inner.push(inner);
    }
    let node = |[i, j, k]: [usize; 3]| i + count * (j + count * k);
    for (k, j, i) in (0..cells).flat_map(|k| (0..cells).flat_map(move |j| (0..cells).map(move |i| (k, j, i))))
    {
        let corners = std::array::from_fn(|c| node([i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)]));
        let tissue = if 2 * k < cells { &below } else { &above };
        network.tetrahedra(&cell_tetrahedra(corners), tissue);
    }
    (network, is_inner)
}

#[test]
fn patch_of_distorted_elements_has_the_affine_solution() {
    let small = DMat3::from_cols(
        DVec3::new(1e-3, 2e-4, 5e-4),
        DVec3::new(4e-4, -5e-4, -1e-4),
        DVec3::new(-3e-4, 6e-4, 8e-4),
    );
    for nu in [0.25, 0.45, 0.49] {
        for (law, gradient) in
            [(LINEAR, small), (LINEAR, 200.0 * small), (ElasticLaw::NeoHookean, 200.0 * small)]
        {
            let tissue = tissue(law, nu);
            let (network, is_inner) = distorted(4, 0.25, [tissue; 2]);
            let outer = is_inner.iter().enumerate().filter(|(_, inner)| !**inner).map(|(node, _)| node);
            let network = network.fix(outer).build().unwrap();
            let rest = network.rest_m().to_vec();
            let mass: f64 = network.mass_kg().iter().sum();
            assert!((mass - 1.0).abs() < 1e-12, "{mass} kg");
            let mut body = Body::new(network, Surface::default()).unwrap();
            let moved = |x: DVec3| x + gradient * x;
            let mut random = Random(8);
            let held: Vec<DVec3> = rest
                .iter()
                .zip(&is_inner)
                .map(|(x, inner)| {
                    let off = if *inner { 1e-3 * (random.vector() - 0.5) } else { DVec3::ZERO };
                    moved(*x) + off
                })
                .collect();
            body.set_state(&held, &vec![DVec3::ZERO; held.len()]).unwrap();
            newton(&mut body, 40);
            for (x, rest) in body.positions_m().iter().zip(&rest) {
                let off_m = x.distance(moved(*rest));
                assert!(off_m < 1e-10 * 0.1 * gradient.x_axis.length(), "{law:?} {nu}: {off_m} m");
            }
        }
    }
}

/// Two tissues in a row under tension: each has its own strain, since they are not averaged together.
#[test]
fn tissues_in_series_have_their_closed_form() {
    let soft = tissue(LINEAR, 0.0);
    let stiff = Tissue { youngs_modulus_pa: 4.0 * E, ..soft };
    let (network, _) = distorted(4, 0.2, [soft, stiff]);
    let network = network.fix_where(|x| x.z < 1e-9 || x.z > 0.1 - 1e-9).build().unwrap();
    let rest = network.rest_m().to_vec();
    let mut body = Body::new(network, Surface::default()).unwrap();
    // The elastic interface is not flat, since nodes between the halves are moved: it is where the tissues meet.
    let lifted: Vec<DVec3> =
        rest.iter().map(|x| if x.z > 0.1 - 1e-9 { *x + 1e-6 * DVec3::Z } else { *x }).collect();
    body.set_state(&lifted, &vec![DVec3::ZERO; lifted.len()]).unwrap();
    newton(&mut body, 6);
    let mut force = vec![DVec3::ZERO; rest.len()];
    body.internal_forces_n(&mut force);
    let pull: f64 = rest.iter().zip(&force).filter(|(x, _)| x.z > 0.1 - 1e-9).map(|(_, f)| -f.z).sum();
    // Springs E A/L in series.
    let expected = E * 0.01 / 0.1 * 1e-6 / (0.5 + 0.5 / 4.0);
    assert!((pull / expected - 1.0).abs() < 0.01, "{pull} N, {expected} N");
}

/// Slippery platens: the sides of a block move freely, and its stress is uniaxial.
#[test]
fn uniaxial_stress_has_its_closed_form() {
    for (nu, stretch) in [(0.25, 0.7), (0.45, 1.4), (0.49, 0.8)] {
        let law = ElasticLaw::NeoHookean;
        // λ₂ with (μ (λ₂² − 1) + λ ln J)/J = 0, by bisection.
        let parameters = palpate_laws::LameParameters::new(E, nu).unwrap();
        let across_pa = |s: f64| parameters.mu * (s * s - 1.0) + parameters.lambda * (stretch * s * s).ln();
        let (mut low, mut high) = (0.3, 3.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            *(if across_pa(middle) < 0.0 { &mut low } else { &mut high }) = middle;
        }
        let expected_pa = (parameters.mu * (stretch * stretch - 1.0)
            + parameters.lambda * (stretch * low * low).ln())
            / stretch;
        let block = Block::new([4, 4, 4], DVec3::splat(0.03)).unwrap().fix(Face::NegZ).fix(Face::PosZ);
        let mut body = TETRAHEDRA.body(&block, &tissue(law, nu));
        let x: Vec<DVec3> =
            body.network().rest_m().iter().map(|x| *x * DVec3::new(low, low, stretch)).collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        let mut force = vec![DVec3::ZERO; x.len()];
        body.internal_forces_n(&mut force);
        let rest = body.network().rest_m();
        let on_top: f64 = rest.iter().zip(&force).filter(|(x, _)| x.z > 0.0149).map(|(_, f)| -f.z).sum();
        assert!((on_top / (expected_pa * 9e-4) - 1.0).abs() < 1e-9, "{nu}: {on_top}");
        let inner = rest.iter().zip(&force).filter(|(x, _)| x.z.abs() < 0.0149);
        inner.for_each(|(_, f)| assert!(f.length() < 1e-9, "{nu}: {f}"));
    }
}

#[test]
fn stretched_compressed_twisted_flat_and_mirrored_bodies_return_to_rest() {
    element_properties::returns_from_motions(TETRAHEDRA);
}

#[test]
fn bodies_with_random_places_return_to_rest() {
    let mut random = Random(1);
    for (tissue, _) in tissues().flat_map(|tissue| (0..4).map(move |i| (tissue, i))) {
        let mut body = block(TETRAHEDRA, [4, 4, 6], &tissue);
        set_places(&mut body, |_| DVec3::new(0.03, 0.03, 0.05) * (random.vector() - 0.5));
        assert!(body.inverted_tetrahedra().count() > 100);
        returns(&mut body, 2e-3);
    }
}

/// Steps of a tick throw corotational bodies of a large λ far apart from such states.
#[test]
fn implicit_steps_return_from_random_places() {
    let mut random = Random(2);
    for tissue in tissues().filter(|tissue| tissue.law != LINEAR || tissue.poissons_ratio < 0.4) {
        let mut body = block(TETRAHEDRA, [4, 4, 6], &tissue);
        set_places(&mut body, |_| DVec3::new(0.03, 0.03, 0.05) * (random.vector() - 0.5));
        for _ in 0..200 {
            body.advance(None, 20, LinearlyImplicitEuler::default()).unwrap();
            if body.inverted_tetrahedra().count() == 0 && off_m(&body) < 2e-3 {
                break;
            }
        }
        let inverted = body.inverted_tetrahedra().count();
        assert!(inverted == 0 && off_m(&body) < 2e-3, "{tissue:?}: {} m, {inverted}", off_m(&body));
    }
}

#[test]
fn energy_of_a_motion_is_in_the_balance() {
    element_properties::energy_of_a_motion_is_in_the_balance(TETRAHEDRA);
}

#[test]
fn rigid_motion_gives_no_force_and_free_motion_keeps_its_momenta() {
    element_properties::rigid_motion_gives_no_force_and_free_motion_keeps_its_momenta(TETRAHEDRA);
}

#[test]
fn force_on_one_node_is_that_of_all() {
    let mut body = block(TETRAHEDRA, [3, 4, 3], &relaxing(0.45));
    let mut random = Random(9);
    set_places(&mut body, |x| x + 4e-3 * (random.vector() - 0.5));
    body.advance(None, 5, SemiImplicitEuler::default()).unwrap();
    let mut force = vec![DVec3::ZERO; body.positions_m().len()];
    body.internal_forces_n(&mut force);
    for (node, force) in force.into_iter().enumerate() {
        assert!(body.internal_force_on_n(node).distance(force) < 1e-13, "{node}");
    }
}

#[test]
fn tangent_of_a_body_is_the_derivative_of_its_forces() {
    element_properties::tangent_is_the_derivative_of_forces(TETRAHEDRA);
}

/// The clamped tangent is positive definite where the fixed nodes allow no motion, in any state.
#[test]
fn clamped_tangent_of_a_crushed_body_is_positive_definite() {
    for tissue in tissues() {
        let mut body = block(TETRAHEDRA, [3, 3, 4], &tissue);
        let mut random = Random(6);
        set_places(&mut body, |_| 0.03 * (random.vector() - 0.5));
        let pattern = TangentPattern::new(&body);
        let mut tangent = pattern.zero();
        pattern.fill(&body, true, &mut tangent);
        let factor = tangent.stiffness().sp_cholesky(faer::Side::Lower);
        assert!(factor.is_ok(), "{tissue:?}");
    }
}

#[test]
fn relaxed_stress_is_part_of_the_state() {
    let make = || block(TETRAHEDRA, [4, 4, 5], &relaxing(0.45));
    let mut body = make();
    set_places(&mut body, |x| DVec3::new(x.x, x.y, 1.1 * x.z));
    body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
    let state = body.state();
    assert_eq!(state.relaxed_stress_j.len(), body.network().tetrahedra().domains().of_nodes());
    let mut again = make();
    again.restore(&state).unwrap();
    for body in [&mut body, &mut again] {
        body.advance(None, 60, SemiImplicitEuler::default()).unwrap();
    }
    assert_eq!(body.state(), again.state());
    // It returns to rest once all has relaxed.
    for _ in 0..60 {
        body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
    }
    assert!(off_m(&body) < 1e-5 && body.is_settled(), "{}", off_m(&body));
}

#[test]
fn placed_network_has_the_forces_turned() {
    let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.5, 2.0, -1.0);
    let made = Block::new([3, 3, 4], DVec3::splat(0.03)).unwrap().fix(Face::NegZ);
    let made = made.tetrahedra(&tissue(ElasticLaw::NeoHookean, 0.45)).unwrap();
    let placed = made.network.clone().placed(turn, DVec3::new(1.0, 2.0, 3.0)).unwrap();
    let forces = |network: Network, turn: glam::DQuat| {
        let mut body = Body::new(network, Surface::default()).unwrap();
        let mut random = Random(5);
        let rest = body.network().rest_m().to_vec();
        let x: Vec<DVec3> = rest.iter().map(|x| *x + turn * (2e-3 * (random.vector() - 0.5))).collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        let mut force = vec![DVec3::ZERO; x.len()];
        body.internal_forces_n(&mut force);
        force
    };
    let pairs = forces(made.network, glam::DQuat::IDENTITY).into_iter().zip(forces(placed, turn));
    pairs.for_each(|(f, turned)| assert!((turn * f).distance(turned) < 1e-10, "{f} {turned}"));
}

#[test]
fn region_scales_stiffness_and_edited_networks_are_equal() {
    let made = Block::new([3, 3, 5], DVec3::new(0.02, 0.02, 0.04)).unwrap().fix(Face::NegZ);
    let network = made.tetrahedra(&tissue(ElasticLaw::NeoHookean, 0.45)).unwrap().network;
    assert_eq!(network.clone().edit().build().unwrap(), network);
    let stiff = network.clone().edit().region(|x| x.z > 0.0, 3.0, 2.0, 1.0).build().unwrap();
    let all = network.clone().edit().region(|_| true, 3.0, 2.0, 1.0).build().unwrap();
    let energy = |network: Network, motion: fn(DVec3) -> DVec3| {
        let mut body = Body::new(network, Surface::default()).unwrap();
        let x: Vec<DVec3> = body.network().rest_m().iter().map(|x| motion(*x)).collect();
        body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
        body.energy().elastic_j
    };
    let stretched: fn(DVec3) -> DVec3 = |x| DVec3::new(x.x, x.y, 1.1 * x.z);
    let plain = energy(network, stretched);
    assert!((energy(all, stretched) / plain - 3.0).abs() < 1e-9);
    assert!((energy(stiff, stretched) / plain - 2.0).abs() < 1e-9);
}

#[test]
fn invalid_tetrahedra_are_rejected() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|x| 0.01 * x);
    let build = |nodes: [usize; 4], tissue: &Tissue| {
        let mut network = NetworkBuilder::new();
        corners.iter().for_each(|x| {
            network.node(*x, 0.0);
        });
        network.tetrahedra(&[nodes], tissue);
        network.fix([0]).build()
    };
    let tissue = tissue(LINEAR, 0.3);
    assert!(build([0, 1, 2, 3], &tissue).is_ok());
    assert_eq!(build([0, 1, 2, 4], &tissue), Err(BodyError::ElementNode { element: 0, node: 4, nodes: 4 }));
    for bad in [[0, 2, 1, 3], [0, 1, 1, 3]] {
        assert_eq!(build(bad, &tissue), Err(BodyError::ElementShape { element: 0 }));
    }
    assert!(build([0, 1, 2, 3], &Tissue { poissons_ratio: 0.5, ..tissue }).is_err());
}
