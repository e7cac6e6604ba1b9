//! The network of a mesh: masses, springs, fixed nodes and position.

use super::shapes::{Shape, cube, cuboid, sphere, torus};
use glam::{DMat3, DQuat, DVec3};
use palpate_body::*;
use palpate_laws::ForceLaw;
use proptest::prelude::*;

const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 20e3,
    density_kg_per_m3: 1000.0,
    damping: Damping::Ratio(0.5),
    ..Tissue::SOFT
};

fn free(shape: &Shape, cells: usize) -> MeshBody {
    let mesh = shape.close().unwrap();
    CellLattice::fit(&mesh, CellSize::Along(cells)).unwrap().allow_unconstrained().tissue(&TISSUE).unwrap()
}

fn mass(network: &Network) -> f64 {
    network.mass_kg().iter().sum()
}

fn center_of_mass(network: &Network) -> DVec3 {
    network.rest_m().iter().zip(network.mass_kg()).map(|(x, m)| *m * *x).sum::<DVec3>() / mass(network)
}

fn stiffness(link: &Link) -> f64 {
    let ForceLaw::Linear { stiffness_n_per_m } = link.spring.law() else { unreachable!() };
    stiffness_n_per_m
}

/// Elastic energy under the infinitesimal affine displacement x → x + ε x.
fn energy(network: &Network, strain: DMat3) -> f64 {
    let x = network.rest_m();
    let of = |link: &Link| {
        let d = x[link.b] - x[link.a];
        0.5 * stiffness(link) * (d.dot(strain * d) / d.length()).powi(2)
    };
    network.links().iter().map(of).sum()
}

#[test]
fn box_of_whole_cells_gives_the_network_of_a_block() {
    let size = DVec3::new(0.12, 0.08, 0.1);
    let at = DVec3::new(0.3, -0.2, 5.0);
    let block = Block::new([7, 5, 6], size).unwrap().centered_at(at).unwrap().fix(Face::NegZ);
    let block = block.tissue(&TISSUE).unwrap().network;
    for fields in [[1; 3], [6, 4, 5], [5, 7, 3]] {
        let mesh = cuboid(size, fields).moved(at).close().unwrap();
        let bottom = Region::HalfSpace { point_m: at - 0.049 * DVec3::Z, outward: DVec3::Z };
        let made = CellLattice::fit(&mesh, CellSize::Along(6)).unwrap().fix(bottom).tissue(&TISSUE).unwrap();
        let network = made.network;
        assert_eq!(network.node_count(), block.node_count());
        assert_eq!(network.free(), block.free());
        for node in 0..block.node_count() {
            assert!(network.rest_m()[node].distance(block.rest_m()[node]) < 1e-14);
            assert!((network.mass_kg()[node] / block.mass_kg()[node] - 1.0).abs() < 1e-12);
        }
        assert_eq!(network.links().len(), block.links().len());
        for (own, of_block) in network.links().iter().zip(block.links()) {
            assert_eq!((own.a, own.b), (of_block.a, of_block.b));
            assert!((stiffness(own) / stiffness(of_block) - 1.0).abs() < 1e-12);
            let (own, of_block) = (own.spring, of_block.spring);
            assert!((own.rest_length_m() / of_block.rest_length_m() - 1.0).abs() < 1e-12);
            assert!((own.damping_ns_per_m() / of_block.damping_ns_per_m() - 1.0).abs() < 1e-12);
        }
        assert_eq!(made.cells.slivers_carried + made.cells.raised, 0);
        assert!(made.cells.cells == 120 && (made.cells.least_fill - 1.0).abs() < 1e-12);
    }
}

