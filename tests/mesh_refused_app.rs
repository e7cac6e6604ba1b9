//! Unusual meshes in an app, in lock step: each becomes a body or a fault.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, MeshCellSize, MeshFault, MeshPieces, MeshShape, SimulatedBody};
use palpate_body::{BodyError, MeshError};
use palpate_tests::app::{assert_no_faults, step, take_kinds};
use palpate_tests::mesh::{
    RADIUS, add, ball, body, both, cuboid, mesh_app as app, mesh_of, shown, spawn, torn,
};

/// A box with edges of `edge`, centred at `at`.
fn box_at(at: Vec3, edge: f32) -> Mesh {
    cuboid(at - 0.5 * edge, at + 0.5 * edge)
}

fn inside_out(mesh: Mesh) -> Mesh {
    mesh.with_inverted_winding().unwrap()
}

fn with_corner(corner: [f32; 3]) -> Mesh {
    let mut corners: Vec<[f32; 3]> = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]];
    corners[3] = corner;
    mesh_of(&corners, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
}

/// Two adjacent boxes with a common wall, at whose edges three triangles meet.
fn with_inner_wall() -> Mesh {
    let corners: Vec<[f32; 3]> = (0..12_u32)
        .map(|i| [0.05 * (i / 4) as f32, 0.05 * (i & 1) as f32, 0.05 * (i >> 1 & 1) as f32])
        .collect();
    let quad = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d]];
    let mut triangles = Vec::new();
    for first in [0, 4] {
        let at = |i: u32| first + i;
        triangles.extend(quad(at(0), at(4), at(5), at(1)));
        triangles.extend(quad(at(2), at(3), at(7), at(6)));
        triangles.extend(quad(at(0), at(2), at(6), at(4)));
        triangles.extend(quad(at(1), at(5), at(7), at(3)));
    }
    for (wall, is_high) in [(0, false), (4, true), (8, true)] {
        let [a, b, c, d] = [wall, wall + 1, wall + 3, wall + 2];
        triangles.extend(if is_high { quad(a, b, c, d) } else { quad(a, d, c, b) });
    }
    mesh_of(&corners, &triangles)
}

/// The error of a mesh that was read but rejected.
fn mesh_error(kind: &HapticFaultKind) -> Option<&MeshError> {
    if let HapticFaultKind::BuildBody(BodyError::Mesh(error)) = kind { Some(error) } else { None }
}

/// Checks the kind of a fault.
type Expected = fn(&HapticFaultKind) -> bool;

/// Whether the mesh has another size than expected, and `factor` is the suggested scale.
fn is_size(kind: &HapticFaultKind, expected: f64) -> bool {
    matches!(mesh_error(kind), Some(MeshError::Size { factor, .. }) if (factor / expected - 1.0).abs() < 1e-9)
}

#[test]
fn meshes_that_cannot_become_a_body_are_faults() {
    let usage = RenderAssetUsages::default();
    let lines = Mesh::new(PrimitiveTopology::LineList, usage);
    let bare = Mesh::new(PrimitiveTopology::TriangleList, usage);
    let of_units = |scale: f32| ball().scaled_by(Vec3::splat(scale));
    let at_x = |x: f32| ball().translated_by(Vec3::X * x);
    let squashed = ball().scaled_by(Vec3::new(1.0, 0.0, 1.0));
    let pair = both(box_at(Vec3::ZERO, 0.06), &box_at(Vec3::new(0.03, 0.02, 0.01), 0.06));
    let nested = both(box_at(Vec3::ZERO, 0.12), &box_at(Vec3::ZERO, 0.04));
    let is_holes: Expected = |kind| matches!(mesh_error(kind), Some(MeshError::Holes { .. }));
    let is_not_finite: Expected = |kind| matches!(mesh_error(kind), Some(MeshError::NotFinite { .. }));
    let cases: [(&str, Mesh, Expected); 17] = [
        ("lines", lines, |kind| {
            matches!(kind, HapticFaultKind::Mesh(MeshFault::Topology(PrimitiveTopology::LineList)))
        }),
        ("no positions", bare, |kind| matches!(kind, HapticFaultKind::Mesh(MeshFault::NoPositions))),
        ("an open square", Rectangle::new(0.1, 0.1).mesh().build(), is_holes),
        ("a hole", torn(ball()), is_holes),
        ("no thickness", squashed, |kind| matches!(mesh_error(kind), Some(MeshError::Flat { .. }))),
        ("crossing parts", pair, |kind| matches!(mesh_error(kind), Some(MeshError::Crossing { .. }))),
        ("an inner wall", with_inner_wall(), |kind| {
            matches!(mesh_error(kind), Some(MeshError::NonManifold { .. }))
        }),
        ("millimetres", of_units(1e3), |kind| is_size(kind, 1e-3)),
        ("micrometres", of_units(1e6), |kind| is_size(kind, 1e-6)),
        ("huge", of_units(1e12), |kind| matches!(mesh_error(kind), Some(MeshError::Size { .. }))),
        ("tiny", of_units(1e-3), |kind| is_size(kind, 1e3)),
        ("nearly nothing", Sphere::new(1e-5).mesh().ico(2).unwrap(), |kind| {
            matches!(mesh_error(kind), Some(MeshError::Size { .. }))
        }),
        ("not a number", with_corner([f32::NAN, 0.0, 0.1]), is_not_finite),
        ("infinite", with_corner([0.0, f32::INFINITY, 0.1]), is_not_finite),
        ("a shell in a shell", nested, |kind| matches!(mesh_error(kind), Some(MeshError::Nested { .. }))),
        ("far away", at_x(1e5), |kind| matches!(mesh_error(kind), Some(MeshError::LostDigits { .. }))),
        ("too far for its cells", at_x(3000.0), |kind| {
            matches!(mesh_error(kind), Some(MeshError::CoarseGrid { .. }))
        }),
    ];
    for (what, mesh, is_expected) in cases {
        let mut app = app();
        let entity = spawn(&mut app, mesh);
        step(&mut app, 3);
        let kinds = take_kinds(&mut app);
        assert!(kinds.len() == 1 && is_expected(&kinds[0]), "{what}: {kinds:?}");
        assert!(app.world().get::<SimulatedBody>(entity).is_none(), "{what}");
    }
}

