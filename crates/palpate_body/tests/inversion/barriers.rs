//! Volume barriers: force, tangent, energy, cells, and the steps of a body while they act.

use super::*;

#[test]
fn force_is_minus_the_derivative_of_the_energy() {
    let mut body = cube(4);
    let x = shaken(&body, 0.016, 3);
    at_rest(&mut body, &x);
    assert!(body.inverted_cells().count() > 5 && body.active_barriers().count() > 60);
    let (force, h) = (internal_n(&body), 1e-7);
    for node in body.network().free().to_vec() {
        at_rest(&mut body, &x);
        let one = body.internal_force_on_n(node);
        assert!((one - force[node]).length() < 1e-12, "one node has {one} N, all have {} N", force[node]);
        for axis in 0..3 {
            let mut energy = |by: f64| {
                let mut x = x.clone();
                x[node][axis] += by;
                at_rest(&mut body, &x);
                body.energy().elastic_j
            };
            let expected = -(energy(h) - energy(-h)) / (2.0 * h);
            assert!((force[node][axis] - expected).abs() < 1e-6, "{} N, not {expected} N", force[node][axis]);
        }
    }
}

#[test]
fn tangent_is_the_derivative_of_the_force_and_its_clamped_form_is_positive_semidefinite() {
    let mut body = cube(3);
    let x = shaken(&body, 0.016, 5);
    at_rest(&mut body, &x);
    assert!(body.inverted_cells().count() > 2);
    let pattern = TangentPattern::new(&body);
    let (mut exact, mut clamped) = (pattern.zero(), pattern.zero());
    pattern.fill(&body, false, &mut exact);
    pattern.fill(&body, true, &mut clamped);
    let (exact, clamped) = (exact.stiffness().to_dense(), clamped.stiffness().to_dense());
    let (free, h) = (body.network().free().to_vec(), 1e-8);
    let largest = exact.norm_max();
    for (column, axis) in (0..free.len()).flat_map(|column| [0, 1, 2].map(|axis| (column, axis))) {
        let mut force = |by: f64| {
            let mut x = x.clone();
            x[free[column]][axis] += by;
            at_rest(&mut body, &x);
            internal_n(&body)
        };
        let (up, down) = (force(h), force(-h));
        for (row, &node) in free.iter().enumerate() {
            for c in 0..3 {
                let expected = -(up[node][c] - down[node][c]) / (2.0 * h);
                let got = exact[(3 * row + c, 3 * column + axis)];
                assert!((got - expected).abs() < 1e-6 * largest, "{got} N/m, not {expected} N/m");
            }
        }
    }
    let eigenvalues = |k: &faer::Mat<f64>| k.self_adjoint_eigenvalues(faer::Side::Lower).unwrap();
    assert!(eigenvalues(&exact)[0] < -1e-3 * largest, "the exact tangent is not indefinite");
    assert!(eigenvalues(&clamped)[0] > -1e-12 * largest);
}

#[test]
fn inactive_barriers_change_no_bit() {
    let body = cube(4);
    let network = body.network().clone();
    let springs = without_cells(&network);
    assert!(springs.cells().is_empty() && network.cells().len() == 27);
    for integrator in integrators() {
        let mut alone = Body::new(springs.clone(), Surface::default()).unwrap();
        let mut body = body.clone();
        // Compressed to 0.7 of its height, and sheared.
        let press = |x: &DVec3| {
            let up = (x.y - network.rest_m()[0].y) / 0.06;
            *x + up * DVec3::new(0.01, -0.018, 0.004)
        };
        let x: Vec<DVec3> = network.rest_m().iter().map(press).collect();
        let least = |x: &[DVec3]| ratios(&network, x).into_iter().fold(f64::INFINITY, f64::min);
        assert!((least(&x) - 0.7).abs() < 1e-12);
        at_rest(&mut body, &x);
        at_rest(&mut alone, &x);
        assert_eq!(internal_n(&body), internal_n(&alone));
        assert_eq!(body.energy(), alone.energy());
        for _ in 0..20 {
            assert_eq!(
                body.advance(None, 10, integrator).unwrap(),
                alone.advance(None, 10, integrator).unwrap()
            );
            assert_eq!(body.positions_m(), alone.positions_m());
            assert!(least(body.positions_m()) > 0.41);
        }
    }
}