#[test]
fn shapes_have_their_mass_and_isotropic_strain_energy() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7);
    let (lambda, mu) = (0.4 * TISSUE.youngs_modulus_pa, 0.4 * TISSUE.youngs_modulus_pa);
    for (shape, cells) in [
        (sphere(0.05, 20), 9),
        (torus(0.05, 0.02, 48, 24).turned(turn), 14),
        (cuboid(DVec3::new(0.1, 0.03, 0.05), [3; 3]).turned(turn), 11),
        (cube(0.1).and(&sphere(0.03, 9).inside_out()), 8),
    ] {
        let mesh = shape.close().unwrap();
        let made = free(&shape, cells);
        assert_eq!(made.cells.raised, 0);
        let expected = 1000.0 * mesh.volume_m3();
        assert!((mass(&made.network) / expected - 1.0).abs() < 1e-12);
        let strain = DMat3::from_cols(
            DVec3::new(0.01, 0.004, 0.0),
            DVec3::new(0.004, -0.003, 0.002),
            DVec3::new(0.0, 0.002, 0.005),
        );
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        let square: f64 = strain.to_cols_array().iter().map(|v| v * v).sum();
        let expected = (0.5 * lambda * trace * trace + mu * square) * mesh.volume_m3();
        let got = energy(&made.network, strain);
        assert!((got / expected - 1.0).abs() < 1e-11, "{got} J, not {expected} J");
    }
}

#[test]
fn sphere_has_its_centre_of_mass() {
    let center = DVec3::new(0.2, 1.0, -3.0);
    // The centre of the bounds is the centre, so the lattice is symmetric about it; rotated it is not.
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.2, 0.9);
    let shape = sphere(0.05, 24).turned(turn).map(|x| x + DVec3::X * x.x.max(0.0)).moved(center);
    let mesh = shape.close().unwrap();
    let made = free(&shape, 12);
    // Half a sphere and half an ellipsoid twice as long: 3/8 (2a · 2 − a) V/V.
    let expected = center + DVec3::X * (0.05 * 3.0 / 8.0 * (4.0 - 1.0) / 3.0);
    assert!((mass(&made.network) / (1000.0 * mesh.volume_m3()) - 1.0).abs() < 1e-12);
    // Facets, and volume off the middle of its cell: well below a cell of 12 mm.
    assert!(
        center_of_mass(&made.network).distance(expected) < 2e-4,
        "{}",
        center_of_mass(&made.network) - expected
    );
}

#[test]
fn thin_plates_tips_and_slivers_keep_mass_and_connection() {
    // A plate thinner than a cell, across the cells.
    let turn = DQuat::from_rotation_y(0.3);
    let plate = cuboid(DVec3::new(0.1, 0.1, 0.002), [20, 20, 1]).turned(turn);
    let made = free(&plate, 10);
    assert!((mass(&made.network) / 0.02 - 1.0).abs() < 1e-9, "{}", mass(&made.network));
    // A needle: almost empty cells without neighbours.
    let needle =
        cuboid(DVec3::new(0.1, 4e-4, 4e-4), [30, 1, 1]).turned(DQuat::from_rotation_z(0.6)).turned(turn);
    let made = free(&needle, 20);
    assert!(made.cells.raised > 20 && made.cells.least_fill == 0.01, "{:?}", made.cells);
    for body in [free(&plate, 10), made] {
        // The kept cells are connected: one piece, found by walking along springs.
        let network = &body.network;
        let mut reached = vec![false; network.node_count()];
        let mut front = vec![0];
        while let Some(node) = front.pop() {
            if !std::mem::replace(&mut reached[node], true) {
                front.extend(network.neighbours(node));
            }
        }
        assert!(reached.into_iter().all(|reached| reached));
    }
}

#[test]
fn rejects_separate_pieces_unless_allowed() {
    let two = sphere(0.03, 8).and(&cube(0.02).moved(DVec3::X * 0.1)).moved(DVec3::Y);
    let mesh = two.close().unwrap();
    let fit =
        |cells| CellLattice::fit(&mesh, CellSize::Along(cells)).unwrap().fix(Region::from_fn(|x| x.y < 0.99));
    let Err(BodyError::Mesh(MeshError::Pieces { pieces: 2, at_m })) = fit(16).tissue(&TISSUE) else {
        panic!()
    };
    assert!(at_m.distance(DVec3::new(0.1, 1.0, 0.0)) < 0.02, "{at_m}");
    let both = fit(16).allow_unconstrained().tissue(&TISSUE).unwrap();
    assert!((mass(&both.network) / (1000.0 * mesh.volume_m3()) - 1.0).abs() < 1e-12);
    // In cells as wide as the gap they are still two.
    assert!(matches!(fit(2).tissue(&TISSUE), Err(BodyError::Mesh(MeshError::Pieces { pieces: 2, .. }))));
}