#[test]
fn unusual_meshes_with_a_volume_become_bodies_of_its_mass() {
    let hollow = both(box_at(Vec3::ZERO, 0.12), &inside_out(box_at(Vec3::ZERO, 0.04)));
    let at_an_edge = both(box_at(Vec3::splat(-0.03), 0.06), &box_at(Vec3::new(0.03, 0.03, -0.03), 0.06));
    let shared = {
        let mut mixed = box_at(Vec3::ZERO, 0.1);
        let mut indices: Vec<u32> = mixed.indices().unwrap().iter().map(|i| i as u32).collect();
        indices.swap(1, 2);
        mixed.insert_indices(bevy::mesh::Indices::U32(indices));
        mixed
    };
    for (what, mesh, volume_m3) in [
        ("inside out", inside_out(box_at(Vec3::ZERO, 0.1)), 1e-3),
        ("of mixed winding", shared, 1e-3),
        ("with a cavity", hollow, 0.12_f64.powi(3) - 0.04_f64.powi(3)),
        ("pinched at an edge", at_an_edge, 2.0 * 0.06_f64.powi(3)),
        ("ten metres away", box_at(Vec3::X * 10.0, 0.1), 1e-3),
        ("given twice", both(box_at(Vec3::ZERO, 0.1), &box_at(Vec3::ZERO, 0.1)), 1e-3),
    ] {
        let mut app = app();
        let mesh = add(&mut app, mesh);
        let entity = app.world_mut().spawn(DeformableBody::from_mesh(mesh)).id();
        step(&mut app, 5);
        assert_no_faults(&mut app);
        let mass_kg: f64 = body(&app, entity).unwrap().body().network().mass_kg().iter().sum();
        assert!((mass_kg / (1000.0 * volume_m3) - 1.0).abs() < 1e-4, "{what}: {mass_kg} kg");
    }
}

#[test]
fn largest_piece_or_the_selected_one_or_all_become_the_body() {
    let volumes_m3 = [0.06_f64.powi(3), 0.04_f64.powi(3)];
    let pieces = both(box_at(Vec3::Y * 0.08, 0.04), &box_at(Vec3::Y * -0.05, 0.06));
    for (selected, expected_m3) in [
        (MeshPieces::Largest, Ok(volumes_m3[0])),
        (MeshPieces::Index(0), Ok(volumes_m3[0])),
        (MeshPieces::Index(1), Ok(volumes_m3[1])),
        (MeshPieces::All, Ok(volumes_m3[0] + volumes_m3[1])),
        (MeshPieces::Index(2), Err(())),
    ] {
        let mut app = app();
        let mesh = add(&mut app, pieces.clone());
        let shape = MeshShape { pieces: selected, ..MeshShape::new(mesh) };
        let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
        step(&mut app, 3);
        let kinds = take_kinds(&mut app);
        let Ok(volume_m3) = expected_m3 else {
            assert!(
                matches!(mesh_error(&kinds[0]), Some(MeshError::Piece { index: 2, count: 2 })),
                "{kinds:?}"
            );
            continue;
        };
        assert!(kinds.is_empty(), "{kinds:?}");
        let simulated = body(&app, entity).unwrap();
        let mass_kg: f64 = simulated.body().network().mass_kg().iter().sum();
        assert!((mass_kg / (1000.0 * volume_m3) - 1.0).abs() < 1e-4, "{selected:?}: {mass_kg} kg");
        let report = simulated.mesh_report().unwrap();
        assert_eq!(report.piece_count, 2);
        assert!(
            (report.piece_share * volumes_m3.iter().sum::<f64>() / volume_m3 - 1.0).abs() < 1e-4,
            "{report:?}"
        );
        // Only the body is drawn.
        let drawn = app.world().get::<Mesh3d>(entity).unwrap().0.clone();
        let triangles =
            app.world().resource::<Assets<Mesh>>().get(&drawn).unwrap().indices().unwrap().len() / 3;
        assert_eq!(triangles, if selected == MeshPieces::All { 24 } else { 12 });
    }
    // A fixed region does not hold pieces that float.
    let mut app = app();
    let mesh = add(&mut app, pieces);
    let shape = MeshShape { pieces: MeshPieces::All, ..MeshShape::new(mesh) };
    app.world_mut().spawn((DeformableBody::Mesh(shape), FixedRegion::Face(BoxFace::Bottom)));
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    assert!(matches!(mesh_error(&kinds[0]), Some(MeshError::Pieces { pieces: 2, .. })), "{kinds:?}");
}