#[test]
fn barrier_forces_rotate_with_the_body() {
    let mut body = cube(3);
    let x = shaken(&body, 0.02, 8);
    at_rest(&mut body, &x);
    let (force, energy) = (internal_n(&body), body.energy());
    let (turn, shift) =
        (DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 2.1), DVec3::new(0.3, 1.0, -2.0));
    let placed = body.network().clone().placed(turn, shift).unwrap();
    assert_eq!(placed.cells(), body.network().cells());
    let mut other = Body::new(placed, Surface::default()).unwrap();
    at_rest(&mut other, &x.iter().map(|x| turn * *x + shift).collect::<Vec<_>>());
    assert!((other.energy().elastic_j / energy.elastic_j - 1.0).abs() < 1e-12);
    assert_eq!(other.inverted_cells().collect::<Vec<_>>(), body.inverted_cells().collect::<Vec<_>>());
    for (turned, force) in internal_n(&other).into_iter().zip(force) {
        assert!((turned - turn * force).length() < 1e-11);
    }
}

#[test]
fn barrier_forces_have_no_resultant_and_no_moment() {
    let mut body = cube(3);
    let x = shaken(&body, 0.02, 9);
    at_rest(&mut body, &x);
    let (mut sum, mut moment, mut size) = (DVec3::ZERO, DVec3::ZERO, 0.0);
    for corner in body.active_barriers() {
        for (node, force) in corner.nodes.into_iter().zip(corner.forces_n(&x)) {
            sum += force;
            moment += x[node].cross(force);
            size += force.length();
        }
    }
    assert!(size > 1.0 && sum.length() < 1e-14 * size && moment.length() < 1e-14 * size);
}

#[test]
fn report_counts_a_cell_inverted_by_hand() {
    let mut body = cube(3);
    let mut x = body.network().rest_m().to_vec();
    // A corner of the block, moved through its only cell to the other side.
    let corner = 3 * 2;
    let own: Vec<usize> = (0..8).filter(|&cell| body.network().cells()[cell].contains(&corner)).collect();
    assert_eq!(own.len(), 1);
    x[corner] += DVec3::new(0.03, -0.03, 0.03);
    at_rest(&mut body, &x);
    assert_eq!(body.inverted_cells().collect::<Vec<_>>(), own);
    for integrator in integrators() {
        assert_eq!(body.advance(None, 0, integrator).unwrap().inverted_cells, 1);
    }
    // Flat counts as inverted, strongly compressed does not.
    for (share, count) in [(0.999, 0), (1.0, 1)] {
        let rest = body.network().rest_m().to_vec();
        let moved: Vec<DVec3> = rest
            .iter()
            .enumerate()
            .map(|(node, x)| if node == corner { *x - DVec3::Y * (0.02 * share) } else { *x })
            .collect();
        at_rest(&mut body, &moved);
        assert_eq!(body.inverted_cells().count(), count);
    }
}

