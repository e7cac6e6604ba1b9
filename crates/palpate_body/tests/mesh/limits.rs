//! Limits of meshes: distance from the origin in single precision, number of nodes, excess mass.

use super::shapes::{Shape, cuboid, sphere};
use glam::DVec3;
use palpate_body::{CellLattice, CellSize, ClosedMesh, MeshError, Tissue};

/// The shape as saved in units of `unit_m` metres.
fn stored(shape: &Shape, unit_m: f64) -> Result<ClosedMesh, MeshError> {
    let single: Vec<[f32; 3]> = shape.vertices.iter().map(|x| (*x / unit_m).as_vec3().to_array()).collect();
    ClosedMesh::from_single(&single, unit_m, shape.triangles.clone())
}

#[test]
fn rejects_lost_single_precision_digits_in_every_unit() {
    for unit_m in [1.0, 1e-3, 0.0254] {
        let away = |x: f64| sphere(0.05, 12).moved(DVec3::X * x);
        // A hundredth of a cell of a centimetre is 0.1 mm, which single precision resolves up to 840 m.
        for x in [0.0, 10.0, 700.0] {
            let mesh = stored(&away(x), unit_m).unwrap();
            assert!(CellLattice::fit(&mesh, CellSize::Along(10)).is_ok(), "{x} m in units of {unit_m} m");
        }
        let mesh = stored(&away(1000.0), unit_m).unwrap();
        let error = CellLattice::fit(&mesh, CellSize::Along(10)).map(|_| ()).unwrap_err();
        let MeshError::CoarseGrid { distance_m, grid_m, cell_m } = error else { panic!("{error}") };
        assert!((distance_m - 1000.05).abs() < 0.01 && (cell_m - 0.01).abs() < 1e-4, "{error}");
        assert!((grid_m - 1000.05 * f64::from(f32::EPSILON)).abs() < 1e-8, "{grid_m}");
        // Larger cells are accepted.
        assert!(CellLattice::fit(&mesh, CellSize::Along(5)).is_ok());
        // Where most vertices are displaced, the mesh does not close or is too coarse: both errors are due to the
        // distance.
        for x in [1e5, 1e6, 1e7] {
            let fitted = |mesh| CellLattice::fit(&mesh, CellSize::Along(10)).map(|_| ());
            let error = stored(&away(x), unit_m).and_then(fitted).unwrap_err();
            let is_distance = matches!(error, MeshError::LostDigits { .. } | MeshError::CoarseGrid { .. });
            assert!(is_distance, "{x} m: {error}");
        }
    }
}

/// Too many cells along the longest side for all boxes below.
const FINE: usize = 80;

#[test]
fn rejects_too_many_nodes_and_advises_a_cell_count() {
    for size in [DVec3::splat(0.1), DVec3::new(0.1, 0.1, 0.04), DVec3::new(0.1, 0.03, 0.04)] {
        let mesh = cuboid(size, [1; 3]).close().unwrap();
        let made = |cells| {
            CellLattice::fit(&mesh, CellSize::Along(cells))
                .unwrap()
                .allow_unconstrained()
                .tissue(&Tissue::default())
        };
        let error = made(FINE).map(|made| made.cells).unwrap_err();
        let palpate_body::BodyError::Mesh(MeshError::TooManyNodes { along, nodes, most, advised }) = error
        else {
            panic!("{error}")
        };
        assert_eq!((along, most), (FINE, CellLattice::MAX_NODES));
        assert!(nodes > most, "{error}");
        let taken = made(advised).unwrap().network.node_count();
        assert!(taken <= most && taken > most / 2, "{advised} cells: {taken} nodes");
    }
}

#[test]
fn reports_the_excess_mass_of_raised_cells() {
    // A sheet in one layer of cells of a centimetre.
    for (thickness, filled) in [(2e-3, 0.2), (1e-4, 0.01), (5e-5, 0.005), (2e-5, 0.002)] {
        let mesh = cuboid(DVec3::new(0.1, 0.1, thickness), [1; 3]).close().unwrap();
        let made = CellLattice::fit(&mesh, CellSize::Along(10)).unwrap().allow_unconstrained();
        let made = made.tissue(&Tissue::default()).unwrap();
        let mass_kg: f64 = made.network.mass_kg().iter().sum();
        let expected = (0.01 / filled - 1.0_f64).max(0.0);
        assert!((made.cells.raised_share - expected).abs() < 1e-9, "{thickness} m: {:?}", made.cells);
        let weighed = mass_kg / (1000.0 * mesh.volume_m3()) - 1.0;
        assert!((weighed - expected).abs() < 1e-9, "{thickness} m: {weighed}");
    }
}

#[test]
fn rejects_cells_that_the_mesh_fills_less_than_rounding_leaves() {
    let mesh = cuboid(DVec3::splat(0.1), [1; 3]).close().unwrap();
    for cell_m in [2e3, 1e30] {
        let lattice =
            CellLattice::fit(&mesh, CellSize::Side(cell_m)).and_then(|_| mesh.pieces(CellSize::Side(cell_m)));
        assert!(matches!(lattice, Err(MeshError::Cells { .. })), "{lattice:?}");
    }
}
