//! Hexahedral elements against closed forms and converged solutions. The reference values are those of quadratic elements on graded meshes,
//! extrapolated (cases 2, 3 and 6).

use crate::element_bodies::*;
use crate::element_properties;
use crate::mesh::ripple::{press, ripple};
use glam::{DMat3, DVec3};
use palpate_body::*;

const HEXAHEDRA: Family = Family::Hexahedra;

#[test]
fn bonded_cube_has_the_converged_stiffness() {
    let cases = [
        (LINEAR, 0.25, 1e-3, 2.085_219_4),
        (LINEAR, 0.45, 1e-3, 2.345_365_2),
        (LINEAR, 0.49, 1e-3, 2.439_204_0),
        (ElasticLaw::NeoHookean, 0.25, 1e-2, 22.526_08),
        (ElasticLaw::NeoHookean, 0.45, 1e-2, 25.805_21),
    ];
    for (law, nu, down_m, reference_n) in cases {
        let errors = [4, 8, 16]
            .map(|cells| bonded_cube(HEXAHEDRA, cells, &tissue(law, nu), down_m) / reference_n - 1.0);
        // The edge of the bond is singular: the order is below 2.
        let falls = errors.windows(2).all(|pair| (0.0..0.52 * pair[0]).contains(&pair[1]));
        assert!(falls && errors[2] < 0.011, "{law:?} {nu}: {errors:?}");
    }
}

#[test]
fn cantilever_bends_as_the_converged_solution() {
    for (nu, reference_m) in [(0.25, 1.275_759e-3), (0.45, 1.253_473e-3), (0.49, 1.246_259e-3)] {
        // So small that the deflection is linear.
        let of = |cells| {
            1e3 * end_deflection(HEXAHEDRA, cells, &tissue(LINEAR, nu), 1e-6 * DVec3::Z, 1).z / reference_m
                - 1.0
        };
        let errors = [8, 16, 24].map(of);
        // Two, three and five cells across.
        assert!(errors[1].abs() < 0.01 && errors[2].abs() < 0.16 * errors[0].abs(), "{nu}: {errors:?}");
    }
    let u = end_deflection(HEXAHEDRA, 16, &tissue(ElasticLaw::NeoHookean, 0.45), -0.054 * DVec3::Z, 8);
    let errors = [u.x / -0.016_215_93 - 1.0, u.z / -0.050_860_88 - 1.0];
    assert!(errors.iter().all(|error| error.abs() < 0.01), "{errors:?}");
}

#[test]
fn cantilever_vibrates_as_the_converged_solution() {
    for (nu, reference_hz) in [(0.25, 1.410_890_2), (0.45, 1.426_430_6), (0.49, 1.431_656_2)] {
        let (mut body, _) = cantilever(HEXAHEDRA, 16, &tissue(LINEAR, nu));
        let error = frequency_hz(&mut body, |x| DVec3::Z * (x.x + 0.05).powi(2)) / reference_hz - 1.0;
        assert!(error.abs() < 0.01, "{nu}: {error}");
    }
}

/// Case 7: seven hexahedra in a cube of 0.1 m with eight distorted corners inside (R. H. MacNeal and R. L. Harder, Finite Elem. Anal. Des. 1
/// (1985) 3).
fn patch() -> (Vec<DVec3>, [[usize; 8]; 7]) {
    let nodes_mm = [
        [24.9, 34.2, 19.2],
        [82.6, 28.8, 28.8],
        [85.0, 64.9, 26.3],
        [27.3, 75.0, 23.0],
        [32.0, 18.6, 64.3],
        [67.7, 30.5, 68.3],
        [78.8, 69.3, 64.4],
        [16.5, 74.5, 70.2],
        [0.0, 0.0, 0.0],
        [100.0, 0.0, 0.0],
        [100.0, 100.0, 0.0],
        [0.0, 100.0, 0.0],
        [0.0, 0.0, 100.0],
        [100.0, 0.0, 100.0],
        [100.0, 100.0, 100.0],
        [0.0, 100.0, 100.0],
    ];
    // In the order of two circles of four corners.
    let circles = [
        [0, 1, 2, 3, 4, 5, 6, 7],
        [0, 3, 2, 1, 8, 11, 10, 9],
        [4, 5, 6, 7, 12, 13, 14, 15],
        [0, 1, 5, 4, 8, 9, 13, 12],
        [1, 2, 6, 5, 9, 10, 14, 13],
        [2, 3, 7, 6, 10, 11, 15, 14],
        [3, 0, 4, 7, 11, 8, 12, 15],
    ];
    let nodes = nodes_mm.map(|x| 1e-3 * DVec3::from_array(x)).to_vec();
    (nodes, circles.map(|[a, b, c, d, e, f, g, h]| [a, b, d, c, e, f, h, g]))
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
            let (rest, elements) = patch();
            let mut network = NetworkBuilder::new();
            rest.iter().for_each(|x| {
                network.node(*x, 0.0);
            });
            elements.iter().for_each(|nodes| {
                network.hexahedron(*nodes, &tissue(law, nu), 1.0);
            });
            let network = network.fix(8..16).build().unwrap();
            let mass: f64 = network.mass_kg().iter().sum();
            assert!((mass - 1.0).abs() < 1e-12, "{mass} kg");
            let mut body = Body::new(network, Surface::default()).unwrap();
            let moved = |x: DVec3| x + gradient * x;
            // The free nodes begin 2 mm off.
            let off = |node: usize| {
                let number = |axis: usize| ((node * 7 + axis * 5) % 9) as f64 - 4.0;
                if node < 8 { 5e-4 * DVec3::new(number(0), number(1), number(2)) } else { DVec3::ZERO }
            };
            let held: Vec<DVec3> = rest.iter().enumerate().map(|(node, x)| moved(*x) + off(node)).collect();
            body.set_state(&held, &[DVec3::ZERO; 16]).unwrap();
            newton(&mut body, 40);
            for (x, rest) in body.positions_m().iter().zip(&rest) {
                let off_m = x.distance(moved(*rest));
                assert!(off_m < 1e-10 * 0.1 * gradient.x_axis.length(), "{law:?} {nu}: {off_m} m");
            }
        }
    }
}

