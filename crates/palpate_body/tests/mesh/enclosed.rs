//! Meshes that are not closed: their inside, its surface, and what was assumed.

use super::shapes::{Shape, cube, cuboid, sphere, torus};
use glam::{DQuat, DVec3};
use palpate_body::{CellLattice, CellSize, ClosedMesh, MeshError, Tissue};
use proptest::prelude::*;
use std::f64::consts::PI;

pub fn enclose(shape: &Shape) -> ClosedMesh {
    ClosedMesh::enclose(shape.vertices.clone(), shape.triangles.clone(), None).unwrap()
}

/// Without the triangles whose corners all satisfy `is_open`.
pub fn opened(mut shape: Shape, is_open: impl Fn(DVec3) -> bool) -> Shape {
    let vertices = shape.vertices.clone();
    shape.triangles.retain(|t| !t.iter().all(|&v| is_open(vertices[v])));
    shape
}

fn is_within(found: f64, expected: f64, share: f64) -> bool {
    (found / expected - 1.0).abs() < share
}

#[test]
fn closed_mesh_is_not_sampled() {
    let shape = torus(0.05, 0.02, 48, 24);
    let mesh = enclose(&shape);
    assert_eq!(mesh.volume_m3(), shape.close().unwrap().volume_m3());
    assert_eq!(mesh.assumptions(), None);
}

#[test]
fn open_box_is_filled_to_its_rim() {
    // The winding number of a box without its top is 1/2 on the missing square.
    for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7)] {
        for hole in [0.026, 0.051] {
            let is_open = |x: DVec3| x.z > 0.0499 && x.x.abs() < hole && x.y.abs() < hole;
            let shape = opened(cuboid(DVec3::splat(0.1), [8; 3]), is_open).turned(turn);
            for (shape, reoriented) in [(shape.clone(), 0), (shape.inside_out(), 1)] {
                let mesh = enclose(&shape);
                assert!(is_within(mesh.volume_m3(), 1e-3, 5e-3), "{} m³", mesh.volume_m3());
                let found = mesh.assumptions().unwrap();
                let along = if hole < 0.05 { 4 } else { 8 };
                assert_eq!((found.hole_count, found.open_edge_count), (1, 4 * along));
                assert_eq!((found.part_count, found.reoriented_part_count), (1, reoriented));
                assert_eq!((found.crossing_count, found.branching_edge_count), (0, 0));
                // The solid angle of the hole decides it: everything below an open box is uncertain.
                let uncertain = if hole < 0.05 { 0.03..0.3 } else { 0.25..0.7 };
                assert!(uncertain.contains(&found.uncertain_share), "{found:?}");
                assert!(mesh.contains(turn * DVec3::new(0.03, -0.04, 0.047)));
                assert!(!mesh.contains(turn * DVec3::new(0.0, 0.0, 0.053)));
            }
        }
    }
}

#[test]
fn crossing_parts_are_united() {
    let pair = cube(0.1).and(&cube(0.1).moved(DVec3::new(0.06, 0.03, 0.02)));
    let union = 2e-3 - 0.04 * 0.07 * 0.08;
    let mesh = enclose(&pair);
    assert!(is_within(mesh.volume_m3(), union, 5e-3), "{} m³", mesh.volume_m3());
    assert!(mesh.assumptions().unwrap().crossing_count > 0);
    // Two balls at a distance d: each loses a cap of height r − d/2.
    let (r, d) = (0.05_f64, 0.06);
    let cap = r - 0.5 * d;
    let union = 2.0 * (4.0 / 3.0 * PI * r.powi(3) - PI * cap * cap * (3.0 * r - cap) / 3.0);
    let mesh = enclose(&sphere(r, 32).and(&sphere(r, 32).inside_out().moved(DVec3::new(d, 0.0, 0.0))));
    assert!(is_within(mesh.volume_m3(), union, 6e-3), "{} m³, {union}", mesh.volume_m3());
    assert_eq!(mesh.assumptions().unwrap().reoriented_part_count, 1);
}

