use super::*;

fn block(nodes: [usize; 3]) -> Block {
    Block::new(nodes, DVec3::new(0.1, 0.1, 0.1)).unwrap().allow_free()
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
fn the_surface_is_closed_and_looks_outward() {
    let b = Block::new([3, 4, 5], DVec3::new(0.1, 0.2, 0.3)).unwrap().allow_free();
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
fn the_block_lies_round_its_centre() {
    let c = DVec3::new(1.0, -2.0, 3.0);
    let body = block([3, 3, 3]).centered_at(c).unwrap().uniform(&LATTICE).unwrap();
    let mean: DVec3 = body.network.rest_m().iter().sum::<DVec3>() / 27.0;
    assert!((mean - c).length() < 1e-14);
    assert_eq!(body.network.rest_m()[0], c - DVec3::splat(0.05));
}

#[test]
fn senseless_blocks_are_refused_with_the_value() {
    let size = DVec3::splat(0.1);
    assert_eq!(Block::new([1, 6, 6], size), Err(BodyError::LatticeNodes { nodes: [1, 6, 6] }));
    assert_eq!(Block::new([6, 6, 129], size), Err(BodyError::LatticeNodes { nodes: [6, 6, 129] }));
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
fn a_placed_block_is_the_same_block_elsewhere() {
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
fn what_is_within_regions_is_fixed_beside_faces() {
    let block = block([5, 5, 5]).fix(Face::NegZ);
    let corner = block.rest([4, 4, 4]);
    let made =
        block.fix_within(Region::Sphere { center_m: corner, radius_m: 1e-6 }).uniform(&LATTICE).unwrap();
    let fixed = (0..125).filter(|&node| made.network.is_fixed(node)).count();
    assert_eq!(fixed, 25 + 1);
    assert!(made.network.is_fixed(124));
}