#[test]
fn stretched_compressed_twisted_flat_and_mirrored_bodies_return_to_rest() {
    element_properties::returns_from_motions(HEXAHEDRA);
}

#[test]
fn bodies_with_random_places_return_to_rest() {
    let mut random = Random(1);
    for (tissue, _) in tissues().flat_map(|tissue| (0..4).map(move |i| (tissue, i))) {
        let mut body = block(HEXAHEDRA, [4, 4, 6], &tissue);
        set_places(&mut body, |_| DVec3::new(0.03, 0.03, 0.05) * (random.vector() - 0.5));
        assert!(body.inverted_cells().count() > 10);
        returns(&mut body, 2e-3);
    }
}

#[test]
fn implicit_steps_return_from_random_places() {
    let mut random = Random(2);
    for tissue in tissues() {
        let mut body = block(HEXAHEDRA, [4, 4, 6], &tissue);
        set_places(&mut body, |_| DVec3::new(0.03, 0.03, 0.05) * (random.vector() - 0.5));
        for _ in 0..200 {
            body.advance(None, 20, LinearlyImplicitEuler::default()).unwrap();
            if body.inverted_cells().count() == 0 && off_m(&body) < 2e-3 {
                break;
            }
        }
        assert!(off_m(&body) < 2e-3, "{tissue:?}: {} m", off_m(&body));
    }
}

#[test]
fn energy_of_a_motion_is_in_the_balance() {
    element_properties::energy_of_a_motion_is_in_the_balance(HEXAHEDRA);
}

#[test]
fn rigid_motion_gives_no_force_and_free_motion_keeps_its_momenta() {
    element_properties::rigid_motion_gives_no_force_and_free_motion_keeps_its_momenta(HEXAHEDRA);
}

#[test]
fn tangent_of_a_body_is_the_derivative_of_its_forces() {
    element_properties::tangent_is_the_derivative_of_forces(HEXAHEDRA);
}

/// Differences of displacements under a force on a node of the top, which the distant bottom does not change much.
#[test]
fn surface_of_a_block_yields_as_the_table_of_hexahedra() {
    for nu in [0.25, 0.37, 0.45] {
        let block = Block::new([17, 17, 13], DVec3::new(0.16, 0.16, 0.12)).unwrap().fix(Face::NegZ);
        let middle = block.node([8, 8, 12]);
        let beside = [[9, 8], [9, 9], [10, 8], [10, 9], [11, 8], [8, 6]];
        let beside = beside.map(|[i, j]| ([i as i32 - 8, j as i32 - 8], block.node([i, j, 12])));
        let made = block.elements(&tissue(LINEAR, nu)).unwrap();
        let mut body = Body::new(made.network, made.surface).unwrap();
        let mut loads = vec![DVec3::ZERO; body.network().node_count()];
        loads[middle] = -1e-6 * DVec3::Z;
        body.set_loads(&loads).unwrap();
        let solver = LinearSolver::ConjugateGradients;
        let newton = LinearlyImplicitEuler {
            tick_s: 1e4,
            solver,
            tolerance: 1e-10,
            ..LinearlyImplicitEuler::default()
        };
        body.advance(None, 1, newton).unwrap();
        let down =
            |node: usize| (body.network().rest_m()[node].z - body.positions_m()[node].z) / 1e-6 * E * 0.01;
        let table = |[i, j]: [i32; 2]| palpate_laws::hexahedra_compliance(nu, i, j);
        for (offset, node) in beside {
            let (found, expected) = (down(middle) - down(node), table([0, 0]) - table(offset));
            assert!((found - expected).abs() < 0.01, "{nu} {offset:?}: {found}, {expected}");
        }
    }
}