#[test]
fn part_within_another_is_a_cavity_only_if_it_faces_the_other_way() {
    let hollow = cube(0.1).and(&sphere(0.03, 24).inside_out());
    let cavity = 4.0 / 3.0 * PI * 0.03_f64.powi(3);
    let is_open = |x: DVec3| x.z > 0.0299 && x.length() < 0.0301;
    for (shape, volume) in [
        (hollow.clone(), 1e-3 - cavity),
        (hollow.inside_out(), 1e-3 - cavity),
        (cube(0.1).and(&sphere(0.03, 24)), 1e-3),
    ] {
        // A hole elsewhere, in a part of its own, keeps the mesh from being closed.
        let shape = shape.and(&opened(cuboid(DVec3::splat(0.02), [4; 3]).moved(DVec3::X * 0.08), |x| {
            x.z > 0.0099 && x.x.abs() < 0.0851
        }));
        let mesh = enclose(&opened(shape, is_open));
        assert!(is_within(mesh.volume_m3(), volume + 8e-6, 5e-3), "{} m³, {volume}", mesh.volume_m3());
    }
}

#[test]
fn separate_faces_enclose_what_is_between_them() {
    // Six rectangles with gaps along all edges: loops around whole faces.
    let gap = |shape: Shape| {
        let split = shape.split();
        let centre = |v: usize| {
            split.triangles[v / 6 * 2..v / 6 * 2 + 2]
                .iter()
                .flatten()
                .map(|&v| split.vertices[v])
                .sum::<DVec3>()
                / 6.0
        };
        let vertices =
            (0..split.vertices.len()).map(|v| centre(v) + 0.98 * (split.vertices[v] - centre(v))).collect();
        Shape { vertices, triangles: split.triangles.clone() }
    };
    let mesh = enclose(&gap(cuboid(DVec3::new(0.1, 0.05, 0.04), [1; 3])));
    assert!(is_within(mesh.volume_m3(), 2e-4, 0.02), "{} m³", mesh.volume_m3());
    assert_eq!(mesh.assumptions().unwrap().hole_count, 6);
}

#[test]
fn mixed_windings_are_made_consistent() {
    let mut shape = opened(sphere(0.05, 16), |x| x.z > 0.045);
    shape.triangles.iter_mut().step_by(3).for_each(|t| t.swap(1, 2));
    let consistent = enclose(&opened(sphere(0.05, 16), |x| x.z > 0.045));
    let mesh = enclose(&shape);
    assert!(is_within(mesh.volume_m3(), consistent.volume_m3(), 1e-12));
    let expected = shape.triangles.len().div_ceil(3);
    assert!(
        [expected, shape.triangles.len() - expected].contains(&mesh.repairs().turned),
        "{:?}",
        mesh.repairs()
    );
}

#[test]
fn surface_is_closed_and_near_the_mesh() {
    let shape = opened(sphere(0.05, 32), |x| x.z > 0.04);
    let mesh = enclose(&shape);
    // Every point of the body's surface is on the sphere, or on the flat cap at its rim.
    let lattice = CellLattice::fit(&mesh, CellSize::Along(10)).unwrap().allow_unconstrained();
    let made = lattice.tissue(&Tissue::default()).unwrap();
    let rim = shape.vertices.iter().map(|x| x.z).filter(|z| *z <= 0.04).fold(0.0, f64::max);
    for point in &made.surface.points {
        let x = point.of(made.network.rest_m());
        let on_sphere = (x.length() - 0.05).abs();
        assert!(on_sphere < 3e-4 || x.z > rim - 3e-3, "{x}: {on_sphere} m");
    }
    let mut edges = std::collections::HashMap::new();
    for triangle in 0..made.surface.triangles.len() {
        let [a, b, c] = made.surface.corners(triangle);
        for (a, b) in [(a, b), (b, c), (c, a)] {
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|sum| *sum == 0));
    let mass_kg: f64 = made.network.mass_kg().iter().sum();
    assert!(is_within(mass_kg, 1000.0 * mesh.volume_m3(), 1e-3), "{mass_kg} kg");
}

#[test]
fn sheet_has_no_inside() {
    let sheet = opened(cuboid(DVec3::new(0.1, 0.1, 0.02), [4; 3]), |x| x.z < 0.0099);
    let only_top = Shape {
        triangles: sheet
            .triangles
            .iter()
            .filter(|t| t.iter().all(|&v| sheet.vertices[v].z > 0.0099))
            .copied()
            .collect(),
        ..sheet
    };
    let error = ClosedMesh::enclose(only_top.vertices, only_top.triangles, None)
        .map(|mesh| mesh.volume_m3())
        .unwrap_err();
    assert!(matches!(error, MeshError::NoInside { .. }), "{error}");
    // Every triangle in both windings.
    let both = opened(cube(0.1), |x| x.z > 0.049);
    let both = both.clone().and(&both.inside_out());
    let mesh = ClosedMesh::enclose(both.vertices, both.triangles, None).map(|mesh| mesh.volume_m3());
    assert!(
        matches!(mesh, Err(MeshError::NoInside { .. }))
            || mesh.is_ok_and(|volume| is_within(volume, 1e-3, 0.02))
    );
}