/// Meshes that are rejected where they must be closed.
#[test]
fn meshes_that_are_not_closed_become_bodies_of_their_inside() {
    let pair = both(box_at(Vec3::ZERO, 0.06), &box_at(Vec3::new(0.03, 0.02, 0.01), 0.06));
    let nested = both(box_at(Vec3::ZERO, 0.12), &box_at(Vec3::ZERO, 0.04));
    let square = Rectangle::new(0.1, 0.1).mesh().build();
    let ball_m3 = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    for (what, mesh, thickness_m, volume_m3, share) in [
        // The triangle of a fine ball that is missing is small.
        ("a hole", torn(ball()), None, ball_m3, 0.02),
        ("crossing parts", pair, None, 2.0 * 0.06_f64.powi(3) - 0.03 * 0.04 * 0.05, 5e-3),
        ("an inner wall", with_inner_wall(), None, 0.1 * 0.05 * 0.05, 5e-3),
        ("a shell in a shell", nested, None, 0.12_f64.powi(3), 5e-3),
        ("an open square", square.clone(), Some(0.01), 0.1 * 0.1 * 0.01, 1e-6),
    ] {
        let mut app = app();
        let mesh = add(&mut app, mesh);
        let shape = MeshShape { thickness_m, ..MeshShape::new(mesh) };
        let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
        step(&mut app, 5);
        assert_no_faults(&mut app);
        let simulated = body(&app, entity).unwrap();
        let mass_kg: f64 = simulated.body().network().mass_kg().iter().sum();
        assert!((mass_kg / (1000.0 * volume_m3) - 1.0).abs() < share, "{what}: {mass_kg} kg");
        let assumptions = simulated.mesh_report().unwrap().assumptions.unwrap();
        assert_eq!(assumptions.thickness_m, thickness_m, "{what}");
    }
    let squashed = ball().scaled_by(Vec3::new(1.0, 0.0, 1.0));
    for (what, mesh, thickness_m) in
        [("an open square", square, None), ("no thickness", squashed, Some(0.01))]
    {
        let mut app = app();
        let mesh = add(&mut app, mesh);
        let shape = MeshShape { thickness_m, ..MeshShape::new(mesh) };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 3);
        let kinds = take_kinds(&mut app);
        assert!(
            kinds.len() == 1 && matches!(mesh_error(&kinds[0]), Some(MeshError::NoInside { .. })),
            "{what}: {kinds:?}"
        );
    }
}

