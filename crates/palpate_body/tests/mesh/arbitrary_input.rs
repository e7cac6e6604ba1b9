//! Arbitrary input gives a body or an error, without a panic or a hang.

use super::shapes::{Shape, sphere, torus};
use glam::DVec3;
use palpate_body::{CellLattice, CellSize, MeshError, Tissue};
use proptest::prelude::*;

/// Builds a body from a shape if possible.
fn make(shape: &Shape) -> Result<(), MeshError> {
    let mesh = shape.close()?;
    assert!(mesh.volume_m3() > 0.0, "{}", mesh.volume_m3());
    let lattice = CellLattice::fit(&mesh, CellSize::Along(5))?.allow_unconstrained();
    let made = lattice.tissue(&Tissue::default()).expect("free parts are allowed, and nothing is fixed");
    assert!(made.network.mass_kg().iter().all(|m| *m > 0.0));
    Ok(())
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        -0.1..0.1f64,
        // Coincident and degenerate positions.
        (-2..3i32).prop_map(|i| f64::from(i) * 0.02),
        prop::num::f64::ANY,
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rejects_random_triangles(
        vertices in prop::collection::vec(prop::array::uniform3(coordinate()), 1..12),
        triangles in prop::collection::vec(prop::array::uniform3(0..14usize), 0..40),
    ) {
        let shape = Shape { vertices: vertices.into_iter().map(DVec3::from_array).collect(), triangles };
        prop_assert!(make(&shape).is_err());
    }

    #[test]
    fn random_closed_surfaces_give_a_body_or_an_error(
        places in prop::collection::vec(prop::array::uniform3(-2..3i32), 4..7),
        tetrahedra in prop::collection::vec(prop::array::uniform4(0..4usize), 1..5),
    ) {
        let mut shape = Shape {
            vertices: places.iter().map(|p| DVec3::from_array(p.map(f64::from)) * 0.02).collect(),
            triangles: Vec::new(),
        };
        for [a, b, c, d] in tetrahedra {
            shape.triangles.extend([[a, b, c], [a, c, d], [a, d, b], [b, d, c]]);
        }
        // Any result is accepted.
        let _ = make(&shape);
    }

    #[test]
    fn damaged_surface_gives_a_body_or_an_error(
        round in any::<bool>(),
        moved in prop::collection::vec((any::<prop::sample::Index>(), prop::array::uniform3(-0.03..0.03f64)), 0..4),
        renamed in prop::collection::vec((any::<prop::sample::Index>(), 0..3usize, any::<prop::sample::Index>()), 0..3),
        turned in prop::collection::vec(any::<prop::sample::Index>(), 0..6),
        gone in prop::collection::vec(any::<prop::sample::Index>(), 0..2),
    ) {
        let mut shape = if round { sphere(0.05, 4) } else { torus(0.04, 0.015, 10, 6) };
        for (vertex, by) in moved {
            let vertex = vertex.index(shape.vertices.len());
            shape.vertices[vertex] += DVec3::from_array(by);
        }
        for (triangle, corner, vertex) in renamed {
            let (triangle, vertex) = (triangle.index(shape.triangles.len()), vertex.index(shape.vertices.len()));
            shape.triangles[triangle][corner] = vertex;
        }
        turned.iter().for_each(|t| { let t = t.index(shape.triangles.len()); shape.triangles[t].swap(0, 1); });
        let whole = gone.is_empty();
        for triangle in gone {
            let triangle = triangle.index(shape.triangles.len());
            shape.triangles.swap_remove(triangle);
        }
        let made = make(&shape);
        prop_assert!(whole || made.is_err());
    }
}

#[test]
fn rejects_many_overlapping_triangles_in_bounded_time() {
    // Long slivers through the origin: every box overlaps every other.
    let mut shape = Shape::default();
    for i in 0..60_000_u32 {
        let turn = f64::from(i) * 0.01;
        let along = DVec3::new(turn.cos(), turn.sin(), (0.37 * turn).sin()) * 0.05;
        let across = along.any_orthonormal_vector() * 1e-4;
        let first = shape.vertices.len();
        shape.vertices.extend([along, -along, across, along.cross(across).normalize() * 1e-4]);
        let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
        shape.triangles.extend([[a, b, c], [a, c, d], [a, d, b], [b, d, c]]);
    }
    assert!(matches!(make(&shape), Err(MeshError::Crossing { .. } | MeshError::Tangled { .. })));
}