#[test]
fn region_tissue_is_averaged_by_its_share_of_a_cell() {
    let mesh = cuboid(DVec3::splat(0.1), [1; 3]).close().unwrap();
    let stiff = Tissue {
        youngs_modulus_pa: 80e3,
        density_kg_per_m3: 2000.0,
        damping: Damping::Ratio(0.2),
        ..Tissue::SOFT
    };
    // The upper 37.5 mm of 100 mm, in cells of 25 mm: one whole layer and half of another.
    let upper = Region::HalfSpace { point_m: 0.0125 * DVec3::Z, outward: -DVec3::Z };
    let fit = || CellLattice::fit(&mesh, CellSize::Side(0.025)).unwrap().allow_unconstrained();
    let made = fit().region(upper.clone(), stiff).tissue(&TISSUE).unwrap();
    assert!((mass(&made.network) - (1.0 + 0.375)).abs() < 1e-12);
    let strain = DMat3::from_diagonal(DVec3::new(0.0, 0.0, 0.01));
    let of = |e: f64| 0.5 * 1.2 * e * 1e-4 * 1e-3;
    let expected = of(20e3) * 0.625 + of(80e3) * 0.375;
    assert!((energy(&made.network, strain) / expected - 1.0).abs() < 1e-12);
    // The last region applies.
    let other =
        fit().region(upper.clone(), stiff).region(Region::from_fn(|_| true), TISSUE).tissue(&TISSUE).unwrap();
    let plain = fit().tissue(&TISSUE).unwrap();
    for (a, b) in other.network.links().iter().zip(plain.network.links()) {
        assert!((stiffness(a) / stiffness(b) - 1.0).abs() < 1e-12);
    }
    // The dampers of the stiff layer have its damping ratio.
    let top: Vec<usize> = (0..125).filter(|&n| made.network.rest_m()[n].z > 0.049).collect();
    let link = made.network.links().iter().find(|l| top.contains(&l.a) && top.contains(&l.b)).unwrap();
    let (m_a, m_b) = (made.network.mass_kg()[link.a], made.network.mass_kg()[link.b]);
    let expected = 0.2 * (stiffness(link) * 2.0 * m_a * m_b / (m_a + m_b)).sqrt();
    assert!((link.spring.damping_ns_per_m() / expected - 1.0).abs() < 1e-12);
    for (nothing, error) in [
        (Region::Sphere { center_m: DVec3::ONE, radius_m: 0.5 }, 1),
        (Region::Sphere { center_m: DVec3::splat(f64::NAN), radius_m: 0.5 }, 1),
        (Region::Cuboid { center_m: DVec3::ZERO, half_m: -DVec3::ONE }, 1),
    ] {
        let rejected = fit().region(upper.clone(), stiff).region(nothing, stiff).tissue(&TISSUE).unwrap_err();
        assert!(
            matches!(rejected, BodyError::Mesh(MeshError::EmptyRegion { what: "region of tissue", index, .. }) if index == error)
        );
    }
    let bad = Tissue { youngs_modulus_pa: -1.0, ..TISSUE };
    assert!(fit().region(upper, bad).tissue(&TISSUE).is_err() && fit().tissue(&bad).is_err());
}