/// Triangles of the upper side of a box.
fn top_of(shape: Shape, top_m: f64) -> Shape {
    let vertices = shape.vertices.clone();
    let is_top = |t: &&[usize; 3]| t.iter().all(|&v| vertices[v].z > top_m);
    Shape { triangles: shape.triangles.iter().filter(is_top).copied().collect(), ..shape }
}

#[test]
fn sheet_with_a_thickness_is_a_plate() {
    let sheet = top_of(cuboid(DVec3::new(0.1, 0.06, 0.02), [10, 6, 2]), 0.0099);
    for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.7)] {
        let Shape { vertices, triangles } = sheet.clone().turned(turn);
        let mesh = ClosedMesh::enclose(vertices, triangles, Some(0.002)).unwrap();
        assert!(is_within(mesh.volume_m3(), 0.1 * 0.06 * 0.002, 1e-9), "{} m³", mesh.volume_m3());
        assert!(
            mesh.contains(turn * DVec3::new(0.03, 0.01, 0.0109))
                && mesh.contains(turn * DVec3::new(0.03, 0.01, 0.0091))
        );
        assert!(!mesh.contains(turn * DVec3::new(0.03, 0.01, 0.0111)));
        assert_eq!(mesh.assumptions().unwrap().thickness_m, Some(0.002));
        let made = CellLattice::fit(&mesh, CellSize::Along(10))
            .unwrap()
            .allow_unconstrained()
            .tissue(&Tissue::default())
            .unwrap();
        let mass_kg: f64 = made.network.mass_kg().iter().sum();
        assert!(is_within(mass_kg, 0.012, 1e-6), "{mass_kg} kg");
    }
}

#[test]
fn bowl_with_a_thickness_is_a_shell() {
    // A hemisphere up to the rim of its triangles: the area of the polyhedron times the thickness, exact for small curvature.
    let bowl = opened(sphere(0.05, 32), |x| x.z > -1e-9);
    let area: f64 = bowl
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| bowl.vertices[v]);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let mesh = ClosedMesh::enclose(bowl.vertices.clone(), bowl.triangles.clone(), Some(0.002)).unwrap();
    assert!(is_within(mesh.volume_m3(), 0.002 * area, 5e-3), "{} m³, {}", mesh.volume_m3(), 0.002 * area);
    assert!(!mesh.contains(DVec3::new(0.0, 0.0, -0.02)));
    // Without a thickness it is filled.
    assert!(enclose(&bowl).contains(DVec3::new(0.0, 0.0, -0.02)));
}

#[test]
fn crossing_sheets_are_united() {
    let sheet = top_of(cuboid(DVec3::new(0.1, 0.1, 0.02), [5; 3]), 0.0099).moved(DVec3::Z * -0.01);
    let Shape { vertices, triangles } = sheet.clone().and(&sheet.turned(DQuat::from_rotation_x(1.2)));
    let mesh = ClosedMesh::enclose(vertices, triangles, Some(0.006)).unwrap();
    let common = 0.1 * 0.006 * 0.006 / 1.2_f64.sin();
    assert!(is_within(mesh.volume_m3(), 2.0 * 0.1 * 0.1 * 0.006 - common, 0.02), "{} m³", mesh.volume_m3());
}

#[test]
fn thickness_out_of_range_is_rejected() {
    let Shape { vertices, triangles } = top_of(cube(0.1), 0.049);
    for thickness_m in [0.0, -0.001, 1e-5, 0.11, f64::NAN, f64::INFINITY] {
        let made = ClosedMesh::enclose(vertices.clone(), triangles.clone(), Some(thickness_m));
        assert!(
            matches!(made.map(|mesh| mesh.volume_m3()), Err(MeshError::Thickness { .. })),
            "{thickness_m}"
        );
    }
}

