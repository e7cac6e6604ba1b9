use super::*;

fn block(nodes: [usize; 3]) -> Block {
    Block::new(nodes, DVec3::new(0.1, 0.1, 0.1)).unwrap().allow_unconstrained()
}

const LATTICE: UniformLattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };

#[test]
fn six_nodes_a_side_make_1940_springs() {
    let body = block([6, 6, 6]).fix(Face::NegZ).uniform(&LATTICE).unwrap();
    assert_eq!(body.network.node_count(), 216);
    assert_eq!(body.network.links().len(), 1940);
    assert_eq!(body.network.free().len(), 180);
    assert!((body.network.mass_kg().iter().sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn an_inner_node_has_26_neighbours_a_corner_7() {
    let b = block([4, 4, 4]);
    let network = b.uniform(&LATTICE).unwrap().network;
    assert_eq!(network.neighbours(b.node([1, 2, 1])).count(), 26);
    assert_eq!(network.neighbours(b.node([0, 0, 0])).count(), 7);
}

#[test]
fn surface_is_closed_and_faces_outward() {
    let b = Block::new([3, 4, 5], DVec3::new(0.1, 0.2, 0.3)).unwrap().allow_unconstrained();
    let body = b.uniform(&LATTICE).unwrap();
    let x = body.network.rest_m();
    // Divergence theorem: the volume is a third of the flux of x through the surface.
    let volume: f64 = body
        .surface
        .triangles
        .iter()
        .map(|t| t.map(|v| body.surface.points[body.surface.vertices[v]].of(x)))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum();
    assert!((volume - 0.1 * 0.2 * 0.3).abs() < 1e-15, "{volume}");
    let mut nodes: Vec<usize> = body.surface.points.iter().map(|point| point.nodes()[0].0).collect();
    assert_eq!(nodes.len(), 3 * 4 * 5 - 2 * 3);
    nodes.sort_unstable();
    nodes.dedup();
    assert_eq!(nodes.len(), 3 * 4 * 5 - 2 * 3);
}

#[test]
fn block_is_centred_on_its_centre() {
    let c = DVec3::new(1.0, -2.0, 3.0);
    let body = block([3, 3, 3]).centered_at(c).unwrap().uniform(&LATTICE).unwrap();
    let mean: DVec3 = body.network.rest_m().iter().sum::<DVec3>() / 27.0;
    assert!((mean - c).length() < 1e-14);
    assert_eq!(body.network.rest_m()[0], c - DVec3::splat(0.05));
}

#[test]
fn rejects_invalid_blocks_with_the_value() {
    let size = DVec3::splat(0.1);
    assert_eq!(Block::new([1, 6, 6], size).unwrap_err(), BodyError::LatticeNodes { nodes: [1, 6, 6] });
    assert_eq!(Block::new([6, 6, 129], size).unwrap_err(), BodyError::LatticeNodes { nodes: [6, 6, 129] });
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let refused = Block::new([6, 6, 6], DVec3::new(0.1, bad, 0.1)).unwrap_err();
        assert!(matches!(refused, BodyError::Parameter { what: "size along y, m", .. }));
        for lattice in
            [UniformLattice { stiffness_n_per_m: bad, ..LATTICE }, UniformLattice { mass_kg: bad, ..LATTICE }]
        {
            assert!(matches!(block([3, 3, 3]).uniform(&lattice), Err(BodyError::Parameter { .. })));
        }
    }
    assert!(block([3, 3, 3]).uniform(&UniformLattice { damping_ratio: -0.1, ..LATTICE }).is_err());
    assert!(block([3, 3, 3]).centered_at(DVec3::NAN).is_err());
    let all_fixed = block([2, 2, 2]).fix(Face::NegX).fix(Face::PosX).uniform(&LATTICE);
    assert_eq!(all_fixed, Err(BodyError::AllFixed(8)));
}

#[test]
fn placed_block_is_the_same_block_moved() {
    let body = block([3, 3, 3]).fix(Face::NegZ).uniform(&LATTICE).unwrap();
    let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let placed = body.clone().placed(turn, DVec3::X).unwrap();
    for (a, b) in body.network.rest_m().iter().zip(placed.network.rest_m()) {
        assert!((*b - DVec3::new(a.x + 1.0, -a.z, a.y)).length() < 1e-15);
    }
    assert_eq!(body.surface, placed.surface);
    assert_eq!(body.network.links(), placed.network.links());
    for (rotation, translation) in [
        (DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), DVec3::ZERO),
        (DQuat::NAN, DVec3::ZERO),
        (DQuat::IDENTITY, DVec3::NAN),
    ] {
        assert!(matches!(body.clone().placed(rotation, translation), Err(BodyError::Parameter { .. })));
    }
}

#[test]
fn fixes_regions_in_addition_to_faces() {
    let block = block([5, 5, 5]).fix(Face::NegZ);
    let corner = block.rest([4, 4, 4]);
    let made =
        block.fix_within(Region::Sphere { center_m: corner, radius_m: 1e-6 }).uniform(&LATTICE).unwrap();
    let fixed = (0..125).filter(|&node| made.network.is_fixed(node)).count();
    assert_eq!(fixed, 25 + 1);
    assert!(made.network.is_fixed(124));
}

fn slit(opening_m: f64) -> Slit {
    Slit { length_m: 0.06, depth_m: 0.04, opening_m }
}

#[test]
fn slit_separates_its_lips_and_nothing_else() {
    let whole = block([5, 6, 11]).uniform(&LATTICE).unwrap();
    let cut = block([5, 6, 11]).slit(slit(0.0)).uniform(&LATTICE).unwrap();
    // 2 rows below the top and 5 nodes between the ends are doubled.
    let doubled = 2 * 5;
    assert_eq!(cut.network.node_count(), whole.network.node_count() + doubled);
    let mass = |body: &BlockBody| body.network.mass_kg().iter().sum::<f64>();
    assert!((mass(&cut) - mass(&whole)).abs() < 1e-12);
    // No spring leads from the left lip to what is on its right, nor the other way round.
    let (lips, copies) = (whole.network.node_count() - doubled.., whole.network.node_count()..);
    assert!(lips.start < copies.start);
    for link in cut.network.links() {
        let x = |node: usize| cut.network.rest_m()[node].x;
        let is_open = |node: usize| {
            let at = cut.network.rest_m()[node];
            at.x == 0.0 && at.y > 0.011 && at.z.abs() < 0.029
        };
        for (lip, other) in [(link.a, link.b), (link.b, link.a)] {
            if is_open(lip) {
                let side = if copies.contains(&lip) { 1.0 } else { -1.0 };
                assert!(side * x(other) >= 0.0, "{link:?}");
                assert!(!is_open(other) || copies.contains(&lip) == copies.contains(&other), "{link:?}");
            }
        }
    }
}

#[test]
fn closed_slit_changes_no_strain_energy() {
    let energy = |body: &BlockBody| -> f64 {
        let x: Vec<DVec3> = body
            .network
            .rest_m()
            .iter()
            .map(|x| DVec3::new(1.01 * x.x, 0.98 * x.y + 0.02 * x.z, 1.03 * x.z))
            .collect();
        let links = body.network.links().iter();
        links.map(|l| l.spring.energy_j(x[l.b] - x[l.a])).sum()
    };
    let whole = energy(&block([5, 6, 11]).uniform(&LATTICE).unwrap());
    let cut = energy(&block([5, 6, 11]).slit(slit(0.0)).uniform(&LATTICE).unwrap());
    assert!((cut / whole - 1.0).abs() < 1e-12, "{cut} J, {whole} J");
}

#[test]
fn surface_of_an_open_slit_is_closed_and_excludes_the_gap() {
    let gape = 0.02;
    let body = block([5, 6, 11]).slit(slit(gape)).uniform(&LATTICE).unwrap();
    let x = body.network.rest_m();
    let node = |vertex: usize| body.surface.points[body.surface.vertices[vertex]].nodes()[0].0;
    let corners = body.surface.triangles.iter().map(|t| t.map(node));
    let volume: f64 = corners.clone().map(|t| t.map(|n| x[n])).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    // The gap is a sum of prisms: trapezoids of the parabola along z, times the wedge's half depth.
    let bend = |k: f64| gape * (1.0 - (k / 3.0).powi(2));
    let area: f64 = (-3..3).map(|k| 0.01 * (bend(f64::from(k)) + bend(f64::from(k) + 1.0)) / 2.0).sum();
    // The last square of the lower row is cut along its other diagonal, where the gap is half as wide as above.
    let gap = area * 0.04 / 2.0 + 0.01 * 0.02 * 0.5 * bend(2.0) / 6.0;
    assert!((0.001 - gap - volume).abs() < 1e-12, "{volume} m3, gap {gap} m3");
    // Every edge is passed once in each direction.
    let mut edges: Vec<(usize, usize)> = corners.flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    edges.sort_unstable();
    for &(a, b) in &edges {
        assert!(edges.binary_search(&(b, a)).is_ok(), "{a}, {b}");
    }
    edges.dedup();
    assert_eq!(edges.len(), 3 * body.surface.triangles.len());
}

#[test]
fn rejects_invalid_slits() {
    let good = slit(0.01);
    assert!(block([5, 6, 11]).slit(good).uniform(&LATTICE).is_ok());
    assert!(block([4, 6, 11]).slit(good).uniform(&LATTICE).is_err(), "no plane of nodes in the middle");
    for bad in [
        Slit { length_m: 0.01, ..good },
        Slit { length_m: 0.1, ..good },
        Slit { length_m: f64::NAN, ..good },
        Slit { depth_m: 0.1, ..good },
        Slit { depth_m: 0.001, ..good },
        Slit { opening_m: 0.03, ..good },
        Slit { opening_m: -0.001, ..good },
    ] {
        assert!(
            matches!(block([5, 6, 11]).slit(bad).uniform(&LATTICE), Err(BodyError::Parameter { .. })),
            "{bad:?}"
        );
    }
}