#[test]
fn blocks_slits_and_meshes_have_cells_and_keep_them() {
    let slit = Slit { length_m: 0.06, depth_m: 0.03, opening_m: 0.004 };
    let block = Block::new([7, 6, 7], DVec3::new(0.06, 0.05, 0.06))
        .unwrap()
        .fix(Face::NegY)
        .slit(Slit { length_m: 0.04, ..slit });
    let network = block.tissue(&Tissue::default()).unwrap().network;
    assert_eq!(network.cells().len(), 6 * 5 * 6);
    assert!(network.node_count() > 7 * 6 * 7);
    // The nodes of each cell are connected, so no cell spans the slit.
    for cell in network.cells() {
        for (i, &a) in cell.iter().enumerate() {
            assert!(cell[i + 1..].iter().all(|&b| network.neighbours(a).any(|other| other == b)));
        }
    }
    let edited = network.clone().edit().region(|x| x.y > 0.0, 3.0, 1.0, 1.0).build().unwrap();
    assert_eq!(edited.cells(), network.cells());
    // Three times the stiffness, three times the barrier.
    let whole: Vec<DVec3> = network.rest_m().iter().map(|x| DVec3::new(x.x, 0.1 * x.y, x.z)).collect();
    let energy = |network: &Network, x: &[DVec3]| {
        let mut body = Body::new(network.clone(), Surface::default()).unwrap();
        at_rest(&mut body, x);
        body.active_barriers().map(|c| c.barrier.energy_j(c.ratio(x))).sum::<f64>()
    };
    let all = network.clone().edit().region(|_| true, 3.0, 1.0, 1.0).build().unwrap();
    assert!((energy(&all, &whole) / energy(&network, &whole) - 3.0).abs() < 1e-12);
    // A box mesh of whole cells equals the block.
    let (size, n) = (DVec3::new(0.06, 0.04, 0.08), [4, 3, 5]);
    let block = Block::new(n, size).unwrap().fix(Face::NegY).tissue(&Tissue::default()).unwrap().network;
    let corner = |c: usize| {
        0.5 * size * DVec3::from_array([0, 1, 2].map(|axis| if c >> axis & 1 == 1 { 1.0 } else { -1.0 }))
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    let mesh = ClosedMesh::new((0..8).map(corner).collect(), triangles).unwrap();
    let bottom = Region::HalfSpace { point_m: DVec3::NEG_Y * 0.0199, outward: DVec3::Y };
    let lattice = CellLattice::fit(&mesh, CellSize::Along(4)).unwrap().fix(bottom);
    let mesh = lattice.tissue(&Tissue::default()).unwrap().network;
    assert_eq!(mesh.cells(), block.cells());
    let flat: Vec<DVec3> = block.rest_m().iter().map(|x| DVec3::new(x.x, -0.2 * x.y, x.z)).collect();
    assert!((energy(&mesh, &flat) / energy(&block, &flat) - 1.0).abs() < 1e-12);
}

#[test]
fn energy_of_a_uniformly_flattened_block_is_the_closed_form() {
    // Ten tetrahedra of each cell, all with J = 0.15, t = 0.25 and the energy 3 t³ (1 + t²)^(−4/3) E V/10.
    let e = 35e3;
    for cell_m in [1e-3, 0.05] {
        let tissue = Tissue { youngs_modulus_pa: e, ..Tissue::default() };
        let mut body = block([4, 5, 3], cell_m * DVec3::new(3.0, 4.0, 2.0), &tissue);
        let x: Vec<DVec3> =
            body.network().rest_m().iter().map(|x| DVec3::new(x.x, 0.15 * x.y, x.z)).collect();
        at_rest(&mut body, &x);
        let springs: f64 = body.network().links().iter().map(|l| l.spring.energy_j(x[l.b] - x[l.a])).sum();
        let expected = e * 24.0 * cell_m.powi(3) * 3.0 * 0.015625 * 1.0625_f64.powf(-4.0 / 3.0);
        let got = body.energy().elastic_j - springs;
        assert!((got / expected - 1.0).abs() < 1e-10, "{got} J, not {expected} J");
    }
}

#[test]
fn energy_balance_closes_with_active_barriers() {
    let share = |integrator: Integrator| {
        let mut body = cube(3);
        body.set_gravity(DVec3::NEG_Y * 9.81).unwrap();
        body.start_energy_accounting();
        let node = 1 + 3 * (2 + 3);
        let at = body.positions_m()[node];
        let mut tool = ToolContact::hold(&body, node, at).unwrap();
        // 32 mm deep, through the cells below, and halfway back.
        let place = |i: i32| {
            let t = f64::from(i) * 1e-3;
            at + DVec3::new(0.004 * (20.0 * t).sin(), -0.016 * (1.0 - (20.0 * t).cos()), 0.0)
        };
        let path: Vec<ToolPoint> = (0..=220)
            .map(|i| ToolPoint { position_m: place(i), velocity_m_per_s: (place(i) - place(i - 1)) / 1e-3 })
            .collect();
        let mut inverted = 0;
        for ticks in path.windows(2) {
            let report = body.advance(Some((&mut tool, ticks)), 1, integrator).unwrap();
            inverted = inverted.max(report.inverted_cells);
        }
        assert!(inverted > 0, "{integrator:?}");
        let balance = body.energy_balance().unwrap();
        let through = balance.work_in_j.abs() + balance.damping_loss_j;
        let sum = balance.stored_j + balance.damping_loss_j + balance.integrator_j;
        assert!((sum - balance.work_in_j).abs() < 1e-12 * through);
        balance.integrator_j.abs() / through
    };
    let semi = |n| share(SemiImplicitEuler { min_substeps: n, ..SemiImplicitEuler::default() }.into());
    let whole = |n| share(LinearlyImplicitEuler { substeps: n, ..LinearlyImplicitEuler::default() }.into());
    for (coarse, fine) in [(semi(32), semi(128)), (whole(64), whole(256))] {
        assert!(fine < 2e-3, "{fine}");
        assert!(fine < 0.4 * coarse, "{coarse}, then {fine}");
    }
}

#[test]
fn restored_inverted_state_leads_to_identical_bits() {
    for integrator in integrators() {
        let mut body = cube(4);
        let x = shaken(&body, 0.03, 11);
        at_rest(&mut body, &x);
        body.advance(None, 10, integrator).unwrap();
        let state = body.state();
        assert!(body.active_barriers().count() > 0);
        body.advance(None, 60, integrator).unwrap();
        let mut other = cube(4);
        other.advance(None, 3, integrator).unwrap();
        other.restore(&state).unwrap();
        other.advance(None, 60, integrator).unwrap();
        assert_eq!(other.state(), body.state(), "{integrator:?}");
    }
}

#[test]
fn explicit_steps_stay_stable_while_cells_are_inverted() {
    // Without dampers, the energy of a released body would grow without bound if a step were unstable.
    let tissue = Tissue { youngs_modulus_pa: 500e3, damping: Damping::Ratio(0.0), ..Tissue::default() };
    let mut body = block([4; 3], DVec3::splat(0.06), &tissue);
    let at_rest_substeps = SemiImplicitEuler::default().substeps(&body).unwrap();
    // The energy fluctuates by a share that is proportional to the step length.
    for (min_substeps, share) in [(4, 0.4), (120, 0.02)] {
        let settings = SemiImplicitEuler { min_substeps, ..SemiImplicitEuler::default() };
        let x = shaken(&body, 0.03, 21);
        at_rest(&mut body, &x);
        let first = body.energy().total_j();
        let mut substeps = 0;
        for _ in 0..300 {
            substeps = substeps.max(body.advance(None, 1, settings).unwrap().substeps);
            let now = body.energy().total_j();
            assert!((now / first - 1.0).abs() < share, "{now} J after {first} J");
        }
        assert!(substeps > at_rest_substeps && substeps <= min_substeps.max(40), "{substeps}");
    }
    // A body whose springs need all substeps is still stepped.
    let x = shaken(&body, 0.012, 22);
    let mut alone = Body::new(without_cells(body.network()), Surface::default()).unwrap();
    at_rest(&mut body, &x);
    at_rest(&mut alone, &x);
    let settings =
        |max_substeps| SemiImplicitEuler { max_substeps, min_substeps: 1, ..SemiImplicitEuler::default() };
    let needed = settings(1000).substeps(&alone).unwrap();
    assert!(settings(1000).substeps(&body).unwrap() > needed);
    assert_eq!(settings(needed).substeps(&body).unwrap(), needed);
}
