//! Damping of tissues against closed forms.

use glam::DVec3;
use palpate_body::*;
use std::f64::consts::TAU;

const E: f64 = 20e3;

fn tissue(damping: Damping) -> Tissue {
    Tissue { youngs_modulus_pa: E, poissons_ratio: 0.45, damping, ..Tissue::default() }
}

/// A cube of springs and one of elements.
fn cubes(tissue: &Tissue, fix: Option<Face>) -> [Body; 2] {
    let block = Block::new([4; 3], DVec3::splat(0.06)).unwrap();
    let block = match fix {
        Some(face) => block.fix(face),
        None => block.allow_unconstrained(),
    };
    [block.tissue(tissue), block.elements(tissue)].map(|made| {
        let made = made.unwrap();
        Body::new(made.network, made.surface).unwrap()
    })
}

#[test]
fn rayleigh_damping_is_the_sum_of_mass_and_stiffness_at_rest() {
    let (alpha, beta) = (3.0, 2e-3);
    let tissue = tissue(Damping::Rayleigh { mass_per_s: alpha, stiffness_s: beta });
    for body in cubes(&tissue, Some(Face::NegZ)) {
        let pattern = TangentPattern::new(&body);
        let mut tangent = pattern.zero();
        pattern.fill(&body, false, &mut tangent);
        let (k, b) = (tangent.stiffness(), tangent.damping());
        let network = body.network();
        let largest = b.val().iter().fold(0.0_f64, |most, b| most.max(b.abs()));
        for column in 0..k.ncols() {
            let mass = network.mass_kg()[network.free()[column / 3]];
            for (row, k) in k.row_idx_of_col(column).zip(k.val_of_col(column)) {
                let expected = beta * k + if row == column { alpha * mass } else { 0.0 };
                let b = b.get(row, column).copied().unwrap_or(0.0);
                assert!((b - expected).abs() < 1e-12 * largest, "{row}, {column}: {b}, not {expected}");
            }
        }
    }
}

#[test]
fn mass_proportional_damping_slows_a_free_body_exponentially() {
    let alpha = 5.0;
    let tissue = tissue(Damping::Rayleigh { mass_per_s: alpha, stiffness_s: 0.0 });
    let inclusion = Tissue { density_kg_per_m3: 1500.0, ..tissue };
    for mut body in cubes(&tissue, None) {
        let still = body.positions_m().to_vec();
        let v = DVec3::new(0.1, -0.2, 0.05);
        body.set_state(&still, &vec![v; still.len()]).unwrap();
        body.start_energy_accounting();
        let kinetic = body.energy().kinetic_j;
        body.advance(None, 100, SemiImplicitEuler { min_substeps: 20, ..SemiImplicitEuler::default() })
            .unwrap();
        // v' = v (1 − α h) in each substep.
        let expected = v * (1.0 - alpha * 5e-5_f64).powi(2000);
        for after in body.velocities_m_per_s() {
            assert!(after.distance(expected) < 1e-12, "{after}, not {expected}");
        }
        assert!((expected.length() / v.length() - (-alpha * 0.1_f64).exp()).abs() < 1e-4);
        let balance = body.energy_balance().unwrap();
        let lost = kinetic - body.energy().kinetic_j;
        // Losses are counted at the mean velocity of a substep, v (1 − α h/2).
        let of_mean = 1.0 - alpha * 5e-5 / 2.0;
        assert!((balance.damping_loss_j / lost / of_mean - 1.0).abs() < 1e-7, "{balance:?}, lost {lost} J");
    }
    // Where a heavier region has the same coefficient, the motion stays rigid too.
    let block = Block::new([5; 3], DVec3::splat(0.06)).unwrap().allow_unconstrained();
    let block = block.region(Region::Sphere { center_m: DVec3::splat(0.02), radius_m: 0.03 }, inclusion);
    for made in [block.tissue(&tissue), block.elements(&tissue)] {
        let made = made.unwrap();
        let mut body = Body::new(made.network, made.surface).unwrap();
        let still = body.positions_m().to_vec();
        body.set_state(&still, &vec![DVec3::X; still.len()]).unwrap();
        body.advance(None, 100, SemiImplicitEuler::default()).unwrap();
        let first = body.velocities_m_per_s()[0];
        assert!(body.velocities_m_per_s().iter().all(|v| v.distance(first) < 1e-9));
    }
}