#[test]
fn nodes_are_fixed_by_region_and_by_vertex() {
    let shape = cuboid(DVec3::splat(0.1), [1; 3]);
    let mesh = shape.close().unwrap();
    let fit = || CellLattice::fit(&mesh, CellSize::Along(5)).unwrap();
    let fixed = |body: &MeshBody| (0..216).filter(|&n| body.network.is_fixed(n)).collect::<Vec<_>>();
    let low = |x: DVec3| x.z < -0.049;
    let by_region = fit().fix(Region::from_fn(low)).tissue(&TISSUE).unwrap();
    assert_eq!(fixed(&by_region), (0..36).collect::<Vec<_>>());
    // Layers of 36 nodes, 20 mm apart. A share that ends at a layer contains it.
    for (share, layers) in [(-1.0, 1), (0.0, 1), (0.39, 2), (0.4, 3), (0.41, 3)] {
        let by_base = fit().fix_base(Face::NegZ, share).tissue(&TISSUE).unwrap();
        assert_eq!(fixed(&by_base), (0..36 * layers).collect::<Vec<_>>(), "{share}");
    }
    let by_side = fit().fix_outermost(Face::PosZ).tissue(&TISSUE).unwrap();
    assert_eq!(fixed(&by_side), (180..216).collect::<Vec<_>>());
    // Four corners of one face: its triangles carry all nodes of it, although the mesh has no vertices there.
    let mask: Vec<bool> = shape.vertices.iter().map(|x| low(*x)).collect();
    let by_vertex = fit().fix_vertices(&mask).unwrap().tissue(&TISSUE).unwrap();
    assert_eq!(fixed(&by_vertex), (0..36).collect::<Vec<_>>());
    // One vertex: its node.
    let one: Vec<bool> = (0..8).map(|v| v == 0).collect();
    let held = fixed(&fit().fix_vertices(&one).unwrap().tissue(&TISSUE).unwrap());
    assert!(held.len() == 1 && by_region.network.rest_m()[held[0]].distance(shape.vertices[0]) < 1e-12);
    let rejected = |lattice: CellLattice<'_>| lattice.tissue(&TISSUE).unwrap_err();
    assert_eq!(rejected(fit()), BodyError::Unconstrained { node: 0, nodes: 216 });
    assert_eq!(rejected(fit().fix(Region::from_fn(|_| true))), BodyError::AllFixed(216));
    let nothing = rejected(fit().fix(Region::from_fn(low)).fix(Region::from_fn(|_| false)));
    assert!(matches!(
        nothing,
        BodyError::Mesh(MeshError::EmptyRegion { what: "fixed region", index: 1, .. })
    ));
    let none = rejected(fit().fix_vertices(&[false; 8]).unwrap());
    assert!(matches!(none, BodyError::Mesh(MeshError::EmptyRegion { what: "list of fixed vertices", .. })));
    assert!(matches!(fit().fix_vertices(&[true; 9]), Err(MeshError::Length { found: 9, vertices: 8, .. })));
}

#[test]
fn rejects_invalid_cells() {
    let mesh = cube(0.1).close().unwrap();
    for size in [
        CellSize::Along(0),
        CellSize::Along(128),
        CellSize::Side(0.0),
        CellSize::Side(-0.01),
        CellSize::Side(f64::NAN),
        CellSize::Side(f64::INFINITY),
        CellSize::Side(1e-9),
    ] {
        assert!(matches!(CellLattice::fit(&mesh, size), Err(MeshError::Cells { .. })), "{size:?}");
    }
    // One large cell around a small mesh is a valid body.
    let large =
        CellLattice::fit(&mesh, CellSize::Side(0.5)).unwrap().allow_unconstrained().tissue(&TISSUE).unwrap();
    assert_eq!(large.network.node_count(), 8);
    assert!(CellLattice::fit(&mesh, CellSize::Along(2)).unwrap().touch_spacing(1.5).is_err());
}