/// A ball of half a cell and of a whole one, 0.4 radii deep, at places over a quarter of a cell's face. The force is Hertz's, a few per cent more
/// on a block of this size, and the same everywhere.
#[test]
fn ball_feels_no_cells_and_hertz_s_force() {
    const CELL: f64 = 0.01;
    for (law, nu, cells, most) in [
        (ElasticLaw::NeoHookean, 0.25, 0.5, 0.003),
        (ElasticLaw::NeoHookean, 0.45, 0.5, 0.003),
        (ElasticLaw::NeoHookean, 0.49, 0.5, 0.003),
        (ElasticLaw::NeoHookean, 0.45, 1.0, 0.005),
        (LINEAR, 0.45, 1.0, 0.013),
    ] {
        let block = Block::new([11, 11, 9], CELL * DVec3::new(10.0, 10.0, 8.0)).unwrap().fix(Face::NegZ);
        let made = block.elements(&tissue(law, nu)).unwrap();
        let body = Body::new(made.network, made.surface).unwrap();
        let (radius_m, depth_m) = (cells * CELL, 0.4 * cells * CELL);
        let hertz_n = 4.0 / 3.0 * E / (1.0 - nu * nu) * radius_m.sqrt() * depth_m.powf(1.5);
        let force =
            |[x, y]: [f64; 2]| press(&body, radius_m, (CELL * DVec3::new(x, y, 4.0), DVec3::Z), depth_m);
        let forces = [[0.0, 0.0], [0.5, 0.5], [0.5, 0.02], [0.37, 0.21]].map(force);
        let off = forces.iter().sum::<f64>() / forces.len() as f64 / hertz_n - 1.0;
        let text = format!("{law:?} {nu} {cells}: {off}, {}", ripple(&forces));
        assert!((-0.01..0.05).contains(&off) && ripple(&forces) < most, "{text}");
    }
}

/// A wide layer in simple shear: the force is proportional to the shear modulus.
#[test]
fn sheared_layer_relaxes_with_its_prony_series() {
    let layer = |tissue: &Tissue| {
        let block = Block::new([9, 9, 3], DVec3::new(0.16, 0.16, 0.02)).unwrap();
        let made = block.fix(Face::NegZ).fix(Face::PosZ).elements(tissue).unwrap();
        let mut body = Body::new(made.network, made.surface).unwrap();
        let sheared = body.positions_m().iter().map(|x| *x + 0.02 * (x.z + 0.01) * DVec3::X);
        let sheared: Vec<DVec3> = sheared.collect();
        body.set_state(&sheared, &vec![DVec3::ZERO; sheared.len()]).unwrap();
        body
    };
    let force = |body: &Body| -> f64 {
        let rest = body.network().rest_m();
        let mut force = vec![DVec3::ZERO; rest.len()];
        body.internal_forces_n(&mut force);
        rest.iter().zip(force).filter(|(x, _)| x.z > 0.0099).map(|(_, f)| -f.x).sum()
    };
    let mut body = layer(&relaxing(0.45));
    let mut elastic = layer(&Tissue { relaxation: Relaxation::NONE, ..relaxing(0.45) });
    let stored = body.energy().elastic_j;
    body.start_energy_accounting();
    for t in 1..=10 {
        for body in [&mut body, &mut elastic] {
            body.advance(None, 50, SemiImplicitEuler::default()).unwrap();
        }
        assert!(!body.is_settled(), "the stress still relaxes");
        let t = 0.05 * f64::from(t);
        let expected = 1.0 - 0.3 * (1.0 - (-t / 0.05).exp()) - 0.2 * (1.0 - (-t / 0.4).exp());
        let ratio = force(&body) / force(&elastic);
        assert!((ratio / expected - 1.0).abs() < 0.004, "{t} s: {ratio}, {expected}");
    }
    let balance = body.energy_balance().unwrap();
    // The energy of a branch falls twice as fast as its stress.
    let lost = 0.3 + 0.2 * (1.0 - (-2.0 * 0.5_f64 / 0.4).exp());
    assert!((balance.damping_loss_j / stored / lost - 1.0).abs() < 0.02, "{balance:?} of {stored} J");
    assert!(balance.integrator_j.abs() < 1e-4 * stored, "{balance:?} of {stored} J");
}

#[test]
fn relaxed_stress_is_part_of_the_state() {
    let mut body = block(HEXAHEDRA, [4, 4, 5], &relaxing(0.45));
    set_places(&mut body, |x| DVec3::new(x.x, x.y, 1.1 * x.z));
    body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
    let state = body.state();
    assert_eq!(state.relaxed_stress_j.len(), 36);
    let mut again = block(HEXAHEDRA, [4, 4, 5], &relaxing(0.45));
    again.restore(&state).unwrap();
    for body in [&mut body, &mut again] {
        body.advance(None, 60, SemiImplicitEuler::default()).unwrap();
    }
    assert_eq!(body.state(), again.state());
    let wrong = BodyState { relaxed_stress_j: vec![[[0.0; 6]; 3]; 35], ..state };
    let error = again.restore(&wrong).unwrap_err();
    assert_eq!(error, BodyError::RelaxedStress { found: 35, needed: 36 });
    // It returns to rest once all has relaxed.
    for _ in 0..60 {
        body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
    }
    assert!(off_m(&body) < 1e-5 && body.is_settled(), "{}", off_m(&body));
}