#[test]
fn loss_factor_is_the_ratio_of_the_viscous_to_the_elastic_shear_force() {
    let (loss_factor, frequency_hz) = (0.3, 10.0);
    for mut body in cubes(&tissue(Damping::LossFactor { loss_factor, frequency_hz }), Some(Face::NegZ)) {
        // Simple shear of 0.1 %, and its rate in a vibration of this amplitude at this frequency.
        let rest = body.positions_m().to_vec();
        let shear =
            |rate: f64| -> Vec<DVec3> { rest.iter().map(|x| DVec3::X * rate * (x.z + 0.03)).collect() };
        let moved: Vec<DVec3> = rest.iter().zip(shear(1e-3)).map(|(x, dx)| *x + dx).collect();
        let on_top = |body: &Body| -> f64 {
            let mut force = vec![DVec3::ZERO; rest.len()];
            body.internal_forces_n(&mut force);
            rest.iter().zip(force).filter(|(x, _)| x.z > 0.03 - 1e-9).map(|(_, f)| f.x).sum()
        };
        body.set_state(&moved, &vec![DVec3::ZERO; rest.len()]).unwrap();
        let elastic = on_top(&body);
        body.set_state(&rest, &shear(1e-3 * TAU * frequency_hz)).unwrap();
        let viscous = on_top(&body);
        assert!((viscous / elastic / loss_factor - 1.0).abs() < 1e-5, "{viscous} N, {elastic} N");
    }
}

#[test]
fn damped_motion_is_in_the_balance() {
    for damping in [
        Damping::Rayleigh { mass_per_s: 20.0, stiffness_s: 2e-3 },
        Damping::LossFactor { loss_factor: 0.4, frequency_hz: 20.0 },
    ] {
        for start in 0..2 {
            let balance = |min_substeps: usize| {
                let [springs, elements] = cubes(&tissue(damping), Some(Face::NegZ));
                let mut body = if start == 0 { springs } else { elements };
                let network = body.network();
                let places = network.rest_m().iter().enumerate();
                let stretched = |x: &DVec3| *x + 0.1 * DVec3::new(x.y, -x.x, x.z + 0.03);
                let x: Vec<DVec3> =
                    places.map(|(i, x)| if network.is_fixed(i) { *x } else { stretched(x) }).collect();
                body.set_state(&x, &vec![DVec3::ZERO; x.len()]).unwrap();
                let stored = body.energy().elastic_j;
                body.start_energy_accounting();
                let settings =
                    SemiImplicitEuler { min_substeps, max_substeps: 10_000, ..SemiImplicitEuler::default() };
                body.advance(None, 20, settings).unwrap();
                let balance = body.energy_balance().unwrap();
                assert!(balance.damping_loss_j > 0.3 * stored, "{balance:?}");
                balance.integrator_j.abs() / stored
            };
            let errors = [100, 1000].map(balance);
            // The integrator is of first order.
            assert!(errors[1] < 2e-5 && errors[1] < 0.15 * errors[0], "{damping:?}: {errors:?}");
        }
    }
}

#[test]
fn rejects_invalid_damping() {
    let block = Block::new([3; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ);
    for bad in [-0.1, f64::NAN, f64::INFINITY] {
        for damping in [
            Damping::Ratio(bad),
            Damping::LossFactor { loss_factor: bad, frequency_hz: 1.0 },
            Damping::LossFactor { loss_factor: 0.1, frequency_hz: bad },
            Damping::LossFactor { loss_factor: 0.1, frequency_hz: 0.0 },
            Damping::Rayleigh { mass_per_s: bad, stiffness_s: 0.0 },
            Damping::Rayleigh { mass_per_s: 0.0, stiffness_s: bad },
        ] {
            assert!(block.tissue(&tissue(damping)).is_err(), "{damping:?}");
            assert!(block.elements(&tissue(damping)).is_err(), "{damping:?}");
        }
    }
    let mut network = NetworkBuilder::new();
    let node = network.node(DVec3::ZERO, 1.0);
    network.drag(node, -1.0);
    assert!(network.allow_unconstrained().build().is_err());
}
