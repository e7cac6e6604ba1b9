//! Stress and strain of bodies against closed forms.

use glam::{DMat3, DVec3};
use palpate_body::*;

const E: f64 = 20e3;

fn block() -> Block {
    Block::new([4, 5, 4], DVec3::new(0.03, 0.04, 0.03)).unwrap().allow_unconstrained()
}

fn body(made: BlockBody) -> Body {
    Body::new(made.network, made.surface).unwrap()
}

/// Moves every node X to F X.
fn deform(body: &mut Body, f: DMat3) {
    let x: Vec<DVec3> = body.network().rest_m().iter().map(|x| f * *x).collect();
    body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
}

fn is_near(a: &DMat3, b: &DMat3, within: f64) -> bool {
    a.to_cols_array().iter().zip(b.to_cols_array()).all(|(a, b)| (a - b).abs() < within)
}

#[test]
fn affine_deformation_has_the_stress_of_the_law_everywhere() {
    let f =
        DMat3::from_cols(DVec3::new(1.2, 0.1, 0.0), DVec3::new(-0.15, 0.9, 0.05), DVec3::new(0.0, 0.2, 1.05));
    let nu = 0.45;
    let (mu, lambda) = (E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
    let j = f.determinant();
    let expected = (f * f.transpose() - DMat3::IDENTITY) * (mu / j) + DMat3::IDENTITY * (lambda * j.ln() / j);
    let strain = (f.transpose() * f - DMat3::IDENTITY) * 0.5;
    let tissue = Tissue { youngs_modulus_pa: E, poissons_ratio: nu, ..Tissue::default() };
    for made in [block().elements(&tissue), block().tetrahedra(&tissue)] {
        let mut body = body(made.unwrap());
        deform(&mut body, f);
        for state in body.node_stresses() {
            assert!(
                is_near(&state.cauchy_pa, &expected, 1e-9 * E),
                "{:?}, not {expected:?}",
                state.cauchy_pa
            );
            assert!(is_near(&state.green_strain, &strain, 1e-12));
            assert!((state.volume_ratio - j).abs() < 1e-12);
        }
        let place_m = f * DVec3::new(0.0071, -0.0123, 0.0042);
        let point = body.point_within(place_m).unwrap();
        assert!(point.of(body.positions_m()).distance(place_m) < 1e-12);
        assert!(is_near(&body.stress_of(&point).cauchy_pa, &expected, 1e-9 * E));
        assert!(body.point_within(DVec3::splat(0.1)).is_none());
    }
}

#[test]
fn springs_have_hooke_s_stress_at_small_strain() {
    let strain = DMat3::from_cols(
        DVec3::new(1e-5, 2e-5, 0.0),
        DVec3::new(2e-5, -3e-5, 1e-5),
        DVec3::new(0.0, 1e-5, 2e-5),
    );
    let tissue = Tissue { youngs_modulus_pa: E, ..Tissue::default() };
    let mut body = body(block().tissue(&tissue).unwrap());
    deform(&mut body, DMat3::IDENTITY + strain);
    // λ = μ = 2 E/5.
    let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
    let expected = (DMat3::IDENTITY * trace + strain * 2.0) * (0.4 * E);
    for state in body.node_stresses() {
        assert!(is_near(&state.cauchy_pa, &expected, 3e-4 * 0.4 * E * 3e-5), "{:?}", state.cauchy_pa);
    }
}

#[test]
fn relaxed_stress_is_subtracted() {
    let relaxation = Relaxation::new(&[PronyTerm { share: 0.6, time_s: 0.01 }]).unwrap();
    let tissue = Tissue { youngs_modulus_pa: E, poissons_ratio: 0.45, relaxation, ..Tissue::default() };
    // All nodes of a layer of one cell are fixed: it keeps its shear.
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(1e-4, 1.0, 0.0), DVec3::Z);
    for build in [Block::elements, Block::tetrahedra] {
        let block = Block::new([4, 2, 4], DVec3::new(0.03, 0.01, 0.03)).unwrap();
        let made = build(
            &block.fix(Face::NegY).fix_within(Region::Sphere { center_m: DVec3::ZERO, radius_m: 1e-4 }),
            &tissue,
        );
        let mut body = body(made.unwrap());
        deform(&mut body, shear);
        let fresh = body.node_stresses()[20].cauchy_pa.x_axis.y;
        assert!((fresh / (E / 2.9 * 1e-4) - 1.0).abs() < 1e-3, "{fresh} Pa");
        // Ten relaxation times, in which the state is kept.
        let x = body.positions_m().to_vec();
        for _ in 0..100 {
            body.advance(None, 1, SemiImplicitEuler::default()).unwrap();
            let relaxed_stress_j = body.relaxed_stress_j().to_vec();
            let still = BodyState {
                relaxed_stress_j,
                positions_m: x.clone(),
                velocities_m_per_s: vec![DVec3::ZERO; x.len()],
                ..body.state()
            };
            body.restore(&still).unwrap();
        }
        let relaxed = body.node_stresses()[20].cauchy_pa.x_axis.y;
        assert!((relaxed / fresh - 0.4).abs() < 0.02, "{relaxed} Pa of {fresh} Pa");
    }
}

#[test]
fn csv_has_a_line_for_each_node() {
    let mut body = body(block().elements(&Tissue::default()).unwrap());
    deform(&mut body, DMat3::from_diagonal(DVec3::new(1.1, 1.0, 1.0)));
    let mut csv = Vec::new();
    body.write_stress_csv(&mut csv).unwrap();
    let csv = String::from_utf8(csv).unwrap();
    let mut lines = csv.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(names.len(), 13);
    let states = body.node_stresses();
    for (node, line) in lines.enumerate() {
        let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
        assert_eq!((values.len(), values[0]), (13, node as f64));
        assert_eq!(values[4], states[node].von_mises_pa());
        assert!((values[9] - 0.105).abs() < 1e-12, "{line}");
    }
    assert_eq!(csv.lines().count(), 81);
}
