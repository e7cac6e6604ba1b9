//! Properties of bodies of every family of elements.

use crate::element_bodies::*;
use glam::DVec3;
use palpate_body::*;

/// Stretched, compressed, twisted, flat and mirrored bodies return to rest.
pub fn returns_from_motions(family: Family) {
    type Motion = fn(DVec3) -> DVec3;
    let motions: [Motion; 5] = [
        |x| DVec3::new(x.x, x.y, 2.0 * x.z + 0.03),
        |x| DVec3::new(x.x, x.y, 0.4 * x.z - 0.6 * 0.03),
        |x| glam::DQuat::from_rotation_z(std::f64::consts::PI * (x.z + 0.03) / 0.06) * x,
        |x| DVec3::new(x.x, x.y, -0.03),
        |x| DVec3::new(x.x, x.y, -0.06 - x.z),
    ];
    for (tissue, motion) in tissues().flat_map(|tissue| motions.map(|motion| (tissue, motion))) {
        let mut body = block(family, [4, 4, 7], &tissue);
        set_places(&mut body, motion);
        returns(&mut body, 2e-3);
    }
}

/// The energy of a damped motion is in the balance, up to the error of the integrator.
pub fn energy_of_a_motion_is_in_the_balance(family: Family) {
    for tissue in tissues() {
        let balance = |min_substeps: usize| {
            let mut body = block(family, [4, 4, 5], &tissue);
            let mut random = Random(3);
            set_places(&mut body, |x| x + 2e-3 * (random.vector() - 0.5));
            let stored = body.energy().elastic_j;
            body.start_energy_accounting();
            let settings =
                SemiImplicitEuler { min_substeps, max_substeps: 100_000, ..SemiImplicitEuler::default() };
            body.advance(None, 10, settings).unwrap();
            let balance = body.energy_balance().unwrap();
            assert!(balance.damping_loss_j > 0.3 * stored, "{balance:?}");
            balance.integrator_j.abs() / stored
        };
        let errors = [100, 1000, 10_000].map(balance);
        // The integrator is of first order.
        assert!(errors[2] < 1e-6 && errors[1] < 0.15 * errors[0] + 1e-7, "{tissue:?}: {errors:?}");
        assert!(errors[2] < 0.15 * errors[1], "{tissue:?}: {errors:?}");
    }
}

/// A rigid motion gives no force and no energy, and a free motion keeps its momenta.
pub fn rigid_motion_gives_no_force_and_free_motion_keeps_its_momenta(family: Family) {
    for tissue in tissues() {
        let made = Block::new([4, 3, 5], DVec3::new(0.03, 0.02, 0.04)).unwrap().allow_unconstrained();
        let mut body = family.body(&made, &tissue);
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.5, 2.0, -1.0);
        let moved: Vec<DVec3> =
            body.positions_m().iter().map(|x| turn * *x + DVec3::new(0.3, 0.1, -2.0)).collect();
        let spin = DVec3::new(3.0, -1.0, 2.0);
        let v: Vec<DVec3> = moved.iter().map(|x| spin.cross(*x)).collect();
        body.set_state(&moved, &v).unwrap();
        let mut force = vec![DVec3::ZERO; v.len()];
        body.internal_forces_n(&mut force);
        assert!(force.iter().all(|f| f.length() < 1e-9), "{tissue:?}");
        assert!(body.energy().elastic_j.abs() < 1e-12, "{tissue:?}");
        let mut random = Random(4);
        let x: Vec<DVec3> = moved.iter().map(|x| *x + 3e-3 * (random.vector() - 0.5)).collect();
        body.set_state(&x, &v).unwrap();
        let momenta = |body: &Body| {
            let (m, x, v) = (body.network().mass_kg(), body.positions_m(), body.velocities_m_per_s());
            let linear: DVec3 = m.iter().zip(v).map(|(m, v)| *m * *v).sum();
            let angular: DVec3 = m.iter().zip(x).zip(v).map(|((m, x), v)| x.cross(*m * *v)).sum();
            (linear, angular)
        };
        let before = momenta(&body);
        body.advance(None, 200, SemiImplicitEuler::default()).unwrap();
        let after = momenta(&body);
        assert!((after.0 - before.0).length() < 1e-12 * (1.0 + before.0.length()), "{tissue:?}");
        assert!((after.1 - before.1).length() < 1e-12 * (1.0 + before.1.length()), "{tissue:?}");
    }
}

/// Stiffness and damping are the derivatives of the forces.
pub fn tangent_is_the_derivative_of_forces(family: Family) {
    for tissue in tissues() {
        let mut body = block(family, [3, 3, 4], &tissue);
        let mut random = Random(5);
        set_places(&mut body, |x| x + 4e-3 * (random.vector() - 0.5));
        let pattern = TangentPattern::new(&body);
        let mut tangent = pattern.zero();
        pattern.fill(&body, false, &mut tangent);
        let (x, still) = (body.positions_m().to_vec(), vec![DVec3::ZERO; body.positions_m().len()]);
        let free = body.network().free().to_vec();
        let mut forces = |x: &[DVec3], v: &[DVec3]| {
            body.set_state(x, v).unwrap();
            let mut force = still.clone();
            body.internal_forces_n(&mut force);
            force
        };
        let largest = tangent.stiffness().val().iter().fold(0.0_f64, |most, k| most.max(k.abs()));
        let h = 1e-7;
        for (column, &node) in free.iter().enumerate() {
            for axis in 0..3 {
                let moved = |by: f64, of: &[DVec3]| {
                    let mut of = of.to_vec();
                    of[node][axis] += by;
                    of
                };
                let (up, down) = (forces(&moved(h, &x), &still), forces(&moved(-h, &x), &still));
                let (fast, slow) = (forces(&x, &moved(1.0, &still)), forces(&x, &moved(-1.0, &still)));
                for (row, &other) in free.iter().enumerate() {
                    for along in 0..3 {
                        let at = |of: faer::sparse::SparseColMatRef<'_, usize, f64>| {
                            of.get(3 * row + along, 3 * column + axis).copied().unwrap_or(0.0)
                        };
                        let k = (down[other][along] - up[other][along]) / (2.0 * h);
                        assert!((k - at(tangent.stiffness())).abs() < 1e-6 * largest, "{tissue:?}");
                        let b = (slow[other][along] - fast[other][along]) / 2.0;
                        assert!((b - at(tangent.damping())).abs() < 1e-9 * largest, "{tissue:?}");
                    }
                }
            }
        }
    }
}
