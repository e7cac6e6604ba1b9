//! The size of cells that is chosen for a mesh.

use super::shapes::{Shape, cube, cuboid, sphere};
use glam::DVec3;
use palpate_body::*;
use proptest::prelude::*;

fn nodes(mesh: &ClosedMesh, size: CellSize) -> usize {
    let lattice = CellLattice::fit(mesh, size).unwrap().allow_unconstrained();
    lattice.tissue(&Tissue::default()).unwrap().network.node_count()
}

/// Number of cells along the longest side, and of nodes, at most `max_nodes`.
fn chosen(mesh: &ClosedMesh, max_nodes: usize) -> (usize, usize) {
    let made = CellLattice::fit(mesh, CellSize::Automatic { max_nodes }).unwrap().allow_unconstrained();
    let made = made.tissue(&Tissue::default()).unwrap();
    (made.cells.along, made.network.node_count())
}

#[test]
fn thick_mesh_has_ten_cells_or_the_most_within_its_nodes() {
    let max_nodes = CellSize::DEFAULT_MAX_NODES;
    // A cube of n cells has (n + 1)³ nodes; a bar of 10 × 5 × 5 cells 11 · 6 · 6.
    assert_eq!(chosen(&cube(0.1).close().unwrap(), max_nodes), (6, 343));
    assert_eq!(chosen(&cuboid(DVec3::new(0.1, 0.05, 0.05), [4; 3]).close().unwrap(), max_nodes), (10, 396));
    assert_eq!(chosen(&cube(0.1).close().unwrap(), 1331), (10, 1331));
    assert_eq!(chosen(&cube(0.1).close().unwrap(), 1330), (9, 1000));
    // One cell is the least.
    assert_eq!(chosen(&cube(0.1).close().unwrap(), 0), (1, 8));
    // A ball that is stretched along x takes more cells than a round one.
    let mut last = 0;
    for stretch in [1.0, 1.3, 1.6, 2.0] {
        let mesh = sphere(0.05, 12).map(|x| DVec3::new(stretch * x.x, x.y, x.z)).close().unwrap();
        let fits = |&along: &usize| nodes(&mesh, CellSize::Along(along)) <= max_nodes;
        let along = (1..=10).rev().find(fits).unwrap();
        assert_eq!(chosen(&mesh, max_nodes), (along, nodes(&mesh, CellSize::Along(along))), "{stretch}");
        assert!(along > last || along == 10, "{stretch}: {along}");
        last = along;
    }
    assert_eq!(last, 10);
}

#[test]
fn thin_mesh_has_the_cells_that_resolve_it_or_the_most_within_its_nodes() {
    let max_nodes = CellSize::DEFAULT_MAX_NODES;
    let beam = |width: f64| cuboid(DVec3::new(0.2, width, width), [20, 2, 2]).close().unwrap();
    // Two cells across need 20 along; a tenth of the length is thinner than two of ten cells.
    let (along, count) = chosen(&beam(0.02), max_nodes);
    assert!((20..=24).contains(&along) && count <= max_nodes, "{along} cells, {count} nodes");
    assert!(beam(0.02).thin_parts(0.2 / along as f64).share <= ThinParts::MAX_SHARE);
    // A plate has as many cells as its nodes allow: n + 1 squared, twice.
    let plate = cuboid(DVec3::new(0.2, 0.002, 0.2), [4, 1, 4]).close().unwrap();
    assert_eq!(chosen(&plate, max_nodes), (13, 392));
    // A thread needs more cells than are tried.
    let (along, count) = chosen(&beam(0.002), max_nodes);
    assert_eq!((along, count), (ThinParts::MAX_TRIED_CELLS, 4 * 33));
}

#[test]
fn selected_piece_has_cells_of_its_own_size() {
    let small = cube(0.02).moved(DVec3::X * 0.3);
    let Shape { vertices, triangles } = cube(0.1).and(&small);
    let vertices = vertices.iter().map(|x| x.as_vec3().to_array()).collect();
    let part = MeshPart { vertices, triangles, normals: None };
    let select = |pieces, cells| {
        let closing = MeshClosing::Enclose { thickness_m: None };
        let options = JoinOptions { scale_m: 1.0, closing, pieces, cells };
        let joined = JoinedMesh::new(std::slice::from_ref(&part), options).unwrap();
        (joined.piece_count, joined.cells)
    };
    for piece in [PieceSelection::Largest, PieceSelection::Index(0), PieceSelection::Index(1)] {
        assert_eq!(select(piece, CellSize::default()), (2, CellSize::Along(6)), "{piece:?}");
    }
    // Both together are 0.36 m long.
    assert_eq!(select(PieceSelection::All, CellSize::default()), (2, CellSize::Along(10)));
    assert_eq!(select(PieceSelection::Largest, CellSize::Side(0.02)), (2, CellSize::Side(0.02)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn chosen_cells_keep_the_number_of_nodes(
        size in prop::array::uniform3(0.003..0.2_f64),
        max_nodes in 8_usize..600,
    ) {
        let mesh = cuboid(DVec3::from_array(size), [3; 3]).close().unwrap();
        let (along, count) = chosen(&mesh, max_nodes);
        prop_assert!(count <= max_nodes, "{along} cells, {count} nodes");
        prop_assert!(along <= ThinParts::MAX_TRIED_CELLS);
        if along < CellSize::START_ALONG {
            prop_assert!(nodes(&mesh, CellSize::Along(along + 1)) > max_nodes);
        }
    }
}
