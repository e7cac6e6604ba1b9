//! Meshes that change under their bodies, in lock step: during contact, to an invalid mesh, and back.

use bevy::mesh::{Mesh, VertexAttributeValues};
use bevy::prelude::*;
use bevy_palpate::prelude::*;
use bevy_palpate::{HapticFaultKind, NoForceCause};
use palpate_body::{BodyError, MeshError};
use palpate_tests::app::Contact::{End, Start};
use palpate_tests::app::{assert_no_faults, contacts, step, take_causes, take_faults, take_kinds};
use palpate_tests::mesh::{
    RADIUS, add, ball, body, force, hand, mesh_app as app, replace, shown, spawn_of, torn,
};

/// A ball of fewer triangles.
fn coarser() -> Mesh {
    Sphere::new(RADIUS as f32).mesh().ico(12).unwrap()
}

fn is_a_ball(app: &App, entity: Entity, vertices: usize) -> bool {
    let (x, n) = (shown(app, entity, false), shown(app, entity, true));
    x.len() == vertices
        && n.len() == vertices
        && x.iter()
            .zip(&n)
            .all(|(x, n)| (f64::from(x.length()) - RADIUS).abs() < 1e-4 && n.dot(x.normalize()) > 0.9)
}

#[test]
fn mesh_change_during_contact_ends_the_contact() {
    let mut app = app();
    let mesh = add(&mut app, ball());
    let entity = spawn_of(&mut app, mesh.clone());
    let tool = hand(&mut app);
    step(&mut app, 15);
    let before = force(&app, tool);
    assert!(before.y > 0.5, "{before}");
    let epoch = body(&app, entity).unwrap().epoch();
    replace(&mut app, &mesh, coarser());
    let mut strongest: f64 = 0.0;
    for _ in 0..40 {
        step(&mut app, 1);
        strongest = strongest.max(force(&app, tool).length());
        assert!(force(&app, tool).is_finite());
    }
    assert!(body(&app, entity).unwrap().epoch() > epoch);
    // The change does not raise the force.
    assert!(strongest < 1.5 * before.length(), "{strongest} N, {before} before");
    assert_eq!(contacts(&app)[..2], [Start, End]);
    assert_eq!(shown(&app, entity, false).len(), coarser().count_vertices());
    // The new ball is undeformed, with the tool's centre inside.
    assert_eq!(take_causes(&mut app), [(tool, NoForceCause::Inside { body: entity })]);
    assert_eq!(take_faults(&mut app).len(), 1);
}

#[test]
fn rejected_mesh_change_keeps_the_drawn_mesh() {
    let mut app = app();
    let red = |mesh: Mesh| {
        let vertices = mesh.count_vertices();
        mesh.with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[1.0, 0.0, 0.0, 1.0]; vertices])
    };
    let mesh = add(&mut app, red(ball()));
    let entity = spawn_of(&mut app, mesh.clone());
    step(&mut app, 2);
    let vertices = ball().count_vertices();
    assert!(is_a_ball(&app, entity, vertices));
    replace(&mut app, &mesh, torn(coarser()));
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    let is_holes =
        matches!(kinds[..], [HapticFaultKind::BuildBody(BodyError::Mesh(MeshError::Holes { .. }))]);
    assert!(is_holes, "{kinds:?}");
    assert!(is_a_ball(&app, entity, vertices));
    // Another fixed region rebuilds the body from the previous mesh, with its colours.
    app.world_mut().entity_mut(entity).insert(FixedRegion::Face(BoxFace::Bottom));
    step(&mut app, 3);
    assert_no_faults(&mut app);
    assert!(is_a_ball(&app, entity, vertices));
    let drawn = app.world().get::<Mesh3d>(entity).unwrap().0.clone();
    let drawn = app.world().resource::<Assets<Mesh>>().get(&drawn).unwrap();
    assert!(drawn.indices().unwrap().iter().all(|index| index < vertices));
    let Some(VertexAttributeValues::Float32x4(colors)) = drawn.attribute(Mesh::ATTRIBUTE_COLOR) else {
        panic!("no colours")
    };
    assert!(colors.iter().all(|color| *color == [1.0, 0.0, 0.0, 1.0]) && colors.len() == vertices);
    // A valid mesh is accepted without any other change.
    replace(&mut app, &mesh, coarser());
    step(&mut app, 3);
    assert_no_faults(&mut app);
    assert!(is_a_ball(&app, entity, coarser().count_vertices()));
}

/// A mesh is not rejected for the sake of another component.
#[test]
fn mesh_change_with_an_invalid_tissue_is_built_with_the_next_tissue() {
    let mut app = app();
    let mesh = add(&mut app, ball());
    let entity = spawn_of(&mut app, mesh.clone());
    step(&mut app, 2);
    replace(&mut app, &mesh, coarser());
    app.update();
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = -1.0;
    step(&mut app, 3);
    let kinds = take_kinds(&mut app);
    let is_density = |kind: &HapticFaultKind| {
        matches!(kind, HapticFaultKind::BuildBody(BodyError::Parameter { value: -1.0, .. }))
    };
    assert!(!kinds.is_empty() && kinds.iter().all(is_density), "{kinds:?}");
    app.world_mut().get_mut::<Tissue>(entity).unwrap().density_kg_per_m3 = 900.0;
    step(&mut app, 3);
    assert_no_faults(&mut app);
    assert!(is_a_ball(&app, entity, coarser().count_vertices()));
}
