//! Odd meshes in an app, in lock step: each gives a body, or a fault that says what to do.

use bevy::asset::RenderAssetUsages;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_palpate::SimulatedBody;
use bevy_palpate::prelude::*;
use palpate_tests::app::{step, take_faults};
use palpate_tests::mesh::{
    RADIUS, add, ball, body, both, cuboid, mesh_app as app, mesh_of, shown, spawn, torn,
};

/// A box of `edge` round `at`.
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

/// Two boxes side by side with one wall between them: at its edges three triangles meet.
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

#[test]
fn meshes_that_make_no_body_are_faults_that_say_what_to_do() {
    let usage = RenderAssetUsages::default();
    let lines = Mesh::new(PrimitiveTopology::LineList, usage);
    let bare = Mesh::new(PrimitiveTopology::TriangleList, usage);
    let of_units = |scale: f32| ball().scaled_by(Vec3::splat(scale));
    let at_x = |x: f32| ball().translated_by(Vec3::X * x);
    let squashed = ball().scaled_by(Vec3::new(1.0, 0.0, 1.0));
    let pair = both(box_at(Vec3::ZERO, 0.06), &box_at(Vec3::new(0.03, 0.02, 0.01), 0.06));
    let apart = both(box_at(Vec3::Y * -0.05, 0.05), &box_at(Vec3::Y * 0.08, 0.05));
    let nested = both(box_at(Vec3::ZERO, 0.12), &box_at(Vec3::ZERO, 0.04));
    for (what, mesh, says) in [
        ("lines", lines, "TriangleList"),
        ("no positions", bare, "no positions"),
        ("an open square", Rectangle::new(0.1, 0.1).mesh().build(), "fill them"),
        ("a hole", torn(ball()), "fill them"),
        ("no thickness", squashed, "give it a volume"),
        ("parts that cross", pair, "unite the parts"),
        ("an inner wall", with_inner_wall(), "remove inner walls"),
        ("millimetres", of_units(1e3), "Scale it by 0.001"),
        ("micrometres", of_units(1e6), "Scale it by 0.000001"),
        ("huge", of_units(1e12), "Scale it by"),
        ("tiny", of_units(1e-3), "Scale it by 1000"),
        ("next to nothing", Sphere::new(1e-5).mesh().ico(2).unwrap(), "metres"),
        ("not a number", with_corner([f32::NAN, 0.0, 0.1]), "not a finite number"),
        ("infinite", with_corner([0.0, f32::INFINITY, 0.1]), "not a finite number"),
        ("a shell in a shell", nested, "turn it inside out"),
        ("two pieces", apart, "make a body of each"),
        ("far away", at_x(1e5), "move it to the origin"),
        ("too far for its cells", at_x(3000.0), "move it to the origin"),
    ] {
        let mut app = app();
        let entity = spawn(&mut app, mesh);
        step(&mut app, 3);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains(says), "{what}: {said:?}");
        assert!(app.world().get::<SimulatedBody>(entity).is_none(), "{what}");
    }
}

#[test]
fn odd_meshes_that_enclose_a_volume_are_bodies_of_its_mass() {
    let apart = both(box_at(Vec3::Y * -0.05, 0.05), &box_at(Vec3::Y * 0.08, 0.05));
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
        ("in two pieces that may float", apart, 2.0 * 0.05_f64.powi(3)),
        ("pinched at an edge", at_an_edge, 2.0 * 0.06_f64.powi(3)),
        ("ten metres away", box_at(Vec3::X * 10.0, 0.1), 1e-3),
        ("given twice", both(box_at(Vec3::ZERO, 0.1), &box_at(Vec3::ZERO, 0.1)), 1e-3),
    ] {
        let mut app = app();
        let mesh = add(&mut app, mesh);
        let entity = app.world_mut().spawn(DeformableBody::from_mesh(mesh)).id();
        step(&mut app, 5);
        assert_eq!(take_faults(&mut app), [""; 0], "{what}");
        let mass_kg: f64 = body(&app, entity).unwrap().body().network().mass_kg().iter().sum();
        assert!((mass_kg / (1000.0 * volume_m3) - 1.0).abs() < 1e-4, "{what}: {mass_kg} kg");
    }
}