#[test]
fn pieces_are_sorted_by_their_volumes() {
    let apart =
        cube(0.02).moved(DVec3::X * -0.1).and(&sphere(0.05, 8)).and(&cube(0.04).moved(DVec3::X * 0.1));
    let mesh = enclose(&apart);
    let pieces = mesh.pieces(CellSize::Along(22)).unwrap();
    let triangles: Vec<usize> = pieces.iter().map(|piece| piece.triangles.len()).collect();
    assert_eq!(triangles, [6 * 2 * 8 * 8, 12, 12]);
    let volumes = [sphere(0.05, 8).volume(), 0.04_f64.powi(3), 0.02_f64.powi(3)];
    for (piece, volume) in pieces.iter().zip(volumes) {
        assert!(is_within(piece.volume_m3, volume, 1e-9), "{piece:?}");
    }
    assert!((pieces[2].bounds_m[0] - DVec3::new(-0.11, -0.01, -0.01)).length() < 1e-15);
    // Larger cells do not connect them.
    assert_eq!(mesh.pieces(CellSize::Along(3)).unwrap().len(), 3);
}

#[test]
fn triangles_on_a_line_have_no_inside() {
    let on_line = [0.0, 0.03, 0.07, 0.1].map(|x| DVec3::new(x, 0.0, 0.0)).to_vec();
    let made = ClosedMesh::enclose(on_line, vec![[0, 1, 2], [1, 2, 3]], None).map(|mesh| mesh.volume_m3());
    let Err(MeshError::NoInside { spacing_m }) = made else { panic!("{made:?}") };
    assert!(spacing_m > 0.0);
}

#[test]
fn report_reads_as_a_sentence() {
    let mesh = enclose(&opened(cuboid(DVec3::splat(0.1), [8; 3]), |x| x.z > 0.0499));
    let text = mesh.assumptions().unwrap().to_string();
    assert!(
        text.starts_with(
            "the mesh has 1 hole; its inside is where its winding number exceeds 1/2, which is uncertain in "
        ),
        "{text}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_triangles_give_a_body_or_an_error(
        vertices in prop::collection::vec(prop::array::uniform3(-0.1..0.1f64), 3..12),
        triangles in prop::collection::vec(prop::array::uniform3(0..12usize), 1..40),
    ) {
        let made = ClosedMesh::enclose(vertices.into_iter().map(DVec3::from_array).collect(), triangles, None);
        if let Ok(mesh) = made {
            prop_assert!(mesh.volume_m3() > 0.0, "{}", mesh.volume_m3());
            let lattice = CellLattice::fit(&mesh, CellSize::Along(5)).unwrap().allow_unconstrained();
            let made = lattice.tissue(&Tissue::default()).unwrap();
            prop_assert!(made.network.mass_kg().iter().all(|m| *m > 0.0));
        }
    }

    #[test]
    fn inside_of_a_damaged_ball_is_the_ball(
        removed in prop::collection::vec(any::<prop::sample::Index>(), 1..30),
        turned in prop::collection::vec(any::<prop::sample::Index>(), 0..30),
        place in prop::array::uniform3(-0.06..0.06f64),
    ) {
        let mut shape = sphere(0.05, 12);
        for index in turned {
            index.get_mut(&mut shape.triangles).swap(1, 2);
        }
        for index in removed {
            let index = index.index(shape.triangles.len());
            shape.triangles.remove(index);
        }
        let mesh = enclose(&shape);
        let place = DVec3::from_array(place);
        // Holes of a few triangles move the surface by less than their size.
        if (place.length() - 0.05).abs() > 0.012 {
            prop_assert_eq!(mesh.contains(place), place.length() < 0.05);
        }
    }
}

/// Each place would need the solid angle of every triangle: none is far from any.
#[test]
fn too_many_large_separate_triangles_are_rejected() {
    let corner = |n: usize| DVec3::new(0.754_877_7, 0.569_840_3, 0.430_159_7) * n as f64;
    let vertices: Vec<DVec3> = (0..300_000).map(|n| 0.1 * corner(n + n / 3 * 7).fract_gl()).collect();
    let triangles = (0..100_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let found = ClosedMesh::enclose(vertices, triangles, None);
    assert!(matches!(found, Err(MeshError::Tangled { .. })), "{:?}", found.map(|mesh| mesh.volume_m3()));
}