#[test]
fn unit_and_cells_along_have_their_effect_and_their_limits() {
    let mut app = app();
    let mesh = add(&mut app, ball().scaled_by(Vec3::splat(1000.0)));
    let shape = MeshShape { metres_per_unit: 0.001, ..MeshShape::new(mesh.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    step(&mut app, 2);
    assert_no_faults(&mut app);
    assert!(shown(&app, entity, false).iter().all(|x| (f64::from(x.length()) - RADIUS).abs() < 1e-5));
    // A ball of 120 units. Sizes that are legal and implausible are reported with the factor of a common unit.
    for (scale, size_m, factor) in [(0.001, None, 1.0), (0.02, Some(2.4), 1e-2), (2e-5, Some(0.0024), 1e2)] {
        let shape = MeshShape {
            metres_per_unit: scale,
            cells: MeshCellSize::Along(4),
            ..MeshShape::new(mesh.clone())
        };
        let entity =
            app.world_mut().spawn((DeformableBody::Mesh(shape), FixedRegion::Face(BoxFace::Bottom))).id();
        step(&mut app, 2);
        let size = body(&app, entity).unwrap().mesh_report().unwrap().implausible_size;
        let is_as_expected = match (size, size_m) {
            (Some(size), Some(expected)) => {
                (size.size_m / expected - 1.0).abs() < 0.01 && (size.factor / factor - 1.0).abs() < 1e-9
            }
            (size, expected) => size.is_none() && expected.is_none(),
        };
        assert!(is_as_expected, "{scale}: {size:?}");
        app.world_mut().despawn(entity);
    }
    for scale in [0.0, -1.0, f64::NAN] {
        let shape = MeshShape { metres_per_unit: scale, ..MeshShape::new(mesh.clone()) };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 1);
        let kinds = take_kinds(&mut app);
        let [HapticFaultKind::Mesh(MeshFault::Scale(reported))] = kinds[..] else { panic!("{kinds:?}") };
        assert_eq!(reported.to_bits(), scale.to_bits());
    }
    let cases: [(usize, Expected); 3] = [
        (0, |kind| matches!(mesh_error(kind), Some(MeshError::Cells { .. }))),
        (1000, |kind| matches!(mesh_error(kind), Some(MeshError::Cells { .. }))),
        (100, |kind| matches!(mesh_error(kind), Some(MeshError::TooManyNodes { along: 100, .. }))),
    ];
    for (cells_along, is_expected) in cases {
        let shape = MeshShape {
            cells: MeshCellSize::Along(cells_along),
            metres_per_unit: 0.001,
            ..MeshShape::new(mesh.clone())
        };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 1);
        let kinds = take_kinds(&mut app);
        assert!(kinds.len() == 1 && is_expected(&kinds[0]), "{cells_along}: {kinds:?}");
    }
}

/// Far from the origin, single precision loses as many digits in millimetres as in metres.
#[test]
fn lost_digits_are_detected_for_every_unit() {
    for (away_mm, is_accepted) in [(0.0, true), (1e4, true), (3e6, false), (1e8, false)] {
        let mut app = app();
        let far = ball().scaled_by(Vec3::splat(1000.0)).translated_by(Vec3::X * away_mm);
        let mesh = add(&mut app, far);
        let shape = MeshShape { metres_per_unit: 0.001, ..MeshShape::new(mesh) };
        let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
        step(&mut app, 2);
        let kinds = take_kinds(&mut app);
        assert_eq!(kinds.is_empty(), is_accepted, "{away_mm} mm: {kinds:?}");
        let is_expected = |kind: &HapticFaultKind| {
            matches!(mesh_error(kind), Some(MeshError::LostDigits { .. } | MeshError::CoarseGrid { .. }))
        };
        assert!(kinds.iter().all(is_expected), "{away_mm} mm: {kinds:?}");
        assert_eq!(body(&app, entity).is_some(), is_accepted);
    }
}

#[test]
fn mesh_report_has_repairs_cells_and_excess_mass() {
    let mut app = app();
    let entity = spawn(&mut app, inside_out(box_at(Vec3::ZERO, 0.12)));
    let of_block = app.world_mut().spawn(DeformableBody::block([3; 3], 0.1)).id();
    step(&mut app, 2);
    assert_no_faults(&mut app);
    let report = body(&app, entity).unwrap().mesh_report().unwrap();
    assert_eq!((report.repairs.turned, report.cells.cells, report.cells.raised), (12, 512, 0));
    assert!((report.cells.cell_m - 0.015).abs() < 1e-8 && report.deviation_m < 1e-6, "{report:?}");
    assert_eq!(body(&app, of_block).unwrap().mesh_report(), None);
    // A sheet of a twentieth of a millimetre in cells of a centimetre has twice its mass, which is reported.
    let sheet = cuboid(Vec3::new(-0.05, 0.0, -0.05), Vec3::new(0.05, 5e-5, 0.05));
    let mesh = add(&mut app, sheet);
    let shape = MeshShape { cells: MeshCellSize::Along(10), ..MeshShape::new(mesh) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    let [HapticFaultKind::MassExcess { share, .. }] = kinds[..] else { panic!("{kinds:?}") };
    assert!((share - 1.0).abs() < 1e-4, "{share}");
    let simulated = body(&app, entity).unwrap();
    let mass_kg: f64 = simulated.body().network().mass_kg().iter().sum();
    assert!((mass_kg / (1000.0 * 0.1 * 0.1 * 5e-5) - 2.0).abs() < 1e-4, "{mass_kg} kg");
    assert!((simulated.mesh_report().unwrap().cells.raised_share - 1.0).abs() < 1e-4);
    // Another tissue of the same mesh is not reported again.
    app.world_mut().get_mut::<Tissue>(entity).unwrap().youngs_modulus_pa = 30e3;
    step(&mut app, 3);
    assert_no_faults(&mut app);
}