#[test]
fn touchable_surface_deviates_by_less_than_a_cell() {
    let shape = sphere(0.05, 48);
    let mesh = shape.close().unwrap();
    let made =
        CellLattice::fit(&mesh, CellSize::Along(12)).unwrap().allow_unconstrained().tissue(&TISSUE).unwrap();
    let cell = made.cells.cell_m;
    let x = made.network.rest_m();
    let points: Vec<DVec3> = made.surface.points.iter().map(|point| point.of(x)).collect();
    assert!(
        points.len() < shape.vertices.len() / 3 && made.deviation_m < 0.05 * cell,
        "{}",
        made.deviation_m
    );
    for point in &points {
        assert!((point.length() - 0.05).abs() < 1e-12, "a point of the mesh stays one");
    }
    for point in &made.surface.points {
        assert!((point.nodes().iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(point.nodes().iter().all(|(_, w)| (-0.6..=1.6).contains(w)));
    }
    let corner = |v: usize| points[made.surface.vertices[v]];
    let volume: f64 =
        made.surface.triangles.iter().map(|t| t.map(corner)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    assert!((volume / mesh.volume_m3() - 1.0).abs() < 0.02, "{volume}");
    // With zero spacing every vertex is kept.
    let all = CellLattice::fit(&mesh, CellSize::Along(12))
        .unwrap()
        .allow_unconstrained()
        .touch_spacing(0.0)
        .unwrap();
    let all = all.tissue(&TISSUE).unwrap();
    assert_eq!((all.surface.points.len(), all.deviation_m), (shape.vertices.len(), 0.0));
    // A cube of twelve triangles gets additional points.
    let coarse = free(&cube(0.1), 5);
    assert!(coarse.surface.points.len() > 6 * 16 && coarse.deviation_m == 0.0);
}

/// Also for thin walls, cavities and pieces pinched by clustering, the touchable surface faces outward.
#[test]
fn touchable_surface_of_a_mesh_already_faces_outward() {
    let shapes = [
        ("a sphere", sphere(0.05, 12), 8),
        ("a torus", torus(0.04, 0.012, 24, 12), 10),
        ("a plate of half a cell", cuboid(DVec3::new(0.1, 0.1, 0.005), [20, 20, 1]), 10),
        ("a hollow sphere", sphere(0.05, 16).and(&sphere(0.03, 12).inside_out()), 8),
        ("a thin shell", sphere(0.05, 16).and(&sphere(0.047, 16).inside_out()), 8),
        ("a ball in a shell", sphere(0.05, 16).and(&sphere(0.04, 16).inside_out()).and(&sphere(0.02, 8)), 10),
        ("two cubes", cube(0.04).and(&cube(0.04).moved(DVec3::new(0.05, 0.01, 0.0))), 9),
        ("a needle", cuboid(DVec3::new(0.1, 4e-4, 4e-4), [30, 1, 1]), 10),
    ];
    for (what, shape, cells) in shapes {
        for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, -0.5)] {
            let made = free(&shape.clone().turned(turn), cells);
            let body = Body::new(made.network.clone(), made.surface.clone()).unwrap();
            assert_eq!(body.surface(), &made.surface, "{what}");
            let mut inward = made.surface.clone();
            inward.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            let body = Body::new(made.network, inward).unwrap();
            assert_eq!(body.surface(), &made.surface, "{what}, inside out");
        }
    }
}

#[test]
fn placed_body_is_the_same_body_moved() {
    let made = free(&sphere(0.05, 6), 5);
    let turn = DQuat::from_rotation_x(1.0);
    let placed = made.clone().placed(turn, DVec3::X).unwrap();
    for (a, b) in made.network.rest_m().iter().zip(placed.network.rest_m()) {
        assert!((turn * *a + DVec3::X).distance(*b) < 1e-15);
    }
    assert_eq!(made.surface, placed.surface);
    assert!(made.placed(turn, DVec3::NAN).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rotated_box_keeps_its_mass_in_cells_of_any_size(
        angles in prop::array::uniform3(-3.0..3.0f64),
        half in prop::array::uniform3(0.01..0.06f64),
        cells in 1..14usize,
    ) {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, angles[0], angles[1], angles[2]);
        let shape = cuboid(2.0 * DVec3::from_array(half), [2; 3]).turned(turn);
        let made = free(&shape, cells);
        let expected = 8000.0 * half.iter().product::<f64>();
        prop_assume!(made.cells.raised == 0);
        prop_assert!((mass(&made.network) / expected - 1.0).abs() < 1e-11);
        // The lattice is symmetric; of two equal slivers one may go to the left and one to the right.
        prop_assert!(center_of_mass(&made.network).length() < 0.1 * made.cells.cell_m);
    }
}