#[test]
fn what_the_message_says_helps() {
    let mut app = app();
    let mesh = add(&mut app, ball().scaled_by(Vec3::splat(1000.0)));
    let shape = MeshShape { metres_per_unit: 0.001, ..MeshShape::new(mesh.clone()) };
    let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0]);
    assert!(shown(&app, entity, false).iter().all(|x| (f64::from(x.length()) - RADIUS).abs() < 1e-5));
    for scale in [0.0, -1.0, f64::NAN] {
        let shape = MeshShape { metres_per_unit: scale, ..MeshShape::new(mesh.clone()) };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 1);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains("scaled by"), "{said:?}");
    }
    for (cells_along, says) in
        [(0, "it must be 1 to 127"), (1000, "it must be 1 to 127"), (100, "cells along it")]
    {
        let shape = MeshShape {
            cells_along_longest_axis: cells_along,
            metres_per_unit: 0.001,
            ..MeshShape::new(mesh.clone())
        };
        app.world_mut().spawn(DeformableBody::Mesh(shape));
        step(&mut app, 1);
        let said = take_faults(&mut app);
        assert!(said.len() == 1 && said[0].contains(says), "{said:?}");
    }
}

/// In millimetres and far from the origin, single precision loses as many digits as in metres.
#[test]
fn lost_digits_are_noticed_whatever_the_unit() {
    for (away_mm, is_taken) in [(0.0, true), (1e4, true), (3e6, false), (1e8, false)] {
        let mut app = app();
        let far = ball().scaled_by(Vec3::splat(1000.0)).translated_by(Vec3::X * away_mm);
        let mesh = add(&mut app, far);
        let shape = MeshShape { metres_per_unit: 0.001, ..MeshShape::new(mesh) };
        let entity = app.world_mut().spawn(DeformableBody::Mesh(shape)).id();
        step(&mut app, 2);
        let said = take_faults(&mut app);
        assert_eq!(said.is_empty(), is_taken, "{away_mm} mm: {said:?}");
        assert!(said.iter().all(|said| said.contains("move it to the origin")), "{away_mm} mm: {said:?}");
        assert_eq!(body(&app, entity).is_some(), is_taken);
    }
}

#[test]
fn what_became_of_a_mesh_can_be_asked() {
    let mut app = app();
    let entity = spawn(&mut app, inside_out(box_at(Vec3::ZERO, 0.12)));
    let of_block = app.world_mut().spawn(DeformableBody::block([3; 3], 0.1)).id();
    step(&mut app, 2);
    assert_eq!(take_faults(&mut app), [""; 0]);
    let report = body(&app, entity).unwrap().mesh_report().unwrap();
    assert_eq!((report.repairs.turned, report.cells.cells, report.cells.raised), (12, 512, 0));
    assert!((report.cells.cell_m - 0.015).abs() < 1e-8 && report.deviation_m < 1e-6, "{report:?}");
    assert_eq!(body(&app, of_block).unwrap().mesh_report(), None);
    // A sheet of a twentieth of a millimetre in cells of a centimetre: said, for it weighs twice what it should.
    let sheet = cuboid(Vec3::new(-0.05, 0.0, -0.05), Vec3::new(0.05, 5e-5, 0.05));
    let mesh = add(&mut app, sheet);
    let entity = app.world_mut().spawn(DeformableBody::from_mesh(mesh)).id();
    step(&mut app, 3);
    let said = take_faults(&mut app);
    assert!(said.len() == 1 && said[0].contains("100.0 % heavier"), "{said:?}");
    let simulated = body(&app, entity).unwrap();
    let mass_kg: f64 = simulated.body().network().mass_kg().iter().sum();
    assert!((mass_kg / (1000.0 * 0.1 * 0.1 * 5e-5) - 2.0).abs() < 1e-4, "{mass_kg} kg");
    assert!((simulated.mesh_report().unwrap().cells.raised_share - 1.0).abs() < 1e-4);
    // Of another tissue it is the same mesh: nothing new to say.
    app.world_mut().get_mut::<Tissue>(entity).unwrap().youngs_modulus_pa = 30e3;
    step(&mut app, 3);
    assert_eq!(take_faults(&mut app), [""; 0]);
}
